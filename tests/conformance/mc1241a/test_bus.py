"""The host bus: cycles, HostRdy, what is lost, when effects come (PMD-BUS)."""

import pytest

from tests.conformance.mc1241a.conftest import BUSY, COMMAND, CYCLE, DATA, SLOT, Bench
from vbus.chips.base import POLL
from vbus.core.kernel import NS, US
from vbus.core.signals import STRICT, Policy, Z

spec = pytest.mark.spec


@spec("PMD-BUS-1")
def test_the_host_port_has_five_control_lines_and_eight_data_lines(chip: Bench) -> None:
    pins = {row.name: row for row in chip.chip.pin_rows}
    assert [name for name, row in pins.items() if row.strobe] == [
        "~HostSlct", "~HostWrite", "~HostRead", "HostCmd",
    ]  # fmt: skip
    assert pins["D0-D7"].width == 8
    assert pins["D0-D7"].direction == "io"
    assert chip.level("HostRdy") == 1
    assert chip.level("~HostIntrpt") == 1


@spec("PMD-BUS-2")
def test_host_cmd_tells_a_command_from_a_data_byte(bench: Bench) -> None:
    bench.byte_out(COMMAND, 0x29)
    bench.wait_ready()
    bench.byte_out(DATA, 0x01)
    bench.byte_out(DATA, 0x23)
    bench.wait_ready()
    assert bench.send("GET_POS_ERR") == 0x0123


@spec("PMD-BUS-2")
def test_without_select_nothing_happens() -> None:
    bench = Bench("strobe")
    bench.drive("HostCmd", 1)
    bench.drive("D0-D7", 0x33)
    bench.drive("~HostWrite", 0)
    bench.run_for(100 * NS)
    bench.drive("~HostWrite", 1)
    assert bench.level("HostRdy") == 1
    bench.drive("HostCmd", 0)
    bench.drive("D0-D7", Z)
    bench.drive("~HostRead", 0)
    assert not bench.chip.data_pin.net.driven


def _write_strobe(bench: Bench, data: int, *, select_first: bool) -> None:
    """Write a command byte and let select or strobe rise first; data changes with that edge."""
    bench.drive("HostCmd", 1)
    bench.drive("~HostSlct", 0)
    bench.run_for(20 * NS)
    bench.drive("~HostWrite", 0)
    bench.drive("D0-D7", 0xEE)
    bench.run_for(50 * NS)
    bench.drive("D0-D7", data)
    bench.run_for(50 * NS)
    first, second = ("~HostSlct", "~HostWrite") if select_first else ("~HostWrite", "~HostSlct")
    bench.drive(first, 1)
    bench.drive("D0-D7", 0x00)
    bench.run_for(50 * NS)
    bench.drive(second, 1)
    bench.drive("HostCmd", 0)
    bench.drive("D0-D7", Z)


@spec("PMD-BUS-3")
@pytest.mark.parametrize("select_first", [False, True])
def test_a_byte_is_taken_when_strobe_or_select_rises(select_first: bool) -> None:
    bench = Bench("strobe")
    _write_strobe(bench, 0x6C, select_first=select_first)  # GET_VRSN
    assert bench.read_word() == 0x4A10


@spec("PMD-BUS-3")
def test_data_that_move_with_the_trailing_edge_come_too_late() -> None:
    bench = Bench("strobe")
    for name, level in (("HostCmd", 1), ("~HostSlct", 0), ("~HostWrite", 0), ("D0-D7", 0x6C)):
        bench.drive(name, level)
    bench.run_for(100 * NS)
    data = bench._host["D0-D7"]
    bench._host["~HostWrite"].drive(1)
    data.drive(0x31)  # in the same batch of changes
    bench.kernel.settle()
    bench.drive("D0-D7", Z)
    bench.drive("~HostSlct", 1)
    bench.drive("HostCmd", 0)
    assert bench.read_word() == 0x4A10


