"""The calls of a journal, made again on a board."""

from typing import Any

from vbus.board.board import Board
from vbus.board.host_bus import HostBus
from vbus.kernel import END
from vbus.protocols.port import PortError
from vbus.trace.journal.format import Entry, JournalError

FINDINGS = frozenset(("violation", "cycle", "end", "fault"))
"""Entries that tell what happened and are no calls."""


class Player:
    """Makes the calls of journal entries, at their instants.

    Args:
        board: a board built from the journal's board file.
    """

    def __init__(self, board: Board) -> None:
        self.board: Board = board
        self.ports: dict[int, HostBus] = {}
        """Sessions by their number in the journal; also of those that have ended."""

    def run_to(self, entry: Entry) -> None:
        """Let time pass to the instant of an entry."""
        if entry.when > self.board.now:
            self.board.run_until(entry.when)

    def call(self, entry: Entry) -> tuple[Any, int]:
        """Make one call; return its reply and the number of its refusal, 0 if there was none.

        Raises:
            JournalError: no such call can be made on this board.
        """
        try:
            return self._call(entry)
        except ValueError as error:
            raise JournalError(f"entry {entry.number}, {entry.op}: {error}") from error

    def _call(self, entry: Entry) -> tuple[Any, int]:
        self.board.limit = entry.limit if entry.limit >= 0 else END
        if entry.op == "open":
            label, chips, cycle_ps = entry.args
            self.ports[entry.port] = self.board.open_port(label, chips, cycle_ps)
            return None, 0
        if entry.op == "arm":
            name, target, when, until, values = entry.args
            self.board.faults.links = _NoLinks()
            self.board.faults.arm(name, target, when, until, **values)
            return None, 0
        if entry.op == "clear":
            self.board.faults.clear(*entry.args)
            return None, 0
        port = self.ports.get(entry.port)
        if port is None:
            raise ValueError(f"session {entry.port} has not begun")
        name = "take_events" if entry.op == "edges" else entry.op
        try:
            return getattr(port, name)(*entry.args), 0
        except PortError as error:
            return None, error.code

    def play(self, entry: Entry) -> None:
        """Come to an entry and make its call; what only tells of findings is passed over."""
        if entry.op not in FINDINGS:
            self.run_to(entry)
            self.call(entry)


class _NoLinks:
    """Stands for the links of the recorded run: their faults changed nothing on the board."""

    def begin(self, number: int, name: str, target: str, once: bool) -> str:
        """Do nothing."""
        return ""

    def end(self, number: int) -> None:
        """Do nothing."""
