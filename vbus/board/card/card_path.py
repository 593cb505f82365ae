"""Whole cycles on a card's bus: played as strobes once, remembered, and then made at the chips.

How the wires stand before a cycle, its address, its way, and the byte where glue looks at it
decide what comes of it. So it is played once and watched; the next one like it is made at the
chips it reached, at the instants at which the strobes came, and the wires have the levels they
would have as soon as they are read. What does not follow from the wires alone is always played.

The fast way of a card; ``tests/properties/test_cards.py`` holds it equal to strobes.
"""

# Compiled (LM629 behind a 74HC138): a read 1.0 us and 60 us as strobes, 60 times.

from typing import ClassVar, Final

from mypy_extensions import i64

from vbus.board.card.card_bus import (
    BYTE,
    MOST,
    CardBus,
    CardCycle,
    CyclePath,
    Levels,
    WireState,
)
from vbus.board.card.card_wires import CardRecord, CardWires
from vbus.chips.base import Chip
from vbus.circuit.circuit import Circuit
from vbus.circuit.glue_cycles import CycleTeller, GlueCycles
from vbus.circuit.host_pins import HostPins
from vbus.core.kernel import Kernel
from vbus.core.signals import Guard, Net, Pin, Z
from vbus.core.state import Names

MOST_STATES: Final = 1024
"""So many states of the wires are remembered, each with its cycles; then all are forgotten."""
PLAYED: Final = CardCycle()
"""What is remembered of a cycle that is played each time."""


class OutsideGuard(Guard):
    """Watches the wires that no cycle moves and that decide what comes of one.

    Args:
        path: its ``invalidate`` is called when one moves.
    """

    WIRING: ClassVar[Names] = ("*",)

    def __init__(self, path: "CardPath") -> None:
        self._path: CardPath = path

    def pin_moved(self) -> None:
        """One moves: what is remembered of the wires holds no more."""
        self._path.invalidate()


