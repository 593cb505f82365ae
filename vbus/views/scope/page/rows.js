// Rows of one lane, in order of time: columns of numbers that grow, found by instant, and the least
// and greatest value of any stretch without looking at each row of it.

/** @typedef {import("./frames.js").Numbers} Numbers */

/** Rows of a chunk; a power of STEP. */
const CHUNK = 65536;
/** Each level of the pyramid has one pair for so many of the level below. */
const STEP = 16;
const LEVELS = 4;
/** Ticks are offsets from their chunk's base; a double holds these exactly. */
const FARTHEST = 2 ** 52;

/** A column that grows, of 32-bit integers until a value does not fit. */
class Growing {
  constructor() {
    /** @type {Int32Array | Float64Array} */
    this.values = new Int32Array(64);
    this.length = 0;
  }

  /**
   * Append some values of a column, each with an offset.
   * @param {Numbers} more
   * @param {number} from
   * @param {number} to
   * @param {number} [offset]
   */
  append(more, from, to, offset = 0) {
    const wanted = this.length + to - from;
    if (wanted > this.values.length) this.#grow(wanted > CHUNK / STEP ? CHUNK : 4 * wanted);
    if (this.values instanceof Int32Array && !fits(more, from, to, offset)) {
      const widened = new Float64Array(this.values.length);
      widened.set(this.values);
      this.values = widened;
    }
    if (offset) add(this.values, this.length, more, from, to, offset);
    else this.values.set(more.subarray(from, to), this.length);
    this.length = wanted;
  }

  /** @param {number} size */
  #grow(size) {
    const values = this.values instanceof Int32Array ? new Int32Array(size) : new Float64Array(size);
    values.set(this.values);
    this.values = values;
  }
}

/**
 * Whether all of some values are 32-bit integers.
 * @param {Numbers} more
 * @param {number} from
 * @param {number} to
 * @param {number} offset
 */
function fits(more, from, to, offset) {
  if (more instanceof Uint8Array || (more instanceof Int32Array && !offset)) return true;
  for (let row = from; row < to; row++) {
    const value = more[row] + offset;
    if (value !== (value | 0)) return false;
  }
  return true;
}

/**
 * @param {Int32Array | Float64Array} values
 * @param {number} at
 * @param {Numbers} more
 * @param {number} from
 * @param {number} to
 * @param {number} offset
 */
function add(values, at, more, from, to, offset) {
  for (let row = from; row < to; row++) values[at++] = more[row] + offset;
}

/** So many rows that follow each other, the ticks of which are offsets from one base. */
class Chunk {
  /**
   * @param {bigint} base
   * @param {number} row number of its first row in the lane
   * @param {number} columns
   */
  constructor(base, row, columns) {
    this.base = base;
    this.row = row;
    this.ticks = new Growing();
    /** @type {Growing[]} */
    this.columns = Array.from({ length: columns }, () => new Growing());
    /** @type {{least: Float64Array, most: Float64Array}[]} */
    this.levels = [];
  }

  get length() {
    return this.ticks.length;
  }

  /** Tick of the last row, from the base. */
  get last() {
    return this.ticks.values[this.length - 1];
  }

  /**
   * Return the number of rows at or before a tick (an offset from the base).
   * @param {number} tick
   * @param {number} [from] rows known to be at or before it
   */
  count(tick, from = 0) {
    const ticks = this.ticks.values;
    let low = from;
    let high = Math.min(from + 8, this.length);
    // The wanted row is often near: look farther and farther first.
    for (let stride = 16; high < this.length && ticks[high - 1] <= tick; stride *= 2) {
      low = high;
      high = Math.min(high + stride, this.length);
    }
    while (low < high) {
      const middle = (low + high) >>> 1;
      if (ticks[middle] <= tick) low = middle + 1;
      else high = middle;
    }
    return low;
  }

