// The one renderer: numbers, lines, packets and marks of all lanes on one canvas. It draws at most
// one pair of least and greatest to a column of pixels, and when time moves on it copies what
// there is and draws the new columns only.

import { numberText, roundNumbers } from "./units.js";
import { floorDivide } from "./recording.js";

/**
 * @typedef {import("./recording.js").Lane} Lane
 * @typedef {import("./recording.js").Recording} Recording
 * @typedef {import("./view.js").View} View
 * @typedef {import("./time.js").Ticks} Ticks
 * @typedef {{kind: "axis" | "number" | "line" | "packets" | "marks", lanes: Lane[], name: string,
 *   top: number, height: number, factor: number, unit: string,
 *   range: {least: number, most: number} | null, drawn: bigint | null}} Track
 * @typedef {{surface: string, band: string, grid: string, strong: string, text: string, muted: string,
 *   accent: string, A: string, B: string, violation: string, fault: string, interrupt: string, host: string,
 *   lanes: Record<string, string>, packets: string[], edges: string[]}} Colours
 */

const SANS = 'system-ui, "DejaVu Sans", sans-serif';
const PAD = 7;
/** Lines of numbers are at least so far apart. */
const LINES = 13;
/** What was asked for is a broad line, below that of what came of it. */
const BROAD = new Set(["desired", "profile"]);
/** Packets may stand inside another one; so many back one is looked for that reaches into the view. */
const INSIDE = 32;

/** Draws tracks on a canvas. Sizes are device pixels, those of tracks are CSS pixels. */
export class Plot {
  /**
   * @param {CanvasRenderingContext2D} context
   * @param {CanvasRenderingContext2D} scale of the canvas with the numbers beside it
   * @param {number} ratio device pixels to a CSS pixel
   */
  constructor(context, scale, ratio) {
    this.context = context;
    this.canvas = context.canvas;
    this.scale = scale;
    this.ratio = ratio;
    /** What was drawn last; null if nothing can be used again. */
    /** @type {{start: bigint, scale: number, width: number, height: number, top: number, now: bigint} | null} */
    this.last = null;
    /** Columns drawn since the page was opened, for those who measure. */
    this.columns = 0;
  }

  /** Draw everything next time. */
  forget() {
    this.last = null;
  }

  /**
   * Draw the tracks that are seen.
   * @param {Track[]} tracks
   * @param {Recording} recording
   * @param {View} view
   * @param {Ticks} ticks
   * @param {number} top CSS pixels scrolled down
   * @param {Colours} colours
   */
  draw(tracks, recording, view, ticks, top, colours) {
    const { canvas, context } = this;
    const last = this.last;
    const now = recording.now;
    const kept =
      last !== null &&
      last.scale === view.scale &&
      last.width === canvas.width &&
      last.height === canvas.height &&
      last.top === top &&
      view.start >= last.start &&
      now >= last.now;
    let moved = canvas.width;
    if (last && kept) {
      const shift = view.start - last.start;
      const columns = shift / BigInt(view.scale);
      if (columns * BigInt(view.scale) === shift && columns < BigInt(canvas.width)) {
        moved = Number(columns);
      }
    }
    if (moved && moved < canvas.width) {
      context.globalCompositeOperation = "copy";
      context.drawImage(canvas, -moved, 0);
      context.globalCompositeOperation = "source-over";
    }
    let ranged = false;
    for (const track of tracks) {
      const y = (track.top - top) * this.ratio;
      const height = track.height * this.ratio;
      if (y + height <= 0 || y >= canvas.height) {
        track.drawn = null;
        continue;
      }
      const changed = this.#range(track, view, now);
      ranged ||= changed;
      let from = 0;
      if (moved < canvas.width && !changed && track.drawn !== null) {
        let finished = track.drawn;
        for (const { touched } of track.lanes) if (touched !== null && touched < finished) finished = touched;
        const unfinished = Math.floor(view.x(finished)) - 2;
        from = Math.max(0, Math.min(canvas.width - moved, unfinished));
        if (from >= canvas.width) continue;
      }
      this.#strip(track, recording, view, ticks, y, height, from, colours);
      track.drawn = this.#finished(track, now);
      for (const lane of track.lanes) lane.touched = null;
    }
    const bottom = tracks.length ? tracks[tracks.length - 1].top + tracks[tracks.length - 1].height : 0;
    context.fillStyle = colours.surface;
    context.fillRect(0, (bottom - top) * this.ratio, canvas.width, canvas.height);
    if (ranged || !kept) this.#numbers(tracks, top, colours);
    this.last = { start: view.start, scale: view.scale, width: canvas.width, height: canvas.height, top, now };
  }

