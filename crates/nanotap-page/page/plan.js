// The view Plan: wishes in a sentence, and the free amplitude and setpoint that meet them. The numbers, the map
// and the line for the notebook are the program's.

import { caseText, put, state, remember, theCase } from "./state.js";
import { stop, stream, superseded } from "./api.js";
import { local, t } from "./words.js";
import { choose as fromCatalogue } from "./set.js";
import { make } from "./element.js";
import { inField, inSi, parts, pointed } from "./entry.js";
import * as figure from "./figure.js";

const USUAL = { force: "1.6", want: "one", points: "256", step: "10" };
const WANTS = ["one", "any", "tap", "away"];
const POINTS = ["128", "256", "512", "1024"];
const NONE = "\n";            // the choice of no lever
const REST = 500;             // milliseconds after a change before the map is computed anew
const LEVER = "cantilever.lever";
// Columns of the table of levers that are shown, by their names.
const SHOWN = ["lever", "k", "f0", "tip_radius", "F_max", "regime", "states", "line_time", "holds"];
const SAMPLE = "sample.material";
let onChange = () => {};
let refused = () => {};
let open = () => {};
let active = false;
let keys = [];
let fields = {};
let parties = {};             // the elements of the answer
let made = "";
let answer = null;            // the newest stage, with its case and wishes
let running = "";             // the case and wishes that are computed
let picked = -1;              // a point chosen on the map, in place of the best one
let progress = "";
let complete = false;
let levers = null;            // the table of levers, with its case and wishes, and the progress
let timer = 0;

const root = () => document.getElementById("view-plan");
const key = (name) => keys.find((one) => one.name === name);
const wish = (name) => state.plan[name] ?? USUAL[name];
const want = () => (WANTS.includes(wish("want")) ? wish("want") : USUAL.want);
/** A length or a force with its unit; the text is NaN if it is none. */
const withUnit = (text, unit) => { const read = parts(text); return read && inSi(text, unit.slice(1)) >= 0 ? `${read.number} ${read.unit || unit}` : null; };
const own = () => JSON.stringify([caseText(), wish("force"), want(), wish("points"), wish("step")]);

/** `changed(key, finished, words)` is called for a changed case, `error(refusal)` for a refused one, `show()` to
 *  open the states. */
export function begin(changed, error, show) {
  onChange = changed;
  refused = error;
  open = show;
}

export function enter() {
  active = true;
  if (made !== document.documentElement.lang) build();
  fill();
  draw();
  if (answer?.of !== own() || !complete) compute();
}

export function leave() {
  active = false;
  clearTimeout(timer);
  stop("plan");
  stop("plan-levers");
  running = "";
}

/** The case changed. */
export function changed(finished) {
  if (!active) return;
  picked = -1;
  draw();
  if (finished) later();
}

/** Takes the keys of the case. */
export function show(next) {
  keys = next;
  if (!active) return;
  choices(LEVER, fields.lever, [[t("plan.ownLever", { k: short("cantilever.k"), f0: short("cantilever.f0"), q: short("cantilever.Q") }), ""], [t("plan.noLever"), NONE]]);
  const modulus = ["sample.modulus", "sample.stiffness"].find((name) => key(name)?.value);
  choices(SAMPLE, fields.sample, [[modulus ? t("plan.ownModulus", { modulus: short(modulus) }) : t("plan.ownSample"), ""]]);
  if (levers?.wanted) fields.lever.value = NONE;
}

/** A value of the case with four digits at most. */
function short(name) {
  const text = key(name)?.value ?? "";
  const read = parts(text);
  return read ? `${Number(read.number.toPrecision(4))} ${read.unit}`.trim() : text;
}

/** Fills a list with what the catalogue has. */
function choices(name, list, first) {
  const known = key(name)?.choices ?? [];
  list.replaceChildren(...first.map(([words, value]) => new Option(words, value)), ...known.map(({ word, meaning }) => new Option(meaning ? local(`${word}: ${meaning}`) : word, word)));
  list.value = key(name)?.value ?? "";
}

/** A sentence of the wishes with fields in its blanks. */
function sentence(path, blanks) {
  const words = t(path).split(/\{(\w+)\}/);
  return make("span", {}, ...words.map((text, k) => (k % 2 ? blanks[text] : text)));
}

