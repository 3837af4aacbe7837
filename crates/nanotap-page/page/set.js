// What a user sets first: the setpoint or the distance, the free amplitude, lever, sample and law. Every other
// value of the case is in the list below.

import { state, put, theCase } from "./state.js";
import { ask, superseded } from "./api.js";
import { local, t } from "./words.js";
import { tell } from "./notice.js";
import { make } from "./element.js";
import { FAMILIES } from "./laws.js";
import * as formula from "./formula.js";
import { inField, question, setpoint as readSetpoint, understood } from "./entry.js";

const $ = (id) => document.getElementById(id);
const USUAL = "0.8";          // the setpoint of a case that has none
let changed = () => {};
let refused = () => {};
let keys = [];
let made = "";                // what the fields were made for
let info = {};                // the held quantity and the free lever

/** `onChanged(key, finished, words)` is called when a value changed, `error(refusal)` when it was refused. */
export function begin(onChanged, error) {
  changed = onChanged;
  refused = error;
  $("quick").addEventListener("submit", (event) => event.preventDefault());
  formula.begin({ field, say, changed: (name) => changed(name, true) });
  const range = $("dock").querySelector("input");
  range.addEventListener("input", () => slid(range, false));
  range.addEventListener("change", () => slid(range, true));
}

const key = (name) => keys.find((one) => one.name === name);

/** Whether the case holds a setpoint. */
export const holds = () => Boolean(key("drive.setpoint")?.stated);

/** Shows the values of a case: its keys, and what the states say of it. */
export function show(next, about = info) {
  keys = next;
  info = about;
  const outline = JSON.stringify([keys.filter((one) => one.stated).map((one) => one.name), document.documentElement.lang]);
  const physical = Boolean(key("drive.free_amplitude"));
  $("all").firstElementChild.textContent = t("set.all", { count: keys.length });
  if (!physical) $("all").open = true;
  $("quick").hidden = !physical;
  formula.show(keys);
  if (!physical) { made = ""; $("quick").replaceChildren(); dock(); return; }
  // A slider that is held would be lost.
  const held = $("quick").querySelector("input[type=range]:active");
  if (outline !== made && !held) { made = outline; build(); }
  update();
}

function build() {
  $("quick").replaceChildren(place(), slider("drive.free_amplitude", t("set.free"), "free"), chooser("cantilever.lever", t("set.lever"), t("set.ownLever")), chooser("sample.material", t("set.sample"), t("set.ownSample")), law());
}

/** A field of a number with a slider. */
function field(id, words, unitless = false) {
  const text = make("input", { type: "text", id, inputMode: unitless ? "decimal" : "text" });
  const range = make("input", { type: "range", id: `${id}-slider`, min: 0, max: 1000, step: 1 });
  range.setAttribute("aria-label", words);
  const hint = make("span", { className: "hint", id: `${id}-hint` });
  text.setAttribute("aria-describedby", hint.id);
  const box = make("div", { className: "field" }, make("label", { htmlFor: id, textContent: words }), text, range, hint);
  return { box, text, range, hint };
}

/** The setpoint, or the distance, and the choice between them. */
function place() {
  const held = holds();
  const one = held ? field("setpoint", t("set.setpoint"), true) : slider("gap.tip", t("set.distance"), "distance").parts;
  if (held) {
    one.range.addEventListener("input", () => slid(one.range, false));
    one.range.addEventListener("change", () => slid(one.range, true));
    one.text.addEventListener("change", () => {
      const text = readSetpoint(one.text.value);
      if (text === null) { refused(Object.assign(new Error(t("set.setpointWrong")), { keys: ["drive.setpoint"] })); return; }
      say("drive.setpoint", text, true);
    });
  }
  const way = make("select", { id: "hold-what" }, new Option(t("set.holdSetpoint"), "setpoint", held, held), new Option(t("set.holdDistance"), "distance", !held, !held));
  way.setAttribute("aria-label", t("set.hold"));
  way.addEventListener("change", () => {
    if (way.value === "setpoint") say("drive.setpoint", info.ratio ? String(Number(info.ratio.toPrecision(4))) : USUAL, true);
    else say("gap.tip", info.distance ?? key("gap.tip").value, true);
  });
  one.box.append(way);
  return one.box;
}