  /**
   * Up to where what is drawn stays as it is.
   * @param {Track} track
   * @param {bigint} now
   */
  #finished(track, now) {
    let finished = now;
    for (const lane of track.lanes) {
      if (!lane.rows.length) continue;
      // What follows a point, or runs into the open end of a packet, is drawn when it is known.
      if (lane.points || lane.kind === "packets" || lane.kind === "marks") {
        const instant = lane.instant(lane.rows.length - 1);
        if (instant < finished) finished = instant;
      }
    }
    return finished;
  }

  /**
   * Choose the range of numbers a track shows; say whether it is another one.
   * @param {Track} track
   * @param {View} view
   * @param {bigint} now
   */
  #range(track, view, now) {
    if (track.kind !== "number") return false;
    let least = Infinity;
    let most = -Infinity;
    const end = view.end < now ? view.end : now;
    for (const lane of track.lanes) {
      const found = lane.extent(view.start, end);
      if (found) {
        least = Math.min(least, found.least * track.factor);
        most = Math.max(most, found.most * track.factor);
      }
    }
    if (least > most) {
      if (track.range) return false;
      least = most = 0;
    }
    const old = track.range;
    const size = most - least;
    if (old && least >= old.least && most <= old.most) {
      const room = old.most - old.least;
      if (size > room * 0.5 || (size === 0 && room < Math.abs(most) * 0.5)) return false;
    }
    const margin = size ? size * (view.follow ? 0.18 : 0.06) : Math.abs(most) * 0.1 || 1;
    const range = { least: least - margin, most: most + margin };
    if (old && old.least === range.least && old.most === range.most) return false;
    track.range = range;
    return true;
  }

  /**
   * Draw the columns of one track from one on.
   * @param {Track} track
   * @param {Recording} recording
   * @param {View} view
   * @param {Ticks} ticks
   * @param {number} y
   * @param {number} height
   * @param {number} from
   * @param {Colours} colours
   */
  #strip(track, recording, view, ticks, y, height, from, colours) {
    const { context, canvas } = this;
    const to = canvas.width;
    this.columns += to - from;
    context.save();
    context.beginPath();
    context.rect(from, y, to - from, height);
    context.clip();
    context.fillStyle = track.kind === "axis" ? colours.band : colours.surface;
    context.fillRect(from, y, to - from, height);
    if (track.kind !== "axis") {
      context.fillStyle = colours.grid;
      for (const { at } of ticks.ticks) {
        const x = Math.round(view.x(at));
        if (x >= from && x < to) context.fillRect(x, y, 1, height);
      }
      if (track.kind === "number") {
        for (const { y: line, value } of this.#lines(track, y, height)) {
          context.fillStyle = value === 0 ? colours.strong : colours.grid;
          context.fillRect(from, line, to - from, 1);
        }
      }
    }
    context.fillStyle = colours.grid;
    context.fillRect(from, Math.round(y + height) - 1, to - from, 1);
    const limit = Math.min(to, Math.max(from, Math.ceil(view.x(recording.now))));
    /** @type {Strip} */
    const strip = { context, recording, view, y, height, from, to: limit, ratio: this.ratio, colours };
    for (const lane of track.lanes) {
      if (lane.kind === "number") drawNumber(strip, lane, this.#place(track, y, height), track.factor);
      else if (lane.kind === "line") drawLine(strip, lane);
      else if (lane.kind === "packets") drawPackets(strip, lane);
      else drawMarks(strip, lane);
    }
    context.restore();
  }

  /**
   * Return what makes a value of a track a height on the canvas.
   * @param {Track} track
   * @param {number} y
   * @param {number} height
   * @returns {(value: number) => number}
   */
  #place(track, y, height) {
    const { least, most } = track.range ?? { least: 0, most: 1 };
    const pad = PAD * this.ratio;
    const room = (height - 2 * pad) / (most - least);
    return (value) => y + pad + (most - value) * room;
  }

  /**
   * Return the round numbers of a track and where they are.
   * @param {Track} track
   * @param {number} y
   * @param {number} height
   */
  #lines(track, y, height) {
    if (!track.range) return [];
    const place = this.#place(track, y, height);
    const { least, most } = track.range;
    const apart = ((most - least) / (height / this.ratio - 2 * PAD)) * LINES;
    return roundNumbers(least, most, apart).map((value) => ({ value, y: Math.round(place(value)) }));
  }

  /**
   * Draw the numbers beside the tracks.
   * @param {Track[]} tracks
   * @param {number} top
   * @param {Colours} colours
   */
  #numbers(tracks, top, colours) {
    const context = this.scale;
    const canvas = context.canvas;
    context.clearRect(0, 0, canvas.width, canvas.height);
    context.font = `${11 * this.ratio}px ${SANS}`;
    context.textAlign = "right";
    context.textBaseline = "middle";
    for (const track of tracks) {
      const y = (track.top - top) * this.ratio;
      const height = track.height * this.ratio;
      if (y + height <= 0 || y >= canvas.height) continue;
      context.fillStyle = track.kind === "axis" ? colours.band : colours.surface;
      context.fillRect(0, y, canvas.width, height);
      context.fillStyle = colours.grid;
      context.fillRect(0, Math.round(y + height) - 1, canvas.width, 1);
      if (track.kind !== "number") continue;
      let above = Infinity;
      for (const { value, y: line } of this.#lines(track, y, height)) {
        const half = 6.5 * this.ratio;
        const at = Math.min(y + height - half - 1, Math.max(y + half, line));
        if (above - at < 2 * half) continue;
        above = at;
        context.fillStyle = colours.muted;
        context.fillText(shortNumber(value), canvas.width - 8 * this.ratio, at);
        context.fillStyle = colours.strong;
        context.fillRect(canvas.width - 4 * this.ratio, line, 4 * this.ratio, 1);
      }
    }
  }
}

