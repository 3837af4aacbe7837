// Figures come drawn from the server, the same that the terminal writes, with a map of their axes.

const SVG = "http://www.w3.org/2000/svg";

/** Puts a drawn figure into its place. */
export function put(element, drawn) {
  const parsed = new DOMParser().parseFromString(drawn.svg, "image/svg+xml").documentElement;
  parsed.removeAttribute("width");
  parsed.removeAttribute("height");
  element.replaceChildren(document.importNode(parsed, true));
  element.panels = drawn.map;
}

/** The panel at a point of the window and the values there; `null` outside of all. */
export function under(element, clientX, clientY) {
  const svg = element.querySelector("svg");
  if (!svg || !element.panels) return null;
  const box = svg.getBoundingClientRect();
  const view = svg.viewBox.baseVal;
  const px = view.x + (clientX - box.left) / box.width * view.width;
  const py = view.y + (clientY - box.top) / box.height * view.height;
  for (const panel of element.panels) {
    const u = (px - panel.left) / panel.width;
    const v = 1 - (py - panel.top) / panel.height;
    if (u >= 0 && u <= 1 && v >= 0 && v <= 1) return at(panel, u, v);
  }
  return null;
}

const at = (panel, u, v) => ({ panel, u, v, x: value(panel.x, u), y: value(panel.y, v) });

/** The place a hundredth further; from nowhere, the middle of the first panel. */
export function moved(element, place, [across, up]) {
  if (!element.panels?.length) return null;
  if (!place) return at(element.panels[0], 0.5, 0.5);
  const within = (part) => Math.min(1, Math.max(0, part));
  return at(place.panel, within(place.u + 0.01 * across), within(place.v + 0.01 * up));
}

/** Draws the cross at a place. */
export function cross(element, place) {
  const svg = element.querySelector("svg");
  if (!svg) return;
  svg.querySelector(".cross")?.remove();
  if (!place) return;
  const { panel, u, v } = place;
  const x = panel.left + u * panel.width;
  const y = panel.top + (1 - v) * panel.height;
  const path = document.createElementNS(SVG, "path");
  path.setAttribute("class", "cross");
  path.setAttribute("d", `M${x} ${panel.top}v${panel.height}M${panel.left} ${y}h${panel.width}`);
  svg.append(path);
}

function value(axis, part) {
  if (axis.scale.toLowerCase() === "log") return axis.from * (axis.to / axis.from) ** part;
  return axis.from + (axis.to - axis.from) * part;
}
