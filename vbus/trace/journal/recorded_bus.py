"""A host's port that writes down every call made on it."""

from collections.abc import Callable
from typing import Any, ClassVar, Final, TypeVar

from mypy_extensions import i64

from vbus.board.cards import Card
from vbus.board.host_bus import HostBus, Hosts
from vbus.chips.base import Chip
from vbus.circuit.circuit import Circuit
from vbus.kernel import Kernel
from vbus.protocols.port import PortError
from vbus.signals import Observer
from vbus.state import Names
from vbus.trace.journal.format import CODE
from vbus.trace.journal.rows import FLAG, LARGEST, NUMBER, PAIR, PORTS, JournalRows

T = TypeVar("T")

LINES: Final = CODE["lines"]
DRIVE: Final = CODE["drive"]
RELEASE: Final = CODE["release"]
SAMPLE: Final = CODE["sample"]
PIN: Final = CODE["pin"]
GETPIN: Final = CODE["getpin"]
DELAY: Final = CODE["delay"]
CYCLE: Final = CODE["cycle"]


class RecordedStrobes(Observer):
    """Writes down the bus cycles that a host makes by strobes.

    Args:
        board: the board.
        rows: where they are written down.
        key: of such a cycle of its session.
    """

    WIRING: ClassVar[Names] = ("*",)

    def __init__(self, board: Circuit, rows: JournalRows, key: i64) -> None:
        self._kernel: Kernel = board.kernel
        self._rows: JournalRows = rows
        self._key: i64 = key

    def bus_cycle(
        self, when: int, host: str, chip: str, write: bool, address: int, data: int
    ) -> None:
        """Write a cycle down."""
        self._rows.strobed(self._key, chip, write, address, data, when, self._kernel.now)


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
        self.polls.every_cycle = True
        self.strobes.found = RecordedStrobes(board, rows, number * PORTS + CYCLE)
        self._rows: JournalRows = rows
        self._session: i64 = number
        self._key: i64 = number * PORTS
        self._closed: bool = False
        self._note(board.now, "open", [label, [chip.name for chip in chips], cycle_ps], None)

    def _note(
        self, when: int, op: str, args: list[Any], reply: Any, error: int = 0, limit: int = -1
    ) -> None:
        key = self._key + CODE[op]
        self._rows.other(key, [args, reply, error, limit], when, self._kernel.now)

    def _called(
        self, op: str, args: list[int], call: Callable[..., T], may_wait: bool = False
    ) -> T:
        """Make a call of :class:`HostBus` and write it down, also if it is refused."""
        when = self._kernel.now
        try:
            reply = call(self, *args)
        except PortError as error:
            self._note(when, op, args, None, error.code)
            raise
        self._note(when, op, args, reply, 0, self.board.limit if may_wait and not reply else -1)
        return reply

    # -- bus cycles: the hot path -------------------------------------------------------------

    def read(self, address: int) -> int:
        """Run one read cycle and write it down."""
        kernel = self._kernel
        when = kernel.now
        try:
            data = HostBus.read(self, address)
        except PortError as error:
            self._note(when, "read", [address], None, error.code)
            raise
        self._rows.cycle(self._session, address << 9 | data, when, kernel.now)
        return data

    def write(self, address: int, data: int) -> None:
        """Run one write cycle and write it down."""
        kernel = self._kernel
        when = kernel.now
        try:
            HostBus.write(self, address, data)
        except PortError as error:
            self._note(when, "write", [address, data], None, error.code)
            raise
        self._rows.cycle(self._session, address << 9 | 0x100 | data & 0xFF, when, kernel.now)

    # -- everything else ----------------------------------------------------------------------

    def select(self, mask: int) -> None:
        """Choose the chips of following cycles."""
        self._called("select", [mask], HostBus.select)

    def claim(self) -> bool:
        """Hold the selected chips' bus."""
        return self._called("claim", [], HostBus.claim)

    def unclaim(self) -> None:
        """Let the bus go."""
        if self._closed:
            super().unclaim()
        else:
            self._called("unclaim", [], HostBus.unclaim)

    def wait(self, longest: int) -> tuple[bool, int] | None:
        """Let time pass until the selected chips can take a cycle."""
        return self._called("wait", [longest], HostBus.wait, may_wait=True)

    def delay(self, duration: int) -> bool:
        """Let time pass for this host."""
        when = self._kernel.now
        if duration > LARGEST:
            return self._called("delay", [duration], HostBus.delay, may_wait=True)
        try:
            passed = HostBus.delay(self, duration)
        except PortError as error:
            self._note(when, "delay", [duration], None, error.code)
            raise
        if passed:
            self._rows.call(
                self._key | DELAY, 1 | FLAG << 2, duration, 0, 1, 0, when, self._kernel.now
            )
        else:
            self._note(when, "delay", [duration], False, 0, self.board.limit)
        return passed

    def at(self, when: int) -> None:
        """Set the host's own clock."""
        self._called("at", [when], HostBus.at)

    def now(self) -> int:
        """Return chip time."""
        return self._called("now", [], HostBus.now)

    def sync(self) -> tuple[int, int]:
        """Bring the chips up to the host's time."""
        return self._called("sync", [], HostBus.sync)

    def lines(self, mask: int, levels: int) -> None:
        """Put control lines to levels."""
        when = self._kernel.now
        try:
            HostBus.lines(self, mask, levels)
        except PortError as error:
            self._note(when, "lines", [mask, levels], None, error.code)
            raise
        self._rows.call(self._key | LINES, 2, mask, levels, 0, 0, when, self._kernel.now)

    def drive(self, data: int) -> None:
        """Drive D0-D7."""
        when = self._kernel.now
        try:
            HostBus.drive(self, data)
        except PortError as error:
            self._note(when, "drive", [data], None, error.code)
            raise
        self._rows.call(self._key | DRIVE, 1, data, 0, 0, 0, when, self._kernel.now)

    def release(self) -> None:
        """Let D0-D7 float."""
        when = self._kernel.now
        try:
            HostBus.release(self)
        except PortError as error:
            self._note(when, "release", [], None, error.code)
            raise
        self._rows.call(self._key | RELEASE, 0, 0, 0, 0, 0, when, self._kernel.now)

    def sample(self) -> tuple[int, int]:
        """Return D0-D7 as they stand, and all output lines."""
        when = self._kernel.now
        try:
            data, outputs = HostBus.sample(self)
        except PortError as error:
            self._note(when, "sample", [], None, error.code)
            raise
        self._rows.call(self._key | SAMPLE, PAIR << 2, 0, 0, data, outputs, when, self._kernel.now)
        return data, outputs

    def pin(self, number: int, level: int) -> None:
        """Drive a side pin."""
        when = self._kernel.now
        try:
            HostBus.pin(self, number, level)
        except PortError as error:
            self._note(when, "pin", [number, level], None, error.code)
            raise
        self._rows.call(self._key | PIN, 2, number, level, 0, 0, when, self._kernel.now)

    def getpin(self, number: int) -> int:
        """Return the level of a side pin."""
        when = self._kernel.now
        try:
            level = HostBus.getpin(self, number)
        except PortError as error:
            self._note(when, "getpin", [number], None, error.code)
            raise
        self._rows.call(
            self._key | GETPIN, 1 | NUMBER << 2, number, 0, level, 0, when, self._kernel.now
        )
        return level

    def events(self, mask: int) -> None:
        """Report edges of these output lines from now on."""
        self._called("events", [mask], HostBus.events)

    def take_events(self) -> list[tuple[int, int]]:
        """Return and forget the edges seen since the last call."""
        when = self._kernel.now
        edges = super().take_events()
        if edges:
            self._note(when, "edges", [], edges)
        return edges

    def close(self) -> None:
        """The session has ended."""
        when = self._kernel.now
        first = not self._closed
        self._closed = True
        super().close()
        if first:
            self._note(when, "close", [], None)
