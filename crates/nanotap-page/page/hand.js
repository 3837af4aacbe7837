// A surface that is drawn by hand.

import { state, remember } from "./state.js";
import { make } from "./element.js";

const COLUMNS = 64;           // heights along the line

/** The field of such a surface: a pointer sets its heights, arrow keys move and change one. `kept` is called when the
 *  state has new heights, `drawn` when a pointer is lifted. */
export function hand({ name, drawn: word }, kept, drawn) {
  const heights = Array.from({ length: COLUMNS }, () => 0);
  (state.study[name] ?? "").split(",").forEach((text, k) => { if (text !== "" && k < COLUMNS) heights[k] = Math.min(1, Math.max(0, Number(text) || 0)); });
  const box = make("div", { className: "hand", hidden: (state.study.surface ?? "") !== word });
  const field = make("input", { type: "hidden", name, value: state.study[name] ?? "" });
  const canvas = make("canvas", { width: COLUMNS * 8, height: 96, tabIndex: 0 });
  canvas.setAttribute("role", "img");
  canvas.setAttribute("aria-label", "Surface drawn by hand: drag to set its heights; arrow keys move along the line and change the height there");
  let at = 0;
  let last = null;
  const show = () => {
    const pen = canvas.getContext("2d");
    const style = getComputedStyle(document.documentElement);
    pen.clearRect(0, 0, canvas.width, canvas.height);
    pen.fillStyle = style.getPropertyValue("--sample");
    heights.forEach((height, k) => pen.fillRect(8 * k, 92 - 88 * height, 8, 4 + 88 * height));
    if (document.activeElement === canvas) { pen.fillStyle = style.getPropertyValue("--accent"); pen.fillRect(8 * at, 92 - 88 * heights[at], 8, 3); }
  };
  const keep = () => { field.value = state.study[name] = heights.map((height) => Number(height.toFixed(2))).join(","); remember(true); kept(); };
  const set = (event) => {
    const area = canvas.getBoundingClientRect();
    const k = Math.min(COLUMNS - 1, Math.max(0, Math.floor((event.clientX - area.left) / area.width * COLUMNS)));
    const height = Math.min(1, Math.max(0, (area.bottom - event.clientY) / area.height));
    // A quick pointer leaves no gaps.
    const from = last ?? { k, height };
    const steps = Math.max(1, Math.abs(k - from.k));
    for (let n = 0; n <= steps; n += 1) heights[Math.round(from.k + (k - from.k) * n / steps)] = from.height + (height - from.height) * n / steps;
    last = { k, height };
    at = k;
    show();
  };
  canvas.addEventListener("pointerdown", (event) => { canvas.setPointerCapture(event.pointerId); last = null; set(event); });
  canvas.addEventListener("pointermove", (event) => { if (canvas.hasPointerCapture(event.pointerId)) set(event); });
  canvas.addEventListener("pointerup", () => { keep(); drawn(); });
  canvas.addEventListener("keydown", (event) => {
    const [along, up] = { ArrowLeft: [-1, 0], ArrowRight: [1, 0], ArrowUp: [0, 0.05], ArrowDown: [0, -0.05] }[event.key] ?? [];
    if (along === undefined) return;
    event.preventDefault();
    at = (at + along + COLUMNS) % COLUMNS;
    heights[at] = Math.min(1, Math.max(0, heights[at] + up));
    show();
    if (up) keep();
  });
  for (const event of ["focus", "blur"]) canvas.addEventListener(event, show);
  box.append(field, canvas);
  setTimeout(show);
  return box;
}
