"""Every row of the AC tables, at both supplies: on the limit it passes, a picosecond short it does
not (MCP-TIM). The clock is 10 MHz unless a test says otherwise; numbers are picoseconds."""

from collections.abc import Callable

import pytest

from tests.conformance.mcp1200.conftest import Bench, low_pulse
from vbus.chips.mcp1200.datasheet import DATA
from vbus.core.kernel import NS, US
from vbus.core.signals import HIGH, LOW, STRICT, Policy, Z

HZ = 10_000_000
SUPPLIES = ("5 V", "3.3 V")
PLAIN = 0x20
Edge = tuple[int, str, int]


def separate(write: bool, data: int = 0x5A, **gaps: int) -> list[Edge]:
    """A cycle with /ALE before /CS; keyword arguments are gaps in ps."""
    ale = gaps.get("ale_low", 20 * NS)
    cs = ale + gaps.get("ale_to_cs", 20 * NS)
    rise = cs + gaps.get("cs_low", 40 * NS)
    edges = [(0, DATA, PLAIN), (0, "R/W", int(not write)), (0, "/ALE", 0), (ale, "/ALE", 1)]
    hold = ale + gaps.get("address_hold", 10 * NS)
    edges += [(cs, "/CS", 0), (rise, "/CS", 1)]
    if write:
        edges.append((hold, DATA, 0))
        edges.append((rise - gaps.get("data_setup", 15 * NS), DATA, data))
        edges.append((rise + gaps.get("data_hold", 10 * NS), DATA, 0))
    else:
        edges.append((hold, DATA, Z))
    return edges


def overlapped(**gaps: int) -> list[Edge]:
    """A write with /CS falling inside /ALE."""
    cs = gaps.get("ale_to_cs", 20 * NS)
    rise = cs + 60 * NS
    ale = rise - gaps.get("ale_up", 30 * NS)
    return [
        (0, DATA, PLAIN), (0, "R/W", 0), (0, "/ALE", 0), (cs, "/CS", 0),
        (cs + gaps.get("address_hold", 10 * NS), DATA, 0x5A), (ale, "/ALE", 1), (rise, "/CS", 1),
    ]  # fmt: skip


def inside(**gaps: int) -> list[Edge]:
    """A write with /ALE inside /CS."""
    ale = gaps.get("cs_to_ale", 20 * NS)
    up = ale + 20 * NS
    rise = up + gaps.get("ale_up", 30 * NS)
    return [
        (0, "R/W", 0), (0, "/CS", 0), (ale - 1 * NS, DATA, PLAIN), (ale, "/ALE", 0),
        (up, "/ALE", 1), (up + 10 * NS, DATA, 0x5A), (rise, "/CS", 1),
    ]  # fmt: skip


def later(edges: list[Edge], by: int) -> list[Edge]:
    return [(when + by, name, level) for when, name, level in edges]


def after_cs(first: list[Edge], second: list[Edge], gap: int, name: str = "/ALE") -> list[Edge]:
    """``second`` behind ``first``: from its /CS rise to the first fall of ``name``, ``gap``."""
    rise = max(when for when, pin, level in first if pin == "/CS" and level == 1)
    fall = min(when for when, pin, level in second if pin == name and level == 0)
    return first + later(second, rise + gap - fall)


def oe(low: int, after_latch: int = 100 * NS) -> list[Edge]:
    """A read whose /OE pulse has this width and ends this long after the address latch."""
    latch = 20 * NS
    return [
        *separate(False),
        (latch + after_latch - low, "/OE", 0),
        (latch + after_latch, "/OE", 1),
    ]


def r_w(setup: int = 40 * NS, hold: int = 40 * NS) -> list[Edge]:
    """A write whose R/W is right only around the /CS rise."""
    edges = [edge for edge in separate(True) if edge[1] != "R/W"]
    rise = 80 * NS
    return [(0, "R/W", 1), *edges, (rise - setup, "R/W", 0), (rise + hold, "R/W", 1)]


def play(bench: Bench, edges: list[Edge]) -> None:
    """Move strobes at their instants, counted from 10 us after now."""
    bench.chip.timing_checked = True
    bench.until(bench.cycle + 100)
    start = bench.kernel.now
    for when in sorted({edge[0] for edge in edges}):
        bench.until_ps(start + when)
        for at, name, level in edges:
            if at == when:
                pin = bench._host.get(name)
                if pin is None:
                    bench.drive(name, bench.chip.pins[name].value)
                    pin = bench._host[name]
                pin.drive(level)
        bench.kernel.settle()