/** A slider and a field of a key. */
function slider(name, words, id) {
  const one = field(id, words);
  const value = (p) => {
    const { from, to, log } = key(name).slider;
    return log ? from * (to / from) ** (p / 1000) : from + (to - from) * p / 1000;
  };
  const move = (finished) => {
    const own = key(name);
    if (!own?.slider) return;
    const text = `${Number(value(Number(one.range.value)).toPrecision(4))} ${own.unit}`.trim();
    one.text.value = inField(text);
    one.range.setAttribute("aria-valuetext", one.text.value);
    say(name, text, finished);
  };
  one.range.addEventListener("input", () => move(false));
  one.range.addEventListener("change", () => move(true));
  one.text.addEventListener("change", () => {
    const meant = understood(one.text.value, key(name));
    if (meant.instead) question(one.text, meant, (text) => say(name, text, true));
    else say(name, meant.text, true);
  });
  one.box.dataset.of = name;
  return Object.assign(one.box, { parts: one });
}

/** A lever or a material, whose values replace those of the case. */
function chooser(name, words, own) {
  const list = make("select", { id: `choose-${name.replace(".", "-")}` }, new Option(own, ""), ...(key(name)?.choices ?? []).map(({ word, meaning }) => new Option(meaning ? local(`${word}: ${meaning}`) : word, word)));
  list.addEventListener("change", () => choose(name, list.value));
  const hint = make("span", { className: "hint" });
  const box = make("div", { className: "field choice-field" }, make("label", { htmlFor: list.id, textContent: words }), list, hint);
  box.dataset.of = name;
  return box;
}

/** Takes an entry of a catalogue; returns whether it was taken. */
export const choose = (name, value) => replace(name, "/api/choice", { case: theCase(), key: name, name: value });

/** Makes the changes that the program proposes and shows them in the bar; returns whether it did. */
async function replace(name, path, request) {
  const before = { ...state.set };
  try {
    const answer = await ask("choice", path, request);
    for (const [key, text] of Object.entries(answer.set)) put(key, text);
    changed(name, true, "");
    tell(answer.words, () => { state.set = before; changed(name, true, ""); });
    return true;
  } catch (error) {
    if (superseded(error)) return false;
    made = "";
    show(keys);
    refused(error);
    return false;
  }
}

/** Another law; a formula that was left returns. */
const another = (law) => replace("sample.law", "/api/law", { case: theCase(), law, former: formula.leaving(key("sample.law").value, law) });

/** The law of the contact, in families, and further forces. */
function law() {
  const options = () => Object.entries(FAMILIES).map(([family, names]) => {
    const group = make("optgroup", { label: t(`families.${family}`) });
    const known = new Set((key("sample.law")?.choices ?? []).map(({ word }) => word));
    group.append(...names.filter((one) => known.has(one)).map((one) => new Option(t("laws")[one] ?? one, one)));
    return group;
  });
  const list = make("select", { id: "choose-law" }, ...options());
  list.addEventListener("change", () => another(list.value));
  const more = make("select", { id: "add-law" }, new Option(t("set.addForce"), ""), ...options());
  more.setAttribute("aria-label", t("set.addForce"));
  more.addEventListener("change", () => { if (more.value) another(`${key("sample.law").value} + ${more.value}`); });
  const parts = make("span", { className: "parts" });
  const box = make("div", { className: "field choice-field" }, make("label", { htmlFor: list.id, textContent: t("set.law") }), list, parts, more, make("span", { className: "hint" }));
  box.dataset.of = "sample.law";
  return box;
}

function update() {
  const held = holds();
  for (const box of $("quick").querySelectorAll("[data-of]")) {
    const own = key(box.dataset.of);
    if (box.parts) {
      box.hidden = !own?.slider || (own.name === "drive.free_amplitude" && !own.stated);
      adjust(box.parts, own);
    } else if (own) choice(box, own);
    else box.hidden = true;
  }
  const free = $("free-hint");
  if (free) free.textContent = t("set.freeHint", { frequency: key("drive.frequency")?.value ?? "" });
  const distance = $("distance-hint");
  if (distance) distance.textContent = t("set.distanceHint");
  if (held) setpointShown();
  dock();
}

function adjust({ text, range }, own) {
  if (!own?.slider) return;
  if (document.activeElement !== text) text.value = inField(own.value);
  const { from, to, log } = own.slider;
  if (!range.matches(":active")) range.value = 1000 * (log ? Math.log(own.number / from) / Math.log(to / from) : (own.number - from) / (to - from));
  range.setAttribute("aria-valuetext", inField(own.value));
}

