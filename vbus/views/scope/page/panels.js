// The panel beside the lanes: packets, marks, measurements, the path of two axes, the trigger.

import { clauseIn, tellClause, tellSteps } from "./chip.js";
import { CONDITION_FORMS, readCondition } from "./conditions.js";
import { context2d } from "./draw.js";
import { marksCsv, packetsCsv, save } from "./export.js";
import { Found, packetOf } from "./list.js";
import { intervals, statistics, stepResponse } from "./measure.js";
import { byId, element, Table } from "./table.js";
import { instantText, plainSeconds, roughSpan, spanText } from "./time.js";
import { numberText, unitOf } from "./units.js";
import { drawPath, pathOf, skewAt } from "./xy.js";

/**
 * @typedef {import("./app.js").App} App
 * @typedef {import("./recording.js").Lane} Lane
 */

/** Tabs, of which one panel is seen. */
export class Tabs {
  /** @param {App} app */
  constructor(app) {
    this.app = app;
    this.tabs = [...document.querySelectorAll('[role="tab"]')].filter((tab) => tab instanceof HTMLElement);
    for (const [index, tab] of this.tabs.entries()) {
      tab.addEventListener("click", () => this.show(index));
      tab.addEventListener("keydown", (event) => {
        const step = { ArrowRight: 1, ArrowLeft: -1 }[event.key];
        if (!step) return;
        event.preventDefault();
        event.stopPropagation();
        this.show((index + step + this.tabs.length) % this.tabs.length);
        this.tabs[(index + step + this.tabs.length) % this.tabs.length].focus();
      });
    }
  }

  /** @param {number} index */
  show(index) {
    byId("side", HTMLElement).hidden = false;
    byId("side-switch", HTMLElement).setAttribute("aria-expanded", "true");
    for (const [number, tab] of this.tabs.entries()) {
      tab.setAttribute("aria-selected", String(number === index));
      tab.tabIndex = number === index ? 0 : -1;
      byId(tab.getAttribute("aria-controls") ?? "", HTMLElement).hidden = number !== index;
    }
    this.app.draw();
  }
}

/** @param {string} id */
function hidden(id) {
  return byId(id, HTMLElement).hidden || byId("side", HTMLElement).hidden;
}

/** A table of packets or of marks with its search. */
class ListPanel {
  /**
   * @param {App} app
   * @param {"packets" | "marks"} kind
   * @param {string} search id of its field
   * @param {import("./table.js").TableColumn[]} columns
   */
  constructor(app, kind, search, columns) {
    this.app = app;
    this.kind = kind;
    this.found = new Found(kind);
    this.field = byId(search, HTMLInputElement);
    /** Takes a bookmark away. */
    /** @type {(bookmark: import("./bookmarks.js").Bookmark) => void} */
    this.remove = () => {};
    this.table = new Table(byId(`${kind}-table`, HTMLElement), kind, columns, {
      count: () => this.found.length,
      cells: (index) => this.cells(index),
      kind: (index) => this.kindOf(index),
      pick: (index) => this.pick(index),
    });
    this.field.addEventListener("input", () => this.search());
    this.field.addEventListener("keydown", (event) => {
      if (event.key !== "Enter") return;
      event.preventDefault();
      this.table.select(event.shiftKey ? this.table.selected - 1 : this.table.selected + 1);
    });
    byId(`${kind}-csv`, HTMLButtonElement).addEventListener("click", () => {
      const text = kind === "packets" ? packetsCsv(app.recording, this.found) : marksCsv(app.recording, this.found);
      save(`${app.recording.description.board}-${kind}.csv`, new Blob([text], { type: "text/csv" }));
    });
  }

  /** Look through all of it again. */
  search() {
    this.found.search(this.app.recording, this.field.value);
    this.table.selected = -1;
    this.app.draw();
  }

  update() {
    const { app, found } = this;
    const ended = this.table.atEnd;
    if (found.recording !== app.recording || found.looked.some((row, n) => row < found.lanes[n].rows.begin)) {
      this.table.selected = -1;
      found.search(app.recording, this.field.value);
    } else found.more();
    if (hidden(this.kind)) return;
    const total = found.lanes.reduce((sum, lane) => sum + lane.find(app.recording.now) + 1, 0);
    const text = found.words.length ? `${numberText(found.length)} of ${numberText(total)}` : numberText(total);
    const count = byId(`${this.kind}-count`, HTMLElement);
    const told = `${text} ${this.kind}`;
    if (count.textContent !== told) count.textContent = told;
    this.table.empty.textContent = found.length ? "" : found.words.length ? "None is like that." : "None so far.";
    this.table.draw();
    if (app.view.follow && ended) this.table.see(found.length - 1);
  }

