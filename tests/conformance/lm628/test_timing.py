"""AC electrical characteristics, judged on strobes that carry real times (T1 to T18)."""

import pytest

from tests.conformance.lm628.bench import BUSY, Bench, Log
from tests.probe import probe
from vbus.chips.lm628.datasheet import AC, RULES
from vbus.core.kernel import MS, NEVER, NS, US
from vbus.core.signals import HIGH, LOW, OFF, STRICT, Policy, Z

MSKI, SIP, LPES, RDRP = 0x1C, 0x03, 0x1A, 0x0A


def strict(symbol: str) -> Policy:
    return Policy(rules={f"lm628.{symbol}": STRICT})


def at_the_pins(policy: Policy | None = None) -> Bench:
    bench = Bench("strobe", policy=policy)
    bench.run(US)
    return bench


def play(bench: Bench, *edges: tuple[int, str, int]) -> None:
    """Move host pins at offsets from now (ps); those of one instant in one batch."""
    start = bench.now
    for offset in sorted({offset for offset, _, _ in edges}):
        bench.at(start + offset)
        bench.set(**{name: level for when, name, level in edges if when == offset})


def write(
    bench: Bench,
    data: int,
    port: int = 0,
    cs_setup: int = 50 * NS,
    ps_setup: int = 50 * NS,
    low: int = 200 * NS,
    data_setup: int = 100 * NS,
    data_hold: int = 150 * NS,
    ps_hold: int = 400 * NS,
    cs_hold: int = 50 * NS,
    before: int = 100 * NS,
) -> None:
    """One write; times as the manual draws them, relative to the strobe's edges."""
    play(
        bench,
        (before - ps_setup, "/PS", port),
        (before - cs_setup, "/CS", LOW),
        (before, "/WR", LOW),
        (before + low - data_setup, "D0-D7", data),
        (before + low, "/WR", HIGH),
        (before + low + cs_hold, "/CS", HIGH),
        (before + low + data_hold, "D0-D7", Z),
        (before + low + ps_hold, "/PS", 1 - port),
    )


def read(
    bench: Bench,
    port: int = 0,
    cs_setup: int = 50 * NS,
    ps_setup: int = 50 * NS,
    low: int = 200 * NS,
    ps_hold: int = 400 * NS,
    cs_hold: int = 50 * NS,
    before: int = 100 * NS,
) -> int:
    """One read; returns what is on the bus when the strobe is about to rise."""
    play(
        bench,
        (before - ps_setup, "/PS", port),
        (before - cs_setup, "/CS", LOW),
        (before, "/RD", LOW),
    )
    bench.at(bench.now + low + min(cs_hold, 0) - max(0, cs_setup * -1))
    data = bench.data()
    play(
        bench,
        (-min(cs_hold, 0), "/RD", HIGH),
        (max(cs_hold, 0), "/CS", HIGH),
        (ps_hold, "/PS", 1 - port),
    )
    return data


LEGAL_WRITES = [
    ("T7", {"cs_setup": 0}),
    ("T7", {"cs_hold": 0}),
    ("T8", {"ps_setup": 30 * NS}),
    ("T9", {"ps_hold": 30 * NS}),
    ("T14", {"low": 100 * NS, "data_setup": 60 * NS}),
    ("T15", {"data_setup": 50 * NS}),
    ("T16", {"data_hold": 120 * NS}),
]
BROKEN_WRITES = [
    ("T7", {"cs_setup": -1}, -1, 0),
    ("T7", {"cs_hold": -1}, -1, 0),
    ("T8", {"ps_setup": 30 * NS - 1}, 30 * NS - 1, 30 * NS),
    ("T8", {"ps_setup": -40 * NS}, -40 * NS, 30 * NS),
    ("T9", {"ps_hold": 30 * NS - 1}, 30 * NS - 1, 30 * NS),
    ("T14", {"low": 100 * NS - 1, "data_setup": 60 * NS}, 100 * NS - 1, 100 * NS),
    ("T15", {"data_setup": 50 * NS - 1}, 50 * NS - 1, 50 * NS),
    ("T16", {"data_hold": 120 * NS - 1}, 120 * NS - 1, 120 * NS),
    ("T16", {"data_hold": 0}, 0, 120 * NS),
]
WRITE_CLAUSES = pytest.mark.spec(
    "LM-TIM-7", "LM-TIM-8", "LM-TIM-9", "LM-TIM-14", "LM-TIM-15", "LM-TIM-16"
)


