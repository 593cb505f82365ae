"""Every row of the AC table, on its limit and one picosecond inside it."""

from collections.abc import Callable

import pytest

from tests.conformance.ac import Case, check, check_complete, parameters
from tests.conformance.lm628.bench import Bench
from tests.conformance.lm628.test_timing import at_the_pins, play, read, ready_to_report, write
from vbus.chips.lm628.datasheet import AC
from vbus.core.kernel import NS, SECOND, US
from vbus.core.signals import HIGH, LOW, Violation, Z

SIP, LPES = 0x03, 0x1A


def writing(name: str, **fixed: int) -> Callable[[int], list[Violation]]:
    def run(gap: int) -> list[Violation]:
        bench = at_the_pins()
        write(bench, SIP, **{**fixed, name: gap})
        bench.run(20 * US)
        return bench.violations

    return run


def reading(name: str) -> Callable[[int], list[Violation]]:
    def run(gap: int) -> list[Violation]:
        bench = ready_to_report()
        read(bench, 1, **{name: gap})
        bench.run(US)
        return bench.violations

    return run


def driving(since: int, until: Callable[[int], int]) -> Callable[[int], list[Violation]]:
    """The host drives the bus around the rise of /RD, which is instant 0."""

    def run(gap: int) -> list[Violation]:
        bench = ready_to_report()
        rises = 300 * NS
        start = since if since else gap
        play(
            bench,
            (0, "/PS", HIGH), (0, "/CS", LOW), (100 * NS, "/RD", LOW), (rises, "/RD", HIGH),
            (rises + start, "D0-D7", 0x00), (rises + until(gap), "D0-D7", Z),
        )  # fmt: skip
        bench.run(US)
        return bench.violations

    return run


def recovery(strobe: str) -> Callable[[int], list[Violation]]:
    def run(gap: int) -> list[Violation]:
        bench = ready_to_report() if strobe == "/RD" else at_the_pins()
        if strobe == "/WR":
            bench.command("LPES")
            bench.run(US)
            bench.set(**{"D0-D7": 0x55})
        play(
            bench,
            (0, "/PS", HIGH), (0, "/CS", LOW), (100 * NS, strobe, LOW), (300 * NS, strobe, HIGH),
            (300 * NS + gap, strobe, LOW), (600 * NS, strobe, HIGH), (700 * NS, "/CS", HIGH),
        )  # fmt: skip
        return bench.violations

    return run


