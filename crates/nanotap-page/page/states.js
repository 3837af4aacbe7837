// The states of the lever at the setpoint or the distance: one row a state, the curve on which they lie, and
// the oscilloscope of the chosen one.

import { DISTANCES, basis, caseText, chosen, put, remember, state, thatCase, theCase } from "./state.js";
import { ask, stop, stream, superseded } from "./api.js";
import { local, t } from "./words.js";
import { inSi } from "./entry.js";
import { A, COLOURS, FORCE, PHASE, Z, crossings, portrait, reached, regimeOf, same, stretch } from "./curve.js";
import { make } from "./element.js";
import { axis, scale } from "./axis.js";
import * as film from "./film.js";
import * as figure from "./figure.js";

const $ = (id) => document.getElementById(id);
const REST = 250;             // milliseconds without a change before the curve is followed anew
const MOST = 24;              // largest number of orbits from which rows are requested
const FEW = 6;                // rows up to which unstable ones are shown by themselves
const ALIKE = 1e-3;           // relative difference below which two motions are the same
const NEAR = 0.02;            // the same for a motion and a point of the curve
const FREE = 0.99999;         // amplitude, over the free one, above which a lever counts as free
const NOTE = 4000;            // milliseconds for which the page shows that a state was lost
let shown = () => {};         // called with the chosen row
let refused = () => {};
let active = false;
let rows = [];
let info = {};
let rowsOf = null;            // the case of the rows: its text, its basis, and how a request contains it
let curve = null;
let curveOf = "";
let following = "";           // the case whose curve is being followed
let found = null;             // result of the search from many starts, and its case
let searching = "";
const knocks = new Map();     // smallest knocks, by case and state
const margin = new Map();     // how far frequency and free amplitude may change, by case and state
let second = null;            // the row that is compared with the chosen one
let outdated = false;
let underway = false;
let timer = 0;
let rests = true;
let made = "";
let lost = "";
let approximate = false;

/** `onShown(row, rests)` is called when a row is chosen, `error(refusal)` when there is none. */
export function begin(onShown, error) {
  shown = onShown;
  refused = error;
  $("hold").addEventListener("click", () => { film.hold(film.moves()); holdWords(); });
  $("with-unstable").addEventListener("change", () => { $("with-unstable").dataset.own = "yes"; draw(); });
  figure.alive($("curve"), { views: () => state.views.curve ?? [], tell: () => {}, go, zoom: (views) => { state.views.curve = views; remember(true); } });
  figure.alive($("scope"), { views: () => state.views.scope ?? [], tell: () => {}, zoom: (views) => { state.views.scope = views; remember(true); } });
}

function holdWords() {
  $("hold").textContent = t(film.moves() ? "states.pause" : "states.play");
  $("hold").setAttribute("aria-pressed", String(!film.moves()));
}

/** Shows the view. */
export function enter() {
  active = true;
  made = "";
  if (!chosen.row) second = null;
  holdWords();
  takeFirst();
  changed(true);
  draw();
}

/** Takes the states of the first example, which are in the page, so that they are seen before the program is
 *  there; it then closes them anew. */
function takeFirst() {
  const text = $("first")?.textContent;
  const first = text && !rows.length ? JSON.parse(text) : null;
  if (first?.of !== caseText() || !first.answer?.rows) return;
  info = { held: first.answer.held, free: first.answer.free };
  rowsOf = { text: caseText(), own: own(), basis: basis(), case: theCase() };
  take(first.answer.rows);
  choose();
  draw();
}

export function leave() {
  active = false;
  clearTimeout(timer);
  stop("states"); stop("curve"); stop("search"); stop("knock");
  film.show([]);
}

/** The held quantity, the free motion, and the chosen state. */
export const about = () => info;

const own = () => caseText(DISTANCES);
const fits = () => curve !== null && curveOf === own();
/** What the rows have in common: the column of the curve, and its value. */
function target() {
  const text = state.set["drive.setpoint"];
  const free = fits() ? curve.free.amplitude.value : info.free?.amplitude.value;
  if (text) {
    const ratio = Number(text);
    return { column: A, value: Number.isFinite(ratio) ? ratio * free : inSi(text, "m") };
  }
  if (state.set["gap.tip"]) return { column: Z, value: inSi(state.set["gap.tip"], "m") };
  const plain = state.set.alpha5 ?? state.set.gap;
  if (plain !== undefined) return { column: Z, value: Number(plain) };
  if (info.held?.kind === "amplitude") return { column: A, value: info.held.value * free };
  return { column: Z, value: info.held ? NaN : rows[0]?.distance?.value ?? NaN };
}

