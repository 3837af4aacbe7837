// The studies: a form for each, its figure in stages of increasing resolution, and clicks that go
// to a motion.

import { state, basis, caseText, put, remember, statedText, theCase } from "./state.js";
import { alone, bytes, current, save, stream, stop, superseded } from "./api.js";
import { sameAs } from "./knobs.js";
import * as figure from "./figure.js";
import { moves } from "./lever.js";
import { part } from "./plot.js";

const $ = (id) => document.getElementById(id);
const TABS = {
  approach: "Approach", diagram: "Diagram", branches: "Branches", resonance: "Resonance",
  basin: "Basins", map: "Two parameters", plan: "Plan", levers: "Levers", image: "Image", data: "Data",
};
/** What the studies show, until they are computed. */
const HINTS = {
  approach: "Amplitude, phase, energy and peak force against the distance, coming nearer and going away.",
  diagram: "The largest deflections of the motions that runs lead to, against a parameter: where a motion doubles its period or becomes chaotic.",
  branches: "Every motion followed against a parameter, stable or not: where motions begin, end and meet.",
  resonance: "Amplitude and phase against the frequency, up and down: the resonance curve and its jumps.",
  basin: "To which motion each initial deflection and velocity leads.",
  map: "The kinds of motion, the peak force, or the number of motions over two parameters.",
  image: "A line of an image under feedback: height, amplitude error, phase and peak force over a known surface.",
  levers: "Levers of the catalogue on this sample, at the free amplitude and the setpoint: a click on a row chooses that lever.",
  data: "A measured curve over that of the model, the fit of the model to it, and its force without a contact law. Drop an instrument’s file (JPK, Bruker, Asylum, Nanosurf …) or a CSV file on the page, or choose one; columns of a CSV file are named as in “distance (nm)”, “amplitude (nm)”, “phase (deg)”. The file stays in this page.",
  plan: "Where every motion meets the conditions, over free amplitude and setpoint: the window for imaging.",
};
const MOST_DATA = 24e6;       // bytes of a measured file
const COLUMNS = 64;           // heights of a surface that is drawn by hand
const LINE = 6000;            // milliseconds in which the tip goes along the line of an image
const FIRST = 5;              // fields of a form that are shown at once, if it has more than one in addition
const NEAR = 0.05;            // fraction of a panel within which a click selects a drawn motion
const PAUSE = 250;            // milliseconds after a change before an approach curve is drawn anew
const TERMINAL = 60000;       // milliseconds after which the page without a server names the terminal
const OTHER = "computed for other values – compute again";
const PLAIN = {};             // studies that the page knows from the registry only: name -> what they are about
let plain = {};               // their forms
let forms = null;
let measured = null;          // name and content of the measured file
let found = null;             // the case of a fit
let filled = "";              // the form that is shown
let drawn = null;             // what the displayed figure is of, and where its clicks go
let asking = null;            // the same of the figure that is being computed
let pinned = null;            // the figure that is drawn behind
let shown = null;             // the displayed figure, as it was received
let motion = null;            // the displayed motion
let timer = 0;
let gone = () => {};
let openCase = () => {};

const views = () => state.views.study ?? [];
const asked = () => JSON.stringify([basis(), state.tab, state.study, state.tab === "data" && measured?.[0]]);
const shape = () => asked() + JSON.stringify([forms[state.tab], state.tab in PLAIN && forms.usual[state.tab]]);
const hint = () => HINTS[state.tab] ?? `${PLAIN[state.tab]}.`;

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
  for (const id of ["study-export", "tables"]) $(id).classList.toggle("stale", other);
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
  const { x, y } = drawn?.clicks?.set ?? {};
  if (x && y) {
    const shows = isCurrent() && Number.isFinite(valueOn(x));
    figure.present($("study-figure"), shows ? { x: valueOn(x), heights: [valueOn(y)] } : null);
    return;
  }
  const value = valueOn(x);
  const shows = isCurrent() && Number.isFinite(value);
  const heights = (drawn?.clicks?.heights ?? []).map(({ name, factor }) => {
    const row = motion?.observables.find((one) => one.name === name);
    return row && (factor === null ? Number.parseFloat(row.shown) : factor * row.value);
  });
  figure.present($("study-figure"), shows ? { x: value, heights } : null);
}

