// Requests to the core in Web Workers of this page: one for motions, and one for each kind of request that
// takes longer or must not wait for it. A worker answers one request after another. A request that is no longer wanted is ended with its
// worker; the next worker starts at once, from the same compiled module.

const NAMES = { "/api/states": "states", "/api/curve": "curve", "/api/attractors": "census", "/api/knock": "knock", "/api/force": "force", "/api/margins": "knock", "/api/study": "study" };
const TOO_OLD = "this browser cannot run nanotap, which needs WebAssembly with SIMD and the decompression of streams: use one of 2023 or later";
const workers = new Map();
let compiled = null;
let second = null;            // the part of the module that is loaded on demand, once a worker has loaded it
let place = "";               // its address

/** Sends a request. Passes the lines of a streamed answer to `line`, if given; returns whether the request
 *  was answered, the media type and the bytes; those of a refusal are JSON. */
export async function send(path, body, signal, line = () => {}) {
  compiled ??= load();
  const module = await compiled.catch((error) => { compiled = null; throw error; });
  signal.throwIfAborted();
  const name = NAMES[path] ?? "motion";
  if (!workers.has(name)) workers.set(name, new Queue());
  const queue = workers.get(name);
  return new Promise((fulfil, refuse) => {
    const request = { message: { module, path, body: body === undefined ? "" : JSON.stringify(body) }, line, fulfil, refuse };
    signal.addEventListener("abort", () => { queue.drop(request); refuse(signal.reason); });
    queue.add(request);
  });
}

/** A worker, once it is needed, and the requests that it answers in sequence; it works on the first. */
class Queue {
  requests = [];
  worker = null;

  add(request) {
    this.requests.push(request);
    if (this.requests.length === 1) this.begin();
  }

  begin() {
    if (!this.requests.length) return;
    this.worker ??= this.started();
    this.worker.postMessage({ ...this.requests[0].message, second, address: place });
  }

  started() {
    const worker = new Worker(source());
    worker.addEventListener("message", ({ data }) => this.take(data));
    worker.addEventListener("error", (event) => this.take({ failed: `the worker failed: ${event.message ?? "it cannot be loaded"}; the page goes on` }));
    return worker;
  }

  take({ line, failed, ...answer }) {
    if (answer.second) { second = answer.second; return; }
    const [request] = this.requests;
    try {
      if (line !== undefined) { request.line(line); return; }
    } catch (error) {
      // What follows is not wanted: a refusal ends the lines.
      this.drop(request);
      request.refuse(error);
      return;
    }
    this.requests.shift();
    if (failed) { this.end(); request.refuse(new Error(failed)); } else request.fulfil(answer);
    this.begin();
  }

  drop(request) {
    const place = this.requests.indexOf(request);
    if (place < 0) return;
    this.requests.splice(place, 1);
    if (place) return;
    this.end();
    this.begin();
  }

  end() {
    this.worker?.terminate();
    this.worker = null;
  }
}

/** What a page in one file contains: the text of an element, or nothing. */
const inside = (id) => document.getElementById(id)?.textContent;

let address = "";

/** The address of the worker's code. */
function source() {
  const code = inside("nanotap-worker");
  address ||= code ? URL.createObjectURL(new Blob([code], { type: "text/javascript" })) : "./worker.js";
  return address;
}

/** A module with one function of three numbers, which applies instructions to them as lanes of vectors. */
function tiny(...instructions) {
  const lanes = [0, 1, 2].flatMap((k) => [0x20, k, 0xfd, 0x14]);
  const body = [0, ...lanes, ...instructions, 0xfd, 0x21, 0, 0x0b];
  return Uint8Array.of(0, 0x61, 0x73, 0x6d, 1, 0, 0, 0, 1, 8, 1, 0x60, 3, 0x7c, 0x7c, 0x7c, 1, 0x7c, 3, 2, 1, 0, 7, 5, 1, 1, 0x66, 0, 0,
    0x0a, body.length + 2, 1, body.length, ...body);
}

/** Whether the browser multiplies and adds with one rounding, by `f64x2.relaxed_madd`. The standard also
 *  permits two: then (1 + 2⁻³⁰)(1 − 2⁻³⁰) − 1 is 0. */
function isFused() {
  const module = tiny(0xfd, 0x87, 2);
  if (!WebAssembly.validate(module)) return false;
  const multiplyAdd = new WebAssembly.Instance(new WebAssembly.Module(module)).exports.f;
  return multiplyAdd(1 + 2 ** -30, 1 - 2 ** -30, -1) === -(2 ** -60);
}

/** Whether the browser can run the core: the instructions are `f64x2.add` and `f64x2.mul`. */
const isNewEnough = () => typeof DecompressionStream === "function" && typeof WebAssembly === "object"
  && WebAssembly.validate(tiny(0xfd, 0xf0, 1, 0xfd, 0xf2, 1));

/** The name of the module that this browser runs; both give the same numbers. */
export const moduleName = () => (isFused() ? "nanotap" : "nanotap-exact");

async function load() {
  if (!isNewEnough()) throw new Error(TOO_OLD);
  const name = moduleName();
  const packed = inside(`${name}-module`);
  if (packed) {
    const bytes = Uint8Array.from(atob(packed.trim()), (letter) => letter.charCodeAt(0));
    const plain = new Blob([bytes]).stream().pipeThrough(new DecompressionStream("deflate-raw"));
    return WebAssembly.compile(await new Response(plain).arrayBuffer()).catch(notCompiled);
  }
  place = `./${name}-second.wasm`;
  const answer = await fetch(`./${name}.wasm`).catch(() => { throw new Error("no network: open the page again when there is one"); });
  if (!answer.ok) throw new Error(`${name}.wasm cannot be loaded: ${answer.status} ${answer.statusText}`);
  // Some hosts send another media type, from which nothing is compiled while it comes.
  const streams = answer.headers.get("content-type") === "application/wasm";
  return (streams ? WebAssembly.compileStreaming(answer) : WebAssembly.compile(await answer.arrayBuffer())).catch(notCompiled);
}

const notCompiled = (error) => { throw new Error(`the browser cannot load nanotap, perhaps for too little memory: ${error.message}`); };