/** The case changed; `finished` unless a slider is being moved. */
export function changed(finished) {
  if (!active) return;
  rests = finished;
  clearTimeout(timer);
  if (following && following !== own()) { stop("curve"); following = ""; }
  if (searching && searching !== caseText()) { stop("search"); searching = ""; }
  stop("knock");
  preview();
  solve();
}

/** Rows from the curve, before the program has closed their orbits. */
function preview() {
  const { column, value } = target();
  if (!fits() || !Number.isFinite(value)) { approximate = rows.length > 0; if (rows.length) $("rows").classList.toggle("stale", rowsOf?.text !== caseText()); return; }
  approximate = true;
  take(crossings(curve, column, value).slice(0, MOST).map((near) => ({
    near, period: near.period, stable: near.stable, class: "periodic", approximate: true,
    regime: regimeOf(near),
    distance: { value: near.at[Z] }, first_harmonic: { value: near.at[A] }, phase: { value: near.at[PHASE] }, peak_force: { value: near.at[FORCE] },
    film: rows.find((row) => row.film && row.stable === near.stable && Math.abs(row.phase.value - near.at[PHASE]) < 10)?.film,
  })));
}

/** Asks for the rows until they are those of the present values. */
async function solve() {
  outdated = true;
  if (underway) return;
  underway = true;
  document.body.dataset.rows = "busy";
  while (outdated && active) {
    outdated = false;
    const wish = request();
    try {
      const answer = await ask("states", "/api/states", wish.body);
      if (wish.own !== own() && !wish.body.from && outdated) continue;
      await accept(answer, wish);
    } catch (error) {
      if (!superseded(error) && !outdated) refused(error);
    }
  }
  underway = false;
  document.body.dataset.rows = active ? "done" : "";
}

function request() {
  const wish = { text: caseText(), own: own(), basis: basis(), body: { case: theCase(), near: [] } };
  const { column, value } = target();
  const near = ({ distance, unit, period, state: at, stable }) => ({ distance: distance.value, unit, period, state: at, stable });
  if (fits() && Number.isFinite(value)) {
    wish.near = crossings(curve, column, value).slice(0, MOST);
    wish.body.rest = rests;
    wish.body.near = wish.near.map((one) => near({ ...one, distance: { value: one.at[Z] } }));
  } else if (rowsOf?.basis === basis() && rows.some((row) => row.state && row.period)) {
    const known = rows.filter((row) => row.state && row.period);
    wish.body.near = known.slice(0, MOST).map(near);
    wish.body.from = rowsOf.case;
  }
  return wish;
}

async function accept(answer, wish) {
  const closed = answer.rows.map((row, k) => ({ ...row, near: wish.near?.[k] })).filter((row) => !row.lost);
  if (!closed.length && wish.body.near.length) {
    // None of the known orbits leads here.
    rowsOf = null; rows = [];
    if (fits()) { take([]); settle(answer, wish); return; }
    outdated = true;
    return;
  }
  const before = chosen.row;
  take(unique(closed));
  settle(answer, wish);
  const gone = before && !before.approximate && !rows.some((row) => kind(row) === kind(before)) ? before : null;
  if (gone?.stable) say(t("states.lost", { name: name(gone) }));
}

function settle(answer, wish) {
  info = { held: answer.held, free: answer.free };
  approximate = false;
  $("rows").classList.remove("stale");
  rowsOf = { text: wish.text, own: wish.own, basis: wish.basis, case: wish.body.case };
  merge();
  choose();
  draw();
  if (!outdated) {
    tellRow();
    if (rests) rest();
  }
}

function say(words) {
  lost = words;
  setTimeout(() => { if (lost === words) { lost = ""; if (active) draw(); } }, NOTE);
}

const agree = (a, b, tolerance) => Math.abs(a.value - b.value) <= tolerance * Math.abs(b.value);
/** Whether two rows at one distance are the same motion. */
const alike = (a, b) => a.period === b.period && agree(a.first_harmonic, b.first_harmonic, ALIKE) && agree(a.peak_force, b.peak_force, ALIKE);

/** Removes repeated rows. Two orbits at a setpoint have one amplitude, but not one distance and phase. */
function unique(list) {
  const made = [];
  for (const row of list) {
    if (!made.some((other) => alike(other, row) && agree(other.distance, row.distance, 1e-9) && Math.abs(other.phase.value - row.phase.value) < 1e-3)) made.push(row);
  }
  return made;
}

/** Rows in an order that does not depend on how they were found: stable first, from far to near. */
function take(list) {
  rows = [...list].sort((a, b) => Number(b.stable) - Number(a.stable) || b.distance.value - a.distance.value || b.first_harmonic.value - a.first_harmonic.value);
}

