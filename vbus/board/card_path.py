"""Whole cycles on a card's bus: what comes of one is worked out once, and then made at the chips.

A cycle that nothing but gates stands in the way of moves no register and needs no events: the
chip it selects gets its cycle at the instants at which the strobes would have come. The wires have
the levels they would have as soon as somebody looks. Everything else is played as strobes.
"""

from typing import ClassVar

from mypy_extensions import i64

from vbus.board.card_bus import MOST, CardBus, CyclePath
from vbus.board.card_cycle import CardCycle, RestingWires
from vbus.board.card_decode import CardDecoder
from vbus.board.card_edges import CardEdges, EdgeSteps
from vbus.chips.base import Chip
from vbus.circuit.circuit import Circuit
from vbus.circuit.glue_cycles import CycleTeller, GlueCycles
from vbus.circuit.host_pins import HostPins
from vbus.signals import HIGH
from vbus.state import Names


class CardPath(CyclePath):
    """Brings cycles from a connector to the chips.

    What decides about them (switches, what registers hold, who else drives a wire) is looked at
    when one of these wires has moved; what came of each address is kept for each such setting.

    Args:
        board: the board, with all its wires.
        bus: the connector.
    """

    WIRING: ClassVar[Names] = ("*",)

    def __init__(self, board: Circuit, bus: CardBus) -> None:
        self._board: Circuit = board
        self._kernel = board.kernel
        self._bus: CardBus = bus
        self._through: GlueCycles | None = board.through
        self._low: int = bus.low_ps
        self._lead: int = self._low + bus.setup_ps
        self._hold: int = bus.hold_ps
        self._decoder: CardDecoder = CardDecoder(bus, board.glue, board.chips)
        self._recovery: int = max([self._hold, *(c.cycle_ps for c in self._decoder.behind)])
        self._closed: bool = self._decoder.closed
        self._settings: dict[tuple[int, ...], list[CardCycle | None]] = {}
        self._cycles: list[CardCycle | None] = []
        self._clocks: tuple[int, ...] = ()
        self._moved: bool = True
        """Whether a wire that decides has moved since it was looked at."""
        self._fixed: bool = False
        """Whether cycles may be made at the chips, as far as was looked."""
        self._observed: int = -1
        self._observations: int = -1
        """How many observers sat on nets as it was looked, and how many ever had."""
        self._owed: RestingWires | None = None
        self._judging: bool = False
        self.played: int = 0
        """How many cycles were played as strobes."""
        for net in self._decoder.nets:
            net.guard = self
        self._edges: CardEdges = CardEdges(
            board.kernel, board.player, bus, self._decoder.edged, self._decoder.edge_nets
        )
        self._edges.watch(self.touched)
        board.player.guards.append(self)
        bus.cycle_ps = self._lead + self._recovery
        board.kernel.settle()
        for chip in self._decoder.behind:
            self._take_levels(chip)  # as the wires rest; no edge has told of that

    def why(self, address: int, write: bool) -> str:
        """Say why a cycle at ``address`` (counted from the base) is played; "" if it is not."""
        if not self._look():
            return "somebody looks at the wires, or something is broken or on its way"
        cycle = self._at(address, write)
        if cycle.rest is None:
            return cycle.why
        return "" if cycle.rest.clocks == self._clocks else "a register or a reset moves"

    # -- cycles ---------------------------------------------------------------------------------

    def read(self, pins: HostPins, teller: CycleTeller, address: int, when: i64) -> int:
        """Run a read cycle with its latching edge at ``when`` (ps); return the byte."""
        if self._through is not None:
            self._through.by = teller
        cycle = self._begin(address, False, when)
        if cycle is None:
            return self._play(pins, False, address, 0, when)
        if cycle.steps is not None:
            return self._step(cycle, cycle.steps, False, address, 0, when)
        kernel = self._kernel
        if not cycle.chips:
            self._to(when)
            data = cycle.answer
        else:
            chip = cycle.chips[0]
            self._to(when - self._low)
            chip.judged = True
            chip.begin_read(cycle.places[0])
            kernel.settle()
            self._to(when)
            data = chip.end_read()
        kernel.settle()
        if cycle.chips and teller.wanted():
            self._tell(cycle, False, data, when)
        self._end(cycle, address, data, when)
        return data

    def write(
        self, pins: HostPins, teller: CycleTeller, address: int, data: int, when: i64
    ) -> None:
        """Run a write cycle with its latching edge at ``when`` (ps)."""
        if self._through is not None:
            self._through.by = teller
        cycle = self._begin(address, True, when)
        if cycle is None:
            self._play(pins, True, address, data, when)
            return
        if cycle.steps is not None:
            self._step(cycle, cycle.steps, True, address, data, when)
            return
        self._to(when)
        for number, chip in enumerate(cycle.chips):
            chip.judged = True
            chip.write(cycle.places[number], data)
        self._kernel.settle()
        if cycle.chips and teller.wanted():
            self._tell(cycle, True, data, when)
        self._end(cycle, address, data, when)

    def _tell(self, cycle: CardCycle, write: bool, data: int, when: int) -> None:
        """Tell of the cycles that were made at chips."""
        if self._through is not None:
            self._through.reached(when, cycle.chips, cycle.places, write, data)

    def _step(
        self, cycle: CardCycle, steps: EdgeSteps, write: bool, address: int, data: int, when: int
    ) -> int:
        """Run a cycle of which the chips want every edge; return the byte that is read."""
        for block in self._decoder.blocks:
            block.asleep = True
        self._edges.judged()
        self._owed = cycle.rest
        self._edges.begin(steps, data)
        data = self._edges.run(steps, write, data, when)
        self._kernel.settle()
        self._end(cycle, address, data, when)
        return data

    def _to(self, when: int) -> None:
        kernel = self._kernel
        if kernel.next_stop > when:
            kernel.now = when
        else:
            kernel.run_until(when)

    def _begin(self, address: int, write: bool, when: int) -> CardCycle | None:
        """Come to where a cycle begins; return what comes of it, None if it is played."""
        begin = when - self._lead
        self._judging = begin >= self._bus.free_at and begin >= self._kernel.now
        if not self._judging:
            self.come_true()
            self.cut_short()
            return None
        kernel = self._kernel
        kernel.settle()
        self._to(begin)
        if (
            self._moved
            or kernel.observed != self._observed
            or kernel.observations != self._observations
            or self._board.disturbed
        ) and not self._look():
            return None
        if not self._fixed or (not self._closed and kernel.next_due <= when):
            return None
        if address < 0 or address >= MOST:
            return None
        cycle = self._cycles[address << 1 | write]
        if cycle is None:
            cycle = self._at(address, write)
        if cycle.rest is None or (
            cycle.rest is not self._owed and cycle.rest.clocks != self._clocks
        ):
            return None
        return cycle

    def _at(self, address: int, write: bool) -> CardCycle:
        key = address << 1 | write
        cycle = self._cycles[key]
        if cycle is None:
            self.come_true()
            cycle = self._cycles[key] = self._decoder.cycle(address, write)
        return cycle

    def _end(self, cycle: CardCycle, address: int, data: int, when: int) -> None:
        self._bus.free_at = when + self._recovery
        if cycle.kept:
            for net, level in cycle.kept:
                net.value = data if level < 0 else level
        if not self._moved:
            self._owed = cycle.rest
            return
        # The cycle itself has moved a wire that decides: the address stands as ever.
        bus = self._bus
        where = bus.where(address)
        for strobe in (bus.read_strobe, bus.write_strobe):
            bus.pins[strobe].drive(HIGH)
        for line, pin in enumerate(bus.address_pins):
            pin.drive(where >> line & 1)
        self._kernel.settle()

    def _play(self, pins: HostPins, write: bool, address: int, data: int, when: int) -> int:
        """Play a cycle as strobes; its times are judged if it fits between its neighbours."""
        self.come_true()
        self.played += 1
        fits = self._judging
        player = self._board.player
        player.flush()
        for chip in self._decoder.behind:
            chip.judged = fits
        value = player.play([self._bus], pins, write, address, data, when)
        self._bus.free_at = when + self._recovery
        return value

    # -- levels ---------------------------------------------------------------------------------

    def _look(self) -> bool:
        """Look at what decides; tell whether cycles may be made at the chips."""
        self.come_true()
        kernel, decoder = self._kernel, self._decoder
        self._observed, self._observations = kernel.observed, kernel.observations
        self._fixed = (
            not self._board.disturbed
            and decoder.settled()
            and not any(net.observers or net.bends or net.clashing for net in decoder.nets)
        )
        if self._fixed:
            context = decoder.context()
            if context not in self._settings:
                if len(self._settings) >= MOST:
                    self._settings.clear()
                self._settings[context] = [None] * (2 * MOST)
            self._cycles = self._settings[context]
            self._clocks = decoder.clocks()
            self._fixed = self._idle()
        self._moved = not self._fixed
        return self._fixed

    def _idle(self) -> bool:
        """Whether no strobe is low and nobody drives the data bus."""
        bus = self._bus
        strobes = (bus.pins[bus.read_strobe], bus.pins[bus.write_strobe])
        return all(pin.net.value == HIGH for pin in strobes) and not bus.bus_net.driven

    def touched(self) -> None:
        """A pin on one of the wires moves, or somebody begins to listen."""
        self._moved = True
        if self._owed is not None:
            self.come_true()

    def come_true(self) -> None:
        """Give the wires the levels of the last cycle's end."""
        rest, self._owed = self._owed, None
        if rest is None:
            return
        for net, level in rest.nets:
            net.put(level)
        for pin, level in rest.pins:
            pin.level = level
        for block, levels, driven, was in rest.blocks:
            block.follow(levels, driven, was)
        self._edges.come_true(self._decoder.blocks)
        for chip in self._decoder.behind:
            chip.judged = True
            self._take_levels(chip)

    @staticmethod
    def _take_levels(chip: Chip) -> None:
        if chip.on_levels is not None:
            chip.on_levels()

    def cut_short(self) -> None:
        """Data of a cycle lets go before its instant: nobody judges how long it was held."""
        if self._bus.free_at > self._kernel.now:
            for chip in self._decoder.behind:
                self._take_levels(chip)

    def forget(self) -> None:
        """Another state has been loaded."""
        self._edges.forget()
        self._owed = None
        self._moved = True
