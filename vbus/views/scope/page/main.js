// Puts the page together.

import { App } from "./app.js";
import { Bookmarks, bookmarksOf } from "./bookmarks.js";
import { ChipPanel } from "./chip.js";
import { readCondition } from "./conditions.js";
import { Control } from "./control.js";
import { save, valuesCsv, waveform } from "./export.js";
import { embedded, pageWith, readEmbedded } from "./file.js";
import { FrameReader } from "./frames.js";
import { useKeys } from "./keys.js";
import { Live } from "./live.js";
import { markPanel, MeasurePanel, packetPanel, PathPanel, Tabs, TriggerPanel } from "./panels.js";
import { pngPicture, svgPicture } from "./picture.js";
import { usePointer } from "./pointer.js";
import { byId, element } from "./table.js";
import { applyTheme, chooseTheme, chosenTheme, onSystemTheme } from "./theme.js";
import { unitOf } from "./units.js";

const app = new App();
const tabs = new Tabs(app);
const packets = packetPanel(app);
const marks = markPanel(app);
const path = new PathPanel(app);
const trigger = new TriggerPanel(app);
const chip = new ChipPanel(app);
app.panels = [packets, marks, chip, new MeasurePanel(), path, trigger];
const bookmarks = new Bookmarks(app, () => marks.search());
marks.remove = (/** @type {import("./bookmarks.js").Bookmark} */ bookmark) => bookmarks.remove(bookmark);

const ZOOM = 1.5;

/** @param {string} id @param {() => void} act */
function onClick(id, act) {
  byId(id, HTMLButtonElement).addEventListener("click", act);
}

function middle() {
  const { view } = app;
  return view.pointer ?? view.start + view.span / 2n;
}

function toggleFollow() {
  app.view.follow = !app.view.follow;
  app.draw();
}

function togglePanel() {
  const side = byId("side", HTMLElement);
  side.hidden = !side.hidden;
  byId("side-switch", HTMLElement).setAttribute("aria-expanded", String(!side.hidden));
}

/** @param {string} text */
function theme(text) {
  chooseTheme(text);
  byId("theme", HTMLSelectElement).value = text;
  app.recolour();
}

/** @param {"A" | "B"} name @param {number} columns */
function nudge(name, columns) {
  const { view } = app;
  const at = view.cursors[name] ?? middle();
  app.setCursor(name, at + BigInt(Math.round(columns * app.ratio)) * BigInt(view.scale));
}

onClick("follow", toggleFollow);
onClick("all", () => app.showAll());
onClick("in", () => app.zoom(1 / ZOOM, middle()));
onClick("out", () => app.zoom(ZOOM, middle()));
onClick("side-switch", togglePanel);
onClick("bookmark-set", () => bookmarks.ask(app.view.cursors.A ?? middle()));
onClick("help", () => byId("keys", HTMLDialogElement).showModal());
byId("units", HTMLSelectElement).addEventListener("change", (event) => {
  const { value } = /** @type {HTMLSelectElement} */ (event.target);
  app.useUnits(/** @type {import("./units.js").System} */ (value));
});
const themes = byId("theme", HTMLSelectElement);
themes.value = chosenTheme();
themes.addEventListener("change", () => theme(themes.value));
onSystemTheme(() => {
  applyTheme(chosenTheme());
  app.recolour();
});

/**
 * @param {"png" | "svg"} kind
 */
function savePicture(kind) {
  const name = `${app.recording.description.board}.${kind}`;
  if (kind === "svg") save(name, new Blob([svgPicture(app)], { type: "image/svg+xml" }));
  else pngPicture(app).toBlob((blob) => blob && save(name, blob));
}

const saves = byId("save", HTMLSelectElement);
saves.addEventListener("change", () => {
  const kind = saves.value;
  saves.value = "";
  const { recording, view } = app;
  const lanes = app.tracks.flatMap((track) => track.lanes);
  const begin = view.start < 0n ? 0n : view.start;
  const end = view.end < recording.now ? view.end : recording.now;
  const { board } = recording.description;
  if (kind === "png" || kind === "svg") savePicture(kind);
  else if (kind === "page") {
    save(`${board}.html`, new Blob([pageWith(bookmarksOf(recording))], { type: "text/html" }));
    bookmarks.unsaved = false;
  }
  else if (kind === "csv") {
    const text = valuesCsv(recording, lanes, begin, end, (lane) => unitOf(lane, app.system));
    save(`${board}.csv`, new Blob([text], { type: "text/csv" }));
  } else if (kind === "vcd") {
    save(`${board}.vcd`, new Blob([waveform(recording, lanes, begin, end)], { type: "text/plain" }));
  }
});