@spec("PMD-BUS-13")
@pytest.mark.parametrize("together", [True, False])
def test_a_byte_latched_from_a_floating_bus_is_taken_and_found(together: bool) -> None:
    bench = Bench("strobe")
    for name, level in (("HostCmd", 1), ("~HostSlct", 0), ("~HostWrite", 0), ("D0-D7", 0x6C)):
        bench.drive(name, level)
    bench.run_for(100 * NS)
    bench._host["D0-D7"].drive(Z)
    if not together:
        bench.kernel.settle()
    bench._host["~HostWrite"].drive(1)
    bench.kernel.settle()
    bench.drive("~HostSlct", 1)
    bench.drive("HostCmd", 0)
    assert bench.read_word() == 0x4A10

    assert [(v.rule, v.clause, v.severity, v.detail) for v in bench.violations] == (
        []
        if together
        else [
            (
                "mc1241a.floating-write", "PMD-BUS-13", "warning",
                "no pin drives D0-D7: 6CH is taken",
            )
        ]
    )  # fmt: skip


@spec("PMD-BUS-3", "PMD-TIM-17", "PMD-TIM-18")
@pytest.mark.parametrize("later", [0x31, 0x7F])
@pytest.mark.parametrize("data_first", [False, True])
def test_data_that_move_with_the_trailing_edge_have_been_set_up_before(
    later: int, data_first: bool
) -> None:
    bench = Bench("strobe")
    bench.chip.timing_checked = True
    for name, level in (("HostCmd", 1), ("~HostSlct", 0), ("D0-D7", 0x6C)):
        bench.drive(name, level)
    bench.run_for(100 * NS)
    bench.drive("~HostWrite", 0)
    bench.run_for(100 * NS)
    # In the same batch of changes.
    for name, level in sorted({"~HostWrite": 1, "D0-D7": later}.items(), reverse=not data_first):
        bench._host[name].drive(level)
    bench.kernel.settle()
    assert [(v.rule, v.measured) for v in bench.violations] == [("mc1241a.T16", 0)]


@spec("PMD-BUS-3")
def test_a_read_drives_the_bus_while_select_and_strobe_are_low_and_then_lets_go() -> None:
    bench = Bench("strobe")
    bench.command(0x6C)
    bench.wait_ready()
    bench.drive("~HostSlct", 0)
    bench.drive("~HostRead", 0)
    net = bench.chip.data_pin.net
    assert net.driven
    assert net.value == 0x4A
    bench.run_for(10 * US)
    assert net.value == 0x4A
    bench.drive("~HostRead", 1)
    assert not net.driven
    bench.run_for(100 * NS)
    bench.drive("~HostRead", 0)
    assert net.value == 0x10
    bench.drive("~HostSlct", 1)
    assert not net.driven
    assert bench.level("HostRdy") == 0


@spec("PMD-BUS-2", "PMD-BUS-3")
def test_a_read_that_keeps_every_limit_gets_its_bytes() -> None:
    bench = Bench("strobe")
    bench.chip.timing_checked = True
    assert bench.send("GET_VRSN") == 0x4A10
    assert bench.rules() == []


@spec("PMD-BUS-4")
def test_reading_with_host_cmd_high_drives_nothing_and_is_reported() -> None:
    bench = Bench("strobe")
    bench.command(0x6C)
    bench.wait_ready()
    bench.drive("HostCmd", 1)
    bench.drive("~HostSlct", 0)
    bench.drive("~HostRead", 0)
    assert not bench.chip.data_pin.net.driven
    bench.run_for(100 * NS)
    bench.drive("~HostRead", 1)
    bench.drive("~HostSlct", 1)
    bench.drive("HostCmd", 0)
    assert bench.rules() == ["read-command"]
    assert bench.read_word() == 0x4A10  # the byte pointer has not moved


@spec("PMD-BUS-2")
def test_both_strobes_together_are_reported_and_the_write_counts() -> None:
    bench = Bench("strobe")
    for name, level in (
        ("HostCmd", 1), ("D0-D7", 0x6C), ("~HostSlct", 0), ("~HostRead", 0), ("~HostWrite", 0),
    ):  # fmt: skip
        bench.drive(name, level)
    bench.run_for(100 * NS)
    for name, level in (
        ("~HostWrite", 1), ("~HostRead", 1), ("~HostSlct", 1), ("HostCmd", 0), ("D0-D7", Z),
    ):  # fmt: skip
        bench.drive(name, level)
    assert bench.rules() == ["both-strobes"]
    assert bench.read_word() == 0x4A10