function choice(box, own) {
  const list = box.querySelector("select");
  const hint = box.querySelector(".hint");
  if (own.name !== "sample.law") {
    list.value = own.value;
    if (own.name === "cantilever.lever") {
      const value = (name) => rounded(key(name)?.value ?? "");
      hint.textContent = t("set.leverHint", { k: value("cantilever.k"), f0: value("cantilever.f0"), q: value("cantilever.Q"), radius: value("tip.radius") });
    } else {
      const shown = ["sample.modulus", "sample.stiffness", "sample.hamaker", "sample.work_of_adhesion", "sample.adhesion_force"].map(key).filter((one) => one?.value && (one.stated || own.value));
      hint.textContent = local(shown.map((one) => `${t("set.short")[one.name] ?? one.title} ${rounded(one.value)}`).join(" · "));
    }
    return;
  }
  const terms = own.value.split("+").map((word) => word.trim()).filter(Boolean);
  const single = terms.length === 1 ? terms[0] : "";
  const sum = list.querySelector("option.sum");
  if (single) { sum?.remove(); list.value = single; } else {
    const option = sum ?? make("option", { className: "sum" });
    Object.assign(option, { value: own.value, textContent: t("set.otherLaw", { laws: terms.map((one) => t("laws")[one] ?? one).join(" + ") }) });
    list.prepend(option);
    list.value = own.value;
  }
  box.querySelector("#add-law").value = "";
  // Each force of a sum can be taken away.
  box.querySelector(".parts").replaceChildren(...(single ? [] : terms.map((one) => {
    const button = make("button", { type: "button", textContent: `× ${t("laws")[one] ?? one}` });
    button.addEventListener("click", () => another(terms.filter((other) => other !== one).join(" + ")));
    return button;
  })));
  const formula = own.choices.filter(({ word }) => terms.includes(word)).map(({ meaning }) => meaning).join("; ");
  hint.textContent = [own.note, single && own.name].filter(Boolean)[0] === own.note ? local(own.note ?? "") : "";
  box.title = `sample.law = "${own.value}": ${formula}`;
}

/** A value with four digits. */
const rounded = (text) => text.replace(/^-?[\d.e+-]+/, (number) => String(Number(Number(number).toPrecision(4))));

/** The setpoint as a part of the free amplitude: NaN for a setpoint of another quantity. */
const ratio = () => {
  const own = key("drive.setpoint");
  if (!own?.stated) return NaN;
  if (own.unit === "") return own.number;
  return info.held?.kind === "amplitude" ? info.held.value : NaN;
};

const [LEAST, MOST] = [0.05, 0.995];

function setpointShown() {
  const own = key("drive.setpoint");
  const [text, range] = [$("setpoint"), $("setpoint-slider")];
  if (!text) return;
  const now = ratio();
  const words = Number.isFinite(now) ? inField(`${Number((100 * now).toPrecision(4))} %`) : inField(own.value);
  if (document.activeElement !== text) text.value = words;
  range.hidden = !Number.isFinite(now);
  if (!range.matches(":active") && Number.isFinite(now)) range.value = 1000 * (now - LEAST) / (MOST - LEAST);
  range.setAttribute("aria-valuetext", local(`${words}, ${info.held?.shown ?? ""}`));
  $("setpoint-hint").textContent = info.held?.kind === "amplitude" ? t("set.setpointHint", { amplitude: info.held.shown, free: info.free?.amplitude.shown ?? "" }) : "";
}

/** The slider of the setpoint at the bottom of a phone. */
function dock() {
  const range = $("dock").querySelector("input");
  $("dock").hidden = !holds() || !Number.isFinite(ratio());
  Object.assign(range, { min: 0, max: 1000 });
  if (!$("dock").hidden && !range.matches(":active")) range.value = 1000 * (ratio() - LEAST) / (MOST - LEAST);
}

function slid(range, finished) {
  const part = LEAST + (MOST - LEAST) * range.value / 1000;
  const text = String(Number(part.toFixed(3)));
  const own = key("drive.setpoint");
  Object.assign(own, { number: Number(text), value: text, unit: "" });
  setpointShown();
  say("drive.setpoint", text, finished);
}

function say(name, text, finished) {
  const own = key(name);
  if (own) {
    const read = Number.parseFloat(text);
    if (Number.isFinite(read) && text.endsWith(own.unit)) own.number = read;
  }
  put(name, text, own?.alternatives ?? []);
  changed(name, finished);
}
