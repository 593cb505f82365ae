// What stretch of time is seen: a first instant and whole picoseconds to a pixel, so that every
// column of pixels begins at an exact instant.

const WIDEST = 2 ** 50;

/** Instants are offsets from the recording's tick 0 (ps). */
export class View {
  constructor() {
    this.start = 0n;
    /** ps to a device pixel. */
    this.scale = 1_000_000;
    /** Device pixels. */
    this.width = 1000;
    /** Whether the newest instant stays at the right edge. */
    this.follow = false;
    /** @type {{A: bigint | null, B: bigint | null}} */
    this.cursors = { A: null, B: null };
    /** @type {number | null} where the pointer is, in pixels from the left edge */
    this.pointerX = null;
  }

  /** The instant at the right edge. */
  get end() {
    return this.start + this.span;
  }

  /** The instant the pointer is at. */
  get pointer() {
    return this.pointerX === null ? null : this.instant(this.pointerX);
  }

  get span() {
    return BigInt(this.width) * BigInt(this.scale);
  }

  /**
   * Return the instant at which a column of pixels begins.
   * @param {number} column
   */
  instant(column) {
    return this.start + BigInt(Math.floor(column)) * BigInt(this.scale);
  }

  /**
   * Return where an instant is, in pixels from the left edge.
   * @param {bigint} instant
   */
  x(instant) {
    return Number(instant - this.start) / this.scale;
  }

  /**
   * Change the width; the left edge stays, or the right one while following.
   * @param {number} width device pixels
   */
  resize(width) {
    if (this.follow) this.start += BigInt(this.width - width) * BigInt(this.scale);
    this.width = width;
  }

  /**
   * Show from one instant to another.
   * @param {bigint} begin
   * @param {bigint} end
   */
  show(begin, end) {
    const span = end > begin ? end - begin : 1n;
    const width = BigInt(this.width);
    this.scale = Math.min(WIDEST, Math.max(1, Number((span + width - 1n) / width)));
    this.start = begin;
  }

  /**
   * Show twice, half or any other part of it, around an instant that stays where it is.
   * @param {number} factor of the span
   * @param {bigint} around
   */
  zoom(factor, around) {
    const wanted = Math.round(this.scale * factor);
    // Whole picoseconds: where rounding would leave it, it takes a step nevertheless.
    const step = wanted === this.scale ? Math.sign(factor - 1) : 0;
    const scale = Math.min(WIDEST, Math.max(1, wanted + step));
    const column = this.x(around);
    this.start = around - BigInt(Math.round(column)) * BigInt(scale);
    this.scale = scale;
  }

  /**
   * Move by so many pixels; to later instants if positive.
   * @param {number} columns
   */
  pan(columns) {
    this.start += BigInt(Math.round(columns)) * BigInt(this.scale);
    this.follow = false;
  }

  /**
   * Bring an instant to the middle, unless it is seen already.
   * @param {bigint} instant
   */
  reveal(instant) {
    this.follow = false;
    const x = this.x(instant);
    if (x < this.width * 0.05 || x > this.width * 0.95) this.start = instant - this.span / 2n;
  }

  /**
   * Move on by whole pixels, so that the newest instant is at the right edge.
   * @param {bigint} now
   */
  keepUp(now) {
    const behind = now - this.end;
    const scale = BigInt(this.scale);
    if (behind > 0n) this.start += ((behind + scale - 1n) / scale) * scale;
    else if (-behind > this.span) this.start = now - this.span;
  }
}