/**
 * @typedef {{context: CanvasRenderingContext2D, recording: Recording, view: View, y: number,
 *   height: number, from: number, to: number, ratio: number, colours: Colours}} Strip
 */

/** @param {number} value */
function shortNumber(value) {
  const size = Math.abs(value);
  if (size >= 1e6) return `${numberText(value / 1e6, 10)} M`;
  if (size >= 1e5) return `${numberText(value / 1e3, 10)} k`;
  return numberText(value, 10);
}

/**
 * Return what draws on a canvas.
 * @param {HTMLCanvasElement} canvas
 */
export function context2d(canvas) {
  const context = canvas.getContext("2d", { alpha: true });
  if (!context) throw new Error("this browser draws on no canvas");
  return context;
}

/**
 * Return what is needed to place rows of a lane: a tick at or before the left edge, and the rest.
 * @param {Lane} lane
 * @param {View} view
 */
function zeroOf(lane, view) {
  const zero = floorDivide(view.start, lane.period);
  return { zero, rest: Number(view.start - zero * lane.period) };
}

/**
 * Return the rows that matter between two columns: the one before the first, to the one after the last.
 * @param {Lane} lane
 * @param {View} view
 * @param {number} from
 * @param {number} to
 */
function rowsBetween(lane, view, from, to) {
  const first = Math.max(lane.rows.begin, lane.find(view.instant(from)));
  const last = Math.min(lane.rows.length, lane.find(view.instant(to)) + 2);
  return { first, last };
}

/**
 * @param {Strip} strip
 * @param {Lane} lane
 * @param {(value: number) => number} place
 * @param {number} factor
 */
