// What is in a chip: its registers with their bits, its commands, the clauses of both; and what the
// cycles of a packet did to them.

import { byId, element, Table } from "./table.js";
import { instantText, plainSeconds, spanText } from "./time.js";
import { numberText } from "./units.js";

/**
 * @typedef {import("./app.js").App} App
 * @typedef {import("./recording.js").Lane} Lane
 * @typedef {import("./recording.js").Recording} Recording
 * @typedef {import("./recording.js").Chip} Chip
 * @typedef {import("./recording.js").Register} Register
 * @typedef {import("./recording.js").Command} Command
 * @typedef {{group: string} | {register: Register} | {register: Register, bit: [number, string, string]} |
 *   {command: Command}} Row
 * @typedef {{row: number, instant: bigint | null}} Change
 */

const LIT = "● 1";
const UNLIT = "○ 0";
/** Packets looked at for the last one of each command. */
const LOOKED_AT = 20_000;
/** Changes of a register that are told. */
const TOLD = 6;
/** How long what follows a packet is told of a chip without samples (ps). */
const MILLISECOND = 1_000_000_000n;

/**
 * Return a register's value in the manual's words.
 * @param {Recording} recording
 * @param {Register} register
 * @param {Lane} lane
 * @param {number | null} value
 */
function valueOf(recording, register, lane, value) {
  if (value === null || Number.isNaN(value)) return "–";
  const unit = register.unit ? ` ${register.unit}` : "";
  if (lane.kind === "number") return `${numberText(value, 7)}${unit}`;
  const said = recording.words.get(`${lane.id} ${value}`) ?? register.words?.[value];
  if (said) return said;
  if (register.digits) return hexadecimal(value, register.digits);
  const half = register.signed ? 2 ** (register.signed - 1) : Infinity;
  const number = value >= half ? value - 2 * half : value;
  return `${numberText(number / 2 ** register.fraction, 9)}${unit}`;
}

/** @param {number} value @param {number} digits */
function hexadecimal(value, digits) {
  return `${value.toString(16).toUpperCase().padStart(digits, "0")}H`;
}

/**
 * Whether a bit of a value is set.
 * @param {number | null} value
 * @param {number} bit
 */
function isLit(value, bit) {
  return value !== null && Math.floor(value / 2 ** bit) % 2 === 1;
}

/** @param {number | null} value @param {number} bit */
function lamp(value, bit) {
  if (value === null || Number.isNaN(value)) return "–";
  return isLit(value, bit) ? LIT : UNLIT;
}

/**
 * Tell a clause as `vbus explain` does.
 * @param {HTMLElement} host
 * @param {Recording} recording
 * @param {string | null | undefined} name
 */
export function tellClause(host, recording, name) {
  const clause = name ? recording.clauses.get(name) : undefined;
  if (!clause) return;
  const section = element("section", "clause", host);
  element("h2", "", section).textContent = `${clause.name}: ${clause.title}`;
  element("p", "count", section).textContent = `${clause.kind}: ${clause.section}`;
  for (const paragraph of clause.text.split("\n\n")) {
    if (paragraph.startsWith("|")) {
      element("pre", "", section).textContent = paragraph;
      continue;
    }
    for (const item of paragraph.split(/\n(?=\d+\. |\* )/)) {
      element("p", "", section).textContent = item.split(/\s+/).join(" ");
    }
  }
  for (const line of clause.named_by) element("p", "named", section).textContent = line;
}

/**
 * Return the registers of a chip that changed from one instant on, before another.
 * @param {Recording} recording
 * @param {Chip} chip
 * @param {bigint} begin
 * @param {bigint} end
 */
function changes(recording, chip, begin, end) {
  /** @type {{at: bigint, text: string}[]} */
  const found = [];
  for (const register of chip.registers) {
    const lane = recording.byId.get(register.lane);
    if (register.moves || lane?.kind !== "register") continue;
    const last = lane.find(end - 1n);
    for (let row = Math.max(lane.find(begin - 1n) + 1, lane.rows.begin + 1); row <= last; row++) {
      const [old, now] = [lane.rows.value(row - 1), lane.rows.value(row)];
      if (Number.isNaN(old) || Number.isNaN(now)) continue;
      const bits = register.fields.filter(([bit]) => isLit(old, bit) !== isLit(now, bit));
      const text = bits.length
        ? bits.map(([bit, name]) => `${isLit(now, bit) ? "●" : "○"} ${name}`).join(", ")
        : `${valueOf(recording, register, lane, old)} → ${valueOf(recording, register, lane, now)}`;
      found.push({ at: lane.instant(row), text: `${register.name}: ${text}` });
    }
  }
  return found.sort((one, other) => Number(one.at - other.at));
}

