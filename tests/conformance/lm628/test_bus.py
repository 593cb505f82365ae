"""Bus cycles, busy, and hosts that do not keep to the protocol (manual: Reading and Writing)."""

from collections import Counter

import pytest

from tests.conformance.lm628.bench import BUSY, Bench
from tests.probe import probe
from vbus.chips.lm628.datasheet import COMMANDS
from vbus.core.kernel import NS, US
from vbus.core.signals import HIGH, LOW, Z

RDRP, RDSIGS, LPES = 0x0A, 0x0C, 0x1A


@pytest.mark.spec("LM-BUS-1", "LM-CMD-23")
def test_each_port_is_written_and_read_through_its_own_address(bench):
    assert bench.status() == 0x84
    bench.write(0, RDSIGS)
    bench.ready()
    assert [bench.read(1), bench.read(1)] == [0x81, 0x84]
    bench.ready()
    bench.write(0, LPES)
    bench.ready()
    bench.write(1, 0x12)
    bench.write(1, 0x34)
    bench.ready()
    assert bench.probe.error_threshold == 0x1234


@pytest.mark.spec("LM-BUS-1")
def test_strobes_without_chip_select_are_ignored_and_drive_nothing():
    bench = Bench("strobe")
    bench.set(**{"D0-D7": 0x5A})
    bench.set(**{"/PS": LOW, "/WR": LOW})
    bench.run(US)
    bench.set(**{"/WR": HIGH})
    assert not bench.probe.busy

    bench.set(**{"/RD": LOW})
    bench.run(US)
    assert bench.chip.data_pin.level == -1
    assert bench.data() == 0x5A


@pytest.mark.spec("LM-BUS-2", "LM-BUS-7")
def test_a_byte_counts_at_the_rising_edge_of_the_write_strobe(bench):
    bench.write(0, RDRP)

    assert bench.probe.busy_end == bench.edge + BUSY


@pytest.mark.spec("LM-BUS-2")
def test_data_and_port_are_those_before_the_rising_edge():
    bench = Bench("strobe")
    bench.run(US)
    bench.set(**{"/CS": LOW, "/PS": LOW})
    bench.run(50 * NS)
    bench.set(**{"/WR": LOW, "D0-D7": 0x55})
    bench.run(50 * NS)
    bench.set(**{"D0-D7": LPES})
    bench.run(50 * NS)
    bench.set(**{"/WR": HIGH, "D0-D7": 0x00, "/PS": HIGH})

    assert bench.probe.busy, "a command, not data"
    bench.ready()
    assert bench.probe.words_due == 1, "LPES, not the byte before or after"


@pytest.mark.spec("LM-BUS-2")
def test_chip_select_may_end_the_write_before_the_strobe_does():
    bench = Bench("strobe")
    bench.chip.timing_checked = False
    bench.set(**{"/PS": LOW, "/CS": LOW, "/WR": LOW, "D0-D7": LPES})
    bench.run(200 * NS)
    bench.set(**{"/CS": HIGH})
    edge = bench.now

    bench.run(50 * NS)
    bench.set(**{"D0-D7": 0})
    bench.set(**{"/WR": HIGH})
    assert bench.probe.busy_end == edge + BUSY
    bench.ready()
    assert bench.probe.words_due == 1


@pytest.mark.spec("LM-BUS-2", "LM-TIM-15")
def test_the_byte_must_be_there_in_time_for_the_edge_that_ends_the_write():
    bench = Bench("strobe")
    bench.run(US)
    bench.set(**{"/PS": LOW, "/CS": LOW})
    bench.run(50 * NS)
    bench.set(**{"/WR": LOW})
    bench.run(160 * NS)
    bench.set(**{"D0-D7": LPES})
    bench.run(40 * NS)
    bench.set(**{"/CS": HIGH})
    bench.run(200 * NS)
    bench.set(**{"/WR": HIGH})

    assert bench.rules() == ["T7", "T15"]
    assert bench.violations[1].measured == 40 * NS, "not up to the edge of the strobe"


