// A line of an image under feedback: knobs, five strips on one axis, and why the image is not the surface.

import { DISTANCES, basis, caseText, chosen, put, state, statedText, theCase } from "./state.js";
import { stop, stream, superseded } from "./api.js";
import { local, t } from "./words.js";
import { make } from "./element.js";
import { axis, scale } from "./axis.js";
import { COLOURS as STATES } from "./curve.js";
import { inField, parts, question, setpoint as readSetpoint, understood } from "./entry.js";
import { hand } from "./hand.js";
import * as figure from "./figure.js";

const $ = (id) => document.getElementById(id);
const REST = 300;             // milliseconds without a change before the exact line is computed
const COLOURS = { ...STATES, trace: "#0072b2", retrace: "#d55e00", surface: "#9a7b4f", setpoint: "#5a5a5a" };
/** Knobs with a number, in order: the ends of their sliders, the unit of a bare number, and what a line says of them. */
const KNOBS = {
  gain: { unit: "", of: (line) => line.gain },
  rate: { unit: "Hz", of: (line) => line.line_rate },
  setpoint: { slider: { from: 0.05, to: 0.995 }, unit: "", of: (line) => { const value = Number((line.setpoint.value / line.free.value).toPrecision(4)); return { value, shown: `${Number((100 * value).toPrecision(4))} %` }; } },
  height: { slider: { from: 0.1, to: 100, log: true }, unit: "nm" },
  size: { slider: { from: 50, to: 5000, log: true }, unit: "nm", of: (line) => ({ value: line.size.value * 1e9, shown: line.size.shown }) },
};
let calls = {};               // of main.js: refused(error), note() for a new entry of the history, states(), moved() for another setpoint
let active = false;
let form = [];                // the fields of the program
let formOf = "";
let line = null;              // the line that is shown
let lineOf = "";              // what it was computed for
let shownText = {};           // texts of the knobs for which it was computed
let outdated = false;
let underway = false;
let timer = 0;
let touched = "";             // the knob that was moved last
let known = true;             // whether averaging describes the lever
let progress = "";
let failed = "";
let setpointOf = "";          // the setpoint that a click on a strip left

/** `calls`: `refused(error)`, `note()` for a change that can be undone, `states()` shows the states,
 *  `moved()` follows another setpoint. */
export function begin(given) {
  calls = given;
  const toggle = (name) => make("label", { className: "small" }, make("input", { type: "checkbox", id: `scan-${name}`, checked: true }), " ", make("span", { id: `scan-${name}-words` }));
  $("view-scan").replaceChildren(make("section", { className: "card", id: "scan" },
    make("div", { className: "row head" }, make("h2", { id: "scan-heading" }), toggle("trace"), toggle("retrace")),
    make("form", { id: "scan-knobs", className: "settings", autocomplete: "off" }),
    make("p", { id: "scan-say", className: "big" }),
    make("p", { id: "scan-state", className: "small" }),
    make("figure", { id: "strips", className: "paper", tabIndex: 0 }),
    make("p", { id: "scan-reading", className: "small" }),
    make("details", { id: "scan-command", hidden: true }, make("summary"), make("pre", { tabIndex: 0 }))));
  $("scan-say").setAttribute("role", "status");
  $("strips").setAttribute("aria-describedby", "keys");
  $("scan-knobs").addEventListener("submit", (event) => event.preventDefault());
  for (const name of ["trace", "retrace"]) {
    $(`scan-${name}`).addEventListener("change", () => {
      const other = $(name === "trace" ? "scan-retrace" : "scan-trace");
      if (!$(`scan-${name}`).checked && !other.checked) other.checked = true;
      strips();
    });
  }
  figure.alive($("strips"), {
    views: () => state.views.strips ?? [],
    tell: (place) => { $("scan-reading").textContent = place ? figure.words(place) : line ? t("scan.time", { time: line.time }) : ""; },
    zoom: (views) => { state.views.strips = views; calls.note(); },
    go,
  });
}

export function enter() {
  active = true;
  $("scan-heading").textContent = t("scan.heading");
  for (const name of ["trace", "retrace"]) $(`scan-${name}-words`).textContent = t(`scan.${name}`);
  $("scan-command").firstElementChild.textContent = t("scan.command");
  $("strips").setAttribute("aria-label", t("scan.strips"));
  formOf = "";
  touched = "";
  if (form.length) fields(form);
  changed();
}

