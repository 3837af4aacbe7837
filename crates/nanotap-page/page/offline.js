// The page without a network: a service worker keeps its files, where the page comes from a web server.

import { alone } from "./api.js";
import { moduleName } from "./workers.js";

export async function begin() {
  const { serviceWorker } = navigator;
  if (!serviceWorker || !location.protocol.startsWith("http")) return;
  if (!alone) {
    // `nanotap explore` may have the port that another server of the page had.
    for (const one of await serviceWorker.getRegistrations()) one.unregister();
    return;
  }
  document.head.append(Object.assign(document.createElement("link"), { rel: "manifest", href: "./manifest.webmanifest" }));
  serviceWorker.register(`./service-worker.js?module=${moduleName()}`).catch(() => { /* The page needs none. */ });
}
