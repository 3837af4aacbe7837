// A contact law as the user's own formula: its text, the values of its parameters, its curve, and what is wrong
// with it. The case takes it as soon as it is right; until then the last right one stays.

import { basis, caseText, put, state, statedText, theCase } from "./state.js";
import { ask, superseded } from "./api.js";
import { local, t } from "./words.js";
import { drawn, make } from "./element.js";
import { inField, pointed, question, understood } from "./entry.js";

const LOOK = 150;             // milliseconds without typing before the curve is drawn
const TAKE = 900;             // and before the case takes the formula
const AROUND = 18;            // characters shown before and behind a mistake
const PARAMETERS = "sample.parameters.";
const [WIDE, HIGH, LEFT, BOTTOM, EDGE] = [280, 150, 48, 26, 8]; // of the curve
const box = document.getElementById("formula");
let page = {};                // what set.js passes: see begin
let keys = [];
let taken = null;             // the formula of the case, as shown last
let of = "";                  // the case that it is of
let lang = "";
let looked = "";              // what the curve was drawn for
let taking = false;
let timers = [];
let answer = { keys: [], missing: [] };
const edited = new Map();     // values that were typed and are not in the case yet: name -> text
const former = new Map();     // the last known values
const fields = new Map();     // name -> parts of its field
let laws = new Map();         // the changes with which a law with a formula was left

/** `field(id, words)` makes a field with a slider, `say(key, text, finished)` states a value, `changed(key)` is
 *  called when the case took a formula. */
export function begin(own) {
  page = own;
  box.addEventListener("submit", (event) => event.preventDefault());
}

const key = (name) => keys.find((one) => one.name === name);
const isFormula = (law) => (law ?? "").split("+").some((term) => term.trim() === "formula");
const text = () => box.querySelector("textarea");

/** Remembers a case that leaves its formula for another law, and returns the changes with which a law with a
 *  formula was left. */
export function leaving(law, next) {
  if (isFormula(law)) laws = new Map([[basis(), theCase().set]]);
  return isFormula(next) ? laws.get(basis()) : undefined;
}

/** Shows the formula of a case. */
export function show(next) {
  keys = next;
  box.hidden = !isFormula(key("sample.law")?.value);
  if (box.hidden) { taken = null; return; }
  if (lang !== document.documentElement.lang || !text()) build();
  // The answer may be of a former case: what is stated now counts.
  const own = statedText("sample.force") ?? key("sample.force")?.value ?? "";
  if (own.trim() !== taken?.trim() || of !== basis()) {
    if (of !== basis()) former.clear();
    [taken, of] = [own, basis()];
    edited.clear();
    if (text().value !== own) text().value = own;
  }
  for (const { name, value } of keys) if (name.startsWith(PARAMETERS) && value) former.set(name.slice(PARAMETERS.length), value);
  for (const { name, key: path } of answer.keys) if (key(path)?.value) former.set(name, key(path).value);
  values();
  if (looked !== wanted() && !taking) look(false);
}

function build() {
  lang = document.documentElement.lang;
  const before = text()?.value ?? "";
  const area = make("textarea", { id: "formula-text", rows: 3, value: before, spellcheck: false, autocapitalize: "off", autocomplete: "off" });
  area.setAttribute("autocorrect", "off");
  area.setAttribute("aria-describedby", "formula-wrong");
  area.addEventListener("input", () => soon());
  area.addEventListener("change", () => now());
  const wrong = make("p", { id: "formula-wrong", className: "asks small" });
  wrong.setAttribute("role", "status");
  const help = make("details", {}, make("summary", { textContent: t("formula.help") }), ...t("formula.language").map((line) => make("p", { className: "hint", textContent: line })));
  fields.clear();
  box.replaceChildren(make("label", { htmlFor: area.id, textContent: t("formula.label") }), area, wrong, make("figure", { id: "formula-curve" }), make("div", { id: "formula-values" }), help);
}

/** Draws what was typed after a short while, and takes it after a longer one. */
function soon() {
  for (const timer of timers) clearTimeout(timer);
  timers = [setTimeout(() => look(false), LOOK), setTimeout(() => now(), TAKE)];
}

function now() {
  for (const timer of timers) clearTimeout(timer);
  look(text().value !== taken || edited.size > 0);
}

const wanted = () => JSON.stringify([caseText(), text().value, [...edited]]);

