// What is typed into a field: a bare number has the unit of the field, a comma is a decimal point, and a value
// far from the former one is asked about. In links, cases and requests the decimal sign is a point.

import { local, t } from "./words.js";
import { make } from "./element.js";

const PREFIXES = { y: 1e-24, z: 1e-21, a: 1e-18, f: 1e-15, p: 1e-12, n: 1e-9, "µ": 1e-6, "μ": 1e-6, u: 1e-6, m: 1e-3, "": 1, k: 1e3, M: 1e6, G: 1e9, T: 1e12 };
const BASES = ["N/m", "m/s", "m", "Hz", "N", "J", "eV", "Pa s", "Pa", "V", "s", "g", "rad"];
const FAR = 1000;             // ratio to the former value above which a value is asked about

/** Size and base of a unit; a unit of no base here has the size 1. */
function unit(text) {
  for (const base of BASES) {
    const prefix = text.endsWith(base) ? text.slice(0, -base.length) : null;
    if (prefix !== null && prefix in PREFIXES) return { size: PREFIXES[prefix], base };
  }
  return { size: 1, base: text };
}

const NUMBER = /^\s*([+-]?(?:\d+\.?\d*|\.\d+)(?:[eE][+-]?\d+)?)\s*(.*?)\s*$/;

/** A typed number with a decimal point in place of a comma; a list of numbers, and other texts, stay. */
export const pointed = (text) => text.replace(/^(\s*[+-]?\d+),(\d+)(?![\d,]*[.,]|\d)/, "$1.$2");

/** The text of a number as a field shows it, with the decimal sign of the chosen language. */
export const inField = (text) => (NUMBER.test(text) && !/[,;:=*]/.test(text) ? local(text) : text);

/** The number and the unit of a text, or null. */
export function parts(text) {
  const found = NUMBER.exec(pointed(text));
  return found ? { number: Number(found[1]), unit: found[2] } : null;
}

/** A text in SI, if it is a number with a unit of the same base as `own`. */
export function inSi(text, own = "") {
  const read = parts(text ?? "");
  if (!read) return NaN;
  const [is, wanted] = [unit(read.unit || own), unit(own)];
  return own && is.base !== wanted.base ? NaN : read.number * is.size;
}

/** What a typed text means for a key, and the question to ask first, if any: its value and the same number in
 *  the key's unit. */
export function understood(text, key) {
  const read = parts(text);
  if (!read) return { text: text.trim() };
  const bare = read.unit === "";
  const said = `${read.number}${bare ? (key.unit ? ` ${key.unit}` : "") : ` ${read.unit}`}`;
  const [is, own] = [unit(bare ? key.unit : read.unit), unit(key.unit)];
  const ratio = Math.abs((read.number * is.size) / (key.number * own.size));
  const strange = key.unit && is.base === own.base && !bare && Number.isFinite(ratio) && (ratio > FAR || ratio < 1 / FAR) && ratio !== 0;
  return strange ? { text: said, ratio, instead: `${read.number} ${key.unit}` } : { text: said };
}

/** A setpoint as typed: "80", "80 %", "0.8" and "16 nm" are understood; null otherwise. */
export function setpoint(text) {
  const read = parts(text);
  if (!read) return null;
  if (read.unit === "%") return String(Number((read.number / 100).toPrecision(12)));
  if (read.unit === "") return String(Number((read.number > 1.5 ? read.number / 100 : read.number).toPrecision(12)));
  return `${read.number} ${read.unit}`;
}

/** Asks about a strange value below its field; `use` takes the text that is meant. */
export function question(field, { text, ratio, instead }, use) {
  field.parentElement.querySelector(".asks")?.remove();
  const box = make("p", { className: "asks small" });
  box.setAttribute("role", "alert");
  const times = Number(ratio.toPrecision(2)).toExponential().replace("e+", "·10^").replace("e-", "·10^−");
  const button = (words, meant) => {
    const made = make("button", { type: "button", textContent: words });
    made.addEventListener("click", () => { box.remove(); field.value = inField(meant); use(meant); });
    return made;
  };
  box.append(t("set.huge", { typed: field.value, value: text, times }), " ", button(t("set.inUnit", { value: instead }), instead), " ", button(t("set.keepIt", { value: text }), text));
  field.parentElement.append(box);
  box.querySelector("button").focus();
}
