// Figures in the page: an answer contains their description, which is drawn here in the visible range, read
// under the pointer and zoomed.

import { local } from "./words.js";
import { described, layout, paint, part, plain, value } from "./plot.js";

const DRAG = 6;               // pixels beyond which a press is not a click
const EDGE = 0.01;            // part of a panel by which a pointer may miss it
const REACH = 14;             // pixels within which a drawn point is named
const SHARE = 0.86;           // size of letters over that of the page
const TALLEST = 620;          // height that a figure of a motion keeps to, CSS pixels
const FITTING = [215, 340];   // least and greatest height of a figure that ends with the window, CSS pixels
const LOWEST = 330;           // least height of a main figure, CSS pixels
const seen = new IntersectionObserver((all) => { for (const { target, isIntersecting } of all) { target.inView = isIntersecting; if (isIntersecting) draw(target); } });
const sized = new ResizeObserver((all) => { for (const { target } of all) if (target.figure && target.clientWidth !== target.wide) { arrange(target); draw(target); } });
const figures = new Set();
matchMedia("(prefers-color-scheme: dark)").addEventListener("change", () => { for (const element of figures) { element.dirty = true; draw(element); } });

/** Shows a figure. */
export function put(element, figure) {
  if (!element.base) {
    for (const name of ["base", "over"]) {
      element[name] = document.createElement("canvas");
      element[name].className = name;
    }
    element.over.setAttribute("aria-hidden", "true");
    element.base.setAttribute("role", "img");
    figures.add(element);
    seen.observe(element);
    sized.observe(element);
  }
  if (element.base.parentNode !== element) element.replaceChildren(element.base, element.over);
  element.figure = figure;
  element.hidden = false;
  arrange(element);
  if (element.inView !== false) draw(element);
}

/** Removes the figure. */
export function clear(element) {
  element.replaceChildren();
  Object.assign(element, { figure: null, panels: null, now: null, place: null });
}

/** Shows the visible range that the views state. */
export function renew(element) { arrange(element); draw(element); }

/** Places the panels for the present width and views. */
function arrange(element) {
  const wide = element.clientWidth;
  if (!wide || !element.figure) return;
  const style = getComputedStyle(element);
  const size = SHARE * parseFloat(style.fontSize);
  const pen = element.base.getContext("2d");
  // The main figure ends with the window.
  const below = innerHeight - element.getBoundingClientRect().top - scrollY;
  const fits = element.dataset.fit ? Math.min(FITTING[1], Math.max(FITTING[0], below - 3.6 * size)) : null;
  const tall = element.highest ? element.highest() : fits ?? (["study-figure", "strips"].includes(element.id) ? Math.max(LOWEST, below - 2.4 * size) : TALLEST);
  const made = layout(pen, element.figure, wide, size, tall, element.views?.() ?? [], fits !== null);
  Object.assign(element, { wide, size, made, dirty: true });
  const before = element.panels;
  element.panels = made.places.map(({ index, left, top, width, height, x, y, title }) => ({ index, left, top, width, height, x, y, title }));
  // A lower figure than an empty one is not stretched.
  element.style.height = element.style.minHeight = `${made.height}px`;
  element.base.setAttribute("aria-label", described(made.places));
  // The cross stays at its place.
  const k = before?.indexOf(element.place?.panel) ?? -1;
  if (element.place) element.place = k >= 0 && element.panels[k] ? at(element.panels[k], element.place.u, element.place.v) : null;
}

function draw(element) {
  if (!element.made || !element.dirty || !element.figure) return;
  element.dirty = false;
  const ratio = devicePixelRatio || 1;
  for (const canvas of [element.base, element.over]) {
    const [width, height] = [Math.round(element.wide * ratio), Math.round(element.made.height * ratio)];
    if (canvas.width !== width || canvas.height !== height) Object.assign(canvas, { width, height });
  }
  const pen = element.base.getContext("2d");
  pen.setTransform(ratio, 0, 0, ratio, 0, 0);
  pen.clearRect(0, 0, element.wide, element.made.height);
  paint(pen, element.made, element.size);
  marks(element);
}

