// The studies: a form for each, its figure in stages of increasing resolution, and clicks that go
// to a motion.

import { state, caseText, put, remember, statedText, theCase } from "./state.js";
import { ask, bytes, current, save, stream, stop, superseded } from "./api.js";
import { sameAs } from "./knobs.js";
import * as figure from "./figure.js";

const $ = (id) => document.getElementById(id);
const TABS = {
  approach: "Approach", diagram: "Diagram", branches: "Branches", resonance: "Resonance",
  basin: "Basins", map: "Two parameters", plan: "Plan", image: "Image",
};
/** What the studies show, until they are computed. */
const HINTS = {
  approach: "Amplitude, phase, energy and peak force against the distance, coming nearer and going away.",
  diagram: "The largest deflections of the motions that runs lead to, against a parameter: where a motion doubles its period or becomes chaotic.",
  branches: "Every motion followed against a parameter, stable or not: where motions begin, end and meet.",
  resonance: "Amplitude and phase against the frequency, up and down: the resonance curve and its jumps.",
  basin: "To which motion each initial deflection and velocity leads.",
  map: "The kinds of motion, the peak force, or the number of motions over two parameters.",
  image: "A line of an image under feedback: height, amplitude error, phase and peak force over a surface that is known.",
  plan: "Where every motion keeps to the conditions, over free amplitude and setpoint: a window to image in.",
};
const PREFIX = { "-9": "G", "-6": "M", "-3": "k", 3: "m", 6: "µ", 9: "n", 12: "p", 15: "f" };
const NEAR = 0.05;            // fraction of a panel within which a click selects a drawn motion
const PAUSE = 250;            // milliseconds after a change before an approach curve is drawn anew
const OTHER = "computed for other values – compute again";
let forms = null;
let filled = "";              // the form that is shown
let drawn = null;             // what the displayed figure is of, and where its clicks go
let asking = null;            // the same of the figure that is being computed
let pinned = 0;               // the number of the figure that is drawn behind
let number = 0;               // the server's number for the figure
let motion = null;            // the displayed motion
let timer = 0;
let gone = () => {};
let redrawn = () => {};

const views = () => state.views.study ?? [];
const asked = () => JSON.stringify([state.preset, state.tab, state.study]);

/** The keys of the case that a figure does not depend on: those along its axes. Other keys must be as
 *  they stay along the axis, or the axis is another one. */
function along(clicks) {
  const names = Object.values(clicks?.set ?? {}).map((key) => key.name);
  const distances = ["gap.tip", "gap.beam", "drive.setpoint"];
  if (names.some((name) => distances.includes(name))) return [...names, ...distances];
  const held = Object.entries(clicks?.fixed ?? {}).every(([name, text]) => statedText(name) === text);
  return held ? names : [];
}

/** What a figure is of. */
function subject(clicks) {
  return { form: asked(), case: caseText(along(clicks)), start: state.tab === "basin" ? state.start : "" };
}

const same = (one, other) => one && ["form", "case", "start"].every((name) => one[name] === other[name]);
const isCurrent = () => same(drawn, subject(drawn?.clicks));

/** Marks a figure of another case. */
function mark() {
  const other = drawn !== null && !isCurrent();
  $("study-figure").classList.toggle("stale", other);
  $("study-export").classList.toggle("stale", other);
  for (const button of document.querySelectorAll("[data-study-export]")) button.disabled = other;
  $("stale").hidden = !other;
  $("stale").textContent = other ? OTHER : "";
  // A link contains only figures of the same case.
  if (other && state.ran) { state.ran = ""; remember(false); }
  point();
}

/** A value of the displayed motion on an axis; its setpoint also where the distance is stated. */
function valueOn(axis) {
  const si = axis && motion?.keys.find((key) => key.name === axis.name)?.si;
  const value = axis?.name === "drive.setpoint" && !Number.isFinite(si) ? Number(motion?.readout.ratio ?? NaN) : si;
  return axis ? value * axis.factor : NaN;
}

