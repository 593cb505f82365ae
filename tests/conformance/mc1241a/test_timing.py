"""AC limits: each row kept and broken, judged only where strobes carry times (PMD-TIM)."""

from collections.abc import Callable

import pytest

from tests.conformance.mc1241a.conftest import BUSY, DATA, Bench
from vbus.chips.mc1241a.datasheet import AC
from vbus.core.kernel import NS
from vbus.core.signals import STRICT, Policy, Z

spec = pytest.mark.spec

Step = tuple[int, str, int]
"""Offset from the trailing edge of the strobe (ns), pin, level."""

WRITE: tuple[Step, ...] = (
    (-110, "HostCmd", 1),
    (-110, "~HostSlct", 0),
    (-100, "~HostWrite", 0),
    (-90, "D0-D7", 0x55),
    (0, "~HostWrite", 1),
    (40, "D0-D7", Z),
    (40, "~HostSlct", 1),
    (41, "HostCmd", 0),
)
READ: tuple[Step, ...] = (
    (-110, "~HostSlct", 0),
    (-100, "~HostRead", 0),
    (0, "~HostRead", 1),
    (40, "~HostSlct", 1),
)


def changed(steps: tuple[Step, ...], **moves: int) -> list[Step]:
    """Return ``steps`` with the edges of the named pins moved; names end in the level."""
    result = []
    for offset, pin, level in steps:
        key = {"HostCmd": "cmd", "~HostSlct": "slct", "~HostWrite": "strobe",
               "~HostRead": "strobe", "D0-D7": "data"}[pin]  # fmt: skip
        key += "_off" if level in (Z,) or (level == 1) == (key != "cmd") else "_on"
        if key == "data_off" and level != Z:
            key = "data_on"
        result.append((moves.get(key, offset), pin, level))
    return result


def play(bench: Bench, steps: list[Step], at: int) -> None:
    """Move pins, with the trailing edge at instant ``at`` (ns)."""
    for offset, pin, level in sorted(steps, key=lambda step: step[0]):
        when = (at + offset) * NS
        if when > bench.now:
            bench.kernel.run_until(when)
        bench.drive(pin, level)


def judged(policy: Policy | None = None) -> Bench:
    bench = Bench("strobe", policy=policy)
    bench.chip.timing_checked = True
    bench.run_until(10_000 * NS)
    return bench


