// The lever in slow motion: the beam's shape from all its modes, the tip, and the indented sample.
// Heights are drawn to scale; the lever's length is not.

import { inView } from "./element.js";
import { t } from "./words.js";

const canvas = document.getElementById("lever");
const pen = canvas.getContext("2d");
const clock = document.getElementById("phase");
const play = document.getElementById("play");
const SPEED = 0.32;           // drive periods per second
let film = null;
let time = 0;                 // in drive periods
let before = 0;
let size = 12;                // of the letters
let moving = !matchMedia("(prefers-reduced-motion: reduce)").matches;
export const frames = { drawn: 0 };
/** Whether the lever moves, or is paused. */
export const moves = () => moving;

play.addEventListener("click", () => { moving = !moving; label(); });
function label() { play.dataset.t = moving ? "states.pause" : "states.play"; play.textContent = t(play.dataset.t); }
label();

/** Takes a new film: heights of the beam, of the surface and of the rest position, sample by sample. */
export function show(next) {
  // Heights are whole numbers of a step.
  const full = (row) => row.map((height) => height * next.step);
  film = { ...next, beam: next.beam.map(full), apex: full(next.apex), surface: full(next.surface) };
  if (!moving) draw();
}

let palette = null;
matchMedia("(prefers-color-scheme: dark)").addEventListener("change", () => { palette = null; });
function colour(name) { return (palette ??= getComputedStyle(document.documentElement)).getPropertyValue(name).trim(); }

function draw() {
  const ratio = devicePixelRatio || 1;
  const width = Math.round(canvas.clientWidth * ratio);
  const height = Math.round(canvas.clientHeight * ratio);
  if (canvas.width !== width || canvas.height !== height) {
    Object.assign(canvas, { width, height });
    size = 0.86 * Number.parseFloat(getComputedStyle(document.body).fontSize) * ratio;
  }
  pen.clearRect(0, 0, width, height);
  if (!film) return;
  const count = film.beam.length;
  const at = (time % film.periods) / film.periods * count;
  const k = Math.floor(at) % count;
  const [low, high] = film.range;
  const pad = 0.12 * height;
  const y = (v) => height - pad - (v - low) / (high - low || 1) * (height - 2.4 * pad);
  const left = 0.06 * width;
  const right = 0.86 * width;
  const x = (xi) => left + (right - left) * xi;
  const tip = film.beam[k][film.beam[k].length - 1];
  // The sample rests at 0; in contact its surface is at the tip.
  const touching = film.contact[k] === 1;
  const surface = film.surface[k];
  pen.fillStyle = colour("--sample");
  pen.beginPath();
  pen.moveTo(x(0.72), height); pen.lineTo(x(0.72), y(0));
  for (let s = -1; s <= 1.0001; s += 0.05) pen.lineTo(right + s * 0.1 * width, y(surface * Math.exp(-12 * s * s)));
  pen.lineTo(width, y(0)); pen.lineTo(width, height);
  pen.closePath(); pen.fill();
  // Rest position and clamp.
  pen.strokeStyle = colour("--line"); pen.lineWidth = ratio; pen.setLineDash([4 * ratio, 4 * ratio]);
  pen.beginPath(); pen.moveTo(left, y(film.rest)); pen.lineTo(right, y(film.rest)); pen.stroke(); pen.setLineDash([]);
  pen.fillStyle = colour("--soft");
  if (film.is_beam) pen.fillRect(left - 0.02 * width, y(film.beam[k][0]) - 0.09 * height, 0.02 * width, 0.18 * height);
  // The beam, or the mass of an oscillator.
  pen.strokeStyle = touching ? colour("--warm") : colour("--accent");
  pen.lineWidth = 3 * ratio; pen.lineJoin = "round";
  pen.beginPath();
  film.beam[k].forEach((v, j) => pen.lineTo(x(j / (film.beam[k].length - 1)), y(v)));
  pen.stroke();
  // The tip.
  pen.fillStyle = pen.strokeStyle;
  pen.beginPath(); pen.moveTo(right - 7 * ratio, y(tip)); pen.lineTo(right + 7 * ratio, y(tip)); pen.lineTo(right, y(film.apex[k])); pen.closePath(); pen.fill();
  pen.fillStyle = colour("--ink"); pen.font = `${size}px system-ui`;
  pen.fillText(t("motion.scale", { scale: film.scale }), left, 1.35 * size);
  pen.fillText(touching ? t("motion.contact") : "", right - 2 * size, height - 0.5 * size);
  clock.textContent = t("motion.clock", { period: Math.floor(time % film.periods) + 1, periods: film.periods, phase: (360 * (time % 1)).toFixed(0) });
  frames.drawn += 1;
}

function step(now) {
  if (moving && film) { time += SPEED * Math.min(0.1, (now - before) / 1000); if (inView(canvas)) draw(); }
  before = now;
  requestAnimationFrame(step);
}
requestAnimationFrame(step);
