"""Registers: storage, latches, access (MCP-REG); flag and status register (MCP-FLG, MCP-STA)."""

import pytest

from tests.conformance.mcp1200.conftest import Bench, Rail
from vbus.chips.mcp1200 import datasheet as ds
from vbus.chips.mcp1200.datasheet import REGISTERS
from vbus.chips.mcp1200.registers import RegisterFile
from vbus.chips.tables import SAMPLED
from vbus.core.signals import HIGH, LOW

PLAIN = {
    "FEATURE": "MCP-REG-2", "CONFIG": "MCP-REG-3", "EXCEPTION": "MCP-REG-5",
    "DAC_OFFSET": "MCP-REG-11", "PRESCALER": "MCP-REG-15", "INTERPOLATOR_PRESET": "MCP-REG-18",
    "ENCODER_PWM": "MCP-REG-20", "STEP_WIDTH": "MCP-REG-21", "ENCODER_RATIO": "MCP-REG-22",
    "LEAD_ZERO": "MCP-REG-23", "LEAD_POLE": "MCP-REG-23", "LEAD_GAIN": "MCP-REG-23",
    "VELOCITY": "MCP-REG-24", "ACCELERATION": "MCP-REG-25", "PROFILE_VELOCITY": "MCP-REG-26",
    "FINAL_POSITION": "MCP-REG-27", "VELOCITY_COMMAND": "MCP-REG-33", "BREAKPOINT": "MCP-REG-34",
    "BACKLASH": "MCP-REG-35", "DEADBAND": "MCP-REG-36", "FORCED_EXCEPTION": "MCP-REG-37",
    "MAX_ERROR": "MCP-REG-38", "SATURATION": "MCP-REG-39", "JERK": "MCP-REG-42",
    "FEED_FORWARD": "MCP-REG-43", "KP": "MCP-REG-44", "KI": "MCP-REG-44", "KD": "MCP-REG-44",
    "DERIVATIVE_SPAN": "MCP-REG-45", "INTEGRAL_LIMIT": "MCP-REG-46", "KA": "MCP-REG-47",
    "KV": "MCP-REG-47",
}  # fmt: skip
READ_ONLY = {
    "PHASE": "MCP-REG-7", "INTERPOLATOR_COUNT": "MCP-REG-19", "POSITION_ERROR": "MCP-REG-28",
    "CAPTURE": "MCP-REG-29", "ACCEL_DELTA": "MCP-REG-30", "ACTUAL_VELOCITY": "MCP-REG-31",
    "DECEL_POSITION": "MCP-REG-32",
}  # fmt: skip
REGISTER_LIST = {
    "FLAG": ((0x00,), 0x02), "FEATURE": ((0x01,), 0), "CONFIG": ((0x02,), 0),
    "CAPTURE_CONTROL": ((0x03,), 0), "EXCEPTION": ((0x04,), 0x09), "MODE": ((0x05,), 0x01),
    "PHASE": ((0x06,), 0), "STATUS": ((0x07,), 0xF8), "MOTOR_COMMAND": ((0x08,), 0x80),
    "PWM_COMMAND": ((0x09,), 0), "DAC_OFFSET": ((0x0A,), 0), "COMMAND_INCREMENT": ((0x0B,), 0),
    "COMMAND_POSITION": ((0x0C, 0x0D, 0x0E), 0), "SAMPLE_TIMER": ((0x0F,), 0x40),
    "PRESCALER": ((0x10, 0x11), 0x003F), "ACTUAL_POSITION": ((0x12, 0x13, 0x14), 0),
    "PRESET_POSITION": ((0x15, 0x16, 0x17), 0), "INTERPOLATOR_PRESET": ((0x18,), 0),
    "INTERPOLATOR_COUNT": ((0x19,), 0), "ENCODER_PWM": ((0x1A,), 0), "STEP_WIDTH": ((0x1B,), 0x0F),
    "ENCODER_RATIO": ((0x1C, 0x1D), 0), "LEAD_ZERO": ((0x20,), 0xE5), "LEAD_POLE": ((0x21,), 0x40),
    "LEAD_GAIN": ((0x22,), 0x40), "VELOCITY": ((0x23, 0x24, 0x25), 0),
    "ACCELERATION": ((0x27, 0x26), 0), "PROFILE_VELOCITY": ((0x28,), 0),
    "FINAL_POSITION": ((0x2B, 0x2A, 0x29), 0), "POSITION_ERROR": ((0x2D, 0x2C), 0),
    "CAPTURE": ((0x30, 0x2F, 0x2E), 0), "ACCEL_DELTA": ((0x33, 0x32, 0x31), 0),
    "ACTUAL_VELOCITY": ((0x35, 0x34), 0), "DECEL_POSITION": ((0x3B, 0x3A, 0x39), 0),
    "VELOCITY_COMMAND": ((0x3C,), 0), "BREAKPOINT": ((0x3F, 0x3E, 0x3D), 0x800000),
    "BACKLASH": ((0x44,), 0), "DEADBAND": ((0x45,), 0), "FORCED_EXCEPTION": ((0x46,), 0),
    "MAX_ERROR": ((0x4A, 0x49), 0xFFFF), "SATURATION": ((0x4B,), 0xF0),
    "MOTOR_COMMAND_LOW": ((0x4C,), 0), "PWM_FRACTION": ((0x4D,), 0), "JERK": ((0x55, 0x54), 0),
    "FEED_FORWARD": ((0x57, 0x56), 0), "KP": ((0x61,), 0x40), "KI": ((0x62,), 0),
    "KD": ((0x63,), 0x40), "DERIVATIVE_SPAN": ((0x64,), 0x01),
    "INTEGRAL_LIMIT": ((0x66, 0x65), 0x7FFF), "KA": ((0x69,), 0), "KV": ((0x6A,), 0),
}  # fmt: skip
"""The manual's Register Reference Table, and R46, which stands in the text: addresses, most
significant byte first, and the value after a hard reset."""
SIGNED = {
    "PWM_COMMAND", "DAC_OFFSET", "COMMAND_INCREMENT", "COMMAND_POSITION", "ACTUAL_POSITION",
    "PRESET_POSITION", "VELOCITY", "FINAL_POSITION", "POSITION_ERROR", "CAPTURE",
    "ACTUAL_VELOCITY", "DECEL_POSITION", "VELOCITY_COMMAND", "BREAKPOINT", "FEED_FORWARD",
}  # fmt: skip
"""Registers whose value is two's complement."""
HELD = {"SAMPLE_TIMER", "ACTUAL_POSITION"}
"""Not what stands in a register: a timer that runs, a counter with a latch of its own."""