/** Asks for the curve of what is typed; with `take` the case takes it if it is right. */
async function look(take) {
  const own = wanted();
  looked = own;
  taking = take;
  try {
    const found = await ask("force", "/api/force", { case: theCase(), force: text().value, parameters: Object.fromEntries(edited), former: Object.fromEntries(former), take });
    if (box.hidden) return;
    answer = { ...found, keys: found.keys ?? answer.keys };
    mistake(found.error);
    values();
    if (!found.error && !found.missing.length) curve(found);
    if (found.set && own === wanted()) accept(found.set);
  } catch (error) {
    if (!superseded(error)) mistake({ text: error.message, from: 0, to: 0, parameter: "" });
  } finally {
    if (looked === own) taking = false;
  }
}

/** The case takes the formula, and leaves what it does not use. */
function accept(set) {
  for (const [name, value] of edited) former.set(name, value);
  edited.clear();
  taken = text().value;
  for (const [name, value] of Object.entries(set)) put(name, value, value === "" ? [] : key(name)?.alternatives ?? []);
  state.start = "";
  page.changed("sample.force");
}

/** Says what is wrong, with the wrong part of the text; a click selects it there. */
function mistake(error) {
  const wrong = document.getElementById("formula-wrong");
  const area = text();
  area.classList.toggle("bad", Boolean(error));
  if (error) area.setAttribute("aria-invalid", "true"); else area.removeAttribute("aria-invalid");
  for (const [name, parts] of fields) parts.text.classList.toggle("bad", error?.parameter === name);
  const missing = !error && answer.missing.length > 0;
  // The curve of a former formula.
  document.getElementById("formula-curve").classList.toggle("stale", Boolean(error) || missing);
  wrong.hidden = !error && !missing;
  if (!error) { wrong.textContent = missing ? t("formula.stays") : ""; return; }
  const { from, to } = error;
  const whole = area.value;
  const part = make("button", { type: "button", className: "part", title: t("formula.select") },
    `${from > AROUND ? "…" : ""}${whole.slice(Math.max(0, from - AROUND), from)}`, make("mark", { textContent: whole.slice(from, to) || " " }), `${whole.slice(to, to + AROUND)}${whole.length > to + AROUND ? "…" : ""}`);
  part.addEventListener("click", () => { area.focus(); area.setSelectionRange(from, to); });
  const placed = from > 0 || to > 0;
  wrong.replaceChildren(`${error.text}. `, ...(placed ? [part, " "] : []), t("formula.stays"));
}

/** A field for each parameter of the sample, and for those that have no value. */
function values() {
  const place = document.getElementById("formula-values");
  const shown = answer.keys.filter(({ name, key: path }) => path.startsWith("sample.") || answer.missing.includes(name) || edited.has(name));
  for (const [name, parts] of fields) if (!shown.some((one) => one.name === name)) { parts.box.remove(); fields.delete(name); }
  for (const one of shown) {
    const parts = fields.get(one.name) ?? added(place, one);
    parts.path = one.key;
    const own = key(one.key);
    const missing = answer.missing.includes(one.name);
    parts.box.querySelector("label").textContent = missing ? t("formula.missing", { name: one.name }) : one.name;
    parts.hint.textContent = one.key.startsWith(PARAMETERS) || missing ? "" : own?.title ?? "";
    parts.range.hidden = !own?.slider;
    if (!edited.has(one.name) && document.activeElement !== parts.text) parts.text.value = inField(own?.value || former.get(one.name) || "");
    // While a slider moves, its range stays.
    if (!own?.slider || parts.range.matches(":active")) continue;
    const { from, to, log } = parts.slider = own.slider;
    parts.range.value = 1000 * (log ? Math.log(own.number / from) / Math.log(to / from) : (own.number - from) / (to - from));
    parts.range.setAttribute("aria-valuetext", inField(own.value));
  }
}

function added(place, { name, key: path }) {
  const parts = Object.assign(page.field(`formula-value-${name}`, name), { path });
  parts.text.placeholder = t("formula.example");
  parts.text.autocapitalize = "off";
  parts.text.addEventListener("input", () => { edited.set(name, pointed(parts.text.value)); soon(); });
  parts.text.addEventListener("change", () => {
    const own = key(parts.path);
    const meant = own?.unit ? understood(parts.text.value, own) : { text: pointed(parts.text.value.trim()) };
    const use = (value) => {
      parts.text.value = inField(value);
      // Taken while it was typed.
      if (!edited.has(name) && value === statedText(parts.path)) return;
      edited.set(name, value);
      now();
    };
    if (meant.instead) { for (const timer of timers) clearTimeout(timer); question(parts.text, meant, use); } else use(meant.text);
  });
  const move = (finished) => {
    const { from, to, log } = parts.slider;
    const part = parts.range.value / 1000;
    const value = `${Number((log ? from * (to / from) ** part : from + (to - from) * part).toPrecision(4))} ${key(parts.path).unit}`.trim();
    parts.text.value = inField(value);
    parts.range.setAttribute("aria-valuetext", parts.text.value);
    // Instead of what was typed.
    edited.delete(name);
    page.say(parts.path, value, finished);
  };
  parts.range.addEventListener("input", () => move(false));
  parts.range.addEventListener("change", () => move(true));
  fields.set(name, parts);
  place.append(parts.box);
  return parts;
}

