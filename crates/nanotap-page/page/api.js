// Requests of the page and their answers. Of each kind of request only the newest is active: a new one
// cancels the previous one, and no more work is done on it.
//
// The modules of the page are also put into one file, by a program that knows no JavaScript: it wraps each
// in a function, those that a module imports before it. Therefore a module imports, at its beginning and
// each on one line, only as `import { a, b as c } from "./x.js";` or `import * as x from "./x.js";`; it
// exports only by `export` at the beginning of a line, before `const`, `let`, `class`, `function` or
// `async function`; an exported `let` is not set again; and no two modules import each other. `worker.js`
// and `service-worker.js` are no modules and import nothing.

import * as server from "./server.js";
import * as workers from "./workers.js";

const running = new Map();

/** Whether the page has no server: its requests are answered in the page itself. */
export const alone = !server.token;

/** A refused request, with the keys and fields that the answer names. */
export class Refused extends Error {
  constructor(message, keys = []) { super(message); this.keys = keys; }
}

const parsed = (bytes) => JSON.parse(new TextDecoder().decode(bytes));

async function send(kind, path, body, line) {
  running.get(kind)?.abort();
  const control = new AbortController();
  running.set(kind, control);
  const answer = await (alone ? workers : server).send(path, body, control.signal, line);
  if (answer.answered) return answer;
  const refusal = parsed(answer.bytes);
  throw new Refused(refusal.error, refusal.keys);
}

/** Whether an error only means that a newer request replaced this one. */
export const superseded = (error) => error?.name === "AbortError";

export async function ask(kind, path, body) {
  return parsed((await send(kind, path, body)).bytes);
}

export async function bytes(kind, path, body) {
  const answer = await send(kind, path, body);
  return new Blob([answer.bytes], { type: answer.kind });
}

/** The bytes of a file in base64. */
export const base64Of = (file) => new Promise((done, failed) => {
  const reader = new FileReader();
  reader.addEventListener("load", () => done(reader.result.slice(reader.result.indexOf(",") + 1)));
  reader.addEventListener("error", () => failed(reader.error));
  reader.readAsDataURL(file);
});

/** Saves a file under a name. */
export function save(blob, name) {
  const link = document.createElement("a");
  link.href = URL.createObjectURL(blob);
  link.download = name;
  link.click();
  setTimeout(() => URL.revokeObjectURL(link.href), 1000);
}

/** The newest request of a kind, to stop it and no later one. */
export const current = (kind) => running.get(kind);

export function stop(kind) {
  running.get(kind)?.abort();
}

/** Passes every line of a streamed answer to `take`, parsed. */
export async function stream(kind, path, body, take) {
  await send(kind, path, body, (line) => {
    const message = JSON.parse(line);
    if (message.error) throw new Refused(message.error, message.keys);
    take(message);
  });
}