@spec("PMD-BUS-2")
def test_a_write_strobe_in_the_middle_of_a_read_takes_the_bus_away_from_it() -> None:
    bench = Bench("strobe")
    bench.command(0x6C)
    bench.wait_ready()
    bench.drive("~HostSlct", 0)
    bench.drive("~HostRead", 0)
    assert bench.chip.data_pin.net.driven
    bench.drive("~HostWrite", 0)
    assert not bench.chip.data_pin.net.driven
    bench.drive("~HostRead", 1)
    bench.drive("~HostWrite", 1)
    bench.drive("~HostSlct", 1)
    # The write that remains finds a bus that nobody drives.
    assert bench.rules() == ["both-strobes", "floating-write"]
    assert bench.read_word() == 0x4A10  # the read that was disturbed did not count


@spec("PMD-BUS-5", "PMD-T-3")
def test_words_are_high_byte_first_and_long_values_high_word_first(bench: Bench) -> None:
    bench.command(0x10)  # SET_POS 1234567
    for byte in (0x00, 0x12, 0xD6, 0x87):
        bench.wait_ready()
        bench.byte_out(DATA, byte)
    bench.command(0x4A)  # GET_POS
    got = []
    for _ in range(4):
        bench.wait_ready()
        got.append(bench.byte_in())
    assert got == [0x00, 0x12, 0xD6, 0x87]
    assert bench.send("GET_POS") == 1234567


@spec("PMD-BUS-6")
def test_host_rdy_falls_after_a_command_and_after_second_bytes_only(bench: Bench) -> None:
    def ready() -> int:
        return bench.level("HostRdy")

    bench.byte_out(COMMAND, 0x29)  # SET_POS_ERR
    assert ready() == 0
    bench.wait_ready()
    bench.byte_out(DATA, 0x01)
    assert ready() == 1
    bench.run_for(200 * US)
    assert ready() == 1
    bench.byte_out(DATA, 0x00)
    assert ready() == 0
    bench.wait_ready()
    bench.byte_in()  # checksum, high byte
    assert ready() == 1
    bench.byte_in()
    assert ready() == 0


@spec("PMD-BUS-7")
def test_busy_lasts_67_5_us(bench: Bench) -> None:
    bench.byte_out(COMMAND, 0x33)
    edge = bench.now if bench.way == "cycle" else bench.now - 30 * NS
    bench.run_until(edge + 67_500 * NS - 1)
    assert bench.level("HostRdy") == 0
    bench.run_until(edge + 67_500 * NS)
    assert bench.level("HostRdy") == 1
    assert bench.chip.ready_at() == edge + 67_500 * NS


@spec("PMD-BUS-7")
def test_host_busy_slot_lasts_until_the_next_microstep_slot() -> None:
    bench = Bench(host_busy="slot")
    bench.run_until(3 * 67_840 * NS + 100 * NS - 1 * US)
    bench.byte_out(COMMAND, 0x33)  # latched 0.1 us into the fourth slot
    assert bench.chip.ready_at() == 4 * 67_840 * NS
    bench.run_until(4 * 67_840 * NS - 1)
    assert bench.level("HostRdy") == 0
    bench.run_until(4 * 67_840 * NS)
    assert bench.level("HostRdy") == 1


@spec("PMD-BUS-7")
def test_a_fault_stretches_the_busy_time() -> None:
    bench = Bench()
    bench.chip.busy_stretch = 5_000 * US
    bench.byte_out(COMMAND, 0x33)
    assert bench.chip.ready_at() == bench.now + 5_067_500 * NS
    bench.run_for(5_067_500 * NS - 1)
    assert bench.level("HostRdy") == 0


@spec("PMD-BUS-8")
def test_writes_while_busy_are_lost_and_reported(bench: Bench) -> None:
    bench.byte_out(COMMAND, 0x29)
    bench.byte_out(DATA, 0x7A)  # busy: neither this byte
    bench.byte_out(COMMAND, 0x33)  # nor this command counts
    assert bench.rules() == ["not-ready", "not-ready"]
    assert [violation.limit for violation in bench.violations] == [0, 0]
    bench.write_word(0x0123)
    assert bench.checksum() == 0x0029 + 0x0123
    assert bench.send("GET_POS_ERR") == 0x0123


