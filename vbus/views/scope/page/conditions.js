// The language of conditions, over the lanes of a recording: when one becomes true.
//
//   condition  = both {"or" both}
//   both       = lasting {"and" lasting}
//   lasting    = negation ["stable" "for" TIME]
//   negation   = "not" negation | comparison
//   comparison = event | sum [SIGN sum] | NAME ("rises" | "falls")
//   sum        = operand {("+" | "-") operand}
//   operand    = ["-" | "+"] NUMBER [UNIT] | NAME | [FUNCTION] "(" condition ")"
//   event      = "violation" [NAME] | "command" WORDS

/**
 * @typedef {import("./recording.js").Recording} Recording
 * @typedef {import("./recording.js").Lane} Lane
 * @typedef {(recording: Recording, after: bigint, until: bigint) => bigint | null} Condition
 * @typedef {{lane: Lane, row: number, next: bigint | null, fresh: number[]}} Source
 * @typedef {{value: (when: bigint) => number, units: string[], reset?: () => void}} Node
 */

/** What a condition may be, for people who are about to write one. */
export const CONDITION_FORMS = [
  "x.real > 200", "x.HI == 1", "x.HI rises", "rising(x.error > 20)", "abs(x.error) <= 2 stable for 5 ms",
  "command STT", "x.command == STT", "violation", "violation lm628", "lm628.busy-write", "time >= 2 ms",
  "... and ... or not (...)",
];

