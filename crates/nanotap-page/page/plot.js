// Draws the project's description of a figure on a canvas: panels in a grid, axes with ticks, layers from
// back to front, legends. Letters have the size of the page's, and panels take the width that there is.

import { local, t } from "./words.js";

const NARROW = 520;           // CSS pixels below which panels are in one column
const RATIO = 0.62;           // height of a panel over its width
const LEAST = 110;            // smallest height of a panel, CSS pixels, unless the figure says less
const LOW = 72;               // the same of a figure that ends with the window
const MM = 3.4;               // CSS pixels for a millimetre of print
const POINT = 1.7;            // CSS pixels for a typographer's point
const SCRIPT = 0.72;          // size of a sub- or superscript
const BAR = 12;               // width of a colour bar, CSS pixels
let grown = 1;                // lines and marks grow with the letters

const dark = matchMedia("(prefers-color-scheme: dark)");
let theme = null;
dark.addEventListener("change", () => { theme = null; });
let forced = null;            // whether it is dark, in place of the system's scheme
const isDark = () => forced ?? dark.matches;
/** Draws in dark colours or not, whatever the system's scheme is; `null` follows the system. */
export function scheme(is) { forced = is; theme = null; }
function colours() {
  if (theme) return theme;
  const style = getComputedStyle(document.documentElement);
  const of = (name) => style.getPropertyValue(name).trim();
  return (theme = { ink: of("--ink"), soft: of("--soft"), line: of("--line"), card: of("--card"), known: new Map() });
}

/** A colour of print on the present background: in the dark, greys are reversed and dark colours lighter. */
function shade(colour) {
  const { known } = colours();
  if (!isDark() || !colour) return colour ?? "#000";
  if (!known.has(colour)) {
    const [r, g, b] = [1, 3, 5].map((k) => parseInt(colour.slice(k, k + 2), 16) / 255);
    const [high, low] = [Math.max(r, g, b), Math.min(r, g, b)];
    const middle = (high + low) / 2;
    const grey = high - low < 0.12;
    const target = grey ? 0.92 - 0.8 * middle : Math.max(middle, 0.62);
    const mix = (c) => (grey ? target : middle >= target ? c : c + (1 - c) * (target - middle) / (1 - middle));
    const hex = (c) => Math.round(255 * mix(c)).toString(16).padStart(2, "0");
    known.set(colour, `#${hex(r)}${hex(g)}${hex(b)}${colour.slice(7)}`);
  }
  return known.get(colour);
}

// Words with markup: _{…} lowers, ^{…} raises, between $ letters are italic.

const cache = new Map();
function runs(words) {
  const source = local(words);
  if (cache.has(source)) return cache.get(source);
  const made = [];
  let [maths, script, braces, single] = [false, 0, false, false];
  for (let k = 0; k < source.length; k += 1) {
    let letter = source[k];
    if (letter === "$") { maths = !maths; continue; }
    if ((letter === "_" || letter === "^") && (maths || source[k + 1] === "{")) {
      script = letter === "_" ? -1 : 1;
      braces = source[k + 1] === "{";
      single = !braces;
      if (braces) k += 1;
      continue;
    }
    if (letter === "}" && braces) { [script, braces] = [0, false]; continue; }
    if (letter === "\\") letter = source[k += 1] ?? "";
    if (letter === "-" && (maths || script)) letter = "−";
    const italic = maths && /[a-zα-ω]/i.test(letter) && !(braces && script < 0);
    const last = made.at(-1);
    if (last && last.script === script && last.italic === italic) last.text += letter;
    else made.push({ text: letter, script, italic });
    if (single) [script, single] = [0, false];
  }
  if (cache.size > 2000) cache.clear();
  cache.set(source, made);
  return made;
}
/** Words without markup. */
export const plain = (source) => runs(source).map((run) => run.text).join("");

