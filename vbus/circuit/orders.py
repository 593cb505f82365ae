"""Bus cycles and pins at given instants: what a host has ordered to happen."""

from collections.abc import Callable
from heapq import heapify, heappop, heappush
from operator import itemgetter
from typing import Any, ClassVar, Final

import msgspec

from vbus.chips.base import Chip
from vbus.circuit.circuit import Circuit
from vbus.circuit.host_pins import HostPins
from vbus.circuit.strobe_player import together
from vbus.core.kernel import US, Timer
from vbus.core.signals import Z
from vbus.core.state import Names

READ: Final = 0
WRITE: Final = 1
PIN: Final = 2

LEAD: Final = 20 * US
"""How long before its latching edge a cycle is looked at: longer than any strobe."""

_LOOK: Final = 0
_BEGIN: Final = 1
_LATCH: Final = 2
_TAKE: Final = 3
_DRIVE: Final = 4
_START: Final = 5

Step = tuple[int, int, int, int, int, int]
"""Instant, number of the order, number of the step, what to do, pin and level."""


OrderRow = tuple[Any, ...]
"""Number of an order, and its attributes."""


class Order(msgspec.Struct, frozen=True):
    """One thing a host wants to happen.

    Attributes:
        when: instant of the latching edge, or of the pin's edge (ps).
        chips: names; a read of none or several finds a floating bus.
        kind: :data:`READ`, :data:`WRITE` or :data:`PIN`.
        address: of the cycle.
        data: byte to write; the level of a pin: 0, 1, or 2 to let go.
        pin: name of the pin at the first chip.
    """

    when: int
    chips: tuple[str, ...]
    kind: int
    address: int = 0
    data: int = 0
    pin: str = ""


