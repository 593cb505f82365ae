// All lanes over the stretch of time that is seen, with their names, as one picture.

import { context2d, drawAxis, drawUprights, Plot } from "./draw.js";
import { SvgContext } from "./export.js";

/**
 * @typedef {import("./app.js").App} App
 * @typedef {{context: CanvasRenderingContext2D, x: number, y: number}} Part
 */

const NAMES = 184;
const NUMBERS = 56;
const TITLE = 30;
const AXIS = 30;

/**
 * Draw the parts of a picture, each on a context of its own.
 * @param {App} app
 * @param {number} ratio
 * @param {(width: number, height: number) => CanvasRenderingContext2D} make
 * @returns {{parts: Part[], width: number, height: number}}
 */
function partsOf(app, ratio, make) {
  const { view, recording, colours } = app;
  const last = app.tracks.at(-1);
  const tall = (last ? last.top + last.height : 0) * ratio;
  const [left, above] = [(NAMES + NUMBERS) * ratio, (TITLE + AXIS) * ratio];
  const plot = make(view.width, tall);
  const scale = make(NUMBERS * ratio, tall);
  const names = make(NAMES * ratio, tall);
  const axis = make(view.width, AXIS * ratio);
  const title = make(left + view.width, above);
  const over = make(view.width, tall);
  const ticks = app.ticks();
  const tracks = app.tracks.map((track) => ({ ...track, drawn: null }));
  new Plot(plot, scale, ratio).draw(tracks, recording, view, ticks, 0, colours);
  drawAxis(axis, view, ticks, ratio, colours);
  drawUprights(over, view, app.uprights(), null, ratio, colours);
  title.fillStyle = colours.surface;
  title.fillRect(0, 0, left + view.width, above);
  title.fillStyle = colours.text;
  title.textBaseline = "middle";
  title.textAlign = "left";
  title.font = `600 ${14 * ratio}px system-ui, "DejaVu Sans", sans-serif`;
  title.fillText(recording.description.board, 12 * ratio, 16 * ratio);
  title.font = `${11.5 * ratio}px system-ui, "DejaVu Sans", sans-serif`;
  title.fillStyle = colours.muted;
  title.fillText(ticks.base, 12 * ratio, 43 * ratio);
  for (const track of tracks) drawNames(names, track, ratio, colours);
  return {
    parts: [
      { context: title, x: 0, y: 0 },
      { context: axis, x: left, y: TITLE * ratio },
      { context: names, x: 0, y: above },
      { context: scale, x: NAMES * ratio, y: above },
      { context: plot, x: left, y: above },
      { context: over, x: left, y: above },
    ],
    width: left + view.width,
    height: above + tall,
  };
}

/**
 * @param {CanvasRenderingContext2D} context
 * @param {import("./draw.js").Track} track
 * @param {number} ratio
 * @param {import("./draw.js").Colours} colours
 */
function drawNames(context, track, ratio, colours) {
  const axis = track.kind === "axis";
  context.fillStyle = axis ? colours.band : colours.surface;
  context.fillRect(0, track.top * ratio, NAMES * ratio, track.height * ratio);
  context.fillStyle = colours.grid;
  context.fillRect(0, (track.top + track.height) * ratio - 1, NAMES * ratio, 1);
  context.textBaseline = "middle";
  context.textAlign = "left";
  const texts = axis ? [track.name] : track.lanes.map((lane) => lane.title);
  if (track.unit) texts.push(track.unit);
  const middle = track.top + track.height / 2;
  for (const [number, text] of texts.entries()) {
    const lane = track.lanes[number];
    const y = (middle + (number - (texts.length - 1) / 2) * 17) * ratio;
    context.font = `${axis ? "600 " : ""}${12.5 * ratio}px system-ui, "DejaVu Sans", sans-serif`;
    if (lane?.kind === "number") {
      context.fillStyle = colours.lanes[lane.short] ?? colours.lanes.other;
      context.fillRect(12 * ratio, y - 1.5 * ratio, 10 * ratio, 3 * ratio);
    }
    context.fillStyle = axis || lane ? colours.text : colours.muted;
    context.fillText(text, (track.kind === "number" ? 28 : 12) * ratio, y);
  }
}

/**
 * Return what is seen as a picture of pixels.
 * @param {App} app
 */
export function pngPicture(app) {
  const { parts, width, height } = partsOf(app, app.ratio, (wide, tall) => {
    const canvas = document.createElement("canvas");
    canvas.width = Math.max(1, wide);
    canvas.height = Math.max(1, tall);
    return context2d(canvas);
  });
  const canvas = document.createElement("canvas");
  canvas.width = width;
  canvas.height = height;
  const context = context2d(canvas);
  for (const { context: part, x, y } of parts) context.drawImage(part.canvas, x, y);
  return canvas;
}

/**
 * Return what is seen as SVG, by the same renderer.
 * @param {App} app
 */
export function svgPicture(app) {
  const { parts, width, height } = partsOf(
    app,
    app.ratio,
    (wide, tall) => /** @type {CanvasRenderingContext2D} */ (/** @type {unknown} */ (new SvgContext(wide, tall))),
  );
  const groups = parts.map(({ context, x, y }) => {
    const drawn = /** @type {SvgContext} */ (/** @type {unknown} */ (context)).text();
    return `<g transform="translate(${x} ${y})">\n${drawn}\n</g>`;
  });
  return `<svg xmlns="http://www.w3.org/2000/svg" width="${width}" height="${height}" viewBox="0 0 ${width} ${height}">\n${groups.join("\n")}\n</svg>\n`;
}