# symbol, clause, limit at 5 V, limit at 3.3 V, edges for a gap
ROWS: tuple[tuple[str, str, int, int, Callable[[int], list[Edge]]], ...] = (
    ("tIPW", "MCP-TIM-10", 2_500, 3_800, lambda gap: separate(True, ale_low=gap)),
    ("tIPW", "MCP-TIM-10", 2_500, 3_800,
     lambda gap: separate(False, cs_low=gap)),
    ("tAC", "MCP-TIM-11", 2_100, 3_100, lambda gap: overlapped(ale_to_cs=gap)),
    ("tACH", "MCP-TIM-12", 2_100, 3_100, lambda gap: overlapped(ale_up=gap)),
    ("tACH", "MCP-TIM-12", 2_100, 3_100,
     lambda gap: [*inside(ale_up=gap + 20 * NS)[:-1], (40 * NS + gap, "/CS", 1)]),
    ("tSDR", "MCP-TIM-15", 2_100, 3_100, lambda gap: separate(True, data_setup=gap)),
    ("tH", "MCP-TIM-16", 2_100, 3_100, lambda gap: separate(True, address_hold=gap)),
    ("tH", "MCP-TIM-16", 2_100, 3_100, lambda gap: overlapped(address_hold=gap)),
    ("tH", "MCP-TIM-16", 2_100, 3_100, lambda gap: separate(True, data_hold=gap)),
    ("tWCS", "MCP-TIM-17", 2_100, 3_100, lambda gap: r_w(setup=gap)),
    ("tWH", "MCP-TIM-18", 2_100, 3_100, lambda gap: r_w(hold=gap)),
    ("tCSAL", "MCP-TIM-19", 402_100, 403_100,
     lambda gap: after_cs(separate(True), separate(True), gap)),
    ("tIPWOE", "MCP-TIM-24", 14_200, 17_200, lambda gap: oe(gap)),
    ("tALH", "MCP-TIM-29", 2_100, 3_100,
     lambda gap: after_cs([e if e[1] != "R/W" else (0, "R/W", 1) for e in overlapped()],
                          later(separate(False), 300 * NS), gap)),
    ("tCA", "MCP-TIM-31", 2_100, 3_100, lambda gap: inside(cs_to_ale=gap)),
    ("tACL", "MCP-TIM-32", 2_100, 3_100, lambda gap: separate(True, ale_to_cs=gap)),
)  # fmt: skip


@pytest.mark.spec(*sorted({row[1] for row in ROWS}), "MCP-TIM-33")
@pytest.mark.parametrize("supply", SUPPLIES)
@pytest.mark.parametrize("row", ROWS, ids=lambda row: row[0])
def test_a_bus_interval_passes_on_its_limit_and_fails_below(
    row: tuple[str, str, int, int, Callable[[int], list[Edge]]], supply: str
) -> None:
    symbol, clause, at_5, at_3, edges = row
    limit = at_5 if supply == "5 V" else at_3
    passing = Bench(hz=HZ, supply=supply)
    play(passing, edges(limit))
    assert symbol not in passing.rules()
    failing = Bench(hz=HZ, supply=supply)
    play(failing, edges(limit - 1))
    found = [v for v in failing.violations if v.rule == f"mcp1200.{symbol}"]
    assert [(v.clause, v.measured, v.limit) for v in found] == [(clause, limit - 1, limit)]


@pytest.mark.spec("MCP-TIM-33")
@pytest.mark.parametrize(
    ("edges", "symbols"),
    [
        (separate(True, ale_to_cs=2_000), {"tACL"}),
        (overlapped(ale_to_cs=2_000), {"tAC"}),
        (overlapped(ale_up=2_000), {"tACH"}),
        (inside(cs_to_ale=2_000), {"tCA"}),
    ],
)
def test_each_row_belongs_to_its_bus_order(edges: list[Edge], symbols: set[str]) -> None:
    bench = Bench(hz=HZ)
    play(bench, edges)
    assert set(bench.rules()) == symbols


