// A small picture of each study: lines on a field of 48 by 28.

import { drawn } from "./element.js";

const PATHS = {
  approach: ["M4 6 H24 L40 24", "M40 24 C34 22 30 16 26 11"],
  diagram: ["M4 14 H18", "M18 14 C24 6 30 5 34 5", "M18 14 C24 22 30 23 34 23", "M36 3 V25 M39 5 V23 M42 4 V24 M45 6 V22"],
  branches: ["M4 22 C16 22 30 20 34 14 C36 10 30 8 22 8", "M22 8 C12 8 8 6 4 4"],
  resonance: ["M4 24 C14 24 18 22 22 12 C24 4 26 4 28 8 C32 20 36 24 44 24"],
  basin: ["M6 4 H42 V24 H6 Z", "M12 24 C14 16 22 18 24 12 C26 6 34 10 36 4", "M22 24 C26 20 30 20 34 14 C36 11 40 11 42 8"],
  map: ["M6 4 H42 V24 H6 Z", "M6 16 C16 16 20 8 28 10 C34 12 36 20 42 20", "M20 4 C22 8 30 8 42 6"],
  plan: ["M6 4 H42 V24 H6 Z", "M16 8 H34 V20 H16 Z", "M22 14 L25 17 L31 10"],
  levers: ["M4 6 H26 L28 10", "M4 14 H32 L34 18", "M4 22 H20 L22 26"],
  image: ["M4 22 H16 V10 H32 V22 H44", "M4 19 H15 C18 19 17 7 20 7 H31 C35 7 34 19 38 19 H44"],
  data: ["M4 24 C14 24 20 20 26 12 C30 7 36 6 44 6", "M8 22 V26 M14 20 V24 M20 17 V22 M26 10 V15 M32 6 V10 M38 4 V9"],
  simulate: ["M4 14 H8 C12 14 12 3 15 3 C18 3 18 14 22 14 H44", "M10 20 C14 20 16 14 19 18 C21 24 23 24 25 20 C27 16 29 16 31 20 C33 23 35 23 37 20 C39 18 41 19 44 20"],
  events: ["M4 14 H44", "M14 8 V20 M30 8 V20"],
  lyapunov: ["M4 24 C14 22 22 18 28 4", "M4 24 C18 23 34 20 44 16"],
  modes: ["M4 8 C16 8 30 10 44 22", "M4 8 C14 10 20 24 30 18 C36 14 40 8 44 6"],
  sweep: ["M4 24 V4 M4 24 H44", "M8 20 L14 16 L20 17 L26 10 L32 12 L40 6"],
  window: ["M6 4 H42 V24 H6 Z", "M14 10 C22 4 36 8 34 16 C32 22 18 22 14 10 Z"],
  noise: ["M4 14 L8 8 L11 19 L15 11 L18 17 L22 6 L26 20 L29 12 L33 16 L37 9 L41 15 L44 13"],
  fm: ["M4 14 C6 2 10 2 12 14 C14 26 18 26 20 14 C21 6 24 6 25 14 C26 22 29 22 30 14 C31 6 34 6 35 14 C36 22 40 22 44 14"],
  bimodal: ["M4 14 C10 2 16 2 22 14 C28 26 34 26 40 14", "M4 14 C5 9 7 9 8 14 C9 19 11 19 12 14 C13 9 15 9 16 14 C17 19 19 19 20 14 C21 9 23 9 24 14 C25 19 27 19 28 14"],
  "force-curve": ["M4 8 H22 L30 14 L40 2", "M40 2 L26 24 V8"],
  "contact-laws": ["M4 10 H22 C26 10 27 20 30 20 C34 20 36 8 42 2"],
  convergence: ["M6 4 V24 H44", "M10 6 L20 12 L30 18 L40 24"],
};
const USUAL = ["M4 24 V4 M4 24 H44", "M8 20 C18 20 22 8 40 8"];

/** The picture of a study. */
export function picture(name) {
  const drawing = drawn("svg", { viewBox: "0 0 48 28", "aria-hidden": "true" });
  (PATHS[name] ?? USUAL).forEach((d, k) => drawing.append(drawn("path", { d, class: k ? "second" : "first" })));
  return drawing;
}