export function leave() {
  active = false;
  outdated = false;
  clearTimeout(timer);
  stop("line"); stop("line-quick");
}

/** The setpoint, as a text: that of the page, the one before a click on a strip, or the case's own. */
const setpoint = () => state.set["drive.setpoint"] ?? (setpointOf && state.set["gap.tip"] ? setpointOf : statedText("drive.setpoint"));

function options() {
  const given = {};
  for (const name of ["surface", "profile", "height", "size", "rate", "gain"]) if (state.study[name]) given[name] = state.study[name];
  const own = setpoint();
  if (own) given.setpoint = own;
  return given;
}

const subject = () => JSON.stringify([caseText(DISTANCES), options()]);

/** A value changed: the averaged lever answers at once, the exact one when the values rest. */
export function changed() {
  if (!active) return;
  if (form.length && chosenSurface() === "drawn" && !state.study.profile) { clearTimeout(timer); stop("line"); refuse(new Error(t("scan.drawIt"))); return; }
  if (subject() === lineOf && line?.exact) { outdated = false; clearTimeout(timer); stop("line"); draw(); return; }
  failed = "";
  progress = "";
  stop("line");
  draw();
  quick();
  clearTimeout(timer);
  timer = setTimeout(exact, REST);
}

const body = (quick) => ({ case: theCase(), tab: "line", options: options(), quick });

/** The averaged lever, until it has answered for the present values. */
async function quick() {
  outdated = true;
  if (underway) return;
  underway = true;
  while (outdated && active) {
    outdated = false;
    const of = subject();
    const texts = typed();
    try {
      await stream("line-quick", "/api/study", body(true), (answer) => {
        fields(answer.form);
        known = Boolean(answer.line);
        // The exact line is not replaced by an approximate one.
        if (answer.line && active && !(lineOf === subject() && line?.exact)) take(answer.line, of, texts);
      });
    } catch (error) { if (!superseded(error) && of === subject()) refuse(error); }
  }
  underway = false;
}

async function exact() {
  const of = subject();
  const texts = typed();
  try {
    await stream("line", "/api/study", body(false), (answer) => {
      if (of !== subject() || !active) return;
      if (answer.progress) { progress = answer.progress; draw(); }
      if (answer.form) fields(answer.form);
      if (!answer.line) return;
      fields(answer.line.form);
      $("scan-command").hidden = false;
      $("scan-command").lastElementChild.textContent = answer.command;
      take(answer.line, of, texts);
    });
  } catch (error) { if (!superseded(error) && of === subject()) refuse(error); }
}

function refuse(error) {
  failed = error.message;
  draw();
}

function take(next, of, texts) {
  line = next;
  lineOf = of;
  failed = "";
  draw();
  // The knobs show what the line says of them.
  shownText = of === subject() ? typed() : texts;
}

// The knobs.

const field = (name) => form.find((one) => one.name === name);

/** Makes the fields of a case. */
function fields(own) {
  const of = JSON.stringify([own, document.documentElement.lang, basis()]);
  if (of === formOf) return;
  formOf = of;
  form = own;
  $("scan-knobs").replaceChildren(...(form.length ? [surface(), ...Object.keys(KNOBS).map(knob), drawn()] : []));
  draw();
}

function surface() {
  const list = make("select", { id: "scan-surface" });
  for (const choice of field("surface").choices) list.add(new Option(t("scan.surfaces")[choice] ?? choice, choice));
  list.value = state.study.surface ?? field("surface").value;
  list.addEventListener("change", () => tell("surface", list.value, true));
  return box("surface", list);
}

function box(name, ...inputs) {
  const label = make("label", { htmlFor: `scan-${name}`, textContent: t(`scan.knobs.${name}`) });
  const made = make("div", { className: inputs.length > 1 ? "field" : "field choice-field" });
  made.append(label, ...inputs);
  return made;
}

