// A recording: its description, its lanes with their rows, and how far time has come.

import { FRAME } from "./frames.js";
import { Rows } from "./rows.js";
import { instantText } from "./time.js";

/**
 * @typedef {{name: string, part?: string, counts_per_rev?: number | null, counts?: string,
 *   sample?: number}} Axis
 * @typedef {{id: number, axis: string | null, name: string, title: string,
 *   kind: "number" | "line" | "packets" | "marks" | "register", unit?: string, scale?: number, tick: number,
 *   shape?: "steps" | "points"}} LaneRow
 * @typedef {{format: number, vbus: string, board: string, time: string, live: boolean,
 *   control: boolean, origin: string, now: string, axes: Axis[], lanes: LaneRow[],
 *   xy?: string[][], bookmarks?: {at: string, text: string}[]}} Description
 * @typedef {{text: string, kind: string, rule?: string | null, clause?: string | null,
 *   label?: string | null}} Mark
 * @typedef {{lane: number, name: string, title: string, clause: string, group: string, unit: string,
 *   fraction: number, digits: number, moves: boolean, fields: [number, string, string][],
 *   addresses?: number[], signed?: number, access?: string, reset?: number, words?: string[]}} Register
 * @typedef {{name: string, code: number, title: string, clause: string}} Command
 * @typedef {{name: string, part: string, title: string, kind: string, registers: Register[],
 *   addresses: string[][], commands: Command[]}} Chip
 * @typedef {{name: string, title: string, kind: string, section: string, text: string,
 *   named_by: string[]}} Clause
 */

/** What packets are, by the number of their kind; violations have the greatest. */
export const PACKET_KINDS = ["command", "data written", "data read", "status", "other", "violation"];
const RANK = [0, 1, 2, 3, 5, 4];
const COLUMNS = { number: 1, line: 1, packets: 4, marks: 1, register: 1 };
/** Rows a live recording keeps; the oldest go first. */
const KEPT = 48_000_000;

/**
 * One lane. Packets have columns label, kind, length, place of their inner cycles; marks the place of
 * what they say; a line, a number and a register have their value.
 */
export class Lane {
  /**
   * @param {LaneRow} row
   * @param {Axis | null} axis
   */
  constructor(row, axis) {
    this.id = row.id;
    this.axis = axis;
    this.name = row.axis ? `${row.axis}.${row.name}` : row.name;
    this.short = row.name;
    this.title = row.title || row.name;
    this.kind = row.kind;
    this.unit = row.unit ?? "";
    this.scale = row.scale ?? 1;
    this.points = row.shape === "points";
    this.tick = row.tick;
    this.period = BigInt(row.tick);
    this.rows = new Rows(COLUMNS[row.kind], row.kind === "packets" ? 1 : 0);
    /** @type {Mark[]} what marks say, in the order in which they came */
    this.marks = [];
    /** @type {(number[] | 0)[]} cycles of packets between the first and the last, from the first on (ps) */
    this.inner = [];
    /** From where on rows are others than those that were drawn (ps). */
    /** @type {bigint | null} */
    this.touched = null;
    /** The first row that is another one than the list had. */
    this.moved = Infinity;
  }

  /**
   * Return the number of the last row at or before an instant, -1 if there is none.
   * @param {bigint} instant ps
   */
  find(instant) {
    const row = this.rows.find(floorDivide(instant, this.period));
    return row < this.rows.begin ? -1 : row;
  }

  /**
   * Return the instant of a row (ps).
   * @param {number} row
   */
  instant(row) {
    return this.rows.tick(row) * this.period;
  }

  /**
   * Return when a packet ends (ps).
   * @param {number} row
   */
  end(row) {
    return (this.rows.tick(row) + BigInt(this.rows.value(row, 2))) * this.period;
  }

  /**
   * Return what a mark says.
   * @param {number} row
   */
  mark(row) {
    return this.marks[this.rows.value(row)];
  }

  /**
   * Put packets or marks at their place: they may come a little late.
   * @param {bigint} first
   * @param {import("./frames.js").Numbers} ticks
   * @param {import("./frames.js").Numbers[]} columns
   */
  insert(first, ticks, columns) {
    const length = this.rows.length;
    const row = this.rows.insert(first, ticks, columns);
    if (row >= length) return;
    this.moved = Math.min(this.moved, row);
    const instant = this.instant(row);
    if (this.touched === null || instant < this.touched) this.touched = instant;
  }

  /**
   * Return the number the lane has at an instant, scaled; null where it has none.
   * @param {bigint} instant ps
   * @returns {number | null}
   */
  at(instant) {
    const row = this.find(instant);
    if (row < 0) return null;
    const value = this.rows.value(row) * this.scale;
    if (!this.points || row + 1 >= this.rows.length) return value;
    const next = this.rows.value(row + 1) * this.scale;
    const begin = this.instant(row);
    const share = Number(instant - begin) / Number(this.instant(row + 1) - begin);
    return value + (next - value) * share;
  }

  /**
   * Return the least and the greatest number from one instant to another, null if there is none.
   * @param {bigint} begin ps
   * @param {bigint} end ps
   */
  extent(begin, end) {
    const pair = { least: Infinity, most: -Infinity };
    const from = Math.max(this.find(begin), this.rows.begin);
    this.rows.widen(from, this.find(end) + 1, pair);
    if (pair.least > pair.most) return null;
    const { least, most } = pair;
    return this.scale < 0
      ? { least: most * this.scale, most: least * this.scale }
      : { least: least * this.scale, most: most * this.scale };
  }
}