/** Shows the displayed motion on the figure. */
function point() {
  const { x, y } = drawn?.clicks.set ?? {};
  if (x && y) {
    const shows = isCurrent() && Number.isFinite(valueOn(x));
    figure.present($("study-figure"), shows ? { x: valueOn(x), heights: [valueOn(y)] } : null);
    return;
  }
  const value = valueOn(x);
  const shows = isCurrent() && Number.isFinite(value);
  const heights = (drawn?.clicks.heights ?? []).map(({ name, factor }) => {
    const row = motion?.observables.find((one) => one.name === name);
    return row && (factor === null ? Number.parseFloat(row.shown) : factor * row.value);
  });
  figure.present($("study-figure"), shows ? { x: value, heights } : null);
}

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
      remember(true);
      if (motion) fill(motion);
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
  $("study-form").addEventListener("submit", (event) => { event.preventDefault(); state.ran = "yes"; remember(true); compute(false); });
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
  // A curve that waits to be drawn is of the former tab or case.
  clearTimeout(timer);
  if (!(state.tab in TABS)) state.tab = "approach";
  for (const tab of $("tabs").children) {
    const chosen = tab.id === `tab-${state.tab}`;
    tab.setAttribute("aria-selected", String(chosen));
    tab.tabIndex = chosen ? 0 : -1;
  }
  $("study-panel").setAttribute("aria-labelledby", `tab-${state.tab}`);
  filled = "";
}

/** Takes the displayed motion, with the server's forms. A figure of this case stays; one of another case
 *  is marked; one that the address contains is computed again, and an approach curve always. */
export function fill(next) {
  motion = next;
  forms = next.forms;
  // Only a lever makes images.
  $("tab-image").hidden = !forms.image.length;
  if (!forms[state.tab].length) { state.tab = "approach"; restore(); }
  const now = asked() + JSON.stringify(forms[state.tab]);
  if (now !== filled) {
    filled = now;
    build();
    if (drawn && drawn.form !== asked()) forget();
  }
  mark();
  clearTimeout(timer);
  if (same(asking, subject(asking?.clicks)) || isCurrent()) return;
  if (asking) stop("study");
  if (state.ran === "yes") compute(false);
  else if (state.tab === "approach") timer = setTimeout(() => { if (!isCurrent()) compute(true); }, PAUSE);
}

/** Takes a motion that was computed while a slider moves. */
export function follow(next) {
  motion = next;
  mark();
}

/** Removes the figure. */
function forget() {
  stop("study");
  drawn = null;
  $("study-figure").replaceChildren();
  $("study-export").hidden = true;
  $("progress").textContent = HINTS[state.tab];
  $("hover").textContent = "";
}

/** Creates the form of the tab with the server's initial values. */
function build() {
  const form = $("study-form");
  form.replaceChildren(...forms[state.tab].map((field) => {
    const label = document.createElement("label");
    label.textContent = `${field.words} `;
    const input = document.createElement(field.choices ? "select" : "input");
    for (const choice of field.choices ?? []) input.add(new Option(choice, choice));
    Object.assign(input, { name: field.name, value: state.study[field.name] ?? field.value });
    if (!field.choices) Object.assign(input, { size: field.hint ? 15 : 10, placeholder: field.hint ?? "" });
    input.addEventListener("change", () => {
      state.study[field.name] = input.value;
      filled = asked() + JSON.stringify(forms[state.tab]);
      remember(true);
      mark();
    });
    label.append(input);
    return label;
  }));
  const compute_ = Object.assign(document.createElement("button"), { type: "submit", textContent: "Compute" });
  const end = Object.assign(document.createElement("button"), { type: "button", textContent: "Stop" });
  end.addEventListener("click", () => stop("study"));
  const pin = Object.assign(document.createElement("button"), { type: "button", id: "pin", textContent: pinned ? "Unpin" : "Pin" });
  pin.title = "Keep the curves of this figure behind the next ones";
  pin.setAttribute("aria-pressed", String(Boolean(pinned)));
  pin.addEventListener("click", () => {
    const before = pinned;
    pinned = pinned || !drawn ? 0 : number;
    pin.textContent = pinned ? "Unpin" : "Pin";
    pin.setAttribute("aria-pressed", String(Boolean(pinned)));
    // Without its pinned curves the figure is drawn anew.
    if (before && drawn && isCurrent()) compute(state.tab === "approach" && state.ran !== "yes");
  });
  form.append(compute_, end, pin);
  if (!drawn) $("progress").textContent = HINTS[state.tab];
}

