// The controls: one for every key of the case, made from the core's table of keys. Keys that say the
// same are one control with a switch.

import { basis, state, put as state_put, theCase } from "./state.js";
import { ask, superseded } from "./api.js";
import { local, t } from "./words.js";
import { inField, question, understood } from "./entry.js";
import { make } from "./element.js";

const form = document.getElementById("knobs");
const GROUPS = ["distance", "drive", "sample", "lever", "model", "more"];
const ALWAYS = ["cantilever.lever", "sample.law", "sample.material", "contact"];
let changed = () => {};
let refused = () => {};
let now = {};                 // the displayed motion: its start, and A/A0
let shown = [];               // the keys whose controls are shown
const opened = new Set();

/** The motion from which a changed value continues, if requested. */
export function follows(motion) { now = motion; }

/** `onChanged(key, finished)` is called when a value changed, `error(refusal, key)` when a law was refused. */
export function onChange(onChanged, error) { changed = onChanged; refused = error; }

/** Shows the keys of a case. Controls are made anew if other keys are stated, and keep the focus. While a
 *  slider moves, or `keep` is true, existing ones only take the new values. */
export function show(keys, keep = false) {
  const outline = (all) => JSON.stringify(all.map((key) => [key.name, key.value === "", key.stated, key.choices && key.value]));
  if ((keep || dragged()) && shown.length) update(keys, true);
  else if (outline(keys) === outline(shown) && form.dataset.basis === madeFor()) update(keys, false);
  else build(keys);
  shown = keys;
}

/** What the controls are made for. */
const madeFor = () => `${document.documentElement.lang} ${basis()}`;

function build(keys) {
  const focused = document.activeElement?.id;
  form.dataset.basis = madeFor();
  form.replaceChildren();
  const places = (name) => keys.filter((key) => key.group === name);
  for (const name of GROUPS) {
    const own = places(name);
    if (!own.length) continue;
    const said = (key) => own.some((other) => other.stated && other.alternatives.includes(key.name));
    // The distance of a setpoint follows from it.
    const solved = (key) => key.name !== "drive.setpoint" && own.some((other) => other.name === "drive.setpoint" && other.stated);
    const first = name === "more" ? [] : own.filter((key) => (key.stated || ALWAYS.includes(key.name)) && !solved(key));
    const rest = own.filter((key) => !first.includes(key) && !(said(key) && key.value !== ""));
    const box = make("fieldset", {}, make("legend", { textContent: t(`knobs.groups.${name}`) }), ...first.map((key) => knob(key, own)));
    box.dataset.group = name;
    if (rest.length) {
      const more = make("details", { open: opened.has(name) || (!first.length && name !== "more") },
        make("summary", { textContent: name === "more" ? t("knobs.further") : t("knobs.more", { count: rest.length }) }), ...rest.map((key) => knob(key, own)));
      more.addEventListener("toggle", () => { if (more.open) opened.add(name); else opened.delete(name); });
      box.append(more);
    }
    form.append(box);
  }
  if (focused) document.getElementById(focused)?.focus();
}

/** Sets the newest values in the existing controls. A field in which something else was typed, and not
 *  sent yet, keeps it. */
function update(keys, keep) {
  for (const key of keys) {
    const field = form.querySelector(`[data-key="${key.name}"]`);
    if (!field) continue;
    const typing = field === document.activeElement && field.value !== field.dataset.shown && field.value !== shownText(key, state.set[key.name] ?? "");
    if (!typing && field.value !== shownText(key)) field.value = shownText(key);
    if (!typing) field.dataset.shown = field.value;
    const note = document.getElementById(`${idOf(key.name)}-note`);
    if (note) note.textContent = key.note ? local(`. ${key.note}`) : "";
    const range = form.querySelector(`[data-slider="${key.name}"]`);
    if (range && key.slider && !range.matches(":active")) range.adjust(key, keep);
  }
}

/** The text of a key in its field: a number with the decimal sign of the language, a word or a formula as it is. */
const shownText = (key, text = key.value) => (key.sums || key.choices || key.name === "sample.force" ? text : inField(text));

/** Whether a slider is being moved. */
export const dragged = () => form.querySelector("[data-slider]:active") !== null;

const idOf = (name) => `key-${name.replace(/[^a-z0-9]/gi, "-")}`;
const words = (key) => (key.symbol && key.symbol !== key.name ? `${key.symbol}  ${key.title}` : key.title.replaceAll("_", " "));

function knob(key, own) {
  const id = idOf(key.name);
  const meaning = make("span", { className: "meaning", id: `${id}-meaning`, textContent: key.meaning });
  const field = key.sums ? summed(key, meaning) : key.choices ? chooser(key, meaning) : typed(key);
  field.id = id;
  field.dataset.key = key.name;
  field.dataset.shown = shownText(key);
  field.setAttribute("aria-describedby", meaning.id);
  const label = make("label", { htmlFor: id, textContent: words(key), title: key.meaning });
  const box = make("div", { className: "knob" }, label, field);
  const others = key.stated ? own.filter((other) => key.alternatives.includes(other.name) && (other.value !== "" || other.name === "drive.setpoint")) : [];
  if (others.length) {
    const ways = make("select", { className: "switch" }, ...[key, ...others].map((one) => new Option(words(one), one.name)));
    ways.setAttribute("aria-label", t("knobs.other", { words: words(key) }));
    ways.dataset.switch = key.name;
    ways.addEventListener("change", () => {
      const other = others.find((one) => one.name === ways.value);
      if (other) put(other, other.value || now.ratio || "0.8", true);
    });
    label.hidden = true;
    field.setAttribute("aria-label", words(key));
    box.prepend(ways);
  }
  if (key.slider) box.append(slider(key, field));
  if (key.choices) box.append(meaning);
  else { meaning.hidden = true; box.append(meaning); }
  return box;
}