function font(pen, size, run) {
  pen.font = `${run.italic ? "italic " : ""}${run.script ? SCRIPT * size : size}px system-ui, sans-serif`;
}
const widths = new Map();
function width(pen, source, size) {
  const key = `${size} ${source}`;
  if (!widths.has(key)) {
    if (widths.size > 5000) widths.clear();
    let sum = 0;
    for (const run of runs(source)) { font(pen, size, run); sum += pen.measureText(run.text).width; }
    widths.set(key, sum);
  }
  return widths.get(key);
}
/** Writes words: `across` is 0 for the left end at x, 0.5 for the middle, 1 for the right end. */
function write(pen, source, x, y, size, across = 0, colour = colours().ink) {
  let at = x - across * width(pen, source, size);
  pen.fillStyle = colour;
  for (const run of runs(source)) {
    font(pen, size, run);
    pen.fillText(run.text, at, y - (run.script > 0 ? 0.34 : run.script < 0 ? -0.16 : 0) * size);
    at += pen.measureText(run.text).width;
  }
}

// Axes.

export const logarithmic = (axis) => axis.scale === "log";

/** Position of a value on an axis, as a fraction of the axis. */
export function part(axis, v) {
  if (logarithmic(axis)) return Math.log(v / axis.from) / Math.log(axis.to / axis.from);
  return (v - axis.from) / (axis.to - axis.from);
}
export function value(axis, u) {
  if (logarithmic(axis)) return axis.from * (axis.to / axis.from) ** u;
  return axis.from + (axis.to - axis.from) * u;
}

const power = (n) => `10^{${n < 0 ? "−" : ""}${Math.abs(n)}}`;
const numeral = (v, digits) => v.toFixed(Math.min(20, Math.max(0, digits))).replace("-", "−");

/** At most `most` ticks between the ends of an axis: values with words, and what multiplies all words. */
export function ticks(axis, most) {
  const [low, high] = [Math.min(axis.from, axis.to), Math.max(axis.from, axis.to)];
  if (!(high > low)) return { at: [], note: "" };
  if (axis.marks) return { at: axis.marks.filter(([v]) => v >= low && v <= high), note: "" };
  if (logarithmic(axis)) {
    const [first, last] = [Math.ceil(Math.log10(low) - 1e-9), Math.floor(Math.log10(high) + 1e-9)];
    if (last - first >= 1) {
      const stride = Math.ceil((last - first + 1) / Math.max(2, most));
      const all = Array.from({ length: last - first + 1 }, (_, k) => first + k);
      return { at: all.filter((n) => n % stride === 0).map((n) => [10 ** n, power(n)]), note: "" };
    }
  }
  const rough = (high - low) / Math.max(2, most);
  const unit = 10 ** Math.floor(Math.log10(rough));
  const steps = [10, 5, 2.5, 2, 1, 0.5, 0.25].map((n) => n * unit);
  const widest = steps.findLastIndex((one) => one >= rough * (1 - 1e-9));
  // A single tick is not a scale: there may be more than `most` then.
  const within = (one) => Math.floor(high / one + 1e-9) - Math.ceil(low / one - 1e-9) + 1;
  const step = steps.find((one, k) => k >= widest && within(one) > 1) ?? steps[widest];
  const largest = Math.max(Math.abs(low), Math.abs(high));
  const shift = largest >= 1e5 || largest < 1e-3 ? Math.floor(Math.log10(largest)) : 0;
  const scaled = step / 10 ** shift;
  let digits = Math.max(0, -Math.floor(Math.log10(scaled) + 1e-9));
  if (Math.abs(scaled * 10 ** digits - Math.round(scaled * 10 ** digits)) > 1e-6) digits += 1;
  const at = [];
  for (let k = Math.ceil(low / step - 1e-9); k * step <= high * (1 + Math.sign(high) * 1e-9); k += 1) {
    at.push([k * step, numeral(k * step / 10 ** shift, digits)]);
  }
  return { at, note: shift ? `×${power(shift)}` : "" };
}

const label = (axis) => (axis.unit && axis.label ? `${axis.label} (${axis.unit})` : axis.label || axis.unit);