/** Adds the motions that a search found at this distance. */
function merge() {
  if (!found || found.of !== caseText() || info.held) return;
  for (const { row, share, exponent } of found.motions) {
    const known = rows.find((other) => alike(row, other));
    if (known) known.share = share;
    else rows.push({ ...row, share, exponent });
  }
  take(rows);
}

const kind = (row) => [row.class, row.stable, row.regime, row.period].join();
const chosenRow = () => rows.find((row) => row.chosen);

/** The row that stays chosen: that of the link, the former one's continuation, or where the lever comes to. */
function choose() {
  const before = chosen.row;
  let pick = null;
  if (state.start && !before) pick = nearest(state.start);
  if (!pick && before) pick = continued(before);
  pick ??= rows.find((row) => row.stable && how(row).includes("afar")) ?? rows.find((row) => row.stable) ?? rows[0];
  select(pick);
  if (rows.length > 1) pair(second ? continued(second) : state.compare && nearest(state.compare));
}

/** The row that continues one of other values. */
function continued(before) {
  const turn = (row) => Math.abs(row.phase.value - before.phase.value);
  return rows.filter((row) => kind(row) === kind(before)).sort((a, b) => turn(a) - turn(b))[0];
}

function select(row) {
  for (const one of rows) one.chosen = one === row;
  Object.assign(chosen, { row: row ?? null, of: caseText(), set: info.held ? row?.set ?? null : null });
  state.start = row?.start ?? "";
}

/** Compares a row with the chosen one, or none. */
function pair(row) {
  second = row && !row.chosen ? row : null;
  for (const one of rows) one.compared = one === second;
  state.compare = second?.start ?? "";
}

/** The row with a state of a link, or the row nearest to it. */
function nearest(start) {
  const exact = rows.find((row) => row.start === start);
  if (exact) return exact;
  const [, numbers = start] = start.split(":");
  const wanted = numbers.split(",").map(Number);
  const off = (row) => (row.state?.length === wanted.length ? Math.max(...wanted.map((x, k) => Math.abs(x - row.state[k]))) : Infinity);
  const best = [...rows].sort((a, b) => off(a) - off(b))[0];
  return best && off(best) < Infinity ? best : null;
}

function tellRow() {
  const row = chosenRow();
  info.ratio = row?.ratio ?? null;
  info.distance = row?.set?.["gap.tip"] ?? null;
  // The address is written at rest only.
  if (rests) remember(false);
  shown(row ?? null, rests);
}

/** When the values rest: follows the curve, searches from many starts, then finds the smallest knock. */
function rest() {
  clearTimeout(timer);
  timer = setTimeout(async () => {
    if (!active || outdated) return;
    // Without units the states come from the search; those of a lever lie on its curve.
    if (isPlain()) await search();
    if (!active || outdated) return;
    if (!fits() && following !== own()) await follow();
    if (!active || outdated) return;
    await search();
    if (active && !outdated) await upsets();
  }, REST);
}

async function follow() {
  const of = own();
  following = of;
  draw();
  try {
    await stream("curve", "/api/curve", { case: theCase() }, (stage) => {
      if (of !== own()) return;
      curve = stage.branches ? stage : { ...stage, branches: fits() ? curve.branches : [] };
      if (stage.branches) { curveOf = of; following = ""; }
      else if (curveOf !== of) curveOf = "";
      drawCurve();
      if (stage.branches) solve();
    });
  } catch (error) {
    if (!superseded(error)) $("curve-words").textContent = local(error.message);
  }
  if (following === of) following = "";
}

/** Searches from many starts at the distance of the chosen state. */
async function search() {
  const of = caseText();
  if (found?.of === of || searching === of) return;
  searching = of;
  draw();
  const { shown: at = "", value: z = NaN } = chosenRow()?.distance ?? {};
  try {
    const answer = await ask("search", "/api/attractors", { case: thatCase(), unstable: isPlain() });
    if (of !== caseText() || !active) return;
    found = { of, at, z, ...answer };
    searching = "";
    merge();
    if (!chosenRow()) { choose(); tellRow(); }
    draw();
  } catch (error) {
    if (!superseded(error) && of === caseText()) { searching = ""; found = { of, at, error: error.message, motions: [] }; draw(error.message); }
  } finally { if (searching === of) searching = ""; }
}

/** Whether the case has no units: then all motions come from the search. */
const isPlain = () => rows.every((row) => !row.set);