  /**
   * Bring the pyramid up to date after rows from this one on were appended.
   * @param {number} from
   * @param {number} column
   */
  build(from, column) {
    const rows = this.columns[column].values;
    let size = this.length;
    let begin = from;
    for (let level = 0; level < LEVELS; level++) {
      const blocks = Math.ceil(size / STEP);
      let here = this.levels[level];
      if (!here || here.least.length < blocks) {
        const grown = Math.min(CHUNK / STEP ** (level + 1), Math.max(4 * blocks, 4));
        const next = { least: new Float64Array(grown), most: new Float64Array(grown) };
        if (here) {
          next.least.set(here.least);
          next.most.set(here.most);
        }
        here = this.levels[level] = next;
      }
      const below = level ? this.levels[level - 1] : null;
      const least = below ? below.least : rows;
      const most = below ? below.most : rows;
      begin = Math.floor(begin / STEP);
      for (let block = begin; block < blocks; block++) {
        let low = Infinity;
        let high = -Infinity;
        for (let at = block * STEP; at < Math.min(block * STEP + STEP, size); at++) {
          if (least[at] < low) low = least[at];
          if (most[at] > high) high = most[at];
        }
        here.least[block] = low;
        here.most[block] = high;
      }
      size = blocks;
    }
  }

  /**
   * Widen a pair by the values of some rows.
   * @param {number} from
   * @param {number} to
   * @param {number} column
   * @param {{least: number, most: number}} pair
   */
  widen(from, to, column, pair) {
    const rows = this.columns[column].values;
    let { least, most } = pair;
    for (let at = from; at < to; ) {
      let size = 1;
      let level = -1;
      while (level + 1 < LEVELS && at % (size * STEP) === 0 && at + size * STEP <= to) {
        size *= STEP;
        level++;
      }
      const low = level < 0 ? rows[at] : this.levels[level].least[at / size];
      const high = level < 0 ? rows[at] : this.levels[level].most[at / size];
      if (low < least) least = low;
      if (high > most) most = high;
      at += size;
    }
    pair.least = least;
    pair.most = most;
  }
}

/** All rows of a lane. */
export class Rows {
  /**
   * @param {number} columns besides the ticks
   * @param {number} ranked the column of which least and greatest are kept
   */
  constructor(columns, ranked = 0) {
    this.columns = columns;
    this.ranked = ranked;
    /** @type {Chunk[]} */
    this.chunks = [];
    /** Rows there have been, those dropped included. */
    this.length = 0;
  }

  /** Number of the first row that is kept. */
  get begin() {
    return this.chunks.length ? this.chunks[0].row : this.length;
  }

  /**
   * Append rows.
   * @param {bigint} first
   * @param {Numbers} ticks from first
   * @param {Numbers[]} columns
   */
  append(first, ticks, columns) {
    let row = 0;
    while (row < ticks.length) {
      let chunk = this.chunks.at(-1);
      let offset = chunk ? Number(first - chunk.base) : 0;
      if (!chunk || chunk.length >= CHUNK || offset + ticks[row] > FARTHEST) {
        chunk = new Chunk(first + BigInt(ticks[row]), this.length, this.columns);
        offset = -ticks[row];
        this.chunks.push(chunk);
      }
      let end = Math.min(ticks.length, row + CHUNK - chunk.length);
      while (offset + ticks[end - 1] > FARTHEST) end--;
      const from = chunk.length;
      chunk.ticks.append(ticks, row, end, offset);
      for (let number = 0; number < this.columns; number++) {
        chunk.columns[number].append(columns[number], row, end);
      }
      chunk.build(from, this.ranked);
      this.length += end - row;
      row = end;
    }
  }

  /**
   * Put rows at their place: after those at the same tick, before later ones.
   * @param {bigint} first
   * @param {Numbers} ticks from first, in order of time
   * @param {Numbers[]} columns
   * @returns {number} the number of the first row that is another one now
   */
  insert(first, ticks, columns) {
    const place = ticks.length ? Math.max(this.begin, this.find(first + BigInt(ticks[0])) + 1) : this.length;
    if (place >= this.length) {
      this.append(first, ticks, columns);
      return place;
    }
    /** @type {[number, ...number[]][]} */
    const rows = Array.from(ticks, (tick, row) => [tick, ...columns.map((each) => each[row])]);
    const moved = rows.length;
    this.each(place, this.length, first, (offset, _, row) => {
      rows.push([offset, ...columns.map((_each, number) => this.value(row, number))]);
    });
    // What was there stays before what comes now.
    const order = rows.map((_, index) => index);
    order.sort((a, b) => rows[a][0] - rows[b][0] || Number(a < moved) - Number(b < moved) || a - b);
    this.#cut(place);
    const sorted = order.map((index) => rows[index]);
    /** @param {number} number */
    const column = (number) => Float64Array.from(sorted, (row) => row[number]);
    this.append(first, column(0), columns.map((_, number) => column(number + 1)));
    return place;
  }