@pytest.mark.spec(*sorted({*PLAIN.values()}), "MCP-AMB-2", "MCP-AMB-28", "MCP-AMB-32")
@pytest.mark.parametrize("name", PLAIN)
def test_a_plain_register_keeps_every_byte_that_is_written(bench: Bench, name: str) -> None:
    row = REGISTERS[name]
    if row.addresses[0] >= 0x40:
        bench.extended()
    for place, address in enumerate(row.addresses):
        bench.write(address, 0xA4 + place | 1 if name == "CONFIG" else 0xA4 + place)
    for place, address in enumerate(row.addresses):
        expected = 0xA4 + place | (1 if name == "CONFIG" else 0)
        assert bench.read(address) == expected


@pytest.mark.spec(*READ_ONLY.values())
@pytest.mark.parametrize("name", READ_ONLY)
def test_a_result_register_cannot_be_written(bench: Bench, name: str) -> None:
    for address in REGISTERS[name].addresses:
        bench.write(address, 0x55)
        assert bench.read(address) == 0


@pytest.mark.spec("MCP-RST-3", "MCP-REG-48", "MCP-AMB-2", "MCP-AMB-23", "MCP-AMB-28")
def test_the_register_table_is_the_manual_s() -> None:
    assert {row.name: (row.addresses, row.reset) for row in REGISTERS} == REGISTER_LIST


FRACTIONS = {"ENCODER_RATIO": 8, "VELOCITY": 8, "ACCELERATION": 8, "JERK": 16, "FEED_FORWARD": 8}