function knob(name) {
  const text = make("input", { type: "text", id: `scan-${name}`, inputMode: "text" });
  const range = make("input", { type: "range", id: `scan-${name}-slider`, min: 0, max: 1000 });
  range.setAttribute("aria-label", t(`scan.knobs.${name}`));
  const ends = KNOBS[name].slider ?? { ...field(name).slider, log: true };
  const value = () => { const u = range.value / 1000; return ends.log ? ends.from * (ends.to / ends.from) ** u : ends.from + u * (ends.to - ends.from); };
  const slid = (finished) => {
    const number = Number(value().toPrecision(3));
    text.value = inField(name === "setpoint" ? `${Number((100 * number).toPrecision(3))} %` : withUnit(number, name));
    range.setAttribute("aria-valuetext", text.value);
    tell(name, name === "setpoint" ? String(number) : withUnit(number, name), finished);
  };
  range.addEventListener("input", () => slid(false));
  range.addEventListener("change", () => slid(true));
  text.addEventListener("change", () => entered(name, text));
  range.scale = ends;
  return box(name, text, range);
}

const withUnit = (number, name) => `${number}${KNOBS[name].unit ? ` ${KNOBS[name].unit}` : ""}`;

function entered(name, text) {
  if (text.value.trim() === "") { delete state.study[name]; changed(); calls.note(); return; }
  if (name === "setpoint") { const read = readSetpoint(text.value); if (read) tell(name, read, true); else calls.refused(new Error(t("set.setpointWrong"))); return; }
  const before = parts(typed()[name] ?? "");
  const meant = understood(text.value, { unit: KNOBS[name].unit, number: before?.number ?? 1 });
  if (meant.instead) question(text, meant, (use) => tell(name, use, true)); else tell(name, meant.text, true);
}

/** States the value of a knob. */
function tell(name, text, finished) {
  touched = name;
  if (name === "setpoint") { setpointOf = ""; put("drive.setpoint", text, DISTANCES); } else state.study[name] = text;
  if (finished) calls.note();
  changed();
  if (finished && name === "setpoint") calls.moved();
}

function drawn() {
  const made = hand(field("profile"), () => { touched = "surface"; changed(); }, () => changed());
  made.hidden = chosenSurface() !== "drawn";
  return made;
}

const chosenSurface = () => state.study.surface ?? field("surface")?.value;

/** The texts of the knobs as they are. */
function typed() {
  return Object.fromEntries(["surface", ...Object.keys(KNOBS)].map((name) => [name, $(`scan-${name}`)?.value ?? ""]));
}

/** Shows in the knobs what the line says of them, or what was stated. */
function settings() {
  const fresh = line && lineOf === subject();
  const list = $("scan-surface");
  if (!list) return;
  list.value = chosenSurface();
  for (const one of $("scan-knobs").querySelectorAll(".hand")) one.hidden = list.value !== "drawn";
  for (const [name, { of, unit }] of Object.entries(KNOBS)) {
    const [text, range] = [$(`scan-${name}`), $(`scan-${name}-slider`)];
    const said = name === "setpoint" ? undefined : state.study[name] ?? field(name).value;
    const own = fresh && of ? of(line) : null;
    const read = parts(said ?? "");
    if (document.activeElement !== text && (said || own)) text.value = inField(said || own.shown);
    const number = own?.value ?? (read ? read.number * ({ µm: 1000, um: 1000, mm: 1e6, m: 1e9 }[unit === "nm" ? read.unit : ""] ?? 1) : NaN);
    if (!range.matches(":active") && Number.isFinite(number)) {
      const { from, to, log } = range.scale;
      range.value = 1000 * (log ? Math.log(number / from) / Math.log(to / from) : (number - from) / (to - from));
    }
    range.setAttribute("aria-valuetext", text.value);
    text.parentElement.hidden = name === "height" && ["flat", "of the case"].includes(list.value);
  }
}

// What is shown.

function draw() {
  if (!active) return;
  settings();
  const none = formOf && !form.length;
  const stale = Boolean(line) && lineOf !== subject();
  $("strips").classList.toggle("stale", stale && !none);
  $("scan-say").classList.toggle("stale", stale && !failed && !none);
  const words = none ? t("scan.noLever") : local(failed || sentence());
  if ($("scan-say").textContent !== words) $("scan-say").textContent = words;
  $("scan-state").textContent = none || failed ? "" : status(stale);
  $("strips").dataset.line = none ? "none" : failed ? "failed" : stale || !line ? "stale" : line.exact ? "exact" : "approximate";
  for (const name of ["strips", "scan-reading"]) $(name).hidden = Boolean(none);
  if (none) { line = null; lineOf = ""; $("scan-command").hidden = true; figure.clear($("strips")); return; }
  strips();
}

