// The lessons of the lecture, as data. A step asks, then shows: `set` are the values while it is asked, `to`
// those that change when it is shown (an empty text removes a value), `pick` the state whose lever is shown,
// `only` the states whose branches are drawn. Its words are in words.js, or in the lesson itself if a lecturer
// wrote it, and contain no numbers of the lever: `{phase}` is filled from the rows of the program.
//
// Besides keys of the case, `set` and `to` take `steps` (fixed time steps per period) and `study.NAME` (a field
// of the study's form). A figure is "states", "motion", "settle", or the tab of a study; `asked` names the
// curves of a study that are drawn before the answer is known, `panels` those of its panels that are drawn.

import { local, t } from "./words.js";

const AIR = { "cantilever.k": "0.874 N/m", "cantilever.f0": "100 kHz", "drive.frequency": "100 kHz", "cantilever.Q": "200", "gap.tip": "100 nm" };
const SOFT = { "cantilever.k": "0.1 N/m", "cantilever.f0": "10 kHz", "drive.frequency": "10 kHz" };
const PATCH = { figure: "image", preset: "patch", set: { "drive.setpoint": "0.9" } };
const EDGE = { "study.surface": "step", "study.height": "10 nm", "study.size": "500 nm" };

export const LESSONS = {
  states: {
    preset: "dmt", figure: "states", set: { "drive.setpoint": "0.995", "drive.free_amplitude": "20 nm" }, knobs: ["drive.setpoint", "drive.free_amplitude"],
    steps: [
      { to: { "drive.setpoint": "0.8" }, only: [["attractive"], ["attractive", "repulsive", "unstable"]], pick: ["attractive", "attractive"], right: 1 },
      { set: { "drive.setpoint": "0.8" }, pick: ["attractive", "attractive"], right: 0 },
      { set: { "drive.setpoint": "0.8" }, pick: ["attractive", "repulsive"], right: 1 },
      { set: { "drive.setpoint": "0.8" }, to: { "drive.free_amplitude": "30 nm" }, pick: ["attractive", "repulsive"], right: 2 },
    ],
  },
  phase: {
    preset: "dmt", figure: "states", set: { "drive.setpoint": "0.995" }, knobs: ["drive.setpoint"],
    steps: [
      { set: { "drive.setpoint": "", "gap.tip": "24 nm" }, only: [[], ["attractive"]], pick: ["attractive", "attractive"], knobs: ["gap.tip"], right: 1 },
      { to: { "drive.setpoint": "0.8" }, only: [[], ["attractive"]], pick: ["attractive", "attractive"], right: 2 },
      { set: { "drive.setpoint": "0.8" }, only: [["attractive"], ["attractive", "repulsive"]], pick: ["attractive", "repulsive"], right: 0 },
      { set: { "drive.setpoint": "0.8" }, to: { "drive.setpoint": "0.6" }, only: [["attractive", "repulsive"], ["attractive", "repulsive"]], pick: ["repulsive", "repulsive"], right: 1 },
    ],
  },
  image: {
    ...PATCH, knobs: ["study.rate", "study.gain"],
    steps: [
      { set: { "study.surface": "of the case", "study.rate": "32.5 Hz", "study.gain": "600" }, panels: [0], asked: ["surface"], right: 1 },
      { figure: "states", pick: ["attractive", "repulsive"], knobs: ["drive.setpoint"], right: 0 },
      { set: { ...EDGE, "study.rate": "32.5 Hz", "study.gain": "2500" }, panels: [0], asked: ["surface"], right: 2 },
      { set: { ...EDGE, "study.rate": "32.5 Hz", "study.gain": "2500" }, to: { "study.rate": "8 Hz" }, panels: [0], right: 1 },
    ],
  },
  force: {
    preset: "hertz", figure: "states", knobs: ["drive.setpoint", "drive.free_amplitude", "sample.modulus", "cantilever.k"],
    set: { "drive.setpoint": "0.8", "drive.free_amplitude": "15 nm", "sample.modulus": "100 MPa", "cantilever.k": "0.874 N/m" },
    steps: [
      { to: { "drive.setpoint": "0.5" }, right: 0 },
      { to: { "drive.free_amplitude": "30 nm" }, right: 1 },
      { to: { "sample.modulus": "1 GPa" }, right: 1 },
      { to: { "cantilever.k": "40 N/m" }, right: 2 },
    ],
  },
  vacuum: {
    preset: "dmt", figure: "settle", set: AIR, knobs: ["cantilever.Q", "cantilever.f0"],
    steps: [
      { right: 1 },
      { to: { "cantilever.Q": "20000" }, right: 2 },
      { set: { "cantilever.Q": "20000" }, to: SOFT, right: 2 },
      { set: { ...SOFT, "cantilever.Q": "20000" }, right: 1 },
    ],
  },
  doubling: {
    preset: "paper", figure: "motion", set: { omega: "3" }, knobs: ["omega"],
    steps: [
      { to: { omega: "2.8" }, right: 1 },
      { set: { omega: "2.8" }, to: { omega: "2.7" }, right: 1 },
      { set: { omega: "2.7" }, to: { omega: "2.6" }, right: 2 },
      { set: { omega: "2.6", "study.key": "omega", "study.from": "2.5", "study.to": "3" }, figure: "diagram", knobs: [], asked: [], right: 0 },
    ],
  },
  steps: {
    preset: "paper", figure: "motion", set: { omega: "3", steps: "0" }, knobs: ["steps"],
    steps: [
      { to: { steps: "60" }, right: 1 },
      { set: { steps: "60" }, to: { steps: "100" }, right: 2 },
      { set: { steps: "100" }, to: { steps: "120" }, right: 1 },
      { set: { steps: "120" }, to: { steps: "400" }, right: 2 },
    ],
  },
};