usePointer(app, (track, instant) => {
  if (chip.open && track.kind === "packets") {
    chip.showPacket(track.lanes[0], instant);
    return;
  }
  const marked = track.kind === "marks";
  tabs.show(marked ? 1 : 0);
  (marked ? marks : packets).chooseAt(instant, track.lanes[0]);
});

/** @type {Live | null} */
let live = null;
const control = new Control((order) => live?.send(order));

useKeys(app, [
  { keys: ["g"], name: "g", told: "pause the board, or let it go on, where pages may", act: () => control.toggle() },
  { keys: ["s"], name: "s", told: "step the board", act: () => control.step() },
  { keys: [" "], name: "Space", told: "stay at the newest instant, or hold", act: toggleFollow },
  { keys: ["0"], name: "0", told: "show all of it", act: () => app.showAll() },
  { keys: ["+", "="], name: "+", told: "zoom in, around the pointer or the middle", act: () => app.zoom(1 / ZOOM, middle()) },
  { keys: ["-", "_"], name: "-", told: "zoom out", act: () => app.zoom(ZOOM, middle()) },
  {
    keys: ["ArrowLeft", "ArrowRight"],
    name: "← →",
    told: "move by a tenth of the view; with Shift by all of it",
    act: (_, event) => {
      const part = event.shiftKey ? 1 : 0.1;
      app.view.pan(app.view.width * part * (event.key === "ArrowLeft" ? -1 : 1));
      app.draw();
    },
  },
  {
    keys: ["Home", "End"],
    name: "Home End",
    told: "go to the first and to the newest instant",
    act: (_, { key }) => {
      const { view, recording } = app;
      view.follow = key === "End" && recording.description.live;
      view.start = key === "Home" ? recording.begin : recording.now - view.span;
      app.draw();
    },
  },
  { keys: ["a"], name: "a", told: "put cursor A at the pointer or in the middle", act: () => app.setCursor("A", middle()) },
  { keys: ["b"], name: "b", told: "put cursor B", act: () => app.setCursor("B", middle()) },
  { keys: [",", "."], name: ", .", told: "move cursor A by one pixel", act: (_, { key }) => nudge("A", key === "," ? -1 : 1) },
  { keys: ["<", ">"], name: "< >", told: "move cursor B by one pixel", act: (_, { key }) => nudge("B", key === "<" ? -1 : 1) },
  {
    keys: ["z"],
    name: "z",
    told: "show what is between the cursors",
    act: () => {
      const { begin, end, cursors } = app.between;
      if (!cursors) return;
      app.view.follow = false;
      app.view.show(begin, end);
      app.draw();
    },
  },
  {
    keys: ["Escape"],
    name: "Escape",
    told: "take the cursors away",
    act: () => {
      app.view.cursors = { A: null, B: null };
      app.chosen = null;
      app.trigger.at = null;
      app.draw();
    },
  },
  {
    keys: ["v", "V"],
    name: "v V",
    told: "next and previous violation",
    act: (_, { key }) => {
      tabs.show(1);
      marks.chooseNext(app.chosen?.begin ?? middle(), key === "v" ? 1 : -1, (kind) => kind === "violation");
    },
  },
  {
    keys: ["n", "N"],
    name: "n N",
    told: "next and previous packet of the search",
    act: (_, { key }) => {
      tabs.show(0);
      packets.chooseNext(app.chosen?.begin ?? middle(), key === "n" ? 1 : -1, () => true);
    },
  },
  {
    keys: ["/"],
    name: "/",
    told: "search packets",
    act: () => {
      tabs.show(0);
      byId("search", HTMLInputElement).select();
    },
  },
  { keys: ["m"], name: "m", told: "set a bookmark at the pointer or in the middle", act: () => bookmarks.ask(middle()) },
  { keys: ["p"], name: "p", told: "panel on or off", act: togglePanel },
  {
    keys: ["1", "2", "3", "4", "5", "6"],
    name: "1 – 6",
    told: "packets, marks, measurements, path, trigger, chip",
    act: (_, { key }) => tabs.show(Number(key) - 1),
  },
  {
    keys: ["u"],
    name: "u",
    told: "other units",
    act: () => {
      const units = byId("units", HTMLSelectElement);
      units.selectedIndex = (units.selectedIndex + 1) % units.options.length;
      units.dispatchEvent(new Event("change"));
    },
  },
  { keys: ["t"], name: "t", told: "light or dark", act: () => theme(document.documentElement.dataset.theme === "dark" ? "light" : "dark") },
  { keys: ["?"], name: "?", told: "these keys", act: () => byId("keys", HTMLDialogElement).showModal() },
]);

