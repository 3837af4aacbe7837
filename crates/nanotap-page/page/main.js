// The page: what is set on the left, the chosen view on the right, and the displayed motion in detail below.

import { state, atChosen, basis, caseText, chosen, decode, names, remember, takeBase, texts, thatCase, theCase } from "./state.js";
import { ask, bytes, save, stop, superseded } from "./api.js";
import { fill, local, other, quantity, sentences, speak, t } from "./words.js";
import { make } from "./element.js";
import * as notice from "./notice.js";
import * as quick from "./set.js";
import * as states from "./states.js";
import * as plan from "./plan.js";
import * as scan from "./scan.js";
import * as knobs from "./knobs.js";
import * as lever from "./lever.js";
import * as figure from "./figure.js";
import * as study from "./study.js";
import * as lecture from "./lecture.js";
import * as link from "./link.js";
import * as offline from "./offline.js";

const $ = (id) => document.getElementById(id);
const FIRST = { "drive.setpoint": "0.8" }; // what the first example holds, as an instrument does
const BUSY_DELAY = 300;        // milliseconds before the page shows that it computes
const PATIENCE = 1000;         // milliseconds after which a motion gives way to a newer one
const CALM = 700;              // milliseconds without a change before coexisting motions are searched
const SAME = 1e-4;             // relative difference of amplitudes below which a listed motion is the displayed one
/** Guided starts, whose words are `guides`: their addresses. */
const GUIDES = {
  bistable: "view=studies&preset=dmt",
  phase: "view=studies&preset=dmt&set.gap.tip=24+nm",
  doubling: "preset=paper&tab=diagram&ran=yes&study.key=omega&study.from=2.4&study.to=3.1",
  image: "view=studies&preset=patch&tab=image&ran=yes",
  step: "preset=paper&steps=80",
  plan: "preset=dmt&tab=plan&ran=yes&study.force=4+nN",
};
const OPEN = "open";           // the entry of the list that opens a case file
let about = null;
let outdated = false;         // a value changed while a motion was being computed
let underway = false;
let moving = false;           // a slider is being moved
let epoch = 0;                // counts links, clicks and cases: answers for earlier ones are dropped
let displayed = null;         // the displayed motion: its case and its start
let found = null;             // the case of the listed motions
let calm = 0;                 // the timer of the search of coexisting motions
let amplitude = NaN;          // of the displayed motion
let searching = null;         // the case of the motions that are being searched
let steps = 0;                // entries of the history that can be undone

/** Says what is wrong with the values; an answer to good ones ends it. What is wrong with a file stays until the
 *  user goes on. */
export function say(error, ofFile = false) {
  const message = $("message");
  if (!error && message.dataset.of === "file") return;
  message.dataset.of = ofFile ? "file" : "values";
  message.hidden = !error;
  message.textContent = local(error?.message ?? "");
  knobs.mark(error?.keys ?? []);
}

/** The user goes on: nothing is wrong until it is found again. */
function goOn() {
  delete $("message").dataset.of;
  say(null);
}

/** Marks the displayed motion as one of other values, or not. */
function stale(is) { document.body.classList.toggle("other", is); }

/** Requests the motion for the present values. While one is being computed the next one waits, so that a
 *  dragged slider shows as many motions as can be computed, and finally the last one; one that takes
 *  long gives way. */
export async function refresh() {
  outdated = true;
  if (underway) return;
  underway = true;
  document.body.dataset.busy = "yes";
  const busyTimer = setTimeout(() => { $("busy").textContent = t("busy"); stale(true); }, BUSY_DELAY);
  let next = request();
  while (next) {
    const { wish, motion, error } = await next;
    // The next motion is computed while this one is drawn.
    next = outdated && !follows() ? request() : null;
    if (wish.epoch !== epoch) { /* dropped */ }
    else if (motion) {
      say(null);
      show(motion, wish);
    } else if (!superseded(error)) { say(error); stale(true); }
    if (!next && outdated) next = request();
  }
  clearTimeout(busyTimer);
  $("busy").textContent = "";
  document.body.dataset.busy = "no";
  underway = false;
}

