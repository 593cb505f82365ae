"""Bus cycles of a host that moves the control lines itself, told as those of any other host."""

from collections.abc import Callable
from typing import ClassVar, Final

from vbus.board import plugins
from vbus.board.circuit import Circuit
from vbus.chips.base import Chip
from vbus.signals import Net
from vbus.state import Names
from vbus.trace.bus_watch import BusWatch

SETTLE_EVERY: Final = 4096
"""Bus cycles after which lazy chips are brought up to date, to bound what observers hold."""

Found = Callable[[int, str, bool, int, int], None]
"""Takes a bus cycle: instant (ps), names of the chips, write, address, byte."""


class StrobeWatch:
    """Sees a host's strobes as bus cycles; cycles played by the board itself are not seen here.

    A cycle is told after the chip has acted on the edge that ends it. Chips of families whose bus
    nobody has described are passed over.

    Args:
        board: the board, whose observers are told.
        label: the host's name.
        chips: chips whose strobes the host can move.
    """

    STATE: ClassVar[Names] = ("watches: parts",)
    WIRING: ClassVar[Names] = ("_board", "_label", "_rows", "found")
    DERIVED: ClassVar[Names] = ("_noted", "_cycles")

    def __init__(self, board: Circuit, label: str, chips: list[Chip]) -> None:
        self.found: Found | None = None
        """Takes each cycle too, before the observers: for a journal."""
        self._board: Circuit = board
        self._label: str = label
        self._rows: list[_Row] = []
        for chip in chips:
            follow = plugins.family(chip.FAMILY).load("bus", BusWatch)
            if follow is not None:
                self._rows.append(_Row(chip, follow()))
        self._cycles: int = 0
        self._noted: bool = False

    def before(self) -> None:
        """Lines are about to move: note how they stand, if anybody wants to know."""
        if self.found is None and not self._board.observers:
            return
        self._noted = True
        for row in self._rows:
            row.chip.advance()
        self._board.kernel.settle()
        for row in self._rows:
            row.levels = row.look()
            row.data = row.chip.bus_net.value

    def after(self) -> None:
        """Lines have moved: tell the cycles that ended."""
        if not self._noted:
            return
        self._noted = False
        now = self._board.now
        writes: dict[tuple[int, int], str] = {}
        for row in self._rows:
            levels = row.look()
            if levels == row.levels:
                continue
            for cycle in row.watch.edges(now, row.levels, levels, row.data, row.data):
                name = row.chip.name
                if cycle.write:
                    # Chips written by one strobe are written together, as in a whole cycle.
                    key = (cycle.address, cycle.data)
                    writes[key] = f"{writes[key]}+{name}" if key in writes else name
                else:
                    self._tell(now, name, False, cycle.address, cycle.data)
        for (address, data), names in writes.items():
            self._tell(now, names, True, address, data)

    @property
    def watches(self) -> list[BusWatch]:
        """What follows the bus of each chip."""
        return [row.watch for row in self._rows]

    def _tell(self, when: int, chip: str, write: bool, address: int, data: int) -> None:
        if self.found is not None:
            self.found(when, chip, write, address, data)
        for observer in self._board.observers:
            observer.bus_cycle(when, self._label, chip, write, address, data)
        self._cycles += 1
        if self._cycles % SETTLE_EVERY == 0:
            self._board.catch_up()


class _Row:
    """One chip: its control lines, and how they stood."""

    DERIVED: ClassVar[Names] = ("*",)

    def __init__(self, chip: Chip, watch: BusWatch) -> None:
        self.chip: Chip = chip
        self.watch: BusWatch = watch
        self.levels: tuple[int, ...] = ()
        self.data: int = 0
        self._nets: list[Net] = []

    def look(self) -> tuple[int, ...]:
        """Return the levels of the control lines."""
        if not self._nets:
            self._nets = [self.chip.pins[name].net for name in self.watch.PINS]
        return tuple([net.value for net in self._nets])
