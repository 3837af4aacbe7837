// Figures are drawn by the server, the same as the terminal writes, with a map of their axes. Here
// they are inserted into the page, queried for the values under the pointer, and zoomed.

const SVG = "http://www.w3.org/2000/svg";
const XLINK = "http://www.w3.org/1999/xlink";
const DRAG = 6;               // pixels beyond which a press is not a click
const EDGE = 0.01;            // part of a panel by which a pointer may miss it

/** Inserts a drawn figure. It has one element per line, and lines that are unchanged stay: a curve that
 *  follows a control costs that curve, not every letter of the figure. */
export function put(element, drawn) {
  // Identifiers in the figure have a prefix that changes with it.
  const text = drawn.svg.replace(/\bf[0-9a-f]{8}-/g, `${element.id}-`);
  const letters = element.letters ??= new Map();
  const lines = text.split("\n").filter((line) => {
    const letter = /^<path id="([^"]+)" d="([^"]+)"\/>$/.exec(line);
    if (letter) letters.set(`#${letter[1]}`, letter[2]);
    return !letter && /^<[^!]/.test(line);
  });
  const tree = grown(lines);
  if (element.querySelector("svg.drawn") && element.tree.line === tree.line) {
    renew(element.tree, tree, letters);
  } else {
    plant(tree, parsed(tree, letters));
    for (const size of ["width", "height"]) tree.node.removeAttribute(size);
    tree.node.setAttribute("class", "drawn");
    element.replaceChildren(tree.node);
  }
  element.tree = tree;
  element.panels = drawn.map;
  // A column of panels is read by scrolling, not in one screen.
  const { width, height } = tree.node.viewBox.baseVal;
  element.classList.toggle("tall", height > width);
}

const closed = (line) => /(\/|<\/\w+)>$/.test(line);

/** The tree of the elements that begin the lines. */
function grown(lines) {
  const open = [{ children: [] }];
  lines.forEach((line, k) => {
    if (line.startsWith("</")) {
      const done = open.pop();
      done.text = lines.slice(done.from, k + 1);
    } else {
      const one = { line, from: k, text: [line], children: [], node: null };
      open.at(-1).children.push(one);
      if (!closed(line)) open.push(one);
    }
  });
  return open[0].children[0];
}

/** Draws one element with its children. */
function parsed(tree, letters) {
  const text = tree.text.join("");
  const whole = text.startsWith("<svg") ? text : `<svg xmlns="${SVG}" xmlns:xlink="${XLINK}">${text}</svg>`;
  const page = document.importNode(new DOMParser().parseFromString(whole, "image/svg+xml").documentElement, true);
  join(page, letters);
  return whole === text ? page : page.firstElementChild;
}

/** Assigns to the nodes of a tree the elements of their lines. */
function plant(tree, node) {
  tree.node = node;
  tree.children.forEach((child, k) => plant(child, node.children[k]));
}

/** Changes the elements of an old tree into those of a new one. */
function renew(old, tree, letters) {
  // A text that only moved is the same text: the content of its line is compared separately.
  const [, head, within] = /^(<\w+[^>&]*>)(.*)$/.exec(tree.line) ?? [];
  const [, before, had] = /^(<\w+[^>]*>)(.*)$/.exec(old.line) ?? [];
  const alike = within !== undefined && within === had && old.children.length === tree.children.length
    && head.split(" ")[0] === before.split(" ")[0];
  if (!alike) {
    plant(tree, parsed(tree, letters));
    old.node.replaceWith(tree.node);
    return;
  }
  tree.node = old.node;
  if (before !== head) attributes(tree.node, head);
  tree.children.forEach((child, k) => renew(old.children[k], child, letters));
}

