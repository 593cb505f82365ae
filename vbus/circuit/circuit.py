"""Circuit: chips, plants and nets under one virtual time, and what is found out about them."""

from collections import deque
from collections.abc import Callable, Iterable, Mapping
from typing import ClassVar, Final

from mypy_extensions import i64

from vbus.chips.base import Chip
from vbus.chips.tables import PinRow
from vbus.circuit.glue_cycles import GlueCycles
from vbus.circuit.stream import PacketReader, PacketStream
from vbus.circuit.strobe_player import StrobePlayer
from vbus.core.interpreter import check_interrupts
from vbus.core.kernel import END, NEVER, Clock, Kernel
from vbus.core.kernel.kernel import Task
from vbus.core.options import Settings
from vbus.core.signals import Net, Observer, Pin, Plant, Policy, Rule, Violation
from vbus.core.state import Names
from vbus.glue.part import Glue, GluePart, Input
from vbus.glue.table import Block

CONTENTION: Final = Rule(
    "board.contention", "decision 9", "Two outputs on one net must not drive different levels."
)
OSCILLATION: Final = Rule(
    "board.oscillation", "glue",
    "Glue without a delay must come to rest: what follows the data bus at once must not decide who"
    " drives it.",
)  # fmt: skip
RULES: Final = (CONTENTION, OSCILLATION)

POLICIES: Final = ("realtime", "lockstep", "slaved")

STRETCH: Final = 20_000_000_000_000
"""Chip time, shared among the chips, that is computed without a look at Ctrl-C (ps)."""
SHORTEST: Final = 1_000_000_000
"""The least stretch of a chip (ps): with a shorter one the looks at Ctrl-C would be the work."""
MOST_STEPS: Final = 2000
"""Samples of a chip that a host may let pass in one go on a board that is served."""


class Fights(Task):
    """Outputs that disagree on wires of a card's bus, until everything has followed the strobe.

    A transceiver turns round and a chip lets go at the same instant. Which of them comes first is
    the order of this program, not of a circuit, so only what remains is reported.
    """

    WIRING: ClassVar[Names] = ("*",)

    def __init__(self, kernel: Kernel, file: Callable[[Net], None]) -> None:
        self._kernel: Kernel = kernel
        self._file: Callable[[Net], None] = file
        self._nets: list[Net] = []

    def note(self, net: Net) -> None:
        """Outputs begin to disagree."""
        if not self._nets:
            self._kernel.soon(self)
        self._nets.append(net)

    def run(self) -> None:
        """File those that still do, once nothing else is to follow."""
        if not self._kernel.last:
            self._kernel.soon(self)
            return
        nets, self._nets = self._nets, []
        for net in dict.fromkeys(nets):
            if net.clashing:
                self._file(net)


