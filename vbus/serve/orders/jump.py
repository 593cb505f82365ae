"""The live board goes back to an earlier instant of its journal, which notes that it did.

The journal is played up to the instant on a twin, a slice of wall time after the other, and the
board takes over its state. Whatever does not hold together is found before: a board that does not
go back is as it was.
"""

import asyncio
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any, ClassVar, Final, Protocol

from vbus.board.board import Board
from vbus.board.build import load_board_text
from vbus.board.host_bus import HostBus
from vbus.board.snapshot import restore, take
from vbus.core.errors import VbusError, read_errors
from vbus.core.signals import Violation
from vbus.core.values.settings import listed
from vbus.faults.armed import ACTING
from vbus.faults.row import LINK
from vbus.protocols.quantities import format_instant, parse_duration
from vbus.record.format import JournalReader
from vbus.record.player import RewoundRun
from vbus.serve.recording import Recording, no_journal
from vbus.serve.time.pacer import WallClockPacer
from vbus.serve.time.steps import PAUSED, Steps
from vbus.serve.time.time_slicer import SLICE_NS

FIRST: Final = "the live board goes back only"


class Onlooker(Protocol):
    """A watcher of the board in another process."""

    WHO: ClassVar[str]
    """Who it is, in words."""

    def step_aside(self) -> None:
        """Let go of the board: it goes back."""

    def step_in(self) -> None:
        """Hold and watch it again."""


class JumpBack:
    """``back``, for one served board.

    Args:
        board: the board.
        pacer: what moves its time.
        steps: what lets it stand still.
        onlookers: gives everybody who watches it.

    Attributes:
        recording: what is recorded of it, if anything.
    """

    def __init__(
        self, board: Board, pacer: WallClockPacer, steps: Steps, onlookers: Callable[[], list[Any]]
    ) -> None:
        self.recording: Recording | None = None
        self._board: Board = board
        self._pacer: WallClockPacer = pacer
        self._steps: Steps = steps
        self._onlookers: Callable[[], list[Any]] = onlookers
        self._going: bool = False

    def begin(self, request: dict[str, Any], own: Onlooker, port: HostBus) -> dict[str, Any]:
        """Begin to go back; :class:`Steps` tells when the board is there, or why it is not.

        Args:
            request: with ``to``, such as ``"12.5 ms"``.
            own: who orders it.
            port: the session they have on the board.

        Raises:
            ValueError: it cannot.
        """
        board = self._board
        to = parse_duration(str(request["to"]))
        if self._going:
            raise ValueError("it is going back already")
        if to > board.now:
            raise ValueError(f"it is {format_instant(board.now)}: {request['to']} is still to come")
        path = self._check(own, port)
        past = RewoundRun(load_board_text(board.text, board.file or "board.toml"))
        self._going = True
        self._steps.pause(f"goes back to {format_instant(to)}")
        work = self._work(past, path, to)
        asyncio.get_running_loop().call_soon(self._go_on, work, past, to, own, port)
        return self._steps.status()

    def _check(self, own: Onlooker, port: HostBus) -> Path:
        """Return where the journal is.

        Raises:
            ValueError: the board cannot go back as things are.
        """
        board, recording = self._board, self.recording
        if recording is None or recording.journal is None:
            no_journal({})
        if recording.journal.error:
            raise ValueError(recording.journal.error)
        path = Path(recording.about["file"])
        if not path.is_file():
            raise ValueError(f"{path} cannot be read again: its journal must be a file")
        if not board.text:
            raise ValueError("a board that was put together in Python cannot be built again")
        if self._steps.state != PAUSED:
            raise ValueError(f"{FIRST} when it is paused")
        others = [other.label for other in board.ports if other is not port]
        if others:
            raise ValueError(f"{FIRST} when no other host is attached; here is {listed(others)}")
        watchers = [one.WHO for one in self._onlookers() if one is not own]
        if recording.others or watchers:
            raise ValueError(
                f"{FIRST} when nothing else is recorded or watches; here is"
                f" {listed([*recording.others, *watchers])}"
            )
        _check_links(board, "now")
        return path

    def _work(self, past: RewoundRun, path: Path, to: int) -> Iterator[None]:
        """Bring the twin to the instant."""
        assert self.recording is not None
        assert self.recording.journal is not None
        self.recording.journal.flush()
        with read_errors(path), path.open("rb") as file:
            yield from past.up_to(JournalReader(file), to)

    def _go_on(
        self, work: Iterator[None], past: RewoundRun, to: int, own: Onlooker, port: HostBus
    ) -> None:
        began = self._pacer.clock()
        try:
            for _ in work:
                if self._pacer.clock() - began > SLICE_NS:
                    loop = asyncio.get_running_loop()
                    loop.call_soon(self._go_on, work, past, to, own, port)
                    return
            # Checked again: other hosts were served between the slices.
            self._check(own, port)
            self._jump(past, own)
            said = f"went back to {format_instant(to)}"
        except (ValueError, VbusError) as error:
            said = f"not gone back: {error}"
        self._going = False
        if self._steps.state == PAUSED:
            self._steps.pause(said)

    def _jump(self, past: RewoundRun, own: Onlooker) -> None:
        board, twin = self._board, past.board
        assert self.recording is not None
        assert self.recording.journal is not None
        journal, left = self.recording.journal, board.now
        _check_links(twin, "then")
        ended = past.leave()
        snapshot = take(twin)
        own.step_aside()
        try:
            journal.flush()
            restore(board, snapshot)
            board.violations.extend(twin.violations)
            if board.broken:
                board.faults.log.clear()
                board.faults.log.extend(twin.faults.log)
            journal.jump(past.kept, left, ended)
            for finding in past.findings():
                if isinstance(finding, Violation):
                    journal.violation(finding)
                else:
                    journal.fault(*finding)
            self._pacer.jumped()
            self._pacer.halt()
        finally:
            own.step_in()
            journal.flush()


def _check_links(board: Board, when: str) -> None:
    """Refuse to go back while, or to where, a fault acts on a link, which has no way back.

    Raises:
        ValueError: one does.
    """
    for armed in board.faults.live() if board.broken else ():
        if armed.fault.target == LINK and armed.state == ACTING:
            raise ValueError(f"{when} a fault acts on a link, which cannot go back: {armed}")