/** Computes the figure of the form, in stages; a `quick` one ends after the first. */
async function compute(quick) {
  clearTimeout(timer);
  const options = Object.fromEntries(new FormData($("study-form")));
  $("progress").textContent = "computing …";
  const own = { ...subject(null), clicks: null };
  const whole = caseText();
  asking = own;
  let request = null;
  try {
    const sent = stream("study", "/api/study", { case: theCase(), start: state.start, tab: state.tab, options, ...(pinned ? { pinned } : {}) }, (message) => {
      // An answer for an older case is dropped.
      if (asking !== own) return;
      if (!own.clicks && caseText() !== whole) { request?.abort(); return; }
      own.clicks = message.clicks;
      Object.assign(own, { case: own.case && caseOf(own, message.clicks) });
      drawn = own;
      number = message.number;
      $("progress").textContent = message.words;
      $("study-command").textContent = message.command;
      $("study-python").textContent = message.python;
      $("study-export").hidden = false;
      if (views().length) look();
      else draw(message.figure);
      mark();
      if (quick) { $("progress").textContent = `${message.words}; Compute: more, with branches`; request?.abort(); }
    });
    request = current("study");
    await sent;
  } catch (error) {
    if (asking === own && !(quick && drawn === own)) $("progress").textContent = superseded(error) ? "stopped" : error.message;
  }
  if (asking === own) asking = null;
}

/** The case of a figure, without the keys along its axes. */
function caseOf(own, clicks) {
  own.text ??= own.case;
  const [preset, kept] = JSON.parse(own.text);
  const left = along(clicks);
  return JSON.stringify([preset, kept.filter(([key]) => !left.includes(key))]);
}

function draw(next) {
  figure.put($("study-figure"), next);
  redrawn();
  point();
}

/** Draws the visible range of the figure. */
async function look() {
  if (!number || !drawn) return;
  try {
    draw(await ask("look", "/api/figure", { number, views: views() }));
  } catch (error) {
    if (!superseded(error)) $("progress").textContent = error.message;
  }
}

/** Sets the values of the axes at a place, and shows the motion there. */
function go(place) {
  if (!drawn || !isCurrent()) return;
  const { clicks } = drawn;
  const orbit = nearest(place);
  state.start = "";
  for (const [axis, key] of Object.entries(clicks.set ?? {})) {
    const shown = orbit && axis === "x" ? orbit[0] : Number(place[axis].toPrecision(7));
    put(key.name, inUnit(shown, key), sameAs(key.name));
  }
  for (const [name, text] of Object.entries(clicks.fixed ?? {})) put(name, text, sameAs(name));
  if (orbit) state.start = orbit[2];
  if (clicks.start) {
    const entry = (one) => (one.axis ? place[one.axis] / clicks.factors[one.axis] : one);
    state.start = clicks.start.map(entry).join(",");
  }
  // The clicked motion is one of the figure.
  Object.assign(drawn, subject(clicks));
  remember(true);
  gone();
}

/** A drawn value in the unit of its axis, or in that of the key. */
function inUnit(shown, { factor, unit }) {
  const power = Math.round(Math.log10(factor));
  if (!unit) return `${shown / factor}`;
  const prefix = Math.abs(factor / 10 ** power - 1) < 1e-9 && unit !== "kg" ? PREFIX[power] : undefined;
  return prefix ? `${shown} ${prefix}${unit}` : `${shown / factor} ${unit}`;
}

/** The drawn motion nearest to a place, if one is near: [x, heights by panel, start]. */
function nearest(place) {
  const { panel, u, v } = place;
  const index = $("study-figure").panels.indexOf(panel);
  let best = null;
  let least = NEAR;
  for (const orbit of drawn?.clicks.near ?? []) {
    const across = Math.abs(figure.part(panel.x, orbit[0]) - u);
    if (across >= least) continue;
    for (const height of orbit[1][index] ?? []) {
      const distance = Math.hypot(across, figure.part(panel.y, height) - v);
      if (distance < least) { least = distance; best = orbit; }
    }
  }
  return best;
}
