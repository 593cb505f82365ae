"""The calls of a journal, made again on a board."""

from collections import Counter
from collections.abc import Iterable, Iterator
from typing import Any, Final

from vbus.board import snapshot as snapshots
from vbus.board.board import Board
from vbus.board.host_bus import HostBus
from vbus.board.snapshot import Snapshot
from vbus.core.kernel import END, MS
from vbus.core.signals import Observer, Violation
from vbus.faults.row import LinkActs
from vbus.protocols.port import NotYet, PortError
from vbus.record.format import NOT_YET, OUTSIDE, Entry, JournalError
from vbus.record.view import violation_of

FINDINGS = frozenset(("violation", "cycle", "end", "fault", "made"))
"""Entries that tell what happened and are no calls."""
# Short enough that a server which plays goes on answering between two steps.
STRETCH: Final = 10 * MS
"""Chip time that passes in one step."""


class Player:
    """A board and its recorded calls: makes the calls of journal entries, at their instants.

    What plays a journal again is a use of it: a replay compares, :class:`RewoundRun` is for a board
    that goes back, :class:`~vbus.record.history.History` goes to and fro, and a copy of a
    board (``vbus scope``, fork) goes on from an instant.

    Args:
        board: a board built from the journal's board file.
    """

    def __init__(self, board: Board) -> None:
        self.board: Board = board
        self.ports: dict[int, HostBus] = {}
        """Sessions by their number in the journal; also of those that have ended."""
        # Links of the recorded run are not here; their faults are in the journal as what they did.
        board.serve_links(LinkActs())

    def run_to(self, entry: Entry) -> None:
        """Let time pass to the instant of an entry."""
        if entry.when > self.board.now:
            self.board.pass_until(entry.when)

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
        # A call that was not finished is not finished now: time may run as far as it could.
        held = entry.limit >= 0 or entry.error == NOT_YET
        self.board.limit = entry.limit if held else END
        if entry.op == "open":
            label, chips, cycle_ps = entry.args
            self.ports[entry.port] = self.board.open_port(label, chips, cycle_ps)
            return None, 0
        if entry.op == "arm":
            name, target, when, until, values = entry.args
            self.board.faults.arm(name, target, when, until, **values)
            return None, 0
        if entry.op == "clear":
            self.board.faults.clear(*entry.args)
            return None, 0
        if entry.op in OUTSIDE:
            if self.board.beyond is None:
                raise ValueError("this is of a node, and the board is none")
            self.board.beyond.replay(entry.op, entry.args)
            return None, 0
        port = self.ports.get(entry.port)
        if port is None:
            raise ValueError(f"session {entry.port} has not begun")
        name = "take_events" if entry.op == "edges" else entry.op
        try:
            return getattr(port, name)(*entry.args), 0
        except NotYet:
            return None, NOT_YET
        except PortError as error:
            return None, error.code

    def play(self, entry: Entry) -> None:
        """Come to an entry and make its call; what only tells of findings is passed over."""
        if entry.op not in FINDINGS:
            self.run_to(entry)
            self.call(entry)

    def up_to(self, entries: Iterable[Entry], to: int | None) -> Iterator[None]:
        """Play, step by step, what had returned by an instant, and let time pass to it.

        Args:
            entries: the journal's entries, in order.
            to: the instant (ps); None: the journal's end.
        """
        for entry in entries:
            if to is not None and entry.after > to:
                break
            if entry.op == "end" or entry.op not in FINDINGS:  # those come before their call
                yield from self._pass(entry.when)
            self.play(entry)
            if entry.op == "end":
                return
            yield
        if to is not None:
            yield from self._pass(to)

    def open_sessions(self) -> list[int]:
        """Return the numbers of the sessions that are open, in the order of their opening."""
        return [number for number, port in self.ports.items() if port in self.board.ports]

    def resume(self, snapshot: Snapshot, sessions: Iterable[int]) -> None:
        """Go on from a snapshot of the run.

        Args:
            snapshot: of the board.
            sessions: numbers of the sessions that were open, in the order of their opening.

        Raises:
            ValueError: the snapshot has more sessions than numbers, or fewer.
        """
        for number, host in zip(sessions, snapshot.hosts, strict=True):
            self.ports[number] = self.board.open_port(host.label, host.chips, host.cycle_ps)
        snapshots.restore(self.board, snapshot)

    def _pass(self, when: int) -> Iterator[None]:
        while self.board.now < when:
            self.board.pass_until(min(when, self.board.now + STRETCH))
            yield


Finding = Violation | tuple[Any, ...]
"""A violation, or the evidence of a fault as entries have it."""


class RewoundRun(Player, Observer):
    """A journal played up to an instant, for the board it is of to go back there.

    Args:
        board: a board built from the journal's board file.

    Attributes:
        kept: entries up to the last call that was played; what was found after it is found again.
    """

    def __init__(self, board: Board) -> None:
        super().__init__(board)
        self.kept: int = 0
        self._found: list[Finding] = []
        self._recorded: list[tuple[int, Finding]] = []
        """What the journal has, with the number of the entry."""
        board.listen(self)

    def play(self, entry: Entry) -> None:
        """Play an entry; note what was found before it."""
        super().play(entry)
        if entry.op in ("violation", "fault"):
            finding = violation_of(entry) if entry.op == "violation" else entry.args
            self._recorded.append((entry.number, finding))
        elif entry.op not in FINDINGS:
            self.kept = entry.number + 1

    def violation(self, violation: Violation) -> None:
        """Note a breach."""
        self._found.append(violation)

    def fault(self, when: int, name: str, target: str, what: str, text: str) -> None:
        """Note the evidence of a fault."""
        self._found.append((when, name, target, what, text))

    def leave(self) -> list[int]:
        """End every session; return the numbers of those that were open."""
        numbers = self.open_sessions()
        for number in numbers:
            self.ports[number].close()
        self.board.catch_up()
        return numbers

    def findings(self) -> list[Finding]:
        """Return what has been found and is not among the entries that are kept."""
        # Counted, not a set: the same finding may come several times at one instant.
        recorded = Counter(finding for number, finding in self._recorded if number < self.kept)
        rest = []
        for finding in self._found:
            if recorded[finding]:
                recorded[finding] -= 1
            else:
                rest.append(finding)
        return rest