class Orders:
    """Runs bus cycles with their latching edges at given instants, on the board's own timers.

    At its instant an order comes after what the chips do of themselves and after edges that
    arrive from other nodes. Orders of one instant run in the order they were given.

    Args:
        board: the board.
        label: the host's name in traces.
        saved: whether it is part of the board's saved state.
    """

    STATE: ClassVar[Names] = (
        "_given", "_step", "last", "_steps: heap[(i64, i64, i64, i64, i64, i64)]",
        "waiting: list[(i64, i64, tuple[str, ...], i64, i64, i64, str), ...]", "_pins: part",
    )  # fmt: skip
    WIRING: ClassVar[Names] = ("_timer", "board", "label")
    DERIVED: ClassVar[Names] = ("_kept", "_orders", "late", "made", "results")

    def __init__(self, board: Circuit, label: str, saved: bool = True) -> None:
        self.board: Circuit = board
        self.label: str = label
        self.last: int = -1
        """Instant of the last order given."""
        self.late: int = 0
        """Orders given after their instant had passed (real time only)."""
        self.results: dict[int, int] = {}
        """Bytes read, by the number of the order, until :meth:`result` takes them."""
        self.made: Callable[[list[object]], None] = _nobody
        """Called for each bus cycle: instant, host, chips, write, address, data."""
        self._kept: set[int] = set()
        self._timer: Timer = board.kernel.timer(self._due, saved)
        self._steps: list[Step] = []
        self._orders: dict[int, Order] = {}
        self._given: int = 0
        self._step: int = 0
        self._pins: HostPins = HostPins(
            board.kernel, label, board.chips, board.glue.parts, _nothing
        )

    def give(self, order: Order, keep: bool = False) -> int:
        """Take an order; return its number.

        Args:
            order: what is to happen, and when.
            keep: whether the byte read will be asked for by :meth:`result`.
        """
        number = self._given
        self._given += 1
        now = self.board.kernel.now
        if order.when < now:
            self.late += 1
        self._orders[number] = order
        if keep:
            self._kept.add(number)
        self.last = max(self.last, order.when)
        start = order.when if order.kind == PIN else order.when - LEAD
        self._push(max(start, now), number, _LOOK)
        return number

    def result(self, number: int) -> int:
        """Return the byte that order ``number`` has read."""
        return self.results.pop(number, 0)

    def _push(self, when: int, number: int, action: int, pin: int = 0, level: int = 0) -> None:
        heappush(self._steps, (when, number, self._step, action, pin, level))
        self._step += 1
        if self._steps[0][0] < self._timer.due:
            self._timer.at(max(self._steps[0][0], self.board.kernel.now))

    def _due(self) -> None:
        now = self.board.kernel.now
        steps = self._steps
        while steps and steps[0][0] <= now:
            _, number, _, action, pin, level = heappop(steps)
            self._do(number, action, pin, level)
        if steps:
            self._timer.at(steps[0][0])

    # -- one step -----------------------------------------------------------------------------

    def _do(self, number: int, action: int, pin: int, level: int) -> None:
        board = self.board
        if action == _DRIVE:
            self._drive(pin, level)
            return
        if action == _START:
            self._flush(number)
            return
        order = self._orders[number]
        chips = [board.chip(name) for name in order.chips]
        if action == _LOOK:
            self._look(number, order, chips)
        elif action == _BEGIN:
            for chip in chips:
                chip.begin_read(order.address)
        elif action == _TAKE:
            for chip in chips:
                chip.advance()
            board.kernel.settle()
            if order.kind == READ:
                board.meet(self.label, chips)
            self._done(number, order, together(chips))
        elif order.kind == PIN:
            del self._orders[number]
            chips[0].timing_checked = True  # instants of a scenario are times like a host's own
            pin_of = chips[0].pins[order.pin]
            self._pins.of(pin_of).drive(Z if order.data == 2 else order.data)
            board.kernel.settle()
        else:
            self._done(number, order, self._latch(order, chips))

    def _look(self, number: int, order: Order, chips: list[Chip]) -> None:
        """Split the cycle into its steps: strobes if the bus is observed."""
        now = self.board.kernel.now
        when = max(order.when, now)
        if order.kind == PIN or not chips:
            self._push(when, number, _LATCH)
            return
        for chip in chips:
            chip.timing_checked = False
        strobes = [
            (offset, list(chip.pins).index(name), place, level)
            for place, chip in enumerate(chips)
            for offset, name, level in chip.strobes(order.kind == WRITE, order.address, order.data)
        ]
        # Whether several chips fight on their data lines shows on the nets alone.
        fight = order.kind == READ and len(chips) > 1
        if (fight or self._observed(chips)) and strobes:
            first = self.board.chips.index(chips[0])
            earliest = min(offset for offset, *_ in strobes)
            when = max(when, now - earliest)
            self._push(when + earliest, number, _START)
            taken = False
            for offset, pin, place, level in sorted(strobes, key=itemgetter(0)):
                if offset >= 0 and not taken:
                    self._push(when, number, _TAKE)
                    taken = True
                rank = first if place == 0 else self.board.chips.index(chips[place])
                self._push(when + offset, number, _DRIVE, rank << 8 | pin, level)
            return
        if order.kind == READ:
            begin = when - max(chip.read_low_ps for chip in chips)
            self._push(max(begin, now), number, _BEGIN)
        self._push(when, number, _LATCH)

    def _flush(self, number: int) -> None:
        """A cycle begins: hold edges of those before it that are still to come happen now."""
        late = [step for step in sorted(self._steps) if step[3] == _DRIVE and step[1] < number]
        if late:
            self._steps[:] = [step for step in self._steps if step not in late]
            heapify(self._steps)
            for _, _, _, _, pin, level in late:
                self._drive(pin, level)

    def _observed(self, chips: list[Chip]) -> bool:
        if not self.board.kernel.observed:
            return False
        return any(pin.net.observers for chip in chips for pin in chip.bus_pins)

    def _drive(self, pin: int, level: int) -> None:
        chip = self.board.chips[pin >> 8]
        self._pins.of(list(chip.pins.values())[pin & 0xFF]).drive(level)
        self.board.kernel.settle()

    def _latch(self, order: Order, chips: list[Chip]) -> int:
        if order.kind == READ:
            for chip in chips:
                chip.bus_net.value = chip.end_read()
            self.board.meet(self.label, chips)
            return together(chips)
        for chip in chips:
            chip.write(order.address, order.data)
            chip.bus_net.value = order.data
        return order.data

    def _done(self, number: int, order: Order, data: int) -> None:
        """The cycle is over: count it, tell of it, keep what was read."""
        board = self.board
        del self._orders[number]
        board.kernel.settle()
        write = order.kind == WRITE
        read = not write
        board.reads += int(read)
        board.writes += int(write)
        for chip in map(board.chip, order.chips):
            chip.reads += int(read)
            chip.writes += int(write)
        if number in self._kept:
            self._kept.discard(number)
            self.results[number] = data
        name = "+".join(order.chips) or "-"
        self.made([int(board.kernel.now), self.label, name, write, order.address, data])
        board.tell_cycle(board.kernel.now, self.label, name, write, order.address, data)

    # -- end and state ------------------------------------------------------------------------

    def close(self) -> None:
        """Forget what waits and let go of every pin."""
        self._timer.cancel()
        self._steps.clear()
        self._orders.clear()
        self._pins.unsolder()

    @property
    def waiting(self) -> list[OrderRow]:
        """The orders that have not been carried out, each with its number."""
        return [(number, *msgspec.structs.astuple(order)) for number, order in self._orders.items()]

    @waiting.setter
    def waiting(self, rows: list[OrderRow]) -> None:
        self._orders = {number: Order(*order) for number, *order in rows}


def _nobody(cycle: list[object]) -> None:
    pass


def _nothing() -> None:
    pass
