// Keeps the files of the page, so that it opens without a network. A new version of the page is loaded while
// the present one is used, and shown at the next visit.

const VERSION = "development"; // `cargo xtask page` states a hash of all files here.
const FILES = ["./"]; // … and the names of the others here.
const PREFIX = "nanotap ";
// The browser runs one of the two modules, each in two parts.
const MODULE = new URL(location.href).searchParams.get("module");
const NAME = `${PREFIX}${registration.scope} ${MODULE} ${VERSION}`;

addEventListener("install", (event) => {
  const requests = [...FILES, `${MODULE}.wasm`, `${MODULE}-second.wasm`].map((file) => new Request(file, { cache: "no-cache" }));
  event.waitUntil(caches.open(NAME).then((cache) => cache.addAll(requests)));
});

addEventListener("activate", (event) => {
  const older = (name) => name.startsWith(`${PREFIX}${registration.scope} `) && name !== NAME;
  event.waitUntil(caches.keys().then((names) => Promise.all(names.filter(older).map((name) => caches.delete(name)))));
});

addEventListener("fetch", (event) => {
  const address = event.request.url.replace(/[?#].*$/, "").replace(/index\.html$/, "");
  const kept = caches.open(NAME).then((cache) => cache.match(address));
  event.respondWith(kept.then((answer) => answer ?? fetch(event.request)));
});