class CardPath(CyclePath):
    """Brings cycles from a connector to the chips.

    Args:
        board: the board, with all its wires.
        bus: the connector.

    Attributes:
        played: how many cycles were played as strobes.
    """

    WIRING: ClassVar[Names] = ("*",)

    def __init__(self, board: Circuit, bus: CardBus) -> None:
        self._board: Final[Circuit] = board
        self._kernel: Final[Kernel] = board.kernel
        self._bus: Final[CardBus] = bus
        self._through: Final[GlueCycles | None] = board.through
        self._lead: i64 = bus.low_ps + bus.setup_ps
        self._wires: Final[CardWires] = CardWires(board, bus)
        self._recovery: i64 = max([bus.hold_ps, *(c.cycle_ps for c in self._wires.behind)])
        self._closed: bool = self._wires.closed
        self._pins: list[Pin] = self._wires.pins
        self._nets: list[Net] = self._wires.nets
        self._outside: list[Net] = self._wires.outside
        self._states: dict[object, WireState] = {}
        self._state: WireState | None = None
        """How the wires stand; None: that is to be found out."""
        self._owed: WireState | None = None
        """How they would stand; None: they do."""
        self._begun: WireState | None = None
        """How they stood before the last cycle; None: there was no room for it."""
        self._observed: bool = False
        """Whether a wire was watched as they were looked at last."""
        self._byte: int = -1
        self._moving: bool = False
        """Whether the wires to chips that want every edge are moved by what is remembered."""
        self._record: CardRecord | None = None
        self.played: int = 0
        outside = OutsideGuard(self)
        for net in self._nets:
            net.guard = self
        for net in self._outside:
            net.guard = outside
        board.player.guards.append(self)
        lead: int = self._lead
        recovery: int = self._recovery
        bus.cycle_ps = lead + recovery
        board.kernel.settle()
        # As the wires rest: no edge has shown that, nor is one in their history, remembered or not.
        self._stand().come_true(-1)
        self._take_levels()

    # -- cycles ---------------------------------------------------------------------------------

    def read(self, pins: HostPins, teller: CycleTeller, address: int, when: i64) -> int:
        """Run a read cycle with its latching edge at ``when`` (ps); return the byte."""
        self._by(teller)
        cycle = self._recall(address, False, 0, when)
        if cycle is None or cycle.after is None:
            return self._play(pins, False, address, 0, when, cycle is None)
        if cycle.steps is not None:
            return self._step(cycle, False, 0, when)
        self._owe(cycle.after)
        kernel = self._kernel
        chip = cycle.chip
        if chip is None:
            data = cycle.answer
            self._kernel.pass_to(when)
        else:
            self._kernel.pass_to(when - cycle.fall)
            chip.begin_read(cycle.place)
            kernel.settle()
            self._kernel.pass_to(when)
            data = chip.end_read()
            if teller.wanted():
                kernel.settle()
                self._tell(cycle, False, data, when)
        kernel.settle()
        self._bus.free_at = when + self._recovery
        if cycle.floating:
            self._keep(cycle, data)
        return data

    def write(
        self, pins: HostPins, teller: CycleTeller, address: int, data: int, when: i64
    ) -> None:
        """Run a write cycle with its latching edge at ``when`` (ps)."""
        self._by(teller)
        cycle = self._recall(address, True, data, when)
        if cycle is None or cycle.after is None:
            self._play(pins, True, address, data, when, cycle is None)
            return
        if cycle.steps is not None:
            self._step(cycle, True, data, when)
            return
        self._owe(cycle.after)
        self._kernel.pass_to(when)
        for number, chip in enumerate(cycle.chips):
            chip.write(cycle.places[number], data)
        self._kernel.settle()
        if cycle.chips and teller.wanted():
            self._tell(cycle, True, data, when)
        self._bus.free_at = when + self._recovery
        if cycle.floating:
            self._keep(cycle, data)

    def _by(self, teller: CycleTeller) -> None:
        """What comes to chips through glue comes of this host."""
        through = self._through
        if through is not None and through.by is not teller:
            through.by = teller

    def _owe(self, after: WireState) -> None:
        """Remember how the wires stand, and set their levels only when one is read or moved."""
        if self._owed is not after:
            self._state = self._owed = after

    def _tell(self, cycle: CardCycle, write: bool, data: int, when: int) -> None:
        """Tell of the cycles that were made at chips."""
        if self._through is not None:
            self._through.reached(when, cycle.chips, cycle.places, write, data)

    @staticmethod
    def _keep(cycle: CardCycle, data: int) -> None:
        """Leave on data buses that float what was there last."""
        for net, level in cycle.floating:
            net.value = data if level == BYTE else level

    def _fits(self, when: i64) -> bool:
        """Whether there is room for a cycle between its neighbours, so that its times count."""
        begin = when - self._lead
        return begin >= self._bus.free_at and begin >= self._kernel.now

    def _recall(self, address: int, write: bool, data: int, when: i64) -> CardCycle | None:
        """Return what is known of such a cycle; :data:`PLAYED` to play it, None to watch it."""
        kernel = self._kernel
        begin = when - self._lead
        self._begun = None
        # No room for it: its times are shorter than the bus makes them, and not judged.
        if begin < self._bus.free_at or begin < kernel.now:
            return PLAYED
        if kernel.next_stop <= when:
            kernel.run_until(begin)
            # What happens within the cycle may move a wire that decides.
            if not self._closed and kernel.next_due <= when:
                return PLAYED
        state = self._state
        if state is None or self._board.disturbed:
            state = self._look()
            if state is None:
                return PLAYED
        self._begun = state
        # Wires that are watched move in every cycle, and let go of its byte after the hold time: to
        # find out how they stand afterwards would cut that short.
        if self._observed or address < 0 or address >= MOST:
            return PLAYED
        cycle = state.cycles[address << 1 | write]
        if cycle is not None and cycle.by_byte is not None:
            cycle = cycle.by_byte.get(data)
        return cycle

    def _step(self, cycle: CardCycle, write: bool, data: int, when: int) -> int:
        """Run a cycle of which the chips want every edge; return the byte that is read."""
        kernel, bus = self._kernel, self._bus
        taken = cycle.answer
        self._state, self._owed, self._byte = None, cycle.after, data
        self._moving = True
        for block in self._wires.blocks:
            block.asleep = True
        for chip in self._wires.behind:
            chip.timing_checked = True
        steps = cycle.steps
        assert steps is not None
        for offset, levels in steps:
            at: int = when + offset
            self._kernel.pass_to(at)
            if offset == 0:
                bus.advance()
                kernel.settle()
                if cycle.source is not None:
                    taken = cycle.source.value
            self._move(levels, data)
        self._moving = False
        self.come_true()
        if write:
            self._board.player.leave(when + bus.hold_ps, bus.data_pin, Z)
        bus.free_at = when + self._recovery
        return taken

    def _move(self, levels: Levels, data: int) -> None:
        """Move what drives the wires to chips, all in one batch."""
        moved: list[Net] = []
        for pin, level in levels:
            pin.level = data if level == BYTE else level
            if pin.net not in moved:
                moved.append(pin.net)
        for net in moved:
            net.resolve()
        self._kernel.settle()

    def _play(
        self, pins: HostPins, write: bool, address: int, data: int, when: int, watched: bool
    ) -> int:
        """Play a cycle as strobes; its times are judged if it fits between its neighbours."""
        fits = self._fits(when)
        self.come_true()
        self.played += 1
        player, through = self._board.player, self._through
        if not fits:
            self.cut_short()
        player.flush()
        for chip in self._wires.behind:
            chip.timing_checked = fits
        before = self._state
        self._state = None
        if not watched or before is None:
            value = player.play([self._bus], pins, write, address, data, when)
            self._bus.free_at = when + self._recovery
            return value
        record = CardRecord(self._wires, self._kernel, write, data, when)
        self._record = record
        if through is not None:
            through.noted = []
        try:
            value = player.play([self._bus], pins, write, address, data, when)
            self._bus.free_at = when + self._recovery
            cycle = record.cycle(value, through.noted if through is not None else None)
            if cycle is not None and cycle.steps is None:
                player.flush()
                after = self._stand()
                after.come_true(-1)
                self._take_levels()
                self._state = after
                if not record.finish(cycle, after):
                    cycle = None
            elif cycle is not None and cycle.after is not None:
                cycle.after.come_true(data)
        finally:
            self._record = None
            if through is not None:
                through.noted = None
        if not record.lost:
            key = address << 1 | write
            if record.by_byte and cycle is not None:
                known = before.cycles[key]
                if known is None:
                    known = before.cycles[key] = CardCycle()
                    known.by_byte = {}
                if known.by_byte is not None:
                    known.by_byte[data] = cycle
            else:
                before.cycles[key] = cycle or PLAYED
        return value

    # -- levels ---------------------------------------------------------------------------------

    def _look(self) -> WireState | None:
        """Find out how the wires stand; None if cycles must be played."""
        self.come_true()
        self._state = None
        if not self._board.disturbed and self._usable():
            self._state = self._stand()
        return self._state

    def _usable(self) -> bool:
        """Whether nothing is broken or on its way, and the bus is idle; note who watches."""
        self._observed = False
        for nets in (self._nets, self._outside):
            for net in nets:
                self._observed = self._observed or bool(net.observers)
                if net.bends or net.clashing:
                    return False
        bus = self._bus
        for name in (bus.read_strobe, bus.write_strobe):
            if not bus.pins[name].net.value:
                return False
        return not bus.bus_net.driven and not any(block.queue for block in self._wires.watched)

    def _stand(self) -> WireState:
        """Return how all stands now: the same object for the same levels."""
        levels: list[int] = []
        # Drivers of others are counted on the way, and named only if there are any: few boards have
        # some.
        others: i64 = 0
        for pin in self._pins:
            levels.append(pin.level)
            if pin.level != Z:
                others -= 1
        for net in self._nets:
            drivers: i64 = 0
            for pin in net.pins:
                if pin.level != Z:
                    drivers += 1
            others += drivers
            # What a data bus was left with is known to the net alone.
            floats = drivers == 0 and net.width == 8 and net.rest == Z
            levels.append(BYTE if floats else net.value)
        for net in self._outside:
            levels.append(net.value)
        for block in self._wires.blocks:
            levels.append(block.state)
        key = (tuple(levels), self._wires.foreign() if others != 0 else ())
        state = self._states.get(key)
        if state is None:
            if len(self._states) >= MOST_STATES:
                self._states.clear()
            state = self._states[key] = self._wires.state()
        return state

    def pin_moved(self) -> None:
        """A pin on a wire that cycles move has moved, or a listener has come."""
        if self._record is not None:
            self._record.pin_moved()
        elif not self._moving:
            self.invalidate()

    def invalidate(self) -> None:
        """What is remembered of the wires holds no more."""
        self._state = None
        if self._record is not None:
            self._record.lost = True
        elif self._owed is not None:
            self.come_true()

    def come_true(self) -> None:
        """Give the wires the levels of the last cycle's end."""
        owed, self._owed = self._owed, None
        if owed is None:
            return
        owed.come_true(self._byte)
        self._byte = -1
        if not self._wires.edged:
            self._take_levels()

    def _take_levels(self) -> None:
        """Let chips take their lines as they stand: there were no edges."""
        for chip in self._wires.behind:
            if chip.on_levels is not None and not self._wires.edged:
                chip.timing_checked = True
                chip.on_levels()

    def cut_short(self) -> None:
        """Data of a cycle lets go before its instant: its hold time is not judged."""
        if self._bus.free_at > self._kernel.now:
            self._take_levels()

    def steady(self, address: int) -> tuple[Chip | None, int] | None:
        """Return which chip is read again if what was just read is, and the address there."""
        begun = self._begun
        if begun is None:
            return None
        state = self._state or self._look()
        # What is remembered is no part of a saved state, and must not decide what hosts are told: a
        # read that has left the wires as they were is remembered by now, wherever the run began.
        if state is not begun or self._board.disturbed:
            return None
        if address < 0 or address >= MOST:
            return None
        cycle = state.cycles[address << 1]
        return (cycle.chip, cycle.place) if cycle is not None and cycle.after is state else None

    def forget(self) -> None:
        """Another state has been loaded."""
        self._owed = self._state = self._begun = None
