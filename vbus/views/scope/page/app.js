// What the page shows: the recording, the view of it, and when to draw.

import { putBookmarks } from "./bookmarks.js";
import { Plot, context2d, drawAxis, drawOverview, drawUprights } from "./draw.js";
import { Recording } from "./recording.js";
import { byId, element } from "./table.js";
import { applyTheme, chosenTheme, themeColours } from "./theme.js";
import { axisTicks, instantText, roughSpan, spanText, tickStep } from "./time.js";
import { layOut, tracksOf, useUnits } from "./tracks.js";
import { Trigger } from "./trigger.js";
import { numberText, unitOf } from "./units.js";
import { View } from "./view.js";

/**
 * @typedef {import("./recording.js").Lane} Lane
 * @typedef {import("./draw.js").Track} Track
 * @typedef {{update: (app: App) => void}} Panel
 */

/** How often texts and tables follow what is drawn (ms). */
const TEXTS_MS = 100;
const PANELS_MS = 250;
/** Pixels between ticks of the time axis, at least. */
const TICK_ROOM = 104;
const LEVELS_OF_LINE = ["0", "1", "Z"];
/** What a page shows of a board at first (ps). */
const FIRST_SPAN = 2_000_000_000_000n;

/** The page. */
export class App {
  constructor() {
    this.recording = new Recording({
      format: 1, vbus: "", board: "", time: "", live: false, control: false, origin: "0", now: "0",
      axes: [], lanes: [],
    });
    this.view = new View();
    this.trigger = new Trigger();
    /** @type {Track[]} */
    this.tracks = [];
    /** @type {Set<string>} */
    this.folded = new Set();
    /** @type {import("./units.js").System} */
    this.system = "counts";
    /** @type {Panel[]} */
    this.panels = [];
    /** What is chosen in a table: from, to. */
    /** @type {{begin: bigint, end: bigint} | null} */
    this.chosen = null;
    this.scroll = byId("scroll", HTMLDivElement);
    this.canvases = {
      axis: byId("axis", HTMLCanvasElement),
      scale: byId("scale", HTMLCanvasElement),
      plot: byId("plot", HTMLCanvasElement),
      over: byId("over", HTMLCanvasElement),
      overview: byId("overview", HTMLCanvasElement),
    };
    applyTheme(chosenTheme());
    this.colours = themeColours();
    this.ratio = 1;
    this.plot = new Plot(context2d(this.canvases.plot), context2d(this.canvases.scale), 1);
    this.whole = new View();
    /** @type {Map<Lane, HTMLOutputElement>} */
    this.values = new Map();
    this.scheduled = false;
    this.waiting = false;
    this.frames = 0;
    /** How long it took to draw them (ms). */
    this.drawing = 0;
    this.textsAt = -Infinity;
    this.panelsAt = -Infinity;
    this.urgent = true;
    this.fitted = false;
    /** How long it took to read the recording of this page (ms). */
    this.read = 0;
    new ResizeObserver(() => this.resize()).observe(this.scroll);
    this.scroll.addEventListener("scroll", () => this.draw());
  }

  /**
   * Begin a recording.
   * @param {import("./recording.js").Description} description
   */
  open(description) {
    const again = this.recording.same(description);
    this.recording = new Recording(description);
    putBookmarks(this.recording, description.bookmarks ?? []);
    const promised = BigInt(description.now);
    if (!description.live) this.recording.now = promised;
    if (!again) {
      this.view.cursors = { A: null, B: null };
      this.view.follow = description.live;
      this.fitted = false;
      this.trigger.disarm();
      if (description.live) {
        this.view.show(promised - FIRST_SPAN, promised);
        this.fitted = true;
      }
    }
    this.chosen = null;
    document.title = `${description.board} – vbus scope`;
    byId("board", HTMLElement).textContent = description.board;
    this.rebuild();
  }

  /** Show all there is. */
  showAll() {
    const { begin, now } = this.recording;
    const margin = (now - begin) / 100n + 1n;
    this.view.show(begin - margin, now + margin);
    this.view.follow = false;
    this.draw();
  }

  /**
   * Show more or less of it, around an instant; while following, the newest one stays.
   * @param {number} factor
   * @param {bigint} around
   */
  zoom(factor, around) {
    const { view, recording } = this;
    view.zoom(factor, view.follow ? recording.now : around);
    this.draw();
  }

  /** Make the tracks anew. */
  rebuild() {
    this.tracks = tracksOf(this.recording, this.folded);
    useUnits(this.tracks, this.system);
    this.#heads();
    this.resize();
  }

  /** @param {import("./units.js").System} system */
  useUnits(system) {
    this.system = system;
    this.rebuild();
  }

  /** Take the colours of the theme. */
  recolour() {
    this.colours = themeColours();
    this.plot.forget();
    for (const [lane, output] of this.values) {
      const swatch = output.parentElement?.querySelector("i");
      if (swatch) swatch.style.background = this.#colour(lane);
    }
    this.draw();
  }