@pytest.mark.parametrize(
    "name",
    [pytest.param(row.name, marks=pytest.mark.spec(row.clause), id=row.name) for row in REGISTERS],
)
def test_a_row_of_the_register_table_is_the_manual_s(name: str) -> None:
    row = REGISTERS[name]
    assert (row.addresses, row.reset) == REGISTER_LIST[name]
    assert (row.signed, row.fraction) == (name in SIGNED, FRACTIONS.get(name, 0))


@pytest.mark.spec("MCP-REG-48", "MCP-AMB-23", "MCP-AMB-28")
@pytest.mark.parametrize("name", REGISTER_LIST)
@pytest.mark.parametrize("value", [0x5AB637, -0x5AB637])
def test_the_number_of_a_register_has_its_bytes_where_the_manual_lists_them(
    name: str, value: int
) -> None:
    places, _ = REGISTER_LIST[name]
    registers = RegisterFile()
    value >>= 8 * (3 - len(places))
    bytes_ = {place: value >> 8 * n & 0xFF for n, place in enumerate(reversed(places))}
    for place, byte in bytes_.items():
        registers.put(place, byte)
    number = value if name in SIGNED else value % (1 << 8 * len(places))
    assert getattr(registers, name.lower()) == number
    image = bytes(bytes_.get(place, 0) for place in range(128))
    assert registers.image == image
    assert bytes(registers.byte(place) for place in range(128)) == image
    registers.sample()
    registers.put(places[0], ~bytes_[places[0]] & 0xFF)
    assert (registers.sampled.image, getattr(registers.sampled, name.lower())) == (image, number)


@pytest.mark.spec("MCP-REG-48", "MCP-SMP-5")
@pytest.mark.parametrize("name", [row.name for row in REGISTERS if row.counts == SAMPLED])
def test_what_counts_with_the_next_sample_leaves_the_one_under_way_alone(
    chip: Bench, name: str
) -> None:
    chip.extended()
    chip.control()
    chip.samples(1)
    start = chip.sample_start()
    chip.until(start + 100)
    registers = chip.probe
    before = getattr(registers.sampled, name.lower())
    chip.put(name, 0x14)
    assert (getattr(registers, name.lower()), chip.pin("BUSY")) == (0x14, 1)
    chip.until(chip.sample_start() - 1)
    assert getattr(registers.sampled, name.lower()) == before != 0x14
    chip.until(chip.cycle + 1)
    assert getattr(registers.sampled, name.lower()) == 0x14


@pytest.mark.spec("MCP-RST-3", "MCP-BUS-9", "MCP-REG-48")
@pytest.mark.parametrize("name", sorted(REGISTER_LIST.keys() - HELD))
def test_every_byte_of_a_register_is_read_where_the_manual_lists_it(
    bench: Bench, name: str
) -> None:
    places, value = REGISTER_LIST[name]
    bench.extended()
    value |= name == "CONFIG"
    bytes_ = [value >> 8 * (len(places) - 1 - n) & 0xFF for n in range(len(places))]
    assert [bench.read(place) for place in places] == bytes_
    assert bench.rules() == []


@pytest.mark.spec("MCP-REG-13")
def test_the_command_position_is_loaded_by_its_last_byte(bench: Bench) -> None:
    bench.write(0x0C, 0x12)
    bench.write(0x0D, 0x34)
    assert (bench.read(0x0C), bench.read(0x0D), bench.read(0x0E)) == (0, 0, 0)
    bench.write(0x0E, 0x56)
    assert (bench.read(0x0D), bench.read(0x0E), bench.read(0x0C)) == (0x34, 0x56, 0x12)
    bench.write(0x0E, 0x57)
    assert bench.seen("COMMAND_POSITION") == 0x123457


