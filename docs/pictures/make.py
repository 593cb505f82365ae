#!/usr/bin/env python3
"""Makes the pictures of the documentation: ``python docs/pictures/make.py``.

``session.svg`` is a terminal that types the tutorial's commands, recorded from a run of them;
``move.svg`` is what an LM629 does with a motor, sample by sample, drawn as ``vbus plot`` does.
"""

import os
import re
import subprocess
import sys
import tempfile
from collections.abc import Iterable, Iterator
from html import escape
from pathlib import Path

HERE = Path(__file__).resolve().parent
TUTORIAL = HERE.parent / "tutorial.md"
COMMANDS = (
    "vbus check axis.toml",
    "vbus run axis.toml --journal axis.vbj --detach",
    "python3 axis.py",
    "vbus stop axis",
    "vbus explain axis.vbj | tail -n 5",
)
WIDTH, LINE, LETTER = 100, 18, 8.4
TYPED, SHOWN, READ = 0.03, 0.08, 1.2
"""Seconds for a letter that is typed, for a line that is shown, and to read what was shown."""

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


def record(folder: Path) -> Iterator[tuple[float, str]]:
    """Run the tutorial's commands in a folder; give when each line is there, and the line."""
    page = TUTORIAL.read_text()
    for name, text in re.findall(r"[Ss]ave this as `([\w.]+)`:\n\n```\w+\n(.*?)```", page, re.S):
        (folder / name).write_text(text)
    environment = {
        **os.environ,
        "PATH": f"{Path(sys.executable).parent}:{os.environ['PATH']}",
        "VBUS_RUNTIME": str(folder / "run"),
    }
    now = 0.0
    for command in COMMANDS:
        now += TYPED * len(command)
        yield now, f"$ {command}"
        done = subprocess.run(
            command, shell=True, cwd=folder, env=environment, text=True,
            stdout=subprocess.PIPE, stderr=subprocess.STDOUT, check=True,
        )  # fmt: skip
        for line in done.stdout.replace(str(folder), "~").splitlines():
            now += SHOWN
            yield now, line[:WIDTH]
        now += READ


def terminal(lines: Iterable[tuple[float, str]]) -> str:
    """Return a terminal in which lines appear at their times, as SVG."""
    rows = list(lines)
    width, height = round(WIDTH * LETTER) + 20, LINE * len(rows) + 20
    texts = [
        f'<text x="10" y="{LINE * (number + 1)}" opacity="0" xml:space="preserve"'
        f' fill="{"#9ece6a" if line.startswith("$ ") else "#c0caf5"}">{escape(line)}'
        f'<set attributeName="opacity" to="1" begin="{when:.2f}s" fill="freeze"/></text>'
        for number, (when, line) in enumerate(rows)
    ]
    return "\n".join(
        [
            f'<svg xmlns="http://www.w3.org/2000/svg" viewBox="0 0 {width} {height}"'
            ' font-family="monospace" font-size="14">',
            f'<rect width="{width}" height="{height}" rx="6" fill="#1a1b26"/>',
            *texts,
            "</svg>\n",
        ]
    )


def move(picture: Path) -> None:
    """Draw a move of an LM629."""
    from vbus.board.build import load_board_text
    from vbus.client.lm628 import Lm628
    from vbus.scope.recording import Recorder
    from vbus.testing import connect_in_process
    from vbus.tools.plot import draw

    board = load_board_text(BOARD, "picture")
    recorder = Recorder(board, edges=False)
    bus = connect_in_process(board)
    axis = Lm628(bus)
    axis.load_filter(kp=300, kd=2000)
    recorder.start()
    axis.load_trajectory(acc=400, vel=6 << 16, pos=2000, start=True)
    bus.delay("320 ms")
    recorder.stop()
    draw(recorder.lanes.described(live=False), recorder.take(), picture, lanes=("desired", "real"))


def main() -> None:
    """Make both pictures."""
    move(HERE / "move.svg")
    with tempfile.TemporaryDirectory() as folder:
        (HERE / "session.svg").write_text(terminal(record(Path(folder))))


if __name__ == "__main__":
    main()
