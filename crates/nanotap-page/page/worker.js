// A worker of the page: one instance of the core, which answers the requests of the page in sequence.

let core = null;
let second = null;            // the second part of the module, once it was needed
let address = "";             // where it is
let panic = "";
const decoder = new TextDecoder();
const encoder = new TextEncoder();
const at = (start, length) => new Uint8Array(core.memory.buffer, start, length);
const text = (start, length) => decoder.decode(at(start, length));

const imports = { nanotap: {
  now: () => performance.now(),
  line: (start, length) => postMessage({ line: text(start, length) }),
  reply: (answered, kind, kindLength, start, length) => {
    const bytes = at(start, length).slice();
    postMessage({ answered: answered === 1, kind: text(kind, kindLength), bytes }, [bytes.buffer]);
  },
  // Functions that the first view does not need; a call waits for them.
  second: () => {
    second ??= loaded();
    new WebAssembly.Instance(second, { first: core });
  },
  panicked: (start, length) => { panic = text(start, length); },
} };

onmessage = ({ data }) => {
  const { module, path, body } = data;
  try {
    address = data.address;
    second ??= data.second;
    core ??= new WebAssembly.Instance(module, imports).exports;
    const [name, rest] = [path, body].map((words) => encoder.encode(words));
    const length = name.length + rest.length;
    const start = core.room(length);
    at(start, name.length).set(name);
    at(start + name.length, rest.length).set(rest);
    core.answer(start, length, name.length);
  } catch (error) {
    postMessage({ failed: `${reason(error)}; the page goes on` });
  }
};

function loaded() {
  const request = new XMLHttpRequest();
  request.open("GET", address, false);
  request.responseType = "arraybuffer";
  request.send();
  if (request.status !== 200) throw new Error(`${address} cannot be loaded: ${request.status} ${request.statusText}`);
  const module = new WebAssembly.Module(request.response);
  // For the next worker.
  postMessage({ second: module });
  return module;
}

/** Why the core is of no use any more. */
function reason(error) {
  if (panic) return `internal error, please report: ${panic}`;
  if (!core) return `the browser has too little memory for this: ${error.message}`;
  const size = Math.round(core.memory.buffer.byteLength / 2 ** 20);
  return `the computation ended with ${size} MiB of memory: ${error.message}`;
}