@pytest.mark.spec("MCP-TIM-13", "MCP-TIM-14")
@pytest.mark.parametrize("supply", SUPPLIES)
@pytest.mark.parametrize(("symbol", "order"), [("tASR1", separate(True)), ("tASR", overlapped())])
def test_the_address_must_be_there_when_its_latch_closes(
    symbol: str, order: list[Edge], supply: str
) -> None:
    on_time = Bench(hz=HZ, supply=supply)
    play(on_time, order)
    assert on_time.rules() == []
    late = Bench(hz=HZ, supply=supply)
    play(late, [(when + 30 * NS if name == DATA else when, name, level)
                for when, name, level in order])  # fmt: skip
    assert symbol in late.rules()


@pytest.mark.spec("MCP-TIM-20")
@pytest.mark.parametrize(("supply", "limit"), [("5 V", 3_500), ("3.3 V", 5_300)])
def test_the_next_address_latch_after_cs_rises(supply: str, limit: int) -> None:
    # Overlapped after a read: /ALE may fall 2.1 ns after /CS rose, /CS again 2.1 ns later.
    for gap, rules in ((limit, set()), (limit - 1, {"tCSCS"})):
        bench = Bench(hz=HZ, supply=supply)
        first = separate(False)
        rise = 80 * NS
        second = [(rise + 200, "/ALE", 0), (rise + gap, "/ALE", 1), (rise + 50 * NS, "/CS", 0)]
        play(bench, [*first, *second])
        assert {"tCSCS"} & set(bench.rules()) == rules


@pytest.mark.spec("MCP-TIM-21", "MCP-T-23")
@pytest.mark.parametrize(
    ("hz", "supply", "limit"),
    [(8_000_000, "5 V", 502_100), (10_000_000, "5 V", 402_100), (10_000_000, "3.3 V", 403_100)],
)
def test_from_ale_fall_to_ale_fall_of_writes(hz: int, supply: str, limit: int) -> None:
    for gap, broken in ((limit, False), (limit - 1, True)):
        bench = Bench(hz=hz, supply=supply)
        play(bench, separate(True) + later(separate(True), gap))
        found = [v.limit for v in bench.violations if v.rule == "mcp1200.tWC"]
        assert found == ([limit] if broken else [])


@pytest.mark.spec("MCP-BUS-2", "MCP-TIM-26", "MCP-T-23")
@pytest.mark.parametrize(
    ("hz", "supply", "limit"),
    [(8_000_000, "5 V", 252_100), (10_000_000, "5 V", 202_100), (10_000_000, "3.3 V", 203_100)],
)
def test_from_address_latch_to_address_latch_of_reads(hz: int, supply: str, limit: int) -> None:
    for gap, broken in ((limit, False), (limit - 1, True)):
        bench = Bench(hz=hz, supply=supply)
        play(bench, separate(False) + later(separate(False), gap))
        found = [v.limit for v in bench.violations if v.rule == "mcp1200.tALAL"]
        assert found == ([limit] if broken else [])


@pytest.mark.spec("MCP-TIM-30")
@pytest.mark.parametrize(("supply", "limit"), [("5 V", 3_100), ("3.3 V", 5_300)])
def test_ale_must_be_high_for_a_while(supply: str, limit: int) -> None:
    for gap, broken in ((limit, False), (limit - 1, True)):
        bench = Bench(hz=HZ, supply=supply)
        again = [(20 * NS + gap, "/ALE", 0), (60 * NS, "/ALE", 1)]
        play(bench, [(0, DATA, PLAIN), (0, "/ALE", 0), (20 * NS, "/ALE", 1), *again])
        assert ("tALPWH" in bench.rules()) == broken


@pytest.mark.spec("MCP-TIM-22", "MCP-TIM-23")
@pytest.mark.parametrize(("supply", "limit"), [("5 V", 25_000), ("3.3 V", 36_000)])
def test_a_host_must_not_take_data_before_the_access_time(supply: str, limit: int) -> None:
    for late, rules in ((0, set()), (1, {"tOEDB"})):
        bench = Bench(hz=HZ, supply=supply)
        play(bench, oe(limit - late))
        assert set(bench.rules()) == rules
    for late, rules in ((0, set()), (1, {"tALDB"})):
        bench = Bench(hz=HZ, supply=supply)
        play(bench, oe(limit - late + 10 * NS, after_latch=limit - late))
        assert set(bench.rules()) == rules