/** Everything that was received or read. */
export class Recording {
  /** @param {Description} description */
  constructor(description) {
    this.description = description;
    this.origin = BigInt(description.origin);
    /** How far time has come (ps); nothing later is shown. */
    this.now = 0n;
    /** @type {string[]} */
    this.labels = [];
    /** @type {string[]} the cycles of a packet, by its label: "w0 1E w1 00" */
    this.cycles = [];
    /** @type {Chip[]} */
    this.chips = [];
    /** @type {Map<string, string>} what values of registers mean, by lane and value */
    this.words = new Map();
    /** @type {Map<string, Clause>} */
    this.clauses = new Map();
    const axes = new Map(description.axes.map((axis) => [axis.name, axis]));
    this.lanes = description.lanes.map(
      (row) => new Lane(row, (row.axis && axes.get(row.axis)) || null),
    );
    /** @type {Map<number, Lane>} */
    this.byId = new Map(this.lanes.map((lane) => [lane.id, lane]));
    /** @type {Map<string, Lane>} */
    this.byName = new Map(this.lanes.map((lane) => [lane.name, lane]));
    this.total = 0;
    /** What is left out of it, in words. */
    this.leftOut = "";
  }

  /**
   * Whether another description tells of the same board and run.
   * @param {Description} other
   */
  same(other) {
    /** @param {Description} one */
    const key = (one) => JSON.stringify([one.board, one.origin, one.axes, one.lanes]);
    return key(this.description) === key(other);
  }

  /** The first instant there is something of (ps). */
  get begin() {
    /** @type {bigint | null} */
    let first = null;
    for (const lane of this.lanes) {
      if (lane.rows.chunks.length) {
        const instant = lane.instant(lane.rows.begin);
        if (first === null || instant < first) first = instant;
      }
    }
    return first === null || first > this.now ? 0n : first;
  }

  /**
   * Take a frame.
   * @param {import("./frames.js").Frame} frame
   */
  take(frame) {
    if (frame.kind === FRAME.labels) {
      for (const label of frame.columns[0]) this.labels.push(String(label));
      for (const cycles of frame.columns[1] ?? []) this.cycles.push(String(cycles));
      return;
    }
    if (frame.kind >= FRAME.chips) {
      this.#takeTable(frame);
      return;
    }
    if (frame.kind === FRAME.now) {
      if (frame.first > this.now) this.now = frame.first;
      return;
    }
    const lane = this.byId.get(frame.lane);
    if (!lane) return;
    const columns = /** @type {import("./frames.js").Numbers[]} */ (frame.columns);
    if (frame.kind === FRAME.samples) {
      lane.rows.append(frame.first, columns[0], [columns[1]]);
    } else if (frame.kind === FRAME.packets) {
      const [begins, lengths, labels, kinds] = columns;
      const inner = /** @type {(number[] | 0)[]} */ (frame.columns[4] ?? []);
      const places = Float64Array.from(begins, (_, number) => lane.inner.length + number);
      for (let number = 0; number < begins.length; number++) lane.inner.push(inner[number] ?? 0);
      lane.insert(frame.first, begins, [labels, kinds.map((kind) => RANK[kind]), lengths, places]);
    } else if (frame.kind === FRAME.marks) {
      const marks = /** @type {Mark[]} */ (frame.columns[1]);
      const places = Float64Array.from(marks, (_, number) => lane.marks.length + number);
      lane.marks.push(...marks);
      lane.insert(frame.first, columns[0], [places]);
      for (const mark of marks) if (mark.kind === "gap") this.leftOut = mark.text;
    }
    this.total += frame.rows;
    if (this.description.live && this.total > KEPT) this.#drop();
  }

  /**
   * Take chips, what values mean, or clauses.
   * @param {import("./frames.js").Frame} frame
   */
  #takeTable(frame) {
    const [rows] = frame.columns;
    if (frame.kind === FRAME.chips) this.chips = /** @type {Chip[]} */ (rows);
    else if (frame.kind === FRAME.words) {
      for (const [lane, value, text] of /** @type {[number, number, string][]} */ (rows)) {
        this.words.set(`${lane} ${value}`, text);
      }
    } else if (frame.kind === FRAME.clauses) {
      for (const clause of /** @type {Clause[]} */ (rows)) this.clauses.set(clause.name, clause);
    }
  }

  #drop() {
    let oldest = null;
    for (const lane of this.lanes) {
      if (lane.kind === "marks" || lane.rows.chunks.length < 2) continue;
      if (!oldest || lane.instant(lane.rows.begin) < oldest.instant(oldest.rows.begin)) oldest = lane;
    }
    if (!oldest) return;
    this.total -= oldest.rows.chunks[0].length;
    oldest.rows.drop();
    const begin = instantText(oldest.instant(oldest.rows.begin));
    this.leftOut = `rows before ${begin} are left out: a page keeps ${KEPT / 1e6} million`;
  }

  /**
   * Return a packet's label.
   * @param {Lane} lane
   * @param {number} row
   */
  label(lane, row) {
    return this.labels[lane.rows.value(row, 0)] ?? "";
  }
}

/**
 * Divide and round towards minus infinity.
 * @param {bigint} number
 * @param {bigint} by positive
 */
export function floorDivide(number, by) {
  const quotient = number / by;
  return number < 0n && quotient * by !== number ? quotient - 1n : quotient;
}
