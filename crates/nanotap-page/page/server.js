// Requests to the server of `nanotap explore` on this machine. Its address contains a token.

/** The token of the page's address; empty on a page without a server. */
export const token = new URLSearchParams(location.search).get("token") ?? "";

/** Without an answer of the server there is only a TypeError with the browser's words. */
const ended = (error) => { throw error instanceof TypeError ? new Error("nanotap explore has ended; start it again") : error; };

/** Sends a request. Passes the lines of a streamed answer to `line`, if given; returns whether the request
 *  was answered, the media type and the bytes; those of a refusal are JSON. */
export async function send(path, body, signal, line) {
  const given = body !== undefined;
  const answer = await fetch(path, {
    method: given ? "POST" : "GET",
    headers: { "x-nanotap-token": token, ...(given ? { "content-type": "application/json" } : {}) },
    body: given ? JSON.stringify(body) : undefined,
    signal,
  }).catch(ended);
  const kind = answer.headers.get("content-type");
  if (answer.ok && line) await lines(answer.body, line);
  const bytes = answer.ok && line ? new Uint8Array() : new Uint8Array(await answer.arrayBuffer().catch(ended));
  if (answer.ok || kind === "application/json") return { answered: answer.ok, kind, bytes };
  // The server's own refusals are plain words.
  const error = new TextDecoder().decode(bytes) || `${answer.status} ${answer.statusText}`;
  return { answered: false, kind, bytes: new TextEncoder().encode(JSON.stringify({ error })) };
}

async function lines(body, line) {
  const reader = body.pipeThrough(new TextDecoderStream()).getReader();
  let rest = "";
  for (;;) {
    const { done, value } = await reader.read().catch(ended);
    const parts = (rest + (value ?? "")).split("\n");
    rest = parts.pop();
    for (const part of parts) if (part) line(part);
    if (done) return;
  }
}
