"""The table of a host bus, and edges to bus cycles by it: for captures, which have pins alone.

The sigrok decoders use copies of this file, so it may need nothing but the standard library.
"""

from collections.abc import Mapping
from typing import Final, NamedTuple

from vbus.chips.packets import Cycle
from vbus.core.signals import HIGH, LOW, Z

ADDRESS: Final = -2
"""In place of a level in a whole cycle: its address."""
BYTE: Final = -3
"""In place of a level in a whole cycle: the byte that the host writes."""
EITHER: Final = -4
"""In place of the level that a line moves to: it moves."""

Edges = tuple[tuple[int, str, int], ...]
"""Edges of a whole cycle: offset from the latching edge (ps), pin, level."""


class Strobe(NamedTuple):
    """One row of a bus table: an edge, its condition, and what happens then.

    Attributes:
        lines: control lines. Of several, which act while all are low, the edge is that of the last
            to fall, or of the first to rise.
        level: ``LOW`` or ``HIGH``, to which they move, or :data:`EITHER`.
        action: one of these words:

            ===========  =====================================================================
            ``begin``    a read begins: the chip drives the data bus
            ``take``     a read ends: the host has taken what stands on the data bus
            ``empty``    a read ends in which nothing was on the data bus
            ``enter``    a write begins; where the address is latched, any access, which closes
                         an open latch
            ``write``    a write ends: what stood on the data bus before the edge counts
            ``clash``    both strobes are low
            ``place``    the address line moves, or the one that says which way the byte goes
            ``release``  the select rises
            ``open``     the address latch follows the data bus
            ``latch``    the address latch, if it is open, closes with what stood on the data bus
                         before the edge
            ``access``   an access ends: the next ``take`` takes what is at the latched address
            ===========  =====================================================================
        given: levels of other lines: after an edge that falls, before any other.
    """

    lines: tuple[str, ...]
    level: int
    action: str
    given: tuple[tuple[str, int], ...] = ()

    def holds(self, levels: Mapping[str, int]) -> bool:
        """Tell whether the lines are low, as far as they need be, and the condition holds."""
        return all(levels[line] == level for line, level in self.given) and (
            self.level == EITHER or not any(levels[line] for line in self.lines)
        )

    def happens(self, before: Mapping[str, int], after: Mapping[str, int]) -> bool:
        """Tell whether its edge is among those from some levels to others."""
        # A fall counts when all lines have come low: before that nothing has begun.
        if self.level == LOW:
            return self.holds(after) and not self.holds(before)
        moved = any(after[line] != before[line] for line in self.lines)
        # A rise counts for what was under way before it.
        return moved and self.holds(before)


class BusTable(NamedTuple):
    """The protocol of a host bus: what its edges come to, and the edges of whole cycles.

    Attributes:
        lines: the control lines; nothing is under way while all are high.
        strobes: the rows, in the order in which edges of one instant act.
        read: the edges of a whole read cycle, in which a level may be :data:`ADDRESS`.
        write: the edges of a whole write cycle, in which a level may also be :data:`BYTE`.
        address: the line that carries the address; ``""``: it is latched from the data bus.
        special: other edges of cycles, by address and whether the host writes; the cycle moves no
            line where there are none.
        data: the data bus.
        cycle_ps: the shortest whole cycle.
    """

    lines: tuple[str, ...]
    strobes: tuple[Strobe, ...]
    read: Edges
    write: Edges
    address: str = ""
    special: Mapping[tuple[int, bool], Edges] = {}
    data: str = "D0-D7"
    cycle_ps: int = 0

    def edges(self, write: bool, address: int, data: int) -> list[tuple[int, str, int]]:
        """Return the edges of a whole cycle as :meth:`~vbus.chips.base.Chip.strobes` has them."""
        edges = self.special.get((address, write), self.write if write else self.read)
        carried = {ADDRESS: address, BYTE: data}
        return [(offset, pin, carried.get(level, level)) for offset, pin, level in edges]

    def strobe(self, write: bool) -> tuple[int, str]:
        """Return the line that ends a whole cycle, and the offset at which it falls (ps)."""
        edges = self.write if write else self.read
        # Offset 0 is the latching edge: that of the strobe, whatever moves with it.
        pin = next(pin for offset, pin, level in edges if offset == 0 and level == HIGH)
        return next((offset, pin) for offset, name, level in edges if name == pin and level == LOW)

    def low(self, write: bool) -> set[str]:
        """Return the lines that a whole cycle holds low as it ends."""
        edges = self.write if write else self.read
        levels = {pin: level for offset, pin, level in edges if offset < 0}
        return {pin for pin, level in levels.items() if level == LOW}

    def actions(self, before: tuple[int, ...], after: tuple[int, ...]) -> tuple[str, ...]:
        """Return what happens as the lines move from some levels to others."""
        old, new = self.named(before), self.named(after)
        return tuple([row.action for row in self.strobes if row.happens(old, new)])

    def named(self, levels: tuple[int, ...]) -> dict[str, int]:
        """Return the levels of the lines by name."""
        return dict(zip(self.lines, levels, strict=True))


