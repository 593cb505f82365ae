// Mouse, pen and fingers on the lanes, the time axis and the overview.

/** @typedef {import("./app.js").App} App */

/** CSS pixels from a cursor within which it is taken, and within which a press is a click. */
const NEAR = 5;
const STILL = 4;

/**
 * Let the pointer zoom, pan and put cursors.
 * @param {App} app
 * @param {(track: import("./draw.js").Track, instant: bigint) => void} clicked
 */
export function usePointer(app, clicked) {
  const { over, axis, overview } = app.canvases;
  for (const canvas of [over, axis]) {
    canvas.addEventListener("wheel", (event) => wheel(app, event), { passive: false });
    drags(app, canvas, clicked);
  }
  over.addEventListener("pointerleave", () => {
    app.view.pointerX = null;
    app.draw();
  });
  const go = (/** @type {PointerEvent} */ event) => {
    const { whole, view } = app;
    const at = whole.instant(event.offsetX * app.ratio);
    view.follow = false;
    view.start = at - view.span / 2n;
    app.draw();
  };
  overview.addEventListener("pointerdown", (event) => {
    overview.setPointerCapture(event.pointerId);
    go(event);
  });
  overview.addEventListener("pointermove", (event) => {
    if (event.buttons) go(event);
  });
}

/**
 * @param {App} app
 * @param {WheelEvent} event
 */
function wheel(app, event) {
  event.preventDefault();
  const { view } = app;
  const lines = event.deltaMode === 1 ? 30 : 1;
  if (event.shiftKey || Math.abs(event.deltaX) > Math.abs(event.deltaY)) {
    view.pan((event.deltaX || event.deltaY) * lines * app.ratio);
  } else if (event.altKey) {
    app.scroll.scrollTop += event.deltaY * lines;
  } else {
    const factor = 1.0015 ** (Math.max(-400, Math.min(400, event.deltaY)) * lines);
    app.zoom(factor, view.instant(event.offsetX * app.ratio));
  }
  app.draw();
}

/**
 * @param {App} app
 * @param {HTMLCanvasElement} canvas
 * @param {(track: import("./draw.js").Track, instant: bigint) => void} clicked
 */
function drags(app, canvas, clicked) {
  const { view } = app;
  /** @type {Map<number, {x: number, y: number}>} */
  const fingers = new Map();
  /** The instant that was taken hold of. */
  let held = 0n;
  /** @type {"A" | "B" | null} */
  let cursor = null;
  let moved = 0;

  /** @param {number} x CSS pixels */
  const cursorAt = (x) => {
    for (const name of /** @type {const} */ (["A", "B"])) {
      const at = view.cursors[name];
      if (at !== null && Math.abs(view.x(at) / app.ratio - x) <= NEAR) return name;
    }
    return null;
  };

  canvas.addEventListener("pointerdown", (event) => {
    if (event.button) return;
    canvas.setPointerCapture(event.pointerId);
    fingers.set(event.pointerId, { x: event.offsetX, y: event.offsetY });
    moved = 0;
    held = view.instant(event.offsetX * app.ratio);
    cursor = fingers.size === 1 ? cursorAt(event.offsetX) : null;
  });
  canvas.addEventListener("pointermove", (event) => {
    const finger = fingers.get(event.pointerId);
    const instant = view.instant(event.offsetX * app.ratio);
    if (!finger) {
      view.pointerX = event.offsetX * app.ratio;
      canvas.classList.toggle("edge", cursorAt(event.offsetX) !== null);
      app.draw();
      return;
    }
    const { x, y } = finger;
    const others = [...fingers.values()].filter((each) => each !== finger);
    moved += Math.abs(event.offsetX - x) + Math.abs(event.offsetY - y);
    if (others.length) {
      const [other] = others;
      const apart = Math.max(20, Math.abs(x - other.x));
      const now = Math.max(20, Math.abs(event.offsetX - other.x));
      app.zoom(apart / now, view.instant(other.x * app.ratio));
    } else if (cursor) {
      app.setCursor(cursor, instant);
    } else if (moved > STILL) {
      canvas.classList.add("grab");
      view.pan(view.x(held) - Math.floor(event.offsetX * app.ratio));
    } else return;
    finger.x = event.offsetX;
    finger.y = event.offsetY;
    view.pointerX = event.offsetX * app.ratio;
    app.draw();
  });
  const up = (/** @type {PointerEvent} */ event) => {
    if (!fingers.delete(event.pointerId)) return;
    canvas.classList.remove("grab");
    if (event.type !== "pointerup" || fingers.size || moved > STILL || cursor) return;
    const instant = view.instant(event.offsetX * app.ratio);
    const track = canvas === app.canvases.over ? app.trackAt(event.offsetY) : null;
    if (track && (track.kind === "packets" || track.kind === "marks")) clicked(track, instant);
    else app.setCursor(event.shiftKey ? "B" : "A", instant);
  };
  canvas.addEventListener("pointerup", up);
  canvas.addEventListener("pointercancel", up);
}