export const FIGURES = ["states", "motion", "settle", "image", "diagram", "resonance", "approach", "basin"];
const STATES = ["attractive", "repulsive", "free", "unstable"];
const [MOST_STEPS, MOST_ANSWERS, MOST_LETTERS] = [20, 6, 600];

/** A lesson with the words of the chosen language, and each step with all its values. */
export function lesson(name, own = LESSONS[name]) {
  const words = own.title ? own : t("lessons")[name];
  const steps = own.steps.map((step, k) => {
    const { ask, answers, says } = own.title ? step : words.steps[k];
    const set = { ...own.set, ...step.set };
    return { figure: own.figure, preset: own.preset, text: own.text, knobs: own.knobs ?? [], pick: [], ...step, set, to: { ...set, ...step.to }, ask, answers, says };
  });
  return { name, title: words.title, steps };
}

/** The file of a lesson, as a lecturer can write one. */
export function file(name) {
  const { title, steps } = { ...LESSONS[name], ...t("lessons")[name] };
  const all = LESSONS[name].steps.map((step, k) => ({ ...step, ...steps[k] }));
  return JSON.stringify({ title, ...LESSONS[name], steps: all }, null, 2);
}

const isText = (text, most = MOST_LETTERS) => typeof text === "string" && text.length > 0 && text.length <= most;
const isTexts = (values) => typeof values === "object" && values !== null && !Array.isArray(values) && Object.entries(values).every(([key, value]) => /^[\w.]{1,60}$/.test(key) && typeof value === "string" && value.length <= 200);
const isList = (list, most, each) => Array.isArray(list) && list.length <= most && list.every((one) => each(one));
const optional = (value, check) => value === undefined || check(value);

/** The first part of a lecturer's lesson that is missing or wrong, or nothing. */
export function wrong(own) {
  if (typeof own !== "object" || own === null) return "title";
  const common = (one) => [
    ["figure", optional(one.figure, (figure) => FIGURES.includes(figure))], ["preset", optional(one.preset, isText)], ["text", optional(one.text, (text) => isText(text, 1 << 20))],
    ["set", optional(one.set, isTexts)], ["knobs", optional(one.knobs, (knobs) => isList(knobs, 6, isText))],
  ];
  const step = (one, k) => (typeof one !== "object" || one === null ? [[`steps.${k + 1}`, false]] : [
    ...common(one), ["to", optional(one.to, isTexts)], ["pick", optional(one.pick, (pick) => isList(pick, 2, (name) => STATES.includes(name)))],
    ["only", optional(one.only, (only) => isList(only, 2, (names) => isList(names, 4, (name) => STATES.includes(name))))],
    ["asked", optional(one.asked, (asked) => isList(asked, 20, (label) => typeof label === "string"))], ["panels", optional(one.panels, (panels) => isList(panels, 9, Number.isInteger))],
    ["ask", isText(one.ask)], ["answers", isList(one.answers, MOST_ANSWERS, (words) => isText(words, 200))], ["says", isText(one.says)],
    ["right", Number.isInteger(one.right) && one.right >= 0 && one.right < Math.max(1, one.answers?.length ?? 0)],
    ["figure", FIGURES.includes(one.figure ?? own.figure)], ["preset", isText(one.preset ?? own.preset ?? one.text ?? own.text, 1 << 20)],
  ].map(([part, right]) => [`steps.${k + 1}.${part}`, right]));
  const parts = [["title", isText(own.title, 200)], ...common(own), ["steps", isList(own.steps, MOST_STEPS, () => true) && own.steps.length > 0]];
  const bad = (list) => list.find(([, right]) => !right)?.[0];
  return bad(parts) ?? bad(own.steps.flatMap(step)) ?? "";
}

/** Words with values in place of their placeholders; `none` in place of an unknown value. */
export const filled = (words, values, none = "–") => words.replace(/\{([\w.]+)\}/g, (_, name) => (Object.hasOwn(values, name) ? local(values[name]) : none));
