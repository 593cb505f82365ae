"""Whole bus cycles as edges on the nets, for observed buses."""

from collections import deque
from typing import ClassVar

from vbus.chips.base import Chip
from vbus.circuit.host_pins import CycleEdge, HostPins, offset_of
from vbus.core.kernel import NEVER, Kernel
from vbus.core.signals import Guard, Pin, Z
from vbus.core.state import Names, Saved, load, save


class LentBus:
    """How a chip's bus stood before whole cycles moved its lines.

    Args:
        chip: the chip.
        hosts: the pins of every host.

    Attributes:
        chip: the chip.
        byte: what the last cycle has left on the data bus.
    """

    WIRING: ClassVar[Names] = ("*",)

    def __init__(self, chip: Chip, hosts: list[HostPins]) -> None:
        self.chip: Chip = chip
        self.byte: int = 0
        self._driven: list[tuple[Pin, int]] = [
            (own, own.level) for one in hosts for own in one.at(chip) if own.level != Z
        ]
        self._data: int = chip.data_pin.level
        self._history: list[tuple[int, ...]] = [pin.net.history for pin in chip.bus_pins]
        self._edges: Saved = {}
        if chip.front is not None:
            chip.front.settle()
            self._edges = save(chip.front)

    def put_back(self, hosts: list[HostPins]) -> None:
        """Put the hosts' pins back; no time is judged from these edges."""
        self.chip.judged = False
        there = [own for one in hosts for own in one.at(self.chip)]
        driven = [(own, level) for own, level in self._driven if own in there]
        for own in there:  # before others drive: nothing is fought that was not
            if all(own is not one for one, _ in driven):
                own.release()
        for own, level in driven:
            own.drive(level)

    def recall(self) -> None:
        """Let the chip know of the edges before, and of none since."""
        chip = self.chip
        if chip.front is not None:
            chip.front.forget_edges()
            load(chip.front, self._edges)
        chip.data_pin.drive(self._data)
        for pin, history in zip(chip.bus_pins, self._history, strict=True):
            pin.net.history = history
        chip.bus_net.value = self.byte
        # A read under way shows what the chip has now, and each change from here on at its instant.
        if chip.front is not None:
            chip.advance()
            chip.touched()


