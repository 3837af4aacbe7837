// The curve of a lever: its orbits against the distance, as the program sends them. What is read off it here
// is shown as approximate until the program has closed the orbit.

import { t } from "./words.js";
import { axis, scale } from "./axis.js";

/** Places of the numbers of a point; 4 and 5 are indentation and energy. */
export const Z = 0;
export const A = 1;
export const PHASE = 2;
export const FORCE = 3;
export const MEAN = 6;

const mix = (a, b, share) => a.map((x, k) => x + share * (b[k] - x));

/** The orbits at a setpoint (`column` A) or a distance (`column` Z) with this value, on every branch. */
export function crossings(curve, column, value) {
  const found = [];
  (curve?.branches ?? []).forEach(({ period, points }, branch) => {
    for (let k = 1; k < points.length; k += 1) {
      const [a, b] = [points[k - 1], points[k]];
      const [from, to] = [a.at[column], b.at[column]];
      if (from === to || (from - value) * (to - value) > 0 || (k > 1 && from === value)) continue;
      const share = (value - from) / (to - from);
      const nearer = share < 0.5 ? a : b;
      found.push({ branch, index: k, period, stable: nearer.stable, at: mix(a.at, b.at, share), state: mix(a.state, b.state, share), unit: curve.unit });
    }
  });
  return found;
}

/** The numbers of the lever at the first place at which it has the value on its way, or at the distance. */
function met(leg, column, value, first) {
  for (let k = 1; k < leg.length; k += 1) {
    const [a, b] = [leg[k - 1], leg[k]];
    const passes = first ? (a[column] - value) * (b[column] - value) <= 0 && a[column] !== b[column] : false;
    if (passes) return mix(a, b, (value - a[column]) / (b[column] - a[column]));
  }
  return null;
}

/** Where a lever is that comes from afar, and one that was pressed and is drawn back. */
export function reached(curve, column, value) {
  if (!curve) return {};
  return { afar: met(curve.approach, column, value, true), back: met(curve.retract, column, value, true) };
}

/** Whether the numbers of a leg are those of an orbit, as far as their spacing tells. */
export function same(numbers, at, curve) {
  if (!numbers) return false;
  const spacing = curve.approach.length > 1 ? Math.abs(curve.approach[0][Z] - curve.approach[1][Z]) : 0;
  return Math.abs(numbers[Z] - at[Z]) <= spacing && Math.abs(numbers[A] - at[A]) <= 2 * spacing && Math.abs(numbers[PHASE] - at[PHASE]) < 6;
}

const CLOSE = 0.02;           // relative difference of points of two branches that are one stretch

/** The pieces of all branches on which every orbit is stable. */
function pieces(curve) {
  if (curve.pieces) return curve.pieces;
  const made = [];
  curve.branches.forEach(({ period, points, bifurcations }, branch) => {
    for (let from = 0; from < points.length;) {
      let to = from;
      while (to + 1 < points.length && points[to + 1].stable === points[from].stable) to += 1;
      if (points[from].stable) {
        const at = points.slice(from, to + 1).map((point) => point.at);
        // A bifurcation that ends the piece is located between two points.
        for (const [last, beyond, push] of [[from, from - 1, "unshift"], [to, to + 1, "push"]]) {
          if (!points[beyond]) continue;
          const [low, high] = [points[last].at[Z], points[beyond].at[Z]].sort((a, b) => a - b);
          const slack = high - low;
          const end = bifurcations.find((one) => one.kind !== "grazing" && one.at[Z] >= low - slack && one.at[Z] <= high + slack);
          if (end) at[push](end.at);
        }
        made.push({ branch, from, to, period, at, ends: [Boolean(points[from - 1]), Boolean(points[to + 1])] });
      }
      from = to + 1;
    }
  });
  return (curve.pieces = made);
}

const near = (a, b) => Math.abs(a[Z] - b[Z]) <= CLOSE * Math.abs(a[A]) && Math.abs(a[A] - b[A]) <= CLOSE * Math.abs(a[A]) && Math.abs(a[PHASE] - b[PHASE]) < 4;

/** The range of a column along the stable orbits around a place of a branch, also where another branch
 *  follows the same orbits further. */
