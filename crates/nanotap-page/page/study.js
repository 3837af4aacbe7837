// The studies: a form for each, its figure in stages of increasing resolution, and clicks that go
// to a motion.

import { DISTANCES, state, basis, caseText, put, remember, statedText, theCase } from "./state.js";
import { base64Of, bytes, current, save, stream, stop, superseded } from "./api.js";
import { sameAs } from "./knobs.js";
import { hand } from "./hand.js";
import * as figure from "./figure.js";
import { moves } from "./lever.js";
import { part } from "./plot.js";
import { picture } from "./pictures.js";
import { local, t, worded } from "./words.js";
import { inField, parts, pointed } from "./entry.js";
import { make } from "./element.js";
import * as image from "./image.js";

const $ = (id) => document.getElementById(id);
const TABS = ["approach", "diagram", "branches", "resonance", "basin", "map", "plan", "levers", "image", "data"];
const MOST_DATA = 24e6;       // bytes of a measured file
const LINE = 6000;            // milliseconds in which the tip goes along the line of an image
const FIRST = 5;              // fields of a form that are shown at once, if it has more than one in addition
const NEAR = 0.05;            // fraction of a panel within which a click selects a drawn motion
const PAUSE = 250;            // milliseconds after a change before an approach curve is drawn anew
const TERMINAL = 60000;       // milliseconds of a study for which the page names the terminal
const TRIAL = 30000;          // the same for an estimate from a trial, which may be too short
const CALM = 500;             // milliseconds without a change before a study is tried
const NO_TRIAL = ["data", "image"]; // forms whose study is not tried: their command needs a file
/** A tapping curve of the DMT example, with its noise: docs/cases/fit.md. */
const EXAMPLE = { preset: "dmt", name: "dmt-tapping.csv", rows: "distance (nm),amplitude (nm),phase (deg)\n19.000,18.734,110.34\n17.875,18.388,67.00\n16.750,17.293,59.79\n15.625,16.188,54.08\n14.500,15.029,48.83\n13.375,13.921,44.17\n12.250,12.792,39.86\n11.125,11.691,35.75\n10.000,10.544,31.85\n" };
const PLAIN = {};             // studies that the page knows from the registry only: name -> what they are about
let plain = {};               // their forms
let forms = null;
let measured = null;          // name and content of the measured file
let kind = "";                // what it is if not a curve: "calibrate" for thermal noise, "image-states" for images
let hasImages = false;        // whether the file of a curve has images, too
let found = null;             // the case of a fit
let filled = "";              // the form that is shown
let drawn = null;             // what the displayed figure is of, and where its clicks go
let asking = null;            // the same of the figure that is being computed
let pinned = null;            // the figure that is drawn behind
let shown = null;             // the displayed figure, as it was received
let motion = null;            // the displayed motion
let timer = 0;
let trial = 0;                // the timer of the trial
let lastTrial = {};           // the study that was tried last, and its command
let gone = () => {};
let openCase = () => {};
let showData = () => {};

const views = () => state.views.study ?? [];
const calibrates = () => kind === "calibrate" && state.tab === "data";
/** Name of the form. */
const form = () => (state.tab === "data" && kind ? kind : state.tab);
const asked = () => JSON.stringify([basis(), form(), state.study, state.tab === "data" && measured?.[0]]);
const shape = () => asked() + JSON.stringify([forms[form()], state.tab in PLAIN && forms.usual[state.tab]]);
const named = (tab) => tab.id.slice("tab-".length);
/** What a study shows. */
const about = (name) => t("studies.about")[name] ?? `${PLAIN[name]}.`;
const hint = () => about(state.tab);

/** The keys of the case that a figure does not depend on: those along its axes. Other keys must be as
 *  they stay along the axis, or the axis is another one. */
function along(clicks) {
  const names = Object.values(clicks?.set ?? {}).map((key) => key.name);
  if (names.some((name) => DISTANCES.includes(name))) return [...names, ...DISTANCES];
  const held = Object.entries(clicks?.fixed ?? {}).every(([name, text]) => statedText(name) === text);
  return held ? names : [];
}

