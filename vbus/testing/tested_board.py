"""One board of a test, with what observes it."""

import io
from collections.abc import Callable
from contextlib import nullcontext
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any, TextIO, TypeVar

from vbus.board.board import Board
from vbus.boardfile.sections import BoardFile
from vbus.boardfile.source import Source
from vbus.campaign.account import Witness
from vbus.record.format import JournalReader
from vbus.record.journal import Journal
from vbus.testing.clock import BoardClock
from vbus.testing.judge import Judged
from vbus.testing.limits import HostWatch, Limits
from vbus.testing.serving import ServedBoard

if TYPE_CHECKING:
    from vbus.views.coverage.coverage import CoverageObserver

_T = TypeVar("_T")


@dataclass
class TestedBoard:
    """One board of a test with what observes it.

    Attributes:
        board: the board.
        file: its board file as it runs here.
        source: the same as text.
        strict: whether a breach of a datasheet fails the test.
        budget: what its hosts may take.
        covered: whether what they exercise is counted.
        bring: see :class:`~vbus.testing.clock.BoardClock`.
        recorded: whether it has a journal; in a world of a campaign nobody reads one.
    """

    board: Board
    file: BoardFile
    source: Source
    strict: bool
    budget: Limits
    covered: bool = False
    bring: Callable[[int], None] | None = None
    recorded: bool = True

    def __post_init__(self) -> None:
        board = self.board
        self._bytes = io.BytesIO()
        self._journal: Journal | None = None
        if self.recorded:
            self._journal = Journal(board, self._bytes, self.source.text, self.file.path)
        self.watch = HostWatch(board, self.budget, times=True)
        self.coverage: CoverageObserver | None = None
        if self.covered:
            from vbus.testing.plugins.suite_coverage import coverage_observer

            self.coverage = coverage_observer(board)
        self.judged: Judged = Judged()
        self.sorted: int = 0
        """How many of its violations are sorted into :attr:`judged`."""
        self.before_end: tuple[int, int] = (0, 0)
        """How many violations there were when the test ended: those that fail it, and those after
        a fault."""
        self.witness: Witness | None = None
        """What sees the run for a campaign."""
        self.missed: list[str] = []
        """Bytes that programs read outside the strobes that gave them."""
        self.slow: str = ""
        """What says that the machine was too slow for a program; "" if it was not."""
        self.served: ServedBoard | None = None
        self.address: str = ""
        self._wave: Any = None
        self._wave_text: TextIO = io.StringIO()
        excused = nullcontext if self.bring is not None else self.watch.excused
        self.clock = BoardClock(board, self.call, excused, self.bring)
        board.waits = self.clock.wait_until

    def call(self, what: Callable[[], _T]) -> _T:
        """Do something to the board while no host does."""
        return what() if self.served is None else self.served.call(what)

    def record_wave(self) -> None:
        """Record a waveform from now on."""
        from vbus.views.wave.wave import Wave

        self._wave = Wave(self.board, self._wave_text)
        self._wave.start()

    def journal(self) -> bytes:
        """End the journal and return it; b"" if it is not recorded."""
        if self._journal is not None:
            self.call(self._journal.close)
        return self._bytes.getvalue()

    def axes(self) -> list[str]:
        """Return what became of each axis: by the journal, so that a test that passes pays nothing.

        It is ended. A run of more than :data:`~vbus.cli.outcome.MOST_PLAYED` cycles gives no lines.
        """
        from vbus.cli.outcome import MOST_PLAYED, axes_played

        if self.watch.cycles > MOST_PLAYED:
            return []
        return axes_played(JournalReader(io.BytesIO(self.journal())), self.file.path)[0]

    def page(self) -> bytes:
        """Return what the journal holds as one page for a browser."""
        from vbus.nodes.machine import board_of
        from vbus.views.scope.page_file import one_file
        from vbus.views.scope.recording import replayed

        reader = JournalReader(io.BytesIO(self.journal()))
        board = board_of(reader.header, self.file.path)
        recorded = replayed(board, reader, reader.header.families)
        return one_file(recorded.description, recorded.frames)

    def wave(self) -> str:
        """End the waveform and return it; "" if there is none."""
        if self._wave is None:
            return ""
        self.call(self._wave.stop)
        text = self._wave_text.getvalue()  # type: ignore[attr-defined]
        self._wave = None
        return str(text)

    def faults(self) -> list[Any]:
        """Return every fault that was armed on the board."""
        # A board that never had one is not given any: that would be part of its state.
        return self.call(self.board.faults.all) if self.board.broken else []