@WRITE_CLAUSES
@pytest.mark.parametrize(("symbol", "times"), LEGAL_WRITES)
def test_a_write_at_the_limit_is_legal(symbol, times):
    bench = at_the_pins()
    write(bench, SIP, **times)
    bench.run(BUSY)

    assert bench.probe.sip
    assert bench.violations == []


@WRITE_CLAUSES
@pytest.mark.parametrize(("symbol", "times", "measured", "limit"), BROKEN_WRITES)
def test_a_write_beyond_the_limit_is_reported_and_carried_out(symbol, times, measured, limit):
    bench = at_the_pins()
    write(bench, SIP, **times)
    bench.run(BUSY)

    assert bench.probe.sip
    assert [(v.rule, v.measured, v.limit) for v in bench.violations] == [
        (f"lm628.{symbol}", measured, limit)
    ]
    assert bench.violations[0].clause == f"LM-TIM-{symbol[1:]}"


@pytest.mark.spec("LM-TIM-9")
def test_a_port_that_moves_too_early_is_reported_at_that_instant():
    bench = at_the_pins()
    write(bench, SIP, ps_hold=29 * NS)
    assert [(v.rule, v.when) for v in bench.violations] == [("lm628.T9", US + 329 * NS)]


@WRITE_CLAUSES
@pytest.mark.parametrize(("symbol", "times", "measured", "limit"), BROKEN_WRITES)
def test_a_strict_limit_loses_the_write(symbol, times, measured, limit):
    bench = at_the_pins(strict(symbol))
    write(bench, SIP, **times)

    assert bench.rules() == [symbol]
    assert bench.chip.ready_at() <= bench.now, "not even busy"
    bench.run(BUSY)
    assert not bench.probe.sip


@pytest.mark.spec("LM-TIM-16")
def test_a_write_that_begins_meanwhile_does_not_end_the_hold_time():
    bench = at_the_pins()
    play(
        bench,
        (0, "/PS", LOW), (0, "/CS", LOW), (50 * NS, "D0-D7", LPES), (100 * NS, "/WR", LOW),
        (300 * NS, "/WR", HIGH), (360 * NS, "/WR", LOW), (400 * NS, "D0-D7", SIP),
        (600 * NS, "/WR", HIGH), (750 * NS, "D0-D7", Z),
    )  # fmt: skip
    assert [(v.measured, v.limit) for v in bench.violations if v.rule == "lm628.T16"] == [
        (100 * NS, 120 * NS)
    ]


@pytest.mark.spec("LM-TIM-16")
def test_data_that_changes_instead_of_floating_breaks_the_hold_time_too():
    bench = at_the_pins(strict("T16"))
    bench.write(0, LPES)
    bench.ready()
    write(bench, 0x12, port=1, ps_hold=US)
    play(
        bench,
        (0, "/PS", HIGH),
        (0, "/CS", LOW),
        (100 * NS, "/WR", LOW),
        (100 * NS, "D0-D7", 0x34),
        (300 * NS, "/WR", HIGH),
        (350 * NS, "D0-D7", 0x35),
        (500 * NS, "/CS", HIGH),
    )

    assert [(v.rule, v.measured) for v in bench.violations] == [("lm628.T16", 50 * NS)]
    assert bench.violations[0].when == bench.now - 150 * NS
    assert bench.probe.words_due == 1
    assert not bench.probe.busy, "the second byte has not been"
    write(bench, 0x56, port=1)
    bench.ready()
    assert bench.probe.error_threshold == 0x1256


