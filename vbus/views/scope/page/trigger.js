// The trigger: waits for a condition while time goes on, and holds the view.

/**
 * @typedef {import("./recording.js").Recording} Recording
 * @typedef {import("./conditions.js").Condition} Condition
 */

/** Where the instant of a trigger is shown: this part of the width from the left. */
const BEFORE = 0.25;

/** Waits for a condition while time goes on, and holds the view where it became true. */
export class Trigger {
  constructor() {
    /** @type {Condition | null} */
    this.condition = null;
    /** @type {"normal" | "single"} */
    this.mode = "normal";
    /** @type {bigint | null} the last instant at which it became true */
    this.at = null;
    this.looked = 0n;
    this.waiting = false;
  }

  /**
   * Begin to wait.
   * @param {Condition} condition
   * @param {"normal" | "single"} mode
   * @param {bigint} now
   */
  arm(condition, mode, now) {
    this.condition = condition;
    this.mode = mode;
    this.looked = now;
    this.at = null;
    this.waiting = false;
  }

  /** Wait no more. */
  disarm() {
    this.condition = null;
    this.waiting = false;
  }

  /**
   * Look at what is new; move the view when all of it that it will show has come.
   * @param {Recording} recording
   * @param {import("./view.js").View} view
   * @returns {boolean} whether the view was moved
   */
  look(recording, view) {
    if (!this.condition) return false;
    const now = recording.now;
    if (!this.waiting) {
      const at = this.condition(recording, this.looked, now);
      if (at === null) {
        this.looked = now;
        return false;
      }
      this.at = at;
      this.waiting = true;
    }
    if (this.at === null) return false;
    const start = this.at - BigInt(Math.round(view.width * BEFORE)) * BigInt(view.scale);
    if (start + view.span > now) return false;
    view.follow = false;
    view.start = start;
    this.waiting = false;
    this.looked = start + view.span;
    if (this.mode === "single") this.condition = null;
    return true;
  }
}