@pytest.mark.spec("MCP-REG-16")
def test_reading_the_lsb_of_the_actual_position_freezes_the_other_bytes(bench: Bench) -> None:
    bench.probe.set_position(-2, bench.cycle)
    assert bench.read(0x12) == 0
    low = bench.read(0x14)
    bench.probe.set_position(0x123456, bench.cycle)
    assert (bench.read(0x12), bench.read(0x13), low) == (0xFF, 0xFF, 0xFE)
    assert bench.read(0x14) == 0x56
    assert (bench.read(0x13), bench.read(0x12)) == (0x34, 0x12)


@pytest.mark.spec("MCP-REG-16")
def test_writing_r13_clears_the_counter_and_r12_and_r14_do_nothing(bench: Bench) -> None:
    bench.probe.set_position(0x123456, bench.cycle)
    bench.write(0x12, 0x77)
    bench.write(0x14, 0x77)
    assert bench.position == 0x123456
    bench.write(0x13, 0x77)
    assert bench.position == 0


@pytest.mark.spec("MCP-REG-16")
def test_the_actual_position_is_live_between_samples() -> None:
    rail = Rail()
    rail.speed = 1_000_000.0
    bench = Bench(plant=rail)
    bench.until(8)
    assert bench.position == 1
    bench.until(808)
    assert bench.position == 101
    first = bench.get("ACTUAL_POSITION")
    assert bench.get("ACTUAL_POSITION") > first >= 101


@pytest.mark.spec("MCP-REG-17")
def test_the_counter_is_preset_by_its_last_byte(bench: Bench) -> None:
    bench.write(0x15, 0xFE)
    bench.write(0x16, 0xDC)
    assert bench.position == 0
    bench.write(0x17, 0xBA)
    assert bench.position == -0x012346
    assert (bench.read(0x15), bench.read(0x16), bench.read(0x17)) == (0xFE, 0xDC, 0xBA)


@pytest.mark.spec("MCP-REG-14")
def test_the_sample_timer_reads_the_count_not_the_reload_value(bench: Bench) -> None:
    bench.write(0x0F, 0x05)
    bench.until(bench.sample_start())
    start = bench.cycle
    for count in (5, 4, 1, 0):
        bench.until(start + (5 - count) * 64 + 20)
        assert bench.read(0x0F) == count
    bench.until(start + 6 * 64)
    assert bench.probe.read_register(0x0F, bench.cycle) == 5


@pytest.mark.spec("MCP-REG-12", "MCP-POS-1")
def test_the_increment_is_taken_once_and_zeroed(bench: Bench) -> None:
    bench.control()
    bench.write(0x0B, 0xFD)
    assert bench.read(0x0B) == 0xFD
    bench.samples(1)
    assert (bench.read(0x0B), bench.seen("COMMAND_POSITION")) == (0, -3)
    bench.samples(2)
    assert bench.seen("COMMAND_POSITION") == -3


@pytest.mark.spec("MCP-REG-9", "MCP-REG-10", "MCP-REG-40", "MCP-REG-41")
def test_the_motor_command_registers_and_their_nibbles(bench: Bench) -> None:
    bench.extended()
    for address, data, reads in ((0x08, 0x9A, 0x9A), (0x4C, 0xBF, 0xB0), (0x09, 0xC4, 0xC4),
                                 (0x4D, 0x7F, 0x70)):  # fmt: skip
        bench.write(address, data)
        assert bench.read(address) == reads
    assert bench.pin("MC0-MC11") == 0x9AB
    assert bench.probe.pwm == (0xC47 - 0x1000)


@pytest.mark.spec("MCP-REG-48")
def test_registers_without_a_latch_are_taken_together_at_the_sample_start(bench: Bench) -> None:
    """Bytes of a top velocity written across a sample start: the old one counts until the next."""
    bench.write(0x01, 0x20)
    bench.put("VELOCITY", 0x000200)
    bench.put("ACCELERATION", 0x7F00)
    bench.control()
    bench.write(0x00, 0x0D)
    bench.samples(2)
    assert bench.seen("COMMAND_POSITION") == 4
    bench.write(0x24, 0x05)
    bench.until(bench.sample_start() + 20)
    bench.write(0x25, 0x80)
    bench.until(bench.sample_start() - 1)
    assert bench.seen("COMMAND_POSITION") == 4 + 5
    bench.samples(2)
    assert bench.seen("COMMAND_POSITION") == 4 + 5 + 5 + 6