@pytest.mark.spec("LM-BUS-3")
def test_a_status_read_is_live_up_to_the_end_of_its_strobe(bench):
    bench.write(0, RDRP)
    fall = bench.edge + BUSY

    # The strobe is low from 30 ns to 210 ns after the start: busy falls 1 ps before it rises.
    bench.at(fall + 1 - 210 * NS)
    assert bench.status() == 0x84
    bench.write(0, RDRP)
    bench.at(bench.edge + BUSY - 211 * NS)
    assert bench.status() == 0x85


@pytest.mark.spec("LM-BUS-3")
def test_the_bus_shows_a_status_bit_changing_while_the_read_strobe_is_low():
    bench = Bench("strobe")
    bench.write(0, RDRP)
    fall = bench.edge + BUSY
    bench.set(**{"/PS": LOW, "/CS": LOW})
    bench.at(fall - US)
    bench.set(**{"/RD": LOW})

    bench.at(fall - 1)
    assert bench.data() == 0x85
    bench.at(fall)
    assert bench.data() == 0x84


@pytest.mark.spec("LM-BUS-3")
def test_the_bus_keeps_the_instant_of_that_change_though_nobody_looks():
    bench = Bench("strobe")
    bench.write(0, RDRP)
    fall = bench.edge + BUSY
    bench.set(**{"/PS": LOW, "/CS": LOW})
    bench.at(fall - US)
    bench.set(**{"/RD": LOW})

    bench.at(fall + 2 * US)
    assert bench.chip.bus_net.changed_at == fall


@pytest.mark.spec("LM-BUS-3")
def test_the_bus_is_driven_only_while_select_and_read_are_low():
    bench = Bench("strobe")
    pin = bench.chip.data_pin
    bench.set(**{"/PS": LOW, "/CS": LOW})
    assert pin.level == -1
    bench.set(**{"/RD": LOW})
    assert pin.level == 0x84
    bench.set(**{"/CS": HIGH})
    assert pin.level == -1
    bench.set(**{"/CS": LOW})
    assert pin.level == 0x84
    bench.set(**{"/RD": HIGH})
    assert pin.level == -1


@pytest.mark.spec("LM-BUS-3")
def test_a_data_byte_is_latched_when_the_read_strobe_falls(bench):
    bench.write(0, RDRP)
    busy_end = bench.edge + BUSY
    # A read that begins just before busy falls takes the old byte, though it ends later.
    bench.at(busy_end - 30 * NS - 1)
    assert bench.read(1) == 0x00
    assert bench.rules() == ["busy-read"]

    assert bench.read(1) == 0x00
    bench.probe.real_position = 0x11223344
    assert bench.rules() == ["busy-read"], "and moved no pointer"


@pytest.mark.spec("LM-BUS-3")
def test_the_read_pointer_moves_when_the_strobe_rises():
    bench = Bench("strobe")
    bench.probe.real_position = 0x11223344
    bench.command("RDRP")
    bench.set(**{"/PS": HIGH, "/CS": LOW})
    seen = []
    for _ in range(2):
        bench.run(200 * NS)
        bench.set(**{"/RD": LOW})
        for _ in range(3):
            bench.run(100 * NS)
            seen.append(bench.data())
        bench.set(**{"/RD": HIGH})
    assert seen == [0x11] * 3 + [0x22] * 3
    assert bench.probe.busy_end == bench.now + BUSY