/** Draws what lies over the figure: the present motion, the cross, the point that is read, the rectangle. */
function marks(element) {
  if (!element.made || !element.over.width) return;
  const ratio = devicePixelRatio || 1;
  const pen = element.over.getContext("2d");
  pen.setTransform(ratio, 0, 0, ratio, 0, 0);
  pen.clearRect(0, 0, element.wide, element.made.height);
  const style = getComputedStyle(element);
  const [warm, accent] = [style.getPropertyValue("--warm"), style.getPropertyValue("--accent")];
  const dot = (x, y) => { pen.beginPath(); pen.arc(x, y, 4.5, 0, 7); pen.fill(); pen.strokeStyle = style.getPropertyValue("--card"); pen.lineWidth = 1.2; pen.stroke(); };
  pen.fillStyle = warm;
  for (const { x, y, panel } of element.now ?? []) {
    pen.strokeStyle = warm; pen.lineWidth = 1.2;
    pen.beginPath(); pen.moveTo(x, panel.top); pen.lineTo(x, panel.top + panel.height); pen.stroke();
    if (y !== null) dot(x, y);
  }
  const { place, zone } = element;
  if (place) {
    const { panel, u, v } = place;
    const [x, y] = [panel.left + u * panel.width, panel.top + (1 - v) * panel.height];
    pen.strokeStyle = warm; pen.lineWidth = 1; pen.setLineDash([4, 4]);
    pen.beginPath(); pen.moveTo(x, panel.top); pen.lineTo(x, panel.top + panel.height);
    pen.moveTo(panel.left, y); pen.lineTo(panel.left + panel.width, y); pen.stroke();
    pen.setLineDash([]);
    if (place.point) { pen.fillStyle = accent; dot(place.point.px, place.point.py); }
  }
  if (zone) {
    pen.fillStyle = accent; pen.globalAlpha = 0.15; pen.fillRect(...zone); pen.globalAlpha = 1;
    pen.strokeStyle = accent; pen.strokeRect(...zone);
  }
}

/** The panel at a point of the window and the values there; `null` outside of all panels. */
export function under(element, clientX, clientY) {
  if (!element.panels || !element.figure) return null;
  const box = element.getBoundingClientRect();
  const [px, py] = [clientX - box.left, clientY - box.top];
  for (const panel of element.panels) {
    const u = (px - panel.left) / panel.width;
    const v = 1 - (py - panel.top) / panel.height;
    // A motion on the frame can be pointed at, too.
    if (Math.abs(within(u) - u) < EDGE && Math.abs(within(v) - v) < EDGE) return at(panel, within(u), within(v));
  }
  return null;
}

const within = (share) => Math.min(1, Math.max(0, share));
const at = (panel, u, v) => ({ panel, u, v, x: value(panel.x, u), y: value(panel.y, v) });

/** The drawn point nearest to a place of the pointer, with the words of its layer. */
function nearest(element, place) {
  const { panel } = place;
  const layers = element.figure.panels[panel.index].layers;
  const [px, py] = [panel.left + place.u * panel.width, panel.top + (1 - place.v) * panel.height];
  let best = null;
  let least = REACH;
  for (const layer of layers) {
    const { x: xs, y: ys } = layer.points ?? { x: [], y: [] };
    for (let k = 0; k < xs.length; k += 1) {
      if (xs[k] === null || ys[k] === null) continue;
      const x = panel.left + part(panel.x, xs[k]) * panel.width;
      if (Math.abs(x - px) >= least) continue;
      const y = panel.top + (1 - part(panel.y, ys[k])) * panel.height;
      const distance = Math.hypot(x - px, y - py);
      if (distance < least) { least = distance; best = { px: x, py: y, x: xs[k], y: ys[k], words: plain(layer.label ?? "") }; }
    }
  }
  return best;
}

/** Text with the values of the axes at a place, or at the drawn point near it. */
export function words(place) {
  const from = place.point ?? place;
  const said = (axis) => `${plain(place.panel[axis].label)} ${Number(from[axis].toPrecision(6))} ${place.panel[axis].unit}`.trim();
  return local(`${from.words ? `${from.words}: ` : ""}${said("x")}, ${said("y")}`);
}

/** The place moved by a hundredth; without one, the centre of the first panel. */
function moved(element, place, [across, up]) {
  if (!element.panels?.length) return null;
  if (!place) return at(element.panels[0], 0.5, 0.5);
  return at(place.panel, within(place.u + 0.01 * across), within(place.v + 0.01 * up));
}

/** Shows where the present motion is: a line at its x in every panel, and a dot at each height. */
export function present(element, place) {
  element.now = !place ? [] : (element.panels ?? []).flatMap((panel) => {
    const u = part(panel.x, place.x);
    if (!(u >= 0 && u <= 1)) return [];
    const height = place.heights[panel.index];
    const v = Number.isFinite(height) ? part(panel.y, height) : -1;
    return [{ panel, x: panel.left + u * panel.width, y: v >= 0 && v <= 1 ? panel.top + (1 - v) * panel.height : null }];
  });
  marks(element);
}

/** Makes a figure respond to pointer, fingers and keys. `tell(place)` is called where the cross goes,
 *  `go(place)` for a click or Enter, `zoom(views)` for another range: a list of {panel, x, y}. `redrawn`
 *  is called when the panels moved. */
