"""Bus cycles of a host that moves the control lines itself, reported as those of any host."""

from typing import ClassVar, Final

from vbus.chips.base import Chip
from vbus.chips.bus_watch import BusWatch, watch_by
from vbus.circuit.circuit import Circuit
from vbus.circuit.glue_cycles import BusLines, CycleTeller, Ended
from vbus.core.signals import Net, Observer
from vbus.core.state import Names
from vbus.protocols.quantities import format_instant

SETTLE_EVERY: Final = 4096
"""Bus cycles after which lazy chips are brought up to date, to bound what observers hold."""
_NOT: Final = -1
"""The host has not looked at D0-D7."""
_WITHIN: Final = -2
"""It has looked while a chip drove them: what stands there may change until the strobe ends."""


def missed_byte(chip: str, count: int, saw: int, gave: int, when: int) -> str:
    """Say that a host has looked for bytes of a chip outside the strobes that gave them.

    Args:
        chip: its name.
        count: bytes.
        saw: what the host saw in place of the first.
        gave: what the chip gave.
        when: its instant (ps).
    """
    times = f"; {count} bytes in all" if count > 1 else ""
    return (
        f"{chip}: the host took {saw:02X}h where the chip gave {gave:02X}h at"
        f" {format_instant(when)}: it looked at D0-D7 before its read strobe was low, or after"
        f" that (t_AC, t_DF); look while the strobe is low{times}"
    )


class StrobeWatch(CycleTeller):
    """Sees a host's strobes as bus cycles; cycles played by the board itself are not seen here.

    A cycle is reported after the chip has acted on the edge that ends it. Chips of families without
    a bus table are passed over, and so are those behind glue, whose cycles
    :class:`~vbus.circuit.glue_cycles.GlueCycles` sees.

    Args:
        board: the board, whose observers get the cycles.
        label: the host's name.
        chips: chips whose strobes the host can move.
    """

    STATE: ClassVar[Names] = ("watches: parts",)
    WIRING: ClassVar[Names] = ("_board", "_label", "_latched", "_rows", "found")
    DERIVED: ClassVar[Names] = ("_noted", "_cycles", "_looked", "_looks")

    def __init__(self, board: Circuit, label: str, chips: list[Chip]) -> None:
        self.found: Observer | None = None
        """Gets each cycle before the board's observers: for a journal."""
        self._board: Circuit = board
        self._label: str = label
        self._rows: list[BusLines] = []
        through = board.through.chips if board.through is not None else ()
        for chip in chips:
            if chip in through:
                continue
            if chip.BUS is not None:
                self._rows.append(BusLines(chip, watch_by(chip.BUS)))
        self._latched: bool = any(row.remembers for row in self._rows)
        self._cycles: int = 0
        self._noted: bool = False
        self._looked: int = _NOT
        """What the host has seen on D0-D7 since the last cycle, when it looked last."""
        self._looks: bool = False
        """The host looks at D0-D7: what chips give is compared with it."""

    def look(self, net: Net) -> None:
        """The host looks at D0-D7, which are on a net."""
        self._looks = True
        driven = any(pin.level >= 0 for pin in net.pins)
        self._looked = _WITHIN if driven else net.value

    def goes_through_glue(self) -> None:
        """What comes to chips through glue from now on comes of this host."""
        if self._board.through is not None:
            self._board.through.by = self

    def passes_glue_by(self) -> None:
        """This host moves what is behind the glue, or has gone."""
        if self._board.through is not None:
            self._board.through.by = None

    def before(self) -> None:
        """Lines are about to move: note how they stand, if a reader wants to know."""
        self.goes_through_glue()
        self._noted = False
        # A latched address is state: it is followed without a reader, so that state is the same.
        if not self._latched and not self.wanted():
            return
        for row in self._rows:
            row.levels = row.look()
            row.under_way = row.busy(row.levels)
            if row.under_way:
                row.chip.advance()
                self._noted = True
        if self._noted:
            self._board.kernel.settle()
            for row in self._rows:
                if row.under_way:
                    row.data = row.chip.bus_net.value

    def after(self) -> None:
        """Lines have moved: tell the cycles that ended."""
        if not self._noted:
            return
        self._noted = False
        now = self._board.now
        found: list[Ended] | None = None
        for row in self._rows:
            if row.under_way:
                before = row.levels
                row.levels = row.look()
                if row.levels != before:
                    ended = row.ended(now, before, row.data)
                    found = found + ended if found else ended
        if found:
            self.tell_together(now, found)

    @property
    def watches(self) -> list[BusWatch]:
        """What follows the bus of each chip."""
        return [row.watch for row in self._rows]

    def wanted(self) -> bool:
        """Tell whether anything wants to know of cycles."""
        return self.found is not None or self._looks or bool(self._board.observers)

    def tell(self, when: int, chip: str, write: bool, address: int, data: int) -> None:
        """Tell of a cycle: the journal, then the observers."""
        # A look after the strobe before this one is told by this one's byte, if that differs.
        if not write and self._looked not in (_NOT, _WITHIN, data):
            first = self._board.missed.get(chip, (0, self._looked, data, when))
            self._board.missed[chip] = (first[0] + 1, first[1], first[2], first[3])
        self._looked = _NOT
        if self.found is not None:
            self.found.bus_cycle(when, self._label, chip, write, address, data)
        self._board.tell_cycle(when, self._label, chip, write, address, data)
        self._cycles += 1
        if self._cycles % SETTLE_EVERY == 0:
            self._board.catch_up()
