// The lecture: one figure on the whole screen, and lessons whose steps ask, let the room choose, and show. Its
// values are those of the lesson, not those of the page; the address names lesson and step.

import { remember, state } from "./state.js";
import { ask, save, stop, stream, superseded } from "./api.js";
import { filled, file, LESSONS, lesson as lessonOf, wrong } from "./lessons.js";
import { A, COLOURS, PHASE, Z, crossings, portrait, regimeOf } from "./curve.js";
import { parts } from "./entry.js";
import { local, t } from "./words.js";
import { make } from "./element.js";
import { axis } from "./axis.js";
import { code } from "./qr.js";
import * as film from "./film.js";
import * as figure from "./figure.js";
import * as link from "./link.js";
import * as plot from "./plot.js";

const $ = (id) => document.getElementById(id);
const GLIDE = 1200;           // milliseconds in which values move
const REST = 400;             // milliseconds without a change before the curve is followed anew
const POINTS = 256;           // of a line
const LINE = COLOURS.attractive;
const OWN = "own";            // name of a lecturer's lesson
const LIST = "list";          // name of the list of lessons in the address
const still = matchMedia("(prefers-reduced-motion: reduce)");
const phone = matchMedia("(max-width: 46rem)");
let closed = () => {};
let opened = () => {};
let own = null;               // a lecturer's lesson
let lesson = null;            // the lesson with its words; none: the list
let at = 0;                   // its step
let picked = -1;
let shown = false;            // the answer is shown
let free = null;              // values that the lecturer set after "What if?"
let glide = null;             // when the values began to move
let failure = "";
let results = new Map();      // by request
let kinds = 0;
let busy = new Set();         // kinds of requests that are under way
let turn = Promise.resolve(); // requests are answered one by one
let before = {};              // what had the focus, and whether films moved

/** `onOpen()` is called before the page is covered, `onClose()` when it is seen again. */
export function begin(onOpen, onClose) {
  [opened, closed] = [onOpen, onClose];
  addEventListener("keydown", pressed);
  addEventListener("resize", () => { if (isOpen()) draw(); });
}

export const isOpen = () => !$("show").hidden;
/** Whether the address is one of the lecture. */
export const wanted = () => Boolean(state.lecture) || state.lesson === LIST || /^[\w-]+\.\d+$/.test(state.lesson);

const button = (words, go, properties = {}) => { const one = make("button", { type: "button", textContent: words, ...properties }); one.addEventListener("click", go); return one; };

/** Shows what the address says, or the list of lessons. */
export async function open() {
  if (!isOpen()) {
    opened();
    before = { focus: document.activeElement, moves: film.moves() };
    $("show").hidden = false;
    for (const one of document.body.children) if (one !== $("show")) one.inert = true;
    film.hold(still.matches);
  }
  let note = "";
  [own, lesson] = [null, null];
  if (state.lecture) note = await read(state.lecture);
  const [name, step] = (state.lesson || (own ? `${OWN}.1` : LIST)).split(".");
  if (name === OWN ? own : Object.hasOwn(LESSONS, name)) begun(name, Number(step) - 1);
  else { if (name !== LIST && !note) note = t("show.unknown", { name }); list(note); }
}

async function read(word) {
  let given = null;
  try { given = JSON.parse(await link.unpacked(word)); } catch { return t("show.damaged"); }
  const part = wrong(given);
  if (part) return t("show.wrong", { part });
  own = given;
  return "";
}

/** Closes the lecture; the page is as it was. */
export function close(keep = false) {
  if (!isOpen()) return;
  for (const kind of busy) stop(kind);
  for (const one of document.body.children) one.inert = false;
  $("show").hidden = true;
  $("show").replaceChildren();
  invert(null);
  film.show([]);
  film.hold(!before.moves);
  lesson = null;
  if (!keep) { Object.assign(state, { lesson: "", lecture: "" }); remember(false); }
  before.focus?.focus?.();
  closed();
}

/** Black on white, the reverse, or as the page. */
function invert(dark) {
  const root = document.documentElement;
  if (dark === null) delete root.dataset.lecture; else root.dataset.lecture = dark ? "dark" : "light";
  plot.scheme(dark);
  film.renew();
  if ($("show-figure")?.figure) figure.renew($("show-figure"));
}