def clock_period(part: str) -> Callable[[int], list[Violation]]:
    return lambda period: Bench(part=part, hz=SECOND // period).violations


def clock_width(part: str, hz: int, high: bool) -> Callable[[int], list[Violation]]:
    def run(width: int) -> list[Violation]:
        share = width * hz / SECOND
        # A little more than the width: a share that is not a whole binary fraction rounds down.
        return Bench(
            part=part, hz=hz, clk_duty=share + 1e-9 if high else 1 - share - 1e-9
        ).violations

    return run


def reset_pulse(hz: int) -> Callable[[int], list[Violation]]:
    def run(width: int) -> list[Violation]:
        bench = Bench("strobe", hz=hz)
        bench.run(US)
        play(bench, (0, "/RST", LOW), (width, "/RST", HIGH))
        return bench.violations

    return run


def turned(hz: int, *states: int) -> Callable[[int], list[Violation]]:
    """The encoder stays in the second state for the interval, in the others for long."""

    def run(width: int) -> list[Violation]:
        bench = Bench("strobe", hz=hz)
        bench.run(US)
        for place, state in enumerate(states):
            bench.set(A=state >> 1, B=state & 1)
            bench.run(width if place == 1 else 20 * US)
        return bench.violations

    return run


def index(set_up: bool) -> Callable[[int], list[Violation]]:
    """The index pulse reaches so far beyond the state with A and B low, at one of its ends."""

    def run(gap: int) -> list[Violation]:
        bench = at_the_pins()
        for a, b in ((1, 0), (1, 1), (0, 1)):
            bench.set(A=a, B=b)
            bench.run(20 * US)
        before, after = (gap, 5 * US) if set_up else (5 * US, gap)
        low = 10 * US
        play(
            bench,
            (low, "B", LOW), (low - before, "/IN", LOW),
            (2 * low, "A", HIGH), (2 * low + after, "/IN", HIGH),
        )  # fmt: skip
        bench.run(20 * US)
        return bench.violations

    return run


LOST = frozenset({"double-edge"})
"""A state that is lost makes the next one a double step."""

CASES = (
    Case("T1", 2 * US, turned(8_000_000, 2, 3, 2), "8 MHz"),
    Case("T1", 2_666_667, turned(6_000_000, 2, 3, 2), "6 MHz"),
    Case("T2", US, turned(8_000_000, 2, 3, 1, 0), "8 MHz", beside=LOST),
    Case("T2", 1_333_334, turned(6_000_000, 2, 3, 1, 0), "6 MHz", beside=LOST),
    Case("T3", 0, index(True), "set-up"),
    Case("T3", 0, index(False), "hold"),
    Case("T4", 57 * NS, clock_width("LM628N-8", 8_000_000, True), "-8 high"),
    Case("T4", 57 * NS, clock_width("LM628N-8", 8_000_000, False), "-8 low"),
    Case("T4", 78 * NS, clock_width("LM628N-6", 6_000_000, True), "-6 high"),
    Case("T4", 78 * NS, clock_width("LM628N-6", 6_000_000, False), "-6 low"),
    Case("T5", 125 * NS, clock_period("LM628N-8"), "-8"),
    Case("T5", 166 * NS, clock_period("LM628N-6"), "-6"),
    Case("T5", US, clock_period("LM628N-8"), "longest", step=1),
    Case("T6", US, reset_pulse(8_000_000), "8 MHz"),
    Case("T6", 1_333_334, reset_pulse(6_000_000), "6 MHz"),
    Case("T7", 0, writing("cs_setup"), "write set-up"),
    Case("T7", 0, writing("cs_hold"), "write hold"),
    Case("T7", 0, reading("cs_setup"), "read set-up"),
    Case("T7", 0, reading("cs_hold"), "read hold"),
    Case("T8", 30 * NS, writing("ps_setup"), "write"),
    Case("T8", 30 * NS, reading("ps_setup"), "read"),
    Case("T9", 30 * NS, writing("ps_hold"), "write"),
    Case("T9", 30 * NS, reading("ps_hold"), "read"),
    Case("T10", 180 * NS, reading("low"), output=True),
    # Driven by another as /RD rises: let go with it, or later.
    Case("T11", 0, driving(-10 * NS, lambda gap: -gap), output=True),
    Case("T12", 180 * NS, driving(0, lambda gap: US), output=True),
    Case("T14", 100 * NS, writing("low", data_setup=60 * NS)),
    Case("T15", 50 * NS, writing("data_setup")),
    Case("T16", 120 * NS, writing("data_hold")),
    Case("T17", 120 * NS, recovery("/RD")),
    Case("T18", 120 * NS, recovery("/WR")),
)


@pytest.mark.parametrize("case", parameters(AC, CASES))
def test_a_row_is_kept_on_its_limit_and_broken_inside_it(case: Case) -> None:
    check(AC, case)


def test_no_row_is_forgotten() -> None:
    check_complete(AC, CASES)


@pytest.mark.spec("LM-TIM-12")
@pytest.mark.parametrize("byte", [0x00, 0x80, 0xFF])
def test_any_byte_driven_just_after_rd_rises_comes_too_soon(byte: int) -> None:
    bench = ready_to_report()
    play(bench, (0, "/PS", HIGH), (0, "/CS", LOW), (100 * NS, "/RD", LOW), (300 * NS, "/RD", HIGH))
    left = bench.chip.pins["D0-D7"].value
    bench.set(**{"D0-D7": byte})
    bench.run(US)
    told = [(it.rule, it.measured) for it in bench.violations]
    assert told == [("lm628.T12", 0)] * (byte != left)