function drawNumber(strip, lane, place, factor) {
  const { context, view, from, to, ratio, colours } = strip;
  if (to <= from || !lane.rows.chunks.length) return;
  const { first, last } = rowsBetween(lane, view, from, to);
  const by = lane.scale * factor;
  const { zero, rest } = zeroOf(lane, view);
  const colour = colours.lanes[lane.short] ?? colours.lanes.other;
  const line = (BROAD.has(lane.short) ? 3.6 : 1.4) * ratio;
  if (last - first > 2 * (to - from) + 4) {
    context.fillStyle = colour;
    context.beginPath();
    const pair = { least: 0, most: 0 };
    lane.rows.walk(zero, to - from, (column) => ((column + from) * view.scale + rest) / lane.tick,
      (column, begin, end) => {
        pair.least = Infinity;
        pair.most = -Infinity;
        lane.rows.widen(Math.max(lane.rows.begin, begin - 1), end, pair);
        if (pair.least > pair.most) return;
        const one = place(pair.most * by);
        const other = place(pair.least * by);
        const high = Math.min(one, other);
        context.rect(column + from, high - line / 2, 1, Math.abs(one - other) + line);
      });
    context.fill();
    return;
  }
  context.strokeStyle = colour;
  context.lineWidth = line;
  context.lineJoin = "round";
  context.beginPath();
  let drawing = false;
  let before = 0;
  const end = view.x(strip.recording.now);
  const wide = (to - from) / Math.max(1, last - first) > 14 * ratio;
  /** @type {[number, number][]} */
  const dots = [];
  lane.rows.each(first, last, zero, (offset, value) => {
    const x = (offset * lane.tick - rest) / view.scale;
    if (x > end) return;
    const y = place(value * by);
    if (Number.isNaN(y)) {
      drawing = false;
      return;
    }
    if (!drawing) context.moveTo(x, y);
    else {
      if (!lane.points) context.lineTo(x, before);
      context.lineTo(x, y);
    }
    if (wide) dots.push([x, y]);
    drawing = true;
    before = y;
  });
  if (drawing && (!lane.points || last === lane.rows.length)) {
    const edge = Math.min(end, to + 4);
    if (!lane.points && edge > 0) context.lineTo(edge, before);
  }
  context.stroke();
  context.fillStyle = colour;
  for (const [x, y] of dots) context.fillRect(x - 1.5 * ratio, y - 1.5 * ratio, 3 * ratio, 3 * ratio);
}

/**
 * @param {Strip} strip
 * @param {Lane} lane
 */
function drawLine(strip, lane) {
  const { context, view, from, to, y, height, ratio, colours } = strip;
  if (to <= from || !lane.rows.chunks.length) return;
  const { first, last } = rowsBetween(lane, view, from, to);
  const { zero, rest } = zeroOf(lane, view);
  const low = Math.round(y + height - 6 * ratio) - 0.5;
  const high = Math.round(y + 6 * ratio) + 0.5;
  const places = [low, high, (low + high) / 2];
  const colour = colours.lanes.line;
  if (last - first > 2 * (to - from) + 4) {
    const pair = { least: 0, most: 0 };
    context.fillStyle = colour;
    context.globalAlpha = 0.6;
    context.beginPath();
    lane.rows.walk(zero, to - from, (column) => ((column + from) * view.scale + rest) / lane.tick,
      (column, begin, end) => {
        pair.least = Infinity;
        pair.most = -Infinity;
        lane.rows.widen(Math.max(lane.rows.begin, begin - 1), end, pair);
        if (pair.least > pair.most) return;
        if (pair.least < pair.most) context.rect(column + from, high, 1, low - high);
        else context.rect(column + from, places[pair.least] - ratio / 2, 1, ratio);
      });
    context.fill();
    context.globalAlpha = 1;
    return;
  }
  context.strokeStyle = colour;
  context.lineWidth = ratio;
  context.beginPath();
  let before = -1;
  let at = 0;
  const end = Math.min(view.x(strip.recording.now), to + 4);
  lane.rows.each(first, last, zero, (offset, value) => {
    const x = Math.round((offset * lane.tick - rest) / view.scale) + 0.5;
    if (x > end + 1) return;
    if (before < 0) context.moveTo(x, places[value]);
    else {
      if (before === 2) context.moveTo(x, places[2]);
      else context.lineTo(x, places[before]);
      context.lineTo(x, places[value]);
    }
    before = value;
    at = x;
  });
  if (before >= 0 && before < 2) context.lineTo(end, places[before]);
  else if (before === 2) context.moveTo(at, places[2]);
  context.stroke();
  // Not driven: broken, in the middle.
  context.save();
  context.setLineDash([2 * ratio, 3 * ratio]);
  context.strokeStyle = colours.muted;
  context.beginPath();
  let open = -Infinity;
  lane.rows.each(first, last, zero, (offset, value) => {
    const x = (offset * lane.tick - rest) / view.scale;
    if (open > -Infinity) {
      context.moveTo(Math.max(open, 0), places[2]);
      context.lineTo(Math.min(x, end), places[2]);
    }
    open = value === 2 ? x : -Infinity;
  });
  if (open > -Infinity) {
    context.moveTo(Math.max(open, 0), places[2]);
    context.lineTo(end, places[2]);
  }
  context.stroke();
  context.restore();
}