/** The list of lessons, the first screen. */
function list(note = "") {
  lesson = null;
  address(LIST);
  invert(document.documentElement.dataset.lecture === "dark");
  film.show([]);
  const input = make("input", { type: "file", accept: ".json,application/json", hidden: true });
  input.addEventListener("change", () => choose(input.files[0]));
  const lessons = make("ol", { className: "lessons" }, ...Object.keys(LESSONS).map((name) => make("li", {}, button(lessonOf(name).title, () => begun(name, 0)))));
  if (own) lessons.append(make("li", {}, button(own.title, () => begun(OWN, 0))));
  $("show").replaceChildren(
    make("h2", { id: "show-heading", textContent: t("show.heading") }),
    make("div", { className: "start" }, make("p", { textContent: t("show.lead") }), make("p", { id: "show-note", textContent: note, role: "alert" }), lessons, make("p", { className: "keys", textContent: t("show.keys") }),
      make("p", { className: "own" }, button(t("show.open"), () => input.click()), button(t("show.template"), () => save(new Blob([`${file("states")}\n`], { type: "application/json" }), "lesson.json")), input)),
    make("div", { className: "foot" }, make("span", { className: "grow" }), button(t("close"), () => close())),
  );
  lessons.querySelector("button").focus();
}

/** Takes a lecturer's lesson from a file: it is in the address from then on. */
async function choose(given) {
  if (!given) return;
  let data = null;
  try { data = JSON.parse(await given.text()); } catch { list(t("show.wrong", { part: given.name })); return; }
  const part = wrong(data);
  if (part) { list(t("show.wrong", { part })); return; }
  own = data;
  state.lecture = await link.packed(JSON.stringify(data));
  begun(OWN, 0);
}

function address(words) {
  state.lesson = words;
  if (words === LIST) state.lecture = "";
  remember(false);
}

/** Begins a lesson at a step. */
function begun(name, step) {
  lesson = lessonOf(name, name === OWN ? own : LESSONS[name]);
  at = Math.max(0, Math.min(lesson.steps.length - 1, step || 0));
  invert(document.documentElement.dataset.lecture === "dark");
  frame();
  to(at, false);
}

/** The elements of a step. */
function frame() {
  const picture = make("figure", { id: "show-figure", className: "paper" });
  picture.highest = () => Math.max(160, $("show-picture").clientHeight - ($("show-film").hidden ? 0 : $("show-film").offsetHeight) - $("show-values").offsetHeight - 12);
  $("show").replaceChildren(
    make("h2", { id: "show-heading", tabIndex: -1 }),
    make("div", { className: "body" },
      make("div", { id: "show-picture" }, make("p", { id: "show-values" }), make("canvas", { id: "show-film" }), picture),
      make("div", { className: "say" }, make("div", { id: "show-answers" }), make("p", { id: "show-says", role: "status" }), make("div", { id: "show-code" }))),
    make("div", { className: "foot" }, make("span", { id: "show-place" }), make("span", { id: "show-address", className: "grow" }),
      button(t("show.whatIf"), whatIf, { id: "show-what-if", className: "plain" }), button(t("show.back"), back, { id: "show-back" }), button(t("show.next"), next, { id: "show-next" }), button(t("close"), () => close(), { id: "show-close" })),
  );
  $("show-film").setAttribute("role", "img");
  $("show-film").setAttribute("aria-label", t("states.filmAbout"));
}

const step = () => lesson.steps[at];

/** Goes to a step, its question or its answer. */
function to(number, answer) {
  const changed = number !== at || !answer;
  [at, shown, free, glide] = [number, answer, null, answer ? performance.now() - GLIDE : null];
  if (changed) picked = -1;
  address(`${lesson.name}.${at + 1}`);
  failure = "";
  qr();
  words();
  prepare();
  $("show-next").focus({ preventScroll: true });
}

function next() {
  if (free) { back(); return; }
  if (!shown) { shown = true; glide = performance.now(); words(); draw(); return; }
  if (at === lesson.steps.length - 1) { list(); return; }
  to(at + 1, false);
}

function back() {
  if (free) { free = null; glide = performance.now() - GLIDE; words(); draw(); return; }
  if (shown) to(at, false);
  else if (at > 0) to(at - 1, true);
  else list();
}

