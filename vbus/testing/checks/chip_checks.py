"""The conformance suite of chips: what every chip owes the board it stands on."""

from collections.abc import Callable
from random import Random
from typing import Final

from vbus.board.board import Board
from vbus.board.host_bus import HostBus
from vbus.chips.base import OUTPUT, Chip
from vbus.core.kernel import MS, NEVER, SECOND, US
from vbus.core.signals import EdgeTaker, Observer
from vbus.core.state import save
from vbus.testing.checks import Nonconformance, demand, packed

_GAPS: Final = (0, 1, 1 * US, 7 * US, 40 * US, 333 * US, 2 * MS)
_LONGEST_RESET: Final = 10 * SECOND
"""Beyond any part that is known: an LM628 takes 1.5 ms."""

Step = tuple[int, bool, int, int]
"""Pause before it (ps), whether it writes, address, byte."""


class _CheckRun:
    """One board with one chip under test and one host.

    Args:
        factory: makes the board.
        chip: the chip's name; "" for the first one.
        wait: lets time pass (ps) before a bus cycle.
    """

    def __init__(
        self,
        factory: Callable[[], Board],
        chip: str,
        wait: "Callable[[_CheckRun, int], None]" = lambda run, gap: run.board.run_for(gap),
    ) -> None:
        self._wait = wait
        self.board: Board = factory()
        names = [member.name for member in self.board.chips]
        demand(bool(names), "the factory made a board without chips")
        self.name: str = chip or names[0]
        self.chip: Chip = self.board.chip(self.name)
        self.port: HostBus = self.board.open_port("host", [self.name])
        self.replies: list[int] = []

    def start(self) -> None:
        ready = self.chip.ready_at()
        demand(
            ready < _LONGEST_RESET,
            f"{self.name}: ready_at() is {ready} ps after power-on: it never becomes ready",
        )
        self.board.run_until(max(ready, self.board.now))

    def step(self, step: Step) -> None:
        gap, write, address, data = step
        self._wait(self, gap)
        if write:
            self.port.write(address, data)
        else:
            value = self.port.read(address)
            demand(
                isinstance(value, int) and 0 <= value <= 0xFF,
                f"{self.name}: a read at {address:X}H gave {value!r}, not a byte",
            )
            self.replies.append(value)

    def end(self) -> None:
        # The last strobe's data hold beyond its latching edge.
        self.board.run_for(MS)
        self.board.catch_up()

    def play(self, steps: list[Step]) -> "_CheckRun":
        """Play all steps from power-on; whatever a host does, a chip goes on."""
        self.start()
        for number, step in enumerate(steps):
            try:
                self.step(step)
            except Nonconformance:
                raise
            except Exception as error:
                way = f"write of {step[3]:02X}h" if step[1] else "read"
                raise Nonconformance(
                    f"{self.name}: bus cycle {number}, a {way} at {step[2]:X}H at"
                    f" {self.board.now} ps, raised {type(error).__name__}: {error}; whatever a"
                    " host does, a chip goes on"
                ) from error
        self.end()
        return self

    def state(self) -> bytes:
        return packed(self.name, save(self.chip))

    def findings(self) -> list[tuple[int, str]]:
        return [(found.when, found.rule) for found in self.board.violations]


