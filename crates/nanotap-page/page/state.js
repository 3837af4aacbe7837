// The state of the page, and the address that contains all of it: a link reproduces a view.

const empty = () => ({
  view: "states",             // the part of the page that is shown
  lang: "",                   // the language of the page's words; empty: the browser's
  preset: "",                 // the case from which the values start, if it is one of the list
  case: "",                   // or its file, as a link contains it: see link.js
  set: {},                    // keys of the case that differ from it: key -> text
  start: "",                  // state at drive phase 0 from which the motion is computed
  compare: "",                // state that is compared with the chosen one
  follow: "",                 // "yes": a changed parameter continues from the displayed motion
  tab: "approach",
  lesson: "",                 // a guided start whose words are shown; or a lesson of the lecture and its step
  lecture: "",                // a lecturer's own lesson, as a link contains it
  steps: 0,                   // Runge-Kutta steps per period of the motion for comparison; 0: none
  study: {},                  // fields of the study's form: name -> text
  ran: "",                    // "yes": the study was computed
  plan: {},                   // what is wished in the view Plan: name -> text
  views: {},                  // visible ranges of figures: name -> list of {panel, x, y}
});

export const state = empty();

/** Texts of opened case files, by their code in a link; and their names. */
export const texts = new Map();
export const names = new Map();

/** Preset or opened file that the case starts from. */
export const basis = () => state.case || state.preset;

const FIELDS = ["view", "lang", "preset", "case", "lesson", "lecture", "start", "compare", "follow", "tab", "steps", "ran"];
/** Fields of a link that only the view of the studies shows. */
const OF_STUDIES = ["tab", "ran", "steps"];

/** The fragment of the address for `state`; some fields may have other values. */
export function encoded(other = {}) {
  const words = new URLSearchParams();
  for (const name of FIELDS) {
    const value = other[name] ?? state[name];
    const hidden = value === empty()[name] || (OF_STUDIES.includes(name) && !["studies", "data"].includes(state.view));
    if (value && !hidden) words.set(name, value);
  }
  for (const [key, value] of Object.entries(state.set)) words.set(`set.${key}`, value);
  for (const [key, value] of Object.entries(state.study)) words.set(`study.${key}`, value);
  for (const [key, value] of Object.entries(state.plan)) words.set(`plan.${key}`, value);
  for (const [name, views] of Object.entries(state.views)) {
    for (const { panel, x, y } of views) words.set(`view.${name}.${panel}`, [...x, ...y].join(","));
  }
  return words.toString();
}

/** Reads the state from the address. */
export function decode(fragment) {
  Object.assign(state, empty());
  const given = new URLSearchParams(fragment.replace(/^#/, ""));
  // Links of nanotap 0.2 name no view: theirs was that of the studies.
  if (!given.has("view") && OF_STUDIES.some((name) => given.has(name))) state.view = "studies";
  for (const [name, value] of given) {
    if (name.startsWith("set.")) state.set[name.slice(4)] = value;
    else if (name.startsWith("study.")) state.study[name.slice(6)] = value;
    else if (name.startsWith("plan.")) state.plan[name.slice(5)] = value;
    else if (name.startsWith("view.")) view(name.slice(5).split("."), value.split(",").map(Number));
    else if (name === "steps") state.steps = Math.max(0, Math.min(4000, Number(value) || 0));
    else if (FIELDS.includes(name)) state[name] = value;
  }
}

function view([name, panel], numbers) {
  if (numbers.length !== 4 || !numbers.every(Number.isFinite) || !/^\d+$/.test(panel)) return;
  (state.views[name] ??= []).push({ panel: Number(panel), x: numbers.slice(0, 2), y: numbers.slice(2) });
}

/** Writes the address: a new entry of the history for a completed change, otherwise in place.
 *  Returns whether there is a new entry. */
export function remember(finished) {
  const address = `${location.pathname}${location.search}#${encoded()}`;
  if (address === `${location.pathname}${location.search}${location.hash}`) return false;
  if (finished) history.pushState(null, "", address);
  else history.replaceState(null, "", address);
  return finished;
}

/** The chosen state: its row, its case, and the changes that put its distance in place of the setpoint. */
export const chosen = { row: null, of: "", set: null };

/** Keys that place the tip: the setpoint and the distance, with and without units. */
export const DISTANCES = ["drive.setpoint", "gap.tip", "gap.beam", "alpha5", "gap"];

let base = { of: "", values: new Map() };

/** Takes what a case states, from its keys without changes. */
export function takeBase(of, { set }, keys) {
  if (!set.length) base = { of, values: new Map(keys.filter((key) => key.stated).map((key) => [key.name, key.value])) };
}

/** States a value, in place of all that says the same. The case's own value is no change. */
export function put(name, text, alternatives = []) {
  for (const other of alternatives) delete state.set[other];
  if (text !== "" && base.of === basis() && base.values.get(name) === text) delete state.set[name];
  else state.set[name] = text;
}

/** The text of a stated value, if it is known. */
export const statedText = (name) => state.set[name] ?? (base.of === basis() ? base.values.get(name) : undefined);

/** The case as a text, for comparison; without some keys. */
export function caseText(without = []) {
  const kept = Object.entries(state.set).filter(([key]) => !without.includes(key)).sort();
  return JSON.stringify([basis(), kept]);
}

/** The case as a request contains it, with the distance of a state in place of its setpoint, if given. */
export function theCase(distance = null) {
  const values = { ...state.set, ...distance };
  if (distance) delete values["drive.setpoint"];
  const set = Object.entries(values).map(([key, value]) => `${key}=${value}`);
  return state.case ? { text: texts.get(state.case), set } : { preset: state.preset, set };
}

/** Whether the case stands at the distance of a chosen state, in place of its setpoint. */
export const atChosen = () => Boolean(chosen.set) && chosen.of === caseText();

/** The case at the distance of the chosen state. */
export const thatCase = () => theCase(atChosen() ? chosen.set : null);
