"""Hosts' ports under a journal, and how calls are written down.

``tests/unit/views/plain_recorder.py`` makes the same of a :class:`HostBus` in the plainest way;
``test_recorder.py`` holds their journals equal, byte for byte.
"""

# Compiled (LM629, a cycle with its entry): polls 154 ns and 689 ns by the plain recorder, 4.5
# times; a driver 2.7 times; a read by strobes 3.3 times.

from collections.abc import Callable
from typing import Any, ClassVar, Final, TypeVar

from mypy_extensions import i64

from vbus.board.card.cards import Card
from vbus.board.host_bus import HostBus, Hosts
from vbus.chips.base import Chip
from vbus.circuit.circuit import Circuit
from vbus.core.kernel import Kernel
from vbus.core.signals import Observer
from vbus.core.state import Names
from vbus.protocols.port import NotYet, PortError
from vbus.record.format import CODE, NOT_YET
from vbus.record.rows import FLAG, LARGEST, NUMBER, PAIR, PORTS, WRITE, JournalRows

T = TypeVar("T")

LINES: Final = CODE["lines"]
DRIVE: Final = CODE["drive"]
RELEASE: Final = CODE["release"]
SAMPLE: Final = CODE["sample"]
DELAY: Final = CODE["delay"]
CYCLE: Final = CODE["cycle"]
FORMS: Final = {
    LINES: 2,
    DRIVE: 1,
    RELEASE: 0,
    SAMPLE: PAIR << 2,
    CODE["pin"]: 2,
    CODE["getpin"]: 1 | NUMBER << 2,
    DELAY: 1 | FLAG << 2,
}
"""Form (:class:`~vbus.record.rows.Call`) of the calls that are a word when they come again,
by operation."""


class SessionRows(Observer):
    """Writes down the calls of one session, and the bus cycles that its host makes by strobes.

    Args:
        board: the board.
        rows: where they are written down.
        number: of the session in the journal.
        label: the host's name.
        chips: what the session may select, in order.
        cycle_ps: cost of a whole cycle; 0 for the default.
    """

    WIRING: ClassVar[Names] = ("*",)

    def __init__(
        self, board: Circuit, rows: JournalRows, number: int, label: str, chips: list[Chip],
        cycle_ps: int,
    ) -> None:  # fmt: skip
        self._board: Circuit = board
        self._kernel: Kernel = board.kernel
        self._rows: JournalRows = rows
        self._session: i64 = number
        self._key: i64 = number * PORTS
        self._closed: bool = False
        self.note(board.now, "open", [label, [chip.name for chip in chips], cycle_ps], None)

    def bus_cycle(
        self, when: int, host: str, chip: str, write: bool, address: int, data: int
    ) -> None:
        """Write a cycle down that strobes have made."""
        self._rows.strobed(self._key + CYCLE, chip, write, address, data, when, self._kernel.now)

    def note(
        self, when: int, op: str, args: list[Any], reply: Any, error: int = 0, limit: int = -1
    ) -> None:
        """Write a call down, in the shortest form that it has.

        Args:
            when: instant at which it was made (ps).
            op: one of :data:`~vbus.record.format.OPERATIONS`.
            args: what was asked.
            reply: what was answered, if anything.
            error: number of the refusal; 0: it was not refused.
            limit: of a call that is not finished: how far time was allowed to go (ps); else -1.
        """
        code = CODE[op]
        now = self._kernel.now
        if error != 0 or limit >= 0 or (code > WRITE and code not in FORMS):
            self._rows.other(self._key + code, [args, reply, error, limit], when, now)
        elif code <= WRITE:
            data = args[1] & 0xFF if code == WRITE else reply
            self._rows.cycle(self._session, args[0] << 9 | code << 8 | data, when, now)
        elif args and args[0] > LARGEST:
            self._rows.other(self._key + code, [args, reply, error, limit], when, now)
        else:
            first, second = [*args, 0, 0][:2]
            answer, more = reply if code == SAMPLE else (int(reply or 0), 0)
            self._rows.call(self._key + code, FORMS[code], first, second, answer, more, when, now)

    def refused(self, when: int, op: str, args: list[Any], error: Exception) -> None:
        """Write down a call that was refused, or that time has to run on for first."""
        if isinstance(error, PortError):
            self.note(when, op, args, None, error.code)
        else:
            self.note(when, op, args, None, NOT_YET, self._board.limit)

    def call(self, port: HostBus, op: str, args: list[Any], call: Callable[..., T]) -> T:
        """Make a call of the session's port and write it down, also if it is refused or unfinished.

        Args:
            port: whose call it is.
            op: its operation.
            args: what is asked.
            call: the method that makes it; of edges it gives none, nothing is written.
        """
        # The end of a session lets its lines go by calls of its own; a replay's end makes them
        # again.
        if self._closed:  # what a session lets go of when it ends is part of its end
            return call(port, *args)
        when = self._kernel.now
        try:
            reply = call(port, *args)
        except (NotYet, PortError) as error:
            self.refused(when, op, args, error)
            raise
        if reply or op != "edges":
            waits = op in ("wait", "delay") and not reply
            self.note(when, op, args, reply, 0, self._board.limit if waits else -1)
        return reply

    def end(self, port: HostBus, close: Callable[..., None]) -> None:
        """Close the session's port; write it down the first time."""
        when, first = self._kernel.now, not self._closed
        self._closed = True
        close(port)
        if first:
            self.note(when, "close", [], None)