@pytest.mark.spec("MCP-TIM-25")
@pytest.mark.parametrize(("supply", "hold"), [("5 V", 2_100), ("3.3 V", 3_100)])
def test_data_stays_on_the_bus_for_its_hold_time(supply: str, hold: int) -> None:
    bench = Bench(hz=HZ, supply=supply)
    play(bench, oe(40 * NS))
    rose = bench.kernel.now
    bench.until_ps(rose + hold - 1)
    assert bench.chip.data_pin.level == 0xE5
    bench.until_ps(rose + hold)
    assert bench.chip.data_pin.level == Z


@pytest.mark.spec("MCP-TIM-25", "MCP-TIM-16")
def test_the_bus_that_the_chip_lets_go_of_is_no_data_that_the_host_has_moved() -> None:
    bench = Bench(hz=HZ)
    play(bench, oe(40 * NS))
    rose = bench.kernel.now
    # Early, but held for long: the next address, which is on the bus when the chip has let go.
    bench.until_ps(rose + 1_000)
    bench.drive("DB0-DB7", 0x12)
    bench.drive("/ALE", LOW)
    bench.until_ps(rose + 1_500)
    bench.drive("/ALE", HIGH)
    before = bench.rules()
    bench.until_ps(rose + 10_000)
    assert bench.chip.data_pin.level == Z
    assert bench.rules() == before


@pytest.mark.spec("MCP-TIM-1", "MCP-CFG-1")
@pytest.mark.parametrize(
    ("hz", "supply", "broken"),
    [
        (20_000_000, "5 V", False), (20_000_001, "5 V", True),
        (14_285_714, "3.3 V", False), (14_285_800, "3.3 V", True),
        (2_000_000, "5 V", False), (1_999_999, "5 V", True),
        (2_000_000, "3.3 V", False), (1_999_999, "3.3 V", True),
    ],
)  # fmt: skip
def test_the_clock_period(hz: int, supply: str, broken: bool) -> None:
    assert Bench(hz=hz, supply=supply).rules() == (["tCPER"] if broken else [])


@pytest.mark.spec("MCP-TIM-2")
@pytest.mark.parametrize("supply", SUPPLIES)
@pytest.mark.parametrize(
    ("high", "rules"), [(0.3, []), (0.29, ["tCPWH"]), (0.7, []), (0.71, ["tCPWL"])]
)
def test_the_clock_is_high_and_low_long_enough(high: float, rules: list[str], supply: str) -> None:
    assert Bench(hz=HZ, supply=supply, clock_high=high).rules() == rules


@pytest.mark.spec("MCP-TIM-3", "MCP-TIM-9")
@pytest.mark.parametrize("supply", SUPPLIES)
@pytest.mark.parametrize(
    ("key", "limit", "rules"),
    [("clock_edge", 5_000, ["tCR"]), ("input_edge", 40_000, ["tIABR", "tIR"])],
)
def test_edges_must_be_steep(key: str, limit: int, rules: list[str], supply: str) -> None:
    assert Bench(hz=HZ, supply=supply, **{key: limit}).rules() == []
    assert Bench(hz=HZ, supply=supply, **{key: limit + 1}).rules() == rules


@pytest.mark.spec("MCP-TIM-4", "MCP-TIM-5", "MCP-AMB-30")
@pytest.mark.parametrize(("supply", "limit"), [("5 V", 102_100), ("3.3 V", 103_100)])
@pytest.mark.parametrize(
    ("pin", "symbol"),
    [("/RESET", "tIRST"), ("/SYNC", "tIRST"), ("/LIMIT", "tIP"), ("/STOP", "tIP")],
)
def test_the_width_of_a_pulse_on_a_side_input(
    pin: str, symbol: str, supply: str, limit: int
) -> None:
    bench = Bench(hz=HZ, supply=supply)
    bench.chip.timing_checked = True
    bench.until(50)
    low_pulse(bench, pin, limit)
    assert bench.rules() == []
    bench.wait(50)
    low_pulse(bench, pin, limit - 1)
    assert [(v.rule, v.measured, v.limit) for v in bench.violations] == [
        (f"mcp1200.{symbol}", limit - 1, limit)
    ]


