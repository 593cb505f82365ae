// Frames of a recording: what a WebSocket's messages and a file's inflated bytes are made of.

/**
 * @typedef {Float64Array | Int32Array | Uint8Array} Numbers
 * @typedef {Numbers | unknown[]} Column
 * @typedef {{kind: number, lane: number, rows: number, first: bigint, columns: Column[]}} Frame
 */

/** Kinds of frames. */
export const FRAME = { samples: 1, packets: 2, labels: 3, marks: 4, now: 5, chips: 6, words: 7, clauses: 8 };

const FRAME_HEAD = 16;
const COLUMN_HEAD = 8;

/** Takes bytes as they come and gives whole frames. */
export class FrameReader {
  constructor() {
    /** @type {Uint8Array<ArrayBuffer>} */
    this.bytes = new Uint8Array(0);
  }

  /**
   * Give every frame that is complete with these bytes.
   * @param {Uint8Array<ArrayBuffer>} more
   * @returns {Generator<Frame>}
   */
  *take(more) {
    let bytes = more;
    if (this.bytes.length) {
      bytes = new Uint8Array(this.bytes.length + more.length);
      bytes.set(this.bytes);
      bytes.set(more, this.bytes.length);
    } else if (more.byteOffset % 8) {
      bytes = more.slice();
    }
    const view = new DataView(bytes.buffer, bytes.byteOffset, bytes.length);
    let at = 0;
    for (;;) {
      const end = frameEnd(view, at);
      if (end < 0) break;
      const frame = readFrame(view, at);
      at = end;
      yield frame;
    }
    this.bytes = bytes.slice(at);
  }
}

/**
 * Return where the frame that begins here ends, -1 if not all of it is there.
 * @param {DataView} view
 * @param {number} at
 */
function frameEnd(view, at) {
  if (at + FRAME_HEAD > view.byteLength) return -1;
  const columns = view.getUint8(at + 1);
  let end = at + FRAME_HEAD;
  for (let number = 0; number < columns; number++) {
    if (end + COLUMN_HEAD > view.byteLength) return -1;
    end += COLUMN_HEAD + padded(view.getUint32(end + 4, true));
  }
  return end <= view.byteLength ? end : -1;
}

/** @param {number} size */
function padded(size) {
  return Math.ceil(size / 8) * 8;
}

/**
 * @param {DataView} view
 * @param {number} at
 * @returns {Frame}
 */
function readFrame(view, at) {
  const rows = view.getUint32(at + 4, true);
  /** @type {Frame} */
  const frame = {
    kind: view.getUint8(at),
    lane: view.getUint16(at + 2, true),
    rows,
    first: view.getBigUint64(at + 8, true),
    columns: [],
  };
  const columns = view.getUint8(at + 1);
  let place = at + FRAME_HEAD;
  for (let number = 0; number < columns; number++) {
    const size = view.getUint32(place + 4, true);
    const payload = new Uint8Array(view.buffer, view.byteOffset + place + COLUMN_HEAD, size);
    frame.columns.push(readColumn(view.getUint8(place), payload, rows));
    place += COLUMN_HEAD + padded(size);
  }
  return frame;
}

/**
 * @param {number} type
 * @param {Uint8Array} payload
 * @param {number} rows
 * @returns {Column}
 */
function readColumn(type, payload, rows) {
  const { buffer, byteOffset } = payload;
  switch (type) {
    case 0:
      return new Float64Array(buffer, byteOffset, rows);
    case 1:
      return new Int32Array(buffer, byteOffset, rows);
    case 2:
      return readDifferences(payload, rows);
    case 3:
      return new Uint8Array(buffer, byteOffset, rows);
    case 4:
      return JSON.parse(new TextDecoder().decode(payload));
    default:
      throw new Error(`a column of type ${type}: this page reads types 0 to 4`);
  }
}

/**
 * Undo zig-zag LEB128 varints of first differences. Sums are doubles: exact to 53 bits.
 * @param {Uint8Array} bytes
 * @param {number} rows
 */
function readDifferences(bytes, rows) {
  const values = new Float64Array(rows);
  let at = 0;
  let value = 0;
  for (let row = 0; row < rows; row++) {
    let digit = bytes[at++];
    let coded = digit & 0x7f;
    for (let shift = 7; digit > 127 && shift < 28; shift += 7) {
      digit = bytes[at++];
      coded |= (digit & 0x7f) << shift;
    }
    if (digit <= 127) {
      value += (coded >>> 1) ^ -(coded & 1);
    } else {
      let weight = 2 ** 28;
      while (digit > 127) {
        digit = bytes[at++];
        coded += (digit & 0x7f) * weight;
        weight *= 128;
      }
      value += coded % 2 ? -(coded + 1) / 2 : coded / 2;
    }
    values[row] = value;
  }
  return values;
}
