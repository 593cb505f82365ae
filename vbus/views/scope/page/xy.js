// Two axes as a path: programmed beside actual, the actual one in the colour of its error.

import { numberText, roundNumbers } from "./units.js";

/**
 * @typedef {import("./recording.js").Lane} Lane
 * @typedef {{x: Lane, y: Lane, desiredX: Lane | null, desiredY: Lane | null}} Pair
 * @typedef {{points: Float64Array, desired: Float64Array | null, error: Float64Array,
 *   most: number, instants: bigint[]}} Path
 */

const POINTS = 6000;
const SHADES = 16;

/**
 * Return the points of a path: at every row of its first lane, or at so many equal steps.
 * @param {Pair} pair
 * @param {bigint} begin
 * @param {bigint} end
 * @param {number} factorX
 * @param {number} factorY
 * @returns {Path}
 */
export function pathOf(pair, begin, end, factorX, factorY) {
  const first = Math.max(pair.x.rows.begin, pair.x.find(begin));
  const last = pair.x.find(end);
  /** @type {bigint[]} */
  const instants = [];
  if (last - first < POINTS) {
    for (let row = first; row <= last; row++) {
      const instant = pair.x.instant(row);
      instants.push(instant < begin ? begin : instant);
    }
    if (last >= first) instants.push(end);
  } else {
    const span = end - begin;
    for (let n = 0; n <= POINTS; n++) instants.push(begin + (span * BigInt(n)) / BigInt(POINTS));
  }
  const points = new Float64Array(2 * instants.length);
  const programmed = pair.desiredX && pair.desiredY ? new Float64Array(points.length) : null;
  const error = new Float64Array(instants.length);
  let most = 0;
  for (const [n, instant] of instants.entries()) {
    points[2 * n] = (pair.x.at(instant) ?? NaN) * factorX;
    points[2 * n + 1] = (pair.y.at(instant) ?? NaN) * factorY;
    if (!programmed) continue;
    programmed[2 * n] = (pair.desiredX?.at(instant) ?? NaN) * factorX;
    programmed[2 * n + 1] = (pair.desiredY?.at(instant) ?? NaN) * factorY;
    error[n] = Math.hypot(points[2 * n] - programmed[2 * n], points[2 * n + 1] - programmed[2 * n + 1]);
    if (error[n] > most) most = error[n];
  }
  return { points, desired: programmed, error, most, instants };
}

/**
 * Draw a path.
 * @param {CanvasRenderingContext2D} context
 * @param {Path} path
 * @param {number} at the point to be marked, -1 for none
 * @param {{x: string, y: string, unit: string}} names
 * @param {number} ratio
 * @param {import("./draw.js").Colours} colours
 */
export function drawPath(context, path, at, names, ratio, colours) {
  const { width, height } = context.canvas;
  context.clearRect(0, 0, width, height);
  const left = 52 * ratio;
  const right = 10 * ratio;
  const above = 10 * ratio;
  const below = 58 * ratio;
  let [leastX, mostX, leastY, mostY] = [Infinity, -Infinity, Infinity, -Infinity];
  for (const points of [path.points, path.desired ?? path.points]) {
    for (let n = 0; n < points.length; n += 2) {
      leastX = Math.min(leastX, points[n]);
      mostX = Math.max(mostX, points[n]);
      leastY = Math.min(leastY, points[n + 1]);
      mostY = Math.max(mostY, points[n + 1]);
    }
  }
  context.font = `${11 * ratio}px system-ui, "DejaVu Sans", sans-serif`;
  if (leastX > mostX) return;
  const roomX = width - left - right;
  const roomY = height - above - below;
  // One scale for both: a circle is a circle.
  const size = 1.1 * Math.max((mostX - leastX) / roomX, (mostY - leastY) / roomY) || 1 / roomX;
  const centreX = (leastX + mostX) / 2;
  const centreY = (leastY + mostY) / 2;
  /** @param {number} value */
  const px = (value) => left + roomX / 2 + (value - centreX) / size;
  /** @param {number} value */
  const py = (value) => above + roomY / 2 - (value - centreY) / size;
  context.textBaseline = "middle";
  for (const value of roundNumbers(centreX - (size * roomX) / 2, centreX + (size * roomX) / 2, size * 70 * ratio)) {
    const x = Math.round(px(value));
    context.fillStyle = colours.grid;
    context.fillRect(x, above, 1, roomY);
    context.fillStyle = colours.muted;
    context.textAlign = "center";
    const text = numberText(value, 5);
    const half = context.measureText(text).width / 2;
    context.fillText(text, Math.min(width - half - 2, x), above + roomY + 10 * ratio);
  }
  for (const value of roundNumbers(centreY - (size * roomY) / 2, centreY + (size * roomY) / 2, size * 50 * ratio)) {
    const y = Math.round(py(value));
    context.fillStyle = colours.grid;
    context.fillRect(left, y, roomX, 1);
    context.fillStyle = colours.muted;
    context.textAlign = "right";
    context.fillText(numberText(value, 5), left - 6 * ratio, y);
  }
  context.strokeStyle = colours.strong;
  context.lineWidth = 1;
  context.strokeRect(left + 0.5, above + 0.5, roomX - 1, roomY - 1);
  context.lineJoin = "round";
  if (path.desired) {
    context.strokeStyle = colours.lanes.desired;
    context.lineWidth = 3 * ratio;
    context.globalAlpha = 0.45;
    trace(context, path.desired, px, py);
    context.globalAlpha = 1;
  }
  context.lineWidth = 1.5 * ratio;
  if (path.desired && path.most > 0) {
    for (let shade = 0; shade < SHADES; shade++) {
      context.strokeStyle = shadeColour(shade / (SHADES - 1), colours);
      context.beginPath();
      for (let n = 1; n < path.error.length; n++) {
        if (Math.min(SHADES - 1, Math.floor((path.error[n] / path.most) * SHADES)) !== shade) continue;
        context.moveTo(px(path.points[2 * n - 2]), py(path.points[2 * n - 1]));
        context.lineTo(px(path.points[2 * n]), py(path.points[2 * n + 1]));
      }
      context.stroke();
    }
  } else {
    context.strokeStyle = colours.lanes.real;
    trace(context, path.points, px, py);
  }
  if (at >= 0) {
    context.fillStyle = colours.A;
    context.beginPath();
    context.arc(px(path.points[2 * at]), py(path.points[2 * at + 1]), 4 * ratio, 0, 2 * Math.PI);
    context.fill();
  }
  legend(context, path, names, ratio, colours);
}

