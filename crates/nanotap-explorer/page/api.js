// Requests to the server. Of each kind of request only the newest is active: a new one cancels the
// previous one, and the server stops working on it.

const token = new URLSearchParams(location.search).get("token") ?? "";
const running = new Map();

export class Refused extends Error {}

async function send(kind, path, body) {
  running.get(kind)?.abort();
  const control = new AbortController();
  running.set(kind, control);
  const answer = await fetch(path, {
    method: body === undefined ? "GET" : "POST",
    headers: { "x-nanotap-token": token, ...(body === undefined ? {} : { "content-type": "application/json" }) },
    body: body === undefined ? undefined : JSON.stringify(body),
    signal: control.signal,
  });
  if (!answer.ok) {
    const text = await answer.text();
    let message = text;
    try { message = JSON.parse(text).error ?? text; } catch { /* plain words */ }
    throw new Refused(message || `${answer.status} ${answer.statusText}`);
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
    const { done, value } = await reader.read();
    rest += decoder.decode(value ?? new Uint8Array(), { stream: !done });
    const lines = rest.split("\n");
    rest = lines.pop();
    for (const line of lines) {
      if (!line) continue;
      const message = JSON.parse(line);
      if (message.error) throw new Refused(message.error);
      take(message);
    }
    if (done) return;
  }
}