@pytest.mark.spec("MCP-REG-49")
def test_idle_registers_written_in_control_last_until_the_next_output(bench: Bench) -> None:
    bench.control()
    bench.samples(1)
    bench.write(0x08, 0x33)
    bench.write(0x09, 0x11)
    assert (bench.seen("MOTOR_COMMAND"), bench.pin("MC0-MC11")) == (0x33, 0x330)
    bench.until(bench.sample_start() + 999)
    assert bench.seen("MOTOR_COMMAND") == 0x33
    bench.wait(1)
    assert (bench.seen("MOTOR_COMMAND"), bench.seen("PWM_COMMAND")) == (0x80, 0)


@pytest.mark.spec("MCP-REG-49", "MCP-REG-14", "MCP-REG-15")
def test_timer_registers_take_effect_at_the_next_reload(bench: Bench) -> None:
    end = bench.sample_start()
    bench.write(0x0F, 0x09)
    bench.write(0x11, 0x63)
    assert bench.sample_start() == end == 4160
    bench.until(end)
    assert bench.sample_start() == end + 1000


# -- flag register --------------------------------------------------------------------------------


@pytest.mark.spec("MCP-FLG-1", "MCP-FLG-3", "MCP-REG-1", "MCP-T-20")
@pytest.mark.parametrize(("flag", "set_code", "clear_code"), [
    (0x01, 0x08, 0x00), (0x08, 0x0B, 0x03), (0x10, 0x0C, 0x04), (0x20, 0x0D, 0x05),
])  # fmt: skip
def test_mode_flags_are_set_and_cleared_by_number(
    bench: Bench, flag: int, set_code: int, clear_code: int
) -> None:
    assert bench.read(0x00) == 0x02
    bench.write(0x00, set_code)
    assert bench.read(0x00) == 0x02 | flag
    bench.write(0x00, 0xF0 | clear_code)
    assert bench.read(0x00) == 0x02
    bench.write(0x00, 0x50 | set_code)
    assert bench.read(0x00) == 0x02 | flag


@pytest.mark.spec("MCP-FLG-2", "MCP-T-20", "MCP-AMB-12", "MCP-AMB-4")
@pytest.mark.parametrize("code", [0x09, 0x01, 0x0A, 0x02, 0x0E, 0x06, 0x0F, 0x07])
def test_flags_of_the_core_cannot_be_written(bench: Bench, code: int) -> None:
    bench.write(0x00, code)
    assert bench.read(0x00) == 0x02


@pytest.mark.spec("MCP-FLG-1", "MCP-FLG-4", "MCP-FLG-5", "MCP-AMB-13", "MCP-REG-1")
def test_in_motion_and_the_prof_pin_during_a_profile(bench: Bench) -> None:
    bench.put("FINAL_POSITION", 6)
    bench.put("PROFILE_VELOCITY", 2)
    bench.put("ACCELERATION", 0x0200)
    bench.control()
    bench.samples(1)
    assert (bench.read(0x00), bench.pin("PROF")) == (0x00, 0)
    bench.write(0x00, 0x08)
    assert (bench.read(0x00), bench.pin("PROF")) == (0x05, 1)
    bench.samples(2)
    assert (bench.seen("FLAG"), bench.pin("PROF"), bench.seen("COMMAND_POSITION")) == (5, 1, 4)
    bench.until(bench.sample_start() + 1899)
    assert (bench.seen("FLAG"), bench.pin("PROF")) == (5, 1)
    bench.wait(1)
    assert (bench.seen("FLAG"), bench.pin("PROF"), bench.seen("COMMAND_POSITION")) == (0, 0, 6)


@pytest.mark.spec("MCP-FLG-4")
def test_a_profile_set_off_while_busy_is_in_motion_from_then_on(bench: Bench) -> None:
    bench.put("FINAL_POSITION", 6)
    bench.put("PROFILE_VELOCITY", 2)
    bench.put("ACCELERATION", 0x0200)
    bench.control()
    bench.samples(1)
    edges = bench.watch("PROF")
    bench.until(bench.sample_start() + 100)
    bench.write(0x00, 0x08)
    bench.samples(5)
    assert [level for _, _, level in edges.seen] == [1, 0]


