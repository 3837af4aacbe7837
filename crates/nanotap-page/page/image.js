// The states of a measured image: which state has which part of it, the steps of the height that are the lever's,
// and the files with the result. The map is the study's own figure.

import { save } from "./api.js";
import { local, t } from "./words.js";
import { make } from "./element.js";

const DECADES = 3;            // digits of a share

/** The name of a state: the program numbers those of one kind, as in "repulsive 2". */
function name(of) {
  const [, word, more] = /^(\S+)(.*)$/.exec(of) ?? ["", of, ""];
  return `${t("data.image.states")[word] ?? word}${more}`;
}

const percent = (share) => `${Number((100 * share).toPrecision(DECADES))} %`;

/** The figure in the words of the page. */
export function inWords(figure) {
  const words = Object.entries(t("data.image.figure"));
  const said = (label) => words.reduce((text, [program, page]) => (text.startsWith(program) ? page + text.slice(program.length) : text), label ?? "");
  const layer = (one) => ({ ...one, ...(one.label ? { label: said(one.label) } : {}), ...(one.scale ? { scale: { ...one.scale, label: said(one.scale.label) } } : {}), ...(one.categories ? { categories: one.categories.map((category) => ({ ...category, label: categoryOf(category.label) })) } : {}) });
  return { ...figure, panels: figure.panels.map((panel) => ({ ...panel, x: { ...panel.x, label: said(panel.x.label) }, y: { ...panel.y, label: said(panel.y.label) }, layers: panel.layers.map(layer) })) };
}

/** A state with its share, as in "attractive (33 %)". */
function categoryOf(label) {
  const [, of, share] = /^(.*) \((.*)\)$/.exec(label) ?? ["", label, ""];
  return share ? `${name(of)} (${share.startsWith("below") ? t("data.image.below") : share})` : name(label);
}

/** The answer in one sentence. */
export function sentence({ decided, states, undecided, reference, steps, step_count: count }) {
  if (!decided) return t("data.image.undecided");
  const shares = states.filter(({ share }) => share > 0).sort((a, b) => b.share - a.share).map((state) => t("data.image.share", { share: percent(state.share), name: name(state.name) }));
  if (undecided > 0) shares.push(t("data.image.share", { share: percent(undecided), name: name("undecided") }));
  const largest = [...steps].sort((a, b) => Math.abs(b.height.value) - Math.abs(a.height.value))[0];
  const change = !count ? t("data.image.noStep") : t(count === 1 ? "data.image.oneStep" : "data.image.manySteps", { count, height: (largest?.height.shown ?? "").replace(/^[-−]/, "") });
  return [t("data.image.decided", { shares: shares.join(", ") }), change, reference ? t("data.image.reference", { name: name(reference) }) : ""].filter(Boolean).join(" ");
}

/** A value, or 0 without its unit. */
const shown = (of) => (!of ? "–" : of.value === 0 ? "0" : of.shown);

function table(caption, heads, rows) {
  const head = make("thead", {}, make("tr", {}, ...heads.map((words) => make("th", { scope: "col", textContent: words }))));
  const body = make("tbody", {}, ...rows.map(([first, ...rest]) => make("tr", {}, make("th", { scope: "row", textContent: local(first) }), ...rest.map((text) => make("td", { textContent: local(text) })))));
  return make("div", { tabIndex: 0, role: "region", ariaLabel: caption }, make("table", {}, make("caption", { textContent: caption }), head, body));
}

/** The tables of states and of steps, what is doubtful, and the files. */
export function details(image) {
  const heads = t("data.image.heads");
  const rows = image.states.map((state) => [name(state.name), percent(state.share), shown(state.phase), shown(state.measured_phase), shown(state.distance), shown(state.height), shown(state.force)]);
  rows.push([name("undecided"), percent(image.undecided), "–", "–", "–", "–", "–"]);
  const states = table(t("data.image.statesHead"), [heads.state, heads.share, heads.phase, heads.measured, heads.distance, heads.height, heads.force], rows);
  states.id = "image-shares";
  image.states.forEach((state, k) => { states.querySelectorAll("tbody tr")[k].cells[1].dataset.value = state.share; });
  states.querySelector("tbody").lastChild.cells[1].dataset.value = image.undecided;
  const parts = [states];
  if (image.steps.length) {
    const more = image.step_count > image.steps.length ? t("data.image.stepsFirst", { shown: image.steps.length, count: image.step_count }) : t("data.image.stepsHead");
    const steps = image.steps.map((step) => [String(step.line), step.x?.shown ?? String(step.pixel), `${name(step.from)} → ${name(step.to)}`, shown(step.height), shown(step.measured)]);
    const box = table(more, [heads.line, image.steps[0].x ? heads.x : heads.pixel, heads.change, heads.height, heads.step], steps);
    box.id = "image-steps";
    image.steps.forEach((step, k) => { box.querySelectorAll("tbody tr")[k].cells[3].dataset.value = step.height.value; });
    parts.push(box);
  }
  const doubts = [image.reason, ...image.warnings].filter(Boolean);
  if (doubts.length) parts.push(make("p", { className: "small", id: "image-doubts", textContent: local(doubts.join(". ")) }));
  const buttons = image.files.map((file) => {
    const button = make("button", { type: "button", textContent: t(`data.image.files.${file.kind}`) });
    button.addEventListener("click", () => save(new Blob([file.text ?? Uint8Array.from(atob(file.base64), (letter) => letter.charCodeAt(0))]), file.name));
    return button;
  });
  if (buttons.length) parts.push(make("p", { className: "row", id: "image-files" }, ...buttons));
  return parts;
}