@pytest.mark.spec("LM-TIM-15", "LM-TIM-16")
def test_data_put_out_just_before_the_strobe_rises_has_no_set_up_time_but_holds():
    bench = at_the_pins()
    play(
        bench,
        (0, "/PS", LOW), (0, "/CS", LOW), (50 * NS, "/WR", LOW), (50 * NS, "D0-D7", 0x04),
        (200 * NS, "D0-D7", SIP),
    )  # fmt: skip
    bench.set(**{"/WR": HIGH})
    bench.run(BUSY)

    assert [(v.rule, v.measured) for v in bench.violations] == [("lm628.T15", 0)]
    assert bench.probe.sip, "the later of two batches at one instant"


@pytest.mark.spec("LM-BUS-15", "LM-TIM-15")
@pytest.mark.parametrize("judged", [True, False])
@pytest.mark.parametrize("early", [50 * NS, 0])
def test_a_byte_latched_from_a_floating_bus_is_taken_and_found(judged, early):
    bench = at_the_pins()
    bench.chip.timing_checked = judged
    play(
        bench,
        (0, "/PS", LOW), (0, "/CS", LOW), (50 * NS, "/WR", LOW), (50 * NS, "D0-D7", SIP),
        (200 * NS - early, "D0-D7", Z),
    )  # fmt: skip
    bench.at(200 * NS + US)
    bench.set(**{"/WR": HIGH})
    bench.run(BUSY)

    (found,) = bench.violations
    assert (found.rule, found.clause, found.severity) == (
        "lm628.floating-write", "LM-BUS-15", "warning",
    )  # fmt: skip
    assert found.detail == "no pin drives D0-D7: 03H is taken"
    assert bench.probe.sip


@pytest.mark.spec("LM-BUS-15")
def test_a_byte_let_go_with_the_trailing_edge_was_driven():
    bench = at_the_pins()
    play(
        bench,
        (0, "/PS", LOW), (0, "/CS", LOW), (50 * NS, "/WR", LOW), (50 * NS, "D0-D7", SIP),
        (200 * NS, "/WR", HIGH), (200 * NS, "D0-D7", Z),
    )  # fmt: skip
    bench.run(BUSY)

    assert [v.rule for v in bench.violations] == ["lm628.T16"]
    assert bench.probe.sip


@pytest.mark.spec("LM-TIM-9")
def test_a_strict_reset_command_is_undone_with_everything_it_cleared():
    bench = at_the_pins(strict("T9"))
    bench.command("MSKI", 0x0000)
    bench.command("SBPA", 0, 1000)
    write(bench, 0x00, ps_hold=29 * NS)

    assert bench.rules() == ["reset-forgets", "T9"]
    assert bench.status() == 0x84
    assert bench.probe.interrupt_mask == 0
    assert bench.probe.breakpoint_armed


READ_CLAUSES = pytest.mark.spec("LM-TIM-7", "LM-TIM-8", "LM-TIM-9", "LM-TIM-10")
BROKEN_READS = [
    ("T7", {"cs_setup": -1}, -1, 0),
    ("T7", {"cs_hold": -1}, -1, 0),
    ("T8", {"ps_setup": 30 * NS - 1}, 30 * NS - 1, 30 * NS),
    ("T9", {"ps_hold": 30 * NS - 1}, 30 * NS - 1, 30 * NS),
    ("T10", {"low": 180 * NS - 1}, 180 * NS - 1, 180 * NS),
]


def ready_to_report(policy: Policy | None = None) -> Bench:
    bench = at_the_pins(policy)
    bench.probe.real_position = 0x11223344
    bench.command("RDRP")
    bench.run(US)
    return bench


@READ_CLAUSES
@pytest.mark.parametrize(
    ("symbol", "times"),
    [
        ("T7", {"cs_setup": 0}),
        ("T7", {"cs_hold": 0}),
        ("T8", {"ps_setup": 30 * NS}),
        ("T9", {"ps_hold": 30 * NS}),
        ("T10", {"low": 180 * NS}),
    ],
)
def test_a_read_at_the_limit_is_legal(symbol, times):
    bench = ready_to_report()

    assert [read(bench, 1, **times), read(bench, 1, **times)] == [0x11, 0x22]
    assert bench.violations == []