function build() {
  made = document.documentElement.lang;
  const list = (name, options) => make("select", { id: `plan-${name}` }, ...options);
  const typed = (name) => make("input", { id: `plan-${name}`, type: "text", inputMode: "decimal" });
  fields = {
    lever: list("lever", []), sample: list("sample", []), force: typed("force"),
    want: list("want", WANTS.map((one) => new Option(t("plan.wants")[one], one))),
    points: list("points", POINTS.map((one) => new Option(one, one))), step: typed("step"),
  };
  for (const [name, field] of Object.entries(fields)) field.setAttribute("aria-label", t("plan.labels")[name]);
  for (const name of ["force", "want", "points", "step"]) {
    fields[name].addEventListener("change", () => {
      state.plan[name] = pointed(fields[name].value.trim());
      if (state.plan[name] === USUAL[name]) delete state.plan[name];
      remember(true);
      picked = -1;
      draw();
      later();
    });
  }
  fields.lever.addEventListener("change", () => { if (fields.lever.value === NONE) look(true); else choose(LEVER, fields.lever.value); });
  fields.sample.addEventListener("change", () => choose(SAMPLE, fields.sample.value));
  const wrong = make("p", { className: "asks small", id: "plan-wrong" });
  wrong.setAttribute("role", "alert");
  const button = (id, words, pressed) => { const one = make("button", { type: "button", id, textContent: words }); one.addEventListener("click", pressed); return one; };
  parties = {
    wrong,
    head: make("h2", { id: "plan-head" }), say: make("p", { id: "plan-say", className: "big" }), far: make("p", { id: "plan-far", className: "small" }),
    others: make("table", { id: "plan-others", className: "picks" }), line: make("p", { id: "plan-line", className: "line" }),
    copy: button("plan-copy", t("plan.copy"), copy), show: button("plan-show", t("plan.show"), take),
    notebook: make("div", {}), which: button("plan-which", t("plan.whichLever"), () => look(false)),
    map: make("figure", { id: "plan-map", className: "paper", tabIndex: 0 }), mapWords: make("p", { className: "small" }),
    levers: make("section", { id: "plan-levers", className: "card", hidden: true }),
  };
  parties.say.setAttribute("role", "status");
  parties.show.className = "primary";
  parties.notebook.append(make("div", { className: "row head" }, make("h3", { textContent: t("plan.notebook") }), parties.copy, parties.show), parties.line);
  const said = make("div", {}, parties.head, parties.say, parties.far, parties.which, parties.notebook, make("div", { className: "wide" }, parties.others));
  const seen = make("div", {}, make("h3", { textContent: t("plan.window") }), parties.map, parties.mapWords);
  root().replaceChildren(
    make("section", { className: "card" }, make("h2", { textContent: t("plan.heading") }),
      make("p", { className: "plan" }, sentence("plan.lever", fields), " ", sentence("plan.wish", fields), " ", sentence("plan.line", fields)), wrong),
    parties.levers, make("section", { className: "card pp" }, said, seen));
  figure.alive(parties.map, { views: () => state.views.plan ?? [], tell: (place) => { parties.mapWords.textContent = place ? figure.words(place) : t("plan.windowWords"); }, go, zoom: (views) => { state.views.plan = views; remember(true); } });
  parties.map.setAttribute("aria-label", t("plan.window"));
  if (answer?.figure) figure.put(parties.map, answer.figure);
  if (keys.length) show(keys);
}

function fill() {
  for (const name of ["force", "points", "step"]) fields[name].value = inField(wish(name));
  fields.want.value = want();
}

function later() {
  clearTimeout(timer);
  if (running && running !== own()) { stop("plan"); running = ""; }
  timer = setTimeout(() => { if (active && answer?.of !== own() && running !== own()) compute(); }, REST);
}

/** The wishes as the program reads them, or null with the reason below the sentence. */
function wishes() {
  const [force, step] = [withUnit(wish("force"), "nN"), withUnit(wish("step"), "nm")];
  fields.force.setAttribute("aria-invalid", String(!force));
  fields.step.setAttribute("aria-invalid", String(!step));
  parties.wrong.textContent = !force ? t("plan.forceWrong") : !step ? t("plan.stepWrong") : "";
  return force && step ? { force, want: want(), points: wish("points"), step } : null;
}