@pytest.mark.spec("LM-BUS-4")
def test_both_strobes_low_write_the_hosts_byte_and_read_ff_without_moving_the_pointer():
    bench = Bench("strobe")
    bench.probe.real_position = 0x11223344
    bench.command("RDRP")
    bench.run(US)
    bench.set(**{"/PS": HIGH, "/CS": LOW})
    bench.run(50 * NS)
    bench.set(**{"/RD": LOW})
    bench.run(200 * NS)
    assert bench.data() == 0x11
    bench.set(**{"/PS": LOW, "/WR": LOW})
    assert bench.data() == 0xFF
    bench.set(**{"D0-D7": LPES})
    bench.run(200 * NS)
    bench.set(**{"/WR": HIGH})
    bench.run(200 * NS)
    bench.set(**{"/RD": HIGH})

    # /PS moved during the read and with the write strobe; LPES ends the report. No T11.
    assert bench.rules() == ["T8", "T8", "contention", "cut-packet"]
    bench.ready()
    assert bench.probe.words_due == 1, "LPES was taken"


@pytest.mark.spec("LM-BUS-4")
def test_a_contended_read_leaves_the_byte_to_be_read_again():
    bench = Bench("strobe")
    bench.chip.timing_checked = False
    bench.probe.real_position = 0x11223344
    bench.command("RDRP")
    bench.set(**{"/PS": HIGH, "/CS": LOW, "/WR": LOW, "D0-D7": 0x77})
    bench.set(**{"/RD": LOW})
    bench.set(**{"/RD": HIGH})
    bench.set(**{"/CS": HIGH, "/WR": HIGH})
    assert bench.rules() == ["contention", "wrong-way"]

    bench.set(**{"D0-D7": -1})
    assert bench.read(1) == 0x11


@pytest.mark.spec("LM-BUS-4")
def test_a_contended_read_is_no_data_read_at_all():
    bench = Bench("strobe")
    bench.chip.timing_checked = False
    bench.set(**{"/PS": HIGH, "/CS": LOW, "/WR": LOW, "D0-D7": 0x77})
    bench.set(**{"/RD": LOW})
    bench.set(**{"/PS": LOW})
    assert bench.rules() == ["contention"], "once"
    bench.set(**{"/RD": HIGH})
    assert bench.probe.flags == 0x04, "no command error"


@pytest.mark.spec("LM-BUS-12", "LM-BUS-5", "LM-T-15")
def test_a_status_read_between_two_bytes_of_a_word_disturbs_nothing(bench):
    bench.probe.real_position = 0x12345678
    bench.command("RDRP")
    got = []
    for _ in range(2):
        got.append(bench.read(1))
        assert bench.status() == 0x84, "not busy after the first byte"
        got.append(bench.read(1))
        assert bench.status() == 0x85
        bench.ready()
    assert got == [0x12, 0x34, 0x56, 0x78]

    bench.command("LPES")
    bench.write(1, 0x01)
    assert bench.status() == 0x84
    bench.write(1, 0x23)
    bench.ready()
    assert bench.probe.error_threshold == 0x0123


@pytest.mark.spec("LM-BUS-5")
def test_status_reads_do_not_stretch_busy(bench):
    bench.write(0, RDRP)
    end = bench.edge + BUSY
    polls = 1
    while bench.status() & 1:
        polls += 1
    assert end <= bench.edge < end + 390 * NS
    assert polls == 39


@pytest.mark.spec("LM-BUS-6")
def test_words_travel_high_byte_first_and_long_values_high_word_first(bench):
    bench.command("SBPA", 0x3412, 0x5678)
    assert bench.probe.breakpoint == 0x34125678

    bench.probe.index_position = -2
    assert bench.report("RDIP") == -2
    bench.probe.index_position = 0x01020304
    bench.command("RDIP")
    got = []
    for _ in range(2):
        got += [bench.read(1), bench.read(1)]
        bench.ready()
    assert got == [1, 2, 3, 4]


@pytest.mark.spec("LM-BUS-6")
def test_a_single_word_travels_with_all_its_bits(bench):
    bench.command("RDSIGS")
    assert [bench.read(1), bench.read(1)] == [0x81, 0x84]