function pressed(event) {
  if (event.ctrlKey || event.metaKey || event.altKey) return;
  const typing = /^(INPUT|SELECT|TEXTAREA)$/.test(event.target.tagName ?? "") && event.target.type !== "range";
  if (!isOpen()) {
    if (event.key.toLowerCase() === "l" && !typing && !document.querySelector("dialog[open]")) { event.preventDefault(); state.lesson = LIST; open(); }
    return;
  }
  const letter = event.key.length === 1 ? event.key.toLowerCase() : "";
  const slides = event.target.type === "range" && event.key.startsWith("Arrow");
  if (event.key === "Escape") close();
  else if (letter === "i") invert(document.documentElement.dataset.lecture !== "dark");
  else if (!lesson || slides) return;
  else if (["ArrowRight", "ArrowDown", "PageDown"].includes(event.key)) next();
  else if (["ArrowLeft", "ArrowUp", "PageUp"].includes(event.key)) back();
  else if (letter === "w") whatIf();
  else if (letter >= "a" && letter < "g" && letter) pick(letter.charCodeAt(0) - 97);
  else return;
  event.preventDefault();
}

function pick(k) {
  if (shown || k >= step().answers.length) return;
  picked = k;
  words();
  if (!phone.matches) return;
  // A phone shows its letter and reports nothing.
  const sign = button("ABCDEF"[k], () => sign.remove(), { className: "letter" });
  sign.setAttribute("aria-label", `${"ABCDEF"[k]}. ${t("show.letter")}`);
  $("show").append(sign);
  sign.focus();
}