async function compute() {
  const options = wishes();
  if (!options) return;
  const of = own();
  running = of;
  complete = false;
  progress = "";
  root().dataset.plan = "busy";
  draw();
  try {
    await stream("plan", "/api/study", { case: theCase(), tab: "wishes", options }, (message) => {
      if (own() !== of) return;
      if (message.progress) { progress = message.progress; far(); return; }
      progress = "";
      const { plan } = message.clicks;
      // A point that was chosen on a coarser map stays chosen.
      const before = answer?.of === of && picked >= 0 ? answer.plan.points[picked].at : null;
      picked = before ? plan.points.findIndex(({ at }) => at.every((value, k) => Math.abs(value / before[k] - 1) < 1e-9)) : -1;
      answer = { of, plan, figure: message.figure, limit: options.force };
      figure.put(parties.map, message.figure);
      draw();
    });
    if (running !== of) return;
    complete = true;
    running = "";
    root().dataset.plan = "done";
    draw();
    if (!answer.plan.best.length && levers?.of !== of) look(false);
  } catch (error) {
    if (superseded(error) || running !== of) return;
    running = "";
    root().dataset.plan = "refused";
    answer = null;
    draw();
    parties.say.textContent = local(error.message);
    refused(error);
  }
}

/** The point that is shown. */
const point = () => (answer ? answer.plan.points[picked >= 0 ? picked : answer.plan.best[0]] : undefined);

function draw() {
  if (!made) return;
  const former = answer !== null && answer.of !== own();
  for (const one of [parties.head, parties.say]) one.classList.toggle("former", former);
  for (const one of [parties.map, parties.others, parties.line]) one.classList.toggle("stale", former);
  const here = point();
  parties.notebook.hidden = !here?.line;
  parties.copy.disabled = parties.show.disabled = former;
  parties.which.hidden = !answer || former || answer.plan.best.length > 0 || !complete || levers?.of === own();
  parties.others.hidden = !answer?.plan.best.length;
  far();
  drawLevers();
  if (!parties.mapWords.textContent) parties.mapWords.textContent = t("plan.windowWords");
  parties.map.hidden = !answer;
  if (!answer) { parties.head.textContent = t("plan.looking"); parties.say.textContent = ""; return; }
  if (here?.line) {
    parties.head.textContent = t("plan.found", here.shown);
    parties.say.textContent = said(here);
    parties.line.textContent = here.line;
  } else none();
  others();
}

/** A point in words. */
function said({ states, regime, touches, force, distance, lines, gentle, kind }) {
  const values = { force: force.shown, limit: answer.limit, allowed: t(gentle ? "plan.below" : "plan.above", { limit: answer.limit }) };
  const press = t(`plan.press.${touches || force.value > 0 ? "with" : "not"}${states > 1 ? "All" : ""}`, values);
  const there = t("plan.regime", { regime: t("states.names")[regime]?.toLowerCase() ?? regime });
  const count = t("plan.counts")[states] ?? states;
  const first = t(states > 1 ? "plan.several" : "plan.one", { distance: distance.shown, there, count, press });
  const rate = t("plan.lines", { rate: lines.rate, limit: t(`plan.limits.${lines.limit}`, lines) });
  return [gentle && kind ? "" : `${t("plan.chosen")} `, first, rate, lines.limit === "gain" && !lines.stated ? ` ${t("plan.usualGain")}` : ""].join("");
}

/** Which wish fails, and what is nearest. */
function none() {
  const { fails, points } = answer.plan;
  const values = { limit: answer.limit, want: t("plan.wants")[JSON.parse(answer.of)[2]] };
  const at = (k) => ({ ...values, ...points[k].shown, force: points[k].force?.shown ?? "", states: t("plan.statesOf")[points[k].states] ?? points[k].states });
  parties.head.textContent = t(complete ? "plan.none" : "plan.noneSoFar");
  parties.say.textContent = [
    t(`plan.fails.${fails.wish}`, values),
    fails.gentlest !== null && t("plan.gentlest", at(fails.gentlest)),
    fails.gentle !== null && t("plan.gentle", at(fails.gentle)),
  ].filter(Boolean).join(" ");
}

/** How much of the map is known. */
function far() {
  const { plan } = answer ?? {};
  parties.far.textContent = !plan ? local(progress) : answer.of !== own() ? t("plan.former") : complete ? t("plan.complete", plan) : t("plan.soFar", { ...plan, progress });
}

/** The other points that meet the wishes. */
function others() {
  const { points, best } = answer.plan;
  const here = point();
  const offers = best.filter((k) => points[k] !== here);
  parties.others.hidden = !offers.length;
  const heads = Object.values(t("plan.heads")).map((words) => make("th", { scope: "col", textContent: words }));
  parties.others.replaceChildren(make("caption", { className: "small", textContent: t("plan.others") }), make("thead", {}, make("tr", {}, ...heads)), make("tbody", {}, ...offers.map((k) => {
    const { shown, states, regime, force, lines } = points[k];
    const first = make("button", { type: "button", textContent: local(shown.free) });
    const cells = [shown.setpoint, `${t("plan.counts")[states] ?? states}, ${t("states.names")[regime]?.toLowerCase() ?? regime}`, force.value > 0 ? force.shown : "0", lines.rate];
    const row = make("tr", {}, make("td", {}, first), ...cells.map((words) => make("td", { textContent: local(words) })));
    row.addEventListener("click", () => { picked = k; draw(); });
    return row;
  })));
}

