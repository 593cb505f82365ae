// Which lanes share a track, and how high the tracks are.

import { unitOf } from "./units.js";

/**
 * @typedef {import("./recording.js").Recording} Recording
 * @typedef {import("./draw.js").Track} Track
 */

const HEIGHTS = { axis: 24, number: 64, line: 24, packets: 30, marks: 24 };
const HIGHEST = 220;
/** Lanes that are read best on top of each other; the last is on top. */
const TOGETHER = [
  ["desired", "real"],
  ["profile", "velocity"],
];

/**
 * Return the tracks of a recording, axis by axis; then what belongs to no axis.
 * @param {Recording} recording
 * @param {Set<string>} folded axes of which the lanes are not shown
 * @returns {Track[]}
 */
export function tracksOf(recording, folded) {
  /** @type {Track[]} */
  const tracks = [];
  /**
   * @param {Track["kind"]} kind
   * @param {import("./recording.js").Lane[]} lanes
   * @param {string} name
   */
  const add = (kind, lanes, name) => {
    tracks.push({
      kind, lanes, name, top: 0, height: HEIGHTS[kind], factor: 1, unit: "", range: null, drawn: null,
    });
  };
  for (const axis of recording.description.axes) {
    const lanes = recording.lanes.filter((lane) => lane.axis === axis);
    if (!lanes.length) continue;
    add("axis", [], axis.name);
    if (folded.has(axis.name)) continue;
    const added = new Set();
    for (const lane of lanes) {
      if (added.has(lane)) continue;
      const names = TOGETHER.find((each) => each.includes(lane.short)) ?? [lane.short];
      const together = names.flatMap((name) => lanes.filter((each) => each.short === name && each.kind === lane.kind));
      for (const each of together) added.add(each);
      if (lane.kind !== "register") add(lane.kind, together, together.map((each) => each.name).join(" "));
    }
  }
  const rest = recording.lanes.filter((lane) => !lane.axis);
  for (const kind of /** @type {const} */ (["packets", "line", "marks", "number"])) {
    for (const lane of rest) if (lane.kind === kind) add(kind, [lane], lane.name);
  }
  return tracks;
}

/**
 * Give the tracks the room there is.
 * @param {Track[]} tracks
 * @param {number} room CSS pixels
 */
export function layOut(tracks, room) {
  const numbers = tracks.filter((track) => track.kind === "number");
  const fixed = tracks.reduce((sum, track) => sum + (track.kind === "number" ? 0 : track.height), 0);
  const each = numbers.length ? Math.floor((room - fixed) / numbers.length) : 0;
  let top = 0;
  for (const track of tracks) {
    track.top = top;
    if (track.kind === "number") track.height = Math.max(HEIGHTS.number, Math.min(HIGHEST, each));
    top += track.height;
  }
  return top;
}

/**
 * Have the tracks show their values in these units.
 * @param {Track[]} tracks
 * @param {import("./units.js").System} system
 */
export function useUnits(tracks, system) {
  for (const track of tracks) {
    if (track.kind !== "number") continue;
    const { factor, unit } = unitOf(track.lanes[0], system);
    if (factor !== track.factor) track.range = null;
    track.factor = factor;
    track.unit = unit;
  }
}