function typed(key) {
  const field = make("input", { type: "text", value: shownText(key), placeholder: key.stated ? "" : "not stated" });
  field.addEventListener("change", () => {
    const meant = key.name === "sample.force" ? { text: field.value.trim() } : understood(field.value, key);
    if (meant.instead) question(field, meant, (text) => put(key, text, true));
    else put(key, meant.text, true);
  });
  return field;
}

function chooser(key, meaning) {
  const field = make("select");
  if (key.value === "") field.add(new Option("own values", "", true, true));
  for (const choice of key.choices) {
    const text = choice.meaning ? local(`${choice.word}: ${choice.meaning}`) : choice.word;
    field.add(new Option(text, choice.word, false, choice.word === key.value));
    if (choice.word === key.value && choice.meaning) meaning.textContent = `${key.meaning}: ${choice.meaning}`;
  }
  field.addEventListener("change", () => (key.name === "contact" ? law(key, field.value, field) : put(key, field.value, true)));
  return field;
}

/** A choice of one contact law, or a sum of laws with +: the field holds the whole name. */
function summed(key, meaning) {
  const field = make("input", { type: "text", value: key.value });
  const terms = key.value.split("+").map((word) => word.trim()).filter(Boolean);
  const said = key.choices.filter((choice) => terms.includes(choice.word)).map((choice) => choice.meaning);
  const note = make("span", { id: `${idOf(key.name)}-note`, textContent: key.note ? local(`. ${key.note}`) : "" });
  meaning.textContent = said.length ? said.join("; ") : key.meaning;
  meaning.append(note);
  const chosen = (title, take) => {
    const list = make("select", { className: "law" }, new Option(title, ""), ...key.choices.map((choice) => new Option(choice.word, choice.word)));
    [...list.options].forEach((option, k) => { if (k) option.title = key.choices[k - 1].meaning; });
    list.setAttribute("aria-label", title);
    list.addEventListener("change", () => { if (list.value) law(key, take(list.value), field); });
    return list;
  };
  field.addEventListener("change", () => law(key, field.value.trim(), field));
  meaning.append(make("span", { className: "laws" }, chosen("another law …", (word) => word), chosen("add a law …", (word) => `${key.value} + ${word}`)));
  return field;
}

/** Another contact law: the answer says which keys it does not take and which it needs. */
async function law(key, text, field) {
  try {
    const answer = await ask("law", "/api/law", { case: theCase(), law: text });
    for (const [name, value] of Object.entries(answer.set)) state.set[name] = value;
    state.start = "";
    changed(key.name, true, answer.words);
  } catch (error) {
    if (superseded(error)) return;
    field.value = key.value;
    refused(error, key);
  }
}

function slider(key, field) {
  const range = make("input", { type: "range", min: 0, max: 1000, step: 1 });
  range.setAttribute("aria-label", `${words(key)}, slider`);
  range.dataset.slider = key.name;
  const whole = key.name === "modes";
  let own = key;
  const value = (p) => {
    const { from, to, log } = own.slider;
    return whole ? p : log ? from * (to / from) ** (p / 1000) : from + (to - from) * p / 1000;
  };
  /** Moves the slider to the value of a key, in its own range if `keep`. */
  range.adjust = (next, keep) => {
    own = keep ? { ...next, slider: own.slider } : next;
    const { from, to, log } = own.slider;
    if (whole) Object.assign(range, { min: from, max: to });
    const v = next.number;
    range.value = whole ? v : 1000 * (log ? Math.log(v / from) / Math.log(to / from) : (v - from) / (to - from));
    range.setAttribute("aria-valuetext", inField(next.value));
  };
  range.adjust(key);
  let dirty = false;
  const move = (finished) => {
    dirty = !finished;
    const text = `${Number(value(Number(range.value)).toPrecision(5))}${own.unit ? ` ${own.unit}` : ""}`;
    field.value = inField(text);
    range.setAttribute("aria-valuetext", field.value);
    put(key, text, finished);
  };
  range.addEventListener("input", () => move(false));
  range.addEventListener("change", () => move(true));
  // A slider that was moved and put back does not change.
  range.addEventListener("pointerup", () => setTimeout(() => { if (dirty) move(true); }));
  return range;
}

function put(key, text, finished) {
  state_put(key.name, text, text === "" ? [] : key.alternatives);
  if (state.follow !== "yes") state.start = "";
  changed(key.name, finished);
}

/** Keys of the present case that say the same as one. */
export const sameAs = (name) => shown.find((key) => key.name === name)?.alternatives ?? [];

/** Marks the fields of the keys that the server names. */
export function mark(names) {
  for (const field of form.querySelectorAll("[data-key]")) {
    const bad = names.includes(field.dataset.key);
    field.classList.toggle("bad", bad);
    if (bad) field.setAttribute("aria-invalid", "true"); else field.removeAttribute("aria-invalid");
    if (bad) for (let box = field.closest("details"); box; box = box.parentElement.closest("details")) box.open = true;
  }
}