  /**
   * @param {number} index
   * @returns {string[]}
   */
  cells(index) {
    const { recording } = this.app;
    const entry = this.found.entry(index);
    const at = plainSeconds(recording.origin + entry.lane.instant(entry.row)).slice(0, -3);
    if (this.kind === "packets") {
      const { chip, label } = packetOf(recording, entry);
      return [at, chip, label];
    }
    const mark = entry.lane.mark(entry.row);
    return [at, mark.kind, [mark.text, mark.rule, mark.clause].filter(Boolean).join(", ")];
  }

  /** @param {number} index */
  kindOf(index) {
    const entry = this.found.entry(index);
    if (this.kind === "marks") return entry.lane.mark(entry.row).kind;
    return packetOf(this.app.recording, entry).kind;
  }

  /**
   * Return all that is known of a row.
   * @param {number} index
   */
  detail(index) {
    const { recording } = this.app;
    const { lane, row } = this.found.entry(index);
    const at = instantText(recording.origin + lane.instant(row));
    if (this.kind === "packets") {
      const { begin, end, kind, label } = packetOf(recording, { lane, row });
      return `${label} (${kind}, at ${at} for ${spanText(end - begin)})`;
    }
    const { text, rule, clause, label } = lane.mark(row);
    return [`${text} at ${at}`, rule && `rule ${rule}`, clause && `clause ${clause}`, label && `in ${label}`]
      .filter(Boolean).join(", ");
  }

  /** @param {number} index */
  pick(index) {
    const { lane, row } = this.found.entry(index);
    const begin = lane.instant(row);
    this.app.jump(begin, lane.kind === "packets" ? lane.end(row) : begin);
    const detail = byId(`${this.kind}-detail`, HTMLElement);
    detail.replaceChildren();
    element("p", "", detail).textContent = this.detail(index);
    const { recording } = this.app;
    if (this.kind === "packets") {
      tellSteps(detail, this.app, lane, row);
      tellClause(detail, recording, clauseIn(recording.label(lane, row)));
      return;
    }
    const { text, kind, clause } = lane.mark(row);
    tellClause(detail, recording, clause);
    if (kind === "bookmark") {
      const button = element("button", "", detail);
      button.type = "button";
      button.textContent = "Remove bookmark";
      button.addEventListener("click", () => {
        detail.replaceChildren();
        this.remove({ at: String(begin), text });
      });
    }
  }

  /**
   * Choose the one of a lane at or before an instant.
   * @param {bigint} instant
   * @param {Lane} lane
   */
  chooseAt(instant, lane) {
    let index = this.found.before(instant);
    while (index >= 0 && this.found.entry(index).lane !== lane) index--;
    if (index >= 0) this.table.select(index);
  }

  /**
   * Choose the next one that is wanted, from an instant on.
   * @param {bigint} instant
   * @param {1 | -1} step
   * @param {(kind: string) => boolean} wanted
   */
  chooseNext(instant, step, wanted) {
    const at = step > 0 ? this.found.before(instant) + 1 : this.found.before(instant - 1n);
    for (let index = at; index >= 0 && index < this.found.length; index += step) {
      if (wanted(this.kindOf(index))) {
        this.table.select(index);
        return;
      }
    }
  }
}

/** @param {App} app */
export function packetPanel(app) {
  return new ListPanel(app, "packets", "search", [
    { title: "seconds", width: "104px" },
    { title: "chip", width: "44px" },
    { title: "packet", width: "minmax(0, 1fr)" },
  ]);
}

/** @param {App} app */
export function markPanel(app) {
  return new ListPanel(app, "marks", "marks-search", [
    { title: "seconds", width: "104px" },
    { title: "kind", width: "74px" },
    { title: "what happened, rule, clause", width: "minmax(0, 1fr)" },
  ]);
}

/** Measurements between the cursors, or of what is seen. */
export class MeasurePanel {
  constructor() {
    this.key = "";
  }

  /** @param {App} app */
  update(app) {
    if (hidden("measure")) return;
    const { begin, end, cursors } = app.between;
    const key = `${begin} ${end} ${cursors} ${app.system} ${app.recording.total} ${app.tracks.length}`;
    if (key === this.key) return;
    this.key = key;
    const span = roughSpan(Number(end - begin));
    byId("measure-where", HTMLElement).textContent = cursors
      ? `Between the cursors, ${span}. Means are over time.`
      : `Of what is seen, ${span}; put cursors A and B to choose. Means are over time.`;
    const table = byId("measure-table", HTMLTableElement);
    table.replaceChildren();
    if (end <= begin) return;
    for (const track of app.tracks) {
      for (const lane of track.lanes) {
        if (lane.kind === "number") this.#number(app, table, lane, begin, end);
        else if (lane.kind === "packets") this.#packets(table, lane, begin, end);
      }
    }
  }