/** An axis in its visible range. */
function seen(axis, range) {
  const [from, to] = range ?? axis.range?.fixed ?? [0, 0];
  return { label: axis.label ?? "", unit: axis.unit ?? "", scale: axis.scale ?? "linear", marks: axis.marks ?? null, from, to };
}

// Layout.

/** The entries of a panel's legend: a layer, its words. */
function entries(panel) {
  const all = [];
  const add = (layer, words, colour) => {
    if (words && !all.some((one) => one.words === words && one.colour === colour && one.layer.kind === layer.kind)) all.push({ layer, words, colour });
  };
  for (const layer of panel.layers) {
    if (layer.kind === "category-map") for (const one of layer.categories) add(layer, one.label, one.colour);
    else add(layer, layer.label, layer.colour);
  }
  return panel.legend === "hidden" ? [] : all;
}

/** Whether all values of a panel are 0: nothing is to be seen in it. */
function isZero({ layers }) {
  const values = layers.flatMap(({ points }) => points?.y ?? []);
  return values.length > 1 && layers.every(({ kind }) => kind !== "heatmap" && kind !== "category-map") && values.every((v) => v === 0 || v === null);
}

/** Places the panels of a figure on a canvas of some width. `highest` is the height that it should keep to,
 *  also on a narrow canvas if it `fits`. Panels in which all is 0 are named below in place of being drawn. */
export function layout(pen, figure, wide, size, highest, views, fits = false) {
  const cols = wide < NARROW ? 1 : Math.max(1, figure.cols);
  const all = figure.panels.map((panel, k) => ({ panel, k })).filter(({ panel }) => panel.layers.length || panel.x.label);
  const some = all.filter(({ panel }) => !isZero(panel));
  const drawn = some.length ? some : all;
  const inGrid = cols === figure.cols && drawn.length === all.length;
  const zero = all.filter((one) => !drawn.includes(one)).map(({ panel }) => plain(panel.y.label));
  const rows = Math.ceil((inGrid ? figure.panels.length : drawn.length) / cols);
  const range = (k) => {
    const own = views.find((view) => view.panel === k);
    const shared = figure.share_x ? views.findLast((view) => view.panel % figure.cols === k % figure.cols) : own;
    return { x: shared?.x, y: own?.y };
  };
  const places = drawn.map(({ panel, k }, n) => {
    const view = range(k);
    const [x, y] = [seen(panel.x, view.x), seen(panel.y, view.y)];
    const place = inGrid ? k : n;
    return { index: k, panel, x, y, row: Math.floor(place / cols), col: place % cols, entries: entries(panel), title: panel.title ?? "" };
  });
  const shares = (list, n) => (list?.length === n ? list : Array(n).fill(1));
  const across = shares(inGrid ? figure.column_widths : null, cols);
  const down = shares(inGrid ? figure.row_heights : null, rows);
  const total = (list) => list.reduce((sum, one) => sum + one, 0);
  const upto = (list, n) => total(list.slice(0, n));
  // Text next to the panels. Ticks of the final height are not wider than these.
  for (const place of places) {
    const words = [2, 3, 4, 5, 6, 7, 8].flatMap((most) => ticks(place.y, most).at.map(([, text]) => width(pen, text, size)));
    place.words = place.row === rows - 1 || !figure.share_x || !places.some((other) => other.col === place.col && other.row > place.row);
    place.aside = Math.max(0, ...words) + 0.7 * size + (label(place.y) ? 1.5 * size : 0);
    place.bar = place.panel.layers.find((layer) => layer.kind === "heatmap");
    const scale = place.bar && seen(place.bar.scale);
    place.barAside = scale ? BAR + 1.5 * size + Math.max(0, ...ticks(scale, 5).at.map(([, text]) => width(pen, text, size))) + 1.6 * size : 1.7 * size;
    place.below = place.words ? (label(place.x) ? 2.9 : 1.6) * size : 0.7 * size;
  }
  const most = (list) => Math.max(0, ...list);
  const column = (key) => across.map((_, c) => most(places.filter((one) => one.col === c).map((one) => one[key])));
  // The panels of a column have the same edges.
  const [asides, bars] = [column("aside"), column("barAside")];
  const columns = asides.map((one, c) => one + bars[c]);
  const free = wide - total(columns);
  const columnWidth = across.map((share) => Math.max(60, free * share / total(across)));
  for (const place of places) {
    // Legends are above, in as many lines as they need.
    let [line, at] = [0, 0];
    for (const one of place.entries) {
      const need = width(pen, one.words, size) + 3.2 * size;
      if (at && at + need > columnWidth[place.col]) { line += 1; at = 0; }
      Object.assign(one, { line, at });
      at += need;
    }
    place.above = (place.entries.length ? 1.3 * size * (line + 1) : 0) + (place.title ? 1.5 * size : 0) + 0.7 * size;
  }
  const row = (key) => down.map((_, r) => most(places.filter((one) => one.row === r).map((one) => one[key])));
  const [above, below] = [row("above"), row("below")];
  const wanted = (figure.ratio ?? RATIO) * most(columnWidth) * rows;
  // A column of panels is read by scrolling.
  if (wide < NARROW && !fits) highest = Infinity;
  const least = fits ? LOW : wide < NARROW ? LEAST : figure.least ?? LEAST;
  const heights = Math.max(least * total(down) / Math.max(...down) * 0.8, least * rows * 0.95, Math.min(wanted, highest - total(above) - total(below)));
  let top = 0;
  down.forEach((share, r) => {
    top += above[r];
    const height = heights * share / total(down);
    for (const place of places.filter((one) => one.row === r)) {
      const left = upto(columns, place.col) + upto(columnWidth, place.col) + asides[place.col];
      // The labels of a column are aligned.
      Object.assign(place, { left, top, width: columnWidth[place.col], height, aside: asides[place.col] });
    }
    top += height + below[r];
  });
  return { places, zero, height: Math.ceil(top + (zero.length ? 1.8 * size : 0)) };
}