const TOKEN = new RegExp(
  String.raw`\s*(?:(?<number>0[xX][0-9a-fA-F]+|[0-9][0-9A-F]*H(?!\w)|[0-9][0-9_]*(?:\.[0-9]+)?(?:[eE][+-]?[0-9]+)?)` +
    String.raw`|(?<name>(?:[^\W\d][\w/~-]*|[/~][\w/~-]*|"[^"]*")(?:\.(?:[\w/~-]+|"[^"]*"))*)` +
    String.raw`|(?<sign><=|>=|==|!=|[<>=+()-]))`,
  "y",
);
const UNIT = /\s*([^\W\d_µ]+(?:\/[^\W\d_]+)?|µs|%)(?!\w)/y;
const WORDS = /\s*("[^"]*"|(?:[^()"]|\([^()"]*\))+?)\s*(?=\b(?:and|or|stable)\b|\)|$)/y;
const KEYWORDS = new Set(["and", "or", "not", "stable", "for", "rises", "falls", "violation", "command"]);
const FUNCTIONS = new Set(["rising", "falling", "changed", "previous", "abs"]);
/** @type {Record<string, bigint>} */
const TIMES = { s: 10n ** 12n, ms: 10n ** 9n, us: 10n ** 6n, µs: 10n ** 6n, ns: 1000n, ps: 1n };
/** @type {Record<string, (one: number, other: number) => boolean>} */
const SIGNS = {
  "<=": (one, other) => one <= other,
  ">=": (one, other) => one >= other,
  "!=": (one, other) => one !== other,
  "==": (one, other) => one === other,
  "=": (one, other) => one === other,
  "<": (one, other) => one < other,
  ">": (one, other) => one > other,
};

/** Reads one text, from left to right. */
class ConditionReader {
  /**
   * @param {string} text
   * @param {Recording} recording
   */
  constructor(text, recording) {
    this.text = text;
    this.recording = recording;
    this.at = 0;
    /** @type {Map<Lane, Source>} */
    this.sources = new Map();
    /** @type {bigint[]} instants at which something may become true though no lane changes */
    this.instants = [];
    /** @type {(() => bigint | null)[]} the same, which come up while it is evaluated */
    this.deadlines = [];
    /** @type {Node[]} */
    this.states = [];
    /** How far back what holds now may have begun (ps). */
    this.back = 0n;
  }

  whole() {
    const node = this.either();
    if (this.look().text) this.wrong("\u201cand\u201d, \u201cor\u201d, a comparison or the end is expected");
    return node;
  }

  /**
   * @param {string} problem
   * @param {number} [at]
   * @returns {never}
   */
  wrong(problem, at = this.at) {
    throw new Error(`${problem} at character ${at + 1} of \u201c${this.text}\u201d`);
  }

  look() {
    TOKEN.lastIndex = this.at;
    const match = TOKEN.exec(this.text);
    if (!match?.groups) {
      if (this.text.slice(this.at).trim()) this.wrong(`\u201c${this.text.slice(this.at).trim()[0]}\u201d has no meaning`);
      return { kind: "end", text: "", end: this.at };
    }
    const kind = match.groups.number ? "number" : match.groups.name ? "name" : "sign";
    return { kind, text: match.groups[kind], end: TOKEN.lastIndex };
  }

  /** @param {string[]} words */
  take(...words) {
    const token = this.look();
    if (!token.text || !words.includes(token.text)) return null;
    this.at = token.end;
    return token.text;
  }

  /** @returns {Node} */
  either() {
    const parts = [this.both()];
    while (this.take("or")) parts.push(this.both());
    if (parts.length === 1) return parts[0];
    // Every part is evaluated, so that each keeps its state.
    return { value: (when) => Number(parts.map((part) => part.value(when)).some((each) => each > 0)), units: [] };
  }

  /** @returns {Node} */
  both() {
    const parts = [this.lasting()];
    while (this.take("and")) parts.push(this.lasting());
    if (parts.length === 1) return parts[0];
    return { value: (when) => Number(parts.map((part) => part.value(when)).every((each) => each > 0)), units: [] };
  }

  /** @returns {Node} */
  lasting() {
    const of = this.negation();
    if (!this.take("stable")) return of;
    if (!this.take("for")) this.wrong("\u201cfor\u201d is expected");
    const number = this.look();
    if (number.kind !== "number") this.wrong("a time is expected");
    this.at = number.end;
    const unit = this.unit();
    if (!(unit in TIMES)) this.wrong("a unit of time is expected");
    const span = BigInt(Math.round(Number(number.text) * Number(TIMES[unit])));
    this.back += span;
    /** @type {bigint | null} */
    let since = null;
    this.deadlines.push(() => since === null ? null : since + span);
    return this.keep({
      value: (when) => {
        if (!(of.value(when) > 0)) since = null;
        else since ??= when;
        return Number(since !== null && when - since >= span);
      },
      units: [],
      reset: () => {
        since = null;
      },
    });
  }

  /** @param {Node} node */
  keep(node) {
    this.states.push(node);
    return node;
  }

  /** @returns {Node} */
  negation() {
    if (!this.take("not")) return this.comparison();
    const of = this.negation();
    return { value: (when) => Number(!(of.value(when) > 0)), units: [] };
  }

  /** @returns {Node} */
  comparison() {
    const begin = this.at;
    const first = this.look();
    if (this.take("violation")) {
      const name = this.look();
      const named = name.kind === "name" && !KEYWORDS.has(name.text);
      if (named) this.at = name.end;
      return this.event("marks", (lane, row) => isViolation(lane, row, named ? name.text : ""));
    }
    if (this.take("command")) {
      WORDS.lastIndex = this.at;
      const match = WORDS.exec(this.text);
      if (!match) this.wrong("the name of a command is expected");
      this.at = WORDS.lastIndex;
      return this.command(match[1].replaceAll('"', "").trim(), "");
    }
    const chip = /^(.+)\.command$/.exec(first.text);
    if (chip && first.kind === "name" && !this.recording.byName.has(first.text)) {
      this.at = first.end;
      if (!this.take("==", "=")) this.wrong("\u201c==\u201d and a command are expected");
      const word = this.look();
      this.at = word.end;
      return this.command(word.text, chip[1]);
    }
    const left = this.sum();
    if (this.take("rises")) return this.edge("rising", left);
    if (this.take("falls")) return this.edge("falling", left);
    const sign = this.take(...Object.keys(SIGNS));
    if (!sign) return left;
    const right = this.sum();
    const units = new Set([...left.units, ...right.units]);
    if (units.size > 1) this.wrong(`${[...units].join(" and ")} cannot be compared`, begin);
    const holds = SIGNS[sign];
    return { value: (when) => Number(holds(left.value(when), right.value(when))), units: [] };
  }

  /** @returns {Node} */
  sum() {
    let node = this.operand();
    for (;;) {
      const sign = this.take("+", "-");
      if (!sign) return node;
      const [left, right] = [node, this.operand()];
      const by = sign === "+" ? 1 : -1;
      node = { value: (when) => left.value(when) + by * right.value(when), units: [...left.units, ...right.units] };
    }
  }

  unit() {
    UNIT.lastIndex = this.at;
    const match = UNIT.exec(this.text);
    if (!match || KEYWORDS.has(match[1])) return "";
    this.at = UNIT.lastIndex;
    return match[1];
  }

  /** @returns {Node} */
  operand() {
    const begin = this.at;
    const negative = this.take("-", "+") === "-";
    const token = this.look();
    if (token.kind === "number") {
      this.at = token.end;
      const hex = /^([0-9A-F]+)H$/.exec(token.text);
      const size = hex ? parseInt(hex[1], 16) : Number(token.text.replaceAll("_", ""));
      const unit = this.unit();
      const number = negative ? -size : size;
      if (!(unit in TIMES)) return { value: () => number, units: unit ? [unit] : [] };
      const ps = number * Number(TIMES[unit]);
      this.instants.push(BigInt(Math.round(ps)) - this.recording.origin);
      return { value: () => ps, units: ["time"] };
    }
    if (token.kind === "name" && FUNCTIONS.has(token.text)) {
      this.at = token.end;
      return this.function(token.text);
    }
    if (this.take("(")) return this.closed();
    if (token.kind !== "name" || KEYWORDS.has(token.text)) this.wrong("a name or a number is expected", begin);
    this.at = token.end;
    return this.name(token.text.replaceAll('"', ""), begin);
  }

  closed() {
    const of = this.either();
    if (!this.take(")")) this.wrong("\u201c)\u201d is expected");
    return of;
  }

  /**
   * @param {string} name
   * @returns {Node}
   */
  function(name) {
    if (!this.take("(")) this.wrong("\u201c(\u201d is expected");
    const of = this.closed();
    if (name === "abs") return { value: (when) => Math.abs(of.value(when)), units: of.units };
    return this.edge(name, of);
  }

  /**
   * @param {string} name
   * @param {Node} of
   * @returns {Node}
   */
  edge(name, of) {
    let last = NaN;
    let before = NaN;
    return this.keep({
      value: (when) => {
        const now = of.value(when);
        const was = last;
        last = now;
        if (now !== was) before = was;
        if (name === "previous") return before;
        if (Number.isNaN(was)) return 0;
        if (name === "changed") return Number(now !== was);
        return Number(name === "rising" ? now > was : now < was);
      },
      units: name === "previous" ? of.units : [],
      reset: () => {
        last = before = NaN;
      },
    });
  }

  /** @param {Lane} lane */
  source(lane) {
    let source = this.sources.get(lane);
    if (!source) this.sources.set(lane, (source = { lane, row: -1, next: null, fresh: [] }));
    return source;
  }

  /**
   * @param {string} name
   * @param {number} begin
   * @returns {Node}
   */
  name(name, begin) {
    const { recording } = this;
    if (name === "time") return { value: (when) => Number(when + recording.origin), units: ["time"] };
    const lane = recording.byName.get(name);
    if (lane && (lane.kind === "number" || lane.kind === "line")) {
      const source = this.source(lane);
      const { rows, scale, unit } = lane;
      return {
        value: () => (source.row < rows.begin ? NaN : rows.value(source.row) * scale),
        units: lane.kind === "number" && unit ? [unit] : [],
      };
    }
    const [chip] = name.split(".");
    if (/^[a-z0-9]+\.[\w-]+$/.test(name) && !recording.lanes.some((each) => each.name.startsWith(`${chip}.`))) {
      return this.rule(name);
    }
    const names = recording.lanes.filter((each) => each.kind === "number" || each.kind === "line");
    return this.wrong(`no lane \u201c${name}\u201d (there are ${names.map((each) => each.name).join(", ")})`, begin);
  }

  /**
   * A rule has been broken, once for all.
   * @param {string} name
   * @returns {Node}
   */
  rule(name) {
    const marks = this.recording.lanes.filter((lane) => lane.kind === "marks");
    const sources = marks.map((lane) => this.source(lane));
    return {
      value: () => Number(sources.some(({ lane, row }) => {
        for (let each = row; each >= lane.rows.begin; each--) if (isViolation(lane, each, name)) return true;
        return false;
      })),
      units: [],
    };
  }

  /**
   * @param {string} words
   * @param {string} chip "" for any
   */
  command(words, chip) {
    const begin = new RegExp(`^${words.replace(/[.*+?^${}()|[\]\\]/g, "\\$&")}(?![A-Za-z0-9_])`);
    const { recording } = this;
    return this.event(
      "packets",
      (lane, row) => begin.test(recording.label(lane, row)) && (!chip || lane.name.split(" ")[0] === chip),
    );
  }

  /**
   * What holds only at the instant at which it happens.
   * @param {"packets" | "marks"} kind
   * @param {(lane: Lane, row: number) => boolean} wanted
   * @returns {Node}
   */
  event(kind, wanted) {
    const lanes = this.recording.lanes.filter((lane) => lane.kind === kind);
    const sources = lanes.map((lane) => this.source(lane));
    return {
      value: () => Number(sources.some(({ lane, fresh }) => fresh.some((row) => wanted(lane, row)))),
      units: [],
    };
  }
}

/**
 * @param {Lane} lane
 * @param {number} row
 * @param {string} name a rule, a family of them, or "" for any
 */
function isViolation(lane, row, name) {
  const { kind, rule } = lane.mark(row);
  return kind === "violation" && (!name || rule === name || Boolean(rule?.startsWith(`${name}.`)));
}

/**
 * Return what a text asks of a recording: the first instant after one, up to another, at which it
 * becomes true. A packet counts from its begin.
 * @param {string} text
 * @param {Recording} recording
 * @returns {Condition}
 */
export function readCondition(text, recording) {
  const reader = new ConditionReader(text, recording);
  const node = reader.whole();
  const sources = [...reader.sources.values()];
  return (_, after, until) => {
    const begin = after - reader.back;
    for (const state of reader.states) state.reset?.();
    for (const source of sources) {
      source.row = source.lane.find(begin);
      source.fresh = [];
      step(source);
    }
    let held = node.value(begin) > 0;
    let at = begin;
    for (;;) {
      /** @type {bigint | null} */
      let next = null;
      const waits = [...reader.instants, ...reader.deadlines.map((deadline) => deadline())];
      for (const instant of [...sources.map((source) => source.next), ...waits]) {
        if (instant !== null && instant > at && (next === null || instant < next)) next = instant;
      }
      if (next === null || next > until) return null;
      at = next;
      for (const source of sources) {
        source.fresh = [];
        while (source.next === at) {
          source.row = Math.max(source.row + 1, source.lane.rows.begin);
          source.fresh.push(source.row);
          step(source);
        }
      }
      const holds = node.value(at) > 0;
      if (holds && !held && at > after) return at;
      // Edges and what happens last for no time: they do not hold until the next instant.
      for (const source of sources) source.fresh = [];
      held = node.value(at) > 0;
    }
  };
}

/** @param {Source} source */
function step(source) {
  const row = Math.max(source.row + 1, source.lane.rows.begin);
  source.next = row < source.lane.rows.length ? source.lane.instant(row) : null;
}