  /**
   * @param {App} app
   * @param {HTMLTableElement} table
   * @param {Lane} lane
   * @param {bigint} begin
   * @param {bigint} end
   */
  #number(app, table, lane, begin, end) {
    const found = statistics(lane, begin, end);
    if (!found) return;
    const { factor, unit } = unitOf(lane, app.system);
    /** @param {number | null} value */
    const text = (value) => (value === null ? "–" : numberText(value * factor));
    headRow(table, lane, unit);
    valueRow(table, "min, max", text(found.least), text(found.most));
    valueRow(table, "mean, RMS", text(found.mean), text(found.rms));
    const [a, b] = [lane.at(begin), lane.at(end)];
    valueRow(table, "peak, B − A", text(found.peak), text(a === null || b === null ? null : b - a));
    if (lane.short !== "real" && lane.short !== "velocity") return;
    const step = stepResponse(lane, begin, end);
    if (!step) return;
    /** @param {number | null} span */
    const time = (span) => (span === null ? "–" : roughSpan(span));
    valueRow(table, "rise 10–90 %, settling 2 %", time(step.rise), time(step.settling));
    valueRow(table, "overshoot", `${numberText(step.overshoot * 100, 4)} %`, "");
  }

  /**
   * @param {HTMLTableElement} table
   * @param {Lane} lane
   * @param {bigint} begin
   * @param {bigint} end
   */
  #packets(table, lane, begin, end) {
    const found = intervals(lane, begin, end);
    if (!found) return;
    headRow(table, lane, "");
    valueRow(table, "packets, mean interval", numberText(found.count), roughSpan(found.mean));
    valueRow(table, "min, max interval", roughSpan(found.least), roughSpan(found.most));
    valueRow(table, "jitter: width, deviation", roughSpan(found.most - found.least), roughSpan(found.deviation));
  }
}

/**
 * @param {HTMLTableElement} table
 * @param {Lane} lane
 * @param {string} unit
 */
function headRow(table, lane, unit) {
  const row = element("tr", "lane-row", table);
  const head = element("th", "", row);
  head.scope = "rowgroup";
  head.colSpan = 3;
  const name = lane.axis ? `${lane.axis.name}: ${lane.title}` : lane.title;
  head.textContent = unit ? `${name} (${unit})` : name;
}

/**
 * @param {HTMLTableElement} table
 * @param {string} name
 * @param {string} one
 * @param {string} other
 */
function valueRow(table, name, one, other) {
  const row = element("tr", "", table);
  const head = element("th", "", row);
  head.scope = "row";
  head.textContent = name;
  element("td", "", row).textContent = one;
  element("td", "", row).textContent = other;
}

/** Two axes as a path. */
export class PathPanel {
  /** @param {App} app */
  constructor(app) {
    this.x = byId("xy-x", HTMLSelectElement);
    this.y = byId("xy-y", HTMLSelectElement);
    /** @type {import("./recording.js").Recording | null} */
    this.recording = null;
    /** @type {import("./xy.js").Path | null} */
    this.path = null;
    for (const choice of [this.x, this.y]) choice.addEventListener("change", () => app.draw());
  }