// Layers.

const DASHES = { dashed: [4, 2.2], dotted: [1, 1.6], "dash-dot": [5, 1.8, 1.2, 1.8] };
function stroke(pen, colour, points, dash) {
  pen.strokeStyle = shade(colour);
  pen.lineWidth = Math.max(0.8, points * POINT) * grown;
  pen.setLineDash((DASHES[dash] ?? []).map((one) => one * Math.max(1, pen.lineWidth)));
}

const SHAPES = {
  circle: (pen, x, y, r) => pen.arc(x, y, r, 0, 7),
  square: (pen, x, y, r) => pen.rect(x - 0.9 * r, y - 0.9 * r, 1.8 * r, 1.8 * r),
  triangle: (pen, x, y, r) => { pen.moveTo(x, y - 1.2 * r); pen.lineTo(x + 1.1 * r, y + 0.8 * r); pen.lineTo(x - 1.1 * r, y + 0.8 * r); pen.closePath(); },
  diamond: (pen, x, y, r) => { pen.moveTo(x, y - 1.2 * r); pen.lineTo(x + 1.2 * r, y); pen.lineTo(x, y + 1.2 * r); pen.lineTo(x - 1.2 * r, y); pen.closePath(); },
  cross: (pen, x, y, r) => { pen.moveTo(x - r, y - r); pen.lineTo(x + r, y + r); pen.moveTo(x - r, y + r); pen.lineTo(x + r, y - r); },
  plus: (pen, x, y, r) => { pen.moveTo(x - r, y); pen.lineTo(x + r, y); pen.moveTo(x, y - r); pen.lineTo(x, y + r); },
};
function marker(pen, layer, x, y) {
  pen.beginPath();
  (SHAPES[layer.shape] ?? SHAPES.circle)(pen, x, y, Math.max(1.8, layer.size * MM / 2) * grown);
  const thin = layer.shape === "cross" || layer.shape === "plus" || layer.open;
  if (layer.open) { pen.fillStyle = colours().card; pen.fill(); }
  if (thin) { pen.strokeStyle = shade(layer.colour); pen.lineWidth = 1.3; pen.stroke(); return; }
  pen.fillStyle = shade(layer.colour);
  pen.fill();
  if (layer.edge) { pen.strokeStyle = colours().card; pen.lineWidth = 1; pen.stroke(); }
}