@pytest.mark.spec("MCP-FLG-4")
def test_in_motion_in_integral_velocity_follows_command_and_velocity(bench: Bench) -> None:
    bench.put("ACCELERATION", 0x0100)
    bench.control()
    bench.write(0x00, 0x0D)
    bench.samples(2)
    assert bench.seen("FLAG") == 0x20
    bench.put("VELOCITY_COMMAND", 2)
    bench.samples(1)
    assert (bench.seen("FLAG"), bench.pin("PROF")) == (0x24, 1)
    bench.samples(2)
    bench.put("VELOCITY_COMMAND", 0)
    bench.samples(1)
    assert bench.seen("FLAG") == 0x24
    bench.samples(1)
    assert (bench.seen("FLAG"), bench.pin("PROF")) == (0x20, 0)


@pytest.mark.spec("MCP-FLG-5", "MCP-INT-2")
def test_prof_shows_the_interpolator_latch_if_asked_and_only_in_interpolation(
    bench: Bench,
) -> None:
    bench.write(0x03, 0x40)
    bench.put("INTERPOLATOR_PRESET", 1)
    bench.put("FINAL_POSITION", 40)
    assert (bench.read(0x03), bench.pin("PROF")) == (0xC0, 0)
    bench.write(0x00, 0x0B)
    bench.control()
    bench.until(bench.sample_start() + 10)
    assert (bench.pin("PROF"), bench.seen("CAPTURE_CONTROL")) == (1, 0xC0)
    bench.samples(1)
    assert (bench.pin("PROF"), bench.seen("CAPTURE_CONTROL")) == (0, 0x40)
    bench.put("FINAL_POSITION", 80)
    assert (bench.pin("PROF"), bench.seen("CAPTURE_CONTROL")) == (1, 0xC0)
    bench.write(0x00, 0x03)
    bench.samples(1)
    assert (bench.pin("PROF"), bench.seen("FLAG")) == (0, 0)


@pytest.mark.spec("MCP-FLG-5", "MCP-AMB-13")
def test_idle_pin_is_flag_f1(bench: Bench) -> None:
    assert (bench.pin("IDLE"), bench.read(0x00) & 2) == (1, 2)
    bench.control()
    bench.samples(1)
    assert (bench.pin("IDLE"), bench.read(0x00) & 2) == (0, 0)


# -- status register ------------------------------------------------------------------------------


@pytest.mark.spec("MCP-STA-1", "MCP-STA-2", "MCP-REG-8", "MCP-AMB-21", "MCP-T-21")
@pytest.mark.parametrize(("pin", "bit"), [("/LIMIT", 0x80), ("/STOP", 0x40)])
def test_pin_flags_are_active_low_and_stay_while_the_pin_is_low(
    bench: Bench, pin: str, bit: int
) -> None:
    assert bench.read(0x07) == 0xF8
    bench.drive(pin, LOW)
    assert bench.read(0x07) == 0xF8 & ~bit
    bench.write(0x07, 0x00)
    assert bench.read(0x07) == 0xF8 & ~bit
    bench.drive(pin, HIGH)
    assert bench.read(0x07) == 0xF8 & ~bit
    bench.write(0x07, 0xFF)
    assert bench.read(0x07) == 0xF8


@pytest.mark.spec("MCP-STA-2")
def test_writing_status_leaves_the_three_low_bits(bench: Bench) -> None:
    bench.control()
    bench.samples(1)
    assert bench.read(0x07) == 0xFC
    bench.probe.status = 0x06
    bench.write(0x07, 0x00)
    assert bench.read(0x07) == 0xFE


