#!/usr/bin/env python3
"""Makes the pictures of the documentation: ``python docs/pictures/make.py``.

``session.svg`` is a terminal with the commands of the README, recorded from a run of them: a frame
for each step, with the command and what it printed. ``move.svg`` is what an LM629 does with a
motor, sample by sample, drawn as ``vbus plot`` does. ``scope.png`` is the page of the scope with a
move that a jammed motor interrupts; it takes playwright and chromium. ``lm628.svg`` and so on are
made by :mod:`chips`.
"""

import importlib.util
import io
import os
import re
import shutil
import subprocess
import sys
import tempfile
import textwrap
from collections.abc import Sequence
from html import escape
from pathlib import Path

HERE = Path(__file__).resolve().parent
README = HERE.parents[1] / "README.md"
STEPS = (
    ("vbus run board.toml --journal run.vbj --detach",),
    ("python3 talk.py", "vbus stop first"),
    ("vbus explain run.vbj | tail -n 4",),
    ("vbus report run.vbj", "vbus replay run.vbj"),
)
"""The commands of the README in the terminal, by the frame that shows them."""

WIDTH, ROWS, LINE, LETTER, EDGE = 64, 8, 24, 9.65, 16
"""Letters in a line, lines in a frame; height of a line, width of a letter and margin in pixels."""

SHOWN = 5
"""Seconds for which a frame is shown."""

BOARD = """
board.name = "axis"
board.time = "lockstep"
board.power_on = "done"
[chips.x]
part = "LM629N-8"
clock = "8 MHz"
plant = "motor"
[plants.motor]
model = "dc_motor"
"""


JAM = """
import os
from vbus import connect
from vbus.client.lm628 import Lm628

with connect(os.environ["VBUS_LINK"]) as bus:
    axis = Lm628(bus)
    axis.load_filter(kp=120, ki=20, kd=1500, il=500)
    axis.rsti(0)
    axis.load_trajectory(acc=120, vel=4 << 16, pos=2000, start=True)
    while not axis.status() & 0x04:
        bus.delay("2 ms")
    bus.delay("30 ms")
"""
FAULT = """
[[faults]]
fault = "jam"
target = "x"
when = "at 150 ms"
until = "for 15 ms"
"""


def typed(command: str, folder: Path) -> list[str]:
    """Run a command in a folder where vbus is installed; return the lines it prints."""
    environment = {
        **os.environ,
        "PATH": f"{Path(sys.executable).parent}:{os.environ['PATH']}",
        "VBUS_RUNTIME": str(folder / "run"),
    }
    done = subprocess.run(
        command, shell=True, cwd=folder, env=environment, text=True,
        stdout=subprocess.PIPE, stderr=subprocess.STDOUT, check=True,
    )  # fmt: skip
    return done.stdout.replace(str(folder), "~").splitlines()


def record(folder: Path) -> list[list[str]]:
    """Run the commands of the README in a folder; return the lines of each frame."""
    page = README.read_text()
    for name, text in re.findall(r"[Ss]ave this as\s+`([\w.]+)`:\n\n```\w+\n(.*?)```", page, re.S):
        (folder / name).write_text(text)
    return [
        [line for command in commands for line in (f"$ {command}", *typed(command, folder))]
        for commands in STEPS
    ]