function status(stale) {
  const follows = progress ? t("scan.progress", { progress }) : "";
  if (!line) return follows || t("scan.computing");
  if (stale) {
    const before = touched && shownText[touched];
    const words = before && touched !== "surface" ? t("scan.stale", { knob: t(`scan.knobs.${touched}`).toLowerCase(), value: before }) : t("scan.former");
    return [words, follows || (known ? "" : t("scan.computing"))].filter(Boolean).join(" · ");
  }
  return line.exact ? t("scan.exact") : follows ? `≈ ${follows}` : t("scan.approximate");
}

const percent = (share) => Number((100 * share).toPrecision(2));

/** The three causes, apart, and how hard the tip presses. */
function sentence() {
  if (!line) return "";
  const share = line.lags.reduce((sum, lag) => sum + lag.share, 0) / line.lags.length;
  const force = line.force.value > 0 ? t("scan.force", { force: line.force.shown }) : t("scan.touchesNot");
  if (!line.exact) return [t(share > 0 ? "scan.off" : "scan.on", { share: percent(share) }), force].join(" ");
  const said = [];
  const direction = (one) => t(`scan.directions.${one.direction}`);
  const lost = line.lags.find((lag) => lag.lost);
  if (lost) said.push(t("scan.lost", { x: lost.lost.shown, direction: direction(lost) }));
  if (line.lagging) {
    const worst = line.lags.filter((lag) => lag.largest).sort((a, b) => b.largest.error.value - a.largest.error.value)[0];
    const { x, until, flies, height } = worst.largest;
    const image = height?.value ? t(flies ? "scan.high" : "scan.low", { height: height.shown }) : "";
    said.push(`${t("scan.lags", { share: percent(share) })}, ${t(flies ? "scan.flies" : "scan.presses", { x: x.shown, until: until.shown, direction: direction(worst), height: image })}.`);
  } else said.push(line.slow ?? (line.rings ? "" : t(line.changes.length ? "scan.keepsUp" : "scan.follows", { rms: line.tracking.shown })));
  if (line.changes.length) {
    const largest = [...line.changes].sort((a, b) => Math.abs(b.change) - Math.abs(a.change))[0];
    said.push(t("scan.changes", { from: largest.from, to: largest.to, x: largest.x.shown, direction: direction(largest), height: largest.height.shown }));
    if (line.changes.length > 1) said.push(t("scan.more", { count: line.changes.length }));
  } else said.push(t("scan.keeps"));
  said.push(loop(), force);
  return said.filter(Boolean).join(" ");
}

/** Above which gain the loop rings, and how near it is. */
function loop() {
  const { largest_gain: largest, shown } = line.loop ?? {};
  const values = { gain: line.gain.shown, largest: shown, share: percent(line.gain.value / largest) };
  if (line.rings?.multiplier >= 1) return largest > 0 && line.gain.value > largest ? t("scan.rings", values) : largest === 0 ? t("scan.ringsAlways") : line.rings.sentence;
  if (!largest) return "";
  return t(line.rings ? "scan.mayRing" : "scan.loop", values);
}

const middle = (list) => { const all = list.filter(Number.isFinite).sort((a, b) => a - b); return all[Math.floor(all.length / 2)] ?? 0; };

