"""Every row of the AC table, on its limit and one picosecond inside it (PMD-TIM)."""

from collections.abc import Callable

import pytest

from tests.conformance.ac import Case, Promise, check, check_complete, check_promise, parameters
from tests.conformance.mc1241a.conftest import Bench
from tests.conformance.mc1241a.test_timing import READ, WRITE, Step, changed, judged
from vbus.chips.mc1241a.datasheet import AC
from vbus.chips.mc1241a.family import FAMILY
from vbus.core.kernel import MS, NS, SECOND, US
from vbus.core.signals import Violation, Z

EDGE = 20 * US
"""Where the trailing edge of the strobe lies (ps)."""


def play(bench: Bench, steps: list[Step], at: int) -> None:
    """Move pins; offsets from the trailing edge at ``at``, both in ps."""
    for offset, pin, level in sorted(steps, key=lambda step: step[0]):
        bench.kernel.run_until(max(at + offset, bench.now))
        bench.drive(pin, level)


def in_ps(steps: tuple[Step, ...]) -> tuple[Step, ...]:
    return tuple((offset * NS, pin, level) for offset, pin, level in steps)


def writing(moved: str, place: Callable[[int], int]) -> Callable[[int], list[Violation]]:
    """A write with one edge at the offset that ``place`` finds for the interval."""

    def run(gap: int) -> list[Violation]:
        bench = judged()
        steps = changed(in_ps(WRITE), **{moved: place(gap)})
        # The bus keeper would hide the end of the data: the host drives something else.
        play(bench, [(o, p, 0x11 if (p, v) == ("D0-D7", Z) else v) for o, p, v in steps], EDGE)
        bench.run_for(US)
        return bench.violations

    return run


def reading(moved: str, place: Callable[[int], int]) -> Callable[[int], list[Violation]]:
    def run(gap: int) -> list[Violation]:
        bench = judged()
        play(bench, changed(in_ps(READ), **{moved: place(gap)}), EDGE)
        bench.run_for(US)
        return bench.violations

    return run


def command_line_of_a_read(gap: int) -> list[Violation]:
    bench = judged()
    bench.drive("HostCmd", 1)
    bench.run_for(US)
    play(bench, [*in_ps(READ), (-100 * NS - gap, "HostCmd", 0)], EDGE)
    return bench.violations


def driven_after_a_read(gap: int) -> list[Violation]:
    bench = judged()
    play(bench, list(in_ps(WRITE)), EDGE)
    bench.run_until(200 * US)
    play(bench, [*in_ps(READ), (gap, "D0-D7", 0x01)], 201 * US)
    return bench.violations


def looked_at_ready(gap: int) -> list[Violation]:
    """A second write whose strobe falls so long after HostRdy could fall."""
    bench = judged()
    play(bench, [s for s in in_ps(WRITE) if (s[1], s[2]) != ("~HostSlct", 1)], EDGE)
    play(bench, [(gap, "~HostWrite", 0), (200 * NS, "~HostWrite", 1)], EDGE)
    return bench.violations


def recovery(strobe: str, command: int, data: int) -> Callable[[int], list[Violation]]:
    """The two strobes of one word, so far apart."""

    def run(gap: int) -> list[Violation]:
        bench = judged()
        bench.chip.timing_checked = False
        bench.command(command)
        bench.wait_ready()
        bench.run_until(200 * US)
        bench.chip.timing_checked = True
        bench.drive("~HostSlct", 0)
        bench.drive("D0-D7", data)
        bench.run_for(20 * NS)
        play(bench, [(-100 * NS, strobe, 0), (0, strobe, 1)], 201 * US)
        play(bench, [(gap, strobe, 0), (gap + 100 * NS, strobe, 1)], 201 * US)
        bench.run_for(50 * NS)
        bench.drive("~HostSlct", 1)
        return bench.violations

    return run


