// Instants and spans of time as text, exact to the picosecond, and where an axis has its ticks.

const SECOND = 1_000_000_000_000n;
const UNITS = /** @type {const} */ ([
  ["s", 12],
  ["ms", 9],
  ["µs", 6],
  ["ns", 3],
  ["ps", 0],
]);
/** U+2009: groups of three digits. */
const THIN = "\u2009";

/**
 * Return a whole number of ps in a unit, with as many decimals as asked for.
 * @param {bigint} ps
 * @param {number} power of ten of the unit, in ps
 * @param {number} decimals at most `power`; the rest is cut off
 */
function decimal(ps, power, decimals) {
  const digits = (ps < 0n ? -ps : ps).toString().padStart(power + 1, "0");
  const whole = digits.slice(0, digits.length - power);
  const rest = digits.slice(digits.length - power, digits.length - power + decimals);
  const grouped = whole.replace(/\B(?=(\d{3})+$)/g, THIN);
  const fraction = rest ? "." + rest.replace(/(\d{3})(?=\d)/g, `$1${THIN}`) : "";
  return (ps < 0n ? "\u2212" : "") + grouped + fraction;
}

/** @param {string} text */
function trimmed(text) {
  return text.includes(".") ? text.replace(/[0\u2009]+$/, "").replace(/\.$/, "") : text;
}

/**
 * Return an instant in seconds, every digit of it that is not a zero at the end.
 * @param {bigint} ps
 */
export function instantText(ps) {
  return `${trimmed(decimal(ps, 12, 12))} s`;
}

/**
 * Return a span in the unit that suits it, exactly.
 * @param {bigint} ps
 */
export function spanText(ps) {
  const size = ps < 0n ? -ps : ps;
  const [unit, power] = UNITS.find(([, each]) => size >= 10n ** BigInt(each)) ?? ["ps", 0];
  return `${trimmed(decimal(ps, power, power))} ${unit}`;
}

/**
 * Return a span with three or four digits, for places where exact ones would not be read.
 * @param {number} ps
 */
export function roughSpan(ps) {
  const size = Math.abs(ps);
  if (size >= 3600e12) return `${+(ps / 3600e12).toPrecision(4)} h`;
  if (size >= 120e12) return `${+(ps / 60e12).toPrecision(4)} min`;
  const [unit, power] = UNITS.find(([, each]) => size >= 10 ** each) ?? ["ps", 0];
  return `${+(ps / 10 ** power).toPrecision(4)} ${unit}`;
}

/**
 * Return an instant in seconds as a plain decimal for files: no groups, all twelve decimals.
 * @param {bigint} ps
 */
export function plainSeconds(ps) {
  const digits = (ps < 0n ? -ps : ps).toString().padStart(13, "0");
  return `${ps < 0n ? "-" : ""}${digits.slice(0, -12)}.${digits.slice(-12)}`;
}

const CLOCK_STEPS = [1n, 2n, 5n, 10n, 15n, 30n, 60n, 120n, 300n, 600n, 900n, 1800n, 3600n, 7200n,
  10800n, 21600n, 43200n, 86400n];

/**
 * Return the step between ticks: at least so many ps, and a number people count in.
 * @param {bigint} least
 * @returns {bigint}
 */
export function tickStep(least) {
  if (least > SECOND) {
    const days = 86_400n * SECOND;
    const found = CLOCK_STEPS.find((each) => each * SECOND >= least);
    if (found) return found * SECOND;
    return days * tickStep(least / days + 1n);
  }
  let power = 1n;
  for (;;) {
    for (const digit of [1n, 2n, 5n]) if (digit * power >= least) return digit * power;
    power *= 10n;
  }
}

/**
 * @typedef {{at: bigint, text: string}} Tick
 * @typedef {{base: string, step: bigint, ticks: Tick[]}} Ticks
 */

/**
 * Return the ticks from one instant to another. Where they would need many digits they are told from
 * a round instant before them, `base`.
 * @param {bigint} begin
 * @param {bigint} end
 * @param {bigint} step
 * @returns {Ticks}
 */
export function axisTicks(begin, end, step) {
  /** @type {Tick[]} */
  const ticks = [];
  let at = (begin / step) * step;
  if (at < begin) at += step;
  const long = step >= 60n * SECOND || (step >= SECOND && end >= 3600n * SECOND);
  const [unit, power] = UNITS.find(([, each]) => step * 100n >= 10n ** BigInt(each)) ?? ["ps", 0];
  // A round base: the ticks from it have at most four or five digits.
  let round = SECOND;
  while (round > 1n && round / 1000n >= step * 10n) round /= 1000n;
  const far = !long && end / step > 99_999n;
  const base = far ? (begin / (round * 10n)) * (round * 10n) : 0n;
  for (; at <= end; at += step) {
    let text;
    if (long) text = clockText(at);
    else if (far) text = `+${trimmed(decimal(at - base, power, power))} ${unit}`;
    else text = at === 0n ? "0" : `${trimmed(decimal(at, power, power))} ${unit}`;
    ticks.push({ at, text });
  }
  return { base: far ? instantText(base) : "", step, ticks };
}

/** @param {bigint} ps whole seconds */
function clockText(ps) {
  const seconds = ps / SECOND;
  /** @param {bigint} number */
  const two = (number) => number.toString().padStart(2, "0");
  const days = seconds / 86_400n;
  const clock = `${(seconds / 3600n) % 24n}:${two((seconds / 60n) % 60n)}:${two(seconds % 60n)}`;
  return days ? `${days} d ${clock}` : clock;
}