/** Sets the attributes of a line on an element. */
function attributes(node, line) {
  const now = new Map([...line.matchAll(/ ([\w:-]+)="([^"]*)"/g)].map(([, name, value]) => [name, value]));
  for (const { name } of [...node.attributes]) if (!now.has(name)) node.removeAttribute(name);
  for (const [name, value] of now) if (node.getAttribute(name) !== value) node.setAttributeNS(name.startsWith("xlink:") ? XLINK : null, name, value);
}

/** Makes one path of the letters of each text, which is drawn many times faster. A letter is a path of
 *  relative steps, so that it can start anywhere. */
function join(svg, letters) {
  for (const run of svg.querySelectorAll("g[role=text] > g")) {
    const word = document.createElementNS(SVG, "path");
    word.setAttribute("transform", run.getAttribute("transform"));
    word.setAttribute("d", [...run.children].map((use) =>
      `M${use.getAttribute("x") ?? 0} ${use.getAttribute("y") ?? 0}${letters.get(use.getAttribute("xlink:href"))}`).join(""));
    run.replaceWith(word);
  }
}

/** The panel at a point of the window and the values there; `null` outside of all panels. */
export function under(element, clientX, clientY) {
  const svg = element.querySelector("svg");
  if (!svg || !element.panels) return null;
  // The figure may be narrower than its box.
  const { x: px, y: py } = new DOMPoint(clientX, clientY).matrixTransform(svg.getScreenCTM().inverse());
  for (const panel of element.panels) {
    const u = (px - panel.left) / panel.width;
    const v = 1 - (py - panel.top) / panel.height;
    // A motion on the frame can be pointed at, too.
    if (Math.abs(within(u) - u) < EDGE && Math.abs(within(v) - v) < EDGE) return at(panel, within(u), within(v));
  }
  return null;
}

const within = (part) => Math.min(1, Math.max(0, part));
const at = (panel, u, v) => ({ panel, u, v, x: value(panel.x, u), y: value(panel.y, v) });
const logarithmic = (axis) => axis.scale.toLowerCase() === "log";

function value(axis, part) {
  if (logarithmic(axis)) return axis.from * (axis.to / axis.from) ** part;
  return axis.from + (axis.to - axis.from) * part;
}

/** Position of a value on an axis, as a fraction of the axis. */
export function part(axis, v) {
  if (logarithmic(axis)) return Math.log(v / axis.from) / Math.log(axis.to / axis.from);
  return (v - axis.from) / (axis.to - axis.from);
}

/** Text with the values of the axes at a place. */
export function words(place) {
  const said = (axis) => `${place.panel[axis].label.replaceAll("$", "").replaceAll("_0", "₀")} ${Number(place[axis].toPrecision(6))} ${place.panel[axis].unit}`.trim();
  return `${said("x")}, ${said("y")}`;
}

/** The place moved by a hundredth; without one, the centre of the first panel. */
function moved(element, place, [across, up]) {
  if (!element.panels?.length) return null;
  if (!place) return at(element.panels[0], 0.5, 0.5);
  return at(place.panel, within(place.u + 0.01 * across), within(place.v + 0.01 * up));
}

/** Draws the marks of the pointer over a figure. */
function over(element, name, path) {
  const svg = element.querySelector("svg");
  if (!svg) return;
  svg.querySelector(`.${name}`)?.remove();
  if (!path) return;
  const drawn = document.createElementNS(SVG, "path");
  drawn.setAttribute("class", name);
  drawn.setAttribute("d", path);
  svg.append(drawn);
}

function cross(element, place) {
  if (!place) { over(element, "cross", ""); return; }
  const { panel, u, v } = place;
  over(element, "cross", `M${panel.left + u * panel.width} ${panel.top}v${panel.height}M${panel.left} ${panel.top + (1 - v) * panel.height}h${panel.width}`);
}

/** Shows where the present motion is: a line at its x in every panel, and a dot at each height. */
export function present(element, place) {
  const paths = (element.panels ?? []).map((panel, k) => {
    const u = place ? part(panel.x, place.x) : -1;
    if (!(u >= 0 && u <= 1)) return ["", ""];
    const x = panel.left + u * panel.width;
    const v = Number.isFinite(place.heights[k]) ? part(panel.y, place.heights[k]) : -1;
    const y = panel.top + (1 - v) * panel.height;
    return [`M${x} ${panel.top}v${panel.height}`, v >= 0 && v <= 1 ? `M${x - 0.9} ${y}a.9 .9 0 1 0 1.8 0a.9 .9 0 1 0 -1.8 0z` : ""];
  });
  over(element, "now", paths.map(([line]) => line).join(""));
  over(element, "dot", paths.map(([, dot]) => dot).join(""));
}

/** Makes a figure respond to pointer and keys. `tell(place)` is called where the cross goes, `go(place)`
 *  for a click or Enter, `zoom(views)` for another range: a list of {panel, x, y}. */
export function alive(element, { views, tell, go, zoom }) {
  let place = null;
  let pressed = null;
  let swallow = false;         // the click that ends a drag
  const here = (event) => under(element, event.clientX, event.clientY);
  const move = (next) => { place = next; cross(element, place); tell?.(place); };
  const see = (panel, x, y) => {
    const index = element.panels.indexOf(panel);
    if (index < 0 || !(x[0] !== x[1] && y[0] !== y[1])) return;
    const exact = (range) => range.map((v) => Number(v.toPrecision(6)));
    zoom([...views().filter((view) => view.panel !== index), { panel: index, x: exact(x), y: exact(y) }]);
  };
  const around = (to, factor) => {
    const side = (axis, middle) => [middle - factor * middle, middle + factor * (1 - middle)].map((p) => value(to.panel[axis], p));
    see(to.panel, side("x", to.u), side("y", to.v));
  };
  element.addEventListener("pointerdown", (event) => {
    swallow = false;
    if (event.button === 0 && here(event)) { pressed = { place: here(event), x: event.clientX, y: event.clientY }; event.preventDefault(); element.focus({ preventScroll: true }); }
  });
  element.addEventListener("pointermove", (event) => {
    const next = here(event);
    if (pressed && next?.panel === pressed.place.panel && Math.hypot(event.clientX - pressed.x, event.clientY - pressed.y) > DRAG) {
      const { panel, u, v } = pressed.place;
      over(element, "zone", `M${panel.left + u * panel.width} ${panel.top + (1 - v) * panel.height}h${(next.u - u) * panel.width}v${(v - next.v) * panel.height}h${(u - next.u) * panel.width}z`);
      pressed.to = next;
    }
    move(next);
  });
  element.addEventListener("pointerup", () => {
    over(element, "zone", "");
    if (pressed?.to) {
      swallow = true;
      const { place: from, to } = pressed;
      const span = (axis, a, b) => [Math.min(a, b), Math.max(a, b)].map((p) => value(from.panel[axis], p));
      see(from.panel, span("x", from.u, to.u), span("y", from.v, to.v));
    }
    pressed = null;
  });
  element.addEventListener("pointerleave", () => { pressed = null; over(element, "zone", ""); });
  element.addEventListener("click", (event) => { if (!swallow) { move(here(event)); if (place) go?.(place); } swallow = false; });
  element.addEventListener("dblclick", () => { if (views().length) zoom([]); });
  element.addEventListener("wheel", (event) => {
    // Without Ctrl the wheel scrolls the page.
    if (!(event.ctrlKey || event.altKey) || !here(event)) return;
    event.preventDefault();
    around(here(event), event.deltaY < 0 ? 0.8 : 1.25);
  }, { passive: false });
  element.addEventListener("keydown", (event) => {
    const step = { ArrowLeft: [-1, 0], ArrowRight: [1, 0], ArrowUp: [0, 1], ArrowDown: [0, -1] }[event.key];
    if (step) move(moved(element, place, event.shiftKey ? step.map((s) => 10 * s) : step));
    else if (event.key === "n" && element.panels) { const next = (element.panels.indexOf(place?.panel) + 1) % element.panels.length; move(at(element.panels[next], 0.5, 0.5)); }
    else if (event.key === "+" && place) around(place, 0.5);
    else if (event.key === "-" && place) around(place, 2);
    else if ((event.key === "0" || event.key === "Escape") && views().length) zoom([]);
    else if (event.key === "Enter" && place) go?.(place);
    else return;
    event.preventDefault();
  });
  /** After the figure was redrawn: the cross stays at its place. */
  return () => {
    if (!place) return;
    const panel = element.panels?.find((one) => Math.abs(one.left - place.panel.left) < 1e-9 && Math.abs(one.top - place.panel.top) < 1e-9);
    place = panel ? at(panel, place.u, place.v) : null;
    cross(element, place);
  };
}