@pytest.mark.spec("MCP-STA-3")
@pytest.mark.parametrize(("speed", "direction"), [(-50_000.0, 2), (50_000.0, 0), (0.0, 0)])
def test_the_direction_at_a_fault_is_noted(speed: float, direction: int) -> None:
    rail = Rail()
    rail.speed = speed
    bench = Bench(plant=rail)
    bench.write(0x04, 0x00)
    bench.control()
    bench.samples(3)
    bench.probe.status ^= 2 - direction
    bench.drive("/STOP", LOW)
    assert bench.seen("STATUS") & 0x42 == direction
    rail.speed = -speed
    bench.samples(3)
    bench.write(0x07, 0)
    assert bench.seen("STATUS") & 0x42 == direction


@pytest.mark.spec("MCP-STA-3")
def test_the_direction_is_that_of_the_first_fault_until_its_flag_is_cleared() -> None:
    rail = Rail()
    rail.speed = -50_000.0
    bench = Bench(plant=rail)
    bench.write(0x04, 0x00)
    bench.control()
    bench.samples(3)
    bench.drive("/STOP", LOW)
    bench.drive("/STOP", HIGH)
    assert bench.seen("STATUS") & 2
    rail.speed = 50_000.0
    bench.samples(3)
    bench.drive("/STOP", LOW)
    assert bench.seen("STATUS") & 2
    bench.drive("/STOP", HIGH)
    bench.write(0x07, 0)
    bench.drive("/STOP", LOW)
    assert not bench.seen("STATUS") & 2


@pytest.mark.spec("MCP-STA-4", "MCP-AMB-35", "MCP-T-16")
@pytest.mark.parametrize(
    ("deadband", "error", "inside"),
    [(0, 0, True), (0, 1, True), (0, -1, True), (0, 2, False), (2, 3, True), (2, -3, True),
     (2, 4, False), (2, -4, False), (255, 256, True), (255, 257, False)],
)  # fmt: skip
def test_in_position_is_one_more_than_the_deadband(
    bench: Bench, deadband: int, error: int, inside: bool
) -> None:
    bench.extended()
    bench.put("DEADBAND", deadband)
    bench.put("COMMAND_POSITION", error & 0xFFFFFF)
    bench.control()
    bench.samples(1)
    assert bool(bench.seen("STATUS") & 4) == inside
    if inside:
        bench.put("COMMAND_POSITION", 1000)
        bench.until(bench.sample_start() - 1)
        assert bench.seen("STATUS") & 4
        bench.samples(1)
        assert not bench.seen("STATUS") & 4


@pytest.mark.spec("MCP-REG-4", "MCP-CAP-1")
def test_bits_of_the_capture_control_register(bench: Bench) -> None:
    for data in (0x10, 0x20, 0x40, 0x02, 0x04, 0x76):
        bench.write(0x03, data)
        assert bench.read(0x03) == data
    bench.write(0x03, 0xFF)
    assert bench.read(0x03) == 0x76
    bench.write(0x29, 0x00)
    for data in (0x76, 0x00):
        bench.write(0x03, data)
        assert bench.read(0x03) == 0x80 | data
    bits = {bit.name: bit.mask for bit in ds.CAPTURE_BITS}
    assert bits == {
        "INTERPOLATOR_BUSY": 0x80, "BUSY_ON_PROF": 0x40, "INDEX_RISING": 0x20,
        "INDEX_CAPTURE": 0x10, "INDEX_LATCH": 0x08, "TRIG_INPUT": 0x04, "TRIG_CAPTURE": 0x02,
        "TRIG_LATCH": 0x01,
    }  # fmt: skip


@pytest.mark.spec("MCP-REG-6")
def test_the_mode_brancher_reads_the_mode(bench: Bench) -> None:
    assert bench.read(0x05) == 0x01
    bench.control()
    bench.samples(1)
    assert bench.read(0x05) == 0x03


@pytest.mark.spec("MCP-REG-2", "MCP-REG-3")
def test_named_bits_of_the_control_registers_have_the_code_s_masks() -> None:
    for rows in (ds.FEATURE_BITS, ds.CONFIG_BITS, ds.CAPTURE_BITS, ds.STATUS_BITS, ds.FLAG_BITS):
        for bit in rows:
            assert getattr(ds, bit.name) == bit.mask