/** A grid of colours as a picture of one pixel a cell. */
function picture(layer) {
  if (layer.picture) return layer.picture;
  const { columns, rows } = layer;
  const made = Object.assign(document.createElement("canvas"), { width: columns, height: rows });
  const data = new ImageData(columns, rows);
  const bytes = (colour) => [1, 3, 5].map((k) => parseInt(colour.slice(k, k + 2), 16));
  let of = null;
  if (layer.kind === "heatmap") {
    const scale = seen(layer.scale);
    const stops = layer.colours.map(bytes);
    of = (v) => (v === null ? null : stops[Math.round(Math.min(1, Math.max(0, part(scale, v))) * (stops.length - 1))]);
  } else {
    const stops = layer.categories.map((one) => bytes(one.colour));
    of = (cell) => (cell === null ? null : stops[cell]);
  }
  (layer.values ?? layer.cells).forEach((one, k) => {
    const colour = of(one);
    const place = 4 * ((rows - 1 - Math.floor(k / columns)) * columns + k % columns);
    if (colour) data.data.set([...colour, 255], place);
  });
  made.getContext("2d").putImageData(data, 0, 0);
  return (layer.picture = made);
}

function layer(pen, place, one) {
  const X = (v) => place.left + part(place.x, v) * place.width;
  const Y = (v) => place.top + (1 - part(place.y, v)) * place.height;
  const [right, bottom] = [place.left + place.width, place.top + place.height];
  const { x: xs, y: ys } = one.points ?? { x: [], y: [] };
  const shown = (k) => xs[k] !== null && ys[k] !== null && !(logarithmic(place.y) && ys[k] <= 0) && !(logarithmic(place.x) && xs[k] <= 0);
  const foot = Y(logarithmic(place.y) ? place.y.from : one.foot ?? 0);
  pen.setLineDash([]);
  switch (one.kind) {
    case "line": {
      stroke(pen, one.colour, one.width, one.dash);
      pen.beginPath();
      let on = false;
      for (let k = 0; k < xs.length; k += 1) {
        if (!shown(k)) on = false;
        else if (on) pen.lineTo(X(xs[k]), Y(ys[k]));
        else { pen.moveTo(X(xs[k]), Y(ys[k])); on = true; }
      }
      pen.stroke();
      break;
    }
    case "points": {
      const size = Math.max(1.8, one.diameter * MM) * grown;
      pen.fillStyle = shade(one.colour);
      for (let k = 0; k < xs.length; k += 1) if (shown(k)) pen.fillRect(X(xs[k]) - size / 2, Y(ys[k]) - size / 2, size, size);
      break;
    }
    case "markers":
      for (let k = 0; k < xs.length; k += 1) if (shown(k)) marker(pen, one, X(xs[k]), Y(ys[k]));
      break;
    case "stems": case "bars": {
      pen.fillStyle = shade(one.colour);
      for (let k = 0; k < xs.length; k += 1) {
        if (!shown(k)) continue;
        // Joined bars are one area.
        const [left, end] = one.joined ? [X(xs[k] - one.width / 2), X(xs[k] + one.width / 2)].map(Math.round) : one.kind === "bars" ? [X(xs[k] - one.width / 2), X(xs[k] + one.width / 2)] : [X(xs[k]) - 0.7, X(xs[k]) + 0.7];
        pen.fillRect(left, Math.min(foot, Y(ys[k])), end - left, Math.abs(foot - Y(ys[k])));
        if (one.kind === "stems") { pen.beginPath(); pen.arc(X(xs[k]), Y(ys[k]), 2.6 * grown, 0, 7); pen.fill(); }
      }
      break;
    }
    case "rule":
      stroke(pen, one.colour, one.width, one.dash);
      pen.beginPath();
      if (one.upright) { pen.moveTo(X(one.at), place.top); pen.lineTo(X(one.at), bottom); } else { pen.moveTo(place.left, Y(one.at)); pen.lineTo(right, Y(one.at)); }
      pen.stroke();
      break;
    case "band":
      pen.fillStyle = shade(one.colour);
      for (const [from, to] of one.intervals) {
        const clamp = (v, none, low, high) => Math.min(high, Math.max(low, v === null ? none : v));
        if (one.along_x) {
          const [a, b] = [clamp(from === null ? null : X(from), place.left, place.left, right), clamp(to === null ? null : X(to), right, place.left, right)];
          pen.fillRect(a, place.top, b - a, place.height);
        } else {
          const [a, b] = [clamp(to === null ? null : Y(to), place.top, place.top, bottom), clamp(from === null ? null : Y(from), bottom, place.top, bottom)];
          pen.fillRect(place.left, a, place.width, b - a);
        }
      }
      break;
    case "heatmap": case "category-map":
      pen.imageSmoothingEnabled = false;
      pen.drawImage(picture(one), X(one.x[0]), Y(one.y[1]), X(one.x[1]) - X(one.x[0]), Y(one.y[0]) - Y(one.y[1]));
      break;
    default:
  }
}

