// The page: controls on the left, the motion in the middle, coexisting motions on the right,
// studies below.

import { state, decode, remember, theCase } from "./state.js";
import { ask, bytes, save, superseded } from "./api.js";
import * as knobs from "./knobs.js";
import * as lever from "./lever.js";
import * as figure from "./figure.js";
import * as study from "./study.js";

const $ = (id) => document.getElementById(id);
const BUSY_DELAY = 300;        // milliseconds before the page shows that it computes
const OFF = "0: off. Too few steps give motions that the equations do not have.";
let about = null;
let outdated = false;         // a value changed while a motion was being computed
let underway = false;
let shown = "";               // the case whose controls are shown
const redrawn = [];            // called when figures were redrawn

export function say(error) {
  const message = $("message");
  message.hidden = !error;
  message.textContent = error?.message ?? "";
  knobs.mark(error?.message ?? "");
}

/** Requests the motion for the present values. While one is being computed the next one waits, so that a
 *  dragged slider shows as many motions as can be computed, and finally the last one. */
export async function refresh() {
  if (underway) { outdated = true; return; }
  underway = true;
  document.body.dataset.busy = "yes";
  const busyTimer = setTimeout(() => { $("busy").textContent = "computing …"; }, BUSY_DELAY);
  let next = request();
  while (next) {
    const { motion, error } = await next;
    // The server computes the next motion while this one is drawn.
    next = outdated ? request() : null;
    if (motion) {
      say(null);
      show(motion);
      study.fill(motion.forms);
    } else if (state.follow && state.start && /state/.test(error.message)) {
      // With another number of modes the state has another length: the motion is then computed from
      // rest.
      state.start = "";
      outdated = true;
    } else if (!superseded(error)) say(error);
    if (!next && outdated) next = request();
  }
  clearTimeout(busyTimer);
  $("busy").textContent = "";
  document.body.dataset.busy = "no";
  underway = false;
}

/** The motion for the present values, or the reason why there is none. */
function request() {
  outdated = false;
  const wish = { case: theCase(), start: state.start, steps: state.steps, views: motionViews() };
  return ask("motion", "/api/motion", wish).then((motion) => ({ motion }), (error) => ({ error }));
}

/** The visible ranges of the motion's figures. */
function motionViews() {
  return Object.fromEntries(["contact", "portrait"].filter((name) => state.views[name]?.length).map((name) => [name, state.views[name]]));
}

function show(motion) {
  knobs.follows(motion.start);
  $("summary").textContent = `${motion.title}: ${motion.summary}`;
  // Controls are recreated if the stated keys change, but not while one is being edited.
  const keys = state.preset + motion.keys.map((key) => `${key.name}${key.value === ""}${key.choices ? key.value : ""}`).join();
  if (knobs.dragged() || keys === shown) knobs.update(motion.keys);
  else { knobs.build(motion.keys); shown = keys; }
  figure.put($("portrait"), motion.figure);
  figure.put($("contact"), motion.contact);
  lever.show(motion.film);
  for (const again of redrawn) again();
  table(motion.observables);
  $("remarks").textContent = motion.remarks.join(" · ");
  $("spurious").textContent = motion.fixed_step?.words ?? OFF;
  $("fixed").hidden = !motion.fixed_step?.figure;
  if (motion.fixed_step?.figure) figure.put($("fixed"), motion.fixed_step.figure);
  $("command").textContent = motion.command;
  $("python").textContent = motion.python;
}

/** Values change in place; lines are recreated if the set of observables changes. */
function table(rows) {
  const body = $("observables").tBodies[0];
  const names = rows.map((row) => row.name).join();
  if (body.dataset.names !== names) {
    body.dataset.names = names;
    body.replaceChildren(...rows.map((row) => {
      const line = document.createElement("tr");
      const name = document.createElement("th");
      name.scope = "row";
      name.textContent = row.words;
      const value = document.createElement("td");
      value.dataset.observable = row.name;
      line.append(name, value);
      return line;
    }));
  }
  rows.forEach((row, k) => {
    const value = body.rows[k].cells[1];
    value.textContent = row.shown;
    value.dataset.value = row.value;
  });
}

async function census() {
  const list = $("attractors");
  list.replaceChildren();
  $("bound").textContent = "searching …";
  try {
    const found = await ask("census", "/api/attractors", { case: theCase(), unstable: $("unstable").checked });
    $("bound").textContent = found.bound;
    list.replaceChildren(...found.motions.map((one) => {
      const item = document.createElement("li");
      const button = document.createElement("button");
      button.type = "button";
      button.textContent = `${one.words}, amplitude ${one.shown}`;
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

/** A census is valid for one case only. */
function forgetCensus() {
  if (!$("bound").textContent) return;
  $("attractors").replaceChildren();
  $("bound").textContent = "";
}

async function exported(format) {
  const blob = await bytes("export", "/api/export", { case: theCase(), start: state.start, views: motionViews(), figure: $("which").value, format });
  save(blob, format === "toml" ? "case.toml" : format === "csv" ? "motion.csv" : `${$("which").value}.${format}`);
}

function takeOver() {
  decode(location.hash);
  if (!about.presets.some((p) => p.name === state.preset)) state.preset = about.presets[0].name;
  $("preset").value = state.preset;
  $("steps").value = state.steps;
  $("follow").checked = state.follow === "yes";
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
    Object.assign(state, { preset: $("preset").value, set: {}, start: "", study: {}, ran: "", views: {} });
    remember(true);
    takeOver();
  });
  knobs.onChange((_, finished) => {
    // While a slider moves, the address is not changed.
    if (finished) remember(true);
    forgetCensus();
    refresh();
  });
  $("steps").addEventListener("change", () => { state.steps = Number($("steps").value) || 0; remember(true); refresh(); });
  $("follow").addEventListener("change", () => { state.follow = $("follow").checked ? "yes" : ""; remember(true); });
  for (const name of ["contact", "portrait"]) {
    redrawn.push(figure.alive($(name), {
      views: () => state.views[name] ?? [],
      tell: (place) => { $("reading").textContent = place ? figure.words(place) : ""; },
      zoom: (views) => { state.views[name] = views; remember(true); refresh(); },
    }));
  }
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
