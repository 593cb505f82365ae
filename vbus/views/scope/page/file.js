// The recording inside a page of one file: inflated and read piece by piece, so that the page is
// there at once and fills while it is read.

import { FrameReader } from "./frames.js";

const PIECE = 1 << 14;
/** How long to read before the page may answer its user, and before it shows what was read (ms). */
const TURN_MS = 24;
const SHOW_MS = 400;

/** The page as it came, before anything was shown in it. */
const source = document.getElementById("recording") ? document.documentElement.cloneNode(true) : null;

/**
 * Return this page with other bookmarks in it.
 * @param {import("./bookmarks.js").Bookmark[]} bookmarks
 */
export function pageWith(bookmarks) {
  if (!(source instanceof HTMLElement)) throw new Error("this page has no recording in it");
  const page = /** @type {HTMLElement} */ (source.cloneNode(true));
  const told = page.querySelector("#description");
  if (told) {
    const description = JSON.stringify({ ...JSON.parse(told.textContent ?? "{}"), bookmarks });
    told.textContent = description.replaceAll("<", "\\u003c");
  }
  return `<!doctype html>\n${page.outerHTML}\n`;
}

/**
 * Return the description in this page, null if it is one of a server.
 * @returns {string | null}
 */
export function embedded() {
  return document.getElementById("description")?.textContent ?? null;
}

/**
 * Read the recording in this page.
 * @param {(frame: import("./frames.js").Frame) => void} take
 * @param {() => void} rest called now and then, so that what was read is shown
 */
export async function readEmbedded(take, rest) {
  const text = (document.getElementById("recording")?.textContent ?? "").replace(/\s+/g, "");
  const reader = new FrameReader();
  const inflated = pieces(text).pipeThrough(new DecompressionStream("deflate-raw")).getReader();
  let begun = performance.now();
  let shown = begun;
  for (;;) {
    const { done, value } = await inflated.read();
    if (done) break;
    for (const frame of reader.take(value)) {
      take(frame);
      if (performance.now() - begun > TURN_MS) {
        if (performance.now() - shown > SHOW_MS) {
          rest();
          shown = performance.now();
        }
        await new Promise((go) => setTimeout(go));
        begun = performance.now();
      }
    }
  }
  rest();
}

/**
 * @param {string} text base64
 * @returns {ReadableStream<Uint8Array<ArrayBuffer>>}
 */
function pieces(text) {
  let at = 0;
  return new ReadableStream({
    pull(controller) {
      if (at >= text.length) {
        controller.close();
        return;
      }
      const binary = atob(text.slice(at, at + PIECE));
      at += PIECE;
      const bytes = new Uint8Array(binary.length);
      for (let number = 0; number < binary.length; number++) bytes[number] = binary.charCodeAt(number);
      controller.enqueue(bytes);
    },
  });
}