/** What a figure is of. */
function subject(clicks) {
  // Thermal noise is of no case.
  return { form: asked(), case: calibrates() ? "" : caseText(along(clicks)), start: state.tab === "basin" ? state.start : "" };
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
  $("stale").textContent = other ? state.tab === "data" ? t("studies.fitted") : t("studies.other") : "";
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

/** Takes a measured file, or a case file with the files that it names. */
async function take(...files) {
  const [file] = files;
  if (!file) return;
  if (files.some((one) => one.name.toLowerCase().endsWith(".toml"))) { openCase(files); return; }
  showData();
  if (state.tab !== "data") choose("data");
  if (file.size > MOST_DATA) { $("progress").textContent = t("studies.tooLarge", { name: file.name, size: file.size, most: MOST_DATA }); return; }
  open(file.name, { base64: await base64Of(file) });
}

/** Takes the content of a measured file. */
function open(...next) {
  measured = next;
  hasImages = false;
  change("");
  compute(false);
}

/** Shows the form of a curve, of thermal noise or of images. */
function change(is) {
  if (is !== kind) state.study = {};
  kind = is;
  filled = "";
  if (motion) fill(motion);
}

/** `motionChanged` is called when a click selected another motion; `studies` are those of the registry
 *  that have no tab made for them; `openFile` takes a case file; `toData` shows the view of measured data. */
export function begin(motionChanged, studies, openFile, toData) {
  gone = motionChanged;
  openCase = openFile;
  showData = toData;
  for (const study of studies) { PLAIN[study.name] = study.about; plain[study.name] = study.form; }
  addEventListener("dragover", (event) => { if (event.dataTransfer?.types.includes("Files")) event.preventDefault(); });
  addEventListener("drop", (event) => {
    if (!event.dataTransfer?.files.length) return;
    event.preventDefault();
    take(...event.dataTransfer.files);
  });
  for (const name of [...TABS, ...Object.keys(PLAIN)]) {
    const tab = document.createElement("button");
    Object.assign(tab, { type: "button", id: `tab-${name}` });
    tab.append(picture(name), "");
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
  $("study-form").addEventListener("submit", (event) => {
    event.preventDefault();
    if (state.tab === "data") return;
    state.ran = "yes";
    remember(true);
    compute(false);
  });
  figure.alive($("study-figure"), {
    views,
    tell: (place) => { $("hover").textContent = place ? `${figure.words(place)}${nearest(place) ? t("studies.drawnMotion") : ""}` : ""; },
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
  if (!(TABS.includes(state.tab) || state.tab in PLAIN)) state.tab = "approach";
  for (const tab of $("tabs").children) {
    const name = named(tab);
    // In the language of now.
    tab.title = about(name);
    tab.lastChild.data = t("cards")[name] ?? name.replaceAll("-", " ");
    const chosen = name === state.tab;
    tab.setAttribute("aria-selected", String(chosen));
    tab.tabIndex = chosen ? 0 : -1;
    // Within the strip of cards alone: the page stays where it is.
    if (chosen) $("tabs").scrollTo({ left: tab.offsetLeft - 0.4 * $("tabs").clientWidth });
  }
  $("study-panel").setAttribute("aria-labelledby", `tab-${state.tab}`);
  filled = "";
}

/** Takes the displayed motion, with its forms. A figure of this case stays; one of another case
 *  is marked; one that the address contains is computed again, and an approach curve always. */
export function fill(next) {
  motion = next;
  forms = { ...plain, ...next.forms };
  // What a case cannot do has no fields: only a lever makes images, is compared with others, and has a drive of one shot.
  for (const tab of $("tabs").children) tab.hidden = !forms[named(tab)].length;
  if (!forms[state.tab].length) { state.tab = "approach"; restore(); }
  const now = shape();
  if (now !== filled) {
    filled = now;
    build();
    if (drawn && drawn.form !== asked()) forget();
  }
  figure.renew($("study-figure"));
  mark();
  clearTimeout(timer);
  foresee();
  if (same(asking, subject(asking?.clicks)) || isCurrent()) return;
  if (asking) {
    stop("study");
    wait(null);
    $("progress").textContent = hint();
  }
  // Measured data are drawn over the model by themselves; a fit stays until the next one.
  const data = state.tab === "data" && measured && !found;
  if (state.ran === "yes" && state.tab !== "data") compute(false);
  else if (state.tab === "approach" || data) timer = setTimeout(() => { if (!isCurrent()) compute(!data); }, PAUSE);
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
  wait(null);
  drawn = null;
  found = null;
  shown = null;
  figure.clear($("study-figure"));
  $("tables").replaceChildren();
  $("study-export").hidden = true;
  $("progress").textContent = hint();
  $("hover").textContent = "";
}

/** Names the terminal for a study that takes this many milliseconds, or an unknown time. */
function long(time, command) {
  const words = Number.isFinite(time) ? t(time < 5.4e6 ? "studies.minutes" : "studies.hours", { count: Math.max(1, Math.round(time / (time < 5.4e6 ? 6e4 : 3.6e6))) }) : t("studies.minute");
  const copy = make("button", { type: "button", textContent: t("plan.copy") });
  copy.addEventListener("click", async () => {
    const done = await navigator.clipboard?.writeText(command).then(() => true, () => false);
    copy.textContent = t(done ? "plan.copied" : "plan.notCopied");
  });
  $("long").replaceChildren(t("studies.long", { time: words }), ...(command ? [" ", t("studies.terminal"), make("pre", { tabIndex: 0, textContent: command }), copy] : []));
}

/** Whether a field is of one number, with or without a unit. */
const isNumber = ({ name, hint, choices }) => !choices && !/[,=:]|STATE/.test(hint ?? "") && !["start", "state", "profile"].includes(name);
/** The text of a field as the program reads it. */
const read = (field, text) => (field.name === "drive_signal" ? text.split(" ").map(pointed).join(" ") : isNumber(field) ? pointed(text) : text);

const options = () => Object.fromEntries([...new FormData($("study-form"))].map(([name, text]) => [name, read(forms[form()].find((field) => field.name === name) ?? {}, text)]));

/** Tries a study for a moment once its form and the case rest, and says so if it takes long. */
function foresee() {
  clearTimeout(trial);
  stop("trial");
  const of = JSON.stringify(subject(null));
  if (lastTrial.of === of) return;
  lastTrial = { of };
  if (!asking) $("long").textContent = "";
  if (NO_TRIAL.includes(state.tab) || isCurrent()) return;
  trial = setTimeout(async () => {
    if (asking) { lastTrial = {}; return; }
    try {
      await stream("trial", "/api/study", { case: theCase(), start: state.start, tab: state.tab, options: options(), estimate: true }, ({ estimate, command }) => {
        if (lastTrial.of !== of) return;
        lastTrial = { of, command };
        if (1000 * estimate > TRIAL) long(1000 * estimate, command);
      });
    } catch {
      // What is wrong is reported when the study is computed.
    }
  }, CALM);
}

/** Takes the request that is being computed; only then it can be stopped. */
function wait(own) {
  asking = own;
  const button = $("stop");
  if (button) button.hidden = !own;
}

/** Creates the form of the tab with its initial values. */
function build() {
  const box = $("study-form");
  const fields = forms[form()].map(entry);
  const fold = (words, from, open = false) => {
    if (fields.length > from + 1) fields.push(make("details", { className: "row", open }, make("summary", { textContent: words }), ...fields.splice(from)));
  };
  if (state.tab in PLAIN || state.tab === "data") fold(t("studies.fields", { count: fields.length - FIRST }), FIRST);
  if (state.tab === "approach") fold(t("studies.range"), 0, Boolean(state.study.from || state.study.to));
  const note = $("long");
  box.replaceChildren(...fields);
  const button = (words, pressed, id) => {
    const made = make("button", { type: pressed ? "button" : "submit", textContent: words });
    if (id) made.id = id;
    if (pressed) made.addEventListener("click", pressed);
    box.append(made);
    return made;
  };
  if (state.tab === "data") {
    const file = make("input", { type: "file" });
    file.addEventListener("change", () => take(file.files[0]));
    const label = document.createElement("label");
    label.append(measured ? `${measured[0]} ` : `${t("data.file")} `, file);
    box.prepend(label);
  }
  box.append(note);
  if (state.tab !== "data") button(t("studies.compute"));
  else if (kind === "image-states") {
    button(t("data.image.again"), () => compute(false), "image-again");
    if (hasImages) button(t("data.image.curve"), () => open(...measured), "image-curve");
  } else if (!kind) {
    button(t("data.fit"), () => compute(false, { fit: "yes" }), "fit");
    button(t("data.force"), () => compute(false, { reconstruct: "yes" }), "reconstruct").title = t("data.forceAbout");
    if (hasImages) button(t("data.image.ask"), () => compute(false, { "image-states": "first" }), "image-states").title = t("data.image.askAbout");
    if (measured) button(t("data.calibrate"), () => compute(false, { calibrate: "first" }), "calibrate").title = t("data.calibrateAbout");
    else if (state.preset === EXAMPLE.preset) button(t("data.example"), () => open(EXAMPLE.name, EXAMPLE.rows), "example-data");
  }
  button(t("studies.stop"), () => stop("study"), "stop").hidden = !asking;
  const pin = button(t(pinned ? "studies.unpin" : "studies.pin"), () => {
    const before = pinned;
    pinned = pinned || !drawn ? null : shown;
    pin.textContent = t(pinned ? "studies.unpin" : "studies.pin");
    pin.setAttribute("aria-pressed", String(Boolean(pinned)));
    // Without its pinned curves the figure is drawn anew.
    if (before && drawn && isCurrent()) compute(state.tab === "approach" && state.ran !== "yes");
  }, "pin");
  pin.title = t("studies.pinAbout");
  pin.setAttribute("aria-pressed", String(Boolean(pinned)));
  if (drawn) return;
  $("progress").textContent = hint();
  // The approach curve comes by itself.
  $("study-figure").hidden = state.tab !== "approach";
}

/** A field of the form. */
function entry(field) {
  if (field.drawn) return hand(field, mark, again);
  const label = document.createElement("label");
  const { words, about, hint, choices } = worded(form(), field);
  label.textContent = `${words} `;
  label.title = about;
  const input = document.createElement(field.choices ? "select" : "input");
  (field.choices ?? []).forEach((choice, k) => input.add(new Option(choices[k], choice)));
  // What a study of the registry needs has a usual value for the case.
  const usual = state.tab in PLAIN ? forms.usual[state.tab]?.[field.name] : undefined;
  Object.assign(input, { name: field.name, value: inField(state.study[field.name] ?? usual ?? field.value) });
  if (!field.choices) Object.assign(input, { size: field.hint ? 15 : 10, placeholder: hint });
  input.addEventListener("change", () => {
    state.study[field.name] = read(field, input.value);
    if (field.name === "surface") for (const box of $("study-form").querySelectorAll(".hand")) box.hidden = input.value !== "drawn";
    filled = shape();
    remember(true);
    mark();
    foresee();
    if (state.tab === "data" && measured) compute(false);
  });
  label.append(input);
  if (field.slider) label.append(slide(words, field.slider, input));
  return label;
}

/** A slider of a field, logarithmic around its usual value. */
function slide(words, { from, to, usual, unit }, input) {
  const range = make("input", { type: "range", min: 0, max: 1000 });
  range.setAttribute("aria-label", t("studies.slider", { words }));
  const { number, unit: of } = parts(input.value) ?? {};
  range.value = 1000 * Math.log((of === unit ? number : usual) / from) / Math.log(to / from);
  range.addEventListener("input", () => { input.value = inField(`${Number((from * (to / from) ** (range.value / 1000)).toPrecision(3))}${unit ? ` ${unit}` : ""}`); });
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
  $("tables").replaceChildren(...(tables ?? []).map(({ title, heads, rows }) => {
    const table = make("table");
    if (title) table.append(make("caption", {}, local(title)));
    if (heads.some(([words]) => words)) {
      table.append(make("thead", {}, make("tr", {}, ...heads.map(([words, about]) => make("th", { scope: "col", title: about }, words)))));
    }
    table.append(make("tbody", {}, ...rows.map(({ cells, set }) => {
      const [first, ...rest] = cells;
      const name = set ? make("button", { type: "button" }, local(first)) : local(first);
      const line = make("tr", {}, make("th", { scope: "row" }, name), ...rest.map((cell) => make("td", {}, local(cell))));
      if (set) { line.className = "choice"; line.addEventListener("click", () => adopt(set)); }
      return line;
    })));
    // A long table scrolls by itself, also by keys, so that what is below stays in reach.
    return make("div", { tabIndex: 0, role: "region", ariaLabel: title || "table" }, table);
  }));
  if (!found) return;
  const { set, take, file, save: words, name } = found;
  const button = (text, pressed) => {
    const made = make("button", { type: "button" }, text);
    made.addEventListener("click", pressed);
    return made;
  };
  const row = make("p", { className: "row" }, set && button(take, () => adopt(set)), button(words, () => save(new Blob([file]), name)));
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
  clearTimeout(trial);
  stop("trial");
  const given = { ...options(), ...more, ...(state.tab === "data" && kind && { [kind]: "yes" }) };
  const data = state.tab === "data" ? { data: measured } : {};
  $("progress").textContent = t("busy");
  const own = { ...subject(null), clicks: null, set: { ...state.set } };
  const whole = caseText();
  wait(own);
  let request = null;
  const warn = (time) => { if (asking === own) long(time, own.clicks ? $("study-command").textContent : lastTrial.command); };
  const slow = setTimeout(() => warn(NaN), TERMINAL);
  const begun = performance.now();
  try {
    const sent = stream("study", "/api/study", { case: theCase(), start: state.start, tab: state.tab, options: given, quick, ...data, ...(pinned ? { pinned } : {}) }, (message) => {
      // An answer for an older case is dropped.
      if (asking !== own) return;
      if (message.progress) {
        $("progress").textContent = local(message.progress);
        // What is done shows how long the rest takes.
        const [, done, total] = /^(\d+) of (\d+)/.exec(message.progress) ?? [];
        const whole = (performance.now() - begun) * total / done;
        if (whole > TERMINAL) warn(whole);
        return;
      }
      if (message.form && !kind) {
        // The file turned out to be of thermal noise, or of images.
        kind = message.form;
        state.study = {};
        Object.assign(own, subject(null));
        filled = shape();
        build();
      }
      if (!own.clicks && !calibrates() && caseText() !== whole) { request?.abort(); return; }
      own.clicks = message.clicks;
      Object.assign(own, { case: own.case && caseOf(own, message.clicks) });
      drawn = own;
      shown = message.figure ?? null;
      found = message.found ?? null;
      if (message.has_images && !hasImages) { hasImages = true; build(); }
      const words = message.words === PLAIN[state.tab] ? hint() : local(message.words);
      $("progress").textContent = message.image ? image.sentence(message.image) : words;
      $("study-command").textContent = message.command;
      $("study-python").textContent = message.python;
      $("study-export").hidden = false;
      for (const button of document.querySelectorAll("[data-study-export]")) button.hidden = !shown;
      $("study-figure").hidden = !shown;
      show(message.tables);
      if (message.image) $("tables").replaceChildren(...image.details(message.image));
      if (message.figure) figure.put($("study-figure"), message.image ? image.inWords(message.figure) : message.figure);
      mark();
      scan();
      if (quick) $("progress").textContent = t("studies.refines", { words });
    });
    request = current("study");
    await sent;
  } catch (error) {
    if (asking === own) $("progress").textContent = superseded(error) ? t("studies.stopped") : local(error.message);
  }
  clearTimeout(slow);
  if (asking && asking !== own) return;
  wait(null);
  $("long").textContent = "";
  if (quick) { lastTrial = {}; foresee(); }
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
