// Values as people read them: in counts, in revolutions, or in SI units.

/** @typedef {"counts" | "rev" | "SI"} System */

/** @typedef {{factor: number, unit: string}} Unit */

const TURN = 2 * Math.PI;
const SECOND_PS = 1e12;

/**
 * Return by what a lane's values are multiplied, and the unit they have then.
 * @param {import("./recording.js").Lane} lane
 * @param {System} system
 * @returns {Unit}
 */
export function unitOf(lane, system) {
  const perTurn = lane.axis?.counts_per_rev;
  // A description says how many counts a turn has, not how many microsteps.
  const steps = /^counts\b/.exec(lane.unit);
  if (!steps || !perTurn || system === "counts") return { factor: 1, unit: lane.unit };
  let rest = lane.unit.slice(steps[0].length);
  let factor = (system === "rev" ? 1 : TURN) / perTurn;
  if (rest === "/sample" && lane.axis?.sample) {
    factor *= SECOND_PS / lane.axis.sample;
    rest = "/s";
  }
  return { factor, unit: (system === "rev" ? "rev" : "rad") + rest };
}

/**
 * Return a number with enough digits to read it, no more than are needed.
 * @param {number} value
 * @param {number} [digits]
 */
export function numberText(value, digits = 6) {
  if (!Number.isFinite(value)) return "\u2013";
  if (Number.isInteger(value) && Math.abs(value) < 1e12) return grouped(String(value));
  const size = Math.abs(value);
  if (size >= 1e9 || size < 1e-6) return value.toExponential(digits - 2).replace("-", "\u2212");
  const text = String(+value.toPrecision(digits));
  return grouped(/e/.test(text) ? value.toFixed(12).replace(/0+$/, "") : text);
}

/** @param {string} text */
function grouped(text) {
  const [whole, rest] = text.replace("-", "\u2212").split(".");
  const groups = whole.replace(/\B(?=(\d{3})+$)/g, "\u2009");
  return rest ? `${groups}.${rest}` : groups;
}

/**
 * Return round numbers between two, not nearer to each other than this.
 * @param {number} least
 * @param {number} most
 * @param {number} apart
 */
export function roundNumbers(least, most, apart) {
  if (!(apart > 0) || !Number.isFinite(apart)) return [];
  const power = 10 ** Math.floor(Math.log10(apart));
  const digit = [1, 2, 4, 5, 10].find((each) => each * power >= apart * (1 - 1e-9)) ?? 10;
  const step = digit * power;
  const found = [];
  for (let n = Math.ceil(least / step - 1e-9); n * step <= most + step * 1e-9; n++) {
    found.push(+(n * step).toPrecision(12));
  }
  return found;
}
