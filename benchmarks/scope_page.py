#!/usr/bin/env python3
"""The page of the scope in a headless browser: frames a second while 16 axes are followed, and how
long an hour takes to open: ``python benchmarks/scope_page.py``.

The page is fed from inside, by what stands in for its WebSocket: so it is the page that is
measured, not what sends to it.
"""

import shutil
import sys
from pathlib import Path
from typing import Any

sys.path.insert(0, str(Path(__file__).resolve().parents[1]))

from playwright.sync_api import sync_playwright

from tests.browser.conftest import ADDRESS, serve
from tests.browser.recordings import PAGE, SAMPLE, SECOND, Recording, samples

AXES, SECONDS, MESSAGES = 16, 8, 60
LANES = (("real", "counts"), ("error", "counts"), ("velocity", "counts/s"), ("output", "%"))
HOUR = 3600 * SECOND
BLOCK = 8192
LOOK = "[scope.state.frames, performance.now(), scope.state.total, scope.state.drawing]"

FEED = """
window.WebSocket = class {
  static OPEN = 1;
  readyState = 1;
  constructor() {
    setTimeout(() => {
      this.onmessage({ data: DESCRIPTION });
      this.begun = performance.now();
      this.sent = 0;
      setInterval(() => this.send_(), 1000 / MESSAGES);
    });
  }
  send_() {
    const due = Math.floor((performance.now() - this.begun) * 1e9 / SAMPLE);
    const rows = due - this.sent;
    if (rows <= 0) return;
    const lanes = LANES;
    const tickBytes = rows * 8, valueBytes = Math.ceil(rows * 4 / 8) * 8;
    const size = 16 + 8 + tickBytes + 8 + valueBytes;
    const bytes = new ArrayBuffer(lanes * size + 16);
    const view = new DataView(bytes);
    for (let lane = 0; lane < lanes; lane++) {
      let at = lane * size;
      view.setUint8(at, 1); view.setUint8(at + 1, 2); view.setUint16(at + 2, lane, true);
      view.setUint32(at + 4, rows, true);
      view.setBigUint64(at + 8, BigInt(this.sent) * BigInt(SAMPLE), true);
      at += 16;
      view.setUint8(at, 0); view.setUint32(at + 4, tickBytes, true);
      const ticks = new Float64Array(bytes, at + 8, rows);
      for (let n = 0; n < rows; n++) ticks[n] = n * SAMPLE;
      at += 8 + tickBytes;
      view.setUint8(at, 1); view.setUint32(at + 4, rows * 4, true);
      const values = new Int32Array(bytes, at + 8, rows);
      for (let n = 0; n < rows; n++) {
        values[n] = 5000 * Math.sin((this.sent + n) / (300 + lane)) + n % 7;
      }
    }
    const end = lanes * size;
    view.setUint8(end, 5); view.setUint16(end + 2, 0xffff, true);
    view.setBigUint64(end + 8, BigInt(due) * BigInt(SAMPLE), true);
    this.sent = due;
    this.onmessage({ data: bytes });
  }
  send() {}
};
"""


def following(browser: Any) -> str:
    recording = Recording(live=True)
    for number in range(AXES):
        recording.axis(f"axis{number + 1}")
        for name, unit in LANES:
            recording.lane(f"axis{number + 1}", name, "number", name, unit=unit)
    page = browser.new_page(viewport={"width": 1600, "height": 1000})
    feed = FEED.replace("SAMPLE", str(SAMPLE)).replace("LANES", str(AXES * len(LANES)))
    feed = feed.replace("MESSAGES", str(MESSAGES))
    description = recording.description().replace("\\", "\\\\").replace("'", "\\'")
    page.add_init_script(feed.replace("DESCRIPTION", f"'{description}'"))
    serve(page, (PAGE / "index.html").read_text())
    page.goto(ADDRESS)
    page.wait_for_timeout(3000)
    before = page.evaluate(LOOK)
    page.wait_for_timeout(1000 * SECONDS)
    after = page.evaluate(LOOK)
    seconds = (after[1] - before[1]) / 1000
    page.close()
    frames = after[0] - before[0]
    return (
        f"{AXES} axes, {AXES * len(LANES)} lanes followed, {(after[2] - before[2]) / seconds:,.0f}"
        f" rows a second: {frames / seconds:.1f} frames a second, {MESSAGES} messages,"
        f" {(after[3] - before[3]) / frames:.1f} ms of drawing in each"
    )


def opening(browser: Any) -> str:
    recording = Recording(end=HOUR)
    recording.axis("x")
    count = HOUR // SAMPLE
    values = [n * 37 % 4001 - 2000 for n in range(BLOCK)]
    ticks = [n * SAMPLE for n in range(BLOCK)]
    for name, unit in LANES:
        lane = recording.lane("x", name, "number", name, unit=unit)
        one = samples(lane, ticks, values)
        for first in range(0, count - BLOCK, BLOCK):
            at = (first * SAMPLE).to_bytes(8, "little")
            recording.frames.append(one[:8] + at + one[16:])
    page = browser.new_page(viewport={"width": 1600, "height": 1000})
    serve(page, recording.page())
    page.goto(ADDRESS, timeout=120_000)
    page.wait_for_function("window.scope && scope.state.frames > 0")
    first = page.evaluate("performance.now()")
    page.wait_for_function("scope.state.read > 0", timeout=120_000)
    page.wait_for_timeout(300)
    read = page.evaluate("scope.state.read")
    total = page.evaluate("scope.state.total")
    redrawn = page.evaluate(
        """async () => {
          const begun = scope.state.drawing, frames = scope.state.frames;
          for (let n = 0; n < 20; n++) {
            const key = n % 2 ? '+' : '-';
            document.dispatchEvent(new KeyboardEvent('keydown', { key }));
            await new Promise((go) => setTimeout(go, 60));
          }
          return (scope.state.drawing - begun) / Math.max(1, scope.state.frames - frames);
        }"""
    )
    page.close()
    return (
        f"an hour of one axis, {total:,} rows: drawn first after {first:.0f} ms, all of it read"
        f" after {read:.0f} ms, drawn anew in {redrawn:.1f} ms"
    )


def main() -> None:
    with sync_playwright() as playwright:
        path = shutil.which("chromium")
        browser = playwright.chromium.launch(executable_path=path, args=["--no-sandbox"])
        print(following(browser))
        print(opening(browser))
        browser.close()


if __name__ == "__main__":
    main()