/**
 * @param {Strip} strip
 * @param {Lane} lane
 */
function drawPackets(strip, lane) {
  const { context, recording, view, from, to, y, height, ratio, colours } = strip;
  const rows = lane.rows;
  if (to <= from || !rows.chunks.length) return;
  const top = y + 4 * ratio;
  const tall = height - 8 * ratio - 1;
  context.font = `${11.5 * ratio}px ${SANS}`;
  context.textBaseline = "middle";
  context.textAlign = "left";
  const pair = { least: 0, most: 0 };
  /** @type {number[]} */
  const violations = [];
  let row = Math.max(rows.begin, lane.find(view.instant(from)) - INSIDE);
  while (row < rows.length) {
    const x = view.x(lane.instant(row));
    if (x >= to) break;
    const end = view.x(lane.end(row));
    if (end < from - 2) {
      row++;
      continue;
    }
    if (end - x >= 3 * ratio) {
      drawPacket(strip, recording.label(lane, row), rows.value(row, 1), x, end, top, tall);
      row++;
      continue;
    }
    // All that begin in this column are one bar; a violation among them gives it its colour.
    const column = Math.floor(x);
    const next = Math.max(row + 1, lane.find(view.instant(column + 1) - 1n) + 1);
    pair.least = Infinity;
    pair.most = -Infinity;
    rows.widen(row, next, pair);
    if (pair.most === 5) violations.push(column);
    context.fillStyle = colours.edges[next - row > 1 ? 3 : Math.min(4, pair.most)];
    context.fillRect(column, top, Math.max(1, Math.min(2 * ratio, end - x)), tall);
    row = next;
  }
  // Seen among all the others: over them, and a bit higher.
  context.fillStyle = colours.violation;
  for (const column of violations) context.fillRect(column - ratio, top - 2 * ratio, 3 * ratio, tall + 4 * ratio);
}

/**
 * @param {Strip} strip
 * @param {string} label
 * @param {number} kind
 * @param {number} x
 * @param {number} end
 * @param {number} top
 * @param {number} tall
 */
function drawPacket(strip, label, kind, x, end, top, tall) {
  const { context, ratio, colours, from, to } = strip;
  const begins = Math.round(x);
  const left = Math.max(begins, from - 4);
  const right = Math.min(Math.round(end), to + 4);
  context.fillStyle = colours.packets[kind] ?? colours.packets[4];
  context.fillRect(left, top, right - left, tall);
  context.fillStyle = kind === 5 ? colours.violation : (colours.edges[kind] ?? colours.edges[4]);
  context.fillRect(begins, top, Math.round(1.5 * ratio), tall);
  if (kind === 5) context.fillRect(left, top + tall - 2 * ratio, right - left, 2 * ratio);
  const inset = 5 * ratio;
  // A label stays where its packet begins, or at the left edge of what is seen.
  const begin = Math.max(x, 0) + inset;
  const room = end - begin - 3 * ratio;
  if (room < 14 * ratio) return;
  const text = fitted(context, label, room);
  if (!text) return;
  context.fillStyle = colours.text;
  context.fillText(text, begin, top + tall / 2 + 0.5 * ratio);
}

/**
 * Return as much of a text as there is room for.
 * @param {CanvasRenderingContext2D} context
 * @param {string} text
 * @param {number} room
 */