const follows = () => state.follow === "yes" && state.view !== "states" && displayed !== null && displayed.epoch === epoch;

/** The motion for the present values, or the reason why there is none. */
function request() {
  outdated = false;
  const wish = { case: thatCase(), start: state.start, steps: state.steps, ranges: !moving };
  if (follows() && caseText() !== displayed.text) Object.assign(wish, { from: displayed.case, start: displayed.start });
  const asked = { ...wish, epoch, text: caseText(), basis: basis(), changes: Object.keys(state.set), placed: atChosen() };
  const patience = setInterval(() => { if (outdated || asked.epoch !== epoch) stop("motion"); }, PATIENCE);
  const answer = ask("motion", "/api/motion", wish);
  return answer.then((motion) => ({ wish: asked, motion }), (error) => ({ wish: asked, error }))
    .finally(() => clearInterval(patience));
}

/** The visible ranges of the motion's figures. */
function motionViews() {
  return Object.fromEntries(["contact", "portrait"].filter((name) => state.views[name]?.length).map((name) => [name, state.views[name]]));
}

function show(motion, wish) {
  displayed = { case: wish.case, text: wish.text, start: motion.start, epoch };
  if (wish.from && !outdated) {
    // A link starts where the followed motion is.
    state.start = motion.start;
    remember(false);
  }
  stale(false);
  if (wish.placed) motion.keys = atSetpoint(motion.keys);
  takeBase(wish.basis, { set: wish.changes }, motion.keys);
  knobs.follows(motion.readout);
  knobs.show(motion.keys, moving);
  quick.show(motion.keys, states.about());
  plan.show(motion.keys);
  $("summary").textContent = local(`${motion.title}: ${motion.summary}`);
  figure.put($("portrait"), motion.figure);
  figure.put($("contact"), motion.contact);
  lever.show(motion.film);
  amplitude = motion.observables.find((row) => row.name === "amplitude")?.value;
  table(motion.observables);
  readout(motion);
  $("remarks").textContent = local(motion.remarks.join(" · "));
  $("spurious").textContent = motion.fixed_step ? local(motion.fixed_step.words) : t("motion.off");
  $("fixed").hidden = !motion.fixed_step?.figure;
  if (motion.fixed_step?.figure) figure.put($("fixed"), motion.fixed_step.figure);
  else figure.clear($("fixed"));
  $("command").textContent = motion.command;
  $("python").textContent = motion.python;
  if (!["studies", "data"].includes(state.view)) return;
  markCensus();
  soon();
  if (!moving) study.fill(motion);
  else study.follow(motion);
}

/** The keys of a case at a setpoint: the motion is one at the distance of the chosen state, but what is stated is
 *  the setpoint. The answer may come after the setpoint has moved further, but not after a distance replaced it. */
function atSetpoint(keys) {
  if ("gap.tip" in state.set) return keys;
  const { held } = states.about();
  const said = state.set["drive.setpoint"] ?? (held?.kind === "amplitude" ? String(held.value) : held?.shown ?? "");
  const number = Number(said);
  const of = { "gap.tip": { stated: false }, "gap.beam": { stated: "gap.beam" in state.set } };
  of["drive.setpoint"] = { stated: true, value: said, number: Number.isFinite(number) ? number : null, unit: "", slider: Number.isFinite(number) ? { from: 0.05, to: 0.995, log: false } : null };
  return keys.map((key) => ({ ...key, ...of[key.name] }));
}

/** What one wants to know first. */
function readout(motion) {
  const lines = motion.readout.lines.map((line) => [line.name, quantity(line.name, line.words, "readout"), line.shown]);
  if (motion.distance) lines.unshift(["distance", t("motion.distance"), motion.distance]);
  lines.push(["regime", t("motion.regime"), t("states.names")[motion.readout.regime]?.toLowerCase() ?? motion.readout.regime]);
  $("readout").replaceChildren(...lines.flatMap(([name, words, shown]) => {
    const [title, value] = ["dt", "dd"].map((tag) => document.createElement(tag));
    title.textContent = words;
    value.textContent = local(shown);
    value.dataset.read = name;
    return [title, value];
  }));
  $("regime").textContent = sentences(motion.readout.words);
}

