// Compares the answers of the WebAssembly modules with those of the native program, byte for byte:
//   node compare.mjs FOLDER_OF_NATIVE_ANSWERS MODULE.wasm...
// and prints how long each answer took. What the first view asks must not need the second part of a module.

import fs from "node:fs";
import path from "node:path";
import v8 from "node:v8";

// Older versions know fused multiply-add by this name only.
v8.setFlagsFromString("--experimental-wasm-relaxed-simd");

const [folder, ...modules] = process.argv.slice(2);
const QUICK = 1.5; // seconds; a request that takes less is timed twice
const LONG = 0.5;  // seconds; longer native answers are compared with the first module only
// Requests of the first view.
const FIRST = ["/api/about", "/api/motion", "/api/states", "/api/curve", "/api/attractors", "/api/knock", "/api/margins", "/api/force", "/api/law", "/api/choice"];
const read = new TextDecoder();
const write = new TextEncoder();

async function opened(file) {
  const compiled = await WebAssembly.compile(fs.readFileSync(file));
  const second = new WebAssembly.Module(fs.readFileSync(file.replace(/\.wasm$/, "-second.wasm")));
  const core = { lines: [], answer: null, panic: "", parts: 1 };
  const bytes = (start, length) => new Uint8Array(core.memory.buffer, start, length);
  const { exports } = await WebAssembly.instantiate(compiled, { nanotap: {
    now: () => performance.now(),
    line: (start, length) => { core.lines.push(read.decode(bytes(start, length))); },
    second: () => {
      core.parts = 2;
      new WebAssembly.Instance(second, { first: exports });
    },
    panicked: (start, length) => { core.panic = read.decode(bytes(start, length)); },
    reply: (answered, kind, kindLength, start, length) => { core.answer = Buffer.from(bytes(start, length).slice()); },
  } });
  core.memory = exports.memory;
  core.ask = (address, body) => {
    Object.assign(core, { lines: [], answer: null });
    const begun = performance.now();
    const [head, rest] = [write.encode(address), write.encode(JSON.stringify(body))];
    const start = exports.room(head.length + rest.length);
    bytes(start, head.length).set(head);
    bytes(start + head.length, rest.length).set(rest);
    exports.answer(start, head.length + rest.length, head.length);
    // How far a study is depends on the clock.
    const lines = core.lines.filter((line) => !("progress" in JSON.parse(line)));
    const whole = Buffer.concat([Buffer.from(lines.map((line) => `${line}\n`).join("")), core.answer]);
    return [whole, (performance.now() - begun) / 1e3];
  };
  return core;
}

let different = 0;
const native = JSON.parse(fs.readFileSync(path.join(folder, "times.json")));
for (const file of modules) {
  console.log(`\n${path.basename(file)}: seconds native, here, ratio`);
  let core = await opened(file);
  for (const [name, address, body] of JSON.parse(fs.readFileSync(path.join(folder, "requests.json")))) {
    // Other modules differ in one function, which the short answers use as well.
    if (file !== modules[0] && native[name] > LONG) continue;
    let words;
    try {
      let [answer, least] = core.ask(address, body);
      if (least < QUICK) { const [again, time] = core.ask(address, body); [answer, least] = [again, Math.min(least, time)]; }
      if (core.parts > 1 && FIRST.includes(address)) {
        different += 1;
        console.log(`${name} needs the second part, as a first view must not`);
      }
      const same = answer.equals(fs.readFileSync(path.join(folder, name.replaceAll(" ", "-"))));
      if (!same) { different += 1; if (process.env.KEEP) fs.writeFileSync(path.join(process.env.KEEP, name.replaceAll(" ", "-")), answer); }
      words = `${native[name].toFixed(4).padStart(9)} ${least.toFixed(4).padStart(9)} ${(least / native[name]).toFixed(1).padStart(6)}  ${same ? "same" : "DIFFERENT"}`;
    } catch (error) {
      different += 1;
      words = `FAILED: ${core.panic || error}`;
      core = await opened(file);
    }
    if (core.parts > 1 && !FIRST.includes(address)) core = await opened(file);
    console.log(`${name.padEnd(28)} ${words}`);
  }
  console.log(`memory: ${core.memory.buffer.byteLength / 2 ** 20} MiB`);
}
console.log(different ? `${different} answers differ` : "every answer is the native one, byte for byte");
process.exit(different ? 1 : 0);