@READ_CLAUSES
@pytest.mark.parametrize(("symbol", "times", "measured", "limit"), BROKEN_READS)
def test_a_read_beyond_the_limit_is_reported_and_carried_out(symbol, times, measured, limit):
    bench = ready_to_report()

    assert [read(bench, 1, **times), read(bench, 1)] == [0x11, 0x22]
    assert [(v.rule, v.measured, v.limit) for v in bench.violations] == [
        (f"lm628.{symbol}", measured, limit)
    ]


@READ_CLAUSES
@pytest.mark.parametrize(("symbol", "times", "measured", "limit"), BROKEN_READS)
def test_a_strict_limit_loses_the_read(symbol, times, measured, limit):
    bench = ready_to_report(strict(symbol))
    first = read(bench, 1, **times)

    assert bench.rules() == [symbol]
    # A hold time is broken when the host has the byte already.
    assert first == (0x11 if symbol == "T9" or "cs_hold" in times else 0xFF)
    assert [read(bench, 1), read(bench, 1)] == [0x11, 0x22], "the pointer has not moved"


@pytest.mark.spec("LM-TIM-10", "LM-BUS-3")
def test_strict_access_time_shows_the_byte_exactly_when_it_is_over():
    bench = ready_to_report(strict("T10"))
    play(bench, (0, "/PS", HIGH), (0, "/CS", LOW), (100 * NS, "/RD", LOW))
    fell = bench.now

    bench.at(fell + 180 * NS - 1)
    assert bench.data() == 0xFF
    bench.at(fell + 180 * NS)
    assert bench.data() == 0x11
    bench.set(**{"/RD": HIGH})
    assert bench.violations == []


@pytest.mark.spec("LM-TIM-10")
def test_strict_access_time_is_an_edge_for_those_who_watch_the_bus():
    bench = ready_to_report(strict("T10"))
    log = Log()
    bench.chip.bus_net.observe(log)
    play(bench, (0, "/PS", HIGH), (0, "/CS", LOW), (100 * NS, "/RD", LOW))
    fell = bench.now
    bench.run(300 * NS)
    assert log.edges == [(fell, "x.D0-D7", 0xFF), (fell + 180 * NS, "x.D0-D7", 0x11)]


@pytest.mark.spec("LM-TIM-11")
def test_driving_the_bus_during_a_read_breaks_the_data_hold_time():
    bench = ready_to_report()
    play(
        bench,
        (0, "/PS", HIGH), (0, "/CS", LOW), (100 * NS, "/RD", LOW), (290 * NS, "D0-D7", 0x00),
        (300 * NS, "/RD", HIGH), (300 * NS, "D0-D7", Z),
    )  # fmt: skip
    assert bench.rules() == [], "it let go in time"

    bench.run(US)
    play(
        bench,
        (0, "/RD", LOW), (290 * NS, "D0-D7", 0x5A), (300 * NS, "/RD", HIGH), (US, "D0-D7", Z),
    )  # fmt: skip
    assert bench.rules() == ["T11"]


@pytest.mark.spec("LM-TIM-11")
def test_strict_data_hold_loses_the_read():
    bench = ready_to_report(strict("T11"))
    play(
        bench,
        (0, "/PS", HIGH), (0, "/CS", LOW), (100 * NS, "/RD", LOW), (290 * NS, "D0-D7", 0x00),
        (300 * NS, "/RD", HIGH), (US, "D0-D7", Z),
    )  # fmt: skip
    bench.run(US)

    assert bench.rules() == ["T11"]
    assert [read(bench, 1), read(bench, 1)] == [0x11, 0x22]


@pytest.mark.spec("LM-TIM-12")
@pytest.mark.parametrize("policy", [None, strict("T12")], ids=["warn", "strict"])
@pytest.mark.parametrize("after", [180 * NS, 180 * NS - 1, 1])
def test_driving_the_bus_before_it_is_let_go_breaks_the_hi_z_time(after, policy):
    bench = ready_to_report(policy)
    play(
        bench,
        (0, "/PS", HIGH), (0, "/CS", LOW), (100 * NS, "/RD", LOW), (300 * NS, "/RD", HIGH),
        (300 * NS + after, "D0-D7", 0xEE), (US, "D0-D7", Z),
    )  # fmt: skip
    bench.run(US)

    broken = after < 180 * NS
    assert [(v.rule, v.measured, v.limit) for v in bench.violations] == (
        [("lm628.T12", after, 180 * NS)] if broken else []
    )
    assert read(bench, 1) == (0x11 if policy and broken else 0x22)


