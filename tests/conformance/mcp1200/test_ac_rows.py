"""Every row of both AC tables, on its limit and one picosecond inside it (MCP-TIM).

The clock is 10 MHz unless a row is about the clock; numbers are picoseconds.
"""

from collections.abc import Callable

import pytest

from tests.conformance.ac import Case, Promise, check, check_complete, check_promise, parameters
from tests.conformance.mcp1200.conftest import Bench, low_pulse
from tests.conformance.mcp1200.test_timing import (
    HZ,
    PLAIN,
    Edge,
    after_cs,
    inside,
    later,
    oe,
    overlapped,
    play,
    r_w,
    separate,
)
from vbus.chips.mcp1200.datasheet import AC, DATA
from vbus.core.kernel import NS, SECOND, US
from vbus.core.signals import Violation, Z

CLK = 100 * NS
Make = Callable[[int], list[Edge]]


def cases(supply: str, k: int, low: int, latch: int, valid: int, oe_low: int, high: int,
          period: int) -> tuple[Case, ...]:  # fmt: skip
    """Return the cases at one supply, with the numbers of its column of the manual."""

    def bus(
        symbol: str, limit: int, make: Make, name: str = "", *beside: str, output: bool = False
    ) -> Case:
        def run(gap: int) -> list[Violation]:
            bench = Bench(hz=HZ, supply=supply)
            play(bench, make(gap))
            bench.wait_ps(US)
            return bench.violations

        return Case(symbol, limit, run, name, beside=frozenset(beside), output=output)

    def pulse(symbol: str, limit: int, pin: str, r1a: int = 0) -> Case:
        def run(width: int) -> list[Violation]:
            bench = Bench(hz=HZ, supply=supply)
            if r1a:
                bench.write(0x1A, r1a)
            bench.chip.timing_checked = True
            bench.until(500)
            low_pulse(bench, pin, width)
            return bench.violations

        return Case(symbol, limit, run, f"{pin} {r1a:02X}")

    def a_to_b(gap: int) -> list[Violation]:
        bench = Bench(hz=HZ, supply=supply)
        bench.chip.timing_checked = True
        bench.until(500)
        bench.drive("CHA", 0)
        bench.wait_ps(gap)
        bench.drive("CHB", 0)
        return bench.violations

    def clock(period: int) -> list[Violation]:
        return Bench(hz=SECOND // period, supply=supply).violations

    def clock_high(width: int) -> list[Violation]:
        return Bench(hz=HZ, supply=supply, clock_high=(width + 0.5) / CLK).violations

    def clock_low(width: int) -> list[Violation]:
        return Bench(hz=HZ, supply=supply, clock_high=1 - width / CLK).violations

    def edges(key: str) -> Callable[[int], list[Violation]]:
        return lambda time: Bench(hz=HZ, supply=supply, **{key: time}).violations

    def read(edges: list[Edge]) -> list[Edge]:
        return [(0, "R/W", 1) if edge[1] == "R/W" else edge for edge in edges]

    def late_address(order: list[Edge], latch: int) -> Make:
        return lambda setup: [
            (latch - setup, name, level) if (when, name) == (0, DATA) else (when, name, level)
            for when, name, level in order
        ]

    def next_latch(gap: int) -> list[Edge]:
        rise = 80 * NS
        second = [(rise + 200, "/ALE", 0), (rise + gap, "/ALE", 1), (rise + 50 * NS, "/CS", 0)]
        return [*(edge for edge in separate(False) if edge[2] != Z), *second]

    def ale_again(gap: int) -> list[Edge]:
        first = [(0, DATA, PLAIN), (0, "/ALE", 0), (20 * NS, "/ALE", 1)]
        return [*first, (20 * NS + gap, "/ALE", 0), (60 * NS, "/ALE", 1)]

    def inside_rise(gap: int) -> list[Edge]:
        return [*inside(ale_up=gap + 20 * NS)[:-1], (40 * NS + gap, "/CS", 1)]

    return (
        Case("tCPER", period, clock, "shortest"),
        Case("tCPER", 500 * NS, clock, "longest", step=1),
        Case("tCPWH", 30 * NS, clock_high),
        Case("tCPWL", 30 * NS, clock_low),
        Case("tCR", 5 * NS, edges("clock_edge"), step=1),
        # One setting for all inputs: either row is broken with the other.
        Case("tIABR", 40 * NS, edges("input_edge"), step=1, beside=frozenset({"tIR"})),
        Case("tIR", 40 * NS, edges("input_edge"), step=1, beside=frozenset({"tIABR"})),
        *(pulse("tIRST", CLK + k, pin) for pin in ("/RESET", "/SYNC")),
        *(pulse("tIP", CLK + k, pin) for pin in ("/LIMIT", "/STOP")),
        pulse("tIX", 3 * CLK + k, "INDEX"),
        pulse("tIX", 24 * CLK + k, "INDEX", 0x30),
        *(pulse("tIAB", 3 * CLK + k, pin) for pin in ("CHA", "CHB")),
        *(pulse("tIAB", 24 * CLK + k, pin, 0x30) for pin in ("CHA", "CHB")),
        *(pulse("tIAB", (3 << n) * CLK + k, "CHA", n << 4) for n in (1, 2, 4, 5)),
        Case("tAB", CLK + k, a_to_b),
        bus("tIPW", low, lambda gap: separate(True, ale_low=gap), "/ALE"),
        bus("tIPW", low, lambda gap: separate(False, cs_low=gap), "/CS"),
        bus("tAC", k, lambda gap: overlapped(ale_to_cs=gap)),
        bus("tACH", k, lambda gap: overlapped(ale_up=gap), "overlapped"),
        bus("tACH", k, inside_rise, "inside"),
        bus("tASR1", 0, late_address(separate(True), 20 * NS), "", "tH"),
        bus("tASR", 0, late_address(overlapped(), 20 * NS), "", "tH"),
        bus("tSDR", k, lambda gap: separate(True, data_setup=gap)),
        bus("tH", k, lambda gap: separate(True, address_hold=gap), "address"),
        bus("tH", k, lambda gap: overlapped(address_hold=gap), "address overlapped"),
        bus("tH", k, lambda gap: separate(True, data_hold=gap), "data"),
        bus("tWCS", k, lambda gap: r_w(setup=gap)),
        bus("tWH", k, lambda gap: r_w(hold=gap)),
        bus("tCSAL", 4 * CLK + k, lambda gap: after_cs(separate(True), separate(True), gap)),
        bus("tCSCS", latch, next_latch),
        bus("tWC", 4 * CLK + k, lambda gap: separate(True) + later(separate(True), gap), "",
            "tCSAL"),
        bus("tOEDB", valid, oe, output=True),
        bus("tALDB", valid, lambda gap: oe(gap + 10 * NS, after_latch=gap), output=True),
        bus("tIPWOE", oe_low, oe, "", "tOEDB"),
        bus("tALAL", 2 * CLK + k, lambda gap: separate(False) + later(separate(False), gap)),
        bus("tALH", k,
            lambda gap: after_cs(read(overlapped()), separate(False, ale_low=250 * NS), gap)),
        bus("tALPWH", high, ale_again),
        bus("tCA", k, lambda gap: inside(cs_to_ale=gap)),
        bus("tACL", k, lambda gap: separate(True, ale_to_cs=gap)),
    )  # fmt: skip


CASES = {
    "5 V": cases("5 V", 2_100, 2_500, 3_500, 25_000, 14_200, 3_100, 50_000),
    "3.3 V": cases("3.3 V", 3_100, 3_800, 5_300, 36_000, 17_200, 5_300, 70_000),
}


def promises(k: int, valid: int) -> tuple[Promise, ...]:
    """Return the rows of the chip's own outputs, with the numbers of one column of the manual."""
    return (
        Promise("tDOEH", k, 0,
                "test_timing.py looks at the bus to the picosecond before and after it is let go"),
        Promise("tOF", CLK, 0,
                "outputs move at clock edges only (test_timing.py): no pulse is shorter than one"),
        Promise("tOR", 0, valid, "levels change at once: a rise takes no time"),
        Promise("tEP", 0, valid,
                "outputs move at the clock edge itself (test_timing.py): no delay"),
    )  # fmt: skip


PROMISES = {"5 V": promises(2_100, 25_000), "3.3 V": promises(3_100, 36_000)}


@pytest.mark.parametrize("case", parameters(AC["5 V"], CASES["5 V"]))
def test_a_row_at_5_v_is_kept_on_its_limit_and_broken_inside_it(case: Case) -> None:
    check(AC["5 V"], case)


@pytest.mark.parametrize("case", parameters(AC["3.3 V"], CASES["3.3 V"]))
def test_a_row_at_3_3_v_is_kept_on_its_limit_and_broken_inside_it(case: Case) -> None:
    check(AC["3.3 V"], case)


@pytest.mark.parametrize("promise", parameters(AC["5 V"], PROMISES["5 V"]))
def test_a_row_of_an_output_at_5_v_has_the_manual_s_numbers(promise: Promise) -> None:
    check_promise(AC["5 V"], promise, HZ)


@pytest.mark.parametrize("promise", parameters(AC["3.3 V"], PROMISES["3.3 V"]))
def test_a_row_of_an_output_at_3_3_v_has_the_manual_s_numbers(promise: Promise) -> None:
    check_promise(AC["3.3 V"], promise, HZ)


@pytest.mark.parametrize("supply", AC)
def test_no_row_is_forgotten(supply: str) -> None:
    check_complete(AC[supply], CASES[supply], PROMISES[supply])
