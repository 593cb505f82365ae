"""Bus cycles that reach chips through glue or a card's bus, reported as those of any host."""

from collections.abc import Iterable
from typing import ClassVar

from mypy_extensions import i64

from vbus.chips.base import Chip
from vbus.chips.bus_watch import BusWatch, watch_by
from vbus.core.kernel import Kernel
from vbus.core.signals import Net, Watcher
from vbus.core.state import Names
from vbus.glue.part import Glue

Ended = tuple[str, bool, int, int]
"""A bus cycle that has ended: name of the chip, whether the host wrote, address, byte."""


class CycleTeller:
    """A host whose cycles at chips are reported."""

    WIRING: ClassVar[Names] = ("*",)

    def wanted(self) -> bool:
        """Tell whether anybody wants to know of them."""
        raise NotImplementedError

    def tell(self, when: int, chip: str, write: bool, address: int, data: int) -> None:
        """Tell of a cycle: instant (ps), names of the chips, direction, address, byte."""
        raise NotImplementedError

    def tell_together(self, when: int, found: list[Ended]) -> None:
        """Tell of the cycles at some chips at one instant.

        Chips written by one strobe are written together, as in a whole cycle.
        """
        if len(found) == 1:
            name, write, address, data = found[0]
            self.tell(when, name, write, address, data)
            return
        writes: dict[tuple[int, int], list[str]] = {}
        for name, write, address, data in found:
            if write:
                writes.setdefault((address, data), []).append(name)
            else:
                self.tell(when, name, False, address, data)
        for (address, data), names in writes.items():
            self.tell(when, "+".join(names), True, address, data)


class GlueCycles:
    """Sees the cycles at chips of which glue or a connector drives a strobe or the select.

    Hosts move lines before the glue, or a card's bus; what comes of that at a chip is a cycle of
    the host that moved something last. Chips written at one instant are written together. Cycles
    of families without a bus table are not seen.

    Args:
        kernel: the board's time.
        chips: all chips of the board, with all their wires.
        glue: its glue.

    Attributes:
        chips: those chips.
        by: who moves something now; None: a host that reaches the chips themselves.
        noted: takes instants and cycles, also where no observer asks for them; or None.
    """

    STATE: ClassVar[Names] = ("watches: parts",)
    WIRING: ClassVar[Names] = ("by", "chips", "noted", "rows", "watcher")

    def __init__(self, kernel: Kernel, chips: Iterable[Chip], glue: Glue) -> None:
        self._kernel: Kernel = kernel
        self.by: CycleTeller | None = None
        self.noted: list[tuple[int, list[Ended]]] | None = None
        self.rows: list[BusLines] = []
        chips = list(chips)
        connectors = {id(pin.net) for chip in chips if chip.CONNECTOR for pin in chip.pins.values()}
        decoded = glue.behind(chips)
        self.chips: list[Chip] = [
            chip for chip in chips
            if not chip.CONNECTOR
            and (
                chip in decoded
                or any(id(p.net) in connectors for p in chip.bus_pins if p is not chip.data_pin)
            )
        ]  # fmt: skip
        self.watcher: Watcher = Watcher(kernel, self._moved)
        for chip in self.chips:
            if chip.BUS is None:
                continue
            row = BusLines(chip, watch_by(chip.BUS))
            row.levels = row.look()
            self.rows.append(row)
            for net in row.nets:
                if self.watcher not in net.watchers:
                    net.watch(self.watcher)

    @property
    def watches(self) -> list[BusWatch]:
        """What follows the bus of each chip."""
        return [row.watch for row in self.rows]

    def remembers(self) -> bool:
        """Tell whether any chip's bus has a state that is worth keeping."""
        return any(row.remembers for row in self.rows)

    def after_load(self) -> None:
        """The nets have been loaded: edges are counted from here."""
        for row in self.rows:
            row.levels = row.look()

    def reached(
        self, when: int, chips: list[Chip], places: list[int], write: bool, data: int
    ) -> None:
        """Tell the present host of a cycle that was made at chips without moving their lines."""
        assert self.by is not None
        places_of = zip(chips, places, strict=True)
        self.by.tell_together(when, [(chip.name, write, place, data) for chip, place in places_of])

    def _moved(self) -> None:
        now = self._kernel.now
        by = self.by if self.by is not None and self.by.wanted() else None
        found: list[Ended] = []
        for row in self.rows:
            before, row.levels = row.levels, row.look()
            if before == row.levels or not row.busy(before):
                continue
            # Without a reader only a bus with a latch is followed: its next cycle depends on that.
            if by is None and self.noted is None and not row.remembers:
                continue
            # A write takes what stood on the bus before the edge that ends it.
            found += row.ended(now, before, row.chip.bus_net.before)
        if self.noted is not None and found:
            self.noted.append((now, found))
        if by is not None and found:
            by.tell_together(now, found)


class BusLines:
    """The control lines of one chip, and how they stood."""

    DERIVED: ClassVar[Names] = ("*",)

    def __init__(self, chip: Chip, watch: BusWatch) -> None:
        self.chip: Chip = chip
        self.watch: BusWatch = watch
        self.remembers: bool = bool(watch.STATE)
        """Whether earlier edges decide about cycles to come: a latched address, say."""
        self.levels: i64 = 0
        self.data: int = 0
        self.under_way: bool = False
        """Whether a cycle was, when the lines were looked at."""
        self._nets: list[Net] = []
        self._busy: list[bool] = []
        """By levels, once they have been asked for."""
        self._ends: dict[int, list[Ended]] = {}
        """By what was on the data bus and levels before and after."""

    @property
    def nets(self) -> list[Net]:
        """The control lines, in the order of the watch."""
        if not self._nets:
            self._nets = [self.chip.pins[name].net for name in self.watch.PINS]
        return self._nets

    def look(self) -> i64:
        """Return the levels of the control lines, a bit each."""
        levels: i64 = 0
        for net in self._nets or self.nets:
            levels = levels << 1 | net.value
        return levels

    def busy(self, levels: i64) -> bool:
        """Whether it is worth following how the lines move from these levels."""
        if not self._busy:
            every = range(1 << len(self.nets))
            self._busy = [self.watch.busy(self._tuple(one)) for one in every]
        return self._busy[levels]

    def ended(self, now: int, before: i64, data: int) -> list[Ended]:
        """Return the cycles that end as lines move to where they are now; not to be changed.

        Args:
            now: instant (ps).
            before: levels they moved from.
            data: what stood on the data bus.
        """
        width: i64 = len(self.nets)
        byte: i64 = data
        key: i64 = (byte << width | before) << width | self.levels
        ends = self._ends.get(key)
        if ends is None:
            moved = self._tuple(before), self._tuple(self.levels)
            cycles = self.watch.edges(now, *moved, data, data)
            name = self.chip.name
            ends = [(name, cycle.write, cycle.address, cycle.data) for cycle in cycles]
            if self.remembers:
                return ends
            self._ends[key] = ends  # the levels alone decide
        return ends

    def _tuple(self, levels: i64) -> tuple[int, ...]:
        return tuple([levels >> place & 1 for place in range(len(self.nets) - 1, -1, -1)])