@pytest.mark.spec("LM-TIM-12")
def test_a_write_that_begins_meanwhile_does_not_end_the_hi_z_time():
    bench = ready_to_report()
    # The strobe rises 50 ns before many bits of the instant change.
    bench.at(((bench.now >> 18) + 2 << 18) - 350 * NS)
    play(
        bench,
        (0, "/PS", HIGH), (0, "/CS", LOW), (100 * NS, "/RD", LOW), (300 * NS, "/RD", HIGH),
        (330 * NS, "/PS", LOW), (360 * NS, "/WR", LOW), (400 * NS, "D0-D7", SIP),
        (600 * NS, "/WR", HIGH), (750 * NS, "D0-D7", Z),
    )  # fmt: skip
    assert [(v.measured, v.limit) for v in bench.violations if v.rule == "lm628.T12"] == [
        (100 * NS, 180 * NS)
    ]


@pytest.mark.spec("LM-TIM-17")
@pytest.mark.parametrize("policy", [None, strict("T17")], ids=["warn", "strict"])
@pytest.mark.parametrize("recovery", [120 * NS, 120 * NS - 1])
def test_data_reads_need_recovery(recovery, policy):
    bench = ready_to_report(policy)
    play(bench, (0, "/PS", HIGH), (0, "/CS", LOW), (100 * NS, "/RD", LOW), (300 * NS, "/RD", HIGH))
    play(bench, (recovery, "/RD", LOW), (recovery + 190 * NS, "/WR", HIGH))
    data = bench.data()
    bench.set(**{"/RD": HIGH})

    broken = recovery < 120 * NS
    assert [(v.rule, v.measured, v.limit) for v in bench.violations] == (
        [("lm628.T17", recovery, 120 * NS)] if broken else []
    )
    assert data == (0xFF if broken and policy else 0x22)
    assert bench.probe.busy == (data == 0x22)


@pytest.mark.spec("LM-TIM-17", "LM-TIM-18")
def test_the_command_port_needs_no_recovery():
    bench = at_the_pins()
    play(
        bench,
        (0, "/PS", LOW), (0, "/CS", LOW), (100 * NS, "/RD", LOW), (300 * NS, "/RD", HIGH),
        (301 * NS, "/RD", LOW), (500 * NS, "/RD", HIGH), (600 * NS, "/CS", HIGH),
    )  # fmt: skip
    bench.run(US)
    write(bench, LPES)
    bench.ready()
    assert bench.violations == []


@pytest.mark.spec("LM-TIM-17")
def test_a_status_read_needs_no_recovery_after_data():
    bench = ready_to_report()
    play(
        bench,
        (0, "/PS", HIGH), (0, "/CS", LOW), (100 * NS, "/RD", LOW), (300 * NS, "/RD", HIGH),
        (340 * NS, "/PS", LOW), (380 * NS, "/RD", LOW), (600 * NS, "/RD", HIGH),
    )  # fmt: skip
    assert bench.violations == []


@pytest.mark.spec("LM-TIM-18")
def test_a_command_needs_no_recovery_after_data():
    bench = at_the_pins()
    bench.command("LPES")
    bench.run(US)
    play(
        bench,
        (0, "/PS", HIGH), (0, "/CS", LOW), (50 * NS, "D0-D7", 0x55), (100 * NS, "/WR", LOW),
        (300 * NS, "/WR", HIGH), (340 * NS, "/PS", LOW), (380 * NS, "/WR", LOW),
        (450 * NS, "D0-D7", SIP), (600 * NS, "/WR", HIGH), (750 * NS, "D0-D7", Z),
    )  # fmt: skip
    bench.run(US)
    assert bench.rules() == ["cut-packet"]


