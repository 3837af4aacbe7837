// The studies: a form for each, its figure in stages of increasing resolution, and clicks that go
// to a motion.

import { state, remember, theCase } from "./state.js";
import { ask, bytes, save, stream, stop, superseded } from "./api.js";
import * as figure from "./figure.js";

const $ = (id) => document.getElementById(id);
const TABS = {
  diagram: "Diagram", branches: "Branches", resonance: "Resonance", approach: "Approach",
  basin: "Basins", map: "Two parameters",
};
const NEAR = 0.05;            // fraction of a panel within which a click selects a drawn motion
let forms = null;
let filled = "";              // the form that is shown
let drawnFor = "";            // the request of the displayed figure
let number = 0;               // the server's number for the figure
let clicks = null;
let gone = () => {};
let redrawn = () => {};

const views = () => state.views.study ?? [];
const asked = () => JSON.stringify([state.preset, state.tab, state.study]);

/** `motionChanged` is called when a click selected another motion. */
export function begin(motionChanged) {
  gone = motionChanged;
  for (const [name, words] of Object.entries(TABS)) {
    const tab = document.createElement("button");
    Object.assign(tab, { type: "button", id: `tab-${name}`, textContent: words });
    tab.setAttribute("role", "tab");
    tab.setAttribute("aria-controls", "study-panel");
    tab.addEventListener("click", () => {
      Object.assign(state, { tab: name, study: {}, ran: "" });
      delete state.views.study;
      restore();
      fill(forms);
      remember(true);
    });
    $("tabs").append(tab);
  }
  $("tabs").addEventListener("keydown", (event) => {
    const way = { ArrowRight: 1, ArrowLeft: -1 }[event.key];
    if (!way) return;
    const tabs = [...$("tabs").children];
    const next = tabs[(tabs.indexOf(document.activeElement) + way + tabs.length) % tabs.length];
    next.focus();
    next.click();
  });
  $("study-form").addEventListener("submit", (event) => { event.preventDefault(); state.ran = "yes"; remember(true); compute(); });
  redrawn = figure.alive($("study-figure"), {
    views,
    tell: (place) => { $("hover").textContent = place ? `${figure.words(place)}${nearest(place) ? ": a motion is drawn here" : ""}` : ""; },
    go,
    zoom: (next) => { state.views.study = next; remember(true); look(); },
  });
  for (const button of document.querySelectorAll("[data-study-export]")) {
    button.addEventListener("click", async () => {
      const format = button.dataset.studyExport;
      try {
        save(await bytes("export", "/api/figure", { number, views: views(), format }), `${state.tab}.${format}`);
      } catch (error) { if (!superseded(error)) $("progress").textContent = error.message; }
    });
  }
}

/** Shows the tab given in the state. */
export function restore() {
  if (!(state.tab in TABS)) state.tab = "diagram";
  for (const tab of $("tabs").children) {
    const chosen = tab.id === `tab-${state.tab}`;
    tab.setAttribute("aria-selected", String(chosen));
    tab.tabIndex = chosen ? 0 : -1;
  }
  $("study-panel").setAttribute("aria-labelledby", `tab-${state.tab}`);
  filled = "";
}

/** Creates the form of the tab with the server's initial values. A figure that was computed for this form
 *  stays; one that the address contains is computed again. */
export function fill(next) {
  forms = next;
  const now = asked();
  if (now === filled) return;
  filled = now;
  const form = $("study-form");
  form.replaceChildren(...forms[state.tab].map((field) => {
    const label = document.createElement("label");
    label.textContent = `${field.words} `;
    const input = document.createElement(field.choices ? "select" : "input");
    for (const choice of field.choices ?? []) input.add(new Option(choice, choice));
    Object.assign(input, { name: field.name, value: state.study[field.name] ?? field.value });
    if (!field.choices) Object.assign(input, { size: field.hint ? 15 : 10, placeholder: field.hint ?? "" });
    input.addEventListener("change", () => { state.study[field.name] = input.value; filled = asked(); remember(true); });
    label.append(input);
    return label;
  }));
  const compute_ = Object.assign(document.createElement("button"), { type: "submit", textContent: "Compute" });
  const end = Object.assign(document.createElement("button"), { type: "button", textContent: "Stop" });
  end.addEventListener("click", () => stop("study"));
  form.append(compute_, end);
  if (drawnFor === now) { look(); return; }
  stop("study");
  drawnFor = "";
  clicks = null;
  $("study-figure").replaceChildren();
  $("study-export").hidden = true;
  $("progress").textContent = "";
  $("hover").textContent = "";
  if (state.ran === "yes") compute();
}

async function compute() {
  const options = Object.fromEntries(new FormData($("study-form")));
  $("progress").textContent = "computing …";
  const begun = asked();
  drawnFor = begun;
  try {
    await stream("study", "/api/study", { case: theCase(), start: state.start, tab: state.tab, options }, async (message) => {
      if (drawnFor !== begun) return;
      number = message.number;
      clicks = message.clicks;
      $("progress").textContent = message.words;
      $("study-command").textContent = message.command;
      $("study-python").textContent = message.python;
      $("study-export").hidden = false;
      if (views().length) look();
      else draw(message.figure);
    });
  } catch (error) {
    if (drawnFor === begun) $("progress").textContent = superseded(error) ? "stopped" : error.message;
  }
}

function draw(drawn) {
  figure.put($("study-figure"), drawn);
  redrawn();
}

/** Draws the visible range of the figure. */
async function look() {
  if (!number || !drawnFor) return;
  try {
    draw(await ask("look", "/api/figure", { number, views: views() }));
  } catch (error) {
    if (!superseded(error)) $("progress").textContent = error.message;
  }
}

/** Sets the values of the axes at a place, and shows the motion there. */
function go(place) {
  if (!clicks) return;
  const orbit = nearest(place);
  state.start = "";
  for (const [axis, key] of Object.entries(clicks.set ?? {})) {
    const value = (orbit && axis === "x" ? orbit[0] : place[axis]) / key.factor;
    state.set[key.name] = `${orbit ? value : Number(value.toPrecision(7))}${key.unit ? ` ${key.unit}` : ""}`;
  }
  if (orbit) state.start = orbit[2];
  if (clicks.start) state.start = clicks.start.map((entry) => (typeof entry === "string" ? place[entry] : entry)).join(",");
  remember(true);
  gone();
}

/** The drawn motion nearest to a place, if one is near: [x, heights by panel, start]. */
function nearest(place) {
  const { panel, u, v } = place;
  const index = $("study-figure").panels.indexOf(panel);
  let best = null;
  let least = NEAR;
  for (const orbit of clicks?.near ?? []) {
    const across = Math.abs(figure.part(panel.x, orbit[0]) - u);
    if (across >= least) continue;
    for (const height of orbit[1][index] ?? []) {
      const distance = Math.hypot(across, figure.part(panel.y, height) - v);
      if (distance < least) { least = distance; best = orbit; }
    }
  }
  return best;
}