/**
 * Return what a cycle is, as the page of its chip has it.
 * @param {Chip} chip
 * @param {string} cycle such as "w0 1E"
 */
function cycleText(chip, cycle) {
  const [where, data] = cycle.split(" ");
  const write = where.startsWith("w");
  const address = parseInt(where.slice(1), 16);
  const row = chip.addresses.find(([number]) => number === String(address));
  const register = chip.registers.find((each) => each.addresses?.includes(address));
  const what = row ? (write ? row[3] : row[2]) : register?.name;
  const place = `address ${hexadecimal(address, row ? 1 : 2)}`;
  return `${write ? "write" : "read"} ${data}H, ${place}${what ? ` (${what})` : ""}`;
}

/**
 * Tell the cycles of a packet one after the other, and what each changed.
 * @param {HTMLElement} host
 * @param {App} app
 * @param {Lane} lane
 * @param {number} row
 */
export function tellSteps(host, app, lane, row) {
  const { recording } = app;
  const name = lane.short.replace(/ bus$/, "");
  const chip = recording.chips.find((each) => each.name === name);
  const cycles = (recording.cycles[lane.rows.value(row, 0)] ?? "").split(" ");
  if (!chip || cycles.length < 2) return;
  const begin = lane.instant(row);
  const inner = lane.inner[lane.rows.value(row, 3)] || [];
  const instants = [begin, ...inner.map((offset) => begin + BigInt(offset)), lane.end(row)];
  const axis = recording.description.axes.find((each) => each.name.split(".")[0] === name);
  const rest = axis?.sample ? 2n * BigInt(axis.sample) : MILLISECOND;
  const list = element("ol", "steps", host);
  const count = cycles.length / 2;
  for (let number = 0; number < count; number++) {
    const at = instants[number];
    const item = element("li", "", list);
    item.textContent = `${spanText(at - begin)}: ${cycleText(chip, cycles.slice(2 * number, 2 * number + 2).join(" "))}`;
    const end = number + 1 < count ? instants[number + 1] : nextWritten(recording, lane, row, at + rest);
    const changed = changes(recording, chip, at, end);
    if (!changed.length) continue;
    const what = element("ul", "", item);
    for (const change of changed) {
      const after = change.at === at ? "at once" : `after ${spanText(change.at - at)}`;
      element("li", "", what).textContent = `${after}, ${change.text}`;
    }
  }
  const known = chip.registers.some((each) => {
    const held = recording.byId.get(each.lane);
    return held?.kind === "register" && !Number.isNaN(held.at(begin) ?? NaN);
  });
  if (!known) {
    element("p", "count", host).textContent =
      "What it changed is not known: registers of a running board are recorded while the Chip panel is open.";
  }
}

/**
 * Return when the next packet begins that is no status read, an instant at most.
 * @param {Recording} recording
 * @param {Lane} lane
 * @param {number} row
 * @param {bigint} most
 */
function nextWritten(recording, lane, row, most) {
  for (let next = row + 1; next < lane.rows.length; next++) {
    const at = lane.instant(next);
    if (at >= most) break;
    if (recording.cycles[lane.rows.value(next, 0)]?.startsWith("w")) return at;
  }
  return most;
}