const UNITS = [["aN", 1e-18], ["fN", 1e-15], ["pN", 1e-12], ["nN", 1e-9], ["µN", 1e-6], ["mN", 1e-3], ["N", 1]];
const digits = (value) => String(Number(value.toPrecision(2)));

/** Ends of the shown forces: all of an attraction, and of a repulsion not much more. */
function range(forces) {
  const sorted = forces.filter(Number.isFinite).sort((a, b) => a - b);
  if (!sorted.length) return [0, 0];
  const low = Math.min(0, sorted[0]);
  return [low, Math.max(0, low < 0 ? Math.min(sorted.at(-1), -1.5 * low) : sorted[Math.floor(0.97 * (sorted.length - 1))])];
}

/** The force over the gap, with the ends of the formula's branches. */
function curve({ points, levels, contact, speed, memory }) {
  const place = document.getElementById("formula-curve");
  let [low, high] = range(points.flatMap((row) => row.slice(1)));
  if (low === high) [low, high] = [-1e-12, 1e-12];
  const size = Math.max(-low, high);
  const [unit, factor] = UNITS.findLast(([, factor]) => size >= factor) ?? UNITS[0];
  const [first, last] = [points[0][0], points.at(-1)[0]];
  const x = (gap) => LEFT + (WIDE - LEFT - EDGE) * (gap - first) / (last - first);
  const y = (force) => EDGE + (HIGH - EDGE - BOTTOM) * Math.min(1.05, Math.max(-0.05, (high - force) / (high - low)));
  const line = (column) => {
    const path = points.map((row, k) => (Number.isFinite(row[column]) ? `${k && Number.isFinite(points[k - 1][column]) ? "L" : "M"}${x(row[0]).toFixed(2)} ${y(row[column]).toFixed(2)}` : ""));
    return drawn("path", { class: column > 1 ? "back" : "force", d: path.join("") });
  };
  const words = (at, said, anchor = "middle") => { const made = drawn("text", { x: at[0], y: at[1], "text-anchor": anchor }); made.textContent = local(said); return made; };
  const upright = (gap, name) => drawn("line", { class: name, x1: x(gap), x2: x(gap), y1: EDGE, y2: HIGH - BOTTOM });
  const marks = levels.filter((gap) => gap > first && gap < last);
  const whole = Array.from({ length: 40 }, (_, k) => k - 20).map((k) => k * Math.max(1, Math.ceil((last - first) / 8e-9)) * 1e-9);
  const svg = drawn("svg", { viewBox: `0 0 ${WIDE} ${HIGH}`, role: "img", "aria-label": t("formula.curve") },
    drawn("line", { class: "zero", x1: LEFT, x2: WIDE - EDGE, y1: y(0), y2: y(0) }),
    ...marks.map((gap) => upright(gap, gap === contact ? "end contact" : "end")),
    ...(points[0].length > 2 ? [line(2)] : []), line(1),
    ...whole.filter((gap) => gap >= first && gap <= last).map((gap) => words([x(gap), HIGH - BOTTOM + 11], digits(gap * 1e9))),
    ...[low, high].filter((force) => force !== 0).map((force) => words([LEFT - 4, y(force) + 4], `${digits(force / factor)}${Math.abs(force) === size ? ` ${unit}` : ""}`, "end")), words([LEFT - 4, y(0) + 4], "0", "end"),
    words([(LEFT + WIDE) / 2, HIGH - 3], t("formula.gap")));
  const said = [];
  if (marks.length) said.push(t("formula.ends", { ends: marks.map((gap) => `${Number((gap * 1e9).toPrecision(3))} nm`).join(", ") }));
  if (memory) said.push(t("formula.memory"));
  if (speed) said.push(t("formula.ways", { speed: `${Number((speed * 1e3).toPrecision(3))} mm/s` }));
  place.replaceChildren(svg, make("figcaption", { className: "hint", textContent: said.join(" ") }));
}