/** What upsets the chosen state: first another frequency or free amplitude, then a knock, which takes long. */
async function upsets() {
  const row = chosenRow();
  const key = knockOf(row);
  if (!row?.stable || !row.period || row.regime === "free" || chosen.of !== caseText()) return;
  for (const [known, path] of [[margin, "/api/margins"], [knocks, "/api/knock"]]) {
    if (known.has(key)) continue;
    try {
      const held = known === margin && info.held ? { held: theCase() } : {};
      known.set(key, await ask("knock", path, { case: thatCase(), start: row.start, ...held }));
      draw();
    } catch (error) {
      if (superseded(error)) return;
      known.set(key, {});
    }
  }
}

/** Case and state, under which the limits of a state are kept. */
const knockOf = (row) => (row ? `${caseText()} ${row.start}` : "");

// What is shown.

/** The name of a state, in words. */
function name(row) {
  if (row.class !== "periodic") return t("states.names")[row.class] ?? row.class;
  if (!row.stable) return t("states.names.unstable");
  return t("states.names")[row.regime];
}

function below(row) {
  const more = row.period > 1 ? t("states.period", { period: row.period }) : "";
  const pair = rows.some((one) => one.stable && one.regime === "attractive") && rows.some((one) => one.stable && one.regime === "repulsive");
  if (!row.set) return [row.stable ? "" : t("states.about.unstable"), more].filter(Boolean).join(", ");
  const words = !row.stable ? t(pair ? "states.about.between" : "states.about.unstable") : row.regime === "free" ? t("states.about.free") : row.peak_force.value > 0 ? t("states.about.taps") : t("states.about.away");
  return [words, more].filter(Boolean).join(", ");
}

/** A number with a prefix, as the program shows it. */
function short(value, unit) {
  if (!value) return `0 ${unit}`;
  if (!unit) return String(Number(value.toPrecision(4)));
  const size = Math.floor(Math.log10(Math.abs(value)) / 3);
  const prefix = { "-7": "z", "-6": "a", "-5": "f", "-4": "p", "-3": "n", "-2": "µ", "-1": "m", 0: "", 1: "k" }[size];
  return `${Number((value / 10 ** (3 * size)).toPrecision(4))} ${prefix ?? ""}${unit}`;
}

const length = (row, key) => row[key].shown ?? short(row[key].value, "m");
/** A part in per cent, with more digits near the whole. */
const percent = (part) => `${Number((100 * part).toFixed(part > 0.999 ? 3 : 1))} %`;
const degrees = (value) => `${value.toFixed(1)}°`;
const zero = (text) => (/^-?0( |$)/.test(text) ? "0" : text);

/** Ways on which a lever gets to a row. */
function how(row) {
  if (!row.stable || !curve || !curve.approach.length) return [];
  const { column, value } = target();
  const { afar, back } = reached(curve, column, value);
  const at = [row.distance.value, row.first_harmonic.value, row.phase.value];
  return [same(afar, at, curve) && "afar", same(back, at, curve) && !same(afar, at, curve) && "back", row.rest && "rest"].filter(Boolean);
}

function howWords(row) {
  if (!row.stable) return t("states.how.never");
  const ways = how(row).map((way) => t(`states.how.${way}`));
  if (Number.isFinite(row.share)) ways.push(t("states.how.start", { share: Number((100 * row.share).toPrecision(3)) }));
  if (!ways.length) return curve ? t("states.how.knock") : t("states.how.looking");
  return ways.join("; ");
}

/** In how many periods a disturbance of a state falls to 1/e. */
const settles = (row) => (row.multiplier > 0 && row.multiplier < 1 ? [t("states.jump.settlesPeriods", { periods: Number((row.period / -Math.log(row.multiplier)).toPrecision(2)) })] : []);

function jumpWords(row) {
  const words = [];
  if (!row.stable && row.multiplier > 1) words.push(t("states.jump.grows", { periods: Number((row.period / Math.log(row.multiplier)).toPrecision(2)) }));
  if (row.stable && row.near && fits()) {
    const held = info.held ? A : Z;
    const range = stretch(curve, row.near, held);
    const free = curve.free.amplitude.value;
    const say = (v) => (info.held ? `${percent(v / free)}` : short(v, curve.unit === 1 ? "" : "m"));
    // Beyond the last distance that is followed the lever is free.
    const open = info.held ? range && range.high >= FREE * free : range && range.high >= FREE * curve.approach[0][Z];
    if (range) words.push(open ? t("states.jump.down", { low: say(range.low) }) : t("states.jump.between", { low: say(range.low), high: say(range.high) }));
  }
  if (row.stable && !words.length) words.push(...settles(row));
  return words.join("; ");
}

/** What ends the chosen state: another frequency or free amplitude, at its setpoint or its distance, or a knock at
 *  its distance. */
