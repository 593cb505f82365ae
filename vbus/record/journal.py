"""The journal: everything hosts did to a board, so that a run can be repeated exactly."""

import hashlib
import platform
from collections.abc import Callable, Iterable
from typing import Any, BinaryIO

from vbus.board.board import Board
from vbus.board.host_bus import HostBus
from vbus.circuit.stream import settings_for_decoders
from vbus.core.errors import VbusError
from vbus.core.signals import Observer, Violation
from vbus.record.format import CODE, Header, header_block, rows_block
from vbus.record.recorded_bus import RecordedBus
from vbus.record.rows import PORTS, JournalRows
from vbus.version import __version__


def end_of(board: Board) -> tuple[str, str, int]:
    """Return what a run comes to.

    Returns:
        The board's state hash; a hash over what the chips tell of themselves;
        and how often nets have had observers. State hashes can be compared where that is 0,
        the others always.
    """
    telemetry = [(chip.name, sorted(chip.telemetry().items())) for chip in board.chips]
    return (
        board.state_hash(),
        hashlib.sha256(repr(telemetry).encode()).hexdigest(),
        board.kernel.observations,
    )


class Journal(Observer):
    """Writes down every call on every port of a board, and every violation.

    Attach it before the first port is opened. Entries are written in blocks: when some thousand
    have come, whenever the board catches up, and at the end. Each block is handed to the file in
    one piece, so what was written stays readable whatever happens to the process; give it a file
    without a buffer of its own.

    A file that takes no more (a full disk) ends the journal; the board goes on.

    Args:
        board: a board without open ports.
        file: takes the bytes.
        text: the board file, for replays; empty for a board made in Python.
        name: name of the board file.
        report: takes a sentence when the file takes no more.
        port: makes the ports that are written down; for tests.
    """

    def __init__(
        self,
        board: Board,
        file: BinaryIO,
        text: str = "",
        name: str = "",
        report: Callable[[str], None] | None = None,
        port: Callable[..., HostBus] = RecordedBus,
    ) -> None:
        if board.ports:
            raise VbusError("a journal must be attached before the first port is opened")
        self.board: Board = board
        self.rows: JournalRows = JournalRows(self.flush)
        """What is not written yet."""
        self.entries: int = 0
        """Entries written that no jump has undone."""
        self.bytes: int = 0
        """Bytes written."""
        self.error: str = ""
        """Why the file takes no more, or ""."""
        self._file: BinaryIO = file
        self._report: Callable[[str], None] | None = report
        self._ports: int = 0
        header = Header(
            board.name,
            name,
            text,
            hashlib.sha256(text.encode()).hexdigest(),
            board.seed,
            board.policy,
            {chip.name: chip.FAMILY for chip in board.chips},
            __version__,
            platform.python_version(),
            settings=settings_for_decoders(board.chips),
        )
        self._write(header_block(header))
        self._recorded: Callable[..., HostBus] = port
        self._plain: Callable[..., HostBus] = board.port_type
        board.port_type = self._port
        # Violations alone: which cycles there were follows from the calls.
        board.listen(self)

    def _port(self, *asked: object) -> HostBus:
        self._ports += 1
        return self._recorded(*asked, self.rows, self._ports - 1)

    def violation(self, violation: Violation) -> None:
        """Write a finding down."""
        self._note("violation", [*violation])

    def fault(self, when: int, name: str, target: str, what: str, text: str) -> None:
        """Write the evidence of a fault down."""
        self._note("fault", [when, name, target, what, text])

    def outside(self, order: str, values: list[object]) -> None:
        """Write down what has reached the board beside its hosts' calls."""
        self._note(order, values)

    def _note(self, op: str, values: list[Any]) -> None:
        now = self.board.now
        self.rows.other(CODE[op], values, now, now)

    def jump(self, kept: int, left: int, ended: Iterable[int]) -> None:
        """The board has gone back and stands there now: what was undone stays in the file.

        Args:
            kept: entries that stay, of those that are written.
            left: the instant it went from (ps).
            ended: numbers of the sessions that were open there; they have no host now.
        """
        self.flush()
        now = self.board.now
        self._note("jump", [kept, now, left])
        self._write(rows_block(self.entries, *self.rows.take()))
        self.entries = kept
        for number in ended:
            self.rows.other(number * PORTS + CODE["close"], [[], None, 0, -1], now, now)

    def settled(self, now: int) -> None:
        """The board has caught up: write what there is."""
        self.flush()

    def flush(self) -> None:
        """Write what is not written yet."""
        count = self.rows.pending
        if count:
            first = self.entries
            self.entries += count
            self._write(rows_block(first, *self.rows.take()))

    def settle(self, sync: Callable[[], object] | None = None) -> bool:
        """Write what there is before a host gets its answer; tell whether the file holds it.

        Args:
            sync: waits until the disk has it too.
        """
        self.flush()
        if sync is not None and not self.error:
            try:
                sync()
            except OSError as error:
                self._end(error)
        return not self.error

    def ending(self) -> bytes:
        """Return what would end a copy of the file as it stands now: the end of a run that goes on.

        Raises:
            VbusError: the file takes no more, so it has not all there is.
        """
        self.flush()
        if self.error:
            raise VbusError(self.error)
        rows, now = self.rows.following(), self.board.now
        rows.other(CODE["end"], [self.entries, *end_of(self.board)], now, now)
        return rows_block(self.entries, *rows.take())

    def _write(self, data: bytes) -> None:
        if self.error:
            return
        try:
            while data:
                # A file without a buffer may take a part alone.
                done = self._file.write(data)
                taken = len(data) if done is None else done
                self.bytes += taken
                data = data[taken:]
            self._file.flush()
        except (OSError, ValueError) as error:
            self._end(error)

    def _end(self, error: Exception) -> None:
        """The file takes no more."""
        reason = error.strerror if isinstance(error, OSError) else str(error)
        self.error = f"the journal ends after {self.bytes} bytes: {reason}"
        if self._report is not None:
            self._report(self.error)

    def close(self) -> None:
        """End the journal with the board's state hash; the file is left open. May be repeated."""
        # It has been closed, or another recorder has come after it.
        if self.board.port_type != self._port:
            return
        self.board.port_type = self._plain
        end = end_of(self.board)
        self._note("end", [self.entries + self.rows.pending, *end])
        self.flush()
        self.board.listeners.remove(self)
