// What the page shows, and the address that holds all of it: a link reproduces a view.

export const state = {
  preset: "",                 // which case the values start from
  set: {},                    // keys of the case that differ from it: key -> text
  start: "",                  // state at drive phase 0 from which the motion is looked for
  tab: "diagram",
  steps: 0,                   // Runge-Kutta steps a period of the motion beside; 0: none
  study: {},                  // fields of the study's form: name -> text
};

const FIELDS = ["preset", "start", "tab", "steps"];

/** The fragment of the address that says all of `state`. */
export function encoded() {
  const words = new URLSearchParams();
  for (const name of FIELDS) if (state[name]) words.set(name, state[name]);
  for (const [key, value] of Object.entries(state.set)) words.set(`set.${key}`, value);
  for (const [key, value] of Object.entries(state.study)) words.set(`study.${key}`, value);
  return words.toString();
}

/** Takes over what the address says. */
export function decode(fragment) {
  const words = new URLSearchParams(fragment.replace(/^#/, ""));
  Object.assign(state, { preset: "", set: {}, start: "", tab: "diagram", steps: 0, study: {} });
  for (const [name, value] of words) {
    if (name.startsWith("set.")) state.set[name.slice(4)] = value;
    else if (name.startsWith("study.")) state.study[name.slice(6)] = value;
    else if (name === "steps") state.steps = Math.max(0, Math.min(4000, Number(value) || 0));
    else if (FIELDS.includes(name)) state[name] = value;
  }
}

/** Writes the address: a new entry of the history for a finished change, else in place. */
export function remember(finished) {
  const address = `${location.pathname}${location.search}#${encoded()}`;
  if (finished && address !== `${location.pathname}${location.search}${location.hash}`) history.pushState(null, "", address);
  else history.replaceState(null, "", address);
}

/** The case as the server takes it. */
export function theCase() {
  return { preset: state.preset, set: Object.entries(state.set).map(([key, value]) => `${key}=${value}`) };
}