  /** @param {App} app */
  #choices(app) {
    const { recording } = app;
    this.recording = recording;
    const axes = recording.description.axes.filter((axis) => recording.byName.has(`${axis.name}.real`));
    for (const choice of [this.x, this.y]) {
      choice.replaceChildren();
      for (const axis of axes) element("option", "", choice).textContent = axis.name;
    }
    const [first] = recording.description.xy ?? [];
    const names = first?.map((name) => recording.byName.get(name)?.axis?.name ?? "") ?? [];
    this.x.value = names[0] || (axes[0]?.name ?? "");
    this.y.value = names[1] || (axes[1]?.name ?? axes[0]?.name ?? "");
  }

  /** @param {App} app */
  update(app) {
    if (this.recording !== app.recording) this.#choices(app);
    if (hidden("xy")) return;
    const { recording, view } = app;
    const canvas = byId("xy-plot", HTMLCanvasElement);
    canvas.width = Math.max(1, Math.round(canvas.clientWidth * app.ratio));
    canvas.height = Math.max(1, Math.round(canvas.clientHeight * app.ratio));
    /** @param {string} name */
    const lane = (name) => recording.byName.get(name) ?? null;
    const x = lane(`${this.x.value}.real`);
    const y = lane(`${this.y.value}.real`);
    const told = byId("xy-told", HTMLElement);
    if (!x || !y) {
      told.textContent = "A path needs two axes with a real position.";
      return;
    }
    const desiredX = lane(`${this.x.value}.desired`);
    const desiredY = lane(`${this.y.value}.desired`);
    const begin = view.start < recording.begin ? recording.begin : view.start;
    const end = view.end < recording.now ? view.end : recording.now;
    if (end <= begin) return;
    const [unitX, unitY] = [unitOf(x, app.system), unitOf(y, app.system)];
    const pair = { x, y, desiredX, desiredY };
    this.path = pathOf(pair, begin, end, unitX.factor, unitY.factor);
    const cursor = view.pointer ?? view.cursors.A;
    let at = -1;
    if (cursor !== null && cursor >= begin && cursor <= end) {
      at = this.path.instants.findLastIndex((instant) => instant <= cursor);
    }
    const names = { x: this.x.value, y: this.y.value, unit: unitX.unit };
    drawPath(context2d(canvas), this.path, at, names, app.ratio, app.colours);
    const skew = skewAt(recording.lanes, at < 0 ? end : /** @type {bigint} */ (cursor));
    const apart = skew === null ? "" : ` Wall skew between nodes ${roughSpan(skew * 1e12)}.`;
    told.textContent = `Of what is seen: ${roughSpan(Number(end - begin))}. Greatest error ${numberText(this.path.most, 5)} ${unitX.unit}.${apart}`;
  }
}

/** The trigger, and the search for an instant by the same conditions. */
export class TriggerPanel {
  /** @param {App} app */
  constructor(app) {
    this.app = app;
    this.field = byId("condition", HTMLInputElement);
    this.told = byId("trigger-told", HTMLElement);
    for (const form of CONDITION_FORMS) element("li", "", byId("forms", HTMLUListElement)).textContent = form;
    byId("trigger-form", HTMLFormElement).addEventListener("submit", (event) => {
      event.preventDefault();
      this.arm();
    });
    byId("find-next", HTMLButtonElement).addEventListener("click", () => this.find(1));
    byId("find-back", HTMLButtonElement).addEventListener("click", () => this.find(-1));
  }

  /** @returns {import("./conditions.js").Condition | null} */
  #condition() {
    try {
      const condition = readCondition(this.field.value, this.app.recording);
      this.told.classList.remove("wrong");
      return condition;
    } catch (error) {
      this.#tell(error instanceof Error ? error.message : String(error), true);
      return null;
    }
  }

  /**
   * @param {string} text
   * @param {boolean} [wrong]
   */
  #tell(text, wrong = false) {
    if (this.told.textContent !== text) this.told.textContent = text;
    this.told.classList.toggle("wrong", wrong);
  }

  arm() {
    const { trigger, view, recording } = this.app;
    if (trigger.condition) {
      trigger.disarm();
      this.#tell("Not armed.");
    } else {
      const condition = this.#condition();
      if (!condition) return;
      const mode = byId("mode", HTMLSelectElement).value === "single" ? "single" : "normal";
      trigger.arm(condition, mode, recording.now);
      view.follow = true;
    }
    this.app.draw();
  }

  /**
   * Go to the next instant, or to the one before, at which the condition becomes true.
   * @param {1 | -1} step
   */
  find(step) {
    const { app } = this;
    const { view, recording, trigger } = app;
    const condition = this.#condition();
    if (!condition) return;
    const middle = trigger.at !== null && view.x(trigger.at) >= 0 && view.x(trigger.at) < view.width
      ? trigger.at
      : view.start + view.span / 2n;
    let found = null;
    if (step > 0) found = condition(recording, middle, recording.now);
    else {
      // Conditions look forward: take the last of all that come before.
      for (let at = condition(recording, -1n, middle - 1n); at !== null; ) {
        found = at;
        at = condition(recording, at, middle - 1n);
      }
    }
    if (found === null) {
      this.#tell(step > 0 ? "It becomes true at no later instant." : "It becomes true at no instant before.");
      return;
    }
    trigger.at = found;
    app.jump(found, found);
    app.chosen = null;
    this.#tell(`Becomes true at ${instantText(found + recording.origin)}.`);
  }

  update() {
    const { trigger, recording } = this.app;
    byId("arm", HTMLElement).setAttribute("aria-pressed", String(trigger.condition !== null));
    if (trigger.condition && trigger.at === null) this.#tell("Armed.");
    else if (trigger.at !== null && (trigger.condition || trigger.mode === "single") && this.armed !== trigger.at) {
      this.armed = trigger.at;
      this.#tell(`Triggered at ${instantText(trigger.at + recording.origin)}.`);
    }
  }

  /** @type {bigint | null} */
  armed = null;
}