export function alive(element, { views, tell, go, zoom, redrawn }) {
  element.views = views;
  let pressed = null;
  let swallow = false;         // the click that ends a drag
  const fingers = new Map();
  let pinch = null;
  const here = (event) => under(element, event.clientX, event.clientY);
  const move = (next) => {
    if (next) next.point = nearest(element, next);
    element.place = next;
    marks(element);
    tell?.(next);
  };
  const see = (panel, x, y) => {
    if (!(x[0] !== x[1] && y[0] !== y[1]) || ![...x, ...y].every(Number.isFinite)) return;
    const exact = (range) => range.map((v) => Number(v.toPrecision(6)));
    zoom([...views().filter((view) => view.panel !== panel.index), { panel: panel.index, x: exact(x), y: exact(y) }]);
    again();
  };
  const again = () => { renew(element); redrawn?.(); };
  const around = (to, factor) => {
    const side = (axis, middle) => [middle - factor * middle, middle + factor * (1 - middle)].map((p) => value(to.panel[axis], p));
    see(to.panel, side("x", to.u), side("y", to.v));
  };
  const spread = () => { const [a, b] = [...fingers.values()]; return { size: Math.hypot(a.x - b.x, a.y - b.y), x: (a.x + b.x) / 2, y: (a.y + b.y) / 2 }; };
  // A figure that is painted again meanwhile has new panels: their number says which one it is.
  const drag = (event) => {
    const next = here(event);
    if (!pressed || next?.panel.index !== pressed.place.panel.index) return;
    if (Math.hypot(event.clientX - pressed.x, event.clientY - pressed.y) <= DRAG) return;
    const { panel, u, v } = pressed.place;
    element.zone = [panel.left + u * panel.width, panel.top + (1 - v) * panel.height, (next.u - u) * panel.width, (v - next.v) * panel.height];
    pressed.to = next;
  };
  element.addEventListener("pointerdown", (event) => {
    swallow = false;
    if (event.pointerType === "touch") {
      fingers.set(event.pointerId, { x: event.clientX, y: event.clientY });
      if (fingers.size === 2) { const now = spread(); pinch = { ...now, to: under(element, now.x, now.y) }; pressed = null; swallow = true; }
      return;
    }
    if (event.button === 0 && here(event)) { pressed = { place: here(event), x: event.clientX, y: event.clientY }; event.preventDefault(); element.focus({ preventScroll: true }); }
  });
  element.addEventListener("pointermove", (event) => {
    if (fingers.has(event.pointerId)) {
      fingers.set(event.pointerId, { x: event.clientX, y: event.clientY });
      if (pinch?.to && fingers.size === 2) {
        const now = spread();
        if (Math.abs(now.size / pinch.size - 1) > 0.1) { const { to } = pinch; around(to, pinch.size / now.size); pinch = { ...now, to: under(element, now.x, now.y) ?? to }; }
      }
      return;
    }
    drag(event);
    move(here(event));
  });
  element.addEventListener("pointerup", (event) => {
    drag(event);
    element.zone = null;
    if (pressed?.to) {
      swallow = true;
      const { place: from, to } = pressed;
      const span = (axis, a, b) => [Math.min(a, b), Math.max(a, b)].map((p) => value(from.panel[axis], p));
      see(from.panel, span("x", from.u, to.u), span("y", from.v, to.v));
    }
    pressed = null;
    marks(element);
  });
  const lifted = (event) => { fingers.delete(event.pointerId); if (fingers.size < 2) pinch = null; };
  for (const name of ["pointerup", "pointercancel"]) element.addEventListener(name, lifted);
  element.addEventListener("pointerleave", () => { pressed = null; element.zone = null; element.place = null; marks(element); tell?.(null); });
  element.addEventListener("click", (event) => { if (!swallow) { move(here(event)); if (element.place) go?.(element.place); } swallow = false; });
  const whole = () => { if (views().length) { zoom([]); again(); } };
  element.addEventListener("dblclick", whole);
  element.addEventListener("wheel", (event) => {
    // Without Ctrl the wheel scrolls the page.
    if (!(event.ctrlKey || event.altKey) || !here(event)) return;
    event.preventDefault();
    around(here(event), event.deltaY < 0 ? 0.8 : 1.25);
  }, { passive: false });
  element.addEventListener("keydown", (event) => {
    const { place } = element;
    const step = { ArrowLeft: [-1, 0], ArrowRight: [1, 0], ArrowUp: [0, 1], ArrowDown: [0, -1] }[event.key];
    if (step) move(moved(element, place, event.shiftKey ? step.map((s) => 10 * s) : step));
    else if (event.key === "n" && element.panels) { const next = (element.panels.indexOf(place?.panel) + 1) % element.panels.length; move(at(element.panels[next], 0.5, 0.5)); }
    else if (event.key === "+" && place) around(place, 0.5);
    else if (event.key === "-" && place) around(place, 2);
    else if (event.key === "0" || event.key === "Escape") whole();
    else if (event.key === "Enter" && place) go?.(place);
    else return;
    event.preventDefault();
  });
}
