// Packets of all chips in order of time, those that are searched for; and marks likewise.

import { PACKET_KINDS } from "./recording.js";

/**
 * @typedef {import("./recording.js").Recording} Recording
 * @typedef {import("./recording.js").Lane} Lane
 * @typedef {{lane: Lane, row: number}} Entry
 */

/** Rows of all lanes of one kind that a search finds, in order of time; new ones are added. */
export class Found {
  /**
   * @param {"packets" | "marks"} kind
   */
  constructor(kind) {
    this.kind = kind;
    /** @type {Recording | null} */
    this.recording = null;
    /** @type {string[]} lower case; each must be there */
    this.words = [];
    /** @type {Lane[]} */
    this.lanes = [];
    /** @type {number[]} the lane of each */
    this.lane = [];
    /** @type {number[]} the row of each */
    this.row = [];
    /** @type {number[]} rows looked at, by lane */
    this.looked = [];
    /** @type {boolean[]} whether a label is wanted */
    this.wanted = [];
  }

  get length() {
    return this.row.length;
  }

  /**
   * Begin anew.
   * @param {Recording} recording
   * @param {string} search
   */
  search(recording, search) {
    this.recording = recording;
    this.words = search.toLowerCase().split(/\s+/).filter(Boolean);
    this.lanes = recording.lanes.filter((lane) => lane.kind === this.kind);
    this.looked = this.lanes.map((lane) => lane.rows.begin);
    this.lane = [];
    this.row = [];
    this.wanted = [];
    this.more();
  }

  /** Add what has come since. */
  more() {
    const recording = this.recording;
    if (!recording) return;
    this.#forgetMoved();
    const ends = this.lanes.map((lane) => lane.find(recording.now) + 1);
    const [only] = this.lanes;
    if (this.lanes.length === 1) {
      for (let row = this.looked[0]; row < ends[0]; row++) {
        if (this.#holds(only, row)) {
          this.lane.push(0);
          this.row.push(row);
        }
      }
    } else {
      const next = [...this.looked];
      const when = next.map((row, number) => (row < ends[number] ? this.lanes[number].instant(row) : null));
      for (;;) {
        let least = -1;
        for (const [number, instant] of when.entries()) {
          if (instant === null) continue;
          const best = least < 0 ? null : when[least];
          if (best === null || instant < best) least = number;
        }
        if (least < 0) break;
        const lane = this.lanes[least];
        if (this.#holds(lane, next[least])) {
          this.lane.push(least);
          this.row.push(next[least]);
        }
        next[least]++;
        when[least] = next[least] < ends[least] ? lane.instant(next[least]) : null;
      }
    }
    this.looked = ends.map((end, number) => Math.max(end, this.looked[number]));
  }

  /** Look again at what came later than what follows it. */
  #forgetMoved() {
    /** @type {bigint | null} */
    let from = null;
    for (const [number, lane] of this.lanes.entries()) {
      if (lane.moved < this.looked[number]) {
        const instant = lane.instant(lane.moved);
        if (from === null || instant < from) from = instant;
      }
      lane.moved = Infinity;
    }
    if (from === null) return;
    const length = this.before(from - 1n) + 1;
    this.row.length = length;
    this.lane.length = length;
    this.looked = this.lanes.map((lane) => lane.rows.find((from - 1n) / lane.period) + 1);
  }

  /**
   * @param {Lane} lane
   * @param {number} row
   */
  #holds(lane, row) {
    if (!this.words.length) return true;
    if (this.kind === "marks") {
      const { text, kind, rule, clause } = lane.mark(row);
      return this.#all(`${text} ${kind} ${rule ?? ""} ${clause ?? ""}`);
    }
    const label = lane.rows.value(row, 0);
    const known = this.wanted[label];
    if (known !== undefined) return known;
    return (this.wanted[label] = this.#all(this.recording?.labels[label] ?? ""));
  }

  /** @param {string} text */
  #all(text) {
    const small = text.toLowerCase();
    return this.words.every((word) => small.includes(word));
  }

  /**
   * @param {number} index
   * @returns {Entry}
   */
  entry(index) {
    return { lane: this.lanes[this.lane[index]], row: this.row[index] };
  }

  /**
   * Return the number of the last one at or before an instant, -1 if there is none.
   * @param {bigint} instant
   */
  before(instant) {
    let low = 0;
    let high = this.length;
    while (low < high) {
      const middle = (low + high) >> 1;
      const { lane, row } = this.entry(middle);
      if (lane.instant(row) <= instant) low = middle + 1;
      else high = middle;
    }
    return low - 1;
  }
}

/**
 * Return a packet in words.
 * @param {Recording} recording
 * @param {Entry} entry
 */
export function packetOf(recording, { lane, row }) {
  const kind = lane.rows.value(row, 1);
  return {
    begin: lane.instant(row),
    end: lane.end(row),
    chip: lane.axis?.name ?? lane.short.replace(/ bus$/, ""),
    label: recording.label(lane, row),
    kind: PACKET_KINDS[kind] ?? "other",
  };
}