/** @param {string} text @param {boolean} [lost] */
function tellState(text, lost = false) {
  const state = byId("state", HTMLElement);
  state.textContent = text;
  state.classList.toggle("lost", lost);
}

/** @param {string} text */
function begin(text) {
  const description = JSON.parse(text);
  if (description.format !== 1) {
    tellState(`a recording of format ${description.format}: this page reads format 1`, true);
    return;
  }
  app.open(description);
  control.open(description);
}

const told = embedded();
if (told !== null) {
  begin(told);
  tellState("reading");
  const option = element("option", "", saves);
  option.value = "page";
  option.textContent = "page, bookmarks (HTML)";
  const begun = performance.now();
  readEmbedded((frame) => app.recording.take(frame), () => {
    app.plot.forget();
    app.draw(false);
  })
    .then(() => {
      app.read = performance.now() - begun;
      const { description } = app.recording;
      tellState(`recording of vbus ${description.vbus}, ${description.time}`);
      app.showAll();
    })
    .catch((error) => tellState(`this recording cannot be read: ${error.message}`, true));
} else {
  let reader = new FrameReader();
  let connected = "";
  const tellLive = () => {
    const { description, leftOut } = app.recording;
    tellState([`${connected}, ${description.time}`, leftOut].filter(Boolean).join("; "));
  };
  live = new Live({
    description: (text) => {
      reader = new FrameReader();
      begin(text);
    },
    frames: (bytes) => {
      const before = app.recording.leftOut;
      for (const frame of reader.take(bytes)) app.recording.take(frame);
      if (app.recording.leftOut !== before) tellLive();
      app.draw(false);
    },
    bookmarks: (text) => bookmarks.show(JSON.parse(text).bookmarks),
    answer: (text) => control.take(JSON.parse(text)),
    state: (text, lost) => {
      connected = text;
      if (lost) tellState(text, true);
      else tellLive();
    },
  });
  bookmarks.keep = (order) => live?.send(order);
  chip.ask = (on) => live?.send({ do: "registers", on });
  void live.begin();
}

app.draw();

/** What the page shows, for those who look at it from outside. Nothing here changes anything. */
const looking = Object.freeze({
  get state() {
    const { view, recording, trigger: armed } = app;
    return {
      start: view.start, end: view.end, scale: view.scale, width: view.width, follow: view.follow,
      cursors: { ...view.cursors }, now: recording.now, total: recording.total, frames: app.frames, drawing: app.drawing,
      columns: app.plot.columns, read: app.read, ratio: app.ratio, trigger: armed.at,
      tracks: app.tracks.map(({ name, kind, top, height, range, unit }) => ({ name, kind, top, height, range, unit })),
    };
  },
  get ticks() {
    return app.ticks();
  },
  get path() {
    return path.path;
  },
  lane: (/** @type {string} */ name) => {
    const lane = app.recording.byName.get(name);
    if (!lane) return null;
    return Object.freeze({
      rows: lane.rows.length,
      at: (/** @type {bigint} */ instant) => lane.at(instant),
      extent: (/** @type {bigint} */ from, /** @type {bigint} */ to) => lane.extent(from, to),
      instant: (/** @type {number} */ row) => lane.instant(row),
    });
  },
  /** The first instant at which a condition becomes true. */
  when: (/** @type {string} */ text) => readCondition(text, app.recording)(app.recording, -1n, app.recording.now),
  svg: () => svgPicture(app),
});
Object.defineProperty(window, "scope", { value: looking });