function qr() {
  const other = new URLSearchParams({ lesson: state.lesson, ...(state.lecture ? { lecture: state.lecture } : {}), ...(state.lang ? { lang: state.lang } : {}) });
  const whole = `${link.home()}#${other}`;
  const rows = code(whole);
  $("show-code").replaceChildren(rows ? link.picture(rows, t("show.code")) : t("show.tooLong"));
  $("show-address").textContent = whole.length < 100 ? t("show.phones", { address: whole.replace(/^https?:\/\//, "") }) : "";
}

// What a step needs from the program.

/** The case of a side of a step, as a request contains it, and the options that are no keys of it. */
function split(side, { preset, text } = step()) {
  const of = text ? { text } : { preset };
  const [set, options] = [[], {}];
  let steps = 0;
  for (const [key, value] of Object.entries(side)) {
    if (key === "steps") steps = Number(value);
    else if (key.startsWith("study.")) options[key.slice(6)] = value;
    else if (value !== "") set.push(`${key}=${value}`);
  }
  return { case: { ...of, set }, options, steps };
}

/** What was computed for a request, or a promise of it; each is computed once. */
function result(path, body, take) {
  const key = JSON.stringify([path, body]);
  if (!results.has(key)) {
    const entry = { value: undefined, done: null };
    const kind = `lecture ${kinds += 1}`;
    const work = async () => {
      if (!isOpen()) throw new DOMException("closed", "AbortError");
      busy.add(kind);
      try {
        if (take) await stream(kind, path, body, (stage) => { entry.value = take(entry.value, stage); if (isOpen() && lesson) draw(); });
        else entry.value = await ask(kind, path, body);
      } finally { busy.delete(kind); }
      return entry.value;
    };
    entry.done = turn = turn.then(work, work);
    entry.done.catch((error) => { if (superseded(error)) results.delete(key); });
    results.set(key, entry);
  }
  return results.get(key);
}

const kind = (of = step()) => of.figure;
const rowsOf = (side, of) => result("/api/states", { case: split(side, of).case, near: [] });
/** The curve does not depend on the place at which the lever is held. */
const curveOf = (side, of) => result("/api/curve", { case: split({ ...side, "drive.setpoint": "", "gap.tip": "" }, of).case }, (_, stage) => ({ ...stage, branches: stage.branches ?? [] }));
const motionOf = (side, of) => { const { case: own, steps } = split(side, of); return result("/api/motion", { case: own, start: "", steps }); };
const studyOf = (side, of) => { const { case: own, options } = split(side, of); return result("/api/study", { case: own, start: "", tab: kind(of), options }, (all, stage) => ({ ...all, ...stage })); };

const isStudy = (of = step()) => !["states", "settle", "motion"].includes(kind(of));
/** Whether no words of a step are about the states at a setpoint or a distance. */
const isPlain = (of = step()) => kind(of) === "motion" || (isStudy(of) && !/\{[\w.]*(phase|force|distance|step|turn)/.test(JSON.stringify([of.ask, of.answers, of.says])));

/** What the words of a side of a step are filled from. */
function facts(side, of = step()) {
  if (kind(of) === "motion") return [motionOf(side, of)];
  return isPlain(of) ? [] : [rowsOf(side, of)];
}

/** What its figure shows in addition. */
function pictures(side, of = step()) {
  if (kind(of) === "states") return [curveOf(side, of)];
  return isStudy(of) ? [studyOf(side, of)] : [];
}

/** Computes what the step shows, first the numbers of both sides; then the numbers of the next step. */
async function prepare() {
  const own = step();
  const following = lesson.steps[at + 1];
  for (const needed of [facts, pictures]) {
    for (const side of [own.set, own.to]) {
      for (const one of needed(side, own)) {
        try { await one.done; } catch (error) { if (current() === own && !superseded(error)) failure = t("show.failed", { reason: error.message }); }
        if (current() !== own) return;
        words();
        draw();
      }
    }
  }
  if (following) for (const side of [following.set, following.to]) facts(side, following);
}

const current = () => (isOpen() && lesson ? step() : null);

// The values that the words of a step contain.

const find = (rows, name) => rows.find((row) => (name === "unstable" ? !row.stable : row.stable && row.regime === name));
const pickOf = (rows, name) => (name && find(rows, name)) ?? rows.find((row) => row.stable) ?? rows[0];
const zero = (text) => (/^-?0( |$)/.test(text) ? "0" : text);
const said = (key, text) => (key === "drive.setpoint" && Number(text) <= 1 ? `${Number((100 * text).toPrecision(4))} %` : key === "steps" && text === "0" ? t("show.exact") : text);
const digits = (value, most = 3) => String(Number(value.toPrecision(most)));
const number = (text) => { const read = parts(text ?? ""); return read ? read.number : NaN; };

/** A value with a prefix. */
function shortened(value, unit) {
  const size = Math.max(-4, Math.min(1, Math.floor(Math.log10(Math.abs(value)) / 3 + 1e-9)));
  return `${digits(value / 10 ** (3 * size))} ${{ "-4": "p", "-3": "n", "-2": "µ", "-1": "m", 0: "", 1: "k" }[size]}${unit}`;
}

const SIZES = { "": 1, k: 1e3, M: 1e6 };
const hertz = (text) => { const [, n, prefix] = /^([\d.e+-]+) ?([kM]?)Hz$/.exec(text ?? "") ?? []; return n ? Number(n) * SIZES[prefix] : NaN; };
/** Drive periods until a disturbance has fallen to 1/e. */
const settling = (row) => -row.period / Math.log(row.multiplier);

function ofRow(row) {
  return {
    phase: row.phase.value === null ? "–" : `${row.phase.value.toFixed(1)}°`, force: zero(row.peak_force.shown), distance: row.distance.shown, amplitude: row.first_harmonic.shown,
    indentation: zero(row.indentation.shown), energy: zero(row.dissipation.shown), period: String(row.period),
  };
}

/** The period that a run of fixed steps shows, in words. */
function fixed(motion) {
  const words = motion.fixed_step?.words;
  if (!words) return "";
  const [, period] = /^\d+ steps per period show period (\d+)/.exec(words) ?? [];
  return period ? t("show.periodOf", { period }) : t(/grew beyond/.test(words) ? "show.grows" : "show.noPeriod");
}

const periodOf = ({ summary }) => /^period (\d+)/.exec(summary)?.[1];
const exactPeriod = (motion) => (periodOf(motion) ? t("show.periodOf", { period: periodOf(motion) }) : t("show.noPeriod"));

/** The values of one side: of the chosen state, and with its name of each state. */
function ofSide(side, picked) {
  const values = Object.fromEntries(Object.entries(side).map(([key, text]) => [key, said(key, text)]));
  const numbers = {};
  if (!isPlain()) {
    const rows = rowsOf(side).value?.rows?.filter((row) => !row.lost) ?? [];
    const row = pickOf(rows, picked);
    for (const name of ["attractive", "repulsive", "unstable", "free"]) {
      const one = find(rows, name);
      if (one) for (const [key, text] of Object.entries(ofRow(one))) values[`${name}.${key}`] = text;
    }
    if (row) {
      Object.assign(values, ofRow(row));
      Object.assign(numbers, { force: row.peak_force.value, indentation: row.indentation.value, distance: row.distance.value });
      const drive = hertz(side["drive.frequency"]);
      if (row.multiplier > 0 && row.multiplier < 1) {
        const periods = settling(row);
        values.settlePeriods = digits(periods);
        if (drive) {
          numbers.settle = periods / drive;
          Object.assign(values, { settle: shortened(periods / drive, "s"), periodTime: shortened(1 / drive, "s"), line: shortened(POINTS * periods / drive, "s") });
        }
      }
    }
    const stable = rows.filter((one) => one.stable).length;
    if (rows.length) values.states = t("states.counts")[stable] ?? String(stable);
    const [one, other] = ["attractive", "repulsive"].map((name) => find(rows, name));
    if (one && other) Object.assign(values, { step: shortened(Math.abs(one.distance.value - other.distance.value), "m"), turn: `${Math.abs(one.phase.value - other.phase.value).toFixed(0)}°` });
  }
  if (kind() === "motion") {
    const motion = motionOf(side).value;
    if (motion) {
      const period = periodOf(motion);
      const [, exponent] = /exponent (-?[\d.]+)/.exec(motion.summary) ?? [];
      Object.assign(values, { period: period ?? "–", exactPeriod: exactPeriod(motion), exponent: exponent ? digits(Number(exponent), 2) : "–", fixed: fixed(motion) });
    }
  }
  return { values, numbers };
}

/** Values for the words of the present step, and whether all of them are there. */
function valuesOf() {
  const { set, to: after, pick: [from, end] } = step();
  const [one, other] = [ofSide(set, from), ofSide(after, end ?? from)];
  const values = { ...other.values };
  for (const [key, text] of Object.entries(one.values)) values[`before.${key}`] = text;
  for (const key of Object.keys(other.numbers)) if (one.numbers[key]) values[`ratio.${key}`] = digits(Math.max(other.numbers[key] / one.numbers[key], key === "force" ? 0 : one.numbers[key] / other.numbers[key]), 2);
  for (const key of Object.keys(after)) {
    const [a, b] = [number(set[key]), number(after[key])];
    if (a && b && a !== b) values[`ratio.${key.split(".").at(-1)}`] = digits(Math.max(a / b, b / a), 2);
  }
  return values;
}

const ready = () => { const own = step(); return [own.set, own.to].every((side) => facts(side).every((one) => one.value !== undefined)); };

// What is seen.

function words() {
  const { ask: question, answers, right, says } = step();
  const values = valuesOf();
  const known = ready();
  const fill = (text) => filled(text, values, known ? "–" : "…");
  $("show-heading").textContent = free ? t("show.whatIfHead") : fill(question);
  $("show-answers").replaceChildren(...(free ? knobs() : answers.map((answer, k) => {
    const is = shown && k === right;
    const one = button(`${"ABCDEF"[k]}  ${is ? "✓ " : ""}${fill(answer)}`, () => pick(k), { className: is ? "right" : k === picked ? "picked" : "" });
    one.setAttribute("aria-pressed", String(k === picked));
    if (is) one.setAttribute("aria-label", `${"ABCDEF"[k]}: ${fill(answer)}, ${t("show.right")}`);
    return one;
  })));
  $("show-says").textContent = free ? whatRows() : !shown ? "" : failure || (known ? fill(says) : t("show.computing"));
  $("show-code").hidden = shown;
  $("show-place").textContent = t("show.place", { step: at + 1, steps: lesson.steps.length });
  $("show-address").style.visibility = shown ? "hidden" : "";
  $("show-next").textContent = t(!shown ? "show.show" : at === lesson.steps.length - 1 ? "show.end" : "show.next");
  $("show-what-if").hidden = !shown || Boolean(free) || !step().knobs.length;
}

/** How far the values have moved, from 0 to 1. */
function moved() {
  if (!shown) return 0;
  return still.matches ? 1 : Math.min(1, Math.max(0, (performance.now() - glide) / GLIDE));
}

/** A value between two. */
function between(from, end, share) {
  const [a, b] = [parts(from ?? ""), parts(end ?? "")];
  if (share >= 1 || !a || !b || a.unit !== b.unit || a.number === b.number) return share < 1 ? from : end;
  const value = a.number > 0 && b.number / a.number > 5 ? a.number * (b.number / a.number) ** share : a.number + share * (b.number - a.number);
  return `${digits(value)} ${a.unit}`.trim();
}

function draw() {
  if (!current()) return;
  let share = moved();
  const { set, to: after, knobs: names, pick: [from, end] } = step();
  if (free) share = 1;
  const side = free?.set ?? (share < 1 ? set : after);
  const moving = share > 0 && share < 1;
  const changes = Object.keys(after).filter((key) => set[key] !== after[key] && after[key] !== "" && key !== "drive.frequency");
  const seen = free ? [] : changes.length ? changes : names.slice(0, 1);
  $("show-values").textContent = seen.map((key) => local(`${t("show.keyNames")[key] ?? key} ${moving && set[key] !== after[key] ? "≈ " : ""}${said(key, between(set[key], after[key], share))}`)).join(" · ");
  $("show-film").hidden = kind() !== "states";
  if (kind() === "states") states(side, share, free ? end ?? from : share < 0.5 ? from : end ?? from);
  else if (kind() === "settle") settle(share);
  else if (kind() === "motion") motion(share < 1 ? set : after);
  else study(share);
  if (moving) requestAnimationFrame(draw);
}

const wave = (one, other, share) => one.map((v, k) => v + share * (other[k] - v));

/** The lever of a state, over the curve on which its orbits lie. */
function states(side, share, name) {
  const { set, to: after, only, pick: [from, end] } = step();
  const known = (of) => (of === free?.set ? free.rows : rowsOf(of).value?.rows?.filter((row) => !row.lost));
  const [first, last] = free ? [free.rows, free.rows] : [known(set), known(after)];
  const rows = share < 0.5 ? first : last ?? first;
  if (!rows?.length) return;
  let row = pickOf(rows, name);
  let marked = rows;
  const curve = curveOf(free ? free.near : share < 0.5 ? set : after).value;
  if (share > 0 && share < 1 && first && last && (from ?? "") === (end ?? from ?? "")) {
    const [one, other] = [pickOf(first, from), pickOf(last, end ?? from)];
    if (one.film.tip.length === other.film.tip.length && one.film.periods === other.film.periods) {
      row = { ...one, regime: (share < 0.5 ? one : other).regime, film: { periods: one.film.periods, tip: wave(one.film.tip, other.film.tip, share), surface: wave(one.film.surface, other.film.surface, share), force: wave(one.film.force, other.film.force, share) } };
    }
    // While other values move there is no curve for them.
    marked = [];
    // Along the curve, if only the setpoint or the distance moves.
    const changes = Object.keys(after).filter((key) => set[key] !== after[key]);
    if (curve && changes.length === 1 && ["drive.setpoint", "gap.tip"].includes(changes[0])) {
      const column = changes[0] === "gap.tip" ? Z : A;
      const [a, b] = [one, other].map((of) => (column === Z ? of.distance.value : of.first_harmonic.value));
      const here = crossings(curve, column, a + share * (b - a)).filter((near) => near.stable === one.stable).sort((p, q) => Math.abs(regimeOf(p) === one.regime ? 0 : 1) - Math.abs(regimeOf(q) === one.regime ? 0 : 1))[0];
      marked = here ? [{ stable: here.stable, regime: regimeOf(here), phase: { value: here.at[PHASE] }, distance: { value: here.at[Z] }, chosen: true }] : [];
    }
  }
  film.show([[$("show-film"), row]], () => {}, rows.includes(row) ? rows : [row]);
  const names = free ? null : only?.[share < 1 ? 0 : 1] ?? null;
  const isSeen = (of) => !names || names.includes(of.stable ? of.regime : "unstable") || of === row;
  if (!curve) blank();
  else put(portrait(curve, marked.filter(isSeen).map((of) => ({ ...of, chosen: of === row || of.chosen })), { only: names, direct: true, distance: row.distance && marked === rows ? row.distance.value : NaN }));
}

/** How a disturbance falls, from the multiplier of the orbit, and before from that of the former values. */
function settle(share) {
  const { set, to: after, pick: [from] } = step();
  const curves = (free ? [[free.rows, free.set]] : shown ? [[rowsOf(set).value?.rows, set], [rowsOf(after).value?.rows, after]] : [])
    .flatMap(([rows, side]) => { const row = rows && pickOf(rows, from); return row ? [{ time: settling(row) / hertz(side["drive.frequency"]), side }] : []; });
  if (!curves.length) { blank(); return; }
  const far = 3 * Math.max(...curves.map(({ time }) => time));
  const [factor, unit] = far < 1e-4 ? [1e6, "µs"] : far < 0.1 ? [1e3, "ms"] : [1, "s"];
  const grid = Array.from({ length: 201 }, (_, k) => k / 200 * share * far);
  const unique = curves.filter(({ time }, k) => k === curves.length - 1 || time !== curves[k + 1].time);
  const layers = unique.flatMap(({ time }, k) => {
    const colour = k === unique.length - 1 ? LINE : COLOURS.unstable;
    return [{ kind: "line", points: { x: grid.map((x) => x * factor), y: grid.map((x) => Math.exp(-x / time)) }, dash: k === unique.length - 1 ? "solid" : "dashed", width: 1.3, colour, label: shortened(time, "s") },
      ...(share * far >= time ? [{ kind: "markers", points: { x: [time * factor], y: [Math.exp(-1)] }, shape: "circle", size: 2.6, edge: true, colour, label: "" }] : [])];
  });
  layers.push({ kind: "rule", at: Math.exp(-1), upright: false, dash: "dashed", width: 0.4, colour: "#5a5a5a", label: "1/e" });
  put({ rows: 1, cols: 1, column_widths: [], row_heights: [], share_x: false, panels: [{ title: "", x: axis(t("show.time"), unit, [0, far * factor]), y: axis(t("show.disturbance"), "", [0, 1]), layers, legend: "above" }] });
}

/** The motion: exact, or that of fixed time steps. */
function motion(side) {
  const known = free ? free.motion : motionOf(side).value;
  if (!known) { blank(); return; }
  const of = split(side).steps ? known.fixed_step?.figure : known.figure;
  if (of) put(panelsOf(of, [0])); else blank();
}

/** The figure of a study; before the answer only what is known then. */
function study(share) {
  const { set, to: after, panels, asked } = step();
  const same = JSON.stringify(set) === JSON.stringify(after);
  const of = (free ? free.study : studyOf(share < 1 && !(same && shown) ? set : after).value)?.figure;
  if (!of || (!shown && asked?.length === 0)) { blank(); return; }
  if (shown || !asked) { put(panelsOf(of, panels)); return; }
  const known = of.panels.map((panel) => ({ ...panel, layers: panel.layers.filter(({ label }) => asked.includes(label)) }));
  put(panelsOf({ ...of, panels: known }, [panels?.[0] ?? 0]));
}

/** A figure of these panels, in one column. */
function panelsOf(of, panels) {
  const many = (panel) => kind() === "motion" || panel.layers.filter(({ label }) => label).length > 4;
  const word = (text) => t("show.figure")[text] ?? text;
  const named = (one) => ({ ...one, label: word(one.label), ...(one.unit ? { unit: word(one.unit) } : {}) });
  const hidden = (panel) => ({ ...panel, title: "", x: named(panel.x), y: named(panel.y), layers: panel.layers.map((one) => (one.label ? named(one) : one)), legend: many(panel) ? "hidden" : panel.legend });
  const list = (panels ?? of.panels.map((_, k) => k)).flatMap((k) => (of.panels[k] ? [hidden(of.panels[k])] : []));
  return { ...of, rows: list.length, cols: 1, column_widths: [], row_heights: [], share_x: list.length > 1, panels: list };
}

const put = (of) => figure.put($("show-figure"), { ...of, ratio: 2 });
function blank() {
  const words = shown || kind() === "states" ? t("show.computing") : "?";
  if ($("show-figure").textContent === words) return;
  figure.clear($("show-figure"));
  $("show-figure").textContent = words;
}

// "What if?": the lecturer moves the values.

function whatIf() {
  if (!shown || free || !step().knobs.length) return;
  const { to: after } = step();
  free = { set: { ...after }, near: after, from: null, rows: rowsOf(after).value?.rows ?? [] , motion: null, study: null };
  if (kind() === "motion") free.motion = motionOf(after).value;
  if (isStudy()) free.study = studyOf(after).value;
  words();
  draw();
  $("show-answers").querySelector("input")?.focus();
}

function knobs() {
  return step().knobs.map((key) => {
    const now = parts(free.set[key] || step().to[key] || "");
    if (!now) return "";
    const start = parts(step().to[key]);
    const [low, high] = key === "drive.setpoint" ? [0.05, 0.995] : key === "steps" ? [20, 4000] : key === "omega" ? [2.4, 3.2] : [start.number / 8, start.number * 8];
    const log = high / low > 20;
    const range = make("input", { type: "range", min: 0, max: 1000, value: 1000 * (log ? Math.log(Math.max(low, now.number) / low) / Math.log(high / low) : (now.number - low) / (high - low)) });
    const out = make("output", { textContent: local(said(key, free.set[key])) });
    const move = () => {
      const value = log ? low * (high / low) ** (range.value / 1000) : low + (high - low) * range.value / 1000;
      free.set = { ...free.set, [key]: `${key === "steps" ? Math.round(value) : digits(value)} ${now.unit}`.trim() };
      if (key === "cantilever.f0") free.set["drive.frequency"] = free.set[key];
      out.textContent = local(said(key, free.set[key]));
      range.setAttribute("aria-valuetext", out.textContent);
      solve();
    };
    range.addEventListener("input", move);
    range.setAttribute("aria-valuetext", out.textContent);
    return make("label", { className: "knob" }, make("span", {}, `${t("show.keyNames")[key] ?? key} `, out), range);
  });
}

const whatRows = () => (free.rows ?? []).filter((row) => row.stable && kind() === "states").map((row) => t("show.row", { name: t("states.names")[row.regime], ...ofRow(row) })).join(" · ")
  || (kind() === "settle" && free.rows?.[0] ? filled("{settle}", { settle: shortened(settling(free.rows[0]) / hertz(free.set["drive.frequency"]), "s") }) : kind() === "motion" && free.motion ? fixed(free.motion) || exactPeriod(free.motion) : "");

const nearby = ({ distance, unit, period, state: at, stable }) => ({ distance: distance.value, unit, period, state: at, stable });

/** Once the values rest: the curve, and the states on all its branches. */
async function rested(own) {
  if (free !== own) return;
  const at = own.near = own.set;
  draw();
  try {
    const curve = await curveOf(at).done;
    const ratio = Number(at["drive.setpoint"] || NaN);
    if (free !== own || own.set !== at || !ratio) return;
    const near = crossings(curve, A, ratio * curve.free.amplitude.value).map((one) => nearby({ ...one, distance: { value: one.at[Z] } }));
    if (!near.length) return;
    const { rows } = await result("/api/states", { case: split(at).case, near }).done;
    if (free !== own || own.set !== at) return;
    own.rows = rows.filter((row) => !row.lost);
    $("show-says").textContent = whatRows();
    draw();
  } catch (error) { if (!superseded(error)) failure = t("show.failed", { reason: error.message }); }
}

let solving = false;
let resting = 0;
/** Computes what the values show, until it is that of the last ones. */
async function solve() {
  if (solving) return;
  solving = true;
  let done = null;
  while (free && done !== free.set) {
    done = free.set;
    const own = free;
    const { case: of, options, steps } = split(done);
    const sent = async (path, body) => { busy.add("lecture free"); try { return await ask("lecture free", path, body); } finally { busy.delete("lecture free"); } };
    try {
      if (kind() === "motion") own.motion = await sent("/api/motion", { case: of, start: "", steps });
      else if (isStudy()) await stream("lecture free", "/api/study", { case: of, start: "", tab: kind(), options }, (stage) => { own.study = { ...own.study, ...stage }; });
      else {
        const near = own.rows.filter((row) => row.state && row.period).map(nearby);
        let rows = near.length ? (await sent("/api/states", { case: of, near, from: split(own.from ?? step().to).case })).rows.filter((row) => !row.lost) : [];
        if (!rows.some((row) => row.stable)) rows = (await sent("/api/states", { case: of, near: [] })).rows.filter((row) => !row.lost);
        Object.assign(own, { rows, from: done });
        clearTimeout(resting);
        if (kind() === "states") resting = setTimeout(() => rested(own), REST);
      }
      failure = "";
    } catch (error) { if (!superseded(error)) failure = t("show.failed", { reason: error.message }); }
    if (free === own && current()) { $("show-says").textContent = failure || whatRows(); draw(); }
  }
  solving = false;
}