@pytest.mark.spec("MCP-TIM-6", "MCP-TIM-7")
@pytest.mark.parametrize(("supply", "k"), [("5 V", 2_100), ("3.3 V", 3_100)])
@pytest.mark.parametrize(("r1a", "divider"), [(0x00, 1), (0x30, 8)])
@pytest.mark.parametrize(("pin", "symbol"), [("INDEX", "tIX"), ("CHA", "tIAB"), ("CHB", "tIAB")])
def test_the_width_of_an_encoder_pulse_counts_filter_clocks(
    pin: str, symbol: str, r1a: int, divider: int, supply: str, k: int
) -> None:
    limit = 3 * divider * 100 * NS + k
    for width, rules in ((limit, []), (limit - 1, [symbol])):
        bench = Bench(hz=HZ, supply=supply)
        bench.write(0x1A, r1a)
        bench.chip.timing_checked = True
        bench.until(500)
        low_pulse(bench, pin, width)
        assert bench.rules() == rules


@pytest.mark.spec("MCP-TIM-8")
@pytest.mark.parametrize(("supply", "limit"), [("5 V", 102_100), ("3.3 V", 103_100)])
def test_the_time_between_edges_of_a_and_b(supply: str, limit: int) -> None:
    for gap, rules in ((limit, []), (limit - 1, ["tAB"])):
        bench = Bench(hz=HZ, supply=supply)
        bench.chip.timing_checked = True
        bench.until(500)
        bench.drive("CHA", 0)
        bench.wait_ps(gap)
        bench.drive("CHB", 0)
        assert bench.rules() == rules


@pytest.mark.spec("MCP-TIM-27", "MCP-TIM-28")
@pytest.mark.parametrize("supply", SUPPLIES)
def test_outputs_move_with_the_clock_and_no_pulse_is_shorter_than_one(supply: str) -> None:
    bench = Bench(hz=HZ, supply=supply, done=False)
    instants: list[int] = []
    edges = bench.watch("PULSE", "SIGN", "PROF", "IDLE", "BUSY", "MC0-MC11")
    edges.edge = lambda when, net, level: instants.append(when)  # type: ignore[method-assign]
    bench.until(400)
    bench.write(0x09, 0x01)
    bench.write(0x4D, 0x00)
    bench.until(2000)
    clock = 100 * NS
    assert len(instants) > 10
    assert all(when % clock == 0 for when in instants)


@pytest.mark.spec("MCP-CFG-1")
def test_nothing_is_judged_while_strobes_carry_no_times() -> None:
    bench = Bench(hz=HZ)
    play(bench, [])
    bench.chip.timing_checked = False
    for name, level in (("R/W", 0), (DATA, PLAIN), ("/ALE", 0), ("/ALE", 1), (DATA, 0x12),
                        ("/CS", 0), ("/CS", 1), (DATA, Z)):  # fmt: skip
        bench.drive(name, level)
    bench.wait_ps(US)
    assert bench.rules() == []
    assert bench.seen("LEAD_ZERO") == 0x12


@pytest.mark.spec("MCP-CFG-1")
@pytest.mark.parametrize("gap", ["ale_low", "data_setup", "data_hold", "ale_to_cs"])
def test_the_policy_decides_whether_a_cycle_that_breaks_a_limit_is_lost(gap: str) -> None:
    short = {gap: 1_000}
    warned = Bench(hz=HZ)
    play(warned, separate(True, **short))
    warned.wait_ps(US)
    assert warned.seen("LEAD_ZERO") == 0x5A
    strict = Bench(hz=HZ, policy=Policy(STRICT))
    play(strict, separate(True, **short))
    strict.wait_ps(US)
    assert strict.seen("LEAD_ZERO") == 0xE5
    assert strict.rules() == warned.rules() != []
    play(strict, separate(True))
    strict.wait_ps(US)
    assert strict.seen("LEAD_ZERO") == 0x5A


@pytest.mark.spec("MCP-CFG-1")
def test_defaults_of_the_board_file(chip: Bench) -> None:
    assert chip.chip.settings["supply"] == "5 V"
    assert chip.chip.settings["io_stall_clk"] == 0
    assert chip.chip.policy.of("mcp1200.tCSAL") == 1


@pytest.mark.spec("MCP-TIM-2")
def test_a_clock_is_low_for_three_tenths_of_its_period() -> None:
    assert Bench(hz=HZ, clock_high=0.7).rules() == []
    assert Bench(hz=HZ, clock_high=0.71).rules() == ["tCPWL"]
