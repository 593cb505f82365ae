"""Equal bus cycles of a journal, made again: a replay does nothing as often."""

from typing import Any

from mypy_extensions import i64

from vbus.board.board import Board
from vbus.board.host_bus import HostBus
from vbus.kernel import END
from vbus.protocols.port import NotYet, PortError
from vbus.signals import Observer
from vbus.trace.journal.format import NOT_YET


class Again(Observer):
    """Makes stretches of equal bus cycles, each as long as it comes out as it was recorded.

    It also takes the bus cycles that come of strobes.

    Args:
        board: the board.
        found: what is found on it beside the cycles; it ends a stretch.

    Attributes:
        entry: number of the entry that is played.
        reply: of the cycle that came out otherwise; None of a write, and of one that was refused.
        error: number of its refusal; 0: it was not refused.
    """

    def __init__(self, board: Board, found: list[Any]) -> None:
        self.entry: int = 0
        self.reply: int | None = None
        self.error: int = 0
        self._board: Board = board
        self._found: list[Any] = found

    def bus_cycle(
        self, when: int, host: str, chip: str, write: bool, address: int, data: int
    ) -> None:
        """Take a cycle that strobes have made."""
        self._found.append((chip, write, address, data))

    def make(
        self, port: HostBus, write: bool, value: i64, number: i64, when: i64, span: i64, times: i64
    ) -> i64:
        """Make the cycles of a stretch; return how many came out as they were recorded.

        Args:
            port: of their session.
            write: whether the host writes.
            value: 256 times the address, plus the byte.
            number: of the first entry.
            when: instant of the first call (ps).
            span: what each takes (ps).
            times: how many there are.
        """
        board, found = self._board, self._found
        kernel = board.kernel
        address, byte = int(value >> 8), int(value & 0xFF)
        if when > kernel.now:
            board.run_until(when)
        board.limit = END
        self.reply, self.error = None if write else byte, 0
        same: i64 = 0
        try:
            while same < times:
                self.entry = int(number + same)
                when += span
                if write:
                    port.write(address, byte)
                else:
                    reply = port.read(address)
                    if reply != byte:
                        self.reply = reply
                        break
                if kernel.now != when or found:
                    break
                same += 1
        except NotYet:
            self.reply, self.error = None, NOT_YET
        except PortError as refusal:
            self.reply, self.error = None, refusal.code
        return same
