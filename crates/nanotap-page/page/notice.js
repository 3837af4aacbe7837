// The bar that says what a choice changed, and takes it back.

import { local } from "./words.js";

const $ = (id) => document.getElementById(id);
let back = () => {};

/** Shows what changed, and the way back; the bar stays until it is used, closed or replaced. */
export function tell(words, undo) {
  $("notice").hidden = !words;
  $("notice").firstElementChild.textContent = local(words);
  back = undo ?? (() => {});
  $("take-back").hidden = !undo;
}

export function begin() {
  $("take-back").addEventListener("click", () => { const undo = back; tell(""); undo(); });
  $("notice-close").addEventListener("click", () => tell(""));
}
