"""A chip's side of its host bus: edges on the control lines become what its bus table says."""

from functools import lru_cache
from typing import ClassVar

from mypy_extensions import i64, mypyc_attr

from vbus.chips.base import Chip
from vbus.chips.bus_watch import BusTable, Strobe
from vbus.core.signals import Pin, Watcher
from vbus.core.state import Names


@lru_cache(maxsize=64)
def _unknown(lines: tuple[str, ...], rows: tuple[Strobe, ...]) -> list[tuple[str, ...] | None]:
    """Return the actions by levels before and after, which all chips with a table share."""
    # A bus has four control lines: 256 places, found by index and filled as edges come.
    return [None] * (1 << 2 * len(lines))


@mypyc_attr(allow_interpreted_subclasses=True)
class BusFrontEnd:
    """Carries out the actions of a chip's bus table (:attr:`~vbus.chips.base.Chip.BUS`).

    As it is, it makes cycles of edges: for a chip that judges no times.

    Args:
        chip: the chip.
    """

    STATE: ClassVar[Names] = ()
    WIRING: ClassVar[Names] = ("_actions", "own")
    DERIVED: ClassVar[Names] = ("_looked", "_seen")

    def __init__(self, chip: Chip) -> None:
        assert chip.BUS is not None
        self._table: BusTable = chip.BUS
        self.chip: Chip = chip
        lines = self._table.lines
        self._lines: tuple[Pin, ...] = tuple([chip.pins[name] for name in lines])
        self._width: i64 = len(lines)
        self._actions: list[tuple[str, ...] | None] = _unknown(lines, self._table.strobes)
        self.address_pin: Pin = chip.pins[self._table.address or lines[0]]
        # Lines may follow one another within a batch: each edge counts once.
        self._looked: int = -1
        self._seen: i64 = 0
        chip.front = self
        # One watcher for all lines: those that move together are one event.
        self.own: Watcher = Watcher(chip.kernel, self.moved)
        self.ears: tuple[Watcher, ...] = (self.own,)
        """All that hears the bus for the chip."""
        for pin in self._lines:
            pin.net.watch(self.own)

    def forget_edges(self) -> None:
        """Take the lines as they stand: no edge has been, and no time is judged from one."""

    def conclude(self) -> None:
        """Whole cycles have the bus from now on: end what still waits after the last edge."""

    def reading(self) -> int:
        """Return which kind of read is under way, of those that whole cycles disturb; 0: none."""
        return 0

    def resume(self, reading: int) -> None:
        """Go on with a read of that kind: whole cycles have been since."""

    def levels(self) -> i64:
        """Return the levels of the control lines, a bit each, that of the first highest."""
        levels: i64 = 0
        for pin in self._lines:
            levels = (
                levels << 1 | pin.net.value & 1
            )  # a host may drive more of an address than this line
        return levels

    def apart(self, levels: i64) -> tuple[int, ...]:
        """Return such levels one by one."""
        return tuple([int(levels) >> n & 1 for n in range(len(self._lines) - 1, -1, -1)])

    def moved(self) -> None:
        """One or more control lines have moved at this instant."""
        self.chip.advance()  # what the chip finds by now comes before what its host does now
        batch = self.chip.kernel.batch
        before: i64 = self._seen
        # The first look in a batch: the levels before it are what the nets say.
        if self._looked != batch:
            before = 0
            for pin in self._lines:
                before = before << 1 | pin.net.before & 1
        self._looked = batch
        self._seen = self.levels()
        self.edges(before, self._seen)

    def edges(self, before: i64, after: i64) -> None:
        """Carry out what comes of lines that move from some levels to others."""
        key = before << self._width | after
        actions = self._actions[key]
        # The table is asked once for each pair of levels.
        if actions is None:
            actions = self._actions[key] = self._table.actions(
                self.apart(before), self.apart(after)
            )
        for action in actions:
            self.act(action, before, after)

    def act(self, action: str, before: i64, after: i64) -> None:
        """Carry out one action of the table.

        Args:
            action: which.
            before: levels of the control lines before the edge.
            after: levels after it.
        """
        chip = self.chip
        if action == "begin":
            chip.begin_read(self.address_pin.net.value)
            chip.data_pin.drive(chip.read_byte())
        elif action == "take":
            chip.end_read()
            chip.data_pin.release()
        elif action == "write":
            # What moves together with the edge that ends a write comes too late for it.
            chip.write(self.address_pin.net.before, chip.bus_net.before)