function marginWords() {
  const row = chosenRow();
  if (!row?.stable || !row.period) return "";
  const words = [];
  const followed = [];
  for (const [key, name] of [["drive.frequency", "frequency"], ["drive.free_amplitude", "free"]]) {
    const [low, high] = margin.get(knockOf(row))?.[key] ?? [];
    if (low || high) followed.push(t(`states.jump.${name}`, { range: t(low && high ? "states.jump.range" : low ? "states.jump.least" : "states.jump.most", { low, high }) }));
  }
  const knocked = knocks.get(knockOf(row));
  if (knocked?.speed) words.push(t("states.jump.knock", { speed: knocked.speed, share: Number((100 * knocked.share).toPrecision(2)) }));
  else if (knocked?.none) words.push(t("states.jump.noKnock", { speed: knocked.none }));
  words.push(...settles(row));
  const state = name(row);
  const held = followed.length && margin.get(knockOf(row)).held && info.held;
  const head = held ? t("states.jump.marginHeld", { name: state, kind: t("states.jump.kinds")[held.kind], value: held.shown }) : t("states.jump.margin", { name: state });
  // A setpoint is held by the distance; a knock is one at the distance.
  const parts = held ? [[head, followed], [t("states.jump.atDistance"), words]] : [[head, [...followed, ...words]]];
  return parts.filter(([, said]) => said.length).map(([first, said]) => `${first} ${said.join("; ")}.`).join(" ");
}

/** The sentence that answers first. */
function verdict(reason) {
  const stable = rows.filter((row) => row.stable);
  if (lost) return lost;
  if (!rows.length) return searching || underway || following ? "" : t("states.sentence.none", { reason: reason ?? "" });
  if (isPlain()) return stable.length ? t(stable.length > 1 ? "states.sentence.many" : "states.sentence.single", { count: count(stable.length), held: t("states.held.distance") }) : "";
  const held = t(info.held ? "states.held.setpoint" : "states.held.distance");
  const touch = (row) => (row.peak_force.value > 0 ? t("states.sentence.presses", { force: row.peak_force.shown ?? short(row.peak_force.value, "N") }) : row.regime === "free" ? "" : t("states.sentence.touchNot"));
  const first = stable.find((row) => how(row).includes("afar"));
  if (!stable.length) return "";
  if (stable.length === 1) return [t(first ? "states.sentence.afar" : "states.sentence.one", { name: name(stable[0]).toLowerCase(), touch: touch(stable[0]) }), found?.of === caseText() && !found.error ? t("states.sentence.only", { held }) : ""].join(" ");
  const [start, other] = first ? [first, stable.find((row) => row !== first)] : stable;
  const step = start.distance.value - other.distance.value;
  const turn = other.phase.value - start.phase.value;
  const change = [
    info.held && Math.abs(step) > 0 ? t("states.sentence.step", { step: short(Math.abs(step), "m") }) : "",
    Math.abs(turn) >= 0.1 ? t(turn > 0 ? "states.sentence.phaseUp" : "states.sentence.phaseDown", { degrees: degrees(Math.abs(turn)) }) : "",
  ].filter(Boolean).join(t("states.sentence.and"));
  return [
    t(first ? "states.sentence.afar" : "states.sentence.one", { name: name(start).toLowerCase(), touch: touch(start) }),
    change ? t("states.sentence.other", { name: name(other).toLowerCase(), touch: touch(other), change: `${change}${info.held ? `, ${t("states.sentence.flat")}` : ""}` }) : t("states.sentence.many", { count: count(stable.length), held }),
  ].join(" ");
}

const count = (n) => t("states.counts")[n] ?? String(n);

function heading() {
  const stable = rows.filter((row) => row.stable).length;
  if (!rows.length && (underway || searching)) return t("states.headingSearch");
  return t(info.held ? "states.heading" : "states.headingDistance", { count: count(stable) });
}

function sure() {
  if (approximate) return t("states.approximate");
  if (searching === caseText()) return t("states.searching");
  if (found?.of !== caseText()) return "";
  if (found.error) return local(found.error);
  const at = isPlain() ? "" : found.at;
  const unseen = found.unseen ? t("states.oneIn", { count: Math.floor(1 / found.unseen) }) : "";
  const place = at ? t("states.searchedAt", { distance: at }) : "";
  const words = [t(unseen ? "states.searched" : "states.searchedNo", { starts: found.starts, place, unseen })];
  if (found.undecided) words.push(t("states.undecided", { count: found.undecided }));
  if (found.unbounded) words.push(t("states.unbounded", { count: found.unbounded }));
  const more = offCurve();
  if (more.length) words.push(t("states.searchedMore", { motions: more.map((row) => `${name(row)} (${COLUMNS.amplitude(row)})`).join(", ") }));
  if (rows.every((row) => !(row.dissipation?.value > 0))) words.push(t("states.noEnergy"));
  return words.join(" ");
}