/** The registers and commands of one chip at the instant that is looked at. */
export class ChipPanel {
  /** @param {App} app */
  constructor(app) {
    this.app = app;
    /** Has a running board's registers recorded. */
    /** @type {(on: boolean) => void} */
    this.ask = () => {};
    /** @type {Recording | null} */
    this.asked = null;
    this.choice = byId("chip-name", HTMLSelectElement);
    this.search = byId("chip-search", HTMLInputElement);
    this.detail = byId("chip-detail", HTMLElement);
    /** @type {Chip[]} */
    this.chips = [];
    /** @type {Row[]} */
    this.rows = [];
    this.instant = 0n;
    /** @type {bigint | null} when anything changed last */
    this.latest = null;
    /** @type {Map<Command, {at: bigint, text: string}>} */
    this.given = new Map();
    const columns = [
      { title: "register, bit, command", width: "minmax(0, 1fr)" },
      { title: "value", width: "minmax(0, 1fr)" },
      { title: "since (s)", width: "76px", right: true },
    ];
    this.table = new Table(byId("chip-table", HTMLElement), "chip-rows", columns, {
      count: () => this.rows.length,
      cells: (index) => this.#cells(this.rows[index]),
      kind: (index) => this.#kind(this.rows[index]),
      pick: (index) => this.#pick(this.rows[index]),
    });
    this.choice.addEventListener("change", () => this.#list());
    this.search.addEventListener("input", () => this.#list());
  }

  /** The chip that is shown. */
  get chip() {
    return this.chips.find((each) => each.name === this.choice.value) ?? this.chips[0];
  }

  get open() {
    return !byId("chip", HTMLElement).hidden && !byId("side", HTMLElement).hidden;
  }

  update() {
    const { recording } = this.app;
    const wanted = this.open ? recording : null;
    if (wanted !== this.asked) {
      this.asked = wanted;
      this.ask(wanted !== null);
    }
    if (recording.chips !== this.chips) this.#choices();
    if (!this.open || !this.chip) return;
    this.instant = this.app.instant;
    this.latest = null;
    for (const row of this.rows) {
      if (!("register" in row) || "bit" in row || row.register.moves) continue;
      const { instant } = this.#change(row.register);
      if (instant !== null && (this.latest === null || instant > this.latest)) this.latest = instant;
    }
    this.#lastGiven();
    const told = byId("chip-when", HTMLElement);
    const at = instantText(this.instant + recording.origin);
    const ago = this.latest === null ? "" : `; ▸ changed last, ${spanText(this.instant - this.latest)} before`;
    told.textContent = `At ${at}${ago}.`;
    this.table.draw();
  }

  #choices() {
    this.chips = this.app.recording.chips;
    this.choice.replaceChildren();
    for (const { name, part } of this.chips) {
      const option = element("option", "", this.choice);
      option.value = name;
      option.textContent = `${name}: ${part}`;
    }
    this.#list();
  }

  #list() {
    this.rows = [];
    this.detail.replaceChildren();
    this.table.selected = -1;
    const words = this.search.value.toLowerCase().split(/\s+/).filter(Boolean);
    /** @param {...string} texts */
    const found = (...texts) => {
      const text = texts.join(" ").toLowerCase();
      return words.every((word) => text.includes(word));
    };
    let group = "";
    /** @param {string} name */
    const head = (name) => {
      if (name !== group) this.rows.push({ group: name });
      group = name;
    };
    for (const register of this.chip?.registers ?? []) {
      const { name, title, fields } = register;
      const all = found(name, title);
      const bits = fields.filter(([, bit, what]) => all || found(name, bit, what));
      if (!all && !bits.length) continue;
      head(register.group);
      this.rows.push({ register });
      for (const bit of bits) this.rows.push({ register, bit });
    }
    for (const command of this.chip?.commands ?? []) {
      if (!found(command.name, command.title)) continue;
      head("commands, as they were given last");
      this.rows.push({ command });
    }
    this.app.draw();
  }