/** A tile that was clicked: the nearest point that is known. */
function go(place) {
  if (!answer || answer.of !== own()) return;
  const places = answer.plan.points.map((one) => one.place);
  const [wide, high] = [0, 1].map((axis) => { const all = places.map((one) => one[axis]); return Math.max(...all) - Math.min(...all); });
  const off = ({ place: [x, y] }) => Math.hypot((place.x - x) / wide, (place.y - y) / high);
  const known = answer.plan.points.map((one, k) => ({ k, off: one.line ? off(one) : Infinity }));
  const nearest = known.reduce((least, one) => (one.off < least.off ? one : least));
  if (Number.isFinite(nearest.off)) { picked = nearest.k; draw(); }
}

async function copy() {
  const done = await navigator.clipboard?.writeText(parties.line.textContent).then(() => true, () => false);
  parties.copy.textContent = t(done ? "plan.copied" : "plan.notCopied");
  if (!done) getSelection()?.selectAllChildren(parties.line);
  setTimeout(() => { parties.copy.textContent = t("plan.copy"); }, 2000);
}

/** Takes the values of the shown point and opens the states. */
function take() {
  const here = point();
  if (!here?.line) return;
  for (const [name, text] of [["drive.free_amplitude", here.free], ["drive.setpoint", here.setpoint]]) put(name, text, key(name)?.alternatives ?? []);
  open();
}

/** Takes a lever or a material of the catalogue. */
async function choose(name, value) {
  if (await fromCatalogue(name, value)) { if (levers) levers.wanted = false; draw(); } else show(keys);
}

/** Compares the levers of the catalogue; `wanted` if the user has none yet. */
async function look(wanted) {
  const options = wishes();
  if (!options) return;
  const setpoint = key("drive.setpoint");
  const of = own();
  levers = { of, wanted, progress: "", table: null };
  draw();
  const body = { case: theCase(), tab: "levers", options: { force: options.force, want: options.want, setpoint: setpoint?.stated ? setpoint.value : "0.8", tip: "of the lever" } };
  try {
    await stream("plan-levers", "/api/study", body, (message) => {
      if (levers?.of !== of) return;
      if (message.progress) levers.progress = message.progress;
      else Object.assign(levers, { table: message.tables[0], words: message.words });
      drawLevers();
    });
  } catch (error) { if (!superseded(error)) { levers = null; refused(error); draw(); } }
}

function drawLevers() {
  const shown = levers !== null && (levers.wanted || levers.of === own());
  parties.levers.hidden = !shown;
  if (!shown) return;
  parties.levers.classList.toggle("stale", levers.of !== own());
  const parts = [make("h2", { textContent: t("plan.levers") })];
  if (!levers.table) parts.push(make("p", { className: "small", textContent: t("plan.leversLooking", { progress: levers.progress }) }));
  else {
    const { names, heads, rows } = levers.table;
    const [first] = rows;
    const at = (name) => names.indexOf(name);
    // The best lever comes first.
    const [fits, force] = [first?.cells[at("holds")] === "yes", first?.cells[at("F_max")]];
    const words = fits ? t(force.startsWith("0 ") ? "plan.leverTouchesNot" : "plan.leverDoes", { lever: first.cells[at("lever")], force }) : t("plan.leverNone");
    parts.push(make("p", { id: "plan-lever-words", textContent: `${words} ${t("plan.leversTake")}` }), make("p", { className: "small", textContent: local(levers.words.split(". ")[0]) }));
    const titles = Object.values(t("plan.leverHeads"));
    const columns = SHOWN.map(at).filter((column) => column >= 0);
    parts.push(make("div", { className: "wide" }, make("table", { className: "picks" },
      make("thead", {}, make("tr", {}, ...columns.map((column, k) => make("th", { scope: "col", textContent: titles[k] ?? heads[column][0], title: heads[column][1] })))),
      make("tbody", {}, ...rows.map(({ cells }) => {
        const row = make("tr", {}, ...columns.map((column, k) => make("td", {}, k ? local(cells[column]) : make("button", { type: "button", textContent: cells[column] }))));
        row.addEventListener("click", () => choose(LEVER, cells[at("lever")]));
        return row;
      })))));
  }
  parties.levers.replaceChildren(...parts);
}