def clock_period(period: int) -> list[Violation]:
    return Bench(hz=SECOND // period).violations


def clock_width(width: int) -> list[Violation]:
    return clock_period(2 * width)


def turned(*states: tuple[int, int]) -> Callable[[int], list[Violation]]:
    """Encoder 1 stays in the second state for the interval, in the others for long."""

    def run(width: int) -> list[Violation]:
        bench = judged()
        for place, (a, b) in enumerate(states):
            bench.drive("QuadA1", a)
            bench.drive("QuadB1", b)
            bench.run_for(width if place == 1 else 20 * US)
        return bench.violations

    return run


def index(set_up: bool) -> Callable[[int], list[Violation]]:
    """The index pulse reaches so far beyond the state with A and B low, at one of its ends."""

    def run(gap: int) -> list[Violation]:
        bench = judged()
        for a, b in ((1, 0), (1, 1), (0, 1)):
            bench.drive("QuadA1", a)
            bench.drive("QuadB1", b)
            bench.run_for(20 * US)
        before, after = (gap, 5 * US) if set_up else (5 * US, gap)
        start, end = 50 * US, 70 * US
        edges = [(-before, "~Index1", 0), (0, "QuadB1", 0)]
        play(bench, edges, bench.now + start)
        play(bench, [(0, "QuadA1", 1), (after, "~Index1", 1)], bench.now + end)
        return bench.violations

    return run


def reset_pulse(width: int) -> list[Violation]:
    bench = judged()
    bench.drive("~Reset", 0)
    bench.run_for(width)
    bench.drive("~Reset", 1)
    return bench.violations


def reset_after_power(rises: int) -> list[Violation]:
    bench = Bench(cold_start=True)
    bench.chip.timing_checked = True
    bench.run_until(rises - 5 * US)
    bench.drive("~Reset", 0)
    bench.run_until(rises)
    bench.drive("~Reset", Z)
    return bench.violations


def clock_case(symbol: str, limit: int, name: str, step: int, *beside: str) -> Case:
    play = clock_width if symbol == "T4" else clock_period
    return Case(symbol, limit, play, name, step, frozenset(beside))


BEFORE = -100 * NS
"""Where the strobe falls, from its rise (ps)."""

CASES = (
    Case("T1", 1600 * NS, turned((1, 0), (1, 1), (1, 0))),
    Case("T2", 800 * NS, turned((1, 0), (1, 1), (0, 1), (0, 0))),
    Case("T3", 0, index(True), "set-up"),
    Case("T3", 0, index(False), "hold"),
    Case("power", 250 * MS, reset_after_power),
    Case("reset", US, reset_pulse),
    # Half of the period, so that T5 is broken with it; T5 counts whole nanoseconds.
    clock_case("T4", 19_500, "shortest", -1, "T5"),
    clock_case("T4", 75 * NS, "longest", 1, "T5"),
    clock_case("T5", 39 * NS, "shortest", -NS, "T4"),
    clock_case("T5", 149 * NS, "longest", NS),
    Case("T6", 15 * NS, writing("slct_off", lambda gap: gap), "shortest"),
    Case("T6", 2 * US, writing("slct_off", lambda gap: gap), "longest", step=1),
    Case("T7w", 10 * NS, writing("slct_on", lambda gap: BEFORE - gap)),
    Case("T7r", -20 * NS, reading("slct_on", lambda gap: BEFORE - gap)),
    Case("T8w", 10 * NS, writing("cmd_on", lambda gap: BEFORE - gap)),
    Case("T8r", -20 * NS, command_line_of_a_read),
    Case("T9", 25 * NS, writing("cmd_off", lambda gap: gap)),
    Case("T10", 50 * NS, reading("strobe_on", lambda gap: -gap), output=True),
    Case("T12", 50 * NS, driven_after_a_read, output=True),
    # Whoever looks too early writes while the chip is busy, and too soon after the last strobe.
    Case(
        "T13",
        70 * NS,
        looked_at_ready,
        beside=frozenset({"not-ready", "T18", "floating-write"}),
        output=True,
    ),
    Case("T14", 50 * NS, writing("strobe_on", lambda gap: -gap)),
    Case("T15", 35 * NS, writing("data_on", lambda gap: -gap)),
    Case("T16", 30 * NS, writing("data_off", lambda gap: gap)),
    Case("T17", 60 * NS, recovery("~HostRead", 0x55, Z)),
    Case("T18", 60 * NS, recovery("~HostWrite", 0x29, 0x42)),
)

DAC_PORT = "the chip writes its own DAC: test_microstep.py measures the edges against the row"
PROMISES = (
    Promise("T11", 10 * NS, 0,
            "the chip holds the byte itself: test_timing.py looks 10 ns after the strobe"),
    Promise("T19", 35 * NS, 0, DAC_PORT),
    Promise("T20", 56 * NS, 95 * NS, DAC_PORT),
    Promise("T21", 17 * NS, 0, DAC_PORT),
    Promise("T22", 10 * NS, 40 * NS, DAC_PORT),
    Promise("T23", 75 * NS, 92 * NS, DAC_PORT),
    Promise("T24", 0, 92 * NS, DAC_PORT),
    Promise("T25", 160 * NS, 0, DAC_PORT),
    Promise("T26", 0, 66 * NS, DAC_PORT),
    Promise("T27", 0, 44_500, DAC_PORT),
)  # fmt: skip


@pytest.mark.parametrize("case", parameters(AC, CASES))
def test_a_row_is_kept_on_its_limit_and_broken_inside_it(case: Case) -> None:
    check(AC, case)


@pytest.mark.parametrize("promise", parameters(AC, PROMISES))
def test_a_row_of_an_output_has_the_manual_s_numbers(promise: Promise) -> None:
    check_promise(AC, promise, 25_000_000)


def test_no_row_is_forgotten() -> None:
    check_complete(AC, CASES, PROMISES)
    assert {promise.symbol for promise in PROMISES} == FAMILY.kept