/** Where the model does not hold for a stable state. */
function limits() {
  const said = rows.filter((row) => row.stable).flatMap((row) => (row.limits ?? []).map((text) => `${name(row)}: ${local(text)}.`));
  return [...new Set(said)].join(" ");
}

/** The motions that the search found and that lie on no branch of the curve at its distance. */
function offCurve() {
  if (!info.held || !fits() || !found) return [];
  // Another row may have been chosen since: its distance is another one.
  const here = crossings(curve, Z, found.z);
  const near = (value, row) => Math.abs(value - row.first_harmonic.value) <= NEAR * Math.abs(value);
  return found.motions.map(({ row }) => row).filter((row) => !here.some(({ at, period }) => period === row.period && near(at[A], row)));
}

/** Columns of the table: name of the head, and words of the cell. */
const COLUMNS = {
  distance: (row) => length(row, "distance"),
  amplitude: (row) => `${length(row, "first_harmonic")}${Number.isFinite(row.ratio) && row.ratio !== null ? ` · ${Number((100 * row.ratio).toPrecision(4))} %` : ""}`,
  phase: (row) => (row.phase.value === null ? "–" : degrees(row.phase.value)),
  force: (row) => zero(row.peak_force.shown ?? short(row.peak_force.value, "N")),
  indentation: (row) => zero(row.indentation?.shown ?? "…"),
  energy: (row) => zero(row.dissipation?.shown ?? "…"),
};

/** Key in a row of what a column shows, and its unit. */
const QUANTITIES = { distance: ["distance", "m"], amplitude: ["first_harmonic", "m"], phase: ["phase", "°"], force: ["peak_force", "N"], indentation: ["indentation", "m"], energy: ["dissipation", "J"] };

function columns() {
  const energy = rows.some((row) => row.dissipation?.value > 0);
  return [info.held ? "distance" : "amplitude", "phase", "force", "indentation", ...(energy ? ["energy"] : [])];
}

/** Draws everything anew. */
function draw(reason) {
  if (!active) return;
  const few = rows.filter((row) => !row.stable).length <= FEW;
  const box = $("with-unstable");
  if (box.dataset.own !== "yes") box.checked = few;
  const list = rows.filter((row) => row.stable || box.checked);
  $("states-heading").textContent = heading();
  document.body.dataset.search = searching || following ? "busy" : "done";
  const words = verdict(reason);
  if ($("verdict").textContent !== words) $("verdict").textContent = words;
  $("limits").textContent = limits();
  $("sure").textContent = sure();
  $("margin").textContent = marginWords();
  table(list);
  drawCurve();
  scope();
  dock();
}

function table(list) {
  const own = columns();
  const outline = JSON.stringify([own, list.map(kind), document.documentElement.lang]);
  const body = $("rows").tBodies[0];
  $("rows").classList.toggle("plain", isPlain());
  if (outline !== made) {
    made = outline;
    const heads = ["state", "film", ...own, "how", "jump", "compare"];
    $("rows").tHead.rows[0].replaceChildren(...heads.map((head) => make("th", { scope: "col", textContent: t(`states.heads.${head}`), title: head === "film" ? t("states.filmAbout") : "", className: head })));
    body.replaceChildren(...list.map(() => line(own)));
  }
  list.forEach((row, k) => fill(body.rows[k], row, own));
  film.show([...list.map((row, k) => [body.rows[k].querySelector("canvas"), row]), ...comparison()], clock, list);
}

/** Shows two states side by side; returns their films. Values that are read off the curve keep the former table. */
function comparison() {
  const box = $("compare");
  const pairs = [chosenRow(), rows.find((row) => row.compared)].filter(Boolean).map((row) => [make("canvas", { ariaLabel: t("states.filmAbout"), role: "img" }), row]);
  box.classList.toggle("stale", approximate);
  if (approximate) return [];
  box.hidden = pairs.length < 2;
  if (box.hidden) return [];
  const [one, other] = pairs.map(([, row]) => row);
  box.caption.textContent = t("states.compared", { one: name(one), other: name(other) });
  const names = pairs.map(([canvas, row]) => { const head = make("th", { scope: "col" }, make("b", { textContent: name(row) }), canvas); head.dataset.state = row.stable ? row.regime : "unstable"; return head; });
  box.tHead.rows[0].replaceChildren(document.createElement("td"), ...names, make("th", { scope: "col", textContent: t("states.difference") }));
  box.tBodies[0].replaceChildren(...columns().map((name) => {
    const cells = [COLUMNS[name](one), COLUMNS[name](other), difference(name, one, other)].map((words) => make("td", { textContent: local(words) }));
    const [key] = QUANTITIES[name];
    cells[2].dataset.value = other[key].value - one[key].value;
    const line = make("tr", {}, make("th", { scope: "row", textContent: t(`states.heads.${name}`) }), ...cells);
    line.dataset.quantity = name;
    return line;
  }));
  return pairs;
}