@pytest.mark.spec("LM-TIM-18")
@pytest.mark.parametrize("policy", [None, strict("T18")], ids=["warn", "strict"])
@pytest.mark.parametrize("recovery", [120 * NS, 120 * NS - 1])
def test_data_writes_need_recovery(recovery, policy):
    bench = at_the_pins(policy)
    bench.command("LPES")
    bench.run(US)
    play(
        bench,
        (0, "/PS", HIGH), (0, "/CS", LOW), (50 * NS, "D0-D7", 0x55), (100 * NS, "/WR", LOW),
        (300 * NS, "/WR", HIGH), (300 * NS + recovery, "/WR", LOW), (550 * NS, "/WR", HIGH),
    )  # fmt: skip

    broken = recovery < 120 * NS
    assert [(v.rule, v.measured, v.limit) for v in bench.violations] == (
        [("lm628.T18", recovery, 120 * NS)] if broken else []
    )
    assert bench.probe.busy == (not (broken and policy))


@pytest.mark.spec("LM-TIM-6", "LM-RST-1")
@pytest.mark.parametrize(("hz", "least"), [(8_000_000, US), (6_000_000, 1_333_334)])
@pytest.mark.parametrize("policy", [None, strict("T6")], ids=["warn", "strict"])
def test_a_reset_pulse_lasts_at_least_8_clocks(hz, least, policy):
    for low in (least, least - 1):
        bench = Bench("strobe", hz=hz, policy=policy)
        bench.run(US)
        play(bench, (0, "/RST", LOW), (low, "/RST", HIGH))

        broken = low < least
        assert [(v.rule, v.measured, v.limit) for v in bench.violations] == (
            [("lm628.T6", low, least)] if broken else []
        )
        assert bench.chip.status() == (0x84 if broken and policy else 0x00)


@pytest.mark.spec("LM-TIM-4", "LM-TIM-5")
@pytest.mark.parametrize(
    ("part", "hz", "settings", "broken"),
    [
        ("LM628N-8", 8_000_000, {}, []),
        ("LM629M-6", 6_000_000, {}, []),
        ("LM628N-8", 1_000_000, {}, []),
        ("LM629N-8", 8_000_001, {}, [("T5", 124_999, 125_000)]),
        ("LM629N-6", 6_024_097, {}, [("T5", 165_999, 166_000)]),
        ("LM629M-6", 8_000_000, {}, [("T4", 62_500, 78_000), ("T5", 125_000, 166_000)]),
        ("LM628N-8", 999_999, {}, [("T5", 1_000_001, 1_000_000)]),
        ("LM628N-8", 8_000_000, {"clk_duty": 0.456}, []),
        ("LM628N-8", 8_000_000, {"clk_duty": 0.455}, [("T4", 56_875, 57_000)]),
        ("LM628N-6", 6_000_000, {"clk_duty": 0.54}, [("T4", 76_666, 78_000)]),
    ],
)
def test_each_grade_has_its_clock_limits(part, hz, settings, broken):
    bench = Bench(part=part, hz=hz, **settings)

    assert [(v.rule, v.measured, v.limit) for v in bench.violations] == [
        (f"lm628.{symbol}", measured, limit) for symbol, measured, limit in broken
    ]
    assert bench.status() == 0x84, "it runs all the same"


@pytest.mark.spec("LM-TIM-5")
@pytest.mark.parametrize("hz", [9_999, 80_000_001])
def test_a_clock_no_such_part_can_have_is_refused(hz):
    with pytest.raises(
        ValueError, match=rf"^a clock of {hz} Hz: a LM629N-6 runs at 1 MHz to 6 MHz$"
    ):
        Bench(part="LM629N-6", hz=hz)


def turn(bench: Bench, *states: tuple[int, int]) -> None:
    """Put A and B to each state (A in bit 1) and let it last so many clocks (at 8 MHz)."""
    for state, clocks in states:
        bench.set(A=state >> 1, B=state & 1)
        bench.run(clocks * 125 * NS)