function note(pen, place, one, size) {
  const at = (where) => (where.data
    ? [place.left + part(place.x, where.data[0]) * place.width, place.top + (1 - part(place.y, where.data[1])) * place.height]
    : [place.left + where.panel[0] * place.width, place.top + (1 - where.panel[1]) * place.height]);
  const [x, y] = at(one.at);
  if (one.tip) {
    const [tx, ty] = at(one.tip);
    const turn = Math.atan2(ty - y, tx - x);
    stroke(pen, one.colour, 0.6, "solid");
    pen.beginPath(); pen.moveTo(x, y); pen.lineTo(tx, ty);
    for (const side of [-0.4, 0.4]) { pen.moveTo(tx, ty); pen.lineTo(tx - 7 * Math.cos(turn + side), ty - 7 * Math.sin(turn + side)); }
    pen.stroke();
  }
  const [across, dx, dy] = { right: [0, 5, 0.35], left: [1, -5, 0.35], above: [0.5, 0, -0.5], below: [0.5, 0, 1.2], centre: [0.5, 0, 0.35] }[one.side ?? "right"];
  if (one.text) write(pen, one.text, x + dx, y + dy * size, size, across, shade(one.colour));
}

/** Draws the panels of a layout. */
export function paint(pen, { places, zero, height: tall }, size) {
  const { ink, soft, line } = colours();
  grown = size / 12;
  pen.textBaseline = "alphabetic";
  for (const place of places) {
    const { left, top, width: wide, height: high } = place;
    const [right, bottom] = [left + wide, top + high];
    pen.save();
    pen.beginPath(); pen.rect(left - 1, top - 1, wide + 2, high + 2); pen.clip();
    for (const one of place.panel.layers) layer(pen, place, one);
    pen.restore();
    for (const one of place.panel.layers) if (one.kind === "note") note(pen, place, one, size);
    pen.setLineDash([]);
    pen.strokeStyle = soft; pen.lineWidth = 1;
    pen.strokeRect(left, top, wide, high);
    pen.beginPath();
    const [across, up] = [ticks(place.x, Math.max(2, Math.floor(wide / (5.5 * size)))), ticks(place.y, Math.max(2, Math.floor(high / (2.4 * size))))];
    for (const [v] of across.at) { const x = left + part(place.x, v) * wide; pen.moveTo(x, bottom); pen.lineTo(x, bottom + 4); }
    for (const [v] of up.at) { const y = top + (1 - part(place.y, v)) * high; pen.moveTo(left, y); pen.lineTo(left - 4, y); }
    pen.stroke();
    if (place.words) {
      for (const [v, words] of across.at) write(pen, words, left + part(place.x, v) * wide, bottom + 1.3 * size, size, 0.5);
      write(pen, [label(place.x), across.note].filter(Boolean).join("  "), left + wide / 2, bottom + 2.6 * size, size, 0.5);
    }
    for (const [v, words] of up.at) write(pen, words, left - 7, top + (1 - part(place.y, v)) * high + 0.35 * size, size, 1);
    const title = [label(place.y), up.note].filter(Boolean).join("  ");
    pen.save();
    pen.translate(left - place.aside + size, top + high / 2);
    pen.rotate(-Math.PI / 2);
    // Little longer than its panel: the next one's begins there.
    write(pen, title, 0, 0, size * Math.min(1, Math.max(0.7, 1.1 * high / width(pen, title, size))), 0.5);
    pen.restore();
    if (place.title) write(pen, place.title, left, top - 0.5 * size - (place.entries.length ? 1.3 * size * (place.entries.at(-1).line + 1) : 0), size, 0);
    const lines = (place.entries.at(-1)?.line ?? -1) + 1;
    for (const { layer: one, words, colour, line: row, at } of place.entries) {
      const [x, y] = [left + at, top - 0.75 * size - 1.3 * size * (lines - 1 - row)];
      if (one.kind === "line" || one.kind === "rule") {
        stroke(pen, colour, one.width, one.dash);
        pen.beginPath(); pen.moveTo(x, y); pen.lineTo(x + 1.8 * size, y); pen.stroke();
      } else if (one.kind === "markers") marker(pen, one, x + 1.1 * size, y);
      else {
        pen.fillStyle = one.kind === "category-map" ? colour : shade(colour?.slice(0, 7));
        const round = one.kind === "points" || one.kind === "stems";
        pen.beginPath();
        if (round) pen.arc(x + 1.1 * size, y, 2.6, 0, 7); else pen.rect(x + 0.6 * size, y - 0.4 * size, 0.9 * size, 0.8 * size);
        pen.fill();
      }
      pen.setLineDash([]);
      write(pen, words, x + 2.1 * size, y + 0.35 * size, size);
    }
    if (place.bar) {
      const scale = seen(place.bar.scale);
      const x = right + size;
      place.bar.colours.forEach((colour, k, all) => {
        pen.fillStyle = colour;
        pen.fillRect(x, bottom - (k + 1) * high / all.length - 0.5, BAR, high / all.length + 1);
      });
      const marks = ticks(scale, Math.max(2, Math.floor(high / (2.4 * size))));
      for (const [v, words] of marks.at) write(pen, words, x + BAR + 4, bottom - part(scale, v) * high + 0.35 * size, size);
      pen.save();
      pen.translate(left + wide + place.barAside - 0.3 * size, top + high / 2);
      pen.rotate(-Math.PI / 2);
      write(pen, [label(scale), marks.note].filter(Boolean).join("  "), 0, 0, size, 0.5);
      pen.restore();
      pen.strokeStyle = line; pen.strokeRect(x, top, BAR, high);
    }
  }
  pen.fillStyle = ink;
  if (zero.length) write(pen, t("zero", { names: zero.join(", ") }), places[0].left, tall - 0.5 * size, size, 0, soft);
}

/** The panels in words, for readers that cannot see them. */
export function described(places) {
  const number = (v) => Number(v.toPrecision(3));
  const axis = (one) => `${plain(label(one))} from ${number(one.from)} to ${number(one.to)}`;
  return places.map((place) => local([place.title && plain(place.title), `${axis(place.y)}, against ${axis(place.x)}`, place.bar && axis(seen(place.bar.scale)),
    place.entries.map((one) => plain(one.words)).join(", ")].filter(Boolean).join(": "))).join(". ");
}