@pytest.mark.spec("LM-BUS-7")
def test_busy_rises_with_a_command_and_with_each_second_data_byte_only(bench):
    bench.write(0, LPES)
    assert bench.probe.busy_end == bench.edge + BUSY
    bench.ready()
    bench.write(1, 0)
    assert not bench.probe.busy
    bench.write(1, 0)
    assert bench.probe.busy_end == bench.edge + BUSY
    bench.ready()

    bench.command("RDRP")
    bench.read(1)
    assert not bench.probe.busy
    bench.read(1)
    assert bench.probe.busy_end == bench.edge + BUSY


@pytest.mark.spec("LM-BUS-8")
@pytest.mark.parametrize(
    ("hz", "settings", "busy"),
    [
        (8_000_000, {}, 15 * US),
        (6_000_000, {}, 20 * US),
        (8_000_000, {"busy_clk": 200}, 25 * US),
        (1_000_000, {}, 100 * US),
        (8_000_000, {"busy": "worst"}, 100 * US),
    ],
    ids=["8 MHz", "6 MHz", "busy_clk", "1 MHz: capped", "worst"],
)
def test_busy_lasts_exactly_its_time(make, hz, settings, busy):
    bench = make(part="LM628N-8", hz=hz, **settings)
    bench.write(0, RDRP)
    end = bench.edge + busy

    bench.at(end - 1)
    bench.chip.advance()
    assert bench.chip.status() & 1
    bench.at(end)
    bench.chip.advance()
    assert not bench.chip.status() & 1
    assert bench.chip.ready_at() == end


@pytest.mark.spec("LM-BUS-8")
def test_jitter_spreads_busy_around_its_time_and_repeats_with_its_seed(make):
    def lengths(**settings) -> list[int]:
        bench = make(busy_jitter_clk=40, **settings)
        result = []
        for _ in range(60):
            bench.write(0, 0x03)
            result.append(bench.probe.busy_end - bench.edge)
            bench.ready()
        return result

    first = lengths(seed=1)
    assert first == lengths(seed=1)
    assert first != lengths(seed=2)
    assert first != lengths(seed=0x80000001), "each bit of the seed counts"
    assert min(first) >= 80 * 125 * NS
    assert max(first) <= 160 * 125 * NS
    assert len(set(first)) > 20


