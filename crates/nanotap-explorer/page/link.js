// Links that open the present view anywhere. A case from a file is in the link itself: a digit for the form
// of the link, then the text of the file, deflated (RFC 1951), in base64url.

import { bytes } from "./api.js";
import { encoded, names, state, texts } from "./state.js";
import { code } from "./qr.js";

const FORM = "1";
const MOST_TEXT = 200_000;    // bytes of a case file
const MARGIN = 4;             // light squares around a QR code
const $ = (id) => document.getElementById(id);

const results = new Map();    // of reading the cases of links

const through = (bytes, stream) => new Blob([bytes]).stream().pipeThrough(stream);

/** What stands for a text in a link. */
async function packed(text) {
  const bytes = new Uint8Array(await new Response(through(text, new CompressionStream("deflate-raw"))).arrayBuffer());
  const letters = btoa(Array.from(bytes, (byte) => String.fromCharCode(byte)).join(""));
  return FORM + letters.replaceAll("+", "-").replaceAll("/", "_").replaceAll("=", "");
}

/** The text of a case in a link; an error if it is damaged. */
async function unpacked(word) {
  const letters = atob(word.slice(1).replaceAll("-", "+").replaceAll("_", "/"));
  const plain = through(Uint8Array.from(letters, (letter) => letter.charCodeAt(0)), new DecompressionStream("deflate-raw"));
  const decoder = new TextDecoder("utf-8", { fatal: true });
  let [text, size] = ["", 0];
  for (const reader = plain.getReader(); ;) {
    const { done, value } = await reader.read();
    if (done) return text + decoder.decode();
    size += value.length;
    if (size > MOST_TEXT) throw new RangeError("too long");
    text += decoder.decode(value, { stream: true });
  }
}

/** Takes a text as a case, if the core reads it. */
async function take(kind, word, text, name) {
  await bytes(kind, "/api/export", { case: { text }, format: "toml" });
  texts.set(word, text);
  names.set(word, name);
}

/** Reads the case of a link, and returns why that is not possible, or nothing. */
export function read(word) {
  if (!word || texts.has(word)) return "";
  if (!results.has(word)) results.set(word, first(word));
  return results.get(word);
}

async function first(word) {
  if (/^\d/.test(word) && word[0] !== FORM) return "This link is of another version of nanotap, and this one cannot read its case.";
  let text = "";
  try { text = await unpacked(word); } catch { return "This link is damaged: it contains no case file."; }
  try { await take(word, word, text, "from a link"); } catch (error) { return `The case of this link is refused: ${error.message}.`; }
  return "";
}

/** Reads a case file, and returns what stands for it in a link. */
export async function open(file) {
  if (file.size > MOST_TEXT) throw new Error(`${file.name} has ${file.size} bytes; a case file has at most ${MOST_TEXT}`);
  const text = await file.text();
  const word = await packed(text);
  await take("open", word, text, file.name).catch((error) => { throw new Error(`${file.name}: ${error.message}`); });
  return word;
}

/** A link to the present view. The file that a server was started with is in it. */
async function link(given) {
  const other = {};
  if (given) {
    const file = await bytes("link", "/api/export", { case: { preset: state.preset }, format: "toml" });
    Object.assign(other, { preset: "", case: await packed(await file.text()) });
  }
  const own = location.href.replace(/[?#].*$/, "");
  return `${document.querySelector("meta[name=nanotap-page]").content || own}#${encoded(other)}`;
}

/** A QR code as a picture. */
function picture(rows) {
  const make = (name, properties) => {
    const made = document.createElementNS("http://www.w3.org/2000/svg", name);
    for (const [key, value] of Object.entries(properties)) made.setAttribute(key, value);
    return made;
  };
  const size = rows.length + 2 * MARGIN;
  const dark = rows.flatMap((row, y) => row.map((one, x) => (one ? `M${x + MARGIN} ${y + MARGIN}h1v1h-1z` : "")));
  const drawing = make("svg", { viewBox: `0 0 ${size} ${size}`, role: "img", "aria-label": "QR code of the link", "shape-rendering": "crispEdges" });
  drawing.append(make("rect", { width: size, height: size, fill: "#fff" }), make("path", { d: dark.join(""), fill: "#000" }));
  return drawing;
}

/** Shows and copies a link to the present view; `given` is whether its case is the file of the server. */
export async function share(given) {
  const address = await link(given);
  const rows = code(address);
  $("link-address").value = address;
  $("link-code").replaceChildren(rows ? picture(rows) : "The link is too long for a QR code.");
  $("link").showModal();
  $("link-address").select();
  const copied = await navigator.clipboard?.writeText(address).then(() => true, () => false);
  $("link-copied").textContent = copied ? "Copied. The link opens this view:" : "Copy this link; it opens this view:";
}