def strobed_bus(
    lines: tuple[str, str, str, str], *, setup: int, read_low: int, write_low: int, hold: int,
    data_setup: int, data_hold: int, cycle_ps: int,
) -> BusTable:  # fmt: skip
    """Return the table of a bus with a select, one address line and a strobe each way.

    A cycle begins with the last of select and strobe to fall, and ends with the first to rise.

    Args:
        lines: the select, the address line, the read and the write strobe; all but the address are
            active low.
        setup: how long select and address stand before the strobe of a whole cycle (ps).
        read_low: how long the read strobe is low (ps).
        write_low: how long the write strobe is low (ps).
        hold: how long the select stays low after the strobe (ps).
        data_setup: how long written data stands before the strobe rises (ps).
        data_hold: how long written data stays after it (ps).
        cycle_ps: the shortest whole cycle (ps).
    """
    select, address, read, write = lines
    # A whole cycle is as short as the limits of the AC table allow.
    reading, writing = -read_low - setup, -write_low - setup
    return BusTable(
        lines,
        strobes=(
            Strobe((select, write), HIGH, "write"),
            Strobe((select, read), HIGH, "take"),
            Strobe((address,), EITHER, "place"),
            Strobe((select, write), LOW, "enter"),
            Strobe((select, read), LOW, "begin"),
            Strobe((select, read, write), LOW, "clash"),
        ),
        read=(
            (reading, address, ADDRESS), (reading, select, LOW), (-read_low, read, LOW),
            (0, read, HIGH), (hold, select, HIGH),
        ),
        write=(
            (writing, address, ADDRESS), (writing, select, LOW), (-write_low, write, LOW),
            (-data_setup, "D0-D7", BYTE), (0, write, HIGH), (hold, select, HIGH),
            (data_hold, "D0-D7", Z),
        ),
        address=address,
        cycle_ps=cycle_ps,
    )  # fmt: skip