@pytest.mark.spec("LM-TIM-1", "LM-TIM-2")
def test_encoder_states_of_8_clocks_and_pulses_of_16_are_legal():
    bench = at_the_pins()
    turn(bench, (2, 8), (3, 8), (1, 8), (0, 8), (2, 8))

    assert bench.violations == []


@pytest.mark.spec("LM-TIM-1", "LM-TIM-2")
def test_shorter_encoder_states_and_pulses_are_reported():
    bench = at_the_pins()
    turn(bench, (2, 20), (3, 7), (1, 20), (0, 20))
    assert [(v.rule, v.measured, v.limit) for v in bench.violations] == [
        ("lm628.T2", 875 * NS, US),
        ("lm628.double-edge", 0, 0),
    ], "the state that was lost makes the next one a double step"
    bench.violations.clear()

    turn(bench, (2, 20), (3, 15), (2, 20))
    assert [(v.rule, v.measured, v.limit) for v in bench.violations] == [
        ("lm628.T1", 1875 * NS, 2 * US)
    ]


@pytest.mark.spec("LM-TIM-3")
@pytest.mark.parametrize("policy", [None, strict("T3")], ids=["warn", "strict"])
def test_an_index_that_falls_after_a_and_b_has_no_set_up_time(policy):
    bench = at_the_pins(policy)
    bench.command("SIP")
    turn(bench, (2, 20), (3, 20), (1, 20), (0, 20))
    bench.set(**{"/IN": LOW})
    bench.run(10 * US)

    assert bench.rules() == ["T3"]
    assert bench.probe.sip == (policy is not None), "strict: not captured"


@pytest.mark.spec("LM-TIM-3")
def test_an_index_that_rises_before_a_or_b_has_no_hold_time():
    bench = at_the_pins()
    turn(bench, (2, 20), (3, 20), (1, 20))
    bench.set(**{"/IN": LOW})
    turn(bench, (0, 20))
    bench.set(**{"/IN": HIGH})
    assert bench.rules() == ["T3"]


@pytest.mark.spec("LM-TIM-3")
def test_an_index_that_moves_together_with_a_and_b_is_legal():
    bench = at_the_pins()
    bench.command("SIP")
    turn(bench, (2, 20), (3, 20), (1, 20))
    bench.set(**{"/IN": LOW, "B": LOW})
    bench.run(10 * US)
    bench.set(**{"/IN": HIGH, "A": HIGH})
    bench.run(10 * US)
    assert bench.violations == []
    assert bench.probe.index_position == 4


def test_strobes_without_real_times_are_not_judged():
    bench = at_the_pins()
    bench.chip.timing_checked = False
    for word in (LPES, SIP):
        bench.set(**{"/PS": LOW, "/CS": LOW})
        bench.set(**{"D0-D7": word})
        bench.set(**{"/WR": LOW})
        bench.set(**{"/WR": HIGH, "/CS": HIGH, "/PS": HIGH})
        bench.ready()
    bench.set(A=HIGH)
    bench.set(A=LOW)

    assert bench.rules() == ["cut-packet"]
    assert bench.probe.sip


def test_a_rule_that_is_off_is_not_recorded():
    bench = at_the_pins(Policy(rules={"lm628": OFF}))
    write(bench, SIP, low=50 * NS, data_setup=10 * NS, data_hold=10 * NS)
    bench.run(BUSY)

    assert bench.violations == []
    assert bench.probe.sip


def test_every_ac_row_has_a_rule_and_a_clause():
    for row in AC:
        assert row.clause == f"LM-TIM-{row.symbol[1:]}"
        assert AC.rules[row.symbol] in RULES
    assert [row.symbol for row in AC] == [f"T{n}" for n in range(1, 19) if n != 13]


def test_what_is_overdue_was_due_more_than_a_millisecond_or_two_samples_ago(bench):
    chip = bench.chip
    bench.run(20 * MS)
    chip.advance()
    assert not chip.overdue()
    for late, told in ((MS, False), (MS + 1, True)):
        probe(chip).busy_end = bench.now - late
        assert chip.overdue() is told
    probe(chip).busy_end = NEVER
    chip.advance()
    assert not chip.overdue()
