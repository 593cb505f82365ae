"""Live views of a running board: whoever connects is told what happens on its buses.

Beside a board's status socket stands one whose name ends in ``.watch``. Who connects gets lines of
JSON: first what the status socket tells, then lists that begin with their kind: ``"c"``, instant,
host, chip, write, address, byte: a bus cycle; ``"v"``, instant, chip, rule, clause, severity,
measured, limit, detail: a violation; ``"t"``, instant, values by chip; ``"lost"``, how many
lines were left out because they were not taken in time.

Who answers with a line ``{"wave": {...}}``, keys as in a board file's ``[waves.NAME]`` with times
in ps, gets a line ``["wave"]`` and after it nothing but a waveform, until it has its duration or
the connection ends; or ``["refused", reason]``.
"""

import asyncio
import errno
import io
import json
from dataclasses import astuple
from typing import Any, Final

import msgspec

from vbus.board.board import Board
from vbus.board.sections import WaveSection
from vbus.errors import VbusError
from vbus.server.local_socket import Connection, OnEnd
from vbus.signals import Observer, Violation
from vbus.trace.wave.wave import DONE, Wave
from vbus.transports.base import Link

EVERY_SECONDS: Final = 0.05
"""How often lines are sent."""
MOST_PENDING: Final = 1 << 20
"""Bytes kept for somebody who does not read."""
MOST_WAVE: Final = 1 << 26
"""The same of a waveform."""
MOST_LINES: Final = 20_000
"""Lines kept between two sendings; the rest is counted as lost."""


class _Text(io.StringIO):
    """A text file whose text goes to a connection's buffer."""

    def __init__(self, buffer: bytearray) -> None:
        super().__init__()
        self._buffer: bytearray = buffer

    def write(self, text: str) -> int:
        """Take text.

        Raises:
            OSError: the other end does not read.
        """
        if len(self._buffer) > MOST_WAVE:
            raise OSError(errno.ENOBUFS, "the other end does not read")
        self._buffer += text.encode("ascii", "replace")
        return len(text)


class Watcher(Connection, Observer):
    """Somebody who watches a board from another process.

    Args:
        loop: the event loop.
        link: the connection.
        on_end: called once when it is over.
        board: the board.
        status: what is sent first.
    """

    def __init__(
        self,
        loop: asyncio.AbstractEventLoop,
        link: Link,
        on_end: OnEnd,
        board: Board,
        status: bytes,
    ) -> None:
        super().__init__(loop, link, on_end)
        self.pending += status + b"\n"
        self._board: Board = board
        self._lines: list[list[Any]] = []
        self._lost: int = 0
        self._timer: asyncio.TimerHandle | None = None
        self._wave: Wave | None = None

    def begin(self) -> None:
        """Watch from now on."""
        super().begin()
        self._board.observe(self)
        self._send()

    def bus_cycle(
        self, when: int, host: str, chip: str, write: bool, address: int, data: int
    ) -> None:
        """Take down a bus cycle."""
        self._add(["c", when, host, chip, write, address, data])

    def violation(self, violation: Violation) -> None:
        """Take down a violation."""
        self._add(["v", *astuple(violation)])

    def _add(self, line: list[Any]) -> None:
        if len(self._lines) < MOST_LINES:
            self._lines.append(line)
        else:
            self._lost += 1

    def take(self, line: bytes) -> None:
        """Begin the waveform that is asked for."""
        if self._wave is not None:
            return
        try:
            asked = json.loads(line)
            section = msgspec.convert({"name": "", "file": "", **asked["wave"]}, WaveSection)
            self._wave = Wave(
                self._board, _Text(self.pending), section.profile, section.signals,
                section.trigger, section.before, section.duration, section.sample,
            )  # fmt: skip
        except (ValueError, KeyError, TypeError, VbusError) as error:
            self._lines.append(["refused", str(error)])
            return
        self._board.unobserve(self)
        self._lines.clear()
        self.pending += b'["wave"]\n'
        self._wave.start()

    def _send(self) -> None:
        lines, self._lines = self._lines, []
        if self._wave is not None:
            if self._wave.state == DONE and not self.pending:
                self.end()
        elif len(self.pending) < MOST_PENDING:
            board = self._board
            values = {chip.name: chip.telemetry() for chip in board.chips}
            lines.append(["t", board.now, values])
            if self._lost:
                lines.append(["lost", self._lost])
                self._lost = 0
            self.pending += "".join(json.dumps(line) + "\n" for line in lines).encode()
        else:
            self._lost += len(lines)
        if self.open:
            self.flush()
        if self.open:
            self._timer = self.loop.call_later(EVERY_SECONDS, self._send)

    def end(self) -> None:
        """Watch no more; may be called again."""
        if self.open:
            if self._timer is not None:
                self._timer.cancel()
            if self._wave is not None:
                self._wave.stop()
            else:
                self._board.unobserve(self)
        super().end()
