"""The text protocol by hand, under the programs people use for serial ports."""

import fcntl
import os
import select
import signal
import struct
import subprocess
import sys
import termios
import time
from collections.abc import Iterator
from itertools import cycle
from pathlib import Path

import pytest

from tests.e2e.serving import served
from tests.left_out import require
from tests.waiting import PATIENCE, Starved
from vbus.board.build import load_board_text
from vbus.serve.server import LinkSpec

BOARD = """
board.time = "lockstep"
[chips.x]
part = "LM629N-8"
clock = "8 MHz"
plant = "none"
"""
PROGRAMS = {
    "picocom": ("picocom {}", b"\x01\x18", b""),
    "minicom": ("minicom -o -D {}", b"\x01x", b"\r"),
    "miniterm": (f"{sys.executable} -m serial.tools.miniterm {{}}", b"\x1d", b""),
    "screen": ("screen {}", b"\x01k", b"y"),
    "socat": ("socat -,raw,echo=0,escape=0x1d {},raw,echo=0", b"\x1d", b""),
}
"""How each is started, the keys that leave it, and those it then wants, as the page has them."""


class Person:
    """Somebody before a terminal in which a program runs."""

    def __init__(self, command: list[str], home: Path) -> None:
        self._terminal, program = os.openpty()
        fcntl.ioctl(self._terminal, termios.TIOCSWINSZ, struct.pack("HHHH", 24, 80, 0, 0))
        environment = {
            **os.environ, "TERM": "vt100", "HOME": str(home), "SCREENDIR": str(home / "screen"),
        }  # fmt: skip
        self.program = subprocess.Popen(
            command, stdin=program, stdout=program, stderr=program, env=environment,
            start_new_session=True,
            preexec_fn=lambda: fcntl.ioctl(0, termios.TIOCSCTTY, 0),
        )  # fmt: skip
        os.close(program)
        self.seen: bytes = b""

    def types(self, keys: bytes) -> None:
        os.write(self._terminal, keys)

    def look(self, seconds: float) -> bool:
        """Take what has come; False if the program has ended."""
        if select.select([self._terminal], [], [], seconds)[0]:
            try:
                self.seen += os.read(self._terminal, 4096)
            except OSError:
                return False
        return True

    def sees(self, text: bytes, keys: bytes = b"") -> None:
        """Wait for a text; type keys whenever nothing comes, until the program takes them."""
        end = time.monotonic() + PATIENCE
        while text not in self.seen:
            before = len(self.seen)
            if not self.look(0.3) or time.monotonic() > end:
                raise Starved(f"in vain: {text!r} in {self.seen!r}")
            if keys and len(self.seen) == before:
                self.types(keys)

    def leaves(self, keys: bytes, answer: bytes) -> int:
        """Leave the program, however late it listens; return its exit code."""
        end = time.monotonic() + PATIENCE
        self.types(keys)
        turns = cycle([answer, answer, keys])
        while self.program.poll() is None:
            if time.monotonic() > end:
                raise Starved(f"it does not end: {self.seen!r}")
            before = len(self.seen)
            there = self.look(0.3)
            if there and len(self.seen) == before:
                self.types(next(turns))
        return self.program.returncode

    def close(self) -> None:
        if self.program.poll() is None:
            os.killpg(self.program.pid, signal.SIGKILL)
            self.program.wait()
        os.close(self._terminal)


@pytest.fixture
def hand(tmp_path: Path) -> Iterator[Path]:
    """A terminal's name with the text protocol for a person behind it."""
    name = tmp_path / "hand"
    with served(load_board_text(BOARD, "bench"), LinkSpec(f"pty:{name}", "terminal")):
        yield name


@pytest.mark.slow
@pytest.mark.parametrize("name", PROGRAMS)
def test_a_person_types_and_corrects_under(name: str, hand: Path, tmp_path: Path) -> None:
    start, leave, confirm = PROGRAMS[name]
    command = start.format(hand).split()
    require(command[0])
    (tmp_path / "screen").mkdir(mode=0o700)
    (tmp_path / ".minirc.dfl").write_text("pu rtscts No\n")
    person = Person(command, tmp_path)
    try:
        person.sees(b"> ", b"\r")
        person.types(b"rubbish\x15chipz\x7fs\r")
        person.sees(b"x LM629N-8 selected")
        person.types(b"help now\r")
        person.sees(b"now: chip time")
        assert b"unknown request" not in person.seen
        assert person.leaves(leave, confirm) == 0
    finally:
        person.close()
