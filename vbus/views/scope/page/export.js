// What is seen, as files: a picture, values, packets, a waveform.

import { bookmarksOf } from "./bookmarks.js";
import { packetOf } from "./list.js";
import { plainSeconds } from "./time.js";

/**
 * @typedef {import("./recording.js").Recording} Recording
 * @typedef {import("./recording.js").Lane} Lane
 */

/**
 * Give the browser a file to save.
 * @param {string} name
 * @param {Blob} blob
 */
export function save(name, blob) {
  const link = document.createElement("a");
  link.href = URL.createObjectURL(blob);
  link.download = name;
  link.click();
  setTimeout(() => URL.revokeObjectURL(link.href), 10_000);
}

/** @param {unknown[]} cells */
function csvLine(cells) {
  return cells
    .map((cell) => {
      const text = String(cell ?? "");
      return /[",\n\r]/.test(text) ? `"${text.replaceAll('"', '""')}"` : text;
    })
    .join(",");
}

/**
 * Return every row of numbers and lines from one instant to another as CSV; the first row of a lane is
 * the value it has at the begin.
 * @param {Recording} recording
 * @param {Lane[]} lanes
 * @param {bigint} begin
 * @param {bigint} end
 * @param {(lane: Lane) => {factor: number, unit: string}} unit
 */
export function valuesCsv(recording, lanes, begin, end, unit) {
  const lines = ["seconds,lane,value,unit"];
  for (const lane of lanes) {
    if (lane.kind !== "number" && lane.kind !== "line") continue;
    const { factor, unit: name } = unit(lane);
    for (let row = Math.max(lane.rows.begin, lane.find(begin)); row <= lane.find(end); row++) {
      const instant = lane.instant(row);
      const value = instant < begin ? lane.at(begin) : lane.rows.value(row) * lane.scale;
      const at = recording.origin + (instant < begin ? begin : instant);
      lines.push(csvLine([plainSeconds(at), lane.name, (value ?? NaN) * factor, name]));
    }
  }
  return lines.join("\n") + "\n";
}

/**
 * Return packets as CSV, with the bookmarks between them.
 * @param {Recording} recording
 * @param {import("./list.js").Found} found
 */
export function packetsCsv(recording, found) {
  const lines = ["seconds,length,chip,kind,packet"];
  const bookmarks = bookmarksOf(recording);
  /** @param {bigint | null} until */
  const tellBookmarks = (until) => {
    while (bookmarks.length && (until === null || BigInt(bookmarks[0].at) <= until)) {
      const [{ at, text }] = bookmarks.splice(0, 1);
      lines.push(csvLine([plainSeconds(recording.origin + BigInt(at)), "", "", "bookmark", text]));
    }
  };
  for (let index = 0; index < found.length; index++) {
    const { begin, end, chip, kind, label } = packetOf(recording, found.entry(index));
    tellBookmarks(begin);
    lines.push(csvLine([plainSeconds(recording.origin + begin), plainSeconds(end - begin), chip, kind, label]));
  }
  tellBookmarks(null);
  return lines.join("\n") + "\n";
}

/**
 * Return marks as CSV.
 * @param {Recording} recording
 * @param {import("./list.js").Found} found
 */
export function marksCsv(recording, found) {
  const lines = ["seconds,kind,rule,clause,text"];
  for (let index = 0; index < found.length; index++) {
    const { lane, row } = found.entry(index);
    const { kind, rule, clause, text } = lane.mark(row);
    lines.push(csvLine([plainSeconds(recording.origin + lane.instant(row)), kind, rule, clause, text]));
  }
  return lines.join("\n") + "\n";
}

/**
 * Return lines and numbers from one instant to another as a VCD waveform.
 * @param {Recording} recording
 * @param {Lane[]} lanes
 * @param {bigint} begin
 * @param {bigint} end
 */
export function waveform(recording, lanes, begin, end) {
  const shown = lanes.filter((lane) => lane.kind === "line" || lane.kind === "number");
  const head = ["$timescale 1 ps $end", "$scope module board $end"];
  /** @type {{at: bigint, text: string}[]} */
  const changes = [];
  for (const [number, lane] of shown.entries()) {
    const code = vcdCode(number);
    const type = lane.kind === "line" ? "wire 1" : "real 64";
    head.push(`$var ${type} ${code} ${lane.name.replaceAll(/\s/g, "_")} $end`);
    for (let row = Math.max(lane.rows.begin, lane.find(begin)); row <= lane.find(end); row++) {
      const value = lane.rows.value(row);
      const text = lane.kind === "line" ? `${"01z"[value] ?? "x"}${code}` : `r${value * lane.scale} ${code}`;
      const instant = lane.instant(row);
      changes.push({ at: instant < begin ? begin : instant, text });
    }
  }
  head.push("$upscope $end", "$enddefinitions $end");
  changes.sort((one, other) => (one.at < other.at ? -1 : one.at > other.at ? 1 : 0));
  let at = null;
  for (const change of changes) {
    if (change.at !== at) head.push(`#${recording.origin + change.at}`);
    at = change.at;
    head.push(change.text);
  }
  head.push(`#${recording.origin + end}`);
  return head.join("\n") + "\n";
}

/** @param {number} number */
function vcdCode(number) {
  return number < 90 ? String.fromCharCode(33 + number) : `~${number.toString(36)}`;
}

let clipPaths = 0;

/** As much of a canvas's context as the renderer uses, which makes SVG. */
export class SvgContext {
  /**
   * @param {number} width
   * @param {number} height
   */
  constructor(width, height) {
    this.canvas = { width, height };
    /** @type {string[]} */
    this.parts = [];
    this.path = "";
    this.fillStyle = "#000";
    this.strokeStyle = "#000";
    this.lineWidth = 1;
    this.lineJoin = "miter";
    this.font = "11px sans-serif";
    this.textAlign = "left";
    this.textBaseline = "middle";
    this.globalAlpha = 1;
    this.globalCompositeOperation = "source-over";
    /** @type {number[]} groups that are open, by save */
    this.open = [0];
    /** @type {number[]} */
    this.dashes = [];
    this.ruler = document.createElement("canvas").getContext("2d");
  }

  save() {
    this.open.push(0);
  }

  restore() {
    for (let count = this.open.pop() ?? 0; count > 0; count--) this.parts.push("</g>");
    this.dashes = [];
  }

  clip() {
    clipPaths++;
    this.parts.push(`<clipPath id="clip${clipPaths}"><path d="${this.path}"/></clipPath>`);
    this.open[this.open.length - 1]++;
    this.parts.push(`<g clip-path="url(#clip${clipPaths})">`);
    this.path = "";
  }

  beginPath() {
    this.path = "";
  }

  /** @param {number} x @param {number} y */
  moveTo(x, y) {
    this.path += `M${short(x)} ${short(y)}`;
  }

  /** @param {number} x @param {number} y */
  lineTo(x, y) {
    this.path += `L${short(x)} ${short(y)}`;
  }

  /** @param {number} x @param {number} y @param {number} width @param {number} height */
  rect(x, y, width, height) {
    this.path += `M${short(x)} ${short(y)}h${short(width)}v${short(height)}h${short(-width)}z`;
  }

  /** A whole circle. @param {number} x @param {number} y @param {number} radius */
  arc(x, y, radius) {
    const r = short(radius);
    this.path += `M${short(x - radius)} ${short(y)}a${r} ${r} 0 1 0 ${short(2 * radius)} 0a${r} ${r} 0 1 0 ${short(-2 * radius)} 0z`;
  }

  fill() {
    this.parts.push(`<path d="${this.path}" fill="${this.fillStyle}" opacity="${this.globalAlpha}"/>`);
  }

  stroke() {
    if (!this.path) return;
    const dash = this.dashes.length ? ` stroke-dasharray="${this.dashes.join(" ")}"` : "";
    this.parts.push(
      `<path d="${this.path}" fill="none" stroke="${this.strokeStyle}" stroke-width="${this.lineWidth}" stroke-linejoin="${this.lineJoin}"${dash}/>`,
    );
  }

  /** @param {number} x @param {number} y @param {number} width @param {number} height */
  fillRect(x, y, width, height) {
    if (width <= 0 || height <= 0) return;
    this.parts.push(
      `<rect x="${short(x)}" y="${short(y)}" width="${short(width)}" height="${short(height)}" fill="${this.fillStyle}" opacity="${this.globalAlpha}"/>`,
    );
  }

  clearRect() {}

  /** @param {number[]} dashes */
  setLineDash(dashes) {
    this.dashes = dashes;
  }

  /** @param {string} text */
  measureText(text) {
    if (!this.ruler) return { width: 7 * text.length };
    this.ruler.font = this.font;
    return this.ruler.measureText(text);
  }

  /** @param {string} text @param {number} x @param {number} y */
  fillText(text, x, y) {
    const [, weight, size, family] = /^(?:(\d+)\s)?([\d.]+)px (.*)$/.exec(this.font) ?? [];
    const anchor = { left: "start", center: "middle", right: "end" }[this.textAlign] ?? "start";
    this.parts.push(
      `<text x="${short(x)}" y="${short(y)}" fill="${this.fillStyle}" font-size="${size}" font-weight="${weight ?? 400}" font-family="${escaped(family)}" text-anchor="${anchor}" dominant-baseline="central">${escaped(text)}</text>`,
    );
  }

  /** Return the elements. */
  text() {
    return this.parts.join("\n");
  }
}

/** @param {number} value */
function short(value) {
  return String(Math.round(value * 100) / 100);
}

/** @param {string} text */
function escaped(text) {
  return text.replaceAll("&", "&amp;").replaceAll("<", "&lt;").replaceAll('"', "&quot;");
}
