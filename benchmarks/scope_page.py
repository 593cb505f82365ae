#!/usr/bin/env python3
"""The scope of 16 axes, each number beside its limit: ``python benchmarks/scope_page.py``.

Frames a second in a headless browser, what board and scope take of a core in real time, how long an
hour takes to open, how large a minute is.

For the frames the page is fed from inside, by what stands in for its WebSocket: so it is the page
that is measured, not what sends to it.
"""

import json
import os
import shutil
import subprocess
import sys
import tempfile
import time
from pathlib import Path
from typing import Any

sys.path.insert(0, str(Path(__file__).resolve().parents[1]))
sys.path.insert(0, str(Path(__file__).parent))

from many_axes import cpu_seconds, hosts, start_axes, text
from playwright.sync_api import sync_playwright

from tests.browser.conftest import ADDRESS, serve
from tests.browser.recordings import MS, PAGE, SAMPLE, SECOND, Recording, samples
from vbus.client import connect
from vbus.client.lm628 import Lm628
from vbus.views.scope.page_file import one_file

AXES, SECONDS, MESSAGES = 16, 8, 60
LANES = (("real", "counts"), ("error", "counts"), ("velocity", "counts/s"), ("output", "%"))
HOUR = 3600 * SECOND
BLOCK = 8192
MINUTE, POLL, EACH_TIME = 60 * SECOND, 150 * MS // 1000, 50
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


def hour(rows: int) -> bytes:
    """Return a page of one file with an hour of one axis, each lane in so many rows."""
    recording = Recording(end=HOUR)
    recording.axis("x")
    values = [n * 37 % 4001 - 2000 for n in range(BLOCK)]
    ticks = [n * SAMPLE for n in range(BLOCK)]
    for name, unit in LANES:
        lane = recording.lane("x", name, "number", name, unit=unit)
        one = samples(lane, ticks, values)
        for first in range(0, rows, BLOCK):
            at = (first * SAMPLE).to_bytes(8, "little")
            recording.frames.append(one[:8] + at + one[16:])
    return one_file(json.loads(recording.description()), recording.frames)


SEEN = """
const look = () => {
  if (!window.scope || !scope.state.frames) return void setTimeout(look, 2);
  window.seen ??= scope.state.total ? performance.now() : undefined;
  if (!scope.state.read) setTimeout(look, 2);
};
look();
"""


def opened(browser: Any, content: bytes) -> tuple[float, float, float, int]:
    """Open a page of one file.

    Returns:
        When it showed rows and had read all (ms), how long it takes to draw anew (ms), its rows.
    """
    with tempfile.NamedTemporaryFile(suffix=".html") as file:
        file.write(content)
        file.flush()
        page = browser.new_page(viewport={"width": 1600, "height": 1000}, bypass_csp=True)
        page.add_init_script(SEEN)
        page.goto(f"file://{file.name}", timeout=120_000)
        page.wait_for_function("window.scope && scope.state.read > 0", timeout=120_000)
        first, read, rows = page.evaluate("[seen, scope.state.read, scope.state.total]")
        page.wait_for_timeout(300)
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
    return first, read, redrawn, rows