  /**
   * Forget all rows from one on.
   * @param {number} row
   */
  #cut(row) {
    while (this.chunks.length && this.chunks[this.chunks.length - 1].row >= row) this.chunks.pop();
    const chunk = this.chunks.at(-1);
    if (chunk) {
      for (const each of [chunk.ticks, ...chunk.columns]) each.length = Math.min(each.length, row - chunk.row);
    }
    this.length = row;
  }

  /** Forget the oldest rows, one chunk of them. */
  drop() {
    this.chunks.shift();
  }

  /** @param {number} row */
  #chunkOf(row) {
    let low = 0;
    let high = this.chunks.length - 1;
    while (low < high) {
      const middle = (low + high + 1) >>> 1;
      if (this.chunks[middle].row <= row) low = middle;
      else high = middle - 1;
    }
    return low;
  }

  /**
   * Return the number of the last row at or before a tick; one less than the first if there is none.
   * @param {bigint} tick
   */
  find(tick) {
    let low = 0;
    let high = this.chunks.length;
    while (low < high) {
      const middle = (low + high) >>> 1;
      if (this.chunks[middle].base <= tick) low = middle + 1;
      else high = middle;
    }
    if (!low) return this.begin - 1;
    const chunk = this.chunks[low - 1];
    return chunk.row + chunk.count(Number(tick - chunk.base)) - 1;
  }

  /**
   * @param {number} row
   * @returns {bigint}
   */
  tick(row) {
    const chunk = this.chunks[this.#chunkOf(row)];
    return chunk.base + BigInt(chunk.ticks.values[row - chunk.row]);
  }

  /**
   * @param {number} row
   * @param {number} [column]
   */
  value(row, column = 0) {
    const chunk = this.chunks[this.#chunkOf(row)];
    return chunk.columns[column].values[row - chunk.row];
  }

  /**
   * Call for each row from one to another (excluded), with its tick as an offset from an instant.
   * The offset is exact where it is less than 53 bits long.
   * @param {number} from
   * @param {number} to
   * @param {bigint} zero
   * @param {(offset: number, value: number, row: number) => void} take
   * @param {number} [column]
   */
  each(from, to, zero, take, column = 0) {
    if (from >= to) return;
    for (let number = this.#chunkOf(from); number < this.chunks.length; number++) {
      const chunk = this.chunks[number];
      if (chunk.row >= to) break;
      const shift = Number(chunk.base - zero);
      const ticks = chunk.ticks.values;
      const values = chunk.columns[column].values;
      const end = Math.min(chunk.length, to - chunk.row);
      for (let at = Math.max(0, from - chunk.row); at < end; at++) {
        take(ticks[at] + shift, values[at], chunk.row + at);
      }
    }
  }

  /**
   * Widen a pair by the values of rows from one to another (excluded).
   * @param {number} from
   * @param {number} to
   * @param {{least: number, most: number}} pair
   */
  widen(from, to, pair) {
    if (from >= to) return;
    for (let number = this.#chunkOf(from); number < this.chunks.length; number++) {
      const chunk = this.chunks[number];
      if (chunk.row >= to) break;
      chunk.widen(
        Math.max(0, from - chunk.row),
        Math.min(chunk.length, to - chunk.row),
        this.ranked,
        pair,
      );
    }
  }

  /**
   * Walk along columns of equal width: for each, say which rows it has.
   * @param {bigint} zero tick from which edges are counted
   * @param {number} columns
   * @param {(column: number) => number} edge ticks from zero at which a column begins
   * @param {(column: number, from: number, to: number) => void} take
   */
  walk(zero, columns, edge, take) {
    if (!this.chunks.length) return;
    let number = this.#chunkOf(Math.max(this.begin, this.find(zero) - 1));
    let shift = Number(this.chunks[number].base - zero);
    let inside = 0;
    /** @param {number} offset @returns {number} rows before this offset */
    const before = (offset) => {
      // Ticks are whole: "before" is "at or before the greatest whole number below".
      const bound = Math.ceil(offset) - 1;
      while (number < this.chunks.length) {
        const chunk = this.chunks[number];
        const tick = bound - shift;
        if (tick < chunk.last) {
          inside = chunk.count(tick, inside);
          return chunk.row + inside;
        }
        inside = 0;
        if (++number < this.chunks.length) shift = Number(this.chunks[number].base - zero);
      }
      return this.length;
    };
    let from = before(edge(0));
    for (let column = 0; column < columns; column++) {
      const to = before(edge(column + 1));
      take(column, from, to);
      from = to;
    }
  }
}
