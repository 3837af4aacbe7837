// How the motion changes: a form for each study, its figure as it grows finer, a click that goes
// to the motion there.

import { state, remember, theCase } from "./state.js";
import { stream, stop, superseded } from "./api.js";
import * as figure from "./figure.js";

const $ = (id) => document.getElementById(id);
const TABS = {
  diagram: "Diagram", branches: "Branches", resonance: "Resonance", approach: "Approach",
  basin: "Basins", map: "Two parameters",
};
let forms = null;
let filled = "";              // the form that stands there
let gone = () => {};
let place = null;             // of the cross
let clicks = null;

/** `motionChanged` is called when a click went to another motion. */
export function begin(motionChanged) {
  gone = motionChanged;
  for (const [name, words] of Object.entries(TABS)) {
    const tab = document.createElement("button");
    Object.assign(tab, { type: "button", id: `tab-${name}`, textContent: words });
    tab.setAttribute("role", "tab");
    tab.addEventListener("click", () => { state.tab = name; state.study = {}; restore(); fill(forms); remember(true); });
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
  const drawn = $("study-figure");
  $("study-form").addEventListener("submit", (event) => { event.preventDefault(); compute(); });
  drawn.addEventListener("pointermove", (event) => { place = figure.under(drawn, event.clientX, event.clientY); hover(); });
  drawn.addEventListener("click", (event) => { place = figure.under(drawn, event.clientX, event.clientY); go(); });
  drawn.addEventListener("keydown", (event) => {
    const step = { ArrowLeft: [-1, 0], ArrowRight: [1, 0], ArrowUp: [0, 1], ArrowDown: [0, -1] }[event.key];
    if (step) { place = figure.moved(drawn, place, step); hover(); event.preventDefault(); }
    if (event.key === "Enter") go();
  });
  $("save-study").addEventListener("click", () => {
    const text = new XMLSerializer().serializeToString(drawn.querySelector("svg:not(.cross)"));
    const link = document.createElement("a");
    link.href = URL.createObjectURL(new Blob([text], { type: "image/svg+xml" }));
    link.download = `${state.tab}.svg`;
    link.click();
    setTimeout(() => URL.revokeObjectURL(link.href), 1000);
  });
}

/** Shows the tab of the state, without a figure. */
export function restore() {
  if (!(state.tab in TABS)) state.tab = "diagram";
  for (const tab of $("tabs").children) {
    const chosen = tab.id === `tab-${state.tab}`;
    tab.setAttribute("aria-selected", String(chosen));
    tab.tabIndex = chosen ? 0 : -1;
  }
  filled = "";
}

/** Makes the form of the tab, its first values those of the server. */
export function fill(next) {
  forms = next;
  const now = `${state.preset} ${state.tab}`;
  if (now === filled) return;
  filled = now;
  stop("study");
  $("study-figure").replaceChildren();
  $("study-export").hidden = true;
  $("progress").textContent = "";
  $("hover").textContent = "";
  clicks = null;
  place = null;
  const form = $("study-form");
  form.replaceChildren(...forms[state.tab].map((field) => {
    const label = document.createElement("label");
    label.textContent = `${field.words} `;
    const input = document.createElement(field.choices ? "select" : "input");
    for (const choice of field.choices ?? []) input.add(new Option(choice, choice));
    Object.assign(input, { name: field.name, value: state.study[field.name] ?? field.value });
    if (!field.choices) Object.assign(input, { size: 10, placeholder: field.hint ?? "" });
    input.addEventListener("change", () => { state.study[field.name] = input.value; remember(true); });
    label.append(input);
    return label;
  }));
  const compute = Object.assign(document.createElement("button"), { type: "submit", textContent: "Compute" });
  const end = Object.assign(document.createElement("button"), { type: "button", textContent: "Stop" });
  end.addEventListener("click", () => stop("study"));
  form.append(compute, end);
}

async function compute() {
  const options = Object.fromEntries(new FormData($("study-form")));
  $("progress").textContent = "computing …";
  const begun = `${state.preset} ${state.tab}`;
  try {
    await stream("study", "/api/study", { case: theCase(), start: state.start, tab: state.tab, options }, (message) => {
      if (begun !== filled) return;
      figure.put($("study-figure"), message.figure);
      clicks = message.clicks;
      $("progress").textContent = message.words;
      $("study-command").textContent = message.command;
      $("study-export").hidden = false;
    });
  } catch (error) {
    if (begun === filled) $("progress").textContent = superseded(error) ? "stopped" : error.message;
  }
}

function hover() {
  const drawn = $("study-figure");
  figure.cross(drawn, place);
  const words = (axis) => `${place.panel[axis].label.replaceAll("$", "")} ${Number(place[axis].toPrecision(6))} ${place.panel[axis].unit}`.trim();
  $("hover").textContent = place ? `${words("x")}, ${words("y")}; a click or Enter goes there` : "";
}

/** Sets what the axes say, and shows the motion there. */
function go() {
  if (!place || !clicks) return;
  state.start = "";
  const orbit = clicks.near ? nearest(clicks.near) : null;
  for (const [axis, key] of Object.entries(clicks.set ?? {})) {
    const value = (orbit && axis === "x" ? orbit[0] : place[axis]) / key.factor;
    state.set[key.name] = `${orbit ? value : Number(value.toPrecision(7))}${key.unit ? ` ${key.unit}` : ""}`;
  }
  if (orbit) state.start = orbit[2];
  if (clicks.start) state.start = clicks.start.map((entry) => (typeof entry === "string" ? place[entry] : entry)).join(",");
  remember(true);
  gone();
}

/** The drawn orbit that is nearest to the cross, if one is near. */
function nearest(orbits) {
  const { panel } = place;
  const part = (axis, v) => (v - panel[axis].from) / (panel[axis].to - panel[axis].from);
  let best = null;
  let least = 0.05;
  for (const orbit of orbits) {
    const distance = Math.hypot(part("x", orbit[0]) - part("x", place.x), part("y", orbit[1]) - part("y", place.y));
    if (distance < least) { least = distance; best = orbit; }
  }
  return best;
}