/** Values change in place; lines are recreated if the set of observables changes. */
function table(rows) {
  const body = $("observables").tBodies[0];
  const names = [document.documentElement.lang, ...rows.map((row) => row.name)].join();
  if (body.dataset.names !== names) {
    body.dataset.names = names;
    body.replaceChildren(...rows.map((row) => {
      const line = document.createElement("tr");
      const name = document.createElement("th");
      name.scope = "row";
      name.textContent = quantity(row.name, row.words);
      const value = document.createElement("td");
      value.dataset.observable = row.name;
      line.append(name, value);
      return line;
    }));
  }
  rows.forEach((row, k) => {
    const value = body.rows[k].cells[1];
    value.textContent = local(row.shown);
    value.dataset.value = row.value;
  });
}

/** What the listed motions are of. */
const searched = () => caseText() + $("unstable").checked;

/** Searches the coexisting motions when the values rest. */
function soon() {
  clearTimeout(calm);
  if (state.view === "studies" && !moving && found?.of !== searched() && searching !== searched()) calm = setTimeout(census, CALM);
}

/** Lists the coexisting motions. */
async function census() {
  const list = $("attractors");
  const own = searched();
  list.replaceChildren();
  found = null;
  $("bound").textContent = t("states.searching");
  searching = own;
  try {
    const answer = await ask("census", "/api/attractors", { case: thatCase(), unstable: $("unstable").checked });
    if (searched() !== own) return;
    searching = null;
    found = { of: own, bound: answer.bound, stable: answer.motions.filter((one) => one.stable !== false).length };
    list.replaceChildren(...answer.motions.map((one) => {
      const item = document.createElement("li");
      const button = document.createElement("button");
      button.type = "button";
      button.textContent = local(`${one.words}, ${one.shown}`);
      button.dataset.amplitude = one.amplitude;
      button.addEventListener("click", () => {
        state.start = one.start;
        remembered();
        elsewhere();
      });
      item.append(button);
      return item;
    }));
    markCensus();
  } catch (error) {
    if (superseded(error)) return;
    searching = null;
    $("bound").textContent = local(error.message);
  }
}

/** Ends the search of coexisting motions. */
function noCensus() {
  clearTimeout(calm);
  stop("census");
  if (searching) $("bound").textContent = "";
  searching = null;
}

/** The listed motions belong to one case only; a search for those of another one ends. */
function markCensus() {
  if (searching !== null && searching !== searched()) noCensus();
  $("states-here").textContent = "";
  if (!found) return;
  const other = searched() !== found.of;
  if (!other && found.stable > 1) $("states-here").textContent = t("motion.several", { count: found.stable });
  $("attractors").classList.toggle("stale", other);
  for (const button of $("attractors").querySelectorAll("button")) {
    const own = Number(button.dataset.amplitude);
    button.disabled = other;
    button.setAttribute("aria-pressed", String(!other && Math.abs(own - amplitude) <= SAME * own));
  }
  $("bound").textContent = other ? t("states.ofFormer") : local(found.bound);
}

/** Another motion than one that continues the displayed one. */
function elsewhere() {
  epoch += 1;
  refresh();
}

function remembered() {
  if (remember(true)) steps += 1;
  $("undo").disabled = steps <= 0;
}

async function exported(format) {
  const blob = await bytes("export", "/api/export", { case: thatCase(), start: state.start, views: motionViews(), figure: $("which").value, format });
  save(blob, format === "toml" ? "case.toml" : format === "csv" ? "motion.csv" : `${$("which").value}.${format}`);
}

/** Another case, without changes: one of the list, or an opened file. */
function fresh(name) {
  const chosen = texts.has(name) ? { preset: "", case: name } : { preset: name, case: "" };
  Object.assign(state, { ...chosen, set: {}, start: "", compare: "", study: {}, ran: "", views: {}, lesson: "" });
  goOn();
  remembered();
  takeOver();
}

async function openFiles(files) {
  try {
    if (files.length) fresh(await link.open(files));
  } catch (error) { if (!superseded(error)) say(error, true); }
}