/** How much larger a quantity is in the other state, in words. */
function difference(name, one, other) {
  const [key, unit] = QUANTITIES[name];
  const [from, to] = [one, other].map((row) => row[key].value);
  if (from === null || to === null) return "–";
  const change = to - from;
  if (Math.abs(change) <= 1e-9 * Math.max(Math.abs(from), Math.abs(to))) return "0";
  return `${change < 0 ? "−" : "+"}${unit === "°" ? degrees(Math.abs(change)) : short(Math.abs(change), isPlain() ? "" : unit)}`;
}

function line(own) {
  const row = document.createElement("tr");
  const head = make("th", { scope: "row" });
  const button = make("button", { type: "button", className: "name" });
  head.append(make("span", { className: "dot" }), button, make("span", { className: "small about" }));
  const film = document.createElement("td");
  const canvas = document.createElement("canvas");
  canvas.setAttribute("role", "img");
  film.append(canvas);
  film.className = "film";
  const cell = (name) => { const one = document.createElement("td"); one.className = name; one.dataset.head = t(`states.heads.${name}`); return one; };
  const box = make("input", { type: "checkbox" });
  const label = make("label", {}, make("span", { textContent: t("states.heads.compare") }), box);
  const last = make("td", { className: "compare" }, label);
  // A click here does not choose the row.
  last.addEventListener("click", (event) => event.stopPropagation());
  box.addEventListener("change", () => toggle(row.of));
  row.append(head, film, ...own.map(cell), cell("how"), cell("jump"), last);
  row.addEventListener("mousedown", (event) => { if (event.shiftKey) event.preventDefault(); });
  row.addEventListener("click", (event) => (event.shiftKey ? toggle(row.of) : pick(row.of)));
  return row;
}

function fill(line, row, own) {
  line.of = row;
  line.dataset.state = row.stable ? row.regime : "unstable";
  line.dataset.stable = String(row.stable);
  line.classList.toggle("approximate", Boolean(row.approximate));
  line.setAttribute("aria-selected", String(Boolean(row.chosen)));
  const button = line.querySelector("button");
  button.textContent = name(row);
  button.setAttribute("aria-pressed", String(Boolean(row.chosen)));
  line.querySelector(".about").textContent = below(row);
  line.querySelector("canvas").setAttribute("aria-label", `${name(row)}: ${t("states.filmAbout")}`);
  const put = (cell, words) => { if (cell.textContent !== words) cell.textContent = words; };
  for (const name of own) put(line.querySelector(`.${name}`), local(`${row.approximate ? "≈ " : ""}${COLUMNS[name](row)}`));
  const box = line.querySelector("input");
  if (!row.approximate) Object.assign(box, { checked: Boolean(row.compared), disabled: Boolean(row.chosen) });
  box.setAttribute("aria-label", t("states.compareWith", { name: name(row) }));
  for (const [name, [key]] of Object.entries(QUANTITIES)) {
    const cell = line.querySelector(`td.${name}`);
    if (cell && row[key]) { cell.dataset.value = row[key].value; cell.title = local(row[key].value ?? ""); }
  }
  put(line.querySelector(".how"), howWords(row));
  put(line.querySelector(".jump"), jumpWords(row));
}

/** Chooses a row. */
function pick(row) {
  if (!row || row.chosen || row.approximate) return;
  const before = chosenRow();
  select(row);
  pair(row === second ? before : second);
  remember(true);
  stop("knock");
  draw();
  tellRow();
  rest();
}

/** Compares a row with the chosen one, or no longer. */
function toggle(row) {
  if (!row || row.chosen || row.approximate) return;
  pair(row.compared ? null : row);
  remember(true);
  draw();
}

