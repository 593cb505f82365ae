// Bookmarks: instants with a text. They are a lane of marks, and kept by the server or in the page.

import { Rows } from "./rows.js";
import { byId } from "./table.js";
import { instantText } from "./time.js";

/**
 * @typedef {import("./app.js").App} App
 * @typedef {{at: string, text: string}} Bookmark
 */

const LANE = "bookmarks";

/**
 * Put instants with a text into a recording, in place of those it had.
 * @param {import("./recording.js").Recording} recording
 * @param {Bookmark[]} bookmarks
 */
export function putBookmarks(recording, bookmarks) {
  const lane = recording.byName.get(LANE);
  if (!lane) return;
  lane.rows = new Rows(1);
  lane.marks = [];
  lane.touched = 0n;
  const order = [...bookmarks].sort((one, other) => Number(BigInt(one.at) - BigInt(other.at)));
  for (const { at, text } of order) {
    lane.marks.push({ text, kind: "bookmark" });
    lane.rows.append(BigInt(at), Float64Array.of(0), [Float64Array.of(lane.marks.length - 1)]);
  }
}

/**
 * Return the bookmarks of a recording.
 * @param {import("./recording.js").Recording} recording
 * @returns {Bookmark[]}
 */
export function bookmarksOf(recording) {
  const lane = recording.byName.get(LANE);
  if (!lane) return [];
  return Array.from(lane.marks, ({ text }, row) => ({ at: String(lane.instant(row)), text }));
}

/** Sets bookmarks, and takes them away. */
export class Bookmarks {
  /**
   * @param {App} app
   * @param {() => void} changed is called when there are others
   */
  constructor(app, changed) {
    this.app = app;
    this.changed = changed;
    /** Tells who keeps them; null where the page does. */
    /** @type {((order: Record<string, unknown>) => void) | null} */
    this.keep = null;
    this.unsaved = false;
    this.at = 0n;
    this.dialog = byId("bookmark", HTMLDialogElement);
    this.text = byId("bookmark-text", HTMLInputElement);
    byId("bookmark-form", HTMLFormElement).addEventListener("submit", () => {
      const text = this.text.value.trim();
      if (text) this.#order("bookmark", { at: String(this.at), text });
    });
    byId("bookmark-cancel", HTMLButtonElement).addEventListener("click", () => this.dialog.close());
    window.addEventListener("beforeunload", (event) => {
      if (this.unsaved) event.preventDefault();
    });
  }

  /**
   * Ask for the text of a bookmark.
   * @param {bigint} instant
   */
  ask(instant) {
    const { recording } = this.app;
    this.at = instant < 0n ? 0n : instant > recording.now ? recording.now : instant;
    byId("bookmark-at", HTMLElement).textContent = `At ${instantText(this.at + recording.origin)}`;
    this.text.value = "";
    this.dialog.showModal();
  }

  /** @param {Bookmark} bookmark */
  remove(bookmark) {
    this.#order("forget", bookmark);
  }

  /**
   * @param {"bookmark" | "forget"} what
   * @param {Bookmark} bookmark
   */
  #order(what, bookmark) {
    if (this.keep) {
      this.keep({ do: what, bookmark });
      return;
    }
    const others = bookmarksOf(this.app.recording).filter(({ at, text }) => at !== bookmark.at || text !== bookmark.text);
    this.unsaved = true;
    this.show(what === "forget" ? others : [...others, bookmark]);
  }

  /** @param {Bookmark[]} bookmarks */
  show(bookmarks) {
    putBookmarks(this.app.recording, bookmarks);
    this.changed();
    this.app.draw();
  }
}
