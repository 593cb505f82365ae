"""A host's port that writes down every call made on it."""

from typing import Any

from mypy_extensions import i64

from vbus.board.cards import Card
from vbus.board.circuit import Circuit
from vbus.board.host_bus import HostBus, Hosts
from vbus.chips.base import Chip
from vbus.protocols.port import PortError
from vbus.trace.journal.format import CODE, PORTS
from vbus.trace.journal.rows import JournalRows


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
        self.every_cycle = True
        self.strobes.found = self._strobed
        self._rows: JournalRows = rows
        self._session: i64 = number
        self._closed: bool = False
        self._note(board.now, "open", [label, [chip.name for chip in chips], cycle_ps], None)

    def _note(
        self, when: int, op: str, args: list[Any], reply: Any, error: int = 0, limit: int = -1
    ) -> None:
        key = self._session * PORTS + CODE[op]
        self._rows.other(key, [args, reply, error, limit], when, self._kernel.now)

    def _refused(self, when: int, op: str, args: list[Any], error: PortError) -> None:
        self._note(when, op, args, None, error.code)

    # -- bus cycles: the hot path -------------------------------------------------------------

    def read(self, address: int) -> int:
        """Run one read cycle and write it down."""
        kernel = self._kernel
        when = kernel.now
        try:
            data = HostBus.read(self, address)
        except PortError as error:
            self._refused(when, "read", [address], error)
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
            self._refused(when, "write", [address, data], error)
            raise
        self._rows.cycle(self._session, address << 9 | 0x100 | data & 0xFF, when, kernel.now)

    # -- everything else ----------------------------------------------------------------------

    def select(self, mask: int) -> None:
        """Choose the chips of following cycles."""
        when = self._kernel.now
        try:
            super().select(mask)
        except PortError as error:
            self._refused(when, "select", [mask], error)
            raise
        self._note(when, "select", [mask], None)

    def claim(self) -> bool:
        """Hold the selected chips' bus."""
        when = self._kernel.now
        got = super().claim()
        self._note(when, "claim", [], got)
        return got

    def unclaim(self) -> None:
        """Let the bus go."""
        when = self._kernel.now
        super().unclaim()
        if not self._closed:
            self._note(when, "unclaim", [], None)

    def wait(self, longest: int) -> tuple[bool, int] | None:
        """Let time pass until the selected chips can take a cycle."""
        when, limit = self._kernel.now, self.board.limit
        result = super().wait(longest)
        self._note(when, "wait", [longest], result, 0, limit if result is None else -1)
        return result

    def delay(self, duration: int) -> bool:
        """Let time pass for this host."""
        when, limit = self._kernel.now, self.board.limit
        try:
            done = super().delay(duration)
        except PortError as error:
            self._refused(when, "delay", [duration], error)
            raise
        self._note(when, "delay", [duration], done, 0, -1 if done else limit)
        return done

    def at(self, when: int) -> None:
        """Set the host's own clock."""
        called = self._kernel.now
        try:
            super().at(when)
        except PortError as error:
            self._refused(called, "at", [when], error)
            raise
        self._note(called, "at", [when], None)

    def now(self) -> int:
        """Return chip time."""
        when = self._kernel.now
        now = super().now()
        self._note(when, "now", [], now)
        return now

    def sync(self) -> tuple[int, int]:
        """Bring the chips up to the host's time."""
        when = self._kernel.now
        result = super().sync()
        self._note(when, "sync", [], result)
        return result

    def lines(self, mask: int, levels: int) -> None:
        """Put control lines to levels."""
        when = self._kernel.now
        try:
            super().lines(mask, levels)
        except PortError as error:
            self._refused(when, "lines", [mask, levels], error)
            raise
        self._note(when, "lines", [mask, levels], None)

    def _strobed(self, when: int, chip: str, write: bool, address: int, data: int) -> None:
        self._note(when, "cycle", [chip, write, address, data], None)

    def drive(self, data: int) -> None:
        """Drive D0-D7."""
        when = self._kernel.now
        try:
            super().drive(data)
        except PortError as error:
            self._refused(when, "drive", [data], error)
            raise
        self._note(when, "drive", [data], None)

    def release(self) -> None:
        """Let D0-D7 float."""
        when = self._kernel.now
        try:
            super().release()
        except PortError as error:
            self._refused(when, "release", [], error)
            raise
        self._note(when, "release", [], None)

    def sample(self) -> tuple[int, int]:
        """Return D0-D7 as they stand, and all output lines."""
        when = self._kernel.now
        try:
            result = super().sample()
        except PortError as error:
            self._refused(when, "sample", [], error)
            raise
        self._note(when, "sample", [], result)
        return result

    def pin(self, number: int, level: int) -> None:
        """Drive a side pin."""
        when = self._kernel.now
        try:
            super().pin(number, level)
        except PortError as error:
            self._refused(when, "pin", [number, level], error)
            raise
        self._note(when, "pin", [number, level], None)

    def getpin(self, number: int) -> int:
        """Return the level of a side pin."""
        when = self._kernel.now
        try:
            level = super().getpin(number)
        except PortError as error:
            self._refused(when, "getpin", [number], error)
            raise
        self._note(when, "getpin", [number], level)
        return level

    def events(self, mask: int) -> None:
        """Report edges of these output lines from now on."""
        when = self._kernel.now
        try:
            super().events(mask)
        except PortError as error:
            self._refused(when, "events", [mask], error)
            raise
        self._note(when, "events", [mask], None)

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