/** The curve of the states: the phase against the distance, or the amplitude where there is no phase. */
function drawCurve() {
  if (!active) return;
  $("curve-words").textContent = following === own() && !fits() ? t("states.curveLooking") : fits() ? t("states.curveFollowed", { held: t(info.held ? "states.held.setpoint" : "states.held.distance") }) : "";
  if (!curve || (curveOf !== own() && following !== own())) { $("curve").classList.toggle("stale", Boolean(curve)); if (!curve) figure.clear($("curve")); return; }
  $("curve").classList.remove("stale");
  const { column, value } = target();
  figure.put($("curve"), portrait(curve, rows, { distance: column === Z ? value : NaN }));
}

/** A click on the curve: the setpoint or the distance there. */
function go(place) {
  if (!fits()) return;
  const far = Math.max(...curve.approach.map((point) => point[Z]));
  const [factor, unit] = scale(far, curve.unit === 1 ? "" : "m");
  const z = place.x / factor;
  if (!info.held) { put(curve.key, `${Number(place.x.toPrecision(5))} ${unit}`.trim(), DISTANCES); remember(true); changed(true); return; }
  const near = crossings(curve, Z, z).sort((a, b) => Math.abs(a.at[PHASE] - place.y) - Math.abs(b.at[PHASE] - place.y))[0];
  if (!near) return;
  put("drive.setpoint", String(Number((near.at[A] / curve.free.amplitude.value).toFixed(4))), DISTANCES);
  chosen.row = { class: "periodic", stable: near.stable, regime: regimeOf(near), period: near.period, phase: { value: near.at[PHASE] } };
  remember(true);
  changed(true);
}

/** The oscilloscope: height and force over two drive periods. */
function scope() {
  const row = chosenRow();
  $("scope-heading").textContent = row ? t("states.scope", { name: name(row).toLowerCase() }) : t("states.scopeChoose");
  if (!row?.film) { figure.clear($("scope")); return; }
  const { film: one } = row;
  const periods = Math.max(2, one.periods);
  const repeats = Math.ceil(periods / one.periods);
  const per = (one.tip.length - 1) / one.periods;
  const time = [];
  const wave = (list) => { const all = []; for (let k = 0; k < repeats; k += 1) all.push(...list.slice(k ? 1 : 0)); return all; };
  const all = { tip: wave(one.tip), surface: wave(one.surface), force: wave(one.force) };
  all.tip.forEach((_, k) => time.push(k / per));
  const plain = row.unit === 1;
  const span = Math.max(...all.tip.map(Math.abs));
  const [factor, unit] = scale(span, plain ? "" : "m");
  const push = Math.max(...all.force.map(Math.abs)) || 1;
  const [newton, ofForce] = scale(push, plain ? "" : "N");
  const range = (list, size) => { const [low, high] = [Math.min(0, ...list) * size, Math.max(0, ...list) * size]; const pad = 0.06 * (high - low || 1); return [low - pad, high + pad]; };
  const x = axis(t("states.axes.time"), "", [0, periods]);
  const lineOf = (list, size, colour, label, dash = "solid") => ({ kind: "line", points: { x: time, y: list.map((v) => v * size) }, dash, width: 1, colour, label });
  const colour = COLOURS[row.stable ? row.regime : "unstable"];
  figure.put($("scope"), {
    rows: 2, cols: 1, column_widths: [], row_heights: [], share_x: true,
    panels: [
      { title: "", x, y: axis(t("states.axes.height"), unit, range([...all.tip, ...all.surface], factor)), layers: [lineOf(all.surface, factor, "#9a7b4f", t("states.surface")), lineOf(all.tip, factor, colour, "")], legend: "above" },
      { title: "", x, y: axis(t("states.axes.force"), ofForce, range(all.force, newton)), layers: [{ kind: "rule", at: 0, upright: false, dash: "dashed", width: 0.3, colour: "#5a5a5a", label: "" }, lineOf(all.force, newton, colour, "")], legend: "hidden" },
    ],
  });
  $("scope").scope = { periods, factor, newton, film: one };
}

/** Moves the cursor of the oscilloscope with the films. */
function clock(time) {
  const { scope: of } = $("scope");
  if (!of || !$("scope").figure) return;
  const here = film.instant(of.film, time);
  figure.present($("scope"), { x: time % of.periods, heights: [here.tip * of.factor, here.force * of.newton] });
}

/** The numbers of the chosen state at the bottom of a phone. */
function dock() {
  const row = chosenRow();
  const box = $("dock").querySelector(".values");
  const cells = row ? [["distance", COLUMNS.distance(row)], ["phase", COLUMNS.phase(row)], ["force", COLUMNS.force(row)]] : [];
  box.replaceChildren(...cells.map(([head, words]) => {
    const one = document.createElement("span");
    one.append(make("small", { textContent: t(`states.heads.${head}`) }), make("b", { textContent: local(words) }));
    return one;
  }));
}