export function stretch(curve, { branch, index }, column) {
  if (!curve?.branches?.[branch]) return null;
  const all = pieces(curve);
  const first = all.find((piece) => piece.branch === branch && index >= piece.from && index - 1 <= piece.to);
  if (!first) return null;
  const mine = new Set([first]);
  // Pieces that meet at an end, or of which one ends within the other.
  for (let grown = true; grown;) {
    grown = false;
    for (const piece of all) {
      if (mine.has(piece) || piece.period !== first.period) continue;
      const meets = [...mine].some((one) => [one.at[0], one.at.at(-1)].some((end) => piece.at.some((at) => near(end, at))) || [piece.at[0], piece.at.at(-1)].some((end) => one.at.some((at) => near(end, at))));
      if (meets) { mine.add(piece); grown = true; }
    }
  }
  const values = [...mine].flatMap((piece) => piece.at.map((at) => at[column]));
  return { low: Math.min(...values), high: Math.max(...values) };
}

/** Colours of the states in figures. */
export const COLOURS = { attractive: "#0067a3", repulsive: "#b84a00", free: "#565d65", unstable: "#6b7076", irregular: "#a04a8f" };
export const regimeOf = ({ at }) => (at[MEAN] === 0 ? "free" : at[MEAN] < 0 ? "attractive" : "repulsive");

/** The range of the phases that are drawn: half a turn at least. */
function phases(layers) {
  const all = layers.flatMap(({ points }) => points?.y ?? []).filter(Number.isFinite);
  const [low, high] = [Math.min(0, ...all), Math.max(180, ...all)];
  return [low < 0 ? low - 5 : 0, high > 180 ? high + 5 : 180];
}

/** The phase against the distance on every branch, with marks for the rows: a description of the figure.
 *  `distance` draws a line there; `only` names the states whose branches are shown; `direct` writes their
 *  names next to them, in place of a legend. */
export function portrait(curve, rows, { distance = NaN, only = null, direct = false }) {
  const far = Math.max(...curve.approach.map((point) => point[Z]));
  const [factor, unit] = scale(far, curve.unit === 1 ? "" : "m");
  const points = (list) => ({ x: list.map((at) => at[Z] * factor), y: list.map((at) => at[PHASE]) });
  const layers = [];
  const named = new Set();
  const label = (name) => { if (named.has(name)) return ""; named.add(name); return name; };
  for (const { points: all } of curve.branches) {
    for (let from = 0; from < all.length;) {
      let to = from + 1;
      while (to < all.length && all[to].stable === all[from].stable && regimeOf(all[to]) === regimeOf(all[from])) to += 1;
      const piece = all.slice(from, Math.min(all.length, to + 1)).map((point) => point.at);
      const which = all[from].stable ? regimeOf(all[from]) : "unstable";
      if (!only || only.includes(which)) layers.push({ kind: "line", points: points(piece), dash: all[from].stable ? "solid" : "dashed", width: all[from].stable ? 1.1 : 0.7, colour: COLOURS[which], label: label(t(`states.names.${which}`)) });
      from = to;
    }
  }
  if (!curve.branches.length && !only) for (const leg of [curve.approach, curve.retract]) layers.push({ kind: "markers", points: points(leg), shape: "circle", size: 1, colour: COLOURS.unstable, label: "" });
  for (const row of rows) if (row.phase.value !== null) layers.push({ kind: "markers", points: { x: [row.distance.value * factor], y: [row.phase.value] }, shape: "circle", size: row.chosen ? 2.6 : 1.8, open: !row.stable, edge: true, colour: COLOURS[row.stable ? row.regime : "unstable"], label: "" });
  if (Number.isFinite(distance)) layers.push({ kind: "rule", at: distance * factor, upright: true, dash: "dashed", width: 0.4, colour: "#5a5a5a", label: "" });
  if (direct) {
    const lengthOf = ({ points: { x } }) => Math.max(...x) - Math.min(...x);
    for (const which of ["attractive", "repulsive", "unstable", "free"]) {
      const longest = layers.filter(({ kind, colour }) => kind === "line" && colour === COLOURS[which]).sort((a, b) => lengthOf(b) - lengthOf(a))[0];
      if (!longest || lengthOf(longest) < 0.1 * far * factor) continue;
      const { x, y } = longest.points;
      const middle = x.map((_, k) => k).sort((a, b) => Math.abs(x[a] - 0.5 * far * factor) - Math.abs(x[b] - 0.5 * far * factor))[0];
      layers.push({ kind: "note", at: { data: [x[middle], y[middle] + (which === "unstable" ? -5 : 5)] }, text: t(`states.names.${which}`), side: which === "unstable" ? "below" : "above", colour: COLOURS[which] });
    }
  }
  return {
    rows: 1, cols: 1, column_widths: [], row_heights: [], share_x: false,
    panels: [{ title: "", x: axis(t("states.axes.distance"), unit, [0, far * factor]), y: axis(t("states.axes.phase"), "°", phases(layers)), layers, legend: direct ? "hidden" : "above" }],
  };
}
