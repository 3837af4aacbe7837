// The page: knobs on the left, the motion in the middle, what coexists on the right, how it
// changes below.

import { state, decode, remember, theCase } from "./state.js";
import { ask, bytes, superseded } from "./api.js";
import * as knobs from "./knobs.js";
import * as lever from "./lever.js";
import * as figure from "./figure.js";
import * as study from "./study.js";

const $ = (id) => document.getElementById(id);
const OFF = "0: off. Few steps show motions that the equations do not have.";
let about = null;
let wanted = false;           // a change that came while a motion was under way
let underway = false;
let shown = "";               // the case whose knobs stand there

export function say(error) {
  const message = $("message");
  message.hidden = !error;
  message.textContent = error?.message ?? "";
  knobs.mark(error?.message ?? "");
}

/** Asks for the motion at the present knobs. While one is under way the next waits, so that a
 *  dragged knob shows every motion that there is time for and ends at the last. */
export async function refresh() {
  if (underway) { wanted = true; return; }
  underway = true;
  do {
    wanted = false;
    document.body.dataset.busy = "yes";
    $("busy").textContent = "computing …";
    try {
      const motion = await ask("motion", "/api/motion", { case: theCase(), start: state.start, steps: state.steps });
      say(null);
      show(motion);
    } catch (error) {
      if (!superseded(error)) say(error);
    }
  } while (wanted);
  $("busy").textContent = "";
  document.body.dataset.busy = "no";
  underway = false;
}

function show(motion) {
  $("summary").textContent = `${motion.title}: ${motion.summary}`;
  // Knobs are made anew where other keys are stated, but not under the hand.
  const keys = state.preset + motion.keys.map((key) => `${key.name}${key.value === ""}${key.choices ? key.value : ""}`).join();
  if (knobs.dragged() || keys === shown) knobs.update(motion.keys);
  else { knobs.build(motion.keys); shown = keys; }
  figure.put($("portrait"), motion.figure);
  figure.put($("contact"), motion.contact);
  lever.show(motion.film);
  $("observables").tBodies[0].replaceChildren(...motion.observables.map((row) => {
    const line = document.createElement("tr");
    const name = document.createElement("th");
    name.scope = "row";
    name.textContent = row.words;
    const value = document.createElement("td");
    value.textContent = row.shown;
    value.dataset.observable = row.name;
    value.dataset.value = row.value;
    line.append(name, value);
    return line;
  }));
  $("remarks").textContent = motion.remarks.join(" · ");
  $("spurious").textContent = motion.fixed_step?.words ?? OFF;
  $("fixed").hidden = !motion.fixed_step?.figure;
  if (motion.fixed_step?.figure) figure.put($("fixed"), motion.fixed_step.figure);
  $("command").textContent = motion.command;
  $("python").textContent = motion.python;
  study.fill(motion.forms);
}

async function census() {
  const list = $("attractors");
  list.replaceChildren();
  $("bound").textContent = "looking …";
  try {
    const found = await ask("census", "/api/attractors", { case: theCase(), unstable: $("unstable").checked });
    $("bound").textContent = found.bound;
    list.replaceChildren(...found.motions.map((one) => {
      const item = document.createElement("li");
      const button = document.createElement("button");
      button.type = "button";
      button.textContent = `${one.words}, amplitude ${Number(one.amplitude.toPrecision(4))}`;
      button.setAttribute("aria-pressed", String(one.start === state.start));
      button.addEventListener("click", () => {
        state.start = one.start;
        for (const other of list.querySelectorAll("button")) other.setAttribute("aria-pressed", String(other === button));
        remember(true);
        refresh();
      });
      item.append(button);
      return item;
    }));
  } catch (error) {
    if (!superseded(error)) $("bound").textContent = error.message;
  }
}

/** A census is of one case only. */
function forgetCensus() {
  $("attractors").replaceChildren();
  $("bound").textContent = "";
}

export function save(blob, name) {
  const link = document.createElement("a");
  link.href = URL.createObjectURL(blob);
  link.download = name;
  link.click();
  setTimeout(() => URL.revokeObjectURL(link.href), 1000);
}

async function exported(format) {
  const blob = await bytes("export", "/api/export", { case: theCase(), start: state.start, format });
  save(blob, format === "toml" ? "case.toml" : `motion.${format}`);
}

function takeOver() {
  decode(location.hash);
  if (!about.presets.some((p) => p.name === state.preset)) state.preset = about.presets[0].name;
  $("preset").value = state.preset;
  $("steps").value = state.steps;
  forgetCensus();
  study.restore();
  refresh();
}

async function begin() {
  try {
    about = await ask("about", "/api/about");
  } catch (error) { say(error); return; }
  document.title = `nanotap explorer ${about.version}`;
  for (const preset of about.presets) $("preset").add(new Option(preset.words, preset.name));
  $("preset").addEventListener("change", () => {
    Object.assign(state, { preset: $("preset").value, set: {}, start: "", study: {} });
    remember(true);
    takeOver();
  });
  knobs.onChange((_, finished) => { remember(finished); forgetCensus(); refresh(); });
  $("steps").addEventListener("change", () => { state.steps = Number($("steps").value) || 0; remember(true); refresh(); });
  $("census").addEventListener("click", census);
  for (const button of document.querySelectorAll("[data-export]")) {
    button.addEventListener("click", () => exported(button.dataset.export).catch(say));
  }
  $("knobs").addEventListener("submit", (event) => event.preventDefault());
  addEventListener("popstate", takeOver);
  addEventListener("hashchange", takeOver);
  study.begin(() => { forgetCensus(); refresh(); });
  takeOver();
}

begin();
