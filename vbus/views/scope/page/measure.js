// Measurements of a lane between two instants. Means are over time, not over rows: a value counts
// for as long as it holds.

/**
 * @typedef {import("./recording.js").Lane} Lane
 * @typedef {{least: number, most: number, mean: number, rms: number, peak: number}} Statistics
 * @typedef {{rise: number | null, overshoot: number, settling: number | null}} Step
 * @typedef {{count: number, mean: number, least: number, most: number, deviation: number}} Intervals
 */

/** Parts of a step between which it rises, and within which it has settled. */
const RISE = [0.1, 0.9];
const BAND = 0.02;

/**
 * Call for each piece of a lane between two instants: offsets (ps from the first) and values.
 * @param {Lane} lane
 * @param {bigint} begin
 * @param {bigint} end
 * @param {(from: number, to: number, first: number, last: number) => void} take
 */
function pieces(lane, begin, end, take) {
  const rows = lane.rows;
  const from = Math.max(rows.begin, lane.find(begin));
  const to = Math.min(rows.length, lane.find(end) + (lane.points ? 2 : 1));
  const zero = begin / lane.period;
  const rest = Number(begin - zero * lane.period);
  const span = Number(end - begin);
  let at = NaN;
  let value = NaN;
  rows.each(from, to, zero, (offset, raw) => {
    const instant = offset * lane.tick - rest;
    const next = raw * lane.scale;
    if (!Number.isNaN(at)) piece(at, instant, value, lane.points ? next : value);
    at = instant;
    value = next;
  });
  if (!Number.isNaN(at) && at < span) piece(at, span, value, value);

  /**
   * @param {number} a
   * @param {number} b
   * @param {number} first
   * @param {number} last
   */
  function piece(a, b, first, last) {
    const left = Math.max(a, 0);
    const right = Math.min(b, span);
    if (right < left || (right === left && span > 0 && b > a)) return;
    const slope = b > a ? (last - first) / (b - a) : 0;
    take(left, right, first + (left - a) * slope, first + (right - a) * slope);
  }
}

/**
 * Return least, greatest, mean, RMS and peak of a lane; null if it has nothing there.
 * @param {Lane} lane
 * @param {bigint} begin
 * @param {bigint} end
 * @returns {Statistics | null}
 */
export function statistics(lane, begin, end) {
  let least = Infinity;
  let most = -Infinity;
  let sum = 0;
  let squares = 0;
  let time = 0;
  pieces(lane, begin, end, (from, to, first, last) => {
    least = Math.min(least, first, last);
    most = Math.max(most, first, last);
    const span = to - from;
    sum += (span * (first + last)) / 2;
    squares += (span * (first * first + first * last + last * last)) / 3;
    time += span;
  });
  if (least > most) return null;
  return {
    least,
    most,
    mean: time ? sum / time : least,
    rms: time ? Math.sqrt(squares / time) : Math.abs(least),
    peak: Math.max(Math.abs(least), Math.abs(most)),
  };
}

/**
 * Return how a lane goes from its value at one instant to that at another: rise from 10 to 90 %,
 * overshoot as a part of the step, and when it stays within 2 % of it; null if it is no step.
 * @param {Lane} lane
 * @param {bigint} begin
 * @param {bigint} end
 * @returns {Step | null}
 */
export function stepResponse(lane, begin, end) {
  const initial = lane.at(begin);
  const final = lane.at(end);
  if (initial === null || final === null || initial === final) return null;
  const size = final - initial;
  /** @type {(number | null)[]} */
  const crossed = [null, null];
  let highest = 0;
  /** @type {number | null} */
  let settled = null;
  pieces(lane, begin, end, (from, to, first, last) => {
    const a = (first - initial) / size;
    const b = (last - initial) / size;
    for (const [number, level] of RISE.entries()) {
      if (crossed[number] !== null) continue;
      if (a >= level) crossed[number] = from;
      else if (b >= level) crossed[number] = from + ((level - a) / (b - a)) * (to - from);
    }
    highest = Math.max(highest, a, b);
    if (Math.abs(b - 1) > BAND) settled = null;
    else if (settled === null || Math.abs(a - 1) > BAND) {
      const edge = a < 1 ? 1 - BAND : 1 + BAND;
      settled = Math.abs(a - 1) <= BAND ? from : from + ((edge - a) / (b - a)) * (to - from);
    }
  });
  const [low, high] = crossed;
  return {
    rise: low === null || high === null ? null : high - low,
    overshoot: Math.max(0, highest - 1),
    settling: settled,
  };
}

/**
 * Return how long it is from the begin of a packet to the begin of the next (ps); null if there are
 * fewer than two. The jitter is `most - least`.
 * @param {Lane} lane
 * @param {bigint} begin
 * @param {bigint} end
 * @param {(row: number) => boolean} [wanted]
 * @returns {Intervals | null}
 */
export function intervals(lane, begin, end, wanted = () => true) {
  const from = lane.find(begin - 1n) + 1;
  const to = lane.find(end) + 1;
  let before = NaN;
  let count = 0;
  let mean = 0;
  let squares = 0;
  let least = Infinity;
  let most = -Infinity;
  lane.rows.each(Math.max(from, lane.rows.begin), to, begin / lane.period, (offset, _, row) => {
    if (!wanted(row)) return;
    const instant = offset * lane.tick;
    if (!Number.isNaN(before)) {
      const span = instant - before;
      count++;
      const apart = span - mean;
      mean += apart / count;
      squares += apart * (span - mean);
      least = Math.min(least, span);
      most = Math.max(most, span);
    }
    before = instant;
  });
  if (!count) return null;
  return { count: count + 1, mean, least, most, deviation: Math.sqrt(squares / count) };
}