class StrobePlayer:
    """Plays the strobes of whole cycles; the hold edges follow while time goes on.

    A cycle is over for its host at the latching edge. What comes after it (hold times) is queued
    and happens at its instant, or when the next cycle begins, if that is earlier.
    """

    WIRING: ClassVar[Names] = ("_kernel", "_timer", "guards", "hosts")
    DERIVED: ClassVar[Names] = ("_tail", "_user", "lent")

    def __init__(self, kernel: Kernel) -> None:
        self._kernel: Kernel = kernel
        self._tail: deque[tuple[int, Pin, int]] = deque()
        # Saved with the kernel: hold edges of a snapshot come at their instants.
        self._timer = kernel.timer(self._run_tail)
        self.hosts: list[HostPins] = []
        """Pins of every host that is there."""
        self.lent: dict[str, LentBus] = {}
        """Buses whose lines whole cycles have moved since a host moved some itself, by chip."""
        self._user: HostPins | None = None
        """Pins of the host of the last cycle."""
        self.guards: list[Guard] = []
        """Who may owe nets their levels."""

    def play(
        self, chips: list[Chip], pins: HostPins, write: bool, address: int, data: int, when: int
    ) -> int:
        """Play one cycle on ``chips`` with its latching edge at ``when`` (ps).

        Returns:
            The byte on the data bus at the latching edge.
        """
        self.flush()
        kernel = self._kernel
        strobes: list[CycleEdge] = []
        for chip in chips:
            chip.judged = False
            strobes = strobes + pins.strobes(chip, write, address, data)
        if not strobes:
            return self._answer(chips, write, address, data, when)
        self._lend(chips, pins)
        # What a computer's bus moves at one instant moves together; no decoder sees it half.
        at_once = chips[0].CONNECTOR
        if len(chips) > 1 and not at_once:
            strobes.sort(key=offset_of)
        value = 0
        latched = False
        for number, strobe in enumerate(strobes):
            offset, pin, level = strobe.offset, strobe.pin, strobe.level
            if offset >= 0 and not latched:
                kernel.run_until(when)
                for chip in chips:
                    chip.advance()
                kernel.settle()
                value = together(chips)
                latched = True
                self._note_bytes(chips)
            if offset > 0:
                self._tail.append((when + offset, pin, level))
                continue
            if when + offset > kernel.now:
                kernel.run_until(when + offset)
            pin.drive(level)
            if offset < 0 and not (at_once and strobes[number + 1].offset == offset):
                kernel.settle()
        kernel.settle()
        if self._tail and self._timer.due == NEVER:
            self._timer.at(self._tail[0][0])
        return value

    def _answer(self, chips: list[Chip], write: bool, address: int, data: int, when: int) -> int:
        """Run a cycle that an adapter answers by itself: it moves no strobe of the chips."""
        self._kernel.run_until(when)
        for chip in chips:
            if write:
                chip.write(address, data)
                chip.bus_net.value = data
            else:
                chip.begin_read(address)
                chip.bus_net.value = chip.end_read()
        self._note_bytes(chips)
        self._kernel.settle()
        return together(chips)

    # A whole cycle moves lines only while they are observed. So what it leaves of them decides
    # about nothing: before another host's cycle its host lets go of them, and before a host moves
    # lines itself, they and what the chip knows of edges are as hosts have left them by hand.

    def _lend(self, chips: list[Chip], pins: HostPins) -> None:
        """Give chips' buses to a host for a whole cycle."""
        to = [chip for chip in chips if not chip.CONNECTOR]
        taken = [chip for chip in to if chip.name not in self.lent]
        for chip in to:  # the latest is the last
            known = self.lent.pop(chip.name, None)
            self.lent[chip.name] = known if known is not None else LentBus(chip, self.hosts)
        if self._user is not pins:
            self._user = pins
            taken = [bus.chip for bus in self.lent.values()]
        for chip in taken:
            chip.judged = False
            for other in self.hosts:
                if other is not pins:
                    for own in other.at(chip):
                        own.release()
        if taken:
            self._kernel.settle()

    def _note_bytes(self, chips: list[Chip]) -> None:
        for chip in chips:
            if chip.name in self.lent:
                self.lent[chip.name].byte = chip.bus_net.value

    def give_back(self) -> None:
        """Put every bus back as hosts have left it by hand."""
        self.flush()
        lent, self.lent = self.lent, {}
        for bus in lent.values():
            bus.put_back(self.hosts)
        self._kernel.settle()
        for bus in lent.values():
            bus.recall()

    def leave(self, when: int, pin: Pin, level: int) -> None:
        """Take over what is to happen to a pin after a cycle that was not played here."""
        self._tail.append((when, pin, level))
        if self._timer.due == NEVER:
            self._timer.at(self._tail[0][0])

    def flush(self) -> None:
        """Run the queued hold edges now; every net has its true level then."""
        for guard in self.guards:
            guard.come_true()
            if self._tail:
                guard.cut_short()
        if self._tail:
            while self._tail:
                _, pin, level = self._tail.popleft()
                pin.drive(level)
                self._kernel.settle()
            self._timer.cancel()

    def tail(self, hosts: list[HostPins]) -> list[tuple[int, int, str, int]]:
        """Return the hold edges that are still to come: instant, host, pin, level."""
        return [
            (when, number, host.name_of(pin), level)
            for when, pin, level in self._tail
            for number, host in enumerate(hosts)
            if host.name_of(pin)
        ]

    def set_tail(self, tail: list[tuple[int, int, str, int]], hosts: list[HostPins]) -> None:
        """Take back what :meth:`tail` gave; the kernel has the timer."""
        self._tail.clear()
        for when, number, name, level in tail:
            self._tail.append((when, hosts[number].named(name), level))

    def _run_tail(self) -> None:
        while self._tail and self._tail[0][0] <= self._kernel.now:
            _, pin, level = self._tail.popleft()
            pin.drive(level)
        if self._tail:
            self._timer.at(self._tail[0][0])


def together(chips: list[Chip]) -> int:
    """Return the byte on a host's data lines: FFh with no chip, low where chips disagree."""
    data = 0xFF
    for chip in chips:
        data &= chip.bus_net.value
    return data
