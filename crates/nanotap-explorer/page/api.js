// Requests to the server. Of each kind of request only the newest is active: a new one cancels the
// previous one, and the server stops working on it.

const token = new URLSearchParams(location.search).get("token") ?? "";
const running = new Map();

/** A refused request, with the keys and fields that the server names. */
export class Refused extends Error {
  constructor(message, keys = []) { super(message); this.keys = keys; }
}

const ENDED = "nanotap explore has ended; start it again";

async function send(kind, path, body) {
  running.get(kind)?.abort();
  const control = new AbortController();
  running.set(kind, control);
  const sent = fetch(path, {
    method: body === undefined ? "GET" : "POST",
    headers: { "x-nanotap-token": token, ...(body === undefined ? {} : { "content-type": "application/json" }) },
    body: body === undefined ? undefined : JSON.stringify(body),
    signal: control.signal,
  });
  // Without an answer of the server there is only a TypeError with the browser's words.
  const answer = await sent.catch((error) => { throw superseded(error) ? error : new Refused(ENDED); });
  if (!answer.ok) {
    const text = await answer.text();
    let refusal = { error: text };
    try { refusal = JSON.parse(text); } catch { /* plain words */ }
    throw new Refused(refusal.error || `${answer.status} ${answer.statusText}`, refusal.keys);
  }
  return answer;
}

/** Whether an error only means that a newer request replaced this one. */
export const superseded = (error) => error?.name === "AbortError";

export async function ask(kind, path, body) {
  return (await send(kind, path, body)).json();
}

export async function bytes(kind, path, body) {
  return (await send(kind, path, body)).blob();
}

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

/** Passes every line of a streamed response to `take`, parsed. */
export async function stream(kind, path, body, take) {
  const answer = await send(kind, path, body);
  const reader = answer.body.getReader();
  const decoder = new TextDecoder();
  let rest = "";
  for (;;) {
    const { done, value } = await reader.read().catch((error) => { throw superseded(error) ? error : new Refused(ENDED); });
    rest += decoder.decode(value ?? new Uint8Array(), { stream: !done });
    const lines = rest.split("\n");
    rest = lines.pop();
    for (const line of lines) {
      if (!line) continue;
      const message = JSON.parse(line);
      if (message.error) throw new Refused(message.error, message.keys);
      take(message);
    }
    if (done) return;
  }
}