def _observed(run: _CheckRun, gap: int) -> None:
    """Let time pass in pieces, and read the chip's values after each of them."""
    board, chip = run.board, run.chip
    for part in (gap // 3, gap - gap // 3):
        board.run_for(part)
        chip.advance()
        chip.advance()
        due = chip.due(OUTPUT)
        demand(
            due > board.now,
            f"{run.name}: due(OUTPUT) gave {due} ps, and it is {board.now} ps: it must lie ahead",
        )
        chip.telemetry()
        chip.ready_at()
        run.state()


def _sliced(run: _CheckRun, gap: int) -> None:
    """Let time pass, and look at the chip again and again meanwhile."""
    board = run.board
    until = board.now + gap
    while board.now < until:
        board.run_until(min(until, board.now + max(gap // 16, 1)))
        run.chip.advance()


def check_chip(
    factory: Callable[[], Board], chip: str = "", seed: int = 0, cycles: int = 300
) -> None:
    """Check that a chip keeps the contract of :class:`~vbus.chips.base.Chip`.

    Plays ``cycles`` random bus cycles, most of them garbage to any chip, on boards that are
    treated differently in ways no chip may notice, and compares them.

    Args:
        factory: makes the same board again and again: lockstep, powered on, with no host yet.
        chip: the chip's name; "" for the first one.
        seed: of the garbage.
        cycles: how much of it.

    Raises:
        Nonconformance: it does not; says what differs, and where.
    """
    first = _CheckRun(factory, chip)
    demand(first.board.policy == "lockstep", "check_chip wants a board in lockstep time")
    _declared(first.chip)
    steps = _garbage(first.chip, Random(seed), cycles)
    first.play(steps)
    again = _CheckRun(factory, chip).play(steps)
    _same(first, again, "two runs with the same bus cycles differ: something is not repeatable")
    observed = _CheckRun(factory, chip, _observed).play(steps)
    sentence = "looking at it (advance, next_event, telemetry, ready_at, save) changes its run"
    _same(first, observed, sentence)
    _snapshots(factory, chip, steps, first)
    _strobes(factory, chip, steps, first)
    _edges(factory, chip, steps)


def _declared(chip: Chip) -> None:
    """What a class must say of itself."""
    demand(bool(chip.FAMILY), f"{type(chip).__name__}: FAMILY is empty")
    demand(1 <= chip.ADDRESS_BITS <= 16, f"{chip.name}: ADDRESS_BITS is {chip.ADDRESS_BITS}")
    rules = [rule.name for rule in chip.RULES]
    strange = [rule for rule in rules if not rule.startswith(f"{chip.FAMILY}.")]
    demand(
        not strange,
        f'{chip.name}: rules begin with "{chip.FAMILY}.", and these do not: {", ".join(strange)}',
    )
    demand(len(set(rules)) == len(rules), f"{chip.name}: two rules have one name")
    demand(chip.cycle_ps > 0, f"{chip.name}: cycle_ps is {chip.cycle_ps}: how long is a bus cycle?")


def _garbage(chip: Chip, random: Random, cycles: int) -> list[Step]:
    last = (1 << chip.ADDRESS_BITS) - 1
    return [
        (
            random.choice(_GAPS),
            random.random() < 0.5,
            random.randint(0, last),
            random.choice((0, 1, 0xFF, random.randrange(256), random.randrange(256))),
        )
        for _ in range(cycles)
    ]


def _same(one: _CheckRun, other: _CheckRun, sentence: str, strobes: bool = False) -> None:
    """Demand that two runs came to the same end."""
    for number, (a, b) in enumerate(zip(one.replies, other.replies, strict=True)):
        demand(a == b, f"{one.name}: {sentence}: read {number} gave {a:02X}h, then {b:02X}h")
    demand(
        one.board.now == other.board.now,
        f"{one.name}: {sentence}: one ended at {one.board.now} ps, the other at"
        f" {other.board.now} ps",
    )
    for found, then in zip(one.findings(), other.findings(), strict=False):
        demand(found == then, f"{one.name}: {sentence}: violation {found}, then {then}")
    demand(
        len(one.findings()) == len(other.findings()),
        f"{one.name}: {sentence}: {len(one.findings())} violations, then {len(other.findings())}",
    )
    if strobes:  # a chip remembers the edges it saw
        first, second = one.chip.telemetry(), other.chip.telemetry()
        demand(first == second, f"{one.name}: {sentence}: telemetry() {first}, then {second}")
        return
    demand(one.state() == other.state(), f"{one.name}: {sentence}: its state at the end differs")


def _snapshots(
    factory: Callable[[], Board], chip: str, steps: list[Step], first: _CheckRun
) -> None:
    """A state that was saved and loaded goes on as the first one."""
    for place in (0, len(steps) // 3, len(steps) - 2):
        before = _CheckRun(factory, chip)
        before.start()
        for step in steps[:place]:
            before.step(step)
        saved = before.board.save()
        packed(before.name, save(before.chip))
        after = _CheckRun(factory, chip)
        # So that a field STATE leaves out is not right by chance.
        after.start()
        for step in steps[place : place + 20]:
            after.step(step)
        after.board.load(saved)
        demand(
            after.state() == before.state(),
            f"{before.name}: the state loaded at bus cycle {place} is not the one saved",
        )
        after.replies = before.replies
        after.board.violations.clear()
        after.board.violations.extend(before.board.violations)
        for step in steps[place:]:
            after.step(step)
        after.end()
        _same(first, after, f"saved and loaded at bus cycle {place}, it goes on differently")


def _strobes(factory: Callable[[], Board], chip: str, steps: list[Step], first: _CheckRun) -> None:
    """Strobes on the nets give what whole cycles give."""
    run = _CheckRun(factory, chip)
    run.chip.bus_net.observe(Observer())
    _same(
        first,
        run.play(steps),
        "played as strobes on its pins, the same bus cycles differ",
        strobes=True,
    )


def _edges(factory: Callable[[], Board], chip: str, steps: list[Step]) -> None:
    """No output changes before due(OUTPUT) says so."""
    quick = _CheckRun(factory, chip, _sliced)
    seen = []
    for run in (quick, _CheckRun(factory, chip)):
        found: list[tuple[int, str, int]] = []
        edges = EdgeTaker(lambda *edge, into=found: into.append(edge))
        seen.append(found)
        for row in run.chip.pin_rows:
            if row.direction in ("out", "od") and not row.wave:
                run.chip.pins[row.name].net.observe(edges)
        run.play(steps)
    for a, b in zip(*seen, strict=False):
        demand(
            a == b,
            f"{quick.name}: looked at often, {a[1]} became {a[2]} at {a[0]} ps; left alone,"
            f" {b[1]} became {b[2]} at {b[0]} ps: due(OUTPUT) promises too much",
        )
    demand(
        len(seen[0]) == len(seen[1]),
        f"{quick.name}: {len(seen[0])} edges of its outputs when looked at often, {len(seen[1])}"
        " when left alone: due(OUTPUT) promises too much",
    )
    demand(quick.chip.due(OUTPUT) <= NEVER, f"{quick.name}: due(OUTPUT) lies beyond NEVER")