/** Shows which case it is; an opened file comes into the list. */
function list() {
  const own = $("yours");
  if (state.case && ![...own.children].some((one) => one.value === state.case)) own.append(new Option(names.get(state.case), state.case));
  own.hidden = !own.children.length;
  $("preset").value = basis();
}

async function takeOver() {
  const address = location.hash;
  let wrong = await link.read(new URLSearchParams(address.slice(1)).get("case"));
  if (address !== location.hash) return;
  const before = basis();
  decode(wrong ? "" : address);
  if (state.case) state.preset = "";
  else if (!about.presets.some((p) => p.name === state.preset)) {
    if (state.preset && !wrong) wrong = t("fromLink.unknown", { version: about.version, name: state.preset });
    state.preset = about.presets[0].name;
    // The first example answers the first question: the states at a setpoint.
    if (about.presets[0].name !== "file") state.set = { ...FIRST, ...state.set };
  }
  if (basis() !== before) found = null;
  Object.assign(chosen, { row: null, of: "", set: null });
  list();
  tongue();
  $("steps").value = state.steps;
  $("follow").checked = state.follow === "yes";
  $("note").textContent = wrong && `${wrong} ${t("fromLink.first")}`;
  const guide = Object.hasOwn(GUIDES, state.lesson) && t("guides")[state.lesson];
  $("lesson").hidden = !guide;
  $("lesson").firstElementChild.textContent = guide ? local(guide.join(". ")) : "";
  if (!found) { $("attractors").replaceChildren(); $("bound").textContent = ""; }
  notice.tell("");
  if (lecture.wanted()) { lecture.open(); return; }
  lecture.close(true);
  enter();
}

const VIEWS = {
  states: { enter: () => states.enter(), leave: () => states.leave(), changed: (finished) => states.changed(finished) },
  plan: { enter: () => { plan.enter(); elsewhere(); }, leave: () => plan.leave(), changed: (finished) => { plan.changed(finished); refresh(); } },
  scan: { enter: () => { scan.enter(); elsewhere(); }, leave: () => scan.leave(), changed: (finished) => { scan.changed(); if (finished) refresh(); } },
  data: { enter: () => bench("data"), leave: () => {}, changed: () => refresh() },
  studies: { enter: () => bench("studies"), leave: noCensus, changed: () => { markCensus(); refresh(); } },
};

/** Puts the form and figure of the studies into the view of all studies or that of measured data. */
function bench(view) {
  if (view === "data") { state.tab = "data"; $("view-data").append($("study")); } else $("middle").append($("study"));
  $("tabs").hidden = view === "data";
  markCensus();
  study.restore();
  elsewhere();
}
let entered = "";

/** Shows the view of the state. */
function enter() {
  if (!(state.view in VIEWS)) state.view = "states";
  if (entered && entered !== state.view) VIEWS[entered].leave();
  entered = state.view;
  document.body.dataset.view = entered;
  for (const name of Object.keys(VIEWS)) $(`view-${name}`).hidden = name !== entered;
  for (const button of $("views").children) {
    if (button.dataset.view === entered) button.setAttribute("aria-current", "page"); else button.removeAttribute("aria-current");
  }
  if (entered === "studies") $("all").open = true;
  $("detail").hidden = !["states", "studies"].includes(entered);
  $("detail").open = entered === "studies" || detailed;
  VIEWS[entered].enter();
}

let detailed = false;         // the details of a state are opened

/** Puts the words of the chosen language into the page. */
function tongue() {
  speak(state.lang || (navigator.language ?? "en").slice(0, 2));
  fill();
  document.title = t("title");
  for (const button of $("views").children) button.textContent = t(`views.${button.dataset.view}`);
  for (const option of $("preset").options) option.textContent = t("presets")[option.value] ?? option.textContent;
}

