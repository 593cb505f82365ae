"""Board: chips, plants and wires with one virtual time."""

import hashlib
from collections import deque
from collections.abc import Callable, Iterable
from typing import TYPE_CHECKING, Any, ClassVar, Final

import msgpack
from mypy_extensions import i64

from vbus.board.breath import breathe
from vbus.board.cards import Card
from vbus.board.host_bus import HostBus
from vbus.board.loading import prepare
from vbus.board.pin_maps import PinMap
from vbus.board.strobe_player import StrobePlayer
from vbus.chips.base import Chip
from vbus.kernel import NEVER, Clock, Kernel
from vbus.options import Settings
from vbus.signals import Net, Observer, Pin, Plant, Policy, Rule, Violation
from vbus.state import Names, Saved, save
from vbus.state.first import to_tuple
from vbus.trace.hash import TraceHash

if TYPE_CHECKING:
    from vbus.faults.faults import Faults

CONTENTION: Final = Rule(
    "board.contention", "decision 9", "Two outputs on one net must not drive different levels."
)
RULES: Final = (CONTENTION,)

POLICIES: Final = ("realtime", "lockstep", "slaved")

STATE_HASH: Final = 2
"""Version of the state hash: 1 is over nested tuples, 2 over fields by name."""

STRETCH: Final = 20_000_000_000_000
"""Chip time, shared among the chips, that is computed without a look at Ctrl-C (ps)."""
SHORTEST: Final = 1_000_000_000