@pytest.mark.spec("LM-BUS-8")
@pytest.mark.parametrize("seed", [1, 2])
def test_jitter_is_drawn_evenly(make, seed: int) -> None:
    """Of 1980 draws among 33 lengths each is met 60 times, give or take four deviations."""
    bench = make(busy_jitter_clk=16, seed=seed)
    seen: Counter[int] = Counter()
    for _ in range(1980):
        bench.write(0, 0x03)
        seen[(probe(bench.chip).busy_end - bench.edge) // (125 * NS)] += 1
        bench.ready()
    assert sorted(seen) == list(range(104, 137))
    assert all(30 <= count <= 90 for count in seen.values()), seen


@pytest.mark.spec("LM-BUS-9")
def test_a_command_has_its_effect_when_busy_falls_and_not_before(bench):
    bench.write(0, COMMANDS["SIP"].code)
    end = bench.edge + BUSY

    bench.at(end - 1)
    assert not bench.probe.sip
    bench.at(end)
    assert bench.probe.sip


@pytest.mark.spec("LM-BUS-9")
def test_a_word_is_stored_and_hi_moves_when_busy_falls(bench):
    bench.command("RSTI")
    bench.write(1, 0)
    bench.write(1, 0)
    end = bench.edge + BUSY

    bench.at(end - 1)
    assert (bench.pin("HI"), bench.chip.status()) == (HIGH, 0x85)
    bench.at(end)
    assert (bench.pin("HI"), bench.chip.status()) == (LOW, 0x80)


@pytest.mark.spec("LM-BUS-9")
@pytest.mark.parametrize("on", [False, True])
def test_the_status_byte_after_busy_is_known_while_busy_lasts(bench, on):
    if on:
        bench.move(0x1800, accel=1, velocity=1)
        bench.next_sample()
    bench.write(0, COMMANDS["LTRJ"].code)
    end = bench.chip.ready_at()
    foreseen = bench.chip.foresee(0, end)
    assert foreseen is not None
    bench.ready()
    assert bench.chip.status() == foreseen[0]
    assert bool(foreseen[0] & 0x80) != on, "motor off"


@pytest.mark.spec("LM-BUS-10")
def test_bytes_written_while_busy_are_ignored_and_reported(bench):
    bench.write(0, LPES)
    bench.write(0, 0x03)
    bench.write(1, 0x55)
    end = bench.probe.busy_end
    assert bench.rules() == ["busy-write", "busy-write"]
    assert "command 03H" in bench.violations[0].detail
    bench.ready()
    assert bench.now >= end

    bench.word(0x0102)
    assert bench.probe.error_threshold == 0x0102, "the ignored data byte was not half of it"
    assert not bench.probe.sip
    assert bench.status() == 0x84, "no command error"


@pytest.mark.spec("LM-BUS-10")
def test_data_read_while_busy_is_the_last_byte_again(bench):
    bench.write(0, RDRP)
    assert bench.read(1) == 0x00, "00h after reset"
    bench.ready()
    bench.probe.real_position = 0x11223344
    bench.command("RDRP")
    bench.read(1)
    bench.read(1)
    for _ in range(3):
        assert bench.read(1) == 0x22
    bench.ready()
    assert [bench.read(1), bench.read(1)] == [0x33, 0x44]
    assert bench.rules() == ["busy-read", "cut-packet", *["busy-read"] * 3]
    assert bench.status() & 2 == 0, "no command error"


@pytest.mark.spec("LM-BUS-11")
def test_a_command_cuts_a_packet_short_and_keeps_the_words_that_were_complete(bench):
    bench.command("LFIL", 0x0C, 0x0111)
    bench.write(1, 0x77)
    bench.command("SIP")

    assert bench.rules() == ["cut-packet"]
    assert bench.status() == 0x84, "no command error"
    assert bench.probe.filter_loaded == [0, 0x0111, 0, 0, 0], "the odd byte is dropped"
    bench.command("LFIL", 0x04, 0x0222)
    assert bench.probe.filter_loaded == [0, 0x0111, 0x0222, 0, 0]


@pytest.mark.spec("LM-BUS-11")
def test_complete_words_of_a_trajectory_stay_when_a_command_cuts_the_rest(bench):
    bench.command("LTRJ", 0x0038, 0x1111, 0x2222, 0x3333)
    bench.write(1, 0x44)
    bench.command("SIP")

    profile = bench.probe
    assert profile.trajectory_loaded == [0x11112222, 0x33330000, 0]
    assert profile.relative == [True, False, False]


@pytest.mark.spec("LM-BUS-11")
def test_a_command_ends_a_report_that_was_not_read_to_its_end(bench):
    bench.probe.real_position = 0x11223344
    bench.probe.index_position = 0x55667788
    bench.command("RDRP")
    bench.read(1)

    assert bench.report("RDIP") == 0x55667788
    assert bench.rules() == ["cut-packet"]


@pytest.mark.spec("LM-BUS-12", "LM-AMB-12")
def test_reading_while_a_word_is_to_be_written_is_a_command_error_and_nothing_else(bench):
    bench.command("LPES")
    bench.write(1, 0x01)
    assert bench.read(1) == 0x00

    assert bench.status() == 0x86
    assert bench.rules() == ["wrong-way"]
    bench.write(1, 0x02)
    bench.ready()
    assert bench.probe.error_threshold == 0x0102, "the packet stayed open"


@pytest.mark.spec("LM-BUS-12")
def test_reading_between_two_words_to_be_written_leaves_the_packet_as_it_is(bench):
    bench.command("SBPA", 0x0123)
    assert bench.read(1) == 0x00
    assert bench.rules() == ["wrong-way"]

    bench.word(0x4567)
    assert bench.probe.breakpoint == 0x01234567
    assert bench.rules() == ["wrong-way"]


@pytest.mark.spec("LM-BUS-12", "LM-AMB-12")
def test_writing_while_a_word_is_to_be_read_is_a_command_error_and_nothing_else(bench):
    bench.probe.real_position = 0x11223344
    bench.command("RDRP")
    bench.read(1)
    bench.write(1, 0x99)

    assert bench.status() == 0x86
    assert bench.rules() == ["wrong-way"]
    assert bench.read(1) == 0x22


@pytest.mark.spec("LM-BUS-3", "LM-BUS-12", "LM-AMB-12")
def test_data_nobody_expects_is_a_command_error(bench):
    assert bench.report("RDSIGS") == 0x8184
    assert bench.read(1) == 0x84, "the last byte"
    assert bench.status() == 0x86
    bench.command("RSTI", 0)

    bench.write(1, 0x12)
    assert bench.status() == 0x82
    assert not bench.probe.busy
    assert bench.rules() == ["wrong-way", "wrong-way"]


@pytest.mark.spec("LM-BUS-12")
def test_the_command_error_of_a_read_appears_when_its_strobe_rises():
    bench = Bench("strobe")
    bench.set(**{"/PS": HIGH, "/CS": LOW})
    bench.run(50 * NS)
    bench.set(**{"/RD": LOW})
    bench.run(200 * NS)
    assert bench.chip.status() == 0x84
    bench.set(**{"/RD": HIGH})
    assert bench.chip.status() == 0x86


@pytest.mark.spec("LM-BUS-13", "LM-AMB-12")
@pytest.mark.parametrize("code", [0x0E, 0x19, 0x22, 0x7F, 0xFF])
def test_an_undefined_command_is_accepted_and_is_a_command_error_when_busy_falls(bench, code):
    bench.write(0, code)
    assert bench.status() == 0x85
    end = bench.edge
    bench.ready()

    assert bench.status() == 0x86
    assert bench.rules() == ["undefined-command"]
    assert bench.violations[0].when == bench.probe.computed_at
    assert bench.violations[0].when <= end + BUSY


@pytest.mark.spec("LM-BUS-13")
def test_commands_are_taken_as_ever_after_an_undefined_one(bench):
    bench.command("LPES", 0x0102)
    bench.write(0, 0x7F)
    bench.ready()
    assert bench.probe.error_threshold == 0x0102
    assert not bench.probe.sip

    bench.command("SIP")
    bench.command("LPES", 0x0304)
    assert bench.probe.sip
    assert bench.probe.error_threshold == 0x0304
    assert bench.rules() == ["undefined-command"]


@pytest.mark.spec("LM-BUS-14")
def test_a_host_that_just_waits_need_not_read_the_status(bench):
    bench.write(0, LPES)
    bench.run(BUSY)
    bench.write(1, 0x00)
    bench.write(1, 0x64)
    bench.run(BUSY)
    bench.write(0, 0x03)
    bench.run(BUSY)
    bench.chip.advance()

    assert bench.probe.error_threshold == 100
    assert bench.probe.sip
    assert bench.violations == []


@pytest.mark.spec("LM-BUS-1", "LM-TIM-8", "LM-TIM-9", "LM-TIM-10", "LM-TIM-14", "LM-TIM-16")
def test_edges_of_a_whole_cycle():
    chip = Bench().chip
    assert chip.strobes(True, 1, 0x5A) == [
        (-130_000, "/PS", 1), (-130_000, "/CS", 0), (-100_000, "/WR", 0),
        (-100_000, "D0-D7", 0x5A), (0, "/WR", 1), (30_000, "/CS", 1), (120_000, "D0-D7", Z),
    ]  # fmt: skip
    assert chip.strobes(False, 0, 0) == [
        (-210_000, "/PS", 0), (-210_000, "/CS", 0), (-180_000, "/RD", 0),
        (0, "/RD", 1), (30_000, "/CS", 1),
    ]  # fmt: skip