  /**
   * Return the lane of a register.
   * @param {Register} register
   */
  #lane(register) {
    return this.app.recording.byId.get(register.lane);
  }

  /**
   * Return the row a register has, and since when if that is not from the begin on.
   * @param {Register} register
   * @returns {Change}
   */
  #change(register) {
    const lane = this.#lane(register);
    const row = lane?.find(this.instant) ?? -1;
    if (!lane || row <= lane.rows.begin) return { row, instant: null };
    return { row, instant: Number.isNaN(lane.rows.value(row - 1)) ? null : lane.instant(row) };
  }

  /** Find the last packet of each command. */
  #lastGiven() {
    this.given = new Map();
    const { recording } = this.app;
    const { name, commands } = this.chip;
    const lane = recording.byName.get(`${name} bus`);
    if (!lane || !commands.length) return;
    const byName = new Map(commands.map((command) => [command.name, command]));
    const first = Math.max(lane.rows.begin, lane.find(this.instant) - LOOKED_AT);
    for (let row = lane.find(this.instant); row >= first && byName.size; row--) {
      const label = recording.label(lane, row);
      const end = label.indexOf(" ");
      const mnemonic = end < 0 ? label : label.slice(0, end);
      const command = byName.get(mnemonic);
      if (!command) continue;
      byName.delete(mnemonic);
      const text = label.slice(mnemonic.length).replace(/ {2}\[[^\]]*\]$/, "").trim();
      this.given.set(command, { at: lane.instant(row), text: text || "given" });
    }
  }

  /**
   * @param {Row} row
   * @returns {string[]}
   */
  #cells(row) {
    const { recording } = this.app;
    /** @param {bigint} at */
    const seconds = (at) => plainSeconds(recording.origin + at).slice(0, -5);
    if ("group" in row) return [row.group, "", ""];
    if ("command" in row) {
      const given = this.given.get(row.command);
      const name = `${row.command.name} ${hexadecimal(row.command.code, 2)}`;
      return [name, given?.text ?? "–", given ? seconds(given.at) : ""];
    }
    const { register } = row;
    const lane = this.#lane(register);
    const value = lane?.at(this.instant) ?? null;
    const mark = this.#isLatest(row) ? "▸ " : "";
    if ("bit" in row) {
      const [bit, name, title] = row.bit;
      return [`${mark}  ${name}`, `${lamp(value, bit)}  ${title}`, ""];
    }
    const { instant } = this.#change(register);
    const told = lane ? valueOf(recording, register, lane, value) : "–";
    return [`${mark}${register.name}`, told, instant === null ? "" : seconds(instant)];
  }

  /**
   * Whether a register or a bit is among what changed last.
   * @param {{register: Register, bit?: [number, string, string]}} row
   */
  #isLatest({ register, bit }) {
    const { row, instant } = this.#change(register);
    if (instant === null || instant !== this.latest) return false;
    const rows = this.#lane(register)?.rows;
    return !rows || !bit || isLit(rows.value(row - 1), bit[0]) !== isLit(rows.value(row), bit[0]);
  }

  /** @param {Row} row */
  #kind(row) {
    if ("group" in row) return "group";
    return "register" in row && this.#isLatest(row) ? "changed" : "";
  }

  /** @param {Row} row */
  #pick(row) {
    const { recording } = this.app;
    this.detail.replaceChildren();
    if ("group" in row) return;
    if ("command" in row) {
      const { command } = row;
      element("p", "", this.detail).textContent = `${command.name} (${hexadecimal(command.code, 2)}): ${command.title}`;
      tellClause(this.detail, recording, command.clause);
      return;
    }
    const { register } = row;
    const lane = this.#lane(register);
    const where = register.addresses ? ` (${register.addresses.map((each) => hexadecimal(each, 2)).join(" ")})` : "";
    element("p", "", this.detail).textContent =
      `${register.name}${where}: ${register.title}${register.access ? `, ${register.access}` : ""}`;
    if ("bit" in row) {
      const [bit, name, title] = row.bit;
      element("p", "", this.detail).textContent = `Bit ${bit}, ${name}: ${title}`;
    }
    if (lane?.kind === "register") {
      const list = element("ul", "steps", this.detail);
      const last = lane.find(this.instant);
      for (let at = last; at > lane.rows.begin && at > last - TOLD; at--) {
        const [old, now] = [lane.rows.value(at - 1), lane.rows.value(at)];
        if (Number.isNaN(old) || Number.isNaN(now)) continue;
        element("li", "", list).textContent =
          `${instantText(recording.origin + lane.instant(at))}: ${valueOf(recording, register, lane, old)} → ${valueOf(recording, register, lane, now)}`;
      }
    }
    tellClause(this.detail, recording, register.clause);
  }

  /**
   * Tell what a packet did.
   * @param {Lane} lane
   * @param {bigint} instant
   */
  showPacket(lane, instant) {
    const row = lane.find(instant);
    if (row < lane.rows.begin) return;
    this.choice.value = lane.short.replace(/ bus$/, "");
    this.#list();
    const { recording } = this.app;
    const label = recording.label(lane, row);
    this.app.jump(lane.instant(row), lane.end(row));
    element("p", "", this.detail).textContent = label;
    tellSteps(this.detail, this.app, lane, row);
    tellClause(this.detail, recording, clauseIn(label));
  }
}

/**
 * Return the clause that a packet's label names at its end.
 * @param {string} label
 */
export function clauseIn(label) {
  return /\[([A-Z]+-[A-Z]+-\d+)\]$/.exec(label)?.[1];
}