@spec("PMD-BUS-8")
def test_reads_while_busy_give_the_last_byte_and_move_no_pointer(bench: Bench) -> None:
    assert bench.send("GET_VRSN") == 0x4A10
    bench.byte_out(COMMAND, 0x55)  # GET_POS_ERR, 7FFFH
    assert bench.byte_in() == 0x10
    assert bench.byte_in() == 0x10
    assert bench.rules() == ["not-ready", "not-ready"]
    assert bench.read_word() == 0x7FFF


@spec("PMD-BUS-8")
def test_a_strict_board_reports_the_same() -> None:
    bench = Bench(policy=Policy(STRICT))
    bench.byte_out(COMMAND, 0x29)
    bench.byte_out(COMMAND, 0x33)
    assert bench.rules() == ["not-ready"]


@spec("PMD-BUS-9")
def test_a_command_acts_at_the_end_of_the_busy_time(chip: Bench) -> None:
    chip.byte_out(COMMAND, 0x74)  # SET_PHASE_2
    chip.run_for(BUSY - 1)
    assert not chip.probe.two_phase
    chip.run_for(1)
    assert chip.probe.two_phase


@spec("PMD-BUS-9")
def test_an_update_acts_at_the_next_cycle(chip: Bench) -> None:
    chip.load(buf_mtr_cmd=0x4000)
    chip.next_cycle()
    chip.send("UPDATE")
    chip.run_until((chip.now // CYCLE + 1) * CYCLE - 1)
    assert chip.probe.motor_command == 0
    chip.run_for(1)
    assert chip.probe.motor_command == 0x4000


@spec("PMD-BUS-9", "PMD-CMD-37")
def test_multi_update_starts_both_axes_in_the_same_cycle(chip: Bench) -> None:
    for axis, speed in ((1, 3), (2, 7)):
        chip.send(f"SET_{axis}")
        chip.load(pos=1000, vel=speed << 16, acc=speed << 16)
    chip.next_cycle()
    chip.send("MULTI_UPDATE", 3)
    chip.run_until((chip.now // CYCLE + 1) * CYCLE - 1)
    assert (chip.seen("target", 1), chip.seen("target", 2)) == (0, 0)
    chip.run_for(1)
    assert (chip.seen("target", 1), chip.seen("target", 2)) == (3, 7)


@spec("PMD-CMD-37")
@pytest.mark.parametrize(("mask", "moved"), [(0, (0, 0)), (1, (3, 0)), (2, (0, 7))])
def test_multi_update_updates_the_axes_of_its_mask(
    chip: Bench, mask: int, moved: tuple[int, int]
) -> None:
    for axis, speed in ((1, 3), (2, 7)):
        chip.send(f"SET_{axis}")
        chip.load(pos=1000, vel=speed << 16, acc=speed << 16)
    chip.send("MULTI_UPDATE", mask)
    chip.next_cycle()
    assert (chip.seen("target", 1), chip.seen("target", 2)) == moved


@spec("PMD-BUS-10")
def test_a_command_cuts_an_unfinished_packet_short(bench: Bench) -> None:
    bench.load(vel=0x12345)
    bench.command(0x11)  # SET_VEL
    bench.write_word(0x0001)  # one word of two
    bench.wait_ready()
    bench.byte_out(DATA, 0x77)  # and half of the other
    assert bench.send("GET_VEL") == 0x12345
    assert bench.rules() == ["aborted"]


@spec("PMD-BUS-11")
def test_data_written_when_none_is_due_are_taken_and_forgotten(bench: Bench) -> None:
    bench.command(0x55)  # GET_POS_ERR
    bench.write_word(0x1234)
    assert bench.level("HostRdy") == 0
    assert bench.read_word() == 0x7FFF
    assert bench.checksum() == 0x0055 + 0x7FFF
    bench.write_word(0x4321)
    assert bench.checksum() == 0x0055 + 0x7FFF
    assert bench.rules() == ["unexpected-write", "unexpected-write"]


@spec("PMD-BUS-11")
def test_reading_when_a_word_is_to_be_written_gives_0_and_leaves_the_packet_open(
    bench: Bench,
) -> None:
    bench.command(0x11)
    bench.write_word(0x0002)
    assert bench.read_word() == 0
    assert bench.read_word() == 0
    bench.write_word(0x8000)
    assert bench.checksum() == 0x0011 + 0x0002 + 0x8000
    assert bench.send("GET_VEL") == 0x28000
    assert bench.rules() == ["unexpected-read", "unexpected-read"]


@spec("PMD-BUS-12")
def test_the_adapter_shows_host_rdy_in_d7_and_the_interrupt_line_in_d6(bench: Bench) -> None:
    assert bench.byte_in(COMMAND) & 0xC0 == 0xC0
    bench.byte_out(COMMAND, 0x33)
    assert bench.byte_in(COMMAND) & 0xC0 == 0x40
    bench.wait_ready()
    bench.send("STOP")
    bench.send("SET_INTRPT_MASK", 1)
    bench.send("UPDATE")
    bench.next_cycle()
    assert bench.byte_in(COMMAND) & 0xC0 == 0x80


@spec("PMD-BUS-12", "PMD-BUS-7")
def test_the_adapter_shows_host_rdy_of_the_very_instant(chip: Bench) -> None:
    chip.byte_out(COMMAND, 0x33)
    ready = chip.chip.ready_at()
    for when, bit in ((ready - 1, 0x00), (ready, 0x80)):
        chip.kernel.run_until(when)
        chip.chip.begin_read(COMMAND)
        assert chip.chip.end_read() & 0x80 == bit


@spec("PMD-BUS-12")
def test_the_adapter_s_status_byte_stays_until_the_busy_time_ends(chip: Bench) -> None:
    chip.next_cycle()
    chip.byte_out(COMMAND, 0x33)
    ready = chip.chip.ready_at()
    assert chip.now < chip.chip.due(POLL) <= ready
    chip.kernel.run_until(ready)
    assert chip.chip.due(POLL) > ready


@spec("PMD-BUS-12")
def test_reading_the_adapter_moves_no_strobe_and_no_pointer(bench: Bench) -> None:
    assert bench.chip.strobes(False, COMMAND, 0) == []
    bench.command(0x6C)
    bench.wait_ready()
    assert bench.byte_in() == 0x4A
    for _ in range(5):
        bench.byte_in(COMMAND)
    assert bench.byte_in() == 0x10


@spec("PMD-BUS-12")
def test_writing_the_reset_port_resets_the_chip_set(bench: Bench) -> None:
    bench.send("SET_POS_ERR", 5)
    bench.byte_out(2, 0x00)
    at = bench.now
    assert bench.chip.ready_at() == at + 2_000 * US
    assert bench.send("GET_POS_ERR") == 0x7FFF


@spec("PMD-BUS-1", "PMD-BUS-3", "PMD-BUS-5")
def test_edges_of_a_whole_cycle() -> None:
    chip = Bench().chip
    assert chip.strobes(True, COMMAND, 0x1A) == [
        (-110_000, "HostCmd", 1), (-110_000, "~HostSlct", 0),
        (-100_000, "~HostWrite", 0), (-100_000, "D0-D7", 0x1A),
        (0, "~HostWrite", 1),
        (30_000, "~HostSlct", 1), (30_000, "HostCmd", Z), (30_000, "D0-D7", Z),
    ]  # fmt: skip
    assert chip.strobes(False, DATA, 0) == [
        (-110_000, "HostCmd", 0), (-110_000, "~HostSlct", 0),
        (-100_000, "~HostRead", 0),
        (0, "~HostRead", 1),
        (25_000, "~HostSlct", 1), (25_000, "HostCmd", Z),
    ]  # fmt: skip


def test_the_strobes_of_whole_cycles_break_no_limit() -> None:
    bench = Bench("strobe")
    bench.chip.timing_checked = True
    assert bench.send("GET_TIME") >= 0
    bench.send("SET_POS", -5)
    assert bench.send("GET_POS") == -5
    assert bench.violations == []


def test_slots_are_an_eighth_of_a_cycle() -> None:
    assert 8 * SLOT == CYCLE
