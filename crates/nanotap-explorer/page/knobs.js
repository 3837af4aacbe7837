// The controls: one for every key of the case, made from the server's table of keys.

import { state } from "./state.js";

const form = document.getElementById("knobs");
let changed = () => {};
let now = "";                 // state at drive phase 0 of the displayed motion
const opened = new Set();

/** The motion from which a changed value continues, if requested. */
export function follows(start) { now = start; }

export function onChange(listener) { changed = listener; }

function element(name, properties = {}, ...children) {
  const made = Object.assign(document.createElement(name), properties);
  made.append(...children);
  return made;
}

/** Creates the controls for the keys of the present case and keeps the focus. */
export function build(keys) {
  const focused = document.activeElement?.id;
  form.replaceChildren();
  const sections = new Map();
  for (const key of keys) {
    if (!sections.has(key.section)) sections.set(key.section, []);
    sections.get(key.section).push(key);
  }
  for (const [name, own] of sections) {
    const box = element("fieldset", {}, element("legend", { textContent: name }));
    const stated = own.filter((key) => key.value !== "");
    const others = own.filter((key) => key.value === "");
    box.append(...stated.map(knob));
    if (others.length) {
      const more = element("details", { open: opened.has(name) || stated.length === 0 },
        element("summary", { textContent: `${others.length} not stated` }), ...others.map(knob));
      more.addEventListener("toggle", () => { if (more.open) opened.add(name); else opened.delete(name); });
      box.append(more);
    }
    form.append(box);
  }
  if (focused) document.getElementById(focused)?.focus();
}

/** Sets the newest values in the existing controls, except in the one being edited. */
export function update(keys) {
  for (const key of keys) {
    const field = form.querySelector(`[data-key="${key.name}"]`);
    if (field && field !== document.activeElement && field.value !== key.value) field.value = key.value;
  }
}

/** Whether a slider is being moved. */
export const dragged = () => form.querySelector("[data-slider]:active") !== null;

function knob(key) {
  const id = `key-${key.name.replace(/[^a-z0-9]/gi, "-")}`;
  const words = key.symbol && key.symbol !== key.name ? `${key.symbol}  ${key.title}` : key.title;
  const meaning = element("span", { className: "meaning", id: `${id}-meaning`, textContent: key.meaning });
  const field = !key.choices ? typed(key) : key.sums ? summed(key, meaning) : chooser(key, meaning);
  field.id = id;
  field.dataset.key = key.name;
  field.setAttribute("aria-describedby", meaning.id);
  const box = element("div", { className: "knob" }, element("label", { htmlFor: id, textContent: words }), field);
  if (key.slider) box.append(slider(key, field, words));
  box.append(meaning);
  return box;
}

function typed(key) {
  const field = element("input", { type: "text", value: key.value });
  field.addEventListener("change", () => put(key, field.value.trim(), true));
  return field;
}

function chooser(key, meaning) {
  const field = element("select");
  if (key.value === "") field.add(new Option("", "", true, true));
  for (const choice of key.choices) {
    const words = choice.meaning ? `${choice.word}: ${choice.meaning}` : choice.word;
    field.add(new Option(words, choice.word, false, choice.word === key.value));
    if (choice.word === key.value && choice.meaning) meaning.textContent = `${key.meaning}: ${choice.meaning}`;
  }
  field.addEventListener("change", () => put(key, field.value, true));
  return field;
}

/** A choice of one option, or a sum of options with +. */
function summed(key, meaning) {
  const field = typed(key);
  const list = element("datalist", { id: `words-${key.name.replace(/[^a-z0-9]/gi, "-")}` },
    ...key.choices.map((choice) => new Option(choice.meaning, choice.word)));
  field.setAttribute("list", list.id);
  const terms = key.value.split("+").map((word) => word.trim());
  const said = key.choices.filter((choice) => terms.includes(choice.word)).map((choice) => choice.meaning);
  const known = element("details", {}, element("summary", { textContent: "laws" }),
    element("dl", {}, ...key.choices.flatMap((choice) => [element("dt", { textContent: choice.word }), element("dd", { textContent: choice.meaning })])));
  meaning.textContent = said.length ? said.join("; ") : key.meaning;
  meaning.append(known, list);
  return field;
}

function slider(key, field, words) {
  const { from, to, log } = key.slider;
  const range = element("input", { type: "range", min: 0, max: 1000, step: 1 });
  range.setAttribute("aria-label", `${words}, slider`);
  range.dataset.slider = key.name;
  const whole = key.name === "modes";
  if (whole) Object.assign(range, { min: from, max: to });
  const place = (v) => (whole ? v : 1000 * (log ? Math.log(v / from) / Math.log(to / from) : (v - from) / (to - from)));
  const value = (p) => (whole ? p : log ? from * (to / from) ** (p / 1000) : from + (to - from) * p / 1000);
  range.value = place(key.number);
  const move = (finished) => {
    field.value = `${Number(value(Number(range.value)).toPrecision(5))}${key.unit ? ` ${key.unit}` : ""}`;
    range.setAttribute("aria-valuetext", field.value);
    put(key, field.value, finished);
  };
  range.addEventListener("input", () => move(false));
  range.addEventListener("change", () => move(true));
  return range;
}

function put(key, text, finished) {
  // A key that the preset states cannot be removed.
  state.set[key.name] = text;
  state.start = state.follow === "yes" ? now : "";
  changed(key.name, finished);
}

/** Marks the fields whose keys an error names. */
export function mark(message) {
  for (const field of form.querySelectorAll("[data-key]")) {
    const name = field.dataset.key.split(".").pop();
    const bad = Boolean(message) && new RegExp(`(^|[^a-z0-9_])${name}([^a-z0-9_]|$)`, "i").test(message);
    field.classList.toggle("bad", bad);
    if (bad) field.setAttribute("aria-invalid", "true"); else field.removeAttribute("aria-invalid");
  }
}