function choose(name) {
  Object.assign(state, { tab: name, study: {}, ran: "" });
  delete state.views.study;
  restore();
  remember(true);
  if (motion) fill(motion);
}

/** The bytes of a file in base64. */
const base64Of = (file) => new Promise((done, failed) => {
  const reader = new FileReader();
  reader.addEventListener("load", () => done(reader.result.slice(reader.result.indexOf(",") + 1)));
  reader.addEventListener("error", () => failed(reader.error));
  reader.readAsDataURL(file);
});

/** Takes a measured file, or a case file. */
async function take(file) {
  if (!file) return;
  if (file.name.toLowerCase().endsWith(".toml")) { openCase(file); return; }
  if (state.tab !== "data") choose("data");
  if (file.size > MOST_DATA) { $("progress").textContent = `${file.name} has ${file.size} bytes; the page reads at most ${MOST_DATA}, the terminal more`; return; }
  measured = [file.name, { base64: await base64Of(file) }];
  filled = "";
  if (motion) fill(motion);
  compute(false);
}

/** `motionChanged` is called when a click selected another motion; `studies` are those of the registry
 *  that have no tab made for them; `openFile` takes a case file. */
export function begin(motionChanged, studies, openFile) {
  gone = motionChanged;
  openCase = openFile;
  for (const { name, about, form } of studies) { PLAIN[name] = about; plain[name] = form; }
  $("more").append(...studies.map(({ name, about }) => Object.assign(new Option(name.replaceAll("-", " "), name), { title: about })));
  $("more").addEventListener("change", () => { if ($("more").value) choose($("more").value); });
  addEventListener("dragover", (event) => { if (event.dataTransfer?.types.includes("Files")) event.preventDefault(); });
  addEventListener("drop", (event) => {
    if (!event.dataTransfer?.files.length) return;
    event.preventDefault();
    take(event.dataTransfer.files[0]);
  });
  for (const [name, words] of Object.entries(TABS)) {
    const tab = document.createElement("button");
    Object.assign(tab, { type: "button", id: `tab-${name}`, textContent: words });
    tab.setAttribute("role", "tab");
    tab.setAttribute("aria-controls", "study-panel");
    tab.addEventListener("click", () => choose(name));
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
  figure.alive($("study-figure"), {
    views,
    tell: (place) => { $("hover").textContent = place ? `${figure.words(place)}${nearest(place) ? ": a motion is drawn here" : ""}` : ""; },
    go,
    zoom: (next) => { state.views.study = next; remember(true); },
    redrawn: point,
  });
  for (const button of document.querySelectorAll("[data-study-export]")) {
    button.addEventListener("click", async () => {
      const format = button.dataset.studyExport;
      try {
        save(await bytes("export", "/api/figure", { figure: shown, views: views(), format }), `${state.tab}.${format}`);
      } catch (error) { if (!superseded(error)) $("progress").textContent = error.message; }
    });
  }
}

/** Shows the tab given in the state. */
export function restore() {
  // A curve that waits to be drawn is of the former tab or case.
  clearTimeout(timer);
  if (!(state.tab in TABS || state.tab in PLAIN)) state.tab = "approach";
  for (const tab of $("tabs").children) {
    const chosen = tab.id === `tab-${state.tab}`;
    tab.setAttribute("aria-selected", String(chosen));
    tab.tabIndex = chosen ? 0 : -1;
  }
  $("more").value = state.tab in PLAIN ? state.tab : "";
  $("study-panel").setAttribute("aria-labelledby", state.tab in PLAIN ? "more" : `tab-${state.tab}`);
  filled = "";
}

/** Takes the displayed motion, with its forms. A figure of this case stays; one of another case
 *  is marked; one that the address contains is computed again, and an approach curve always. */
export function fill(next) {
  motion = next;
  forms = { ...plain, ...next.forms };
  // Only a lever makes images, and is compared with others.
  for (const name of ["image", "levers"]) $(`tab-${name}`).hidden = !forms[name].length;
  if (!(state.tab in PLAIN || forms[state.tab].length)) { state.tab = "approach"; restore(); }
  const now = shape();
  if (now !== filled) {
    filled = now;
    build();
    if (drawn && drawn.form !== asked()) forget();
  }
  figure.renew($("study-figure"));
  mark();
  clearTimeout(timer);
  if (same(asking, subject(asking?.clicks)) || isCurrent()) return;
  if (asking) {
    stop("study");
    asking = null;
    $("progress").textContent = hint();
  }
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
  // Its end is not reported over the words of what follows.
  asking = null;
  drawn = null;
  found = null;
  shown = null;
  figure.clear($("study-figure"));
  $("tables").replaceChildren();
  $("study-export").hidden = true;
  $("progress").textContent = hint();
  $("hover").textContent = "";
}

/** Creates the form of the tab with its initial values. */
function build() {
  const form = $("study-form");
  const fields = forms[state.tab].map(entry);
  if (state.tab in PLAIN || state.tab === "data") {
    const more = document.createElement("details");
    more.append(Object.assign(document.createElement("summary"), { textContent: `${fields.length - FIRST} more` }), ...fields.splice(FIRST));
    more.className = "row";
    if (more.children.length > 2) fields.push(more);
  }
  form.replaceChildren(...fields);
  const button = (words, pressed, id) => {
    const made = Object.assign(document.createElement("button"), { type: pressed ? "button" : "submit", textContent: words });
    if (id) made.id = id;
    if (pressed) made.addEventListener("click", pressed);
    form.append(made);
    return made;
  };
  if (state.tab === "data") {
    const file = Object.assign(document.createElement("input"), { type: "file" });
    file.addEventListener("change", () => take(file.files[0]));
    const label = document.createElement("label");
    label.append(measured ? `${measured[0]} ` : "measured file ", file);
    form.prepend(label);
  }
  button(state.tab === "data" ? "Show" : "Compute");
  if (state.tab === "data") {
    button("Fit", () => compute(false, { fit: "yes" }), "fit");
    button("Force without a law", () => compute(false, { reconstruct: "yes" }), "reconstruct").title
      = "Conservative force and dissipation against distance from the curve, without a contact law";
  }
  button("Stop", () => stop("study"));
  const pin = button(pinned ? "Unpin" : "Pin", () => {
    const before = pinned;
    pinned = pinned || !drawn ? null : shown;
    pin.textContent = pinned ? "Unpin" : "Pin";
    pin.setAttribute("aria-pressed", String(Boolean(pinned)));
    // Without its pinned curves the figure is drawn anew.
    if (before && drawn && isCurrent()) compute(state.tab === "approach" && state.ran !== "yes");
  }, "pin");
  pin.title = "Keep the curves of this figure behind the next ones";
  pin.setAttribute("aria-pressed", String(Boolean(pinned)));
  if (drawn) return;
  $("progress").textContent = hint();
  // The approach curve comes by itself.
  $("study-figure").hidden = state.tab !== "approach";
}

/** A field of the form. */
function entry(field) {
  if (field.drawn) return hand(field);
  const label = document.createElement("label");
  label.textContent = `${field.words} `;
  label.title = field.about ?? "";
  const input = document.createElement(field.choices ? "select" : "input");
  for (const choice of field.choices ?? []) input.add(new Option(choice, choice));
  // What a study of the registry needs has a usual value for the case.
  const usual = state.tab in PLAIN ? forms.usual[state.tab]?.[field.name] : undefined;
  Object.assign(input, { name: field.name, value: state.study[field.name] ?? usual ?? field.value });
  if (!field.choices) Object.assign(input, { size: field.hint ? 15 : 10, placeholder: field.hint ?? "" });
  input.addEventListener("change", () => {
    state.study[field.name] = input.value;
    if (field.name === "surface") for (const box of $("study-form").querySelectorAll(".hand")) box.hidden = input.value !== "drawn";
    filled = shape();
    remember(true);
    mark();
  });
  label.append(input);
  if (field.slider) label.append(slide(field, input));
  return label;
}

/** A slider of a field, logarithmic around its usual value. */
function slide({ words, slider: { from, to, usual, unit } }, input) {
  const range = Object.assign(document.createElement("input"), { type: "range", min: 0, max: 1000 });
  range.setAttribute("aria-label", `${words}, slider`);
  const [, number, of] = /^([\d.e+-]+) ?(.*)$/.exec(input.value) ?? [];
  range.value = 1000 * Math.log((of === unit ? Number(number) : usual) / from) / Math.log(to / from);
  range.addEventListener("input", () => { input.value = `${Number((from * (to / from) ** (range.value / 1000)).toPrecision(3))}${unit ? ` ${unit}` : ""}`; });
  range.addEventListener("change", () => {
    input.dispatchEvent(new Event("change"));
    again();
  });
  return range;
}

/** Computes a figure that is shown anew, with other options. */
function again() {
  if (!drawn) return;
  state.ran = "yes";
  remember(true);
  compute(false);
}

/** A surface that is drawn by hand: a pointer sets its heights, arrow keys move and change one. */
function hand({ name, drawn: word }) {
  const heights = Array.from({ length: COLUMNS }, () => 0);
  (state.study[name] ?? "").split(",").forEach((text, k) => { if (text !== "" && k < COLUMNS) heights[k] = Math.min(1, Math.max(0, Number(text) || 0)); });
  const box = Object.assign(document.createElement("div"), { className: "hand", hidden: (state.study.surface ?? "") !== word });
  const field = Object.assign(document.createElement("input"), { type: "hidden", name, value: state.study[name] ?? "" });
  const canvas = Object.assign(document.createElement("canvas"), { width: COLUMNS * 8, height: 96, tabIndex: 0 });
  canvas.setAttribute("role", "img");
  canvas.setAttribute("aria-label", "Surface drawn by hand: drag to set its heights; arrow keys move along the line and change the height there");
  let at = 0;
  let last = null;
  const show = () => {
    const pen = canvas.getContext("2d");
    const style = getComputedStyle(document.documentElement);
    pen.clearRect(0, 0, canvas.width, canvas.height);
    pen.fillStyle = style.getPropertyValue("--sample");
    heights.forEach((height, k) => pen.fillRect(8 * k, 92 - 88 * height, 8, 4 + 88 * height));
    if (document.activeElement === canvas) { pen.fillStyle = style.getPropertyValue("--accent"); pen.fillRect(8 * at, 92 - 88 * heights[at], 8, 3); }
  };
  const keep = () => { field.value = state.study[name] = heights.map((height) => Number(height.toFixed(2))).join(","); remember(true); mark(); };
  const set = (event) => {
    const area = canvas.getBoundingClientRect();
    const k = Math.min(COLUMNS - 1, Math.max(0, Math.floor((event.clientX - area.left) / area.width * COLUMNS)));
    const height = Math.min(1, Math.max(0, (area.bottom - event.clientY) / area.height));
    // A quick pointer leaves no gaps.
    const from = last ?? { k, height };
    const steps = Math.max(1, Math.abs(k - from.k));
    for (let n = 0; n <= steps; n += 1) heights[Math.round(from.k + (k - from.k) * n / steps)] = from.height + (height - from.height) * n / steps;
    last = { k, height };
    at = k;
    show();
  };
  canvas.addEventListener("pointerdown", (event) => { canvas.setPointerCapture(event.pointerId); last = null; set(event); });
  canvas.addEventListener("pointermove", (event) => { if (canvas.hasPointerCapture(event.pointerId)) set(event); });
  canvas.addEventListener("pointerup", () => { keep(); again(); });
  canvas.addEventListener("keydown", (event) => {
    const [along, up] = { ArrowLeft: [-1, 0], ArrowRight: [1, 0], ArrowUp: [0, 0.05], ArrowDown: [0, -0.05] }[event.key] ?? [];
    if (along === undefined) return;
    event.preventDefault();
    at = (at + along + COLUMNS) % COLUMNS;
    heights[at] = Math.min(1, Math.max(0, heights[at] + up));
    show();
    if (up) keep();
  });
  for (const event of ["focus", "blur"]) canvas.addEventListener(event, show);
  box.append(field, canvas);
  setTimeout(show);
  return box;
}

/** The tip goes along the line of an image again and again, while the lever moves. */
function scan() {
  const own = drawn;
  const one = $("study-figure");
  const begun = performance.now();
  const follow = (now) => {
    if (drawn !== own || state.tab !== "image" || !one.figure) return;
    requestAnimationFrame(follow);
    if (!moves() || !one.inView) return;
    const share = ((now - begun) / LINE % 1 + 1) % 1;
    const { x } = one.panels[0];
    const at = x.from + share * (x.to - x.from);
    figure.present(one, { x: at, heights: one.figure.panels.map(({ layers }, k) => height(layers.filter((layer) => layer.kind === "line")[k ? 0 : 1], at)) });
  };
  if (state.tab === "image") requestAnimationFrame(follow);
}

/** Height of a line at a place. */
function height(line, at) {
  const { x: xs, y: ys } = line?.points ?? { x: [], y: [] };
  const k = xs.findIndex((x) => x >= at);
  return k < 0 || ys[k] === null ? NaN : ys[k];
}

/** Shows the tables of a study. A row that has changes to the case makes them. */
function show(tables) {
  const make = (name, ...children) => { const made = document.createElement(name); made.append(...children); return made; };
  $("tables").replaceChildren(...(tables ?? []).map(({ title, heads, rows }) => {
    const table = make("table");
    if (title) table.append(make("caption", title));
    if (heads.some(([words]) => words)) {
      table.append(make("thead", make("tr", ...heads.map(([words, about]) => Object.assign(make("th", words), { scope: "col", title: about })))));
    }
    table.append(make("tbody", ...rows.map(({ cells, set }) => {
      const [first, ...rest] = cells;
      const name = set ? Object.assign(make("button", first), { type: "button" }) : first;
      const line = make("tr", Object.assign(make("th", name), { scope: "row" }), ...rest.map((cell) => make("td", cell)));
      if (set) { line.className = "choice"; line.addEventListener("click", () => adopt(set)); }
      return line;
    })));
    // A long table scrolls by itself, also by keys, so that what is below stays in reach.
    return Object.assign(make("div", table), { tabIndex: 0, role: "region", ariaLabel: title || "table" });
  }));
  if (!found) return;
  const { set, take, file, save: words, name } = found;
  const button = (text, pressed) => {
    const made = Object.assign(make("button", text), { type: "button" });
    made.addEventListener("click", pressed);
    return made;
  };
  const row = make("p", ...(set ? [button(take, () => adopt(set))] : []), button(words, () => save(new Blob([file]), name)));
  row.className = "row";
  $("tables").append(row);
}

/** States the values of another case that the figure belongs to as well. */
function adopt(set) {
  if (!isCurrent()) return;
  state.set = { ...drawn.set, ...set };
  state.start = "";
  Object.assign(drawn, subject(drawn.clicks));
  remember(true);
  gone();
}

/** Computes the figure of the form, in stages; a `quick` one ends after the first. */
async function compute(quick, more = {}) {
  clearTimeout(timer);
  const options = { ...Object.fromEntries(new FormData($("study-form"))), ...more };
  const data = state.tab === "data" ? { data: measured } : {};
  $("progress").textContent = "computing …";
  const own = { ...subject(null), clicks: null, set: { ...state.set } };
  const whole = caseText();
  asking = own;
  let request = null;
  const warn = () => {
    if (!alone || asking !== own) return;
    const command = own.clicks ? `save the case file, then: ${$("study-command").textContent}` : "nanotap explore";
    $("long").textContent = `This takes long in a browser. On all processors of a machine: ${command}`;
  };
  const slow = setTimeout(warn, TERMINAL);
  const begun = performance.now();
  try {
    const sent = stream("study", "/api/study", { case: theCase(), start: state.start, tab: state.tab, options, quick, ...data, ...(pinned ? { pinned } : {}) }, (message) => {
      // An answer for an older case is dropped.
      if (asking !== own) return;
      if (message.progress) {
        $("progress").textContent = message.progress;
        // What is done shows how long the rest takes.
        const [, done, total] = /^(\d+) of (\d+)/.exec(message.progress) ?? [];
        if ((performance.now() - begun) * total / done > TERMINAL) warn();
        return;
      }
      if (!own.clicks && caseText() !== whole) { request?.abort(); return; }
      own.clicks = message.clicks;
      Object.assign(own, { case: own.case && caseOf(own, message.clicks) });
      drawn = own;
      shown = message.figure ?? null;
      found = message.found ?? null;
      $("progress").textContent = message.words;
      $("study-command").textContent = message.command;
      $("study-python").textContent = message.python;
      $("study-export").hidden = false;
      for (const button of document.querySelectorAll("[data-study-export]")) button.hidden = !shown;
      $("study-figure").hidden = !shown;
      show(message.tables);
      if (message.figure) figure.put($("study-figure"), message.figure);
      mark();
      scan();
      if (quick) $("progress").textContent = `${message.words}; “Compute” refines the curve and follows its branches`;
    });
    request = current("study");
    await sent;
  } catch (error) {
    if (asking === own) $("progress").textContent = superseded(error) ? "stopped" : error.message;
  }
  clearTimeout(slow);
  if (asking && asking !== own) return;
  asking = null;
  $("long").textContent = "";
}

/** The case of a figure, without the keys along its axes. */
function caseOf(own, clicks) {
  own.text ??= own.case;
  const [of, kept] = JSON.parse(own.text);
  const left = along(clicks);
  return JSON.stringify([of, kept.filter(([key]) => !left.includes(key))]);
}

/** Sets the values of the axes at a place, and shows the motion there. */
function go(place) {
  if (!drawn || !isCurrent()) return;
  const clicks = drawn.clicks ?? {};
  const orbit = nearest(place);
  state.start = "";
  for (const [axis, key] of Object.entries(clicks.set ?? {})) {
    const shown = orbit && axis === "x" ? orbit[0] : Number(place[axis].toPrecision(7));
    put(key.name, key.unit ? `${shown} ${key.unit}` : `${shown / key.factor}`, sameAs(key.name));
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

/** The drawn motion nearest to a place, if one is near: [x, heights by panel, start]. */
function nearest(place) {
  const { panel, u, v } = place;
  let best = null;
  let least = NEAR;
  for (const orbit of drawn?.clicks?.near ?? []) {
    const across = Math.abs(part(panel.x, orbit[0]) - u);
    if (across >= least) continue;
    for (const height of orbit[1][panel.index] ?? []) {
      const distance = Math.hypot(across, part(panel.y, height) - v);
      if (distance < least) { least = distance; best = orbit; }
    }
  }
  return best;
}
