"""Chips at rest need nobody: left alone they are what they would be had somebody looked after them.

Two boards from one file, with one host each that does the same. On one every chip is brought up to
date in small steps. On the other that is done only while a chip does not rest, as a server does it.
"""

from contextlib import suppress
from random import Random

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from tests.properties.test_rest import FAMILIES, Machine, reached
from vbus.core.kernel import MS, NEVER, SECOND, US
from vbus.core.signals import Observer
from vbus.protocols.port import PortError

LISTENED = {
    "lm628": ("HI",),
    "mcp1200": ("PROF", "IDLE", "BUSY", "TRIG"),
    "mc1241a": ("~HostIntrpt", "HostRdy"),
}
FAST = {"lm628": "D0-D7", "mcp1200": "PULSE", "mc1241a": "PWMMag1A"}
"""What moves many times in a millisecond while the chip rests."""


class Edges(Observer):
    """Takes down edges."""

    def __init__(self) -> None:
        self.seen: list[tuple[int, str, int]] = []

    def edge(self, when: int, net: str, level: int) -> None:
        self.seen.append((when, net, level))


class Watched(Machine):
    """A random host on a random board, some of whose outputs are listened to."""

    def __init__(self, family: str, seed: int, listened: tuple[str, ...]) -> None:
        super().__init__(family, seed, False)
        self.edges = Edges()
        for name in listened:
            self.board.watch(f"x.{name}", self.edges)

    def hold_or_not(self, held: bool) -> None:
        if held:
            with suppress(PortError):  # in the middle of something
                self.hold()

    def told(self) -> tuple[object, ...]:
        return (
            self.replies.hexdigest(), self.edges.seen, list(self.board.violations),
            self.board.state_hash(), self.board.trace_hash() if self.traced else "",
        )  # fmt: skip

    def served(self, duration: int, steps: int) -> None:
        """Let time pass as a server does: what rests is left alone."""
        end = self.board.now + duration
        for step in range(steps):
            if not self.chip.resting():
                self.chip.advance()
            self.port.delay((end - self.board.now) // (steps - step))

    def attended(self, duration: int, steps: int) -> None:
        """Let time pass, and bring the chip up to date whether it rests or not."""
        end = self.board.now + duration
        for step in range(steps):
            self.chip.advance()
            self.port.delay((end - self.board.now) // (steps - step))

    def motion(self) -> tuple[object, ...]:
        """All that a chip at rest must leave as it is."""
        shown = self.chip.telemetry()
        for name in ("time", "status"):  # the time goes on, and so do samples, with BUSY
            shown.pop(name, 0)
        return (
            sorted(shown.items()), list(self.board.violations),
            [(plant.count, getattr(plant.inner, "velocity", 0.0)) for plant in self.counted],
        )  # fmt: skip


courses = st.lists(
    st.tuples(
        st.floats(6, 11).map(lambda power: int(10**power)), st.integers(1, 9), st.integers(0, 4)
    ),
    min_size=1,
    max_size=5,
)


@pytest.mark.parametrize("family", FAMILIES)
@settings(max_examples=50, deadline=None)
@given(
    seed=st.integers(0, 2**32 - 1),
    before=st.integers(0, 12),
    held=st.booleans(),
    listens=st.sampled_from(("nothing", "some", "fast")),
    course=courses,
)
def test_a_chip_left_alone_is_one_that_was_looked_after(
    family: str, seed: int, before: int, held: bool, listens: str,
    course: list[tuple[int, int, int]],
) -> None:  # fmt: skip
    listened = () if listens == "nothing" else LISTENED[family]
    longest = SECOND
    if listens == "fast":
        listened, longest = (*listened, FAST[family]), 2 * MS
    served, attended = (Watched(family, seed, listened) for _ in range(2))
    for machine in (served, attended):
        reached(machine, before)
        machine.hold_or_not(held)
    for duration, steps, operations in course:
        served.served(min(duration, longest), 3)
        attended.attended(min(duration, longest), 3 * steps)
        for machine in (served, attended):
            reached(machine, operations)
    assert served.told() == attended.told()


@pytest.mark.parametrize("family", FAMILIES)
@settings(max_examples=50, deadline=None)
@given(seed=st.integers(0, 2**32 - 1), before=st.integers(0, 12), held=st.booleans())
def test_a_chip_that_says_it_rests_does_nothing_for_hours(
    family: str, seed: int, before: int, held: bool
) -> None:
    machine = Watched(family, seed, ())
    reached(machine, before)
    machine.hold_or_not(held)
    for _ in range(40):
        machine.port.delay(Random(seed).randrange(10 * US, 10 * MS))
        machine.chip.advance()
        if machine.chip.resting():
            break
    else:
        return  # it moves, or is turned by a load
    if machine.board.next_due() != NEVER:
        return  # somebody listens to what it puts out in every sample: a timer sees to that
    motion, ran = machine.motion(), sum(plant.periods for plant in machine.counted)

    machine.port.delay(3 * 3600 * SECOND)

    assert machine.chip.resting(), "though nobody has looked at it"
    assert machine.motion() == motion
    assert machine.chip.resting()
    assert sum(plant.periods for plant in machine.counted) - ran < 100, "of hundreds of millions"


@pytest.mark.parametrize("held", [False, True], ids=["motor off", "holding"])
@pytest.mark.parametrize("family", FAMILIES)
def test_chips_come_to_rest(family: str, held: bool) -> None:
    rest = 0
    for seed in range(12):
        machine = Watched(family, seed, ())
        machine.hold_or_not(held)
        for _ in range(50):
            machine.port.delay(10 * MS)
            machine.chip.advance()
        rest += machine.chip.resting()
    assert rest >= 3