def broken(bench: Bench) -> list[tuple[str, int, int]]:
    return [(v.rule.partition(".")[2], v.measured // NS, v.limit // NS) for v in bench.violations]


WRITES = [
    pytest.param("PMD-TIM-8", "T6", {"slct_off": 15}, {"slct_off": 14}, 14, 15, id="T6"),
    pytest.param("PMD-TIM-9", "T7w", {"slct_on": -110}, {"slct_on": -109}, 9, 10, id="T7"),
    pytest.param("PMD-TIM-10", "T8w", {"cmd_on": -110}, {"cmd_on": -109}, 9, 10, id="T8"),
    pytest.param("PMD-TIM-11", "T9", {"cmd_off": 25}, {"cmd_off": 24}, 24, 25, id="T9"),
    pytest.param("PMD-TIM-16", "T14", {"strobe_on": -50}, {"strobe_on": -49}, 49, 50, id="T14"),
    pytest.param("PMD-TIM-17", "T15", {"data_on": -35}, {"data_on": -34}, 34, 35, id="T15"),
    pytest.param("PMD-TIM-18", "T16", {"data_off": 30}, {"data_off": 29}, 29, 30, id="T16"),
]


def _mark(params: list[object]) -> Callable[[Callable[..., None]], Callable[..., None]]:
    clauses = [param.values[0] for param in params]  # type: ignore[attr-defined]
    return spec(*clauses)


@_mark(WRITES)
@pytest.mark.parametrize(("clause", "row", "kept", "cut", "measured", "limit"), WRITES)
def test_write_limits(
    clause: str, row: str, kept: dict[str, int], cut: dict[str, int], measured: int, limit: int
) -> None:
    assert AC[row].clause == clause
    bench = judged()
    play(bench, changed(WRITE, data_off=50, **kept) if "data_off" not in kept
         else changed(WRITE, **kept), 20_000)  # fmt: skip
    bench.drive("D0-D7", 0x11)  # a change the bus keeper cannot hide
    assert broken(bench) == []
    bench = judged()
    steps = changed(WRITE, **cut)
    if "data_off" in cut:
        steps = [s if s[1:] != ("D0-D7", Z) else (s[0], "D0-D7", 0x11) for s in steps]
    play(bench, steps, 20_000)
    assert broken(bench) == [(row, measured, limit)]


@_mark(WRITES)
@pytest.mark.parametrize(("clause", "row", "kept", "cut", "measured", "limit"), WRITES)
def test_in_strict_mode_a_write_that_breaks_a_limit_is_lost(
    clause: str, row: str, kept: dict[str, int], cut: dict[str, int], measured: int, limit: int
) -> None:
    bench = judged(Policy(STRICT))
    steps = changed(WRITE, **cut)
    if "data_off" in cut:
        steps = [s if s[1:] != ("D0-D7", Z) else (s[0], "D0-D7", 0x11) for s in steps]
    play(bench, steps, 20_000)  # GET_POS_ERR
    bench.chip.timing_checked = False
    bench.drive("D0-D7", Z)
    assert bench.read_word() == 0  # no packet was opened
    good = judged(Policy(STRICT))
    play(good, changed(WRITE), 20_000)
    good.chip.timing_checked = False
    assert good.read_word() == 0x7FFF


@spec("PMD-TIM-18", "PMD-BUS-5")
def test_in_strict_mode_a_high_byte_that_is_lost_is_no_half_of_a_word() -> None:
    bench = judged(Policy(STRICT))
    bench.chip.timing_checked = False
    bench.command(0x29)  # SET_POS_ERR
    bench.wait_ready()
    bench.chip.timing_checked = True
    steps = [step for step in WRITE if step[1] not in ("HostCmd", "D0-D7")]
    data = [(-90, "D0-D7", 0x12), (29, "D0-D7", 0x11), (40, "D0-D7", Z)]
    play(bench, [*steps, *data], bench.now // NS + 1000)
    assert broken(bench) == [("T16", 29, 30)]
    bench.chip.timing_checked = False
    bench.write_word(0x0123)
    assert bench.send("GET_POS_ERR") == 0x0123


@spec("PMD-BUS-9", "PMD-TIM-18")
def test_in_strict_mode_a_word_whose_low_byte_is_lost_causes_nothing() -> None:
    bench = judged(Policy(STRICT))
    bench.chip.timing_checked = False
    bench.command(0x29)  # SET_POS_ERR
    bench.wait_ready()
    bench.byte_out(DATA, 0x01)
    bench.chip.timing_checked = True
    steps = [step for step in WRITE if step[1] not in ("HostCmd", "D0-D7")]
    data = [(-90, "D0-D7", 0x23), (29, "D0-D7", 0x11), (40, "D0-D7", Z)]
    play(bench, [*steps, *data], bench.now // NS + 1000)
    assert broken(bench) == [("T16", 29, 30)]
    bench.chip.timing_checked = False
    bench.wait_ready()
    assert bench.probe.position_error_limit == 0x7FFF
    bench.write_word(0x0456)
    assert bench.send("GET_POS_ERR") == 0x0456


def test_limits_are_not_judged_where_time_stands_still() -> None:
    bench = Bench("strobe")
    for _, pin, level in WRITE:
        bench.drive(pin, level)
    assert bench.violations == []
    assert bench.read_word() == 0x7FFF


def test_a_host_without_time_may_drive_the_bus_right_after_a_read() -> None:
    bench = Bench("strobe")
    for _, pin, level in WRITE:
        bench.drive(pin, level)
    bench.wait_ready()
    for pin, level in (("~HostSlct", 0), ("~HostRead", 0), ("~HostRead", 1), ("D0-D7", 0x11)):
        bench.drive(pin, level)
    assert bench.violations == []


@spec("PMD-TIM-8", "PMD-AMB-19")
@pytest.mark.parametrize(("held", "found"), [(2000, []), (2001, [("T6", 2001, 2000)])])
def test_select_is_released_within_2_us_of_the_busy_edge(
    held: int, found: list[tuple[str, int, int]]
) -> None:
    bench = judged(Policy(STRICT))
    play(bench, changed(WRITE, slct_off=held), 20_000)
    assert broken(bench) == found
    bench.chip.timing_checked = False
    assert bench.read_word() == 0x7FFF  # only a warning: the command counts in strict mode too


@spec("PMD-TIM-8")
def test_select_may_stay_low_between_the_bytes_of_a_word() -> None:
    bench = judged()
    play(bench, list(WRITE), 20_000)
    bench.run_until(200_000 * NS)
    steps = [s for s in READ if s[1] != "~HostSlct"]
    bench.drive("~HostSlct", 0)
    bench.run_for(20 * NS)
    play(bench, steps, 201_000)
    play(bench, steps, 209_000)  # 8 us later, select low all the time
    bench.run_for(100 * NS)
    bench.drive("~HostSlct", 1)
    assert broken(bench) == []


READS = [
    pytest.param("PMD-TIM-9", "T7r", {"slct_on": -80}, {"slct_on": -79}, -21, -20, id="T7"),
    pytest.param("PMD-TIM-12", "T10", {"strobe_on": -50}, {"strobe_on": -49}, 49, 50, id="T10"),
]


@_mark(READS)
@pytest.mark.parametrize(("clause", "row", "kept", "cut", "measured", "limit"), READS)
def test_read_limits(
    clause: str, row: str, kept: dict[str, int], cut: dict[str, int], measured: int, limit: int
) -> None:
    assert AC[row].clause == clause
    for moves, found in ((kept, []), (cut, [(row, measured, limit)])):
        bench = judged()
        play(bench, changed(READ, **moves), 20_000)
        assert broken(bench) == found


@spec("PMD-TIM-10")
@pytest.mark.parametrize(("falls", "found"), [(-80, []), (-79, [("T8r", -21, -20)])])
def test_host_cmd_may_fall_20_ns_after_the_read_strobe(
    falls: int, found: list[tuple[str, int, int]]
) -> None:
    bench = judged()
    bench.drive("HostCmd", 1)
    bench.run_for(1000 * NS)
    play(bench, [*READ, (falls, "HostCmd", 0)], 20_000)
    assert broken(bench) == found


@spec("PMD-TIM-12")
@pytest.mark.parametrize("symbol", ["T7r", "T10"])
def test_in_strict_mode_a_read_that_breaks_a_limit_moves_no_pointer(symbol: str) -> None:
    bench = judged(Policy(STRICT))
    play(bench, list(WRITE), 20_000)
    bench.run_until(200_000 * NS)
    cut = {"slct_on": -79} if symbol == "T7r" else {"strobe_on": -49}
    play(bench, changed(READ, **cut), 201_000)
    assert [rule for rule, *_ in broken(bench)] == [symbol]
    bench.chip.timing_checked = False
    assert bench.read_word() == 0x7FFF


@spec("PMD-TIM-13")
def test_read_data_stay_on_the_bus_after_the_strobe() -> None:
    bench = judged()
    play(bench, list(WRITE), 20_000)
    bench.run_until(200_000 * NS)
    play(bench, list(READ)[:3], 201_000)
    bench.run_until(201_010 * NS)
    assert bench.chip.data_pin.value == 0x7F
    assert AC["T11"].min_ps == 10 * NS


@spec("PMD-TIM-14")
@pytest.mark.parametrize(("after", "found"), [(50, []), (49, [("T12", 49, 50)])])
def test_the_host_waits_50_ns_before_it_drives_after_a_read(
    after: int, found: list[tuple[str, int, int]]
) -> None:
    bench = judged()
    play(bench, list(WRITE), 20_000)
    bench.run_until(200_000 * NS)
    play(bench, [*READ, (after, "D0-D7", 0x01)], 201_000)
    assert broken(bench) == found


@spec("PMD-TIM-15")
@pytest.mark.parametrize(("fall", "found"), [(70, ["not-ready"]), (69, ["T13", "not-ready"])])
def test_host_rdy_may_be_seen_70_ns_after_the_edge(fall: int, found: list[str]) -> None:
    bench = judged()
    play(bench, [s for s in WRITE if s[1] != "~HostSlct"] + [(-110, "~HostSlct", 0)], 20_000)
    bench.drive("D0-D7", 0x31)
    play(bench, [(fall, "~HostWrite", 0), (200, "~HostWrite", 1)], 20_000)
    assert [rule for rule, *_ in broken(bench) if rule != "T18"] == found


@spec("PMD-TIM-19", "PMD-TIM-20")
@pytest.mark.parametrize(("row", "read"), [("T17", True), ("T18", False)])
@pytest.mark.parametrize("gap", [60, 59])
def test_strobes_of_one_word_are_60_ns_apart(row: str, read: bool, gap: int) -> None:
    bench = judged()
    bench.chip.timing_checked = False
    bench.command(0x55 if read else 0x29)
    bench.wait_ready()
    bench.run_until(200_000 * NS)
    bench.chip.timing_checked = True
    strobe = "~HostRead" if read else "~HostWrite"
    bench.drive("~HostSlct", 0)
    bench.drive("D0-D7", Z if read else 0x42)
    bench.run_for(20 * NS)
    play(bench, [(-100, strobe, 0), (0, strobe, 1)], 201_000)
    play(bench, [(gap, strobe, 0), (gap + 100, strobe, 1)], 201_000)
    bench.run_for(50 * NS)
    bench.drive("~HostSlct", 1)
    assert broken(bench) == ([] if gap == 60 else [(row, 59, 60)])


@spec("PMD-TIM-6", "PMD-TIM-7")
@pytest.mark.parametrize(
    ("hz", "found"),
    [
        (25_000_000, []),
        (25_600_000, []),
        (6_700_000, []),
        (25_700_000, ["T4", "T5"]),
        (6_600_000, ["T4", "T5"]),
    ],
)
def test_the_clock_runs_at_6_7_to_25_6_mhz(hz: int, found: list[str]) -> None:
    assert Bench(hz=hz).rules() == found


def quadrature(bench: Bench, *steps: tuple[int, int, int]) -> None:
    """Move encoder 1: pauses (ns), then A and B."""
    for pause, a, b in steps:
        bench.run_for(pause * NS)
        bench.drive("QuadA1", a)
        bench.drive("QuadB1", b)


@spec("PMD-TIM-1", "PMD-TIM-2", "PMD-ENC-2", "PMD-AMB-21")
@pytest.mark.parametrize(
    ("dwell", "found"),
    [(800, []), (799, ["T2", "T1"]), (571, ["T2", "T1"])],
)
def test_encoder_states_last_800_ns_and_pulses_1600_ns(dwell: int, found: list[str]) -> None:
    bench = judged()
    quadrature(bench, (5000, 1, 0), (dwell, 1, 1), (dwell, 0, 1))
    bench.next_cycle()
    assert sorted(set(bench.rules())) == sorted(found)
    assert bench.seen("actual") == 3  # counted all the same: the filter wants 480 ns


@spec("PMD-TIM-1")
def test_a_pulse_of_one_channel_can_be_too_short_though_its_states_are_not() -> None:
    bench = judged()
    quadrature(bench, (5000, 1, 0), (1599, 0, 0))
    assert broken(bench) == [("T1", 1599, 1600)]


@spec("PMD-TIM-3")
@pytest.mark.parametrize("inside", [False, True])
def test_the_index_moves_while_a_or_b_is_high(inside: bool) -> None:
    bench = judged()
    quadrature(bench, (5000, 0, 1))
    if not inside:
        bench.drive("~Index1", 0)
        quadrature(bench, (5000, 0, 0), (5000, 1, 0))
        bench.drive("~Index1", 1)
        assert broken(bench) == []
    else:
        quadrature(bench, (5000, 0, 0))
        bench.drive("~Index1", 0)
        bench.run_for(5000 * NS)
        bench.drive("~Index1", 1)
        assert bench.rules() == ["T3", "T3"]


def test_a_whole_word_by_hand_at_the_shortest_legal_times() -> None:
    bench = judged()
    play(bench, changed(WRITE, strobe_on=-50, slct_on=-60, cmd_on=-60, data_on=-35,
                        slct_off=15, cmd_off=25, data_off=30), 20_000)  # fmt: skip
    at = 20_000 + BUSY // NS + 100
    play(bench, changed(READ, strobe_on=-50, slct_on=-30, slct_off=15), at)
    play(bench, changed(READ, strobe_on=-50, slct_on=-30, slct_off=15), at + 110)
    assert broken(bench) == []
    assert bench.probe.last_driven == 0xFF