class Circuit:
    """What is on a board, without the hosts: see :class:`~vbus.board.board.Board`."""

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
        self.policy: str = policy
        self.rate: float = rate
        self.seed: int = seed
        self.clock_step: int = clock_step
        self.violation_policy: Policy = violations if violations is not None else Policy()
        self.kernel: Kernel = Kernel()
        self.limit: i64 = END
        """Time may run to this instant without the wall clock (ps); set by the pacer, or by the
        nodes together (:attr:`granted`)."""
        self.granted: bool = False
        """Whether the board is a node in virtual time: nothing may happen beyond :attr:`limit`."""
        self.sliced: bool = False
        """Whether a held host's time passes in slices; set by the pacer."""
        self.caught: i64 = 0
        """The instant up to which every chip has been brought (ps)."""
        self.chips: list[Chip] = []
        self._by_name: dict[str, Chip] = {}
        self.glue: Glue = Glue(self.kernel, self._swing)
        """What stands between hosts and chips: the interrupts of cards, decoders, latches."""
        self.through: GlueCycles | None = None
        """Sees the cycles at chips behind it; None: no chip is."""
        self.missed: dict[str, tuple[int, int, int, int]] = {}
        """Bytes that hosts have looked for outside the strobes that gave them, by chip: how many,
        and of the first what was seen, what the chip gave, and when (ps)."""
        self.pins: list[Pin] = []
        """The chips' pins, and those of :attr:`glue`."""
        self._pin_nets: list[Net] = []
        self.plants: list[Plant] = []
        self.axes: dict[str, Plant] = {}
        """The plants by axis, ``"x.1"``."""
        self.nets: dict[str, Net] = {}
        self.buses: dict[str, list[str]] = {}
        self.observers: list[Observer] = []
        self.stream: PacketStream | None = None
        """One of the observers, while anybody reads packets: all readers have the same."""
        self.listeners: list[Observer] = []
        """Observers of violations only: bus cycles cost nothing for them."""
        # A host that breaks a rule in each cycle must not fill the memory.
        self.violations: deque[Violation] = deque(maxlen=1000)
        """The latest violations; :attr:`counters` has the totals."""
        self._counters: dict[str, int] = {"reads": 0, "writes": 0, "violations": 0}
        self.reads: int = 0
        """Read cycles hosts have made."""
        self.writes: int = 0
        """Write cycles hosts have made."""
        self.player: StrobePlayer = StrobePlayer(self.kernel, self.chips)
        self._fights: Fights = Fights(self.kernel, self._fight)
        self._on_clash: Callable[[Net], None] = self._clash  # one for all nets
        self.disturbed: bool = False
        """Whether a fault is armed, so that no lease can be given."""

    # -- building -----------------------------------------------------------------------------

    def add_chip(
        self, cls: type[Chip], name: str, part: str, hz: int, settings: Settings | None = None
    ) -> Chip:
        """Put a chip on the board.

        Raises:
            ValueError: a chip of that name is there, or the chip refuses its settings.
        """
        if name in self._by_name:
            raise ValueError(f"there is a chip called {name!r} already")
        chip = cls(
            name, part, self.kernel, Clock(hz), settings, self.violation_policy, self.file_violation
        )
        self.chips.append(chip)
        self._by_name[name] = chip
        for pin in chip.pins.values():
            self.pins.append(pin)
            self._own(pin.net)
        return chip

    def add_glue(
        self,
        name: str,
        pin_rows: tuple[PinRow, ...],
        blocks: Iterable[Block],
        borrowed: Mapping[str, Input],
        delay: int = 0,
        inner: tuple[PinRow, ...] = (),
    ) -> GluePart:
        """Put a part of glue on the board; see :class:`~vbus.glue.part.GluePart`."""
        made = GluePart(self.kernel, name, pin_rows, blocks, delay, borrowed, inner)
        self.glue.add(made)
        for pin in made.pins.values():
            self.pins.append(pin)
            self._own(pin.net)
        return made

    def glue_of(self, chips: Iterable[Chip]) -> list[GluePart]:
        """Return the glue in front of these chips and behind them."""
        return self.glue.around(pin for chip in chips for pin in chip.pins.values())

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
        self._pin_nets = []
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
        net.clash = self._on_clash
        self._pin_nets = []

    @property
    def pin_nets(self) -> list[Net]:
        """The nets at the chips' pins."""
        if not self._pin_nets:
            self._pin_nets = list(dict.fromkeys([pin.net for pin in self.pins]))
        return self._pin_nets

    def power_on(self, done: bool = False) -> None:
        """Release every reset at the present instant; ``done`` starts after the resets."""
        for chip in self.chips:
            chip.power_on(done)
        self.glue.start()
        if self.glue.parts or any(chip.CONNECTOR for chip in self.chips):
            # Only now: which chips are behind glue is known once all wires are soldered.
            through = GlueCycles(self.kernel, self.chips, self.glue)
            self.through = self.player.through = through if through.chips else None

    # -- looking up ---------------------------------------------------------------------------

    def chip(self, name: str) -> Chip:
        """Return the chip called ``name``.

        Raises:
            ValueError: there is none.
        """
        chip = self._by_name.get(name)
        if chip is not None:
            return chip
        known = ", ".join(self._by_name) or "none"
        raise ValueError(f"no chip called {name!r}; this board has: {known}")

    def find_pin(self, name: str) -> Pin:
        """Return the pin written ``"chip.pin"``, e.g. ``"x./RST"``.

        Raises:
            ValueError: there is none.
        """
        pin = self.glue.pins.get(name)
        if pin is not None:
            return pin
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

    def run_until(self, when: i64) -> None:
        """Let time pass to ``when`` (ps), and bring all that can be looked at there.

        Raises:
            ValueError: ``when`` is before now, or beyond the end of time.
        """
        self.pass_until(when)
        self.catch_up()

    def pass_until(self, when: i64) -> None:
        """Let time pass to ``when`` (ps). Chips without listeners stay lazy by :data:`STRETCH`
        at the most, so that no single step takes long and Ctrl-C is heard; see :meth:`catch_up`.

        Raises:
            ValueError: ``when`` is before now, or beyond the end of time.
        """
        kernel = self.kernel
        if kernel.now + STRETCH < when <= END:
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
            check_interrupts()
        return awake

    def run_for(self, duration: int) -> None:
        """Let ``duration`` ps pass."""
        self.run_until(self.kernel.now + duration)

    def catch_up(self) -> None:
        """Bring every lazy chip up to now, so that no look at it later takes long."""
        for chip in self.chips:
            chip.advance()
        for guard in self.player.guards:
            guard.come_true()
        self.settled(self.kernel.now)

    def settled(self, when: int) -> None:
        """Every chip has been brought up to instant ``when``: tell the observers."""
        self.caught = when
        self.kernel.settle()
        for observer in (*self.listeners, *self.observers):
            observer.settled(when)

    def stride(self) -> i64:
        """Return how much chip time takes no long while to compute (ps)."""
        step: i64 = NEVER
        for chip in self.chips:
            step = min(step, chip.step_ps())
        # Their product must fit a machine word.
        if step < END // MOST_STEPS:
            return step * MOST_STEPS
        return END

    def end_leases(self) -> None:
        """Carry out the cycles that leases promise, before anything else acts on the board."""

    def next_due(self) -> int:
        """Return the next instant at which something watched may happen (ps)."""
        return self.kernel.next_due

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

    def left_over(self) -> list[Violation]:
        """Return what hosts have begun and not ended, or never done: ask at the end of a run."""
        return [
            self._broken(rule, chip.name, text)
            for chip in self.chips
            for rule, text in chip.left_over()
            if self.violation_policy.of(rule.name)
        ]

    def hints(self, violations: Iterable[Violation]) -> list[str]:
        """Return what a host should know of violations beside what they say, each sentence once."""
        by_name = self._by_name
        hints = [by_name[v.chip].hint(v.rule, v.when) for v in violations if v.chip in by_name]
        return list(dict.fromkeys([text for text in hints if text]))

    def _clash(self, net: Net) -> None:
        if net.guard is not None:
            self._fights.note(net)
        else:
            self._fight(net)

    def _fight(self, net: Net) -> None:
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
        fighters = ", ".join(f"{name}={level:X}" for name, level in levels)
        self._find(CONTENTION, net, f"outputs disagree ({fighters})")

    def _swing(self, net: str) -> None:
        """Glue and a chip move each other without end; ``net`` is one that they move."""
        text = (
            "it moves what moves it, without end; give the glue a delay, or take the data bus out"
        )
        self._find(OSCILLATION, net, f"{text} of what selects")

    def _find(self, rule: Rule, net: str, text: str) -> None:
        """File what is wrong on a net, unless the rule is off."""
        if self.violation_policy.of(rule.name):
            self.file_violation(self._broken(rule, net, f"net {net}: {text}"))

    def _broken(self, rule: Rule, where: str, text: str) -> Violation:
        now = self.kernel.now
        return Violation(now, where, rule.name, rule.clause, rule.severity, 0, 0, text)

    def observe(self, observer: Observer) -> None:
        """Let ``observer`` see bus cycles and violations from now on, and packets if it reads."""
        if not isinstance(observer, PacketReader) or not observer.reads():
            self.observers.append(observer)
            return
        if self.stream is None:
            self.stream = PacketStream.of(self.chips)
            self.observers.append(self.stream)
        self.stream.readers = (*self.stream.readers, observer)

    def unobserve(self, observer: Observer) -> None:
        """Tell ``observer`` no more of bus cycles and violations."""
        stream = self.stream
        if stream is None or observer not in stream.readers:
            self.observers.remove(observer)
            return
        stream.readers = tuple([one for one in stream.readers if one is not observer])
        if not stream.readers:
            self.observers.remove(stream)
            self.stream = None

    def tell_cycle(
        self, when: int, host: str, chip: str, write: bool, address: int, data: int
    ) -> None:
        """A whole bus cycle has been made: tell the observers."""
        for observer in self.observers:
            observer.bus_cycle(when, host, chip, write, address, data)

    def listen(self, observer: Observer) -> None:
        """Let ``observer`` see violations, and no bus cycles, from now on."""
        self.listeners.append(observer)

    def watch(self, pin: str, observer: Observer) -> None:
        """Let ``observer`` see every edge of the net at ``pin`` (``"chip.pin"``)."""
        self.find_pin(pin).net.observe(observer)