async function begin() {
  tongue();
  $("busy").textContent = t("loading");
  try {
    about = await ask("about", "/api/about");
  } catch (error) { say(error); return; } finally { $("busy").textContent = ""; }
  $("lead").title = `nanotap ${about.version}`;
  $("views").replaceChildren(...Object.keys(VIEWS).map((name) => {
    const button = make("button", { type: "button" });
    button.dataset.view = name;
    button.addEventListener("click", () => { if (state.view === name) return; state.view = name; remembered(); enter(); });
    return button;
  }));
  const groups = new Map();
  for (const preset of about.presets) {
    if (!groups.has(preset.group)) groups.set(preset.group, make("optgroup", { label: t("groups")[preset.group] ?? preset.group }));
    groups.get(preset.group).append(new Option(t("presets")[preset.name] ?? preset.words, preset.name));
  }
  const yours = make("optgroup", { id: "yours", label: t("opened") });
  $("preset").append(yours, ...groups.values(), new Option(t("openFile"), OPEN));
  $("lessons").append(...Object.entries(GUIDES).map(([name, address]) => {
    const item = document.createElement("li");
    const link = make("a", { href: `#${address}&lesson=${name}` });
    link.dataset.t = `guides.${name}.0`;
    item.append(link);
    return item;
  }));
  $("lessons").addEventListener("click", () => { $("learn").open = false; });
  $("lesson").lastElementChild.addEventListener("click", () => { state.lesson = ""; $("lesson").hidden = true; remember(true); });
  $("preset").addEventListener("change", () => {
    if ($("preset").value !== OPEN) { fresh($("preset").value); return; }
    list();
    $("open").click();
  });
  $("open").addEventListener("change", () => openFiles($("open").files));
  $("reset").addEventListener("click", () => fresh(basis()));
  $("undo").addEventListener("click", () => { steps -= 1; $("undo").disabled = steps <= 0; history.back(); });
  const onChange = (_, finished, note) => {
    moving = !finished;
    if ($("message").dataset.of === "file") goOn();
    if (note !== undefined) $("note").textContent = local(note);
    // While a slider moves, the address is not changed.
    if (finished) remembered();
    VIEWS[entered].changed(finished);
  };
  knobs.onChange(onChange, say);
  quick.begin(onChange, say);
  notice.begin();
  lecture.begin(() => { if (entered) VIEWS[entered].leave(); }, enter);
  $("lecture").addEventListener("click", () => { state.lesson = "list"; lecture.open(); });
  plan.begin(onChange, say, () => { state.view = "states"; remembered(); enter(); });
  states.begin((row, rests) => { say(null); if (row && rests) { moving = false; elsewhere(); } }, say);
  scan.begin({ refused: say, note: remembered, moved: refresh, states: () => { state.view = "states"; remembered(); enter(); } });
  $("detail").addEventListener("toggle", () => { if (state.view === "states") detailed = $("detail").open; });
  $("language").addEventListener("click", () => { state.lang = other(); remembered(); takeOver(); });
  $("save-case").addEventListener("click", () => exported("toml").catch(say));
  $("steps").addEventListener("change", () => { state.steps = Number($("steps").value) || 0; remembered(); refresh(); });
  $("follow").addEventListener("change", () => { state.follow = $("follow").checked ? "yes" : ""; remembered(); });
  $("unstable").addEventListener("change", () => { markCensus(); soon(); });
  for (const name of ["contact", "portrait"]) {
    figure.alive($(name), {
      views: () => state.views[name] ?? [],
      tell: (place) => { $("reading").textContent = place ? figure.words(place) : ""; },
      zoom: (views) => { state.views[name] = views; remembered(); },
    });
  }
  // The fragment of the address is the state.
  $("skip").addEventListener("click", (event) => { event.preventDefault(); $(state.view === "states" ? "states" : "view").focus(); });
  for (const button of document.querySelectorAll("[data-export]")) {
    button.addEventListener("click", () => exported(button.dataset.export).catch(say));
  }
  $("knobs").addEventListener("submit", (event) => event.preventDefault());
  addEventListener("popstate", takeOver);
  addEventListener("hashchange", takeOver);
  study.begin(() => { markCensus(); elsewhere(); }, about.studies, openFiles, () => {
    if (["studies", "data"].includes(state.view)) return;
    state.view = "data";
    remembered();
    enter();
  });
  $("share").addEventListener("click", () => link.share(basis() === "file").catch(say));
  $("link-close").addEventListener("click", () => $("link").close());
  offline.begin();
  takeOver();
}

begin();