/** The five strips on one axis. */
function strips() {
  if (!line) { figure.clear($("strips")); return; }
  const shown = ["trace", "retrace"].filter((name) => $(`scan-${name}`).checked && line[name]);
  if (!shown.length) shown.push("trace");
  const [along, unit] = scale(line.size.value, "m");
  const x = line.x.map((v) => v * along);
  const step = x.length > 1 ? x[1] - x[0] : along * line.size.value;
  const all = (name) => shown.flatMap((one) => line[one][name]).filter((v) => v !== null);
  const span = (list, pad = 0.08) => { const [low, high] = [Math.min(...list), Math.max(...list)]; const more = pad * (high - low || Math.abs(high) || 1); return [low - more, high + more]; };
  const across = axis(t("scan.axes.x"), unit, [0, along * line.size.value]);
  const curve = (one, name, factor, label = "", list = line[one][name]) => ({ kind: "line", points: { x, y: list.map((v) => (v === null ? null : v * factor)) }, dash: one === "retrace" ? "dashed" : "solid", width: 1, colour: COLOURS[one], label });
  const rule = (at, upright = false) => ({ kind: "rule", at, upright, dash: "dashed", width: 0.4, colour: COLOURS.setpoint, label: "" });
  const changes = (line.changes ?? []).filter((change) => shown.includes(change.direction)).map((change) => rule(change.x.value * along, true));
  const panel = (y, layers, legend = "hidden") => ({ title: "", x: across, y, layers: [...layers, ...changes], legend });
  // Deflection: the band that it fills, in the colour of the state.
  const first = line[shown[0]];
  const [long, ofLength] = scale(line.free.value, "m");
  const band = ["attractive", "repulsive", "free", "irregular"].flatMap((name) => ["high", "low"].map((edge, k) => ({
    kind: "bars", width: step, joined: true, foot: 0, colour: `${COLOURS[name]}59`, label: k || !first.state.includes(name) ? "" : t(`scan.states.${name}`),
    points: { x, y: first[edge].map((v, n) => (v === null || first.state[n] !== name ? null : v * long)) },
  })));
  const edges = shown.flatMap((one) => ["high", "low"].map((edge) => ({ ...curve(one, edge, long), width: 0.7, colour: COLOURS.free })));
  const push = Math.max(...all("force"), 0);
  const [newton, ofForce] = scale(push, "N");
  const setpointAt = line.setpoint.value * long;
  const level = middle(line.trace.height.map((z, k) => (z === null ? NaN : z - line.trace.surface[k])));
  const heights = shown.flatMap((one) => line[one].height.filter((v) => v !== null).map((v) => v - level));
  const range = span([...heights, ...all("surface")]);
  const [tall, ofHeight] = scale(Math.max(...range.map(Math.abs)), "m");
  const name = (one) => t("scan.image", { direction: t(`scan.directions.${one}`) });
  const made = {
    rows: 5, cols: 1, column_widths: [], row_heights: [1, 1, 1, 1, 1.3], share_x: true, least: 66,
    panels: [
      panel(axis(t("scan.axes.deflection"), ofLength, span([...all("low"), ...all("high")].map((v) => v * long))), [...band, ...edges], "above"),
      panel(axis(t("scan.axes.force"), ofForce, [0, 1.12 * (push || 1e-12) * newton]), shown.map((one) => curve(one, "force", newton))),
      panel(axis(t("scan.axes.amplitude"), ofLength, span([0, ...all("amplitude").map((v) => v * long), setpointAt], 0.06)), [{ ...rule(setpointAt), width: 0.8, label: t("scan.setpoint") }, ...shown.map((one) => curve(one, "amplitude", long))], "above"),
      panel(axis(t("scan.axes.phase"), "°", span([0, 180, ...all("phase")], 0)), shown.map((one) => curve(one, "phase", 1))),
      panel(axis(t("scan.axes.height"), ofHeight, range.map((v) => v * tall)), [
        { kind: "bars", width: step, joined: true, foot: range[0] * tall, colour: `${COLOURS.surface}80`, label: t("scan.surface"), points: { x, y: line.trace.surface.map((v) => (v === null ? null : v * tall)) } },
        ...shown.map((one) => curve(one, "height", tall, name(one), line[one].height.map((v) => (v === null ? null : v - level)))),
      ], "above"),
    ],
  };
  $("strips").line = { ...line, level };
  figure.put($("strips"), made);
  if (!$("strips").place) $("scan-reading").textContent = t("scan.time", { time: line.time });
}

/** A click on a strip: the states at the distance there, and that in which the lever is. */
function go(place) {
  if (!line || lineOf !== subject()) return;
  const [along] = scale(line.size.value, "m");
  const one = line[$("scan-trace").checked || !line.retrace ? "trace" : "retrace"];
  const k = Math.min(line.x.length - 1, Math.max(0, Math.round(place.x / along / line.size.value * line.x.length - 0.5)));
  const distance = one.height[k] - one.surface[k];
  if (!Number.isFinite(distance) || one.height[k] === null) return;
  setpointOf = setpoint() ?? String(line.setpoint.value / line.free.value);
  put("gap.tip", `${Number((distance * 1e9).toPrecision(5))} nm`, DISTANCES);
  state.start = "";
  chosen.row = ["attractive", "repulsive", "free"].includes(one.state[k]) ? { class: "periodic", stable: true, regime: one.state[k], period: 1, phase: { value: one.phase[k] } } : null;
  calls.states();
}