/**
 * @param {CanvasRenderingContext2D} context
 * @param {Float64Array} points
 * @param {(value: number) => number} px
 * @param {(value: number) => number} py
 */
function trace(context, points, px, py) {
  context.beginPath();
  for (let n = 0; n < points.length; n += 2) {
    if (n) context.lineTo(px(points[n]), py(points[n + 1]));
    else context.moveTo(px(points[n]), py(points[n + 1]));
  }
  context.stroke();
}

/**
 * @param {CanvasRenderingContext2D} context
 * @param {Path} path
 * @param {{x: string, y: string, unit: string}} names
 * @param {number} ratio
 * @param {import("./draw.js").Colours} colours
 */
function legend(context, path, names, ratio, colours) {
  const { width, height } = context.canvas;
  const y = height - 12 * ratio;
  context.textBaseline = "middle";
  context.textAlign = "left";
  context.fillStyle = colours.muted;
  context.fillText(`${names.x} across, ${names.y} up (${names.unit})`, 52 * ratio, height - 32 * ratio);
  if (!path.desired) return;
  context.fillStyle = colours.lanes.desired;
  context.globalAlpha = 0.45;
  context.fillRect(52 * ratio, y - 1.5 * ratio, 22 * ratio, 3 * ratio);
  context.globalAlpha = 1;
  context.fillStyle = colours.muted;
  context.fillText("desired", 80 * ratio, y);
  context.fillText("error 0", 140 * ratio, y);
  const begin = 140 * ratio + context.measureText("error 0").width + 6 * ratio;
  const size = Math.max(40 * ratio, Math.min(90 * ratio, width - begin - 80 * ratio));
  for (let shade = 0; shade < SHADES; shade++) {
    context.fillStyle = shadeColour(shade / (SHADES - 1), colours);
    context.fillRect(begin + (shade * size) / SHADES, y - 4 * ratio, size / SHADES + 1, 8 * ratio);
  }
  context.fillStyle = colours.muted;
  context.fillText(numberText(path.most, 4), begin + size + 6 * ratio, y);
}

/**
 * Return how far apart in wall time nodes in real time were at an instant, as the one that saw the
 * most of it did (s); null if none has measured that.
 * @param {Lane[]} lanes
 * @param {bigint} instant ps
 */
export function skewAt(lanes, instant) {
  const told = lanes
    .filter((lane) => lane.unit === "s" && /(^|\.)skew$/.test(lane.name))
    .map((lane) => lane.at(instant))
    .filter((skew) => skew !== null);
  return told.length ? Math.max(...told) : null;
}

/**
 * Return the colour of an error, from that of the real position to that of a violation.
 * @param {number} part 0 to 1
 * @param {import("./draw.js").Colours} colours
 */
function shadeColour(part, colours) {
  return mixed(colours.lanes.real, colours.violation, part);
}

/**
 * @param {string} one #rrggbb
 * @param {string} other #rrggbb
 * @param {number} part of the other
 */
function mixed(one, other, part) {
  const channels = [1, 3, 5].map((at) => {
    const a = parseInt(one.slice(at, at + 2), 16);
    const b = parseInt(other.slice(at, at + 2), 16);
    return Math.round(a + (b - a) * part);
  });
  return `rgb(${channels.join(",")})`;
}