class BusWatch:
    """Follows the control lines and the data bus of one chip, by its table.

    A write latches what stood on the bus before its trailing edge; a read gives what stands there
    at the edge: what a chip does of itself at an instant comes before what its host does.

    Args:
        table: the protocol.
    """

    STATE: tuple[str, ...] = ()
    """What earlier edges leave that decides about cycles to come; see ``vbus.core.state``."""
    DERIVED: tuple[str, ...] = ("_actions", "_before", "_data", "_phases")

    def __init__(self, table: BusTable) -> None:
        self.table: BusTable = table
        self.PINS: tuple[str, ...] = table.lines
        """Control lines by the manual's names, in the order of the levels fed."""
        self._before: tuple[int, ...] = ()
        self._data: int = 0
        # A capture has millions of edges, and few that differ.
        self._actions: dict[tuple[tuple[int, ...], tuple[int, ...]], tuple[str, ...]] = {}
        self._phases: dict[tuple[int, ...], tuple[bool, bool]] = {}

    def change(self, when: int, levels: tuple[int, ...], data: int) -> list[Cycle]:
        """Take the levels from ``when`` on; return the bus cycles that ended.

        Args:
            when: instant, in whatever unit the capture has.
            levels: control lines, in the order of :attr:`PINS`.
            data: the data bus as a number.
        """
        cycles: list[Cycle] = []
        # The first levels of a capture are no edge.
        if self._before and levels != self._before:
            cycles = self.edges(when, self._before, levels, self._data, data)
        self._before = levels
        self._data = data
        return cycles

    def edges(
        self, when: int, before: tuple[int, ...], after: tuple[int, ...], old: int, data: int
    ) -> list[Cycle]:
        """Return the cycles that end when lines move from ``before`` to ``after``.

        ``old`` stood on the bus until then, ``data`` stands there at the edge. Which cycles end,
        and where, must follow from ``before`` and ``after`` alone, unless :attr:`STATE` names what
        else decides: boards ask once for what is always the same.
        """
        # Found once for each pair of levels: a capture has millions of edges.
        actions = self._actions.get((before, after))
        if actions is None:
            actions = self._actions[before, after] = self.table.actions(before, after)
        cycles = []
        for action in actions:
            cycles += self.act(action, when, before, old, data)
        return cycles

    def act(
        self, action: str, when: int, before: tuple[int, ...], old: int, data: int
    ) -> list[Cycle]:
        """Return the cycle that ends by an action."""
        if action not in ("take", "write"):
            return []
        # The address stands before the edge that ends the cycle.
        address = before[self.PINS.index(self.table.address)]
        return [Cycle(when, action == "write", address, old if action == "write" else data)]

    def reading(self, levels: tuple[int, ...]) -> bool:
        """Tell whether the chip, not the host, drives the data bus."""
        return self._phase(levels)[0]

    def idle(self, levels: tuple[int, ...]) -> bool:
        """Tell whether no cycle is under way."""
        return self._phase(levels)[1]

    def _phase(self, levels: tuple[int, ...]) -> tuple[bool, bool]:
        """Return what :meth:`reading` and :meth:`idle` tell."""
        phase = self._phases.get(levels)
        if phase is None:
            named = self.table.named(levels)
            rows = [row for row in self.table.strobes if row.holds(named)]
            reads = any(row.action == "begin" for row in rows)
            busy = any(row.level == HIGH and row.action != "release" for row in rows)
            phase = self._phases[levels] = reads, not busy
        return phase

    def busy(self, levels: tuple[int, ...]) -> bool:
        """Tell whether lines may move from these levels so that :meth:`edges` has work to do."""
        return not self.idle(levels)


class LatchedWatch(BusWatch):
    """Follows a bus whose address comes over the data bus and is latched.

    What is accessed before the first address has been seen is passed over.
    """

    STATE = ("_address", "_closed: bool", "_read")

    def __init__(self, table: BusTable) -> None:
        super().__init__(table)
        self._address: int = -1
        self._closed: bool = True
        self._read: int = -1

    def act(
        self, action: str, when: int, before: tuple[int, ...], old: int, data: int
    ) -> list[Cycle]:
        """Return the cycle that ends by an action; follow the latch."""
        if action == "open":
            self._closed = False
        # In one pulse the latch closes once, by whichever edge comes first.
        elif action in ("latch", "enter") and not self._closed:
            self._address, self._closed = old & 0x7F, True
        elif action == "access":
            self._read = self._address
        # Until an address has been seen, which register it was is not known.
        elif action == "write" and self._address >= 0:
            return [Cycle(when, True, self._address, old)]
        elif action == "take" and self._read >= 0:
            address, self._read = self._read, -1
            return [Cycle(when, False, address, data)]
        return []

    def busy(self, levels: tuple[int, ...]) -> bool:
        """Any edge may move the latch."""
        return True


def watch_by(table: BusTable) -> BusWatch:
    """Return a new follower of a bus."""
    return (BusWatch if table.address else LatchedWatch)(table)