class Board:
    """Chips, plants and nets under one virtual time.

    A board is a pure function of how it was built and of the calls made on its ports, with
    their instants. It never reads a clock.

    Args:
        name: for people, and for finding it among running boards.
        policy: who is master of time: ``"realtime"`` (the server stamps), ``"lockstep"`` (time
            moves by bus cycles and DELAY), ``"slaved"`` (the host stamps).
        rate: chip seconds per wall second, for ``"realtime"``; ``inf`` is as fast as possible.
        violations: what to do when a host breaks a datasheet.
        seed: for every seeded stream of the board.
        clock_step: how far reading a clock moves time on a lockstep board (ps).
    """

    STATE: ClassVar[Names] = (
        "levels: list[i64]", "wires: parts", "ports: parts",
        "tail: list[(i64, i64, str, i64), ...]", "kernel: part", "chips: parts",
    )  # fmt: skip
    WIRING: ClassVar[Names] = (
        "_trace", "axes", "buses", "clock_step", "file", "limit", "listeners", "name", "nets",
        "observers", "plants", "player", "policy", "port_type", "rate", "seed", "text",
        "violation_policy",
    )  # fmt: skip
    DERIVED: ClassVar[Names] = (
        "_counters", "_faults", "claims", "disturbed", "reads", "violations", "writes",
    )  # fmt: skip

    def __init__(
        self,
        name: str,
        policy: str = "lockstep",
        rate: float = 1.0,
        violations: Policy | None = None,
        seed: int = 0,
        clock_step: int = 1_000_000,
    ) -> None:
        if policy not in POLICIES:
            raise ValueError(f"time policy {policy!r}: allowed are {', '.join(POLICIES)}")
        self.name: str = name
        self.text: str = ""
        """The board file it was built from; "" if it was put together in Python."""
        self.file: str = ""
        """Name of that file."""
        self.policy: str = policy
        self.rate: float = rate
        self.seed: int = seed
        self.clock_step: int = clock_step
        self.violation_policy: Policy = violations if violations is not None else Policy()
        self.kernel: Kernel = Kernel()
        self.limit: i64 = NEVER - 1
        """Time may run to this instant without the wall clock (ps); set by the pacer."""
        self.chips: list[Chip] = []
        self.plants: list[Plant] = []
        self.axes: dict[str, Plant] = {}
        """The plants by axis, ``"x.1"``."""
        self.nets: dict[str, Net] = {}
        self.buses: dict[str, list[str]] = {}
        self.observers: list[Observer] = []
        self.listeners: list[Observer] = []
        """Observers that are told of violations only: bus cycles cost nothing for them."""
        self.port_type: Callable[[Board, str, list[Chip], int, Card | None], HostBus] = HostBus
        """What makes a port; a journal puts a recording one in its place."""
        self.violations: deque[Violation] = deque(maxlen=1000)
        """The latest violations; :attr:`counters` has the totals."""
        self._counters: dict[str, int] = {"reads": 0, "writes": 0, "violations": 0}
        self.reads: int = 0
        """Read cycles hosts have made."""
        self.writes: int = 0
        """Write cycles hosts have made."""
        self.ports: list[HostBus] = []
        self.claims: dict[str, HostBus] = {}
        self._trace: TraceHash | None = None
        self.player: StrobePlayer = StrobePlayer(self.kernel)
        self.disturbed: bool = False
        """Whether a fault is armed, so that nobody can promise what comes."""
        self._faults: Faults | None = None

    # -- building -----------------------------------------------------------------------------

    def add_chip(
        self, cls: type[Chip], name: str, part: str, hz: int, settings: Settings | None = None
    ) -> Chip:
        """Put a chip on the board.

        Raises:
            ValueError: a chip of that name is there, or the chip refuses its settings.
        """
        if any(chip.name == name for chip in self.chips):
            raise ValueError(f"there is a chip called {name!r} already")
        chip = cls(
            name, part, self.kernel, Clock(hz), settings, self.violation_policy, self.file_violation
        )
        self.chips.append(chip)
        for pin in chip.pins.values():
            self._own(pin.net)
        return chip

    def connect(self, chip: str, axis: int, plant: Plant) -> None:
        """Attach ``plant`` to an axis (0-based) of ``chip``."""
        self.chip(chip).connect(axis, plant)
        self.plants.append(plant)
        self.axes[f"{chip}.{axis + 1}"] = plant

    def join(self, name: str, pins: Iterable[str], rest: int | None = None) -> Net:
        """Solder pins (``"chip.pin"``) to one net called ``name``."""
        members = [self.find_pin(pin) for pin in pins]
        if not members:
            raise ValueError(f"net {name!r} joins no pins")
        widths = {pin.net.width for pin in members}
        if len(widths) > 1:
            raise ValueError(f"net {name!r} joins pins of different widths")
        net = self.nets.get(name)
        if net is None:
            level = members[0].net.rest if rest is None else rest
            net = Net(self.kernel, name, rest=level, width=widths.pop())
            self._own(net)
            self.nets[name] = net
        for pin in members:
            if pin.net is not net:
                pin.move(net)
        return net

    def adopt(self, net: Net) -> None:
        """Take a net made elsewhere: the end of a wire that goes on beyond this board."""
        self._own(net)
        self.nets[net.name] = net

    def share_bus(self, name: str, chips: Iterable[str]) -> None:
        """Give several chips of one family one bus: all but their select lines are joined."""
        members = [self.chip(chip) for chip in chips]
        family = {chip.FAMILY for chip in members}
        if len(family) > 1:
            raise ValueError(f"bus {name!r} joins different chip families: {sorted(family)}")
        self.buses[name] = [chip.name for chip in members]
        for row in members[0].pin_rows:
            if row.shared:
                net = Net(self.kernel, f"{name}.{row.name}", rest=row.rest, width=row.width)
                self._own(net)
                for chip in members:
                    chip.pins[row.name].move(net)

    def _own(self, net: Net) -> None:
        net.clash = self._clash

    def power_on(self, done: bool = False) -> None:
        """Release every reset at the present instant; ``done`` starts after the resets."""
        for chip in self.chips:
            chip.power_on(done)

    @property
    def faults(self) -> "Faults":
        """What is broken on this board, or will be."""
        if self._faults is None:
            from vbus.faults.faults import Faults

            self._faults = Faults(self)
        return self._faults

    @property
    def broken(self) -> bool:
        """Whether anybody has asked for its faults."""
        return self._faults is not None

    # -- looking up ---------------------------------------------------------------------------

    def chip(self, name: str) -> Chip:
        """Return the chip called ``name``.

        Raises:
            ValueError: there is none.
        """
        for chip in self.chips:
            if chip.name == name:
                return chip
        known = ", ".join(chip.name for chip in self.chips) or "none"
        raise ValueError(f"no chip called {name!r}; this board has: {known}")

    def find_pin(self, name: str) -> Pin:
        """Return the pin written ``"chip.pin"``, e.g. ``"x./RST"``.

        Raises:
            ValueError: there is none.
        """
        chip_name, _, pin_name = name.partition(".")
        chip = self.chip(chip_name)
        pin = chip.pins.get(pin_name)
        if pin is None:
            known = ", ".join(chip.pins)
            raise ValueError(f"{chip.part} has no pin {pin_name!r}; it has: {known}")
        return pin

    # -- time ---------------------------------------------------------------------------------

    @property
    def now(self) -> int:
        """Chip time (ps)."""
        return self.kernel.now

    def run_until(self, when: int) -> None:
        """Let time pass to ``when`` (ps). Chips nobody listens to stay lazy by :data:`STRETCH`
        at the most, so that no single step takes long and Ctrl-C is heard; see :meth:`catch_up`.

        Raises:
            ValueError: ``when`` is before now, or beyond the end of time.
        """
        kernel = self.kernel
        if kernel.now + STRETCH < when < NEVER:
            stretch = max(STRETCH // (len(self.chips) + 1), SHORTEST)
            while True:
                # A board at rest stays so until something is due.
                begin = kernel.now if self._advance_awake() else max(kernel.now, kernel.next_due)
                # Nothing may be due at all: no sum with that instant, a machine word has an end.
                if begin >= when - stretch:
                    break
                kernel.run_until(begin + stretch)
        kernel.run_until(when)

    def _advance_awake(self) -> bool:
        """Bring chips up to now that are not at rest; tell whether there were any."""
        awake = False
        for chip in self.chips:
            if not chip.resting():
                awake = True
                chip.advance()
            breathe()
        return awake

    def run_for(self, duration: int) -> None:
        """Let ``duration`` ps pass."""
        self.run_until(self.kernel.now + duration)

    def catch_up(self) -> None:
        """Bring every lazy chip up to now, so that no look at it later takes long."""
        for chip in self.chips:
            chip.advance()
        self.settled(self.kernel.now)

    def settled(self, when: int) -> None:
        """Every chip has been brought up to instant ``when``: tell the observers."""
        self.kernel.settle()
        for observer in (*self.listeners, *self.observers):
            observer.settled(when)

    def next_due(self) -> int:
        """Return the next instant at which something watched may happen (ps)."""
        return self.kernel.next_due

    # -- hosts --------------------------------------------------------------------------------

    def open_port(
        self,
        label: str,
        chips: Iterable[str] | None = None,
        cycle_ps: int = 0,
        card: Card | None = None,
        pin_map: PinMap | None = None,
    ) -> HostBus:
        """Open a host's hold on some chips (default: all).

        Args:
            label: the host's name in traces.
            chips: names, in the order of SELECT's bits.
            cycle_ps: what a whole bus cycle costs; 0 is the default of the time policy.
            card: address decoding of a plug-in card, for hosts that know card addresses.
            pin_map: wiring of a microcontroller's port bits, for hosts that know only those.
        """
        names = list(chips) if chips is not None else [chip.name for chip in self.chips]
        members = [self.chip(name) for name in names]
        for other in self.ports:
            other.end_lease()
        port = self.port_type(self, label, members, cycle_ps, card)
        port.pin_map = pin_map
        self.ports.append(port)
        return port

    # -- findings -----------------------------------------------------------------------------

    @property
    def counters(self) -> dict[str, int]:
        """Totals so far: ``"reads"``, ``"writes"``, ``"violations"``, and of each rule broken."""
        return {**self._counters, "reads": self.reads, "writes": self.writes}

    def set_counters(self, totals: dict[str, int]) -> None:
        """Take back what :attr:`counters` gave."""
        self._counters = {"reads": 0, "writes": 0, "violations": 0, **totals}
        self.reads, self.writes = self._counters["reads"], self._counters["writes"]

    def file_violation(self, violation: Violation) -> None:
        """Record a violation, count it and tell the observers."""
        self.violations.append(violation)
        self._counters["violations"] += 1
        self._counters[violation.rule] = self._counters.get(violation.rule, 0) + 1
        for observer in (*self.listeners, *self.observers):
            observer.violation(violation)

    def _clash(self, net: Net) -> None:
        # In an order that does not tell who was soldered first.
        pins = sorted(net.pins, key=lambda pin: pin.name)
        self._contention(net.name, [(pin.name, pin.level) for pin in pins if pin.level >= 0])

    def meet(self, host: str, chips: list[Chip]) -> None:
        """Chips have driven the data lines of one host in one read: it is a fight if they disagree.

        Those on one bus of the board have fought on its net; others meet at the host alone.
        """
        levels = [(chip.bus_net.name, chip.bus_net.value) for chip in chips]
        if any(level != levels[0][1] for _, level in levels):
            self._contention(f"{host}.D0-D7", levels)

    def _contention(self, net: str, levels: list[tuple[str, int]]) -> None:
        if self.violation_policy.of(CONTENTION.name):
            fighters = ", ".join(f"{name}={level:X}" for name, level in levels)
            self.file_violation(
                Violation(
                    self.kernel.now, net, CONTENTION.name, CONTENTION.clause, CONTENTION.severity,
                    0, 0, f"net {net}: outputs disagree ({fighters})",
                )
            )  # fmt: skip

    def observe(self, observer: Observer) -> None:
        """Let ``observer`` see bus cycles and violations from now on."""
        self.observers.append(observer)

    def unobserve(self, observer: Observer) -> None:
        """Tell ``observer`` no more of bus cycles and violations."""
        self.observers.remove(observer)

    def listen(self, observer: Observer) -> None:
        """Let ``observer`` see violations, and no bus cycles, from now on."""
        self.listeners.append(observer)

    def watch(self, pin: str, observer: Observer) -> None:
        """Let ``observer`` see every edge of the net at ``pin`` (``"chip.pin"``)."""
        self.find_pin(pin).net.observe(observer)

    def start_trace(self) -> None:
        """Begin the trace hash: call before the first bus cycle."""
        if self._trace is None:
            self._trace = TraceHash([chip.name for chip in self.chips])
            self.observe(self._trace)
            for net in self.nets.values():
                net.observe(self._trace)

    def trace_hash(self) -> str:
        """Return the SHA-256 (hex) over all that happened since :meth:`start_trace`.

        Covers bus writes and reads, edges on joined nets and violations, in order of instant.
        """
        if self._trace is None:
            raise ValueError("no trace is running: call start_trace() before the first bus cycle")
        self.catch_up()
        return self._trace.digest()

    # -- state --------------------------------------------------------------------------------

    @property
    def wires(self) -> list[Net]:
        """The nets at the chips' pins."""
        nets = {id(pin.net): pin.net for chip in self.chips for pin in chip.pins.values()}
        return list(nets.values())

    @property
    def levels(self) -> list[int]:
        """What each pin of the chips drives."""
        return [pin.level for chip in self.chips for pin in chip.pins.values()]

    @levels.setter
    def levels(self, levels: list[int]) -> None:
        pins = [pin for chip in self.chips for pin in chip.pins.values()]
        for pin, level in zip(pins, levels, strict=True):
            pin.level = level

    @property
    def tail(self) -> list[tuple[int, int, str, int]]:
        """The hold edges of strobes that are still to come: instant, host, pin, level."""
        return self.player.tail([port._pins for port in self.ports])

    @tail.setter
    def tail(self, tail: list[tuple[int, int, str, int]]) -> None:
        self.player.set_tail(tail, [port._pins for port in self.ports])

    @property
    def parts(self) -> list[tuple[str, str]]:
        """Name and part number of each chip."""
        return [(chip.name, chip.part) for chip in self.chips]

    def save(self) -> Saved:
        """Return the whole state: time, chips with their plants, nets, pins, hosts, faults."""
        self.catch_up()
        saved: Saved = {**save(self), "parts": tuple(self.parts)}
        if self._faults is not None and self._faults.all():
            saved["faults"] = self._faults.save()
        return saved

    def load(self, saved: Any) -> None:
        """Take back what :meth:`save` gave, on a board with the same chips and open ports.

        Raises:
            SnapshotError: the state was made by another board, or is none; the board is as it was.
        """
        prepare(self, saved)()

    def state_hash(self, version: int = STATE_HASH) -> str:
        """Return the SHA-256 (hex) over :meth:`save`; version 1 is that of the first version."""
        saved = self.save() if version > 1 else to_tuple(self, self.save())
        return hashlib.sha256(msgpack.packb(saved)).hexdigest()