  /** @param {Lane} lane */
  #colour(lane) {
    const { lanes, text } = this.colours;
    if (lane.kind === "line") return lanes.line;
    return lane.kind === "number" ? (lanes[lane.short] ?? lanes.other) : text;
  }

  #heads() {
    const list = byId("heads", HTMLUListElement);
    list.replaceChildren();
    this.values.clear();
    for (const track of this.tracks) {
      const item = element("li", track.kind, list);
      if (track.kind === "axis") {
        this.#axisHead(item, track.name);
        continue;
      }
      for (const lane of track.lanes) {
        const row = element("div", "lane", item);
        if (lane.kind === "number") element("i", "", row).style.background = this.#colour(lane);
        const name = element("b", "", row);
        name.textContent = lane.title;
        name.title = lane.name;
        this.values.set(lane, element("output", "number", row));
      }
      if (track.unit) element("div", "unit", item).textContent = track.unit;
    }
  }

  /**
   * @param {HTMLElement} item
   * @param {string} name
   */
  #axisHead(item, name) {
    const axis = this.recording.description.axes.find((each) => each.name === name);
    const fold = element("button", "", item);
    const open = !this.folded.has(name);
    fold.type = "button";
    fold.textContent = `${open ? "▾" : "▸"} ${name}`;
    fold.setAttribute("aria-expanded", String(open));
    fold.addEventListener("click", () => {
      if (!this.folded.delete(name)) this.folded.add(name);
      this.rebuild();
    });
    const told = [axis?.part ?? ""];
    if (axis?.counts_per_rev) told.push(`${axis.counts_per_rev} counts/rev`);
    const text = element("span", "", item);
    text.textContent = told.filter(Boolean).join(", ");
    text.title = text.textContent;
  }

  /** Fit the canvases to the window. */
  resize() {
    this.ratio = window.devicePixelRatio || 1;
    const height = this.scroll.clientHeight;
    const total = layOut(this.tracks, height);
    const tracks = byId("tracks", HTMLDivElement);
    tracks.style.height = `${Math.max(total, height)}px`;
    for (const [index, item] of [...byId("heads", HTMLUListElement).children].entries()) {
      if (item instanceof HTMLElement) item.style.height = `${this.tracks[index].height}px`;
    }
    byId("stage", HTMLDivElement).style.height = `${height}px`;
    for (const canvas of Object.values(this.canvases)) {
      const width = Math.max(1, Math.round(canvas.clientWidth * this.ratio));
      const tall = Math.max(1, Math.round(canvas.clientHeight * this.ratio));
      if (canvas.width !== width) canvas.width = width;
      if (canvas.height !== tall) canvas.height = tall;
    }
    const { plot, scale, overview } = this.canvases;
    this.plot.ratio = this.ratio;
    this.plot.forget();
    context2d(scale);
    if (this.view.width !== plot.width) {
      const { start, end } = this.view;
      const follows = this.view.follow;
      this.view.resize(plot.width);
      if (this.fitted && !follows) this.view.show(start, end);
    }
    this.whole.width = overview.width;
    this.draw(true);
  }

  /**
   * Draw with the next frame of the screen.
   * @param {boolean} [urgent] texts and tables as well
   */
  draw(urgent = true) {
    this.urgent ||= urgent;
    if (this.scheduled) return;
    this.scheduled = true;
    requestAnimationFrame((when) => {
      this.scheduled = false;
      const begun = performance.now();
      this.#frame(when);
      this.drawing += performance.now() - begun;
    });
  }

  /** @param {number} when */
  #frame(when) {
    const { recording, view, canvases, colours } = this;
    if (!this.fitted && recording.total) {
      this.fitted = true;
      this.showAll();
    }
    if (this.trigger.look(recording, view)) this.urgent = true;
    if (view.follow) view.keepUp(recording.now);
    const ticks = this.ticks();
    this.plot.draw(this.tracks, recording, view, ticks, this.scroll.scrollTop, colours);
    drawAxis(context2d(canvases.axis), view, ticks, this.ratio, colours);
    this.#over();
    this.frames++;
    if (this.urgent || when - this.textsAt >= TEXTS_MS) {
      this.textsAt = when;
      this.#texts(ticks.base);
    }
    if (this.urgent || when - this.panelsAt >= PANELS_MS) {
      this.panelsAt = when;
      this.#overview();
      for (const panel of this.panels) panel.update(this);
    } else this.#later();
    this.urgent = false;
  }

  /** Bring texts and tables up to date though nothing more should come. */
  #later() {
    if (this.waiting) return;
    this.waiting = true;
    setTimeout(() => {
      this.waiting = false;
      this.draw();
    }, PANELS_MS);
  }

  /** Return the ticks of the time axis: absolute instants as text, offsets as places. */
  ticks() {
    const { view } = this;
    const { origin } = this.recording;
    const least = BigInt(Math.ceil(TICK_ROOM * this.ratio)) * BigInt(view.scale);
    const found = axisTicks(view.start + origin, view.end + origin, tickStep(least));
    return { ...found, ticks: found.ticks.map(({ at, text }) => ({ at: at - origin, text })) };
  }

  /** Return the upright lines over the lanes. */
  uprights() {
    const { view, colours } = this;
    /** @type {import("./draw.js").Upright[]} */
    const lines = [];
    if (this.chosen) lines.push({ at: this.chosen.begin, text: "", colour: colours.accent });
    if (view.pointer !== null) lines.push({ at: view.pointer, text: "", colour: colours.strong, dashed: true });
    if (this.trigger.at !== null) lines.push({ at: this.trigger.at, text: "T", colour: colours.accent });
    const { A, B } = view.cursors;
    if (A !== null) lines.push({ at: A, text: "A", colour: colours.A });
    if (B !== null) lines.push({ at: B, text: "B", colour: colours.B });
    return lines;
  }

  #over() {
    const { view, colours } = this;
    const { A, B } = view.cursors;
    const between = A !== null && B !== null ? { begin: A < B ? A : B, end: A < B ? B : A } : null;
    const band = this.chosen
      ? { ...this.chosen, colour: colours.accent }
      : between && { ...between, colour: colours.muted };
    drawUprights(context2d(this.canvases.over), view, this.uprights(), band, this.ratio, colours);
  }

  /** The instant of which the heads show the values. */
  get instant() {
    const { pointer, cursors, end, follow } = this.view;
    const { now } = this.recording;
    const wanted = pointer ?? cursors.A ?? (follow || end > now ? now : end);
    return wanted > now ? now : wanted;
  }

  /** @param {string} base */
  #texts(base) {
    const { view, recording } = this;
    const instant = this.instant;
    for (const [lane, output] of this.values) {
      const text = this.valueText(lane, instant);
      if (output.textContent !== text) output.textContent = text;
    }
    /** @param {string} id @param {string} text */
    const tell = (id, text) => {
      const place = byId(id, HTMLElement);
      if (place.textContent !== text) place.textContent = text;
    };
    const { A, B } = view.cursors;
    /** @param {bigint | null} at */
    const absolute = (at) => (at === null ? "–" : instantText(at + recording.origin));
    tell("base", base);
    tell("span", roughSpan(Number(view.span)));
    tell("pointer-name", view.pointer === null ? "newest" : "pointer");
    tell("at-pointer", absolute(view.pointer ?? recording.now));
    tell("at-a", absolute(A));
    tell("at-b", absolute(B));
    const apart = A === null || B === null ? null : B - A;
    tell("apart", apart === null ? "–" : spanText(apart));
    tell("rate", apart ? `${numberText(1e12 / Math.abs(Number(apart)), 6)} Hz` : "–");
    byId("follow", HTMLButtonElement).setAttribute("aria-pressed", String(view.follow));
  }

  /**
   * Return what a lane has at an instant, as text.
   * @param {Lane} lane
   * @param {bigint} instant
   */
  valueText(lane, instant) {
    if (lane.kind === "number") {
      const value = lane.at(instant);
      return value === null ? "–" : numberText(value * unitOf(lane, this.system).factor, 4);
    }
    if (lane.kind === "line") {
      const level = lane.at(instant);
      return level === null ? "–" : (LEVELS_OF_LINE[level] ?? "–");
    }
    return "";
  }

  #overview() {
    const { recording, whole, canvases } = this;
    const begin = recording.begin;
    whole.show(begin, recording.now > begin ? recording.now : begin + 1n);
    const lane = recording.lanes.find((each) => each.short === "real" && each.kind === "number") ??
      recording.lanes.find((each) => each.kind === "number") ?? null;
    drawOverview(context2d(canvases.overview), recording, lane, whole, this.view, this.ratio, this.colours);
  }

  /**
   * Put a cursor.
   * @param {"A" | "B"} name
   * @param {bigint | null} instant
   */
  setCursor(name, instant) {
    this.view.cursors[name] = instant;
    if (instant !== null) {
      const shown = this.tracks.flatMap((track) => track.lanes).filter((lane) => lane.kind === "number");
      const values = shown.slice(0, 6).map((lane) => `${lane.name} ${this.valueText(lane, instant)}`);
      byId("told", HTMLElement).textContent =
        `Cursor ${name} at ${instantText(instant + this.recording.origin)}. ${values.join(", ")}`;
    }
    this.draw();
  }

  /**
   * Go where something is.
   * @param {bigint} begin
   * @param {bigint} end
   */
  jump(begin, end) {
    this.chosen = { begin, end };
    this.view.reveal(begin);
    this.draw();
  }

  /** From where to where to measure: between the cursors, or what is seen. */
  get between() {
    const { A, B } = this.view.cursors;
    const { now } = this.recording;
    let begin = this.view.start;
    let end = this.view.end;
    if (A !== null && B !== null) [begin, end] = A < B ? [A, B] : [B, A];
    if (begin < 0n) begin = 0n;
    return { begin, end: end > now ? now : end, cursors: A !== null && B !== null };
  }

  /**
   * Return the track at a height of the plot, if there is one.
   * @param {number} y CSS pixels
   */
  trackAt(y) {
    const place = y + this.scroll.scrollTop;
    return this.tracks.find((track) => place >= track.top && place < track.top + track.height) ?? null;
  }
}
