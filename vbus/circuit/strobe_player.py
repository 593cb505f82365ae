"""Whole bus cycles as edges on the nets, for observed buses."""

from collections import deque
from collections.abc import Callable
from typing import Any, ClassVar

from vbus.chips.base import Chip
from vbus.chips.front_end import BusFrontEnd
from vbus.circuit.glue_cycles import GlueCycles
from vbus.circuit.host_pins import CycleEdge, HostPins, offset_of
from vbus.core.errors import SnapshotError
from vbus.core.kernel import NEVER, Kernel
from vbus.core.signals import Guard, Net, Pin, Z
from vbus.core.state import Names, Saved, load, save, validate


class LentBus:
    """A chip's bus that whole cycles have, as hosts have left it by hand.

    Args:
        chip: the chip.
        hosts: the pins of every host.

    Attributes:
        chip: the chip.
        hosts: the pins of every host.
        lines: the wires of the bus, but for D0-D7.
    """

    STATE: ClassVar[Names] = (
        "_data", "reading", "held: list[(i64, str, i64), ...]",
        "past: list[(bool, i64, i64, i64), _nets]", "_edges: saved[_front]",
    )  # fmt: skip
    WIRING: ClassVar[Names] = ("_front", "_nets", "chip", "hosts", "lines")
    DERIVED: ClassVar[Names] = ("_levels",)

    def __init__(self, chip: Chip, hosts: list[HostPins]) -> None:
        self.chip: Chip = chip
        self.hosts: list[HostPins] = hosts
        self._front: BusFrontEnd | None = chip.front
        # D0-D7 have the latest byte, until a pin there moves again.
        self.lines: list[Net] = [pin.net for pin in chip.bus_pins if pin is not chip.data_pin]
        self._nets: list[Net] = [*self.lines, chip.bus_net]
        self.past: list[tuple[bool, int, int, int]] = []
        """Of each net: whether pins disagreed, and its history."""
        self._data: int = Z
        self.reading: int = 0
        """Which kind of read was under way, as the chip's front-end calls it; 0: none."""
        self._levels: dict[int, int] = {}
        self._edges: Saved = {}

    def note(self) -> None:
        """Note how the bus stands: whole cycles have it from now on."""
        if self._front is not None:
            self._front.conclude()
            self.reading = self._front.reading()
            self._edges = save(self._front)
        self._data = self.chip.data_pin.level
        self._levels = {id(pin): pin.level for host in self.hosts for pin in host.at(self.chip)}
        past: list[tuple[bool, int, int, int]] = []
        for net in self._nets:
            previous, changed_at, let_go_at = net.history
            past.append((net.clashing, previous, changed_at, let_go_at))
        self.past = past

    @property
    def held(self) -> list[tuple[int, str, int]]:
        """What hosts drive: number of the host, name of the chip's pin, level."""
        return [
            (number, host.name_of(pin), self._levels[id(pin)])
            for number, host in enumerate(self.hosts) for pin in host.at(self.chip)
            if self._levels.get(id(pin), Z) != Z
        ]  # fmt: skip

    @held.setter
    def held(self, held: list[tuple[int, str, int]]) -> None:
        self._levels = {id(self.hosts[number].named(name)): level for number, name, level in held}

    def move(self, back: bool) -> None:
        """Put the pins back, or let go of the bus; the lines are still to follow."""
        self.chip.data_pin.level = self._data if back else Z
        for host in self.hosts:
            for pin in host.at(self.chip):
                # A pin soldered since drove nothing.
                pin.level = self._levels.get(id(pin), Z) if back else Z
        if back:
            for net, row in zip(self._nets, self.past, strict=True):
                net.clashing = row[0]  # nothing is fought that was not

    def recall(self) -> None:
        """Let the chip know of the edges it knew, and the nets of their past."""
        if self._front is not None:
            self._front.forget_edges()
            load(self._front, self._edges)
        for net, row in zip(self._nets, self.past, strict=True):
            net.history = row[1:]


