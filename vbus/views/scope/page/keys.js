// Everything by the keyboard.

import { byId, element } from "./table.js";

/**
 * @typedef {import("./app.js").App} App
 * @typedef {{keys: string[], name: string, told: string, act: (app: App, event: KeyboardEvent) => void}} Key
 */

/**
 * Let keys do something.
 * @param {App} app
 * @param {Key[]} keys
 */
export function useKeys(app, keys) {
  const list = byId("keys-list", HTMLElement);
  for (const { name, told } of keys) {
    element("dt", "", list).textContent = name;
    element("dd", "", list).textContent = told;
  }
  const byKey = new Map(keys.flatMap((key) => key.keys.map((each) => [each, key])));
  document.addEventListener("keydown", (event) => {
    if (event.ctrlKey || event.metaKey || event.altKey || document.querySelector("dialog[open]")) return;
    const at = event.target;
    // A field of a dialog that has just closed is told of keys until the next frame.
    const asked = at instanceof Element && at.closest("dialog");
    if (!asked && (at instanceof HTMLInputElement || at instanceof HTMLSelectElement)) {
      if (event.key === "Escape") at.blur();
      return;
    }
    if (at instanceof HTMLButtonElement && (event.key === " " || event.key === "Enter")) return;
    const key = byKey.get(event.key);
    if (!key) return;
    event.preventDefault();
    key.act(app, event);
  });
}