def opening(browser: Any) -> str:
    few, full = hour(1), hour(HOUR // SAMPLE)
    opened(browser, few)  # a browser that has opened nothing yet is slower at it
    empty = opened(browser, few)[0]
    first, read, redrawn, rows = opened(browser, full)
    return (
        f"an hour of one axis, {rows:,} rows, {len(full) / 1e6:.1f} MB: drawn first after"
        f" {first:.0f} ms (limit 1000; one of {len(LANES) * BLOCK:,} rows: {empty:.0f}), all of it"
        f" read after {read:.0f} ms, drawn anew in {redrawn:.1f} ms"
    )


def shares(pids: list[int], seconds: float) -> list[float]:
    """Return what share of a core each process takes (%)."""
    begun, wall = [cpu_seconds(pid) for pid in pids], time.perf_counter()
    time.sleep(seconds)
    passed = time.perf_counter() - wall
    return [100 * (cpu_seconds(pid) - was) / passed for pid, was in zip(pids, begun, strict=True)]


def costs(browser: Any) -> str:
    """What board and scope take in real time: alone, with no page open, with one, and after it."""
    with tempfile.TemporaryDirectory() as folder:
        file = Path(folder) / "many.toml"
        file.write_text(text(AXES, "realtime") + hosts(AXES))
        environment = {**os.environ, "VBUS_RUNTIME": folder}
        command = [sys.executable, "-m", "vbus"]
        pipes: dict[str, Any] = {"env": environment, "stdout": subprocess.PIPE, "text": True}
        board = subprocess.Popen([*command, "run", "--json", file], **pipes)
        started = [board]
        try:
            assert board.stdout is not None
            board.stdout.readline()
            start_axes(Path(folder), AXES)
            time.sleep(1)
            (alone,) = shares([board.pid], SECONDS)
            unseen = []
            for options in (["--sparse"], []):
                scope = subprocess.Popen([*command, "scope", "many", *options], **pipes)
                started.append(scope)
                assert scope.stdout is not None
                link = scope.stdout.readline().split()[1]
                time.sleep(2)
                pids = [board.pid, scope.pid]
                unseen.append(sum(shares(pids, SECONDS)) - alone)
                if options:
                    scope.terminate()
                    scope.wait()
            page = browser.new_page(viewport={"width": 1600, "height": 1000}, bypass_csp=True)
            page.goto(link)
            page.wait_for_function("window.scope && scope.state.total > 0")
            page.wait_for_timeout(2000)
            seen = shares(pids, SECONDS)
            page.close()
        finally:
            for process in reversed(started):
                process.terminate()
                process.wait()
    return (
        f"{AXES} axes moving in real time, % of a core: board {alone:.1f}; with a page, board"
        f" {seen[0]:.1f} and scope {seen[1]:.1f}: {sum(seen) - alone:.1f} more (limit 15);"
        f" {unseen[1]:.1f} more with a scope that no page has open, {unseen[0]:.1f} if it is sparse"
    )


def minute() -> str:
    """Return how large a page with a minute of one axis and its host's cycles is."""
    with tempfile.TemporaryDirectory() as folder:
        file, journal = Path(folder) / "one.toml", Path(folder) / "one.vbj"
        record = f'[record]\njournal = "{journal}"\n'
        file.write_text(text(1, "lockstep") + hosts(1) + record)
        environment = {**os.environ, "VBUS_RUNTIME": folder}
        command = [sys.executable, "-m", "vbus"]
        board = subprocess.Popen(
            [*command, "run", "--json", file], env=environment, stdout=subprocess.PIPE
        )
        try:
            assert board.stdout is not None
            board.stdout.readline()
            with connect(f"unix:{folder}/0.sock", timeout=60) as bus:
                axis = Lm628(bus)
                axis.load_filter(kp=300, kd=2000)
                moves = polls = 0
                while (begun := bus.now()) < MINUTE:
                    axis.move(500 * (moves % 2), acc=40, vel=2 << 16)
                    moves += 1
                    while bus.now() < begun + SECOND:
                        with bus.batch() as batch:
                            for _ in range(EACH_TIME):
                                batch.read(0)
                                batch.delay(POLL)
                        polls += EACH_TIME
        finally:
            board.terminate()
            board.wait()
        page = Path(folder) / "one.html"
        subprocess.run([*command, "scope", journal, "-o", page], env=environment, check=True)
        size = page.stat().st_size
    return (
        f"a minute of one axis, {moves} moves, {polls:,} polls besides: a page of"
        f" {size / 1e6:.2f} MB (limit 3)"
    )


def main() -> None:
    with sync_playwright() as playwright:
        path = shutil.which("chromium")
        browser = playwright.chromium.launch(executable_path=path, args=["--no-sandbox"])
        print(following(browser))
        print(opening(browser))
        print(costs(browser))
        print(minute())
        browser.close()


if __name__ == "__main__":
    main()
