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
import os
from collections.abc import Callable
from dataclasses import astuple
from typing import Any, Final

import msgspec

from vbus.board.board import Board
from vbus.board.sections import WaveSection
from vbus.errors import VbusError
from vbus.server.registry import watch_path
from vbus.signals import Observer, Violation
from vbus.trace.wave.wave import DONE, Wave
from vbus.transports.base import Link
from vbus.transports.sockets import UnixTransport

EVERY_SECONDS: Final = 0.05
"""How often lines are sent."""
MOST_PENDING: Final = 1 << 20
"""Bytes kept for somebody who does not read."""
MOST_WAVE: Final = 1 << 26
"""The same of a waveform."""
MOST_ASKED: Final = 1 << 16
"""Bytes of a request."""
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


class Watcher(Observer):
    """Somebody who watches a board from another process.

    Args:
        loop: the event loop.
        link: the connection.
        board: the board.
        hello: what is told first.
        on_end: called once when the other end has gone.
    """

    def __init__(
        self,
        loop: asyncio.AbstractEventLoop,
        link: Link,
        board: Board,
        hello: dict[str, Any],
        on_end: Callable[["Watcher"], None],
    ) -> None:
        self._loop: asyncio.AbstractEventLoop = loop
        self._link: Link = link
        self._board: Board = board
        self._on_end: Callable[[Watcher], None] = on_end
        self._lines: list[list[Any]] = []
        self._lost: int = 0
        self._pending: bytearray = bytearray(json.dumps(hello).encode() + b"\n")
        self._timer: asyncio.TimerHandle | None = None
        self._open: bool = True
        self._asked: bytearray = bytearray()
        self._wave: Wave | None = None
        loop.add_reader(link.fd, self._heard)
        board.observe(self)
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

    def _heard(self) -> None:
        """The other end has said something, or has gone."""
        try:
            data = os.read(self._link.fd, 4096)
        except BlockingIOError:
            return
        except OSError:
            data = b""
        if not data:
            self.end()
            return
        self._asked += data
        if len(self._asked) > MOST_ASKED:
            self.end()
        elif self._wave is None and self._asked.endswith(b"\n"):
            self._begin_wave()

    def _begin_wave(self) -> None:
        try:
            asked = json.loads(self._asked)
            wish = msgspec.convert({"name": "", "file": "", **asked["wave"]}, WaveSection)
            self._wave = Wave(
                self._board, _Text(self._pending), wish.profile, wish.signals, wish.trigger,
                wish.before, wish.duration, wish.sample,
            )  # fmt: skip
        except (ValueError, KeyError, TypeError, VbusError) as error:
            self._asked.clear()
            self._lines.append(["refused", str(error)])
            return
        self._board.unobserve(self)
        self._lines.clear()
        self._pending += b'["wave"]\n'
        self._wave.start()

    def _send(self) -> None:
        if not self._open:
            return
        lines, self._lines = self._lines, []
        if self._wave is not None:
            if self._wave.state == DONE and not self._pending:
                self.end()
                return
        elif len(self._pending) < MOST_PENDING:
            board = self._board
            values = {chip.name: chip.telemetry() for chip in board.chips}
            lines.append(["t", board.now, values])
            if self._lost:
                lines.append(["lost", self._lost])
                self._lost = 0
            self._pending += "".join(json.dumps(line) + "\n" for line in lines).encode()
        else:
            self._lost += len(lines)
        try:
            del self._pending[: os.write(self._link.fd, self._pending)]
        except BlockingIOError:
            pass
        except OSError:
            self.end()
            return
        self._timer = self._loop.call_later(EVERY_SECONDS, self._send)

    def end(self) -> None:
        """Tell no more; may be called again."""
        if self._open:
            self._open = False
            if self._timer is not None:
                self._timer.cancel()
            if self._wave is not None:
                self._wave.stop()
            else:
                self._board.unobserve(self)
            self._loop.remove_reader(self._link.fd)
            self._link.close()
            self._on_end(self)


class Watching:
    """The socket at which a board can be watched.

    Args:
        board: the board.
        hello: makes what each watcher is told first.
    """

    def __init__(self, board: Board, hello: Callable[[], dict[str, Any]]) -> None:
        self._board: Board = board
        self._hello: Callable[[], dict[str, Any]] = hello
        self._transport: UnixTransport | None = None
        self._watchers: list[Watcher] = []

    def open(self, loop: asyncio.AbstractEventLoop) -> None:
        """Wait for watchers.

        Raises:
            TransportError: the socket cannot be made.
        """
        transport = UnixTransport(str(watch_path(self._board.name)), {})

        def linked(link: Link) -> None:
            hello = self._hello()
            self._watchers.append(Watcher(loop, link, self._board, hello, self._watchers.remove))

        transport.open(loop, linked)
        self._transport = transport

    def close(self) -> None:
        """Send every watcher home; may be called again."""
        for watcher in list(self._watchers):
            watcher.end()
        if self._transport is not None:
            self._transport.close()
            self._transport = None