class RecordedBus(HostBus):
    """A :class:`HostBus` under a journal.

    Args:
        board: the board.
        hosts: its hosts.
        label: the host's name in traces.
        chips: what the session may select, in order.
        cycle_ps: cost of a whole cycle; 0 for the default.
        card: address decoding, if any.
        rows: where calls are written down.
        number: of this session in the journal.
    """

    def __init__(
        self,
        board: Circuit,
        hosts: Hosts,
        label: str,
        chips: list[Chip],
        cycle_ps: int,
        card: Card | None,
        rows: JournalRows,
        number: int,
    ) -> None:
        super().__init__(board, hosts, label, chips, cycle_ps, card)
        self._notes: SessionRows = SessionRows(board, rows, number, label, chips, cycle_ps)
        # A poll answered from memory would be missing from the journal.
        self.polls.every_cycle = True
        self.strobes.found = self._notes
        self._rows: JournalRows = rows
        self._session: i64 = number
        self._key: i64 = number * PORTS

    # -- bus cycles: the hot path -------------------------------------------------------------

    def read(self, address: int) -> int:
        """Run one read cycle and write it down."""
        kernel = self.kernel
        when = kernel.now
        try:
            data = HostBus.read(self, address)
        except (NotYet, PortError) as error:
            self._notes.refused(when, "read", [address], error)
            raise
        self._rows.cycle(self._session, address << 9 | data, when, kernel.now)
        return data

    def write(self, address: int, data: int) -> None:
        """Run one write cycle and write it down."""
        kernel = self.kernel
        when = kernel.now
        try:
            HostBus.write(self, address, data)
        except (NotYet, PortError) as error:
            self._notes.refused(when, "write", [address, data], error)
            raise
        self._rows.cycle(self._session, address << 9 | 0x100 | data & 0xFF, when, kernel.now)

    # -- what strobes are made of: hot, too ---------------------------------------------------

    def lines(self, mask: int, levels: int) -> None:
        """Put control lines to levels."""
        when = self.kernel.now
        try:
            HostBus.lines(self, mask, levels)
        except (NotYet, PortError) as error:
            self._notes.refused(when, "lines", [mask, levels], error)
            raise
        self._rows.call(self._key | LINES, 2, mask, levels, 0, 0, when, self.kernel.now)

    def drive(self, data: int) -> None:
        """Drive D0-D7."""
        when = self.kernel.now
        try:
            HostBus.drive(self, data)
        except (NotYet, PortError) as error:
            self._notes.refused(when, "drive", [data], error)
            raise
        self._rows.call(self._key | DRIVE, 1, data, 0, 0, 0, when, self.kernel.now)

    def release(self) -> None:
        """Let D0-D7 float."""
        when = self.kernel.now
        try:
            HostBus.release(self)
        except (NotYet, PortError) as error:
            self._notes.refused(when, "release", [], error)
            raise
        self._rows.call(self._key | RELEASE, 0, 0, 0, 0, 0, when, self.kernel.now)

    def sample(self) -> tuple[int, int]:
        """Return D0-D7 as they stand, and all output lines."""
        when = self.kernel.now
        try:
            data, outputs = HostBus.sample(self)
        except (NotYet, PortError) as error:
            self._notes.refused(when, "sample", [], error)
            raise
        self._rows.call(self._key | SAMPLE, PAIR << 2, 0, 0, data, outputs, when, self.kernel.now)
        return data, outputs

    def delay(self, duration: int) -> bool:
        """Let time pass for this host."""
        when = self.kernel.now
        # Beyond 62 bits the number is no machine word of a compiled core.
        if duration > LARGEST:
            return self._notes.call(self, "delay", [duration], HostBus.delay)
        try:
            passed = HostBus.delay(self, duration)
        except PortError as error:
            self._notes.refused(when, "delay", [duration], error)
            raise
        if passed:
            self._rows.call(
                self._key | DELAY, 1 | FLAG << 2, duration, 0, 1, 0, when, self.kernel.now
            )
        else:
            self._notes.note(when, "delay", [duration], False, 0, self.board.limit)
        return passed

    # -- everything else ----------------------------------------------------------------------

    def select(self, mask: int) -> None:
        """Choose the chips of following cycles."""
        self._notes.call(self, "select", [mask], HostBus.select)

    def claim(self) -> bool:
        """Hold the selected chips' bus."""
        return self._notes.call(self, "claim", [], HostBus.claim)

    def unclaim(self) -> None:
        """Let the bus go."""
        self._notes.call(self, "unclaim", [], HostBus.unclaim)

    def wait(self, longest: int) -> tuple[bool, int] | None:
        """Let time pass until the selected chips can take a cycle."""
        return self._notes.call(self, "wait", [longest], HostBus.wait)

    def at(self, when: int) -> None:
        """Set the host's own clock."""
        self._notes.call(self, "at", [when], HostBus.at)

    def now(self) -> int:
        """Return chip time."""
        return self._notes.call(self, "now", [], HostBus.now)

    def sync(self) -> tuple[int, int]:
        """Bring the chips up to the host's time."""
        return self._notes.call(self, "sync", [], HostBus.sync)

    def pin(self, number: int, level: int) -> None:
        """Drive a side pin."""
        self._notes.call(self, "pin", [number, level], HostBus.pin)

    def getpin(self, number: int) -> int:
        """Return the level of a side pin."""
        return self._notes.call(self, "getpin", [number], HostBus.getpin)

    def events(self, mask: int) -> None:
        """Report edges of these output lines from now on."""
        self._notes.call(self, "events", [mask], HostBus.events)

    def take_events(self) -> list[tuple[int, int]]:
        """Return and forget the edges seen since the last call."""
        return self._notes.call(self, "edges", [], HostBus.take_events)

    def close(self) -> None:
        """The session has ended."""
        self._notes.end(self, HostBus.close)
