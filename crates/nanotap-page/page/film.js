// The tip of a state over the sample in slow motion: its whole swing, and the lowest part magnified. All rows
// have one scale and one clock, so that states are compared by eye.

import { inView } from "./element.js";

const still = matchMedia("(prefers-reduced-motion: reduce)");
const SPEED = 0.45;           // drive periods per second
const NEAR = 0.1;             // height of the magnified part over the free amplitude
let moving = !still.matches;
let time = 0.18;              // in drive periods
let before = 0;
let shown = [];               // pairs of a canvas and a row
let after = () => {};
let scale = [0, 0];           // the lowest and highest place of all rows that have one scale

export const moves = () => moving;
export const now = () => time;
export function hold(is) { moving = !is; if (!moving) draw(); }

let palette = null;
matchMedia("(prefers-color-scheme: dark)").addEventListener("change", () => { palette = null; });
const colour = (name) => (palette ??= getComputedStyle(document.documentElement)).getPropertyValue(name).trim();

/** The colour of a state. */
export const colourOf = (row) => colour(!row.stable ? "--unstable" : row.regime === "repulsive" ? "--repulsive" : row.regime === "attractive" ? "--attractive" : "--soft");

/** Shows these films; `each(time)` is called for every picture. They have the scale of the rows of `as`. */
export function show(pairs, each = () => {}, as = pairs.map(([, row]) => row)) {
  shown = pairs;
  after = each;
  const films = as.map(({ film }) => film).filter(Boolean);
  scale = [Math.min(0, ...films.flatMap(({ surface, tip }) => [...surface, ...tip])), Math.max(...films.flatMap(({ tip }) => tip))];
  draw();
}

/** Draws anew, in the colours of the present scheme. */
export function renew() { palette = null; draw(); }

const at = (list, share) => {
  const place = share * (list.length - 1);
  const k = Math.min(list.length - 2, Math.floor(place));
  return list[k] + (place - k) * (list[k + 1] - list[k]);
};

/** A film at a time in drive periods: heights of tip and surface, and the force. */
export function instant(film, periods) {
  const share = ((periods % film.periods) + film.periods) % film.periods / film.periods;
  return { share, tip: at(film.tip, share), surface: at(film.surface, share), force: at(film.force, share) };
}

/** Draws the films: all, or those on the screen. */
function draw(all = true) {
  for (const [canvas, row] of shown) if (row.film && canvas.isConnected && (all || inView(canvas))) paint(canvas, row, ...scale);
  after(time);
}

function paint(canvas, row, lowest, highest) {
  const ratio = devicePixelRatio || 1;
  const [wide, high] = [canvas.clientWidth, canvas.clientHeight];
  if (!wide || !high) return;
  const [w, h] = [Math.round(wide * ratio), Math.round(high * ratio)];
  if (canvas.width !== w || canvas.height !== h) Object.assign(canvas, { width: w, height: h });
  const pen = canvas.getContext("2d");
  pen.setTransform(ratio, 0, 0, ratio, 0, 0);
  pen.clearRect(0, 0, wide, high);
  const { film } = row;
  const here = instant(film, time);
  const least = Math.min(...film.tip);
  const ink = colourOf(row);
  // Left: the lever swings to scale, its length is not.
  const split = 0.6 * wide;
  const rest = film.tip.reduce((sum, v) => sum + v, 0) / film.tip.length;
  const range = highest - lowest || 1;
  const y = (v) => 0.22 * high + (highest - v) / range * 0.6 * high;
  ground(pen, 0.55 * split, split, high, y(0), y(here.surface), 0.86 * split);
  pen.strokeStyle = ink; pen.lineWidth = Math.max(2.5, high / 50); pen.lineCap = "round";
  pen.beginPath();
  const [left, tipX] = [0.06 * wide, 0.86 * split];
  for (let k = 0; k <= 20; k += 1) {
    const u = k / 20;
    // The first mode's shape, nearly.
    const bend = u * u * (3 - u) / 2;
    pen.lineTo(left + u * (tipX - left), y(rest + bend * (here.tip - rest)) - 0.14 * high);
  }
  pen.stroke();
  pen.fillStyle = colour("--soft");
  pen.fillRect(left - 3, y(rest) - 0.14 * high - 7, 3, 14);
  tip(pen, tipX, y(here.tip), 0.14 * high, ink);
  // Right: the lowest part, with the lowest point dotted.
  const reach = NEAR * range;
  const floor = Math.min(lowest, 0) - 0.25 * reach;
  const span = Math.max(1.5 * reach, 0.6 * reach - floor);
  const zoom = (v) => high - (v - floor) / span * high;
  const middle = (split + wide) / 2;
  pen.save();
  pen.beginPath(); pen.rect(split + 3, 0, wide - split - 3, high); pen.clip();
  ground(pen, split + 3, wide, high, zoom(0), zoom(here.surface), middle);
  pen.strokeStyle = ink; pen.lineWidth = 1.2; pen.setLineDash([2, 3]);
  pen.beginPath(); pen.moveTo(split + 3, zoom(least)); pen.lineTo(wide, zoom(least)); pen.stroke();
  pen.setLineDash([]);
  tip(pen, middle, zoom(here.tip), high, ink);
  pen.restore();
  pen.strokeStyle = colour("--line"); pen.lineWidth = 1;
  pen.strokeRect(split + 2.5, 0.5, wide - split - 3, high - 1);
}

function ground(pen, from, to, high, flat, dent, under) {
  pen.fillStyle = colour("--sample");
  pen.beginPath(); pen.moveTo(from, high); pen.lineTo(from, flat);
  for (let x = from; x <= to; x += 2) pen.lineTo(x, flat + (dent - flat) * Math.exp(-(((x - under) / 9) ** 2)));
  pen.lineTo(to, high); pen.closePath(); pen.fill();
}

function tip(pen, x, y, high, ink) {
  pen.fillStyle = ink;
  pen.beginPath(); pen.moveTo(x - 0.4 * high, y - high); pen.lineTo(x + 0.4 * high, y - high); pen.lineTo(x, y); pen.closePath(); pen.fill();
}

function step(stamp) {
  if (moving && shown.length && !document.hidden) { time += SPEED * Math.min(0.1, (stamp - before) / 1000); draw(false); }
  before = stamp;
  requestAnimationFrame(step);
}
requestAnimationFrame(step);