def terminal(frames: Sequence[Sequence[str]], only: int | None = None) -> str:
    """Return a terminal that shows frames in turn, or one of them, as SVG.

    A viewer without animations shows the first frame.
    """
    width, height = round(WIDTH * LETTER) + 2 * EDGE, LINE * ROWS + 2 * EDGE
    whole = SHOWN * len(frames)
    part = 100 / len(frames)
    drawn = []
    for number, lines in enumerate(frames):
        if only not in (None, number):
            continue
        texts = [
            f'<text x="{EDGE}" y="{EDGE + LINE * row + 17}" xml:space="preserve"'
            f' fill="{"#9ece6a" if line.startswith("$ ") else "#c0caf5"}">{escape(line)}</text>'
            for row, line in enumerate(_wrapped(lines))
        ]
        # A negative delay: a positive one would show the frame before its turn, over the others.
        delay = SHOWN * number - whole
        start = f' class="frame" style="animation-delay:{delay}s"' if only is None else ""
        drawn += [f'<g opacity="{0 if only is None and number else 1}"{start}>', *texts, "</g>"]
    style = (
        f".frame{{animation:show {whole}s step-end infinite}}"
        f"@keyframes show{{0%{{opacity:1}}{part:g}%{{opacity:0}}100%{{opacity:0}}}}"
    )
    return "\n".join(
        [
            f'<svg xmlns="http://www.w3.org/2000/svg" viewBox="0 0 {width} {height}"'
            ' font-family="monospace" font-size="16">',
            f"<style>{style if only is None else ''}</style>",
            f'<rect width="{width}" height="{height}" rx="8" fill="#1a1b26"/>',
            *drawn,
            "</svg>\n",
        ]
    )


def _wrapped(lines: Sequence[str]) -> list[str]:
    """Return lines that fit the width, broken between words."""
    rows = [
        row
        for line in lines
        for row in textwrap.wrap(line, WIDTH, subsequent_indent="    ") or [""]
    ]
    if len(rows) > ROWS:
        raise ValueError(f"{len(rows)} lines in a frame of {ROWS}: {rows}")
    return rows


def move(picture: Path) -> None:
    """Draw the tutorial's move of an LM629."""
    from vbus.board.build import load_board_text
    from vbus.cli.look.plot import draw
    from vbus.client.lm628 import Lm628
    from vbus.testing import connect_in_process
    from vbus.views.scope.recording import Recorder

    board = load_board_text(BOARD, "picture")
    recorder = Recorder(board, edges=False)
    bus = connect_in_process(board)
    axis = Lm628(bus)
    axis.load_filter(kp=300, kd=2000)
    recorder.start()
    axis.load_trajectory(acc=20, vel=3 << 16, pos=2000, start=True)
    bus.delay("1400 ms")
    recorder.stop()
    draw(recorder.lanes.described(live=False), recorder.take(), picture, lanes=("desired", "real"))


def scope(picture: Path) -> None:
    """Take a picture of the scope's page: a move that a jammed motor interrupts."""
    from PIL import Image
    from playwright.sync_api import sync_playwright

    with tempfile.TemporaryDirectory() as name, sync_playwright() as playwright:
        folder = Path(name)
        (folder / "axis.toml").write_text(BOARD + FAULT)
        (folder / "move.py").write_text(JAM)
        typed("vbus exec --board axis.toml --journal run.vbj -- python3 move.py", folder)
        typed("vbus scope run.vbj -o run.html", folder)
        browser = playwright.chromium.launch(
            executable_path=shutil.which("chromium"), args=["--no-sandbox", "--disable-gpu"]
        )
        page = browser.new_page(viewport={"width": 1120, "height": 680}, color_scheme="light")
        page.goto(f"file://{folder}/run.html")
        page.wait_for_function("window.scope && scope.state.read > 0 && scope.state.frames > 1")
        page.wait_for_timeout(500)
        shot = Image.open(io.BytesIO(page.screenshot())).convert("RGB")
        browser.close()
        shot.quantize(256, dither=Image.Dither.NONE).save(picture, optimize=True)


def main() -> None:
    """Make the pictures."""
    from chips import DRAWINGS, draw

    for name, drawing in DRAWINGS.items():
        (HERE / f"{name}.svg").write_text(draw(drawing))
    move(HERE / "move.svg")
    with tempfile.TemporaryDirectory() as folder:
        (HERE / "session.svg").write_text(terminal(record(Path(folder))))
    if importlib.util.find_spec("playwright") and shutil.which("chromium"):
        scope(HERE / "scope.png")
    else:
        print("scope.png is as it was: it takes playwright and chromium")


if __name__ == "__main__":
    main()
