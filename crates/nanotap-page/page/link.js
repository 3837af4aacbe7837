// Links that open the present view anywhere. A case from a file is in the link itself: a digit for the form
// of the link, then the text of the file, deflated (RFC 1951), in base64url.

import { base64Of, bytes } from "./api.js";
import { encoded, names, state, texts } from "./state.js";
import { code } from "./qr.js";
import { t } from "./words.js";
import { drawn } from "./element.js";

const FORM = "1";
const MOST_TEXT = 1 << 20;    // bytes of a case with its files
const MARGIN = 4;             // light squares around a QR code
const $ = (id) => document.getElementById(id);

const results = new Map();    // of reading the cases of links

const through = (bytes, stream) => new Blob([bytes]).stream().pipeThrough(stream);

/** The code of a text in a link. */
export async function packed(text) {
  const bytes = new Uint8Array(await new Response(through(text, new CompressionStream("deflate-raw"))).arrayBuffer());
  const letters = btoa(Array.from(bytes, (byte) => String.fromCharCode(byte)).join(""));
  return FORM + letters.replaceAll("+", "-").replaceAll("/", "_").replaceAll("=", "");
}

/** The text of a code in a link; an error if it is damaged. */
export async function unpacked(word) {
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

/** The text of a case with the files that it names in it, if the core reads it. */
async function whole(kind, text, files = {}) {
  return (await bytes(kind, "/api/open", { text, files })).text();
}

function keep(word, text, name) {
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
  if (/^\d/.test(word) && word[0] !== FORM) return t("fromLink.newer");
  let text = "";
  try { text = await unpacked(word); } catch { return t("fromLink.damaged"); }
  try { keep(word, await whole(word, text), "from a link"); } catch (error) { return t("fromLink.refused", { reason: error.message }); }
  return "";
}

/** Reads a case file, and the files that it names, and returns its code in a link. */
export async function open(files) {
  const [file, ...others] = [...files].sort((one) => (one.name.toLowerCase().endsWith(".toml") ? -1 : 1));
  for (const { name, size } of files) if (size > MOST_TEXT) throw new Error(`${name} has ${size} bytes; a case with its files has at most ${MOST_TEXT}`);
  const beside = await Promise.all(others.map(async (one) => [one.name, { base64: await base64Of(one) }]));
  const text = await whole("open", await file.text(), Object.fromEntries(beside)).catch((error) => { throw new Error(`${file.name}: ${error.message}`); });
  const word = await packed(text);
  keep(word, text, file.name);
  return word;
}

/** The address of the page that others can open. */
export const home = () => document.querySelector("meta[name=nanotap-page]").content || location.href.replace(/[?#].*$/, "");

/** A link to the present view. The file that a server was started with is in it. */
async function link(given) {
  const other = {};
  if (given) {
    const file = await bytes("link", "/api/export", { case: { preset: state.preset }, format: "toml" });
    Object.assign(other, { preset: "", case: await packed(await file.text()) });
  }
  return `${home()}#${encoded(other)}`;
}

/** A QR code as a picture. */
export function picture(rows, label = t("linkWords.qr")) {
  const size = rows.length + 2 * MARGIN;
  const dark = rows.flatMap((row, y) => row.map((one, x) => (one ? `M${x + MARGIN} ${y + MARGIN}h1v1h-1z` : "")));
  const drawing = drawn("svg", { viewBox: `0 0 ${size} ${size}`, role: "img", "aria-label": label, "shape-rendering": "crispEdges" });
  drawing.append(drawn("rect", { width: size, height: size, fill: "#fff" }), drawn("path", { d: dark.join(""), fill: "#000" }));
  return drawing;
}

/** Shows and copies a link to the present view; `given` is whether its case is the file of the server. */
export async function share(given) {
  const address = await link(given);
  const rows = code(address);
  $("link-address").value = address;
  $("link-code").replaceChildren(rows ? picture(rows) : t("linkWords.tooLong"));
  $("link").showModal();
  $("link-address").select();
  const copied = await navigator.clipboard?.writeText(address).then(() => true, () => false);
  $("link-copied").textContent = t(copied ? "linkWords.copied" : "linkWords.copy");
}