function fitted(context, text, room) {
  if (context.measureText(text).width <= room) return text;
  let low = 0;
  let high = text.length;
  while (low < high) {
    const middle = (low + high + 1) >> 1;
    if (context.measureText(`${text.slice(0, middle)}\u2026`).width <= room) low = middle;
    else high = middle - 1;
  }
  return low > 1 ? `${text.slice(0, low).trimEnd()}\u2026` : "";
}

/**
 * @param {Strip} strip
 * @param {Lane} lane
 */
function drawMarks(strip, lane) {
  const { context, view, from, to, y, height, ratio, colours } = strip;
  const rows = lane.rows;
  if (to <= from || !rows.chunks.length) return;
  context.font = `${11.5 * ratio}px ${SANS}`;
  context.textBaseline = "middle";
  context.textAlign = "left";
  const middle = y + height / 2;
  // The text of a mark before the strip may reach into it.
  let row = Math.max(rows.begin, lane.find(view.instant(from)));
  while (row < rows.length) {
    const x = view.x(lane.instant(row));
    if (x >= to) break;
    const mark = lane.mark(row);
    context.fillStyle = markColour(mark.kind, colours);
    markShape(context, mark.kind, x, middle, 4.5 * ratio);
    const next = Math.max(row + 1, lane.find(view.instant(Math.floor(x) + 1) - 1n) + 1);
    const edge = next < rows.length ? view.x(lane.instant(next)) : Infinity;
    const room = Math.min(edge, view.width + 400) - x - 16 * ratio;
    if (room > 56 * ratio) {
      const text = fitted(context, mark.text, room);
      context.fillStyle = colours.text;
      context.fillText(text, x + 9 * ratio, middle + 0.5 * ratio);
    }
    row = next;
  }
}

/**
 * @param {string} kind
 * @param {Colours} colours
 */
export function markColour(kind, colours) {
  if (kind === "violation") return colours.violation;
  if (kind === "fault" || kind === "gap") return colours.fault;
  if (kind === "interrupt") return colours.interrupt;
  if (kind === "bookmark") return colours.accent;
  if (kind === "node") return colours.strong;
  return colours.host;
}

/**
 * Each kind of mark has its shape, so that no one needs the colour.
 * @param {CanvasRenderingContext2D} context
 * @param {string} kind
 * @param {number} x
 * @param {number} y
 * @param {number} size
 */
function markShape(context, kind, x, y, size) {
  context.beginPath();
  if (kind === "violation") {
    context.moveTo(x, y - size);
    context.lineTo(x + size, y + size);
    context.lineTo(x - size, y + size);
  } else if (kind === "fault") {
    context.moveTo(x, y - size * 1.2);
    context.lineTo(x + size * 1.2, y);
    context.lineTo(x, y + size * 1.2);
    context.lineTo(x - size * 1.2, y);
  } else if (kind === "interrupt") {
    context.rect(x - size / 3, y - size, (2 * size) / 3, 2 * size);
  } else if (kind === "node") {
    context.rect(x - size * 0.8, y - size * 0.8, 1.6 * size, 1.6 * size);
  } else if (kind === "bookmark") {
    context.moveTo(x - size * 0.7, y - size);
    context.lineTo(x + size * 0.7, y - size);
    context.lineTo(x + size * 0.7, y + size);
    context.lineTo(x, y + size * 0.4);
    context.lineTo(x - size * 0.7, y + size);
  } else {
    context.arc(x, y, size * 0.8, 0, 2 * Math.PI);
  }
  context.fill();
}

/**
 * Draw the time axis.
 * @param {CanvasRenderingContext2D} context
 * @param {View} view
 * @param {Ticks} ticks
 * @param {number} ratio
 * @param {Colours} colours
 */
export function drawAxis(context, view, ticks, ratio, colours) {
  const canvas = context.canvas;
  context.clearRect(0, 0, canvas.width, canvas.height);
  context.font = `${11.5 * ratio}px ${SANS}`;
  context.textAlign = "left";
  context.textBaseline = "middle";
  for (const { at, text } of ticks.ticks) {
    const x = Math.round(view.x(at));
    context.fillStyle = colours.strong;
    context.fillRect(x, canvas.height - 7 * ratio, 1, 7 * ratio);
    const width = context.measureText(text).width;
    const left = x - width / 2;
    if (left < 2 * ratio || left + width > canvas.width - 2 * ratio) continue;
    context.fillStyle = colours.muted;
    context.fillText(text, left, canvas.height / 2 - 3 * ratio);
  }
}