class StrobePlayer:
    """Plays the strobes of whole cycles; the hold edges follow while time goes on.

    A cycle is over for its host at the latching edge. What comes after it (hold times) is queued
    and happens at its instant, or when the next cycle begins, if that is earlier.

    Args:
        kernel: the board's time.
        chips: the board's chips.
    """

    WIRING: ClassVar[Names] = ("_chips", "guards", "hosts", "through")
    DERIVED: ClassVar[Names] = ("_tail", "_user", "by_hand", "lent")

    def __init__(self, kernel: Kernel, chips: list[Chip]) -> None:
        self._kernel: Kernel = kernel
        self._chips: list[Chip] = chips
        self._tail: deque[tuple[int, Pin, int]] = deque()
        # Saved with the kernel: hold edges of a snapshot come at their instants.
        self._timer = kernel.timer(self._run_tail)
        self.hosts: list[HostPins] = []
        """Pins of every host that is there."""
        self.by_hand: bool = True
        """Whether a host may hold lines of a bus by hand: :meth:`lend` comes before a cycle."""
        self.lent: dict[str, LentBus] = {}
        """Buses that whole cycles have had since a host moved lines itself, by chip."""
        self._user: HostPins | None = None
        """Pins of the host of the last cycle that was played."""
        self.guards: list[Guard] = []
        """Who may owe nets their levels."""
        self.through: GlueCycles | None = None
        """Sees the cycles at chips behind glue."""

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
            strobes = strobes + pins.strobes(chip, write, address, data)
        if not chips[0].CONNECTOR:
            self.lend(chips, pins)
        if not strobes:
            return self._answer(chips, write, address, data, when)
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
            if offset > 0:
                self._tail.append((when + offset, pin, level))
                continue
            if when + offset > kernel.now:
                kernel.run_until(when + offset)
            if at_once:
                pin.drive(level)
                if offset < 0 and strobes[number + 1].offset > offset:
                    kernel.settle()
            else:
                self._drive(pin, level)
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
        self._kernel.settle()
        return together(chips)

    # Lines that a host holds by hand are let go of for whole cycles, and stand as they were left,
    # with what chips knew of their edges, as soon as a host moves lines again. A whole cycle moves
    # lines only while they are observed: so nothing follows from what it leaves of them, and a
    # saved state has both. Chips hear no edge as a bus is lent or given back; glue there does.

    def lend(self, chips: list[Chip], user: HostPins | None = None) -> None:
        """Give the buses that hosts hold by hand to whole cycles.

        Args:
            chips: those whose cycle is played: their buses are given in any case.
            user: pins of the host whose cycle is played.
        """
        nets = {id(pin.net) for chip in chips for pin in chip.bus_pins}
        if self.by_hand:
            self.by_hand = False
            nets |= {id(pin.net) for one in self.hosts for pin in one.driven()}
        elif self._user is user and all(chip.name in self.lent for chip in chips):
            return
        # All chips on these wires: none is to take another's cycle for the end of its own.
        taken = [
            LentBus(chip, self.hosts) for chip in self._chips
            if not chip.CONNECTOR and chip.name not in self.lent
            and any(id(pin.net) in nets for pin in chip.bus_pins)
        ]  # fmt: skip
        for bus in taken:
            bus.note()
        self.lent |= {bus.chip.name: bus for bus in taken}
        if user is not None and user is not self._user:
            taken = list(self.lent.values())
        self._user = user
        self._move(taken, back=False)

    def give_back(self) -> None:
        """Put every bus back as hosts have left it by hand."""
        lent = list(self.lent.values())
        if lent:  # of a computer's own bus, which is never lent, the hold edges come in time
            self.flush()
        self.forget()
        if lent:
            self._move(lent, back=True)
            # A read under way shows what the chip has now, and each change at its instant.
            for bus in lent:
                bus.chip.advance()
                if bus.reading and bus.chip.front is not None:
                    bus.chip.front.resume(bus.reading)
                bus.chip.rearm()

    def forget(self) -> None:
        """All stands as hosts have left it by hand: so a state is loaded."""
        self.lent, self._user, self.by_hand = {}, None, True

    def _move(self, buses: list[LentBus], back: bool) -> None:
        """Move buses, and what the chips know of edges, without an edge for any chip."""
        fronts: list[BusFrontEnd] = [bus.chip.front for bus in buses if bus.chip.front is not None]
        deaf = [ear for front in fronts for ear in front.ears]
        if self.through is not None:
            deaf.append(self.through.watcher)
        for ear in deaf:
            ear.deaf = True
        for bus in buses:
            bus.move(back)
        for bus in buses:
            for net in bus.lines:
                net.resolve()
        self._kernel.settle()
        for ear in deaf:
            ear.deaf = False
        for bus in buses:
            if back:
                bus.recall()
        if not back:
            for front in fronts:
                front.forget_edges()
        if self.through is not None:
            self.through.after_load()

    def saved(self) -> Saved:
        """Return what whole cycles have of the buses: the host that had them last, and each bus."""
        user = self.hosts.index(self._user) if self._user in self.hosts else -1
        return {"": user, **{name: save(bus) for name, bus in self.lent.items()}}

    def prepare(self, saved: Any, hosts: list[HostPins]) -> Callable[[], None]:
        """Check what :meth:`saved` gave; return what loads it, once all levels are.

        Args:
            saved: that.
            hosts: the pins of the hosts that were there, in their order.

        Raises:
            SnapshotError: it does not fit.
        """
        chips = {chip.name: chip for chip in self._chips}
        if not isinstance(saved, dict) or not saved.keys() <= chips.keys() | {""}:
            raise SnapshotError("the state: lent: wants buses by the names of their chips")
        rows = {**saved}
        user = rows.pop("", -1)
        users = [host for number, host in enumerate(hosts) if number == user]
        lent = {name: LentBus(chips[name], hosts) for name in rows}
        loads = [
            validate(lent[name], row, f"the state: lent: {name}") for name, row in rows.items()
        ]

        def go() -> None:
            for loading in loads:
                loading.apply()
            for bus in lent.values():
                bus.hosts = self.hosts
            self.lent, self.by_hand = lent, False
            self._user = users[0] if users else None

        return go

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
                self._drive(pin, level)
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

    def _drive(self, pin: Pin, level: int) -> None:
        """Make one edge of a whole cycle; such an edge carries no time of its host to be judged."""
        judged = [bus.chip for bus in self.lent.values() if bus.chip.timing_checked]
        for chip in judged:
            chip.timing_checked = False
        pin.drive(level)
        self._kernel.settle()
        for chip in judged:
            chip.timing_checked = True

    def _run_tail(self) -> None:
        while self._tail and self._tail[0][0] <= self._kernel.now:
            _, pin, level = self._tail.popleft()
            self._drive(pin, level)
        if self._tail:
            self._timer.at(self._tail[0][0])


def together(chips: list[Chip]) -> int:
    """Return the byte on a host's data lines: FFh with no chip, low where chips disagree."""
    data = 0xFF
    for chip in chips:
        data &= chip.bus_net.value
    return data