/**
 * @typedef {{at: bigint, text: string, colour: string, dashed?: boolean}} Upright
 */

/**
 * Draw cursors and other upright lines over the lanes.
 * @param {CanvasRenderingContext2D} context
 * @param {View} view
 * @param {Upright[]} lines
 * @param {{begin: bigint, end: bigint, colour: string} | null} band
 * @param {number} ratio
 * @param {Colours} colours
 */
export function drawUprights(context, view, lines, band, ratio, colours) {
  const canvas = context.canvas;
  context.clearRect(0, 0, canvas.width, canvas.height);
  if (band) {
    const left = Math.max(-2, view.x(band.begin));
    const right = Math.min(canvas.width + 2, view.x(band.end));
    context.globalAlpha = 0.09;
    context.fillStyle = band.colour;
    context.fillRect(left, 0, right - left, canvas.height);
    context.globalAlpha = 1;
  }
  context.font = `600 ${11 * ratio}px ${SANS}`;
  context.textBaseline = "middle";
  context.textAlign = "center";
  for (const { at, text, colour, dashed } of lines) {
    const x = Math.round(view.x(at));
    if (x < 0 || x >= canvas.width) continue;
    context.strokeStyle = colour;
    context.lineWidth = ratio;
    context.setLineDash(dashed ? [3 * ratio, 3 * ratio] : []);
    context.beginPath();
    context.moveTo(x + 0.5, 0);
    context.lineTo(x + 0.5, canvas.height);
    context.stroke();
    if (!text) continue;
    const width = context.measureText(text).width + 10 * ratio;
    const middle = Math.min(canvas.width - width / 2, Math.max(width / 2, x));
    context.fillStyle = colour;
    context.fillRect(middle - width / 2, 0, width, 16 * ratio);
    context.fillStyle = colours.surface;
    context.fillText(text, middle, 8.5 * ratio);
  }
  context.setLineDash([]);
}

/**
 * Draw one lane and all violations over the whole recording, and frame what is seen of it.
 * @param {CanvasRenderingContext2D} context
 * @param {Recording} recording
 * @param {Lane | null} lane
 * @param {View} whole
 * @param {View} view
 * @param {number} ratio
 * @param {Colours} colours
 */
export function drawOverview(context, recording, lane, whole, view, ratio, colours) {
  const { width, height } = context.canvas;
  context.fillStyle = colours.surface;
  context.fillRect(0, 0, width, height);
  /** @type {Strip} */
  const strip = { context, recording, view: whole, y: 0, height, from: 0, to: width, ratio, colours };
  const range = lane?.extent(whole.start, whole.end);
  if (lane && range) {
    const size = range.most - range.least || 1;
    const room = height - 6 * ratio;
    drawNumber(strip, lane, (value) => 3 * ratio + ((range.most - value) / size) * room, 1);
  }
  for (const marks of recording.lanes) {
    if (marks.kind !== "marks") continue;
    for (let row = 0; row < marks.rows.length; row++) {
      if (marks.mark(row).kind !== "violation") continue;
      const x = Math.floor(whole.x(marks.instant(row)));
      context.fillStyle = colours.violation;
      context.fillRect(x, height - 6 * ratio, ratio, 6 * ratio);
      // The others of this column would be the same.
      row = Math.max(row, marks.find(whole.instant(x + 1) - 1n));
    }
  }
  const left = Math.max(0, whole.x(view.start));
  const right = Math.min(width, Math.max(whole.x(view.end), left + 3 * ratio));
  context.globalAlpha = 0.16;
  context.fillStyle = colours.accent;
  context.fillRect(left, 0, right - left, height);
  context.globalAlpha = 1;
  context.strokeStyle = colours.accent;
  context.lineWidth = ratio;
  context.strokeRect(left + ratio / 2, ratio / 2, Math.max(ratio, right - left - ratio), height - ratio);
}
