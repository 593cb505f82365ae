"""Hard and soft reset (MCP-RST), idle and control modes (MCP-MOD)."""

import pytest

from tests.conformance.mcp1200.conftest import Bench, Rail
from vbus.chips.mcp1200.datasheet import REGISTERS
from vbus.core.signals import HIGH, LOW
from vbus.core.state import save

SOFT = {
    "EXCEPTION": 0x09, "PHASE": 0, "MOTOR_COMMAND": 0x80, "PWM_COMMAND": 0,
    "MOTOR_COMMAND_LOW": 0, "PWM_FRACTION": 0, "DAC_OFFSET": 0, "COMMAND_INCREMENT": 0,
    "COMMAND_POSITION": 0, "LEAD_ZERO": 0xE5, "LEAD_POLE": 0x40, "LEAD_GAIN": 0x40,
    "SATURATION": 0xF0, "MAX_ERROR": 0xFFFF, "MODE": 0x01, "STATUS": 0xF8, "FLAG": 0x02,
}  # fmt: skip
KEPT = {
    "FEATURE": 0x38, "CONFIG": 0x41, "CAPTURE_CONTROL": 0xF2, "PRESCALER": 0x0123,
    "ENCODER_PWM": 0x35, "STEP_WIDTH": 0x22, "ENCODER_RATIO": 0x0180, "VELOCITY": 0x123456,
    "ACCELERATION": 0x0203, "PROFILE_VELOCITY": 0x44, "FINAL_POSITION": 0x010203,
    "VELOCITY_COMMAND": 0x05, "BREAKPOINT": 0x003A98, "BACKLASH": 3, "DEADBAND": 4,
    "FORCED_EXCEPTION": 1, "JERK": 0x1234, "FEED_FORWARD": 0x0102, "KP": 1, "KI": 2, "KD": 3,
    "DERIVATIVE_SPAN": 4, "INTEGRAL_LIMIT": 0x1000, "KA": 5, "KV": 6, "INTERPOLATOR_PRESET": 5,
}  # fmt: skip


def fill(bench: Bench) -> None:
    """Write something else than the reset value everywhere."""
    bench.extended()
    for name, value in KEPT.items():
        bench.put(name, value)
    for name in SOFT:
        if name not in ("PHASE", "STATUS", "FLAG", "MODE", "MOTOR_COMMAND_LOW", "PWM_FRACTION"):
            bench.put(name, 0x12)
    bench.put("SAMPLE_TIMER", 0x7F)


@pytest.mark.spec("MCP-RST-1", "MCP-RST-2")
def test_outputs_while_reset_is_low_and_after(bench: Bench) -> None:
    bench.write(0x08, 0xC0)
    bench.write(0x09, 0x32)
    bench.write(0x02, 0x10)
    bench.write(0x3F, 0)
    bench.wait(2 * bench.period)
    assert bench.pin("TRIG") == LOW
    bench.drive("/RESET", LOW)
    levels = {name: bench.pin(name) for name in ("PROF", "IDLE", "BUSY", "PULSE", "SIGN")}
    assert levels == {"PROF": 0, "IDLE": 0, "BUSY": 0, "PULSE": 0, "SIGN": 1}
    assert bench.pin("MC0-MC11") == 0x800
    assert bench.pin("TRIG") == HIGH
    assert bench.seen("FLAG") == 0
    bench.wait(10)
    bench.drive("/RESET", HIGH)
    assert bench.pin("SIGN") == 0


@pytest.mark.spec("MCP-RST-1", "MCP-RST-3")
def test_a_byte_on_its_way_to_a_register_is_lost_in_a_reset(chip: Bench) -> None:
    chip.chip.write(0x10, 0x55)
    assert chip.seen("PRESCALER") == 0x3F, "a byte takes four clocks"
    chip.drive("/RESET", LOW)
    chip.wait(10)
    chip.drive("/RESET", HIGH)
    chip.wait(320)
    assert chip.seen("PRESCALER") == 0x3F


@pytest.mark.spec("MCP-RST-1")
def test_pulse_is_high_for_exactly_one_clock_after_reset(chip: Bench) -> None:
    edges = chip.watch("PULSE")
    chip.until(50)
    chip.drive("/RESET", LOW)
    chip.until(100)
    chip.drive("/RESET", HIGH)
    chip.until(1000)
    assert edges.seen == [(100, "PULSE", 1), (101, "PULSE", 0)]


@pytest.mark.spec("MCP-RST-1", "MCP-RST-3")
def test_a_hard_reset_forgets_the_steps_still_to_come_and_their_direction(chip: Bench) -> None:
    chip.write(0x02, 0x03)
    chip.control()
    chip.samples(1)
    chip.put("COMMAND_POSITION", -20)
    chip.samples(1)
    assert (chip.pin("SIGN"), -20 < chip.position < 0) == (1, True)
    chip.drive("/RESET", LOW)
    chip.wait(2)
    chip.drive("/RESET", HIGH)
    chip.wait(320)
    edges = chip.watch("PULSE")
    chip.write(0x02, 0x03)
    chip.wait(2 * chip.period)
    assert (chip.pin("SIGN"), chip.position, edges.seen) == (0, 0, [])


@pytest.mark.spec("MCP-RST-3", "MCP-AMB-9", "MCP-AMB-19")
def test_hard_reset_loads_every_default(bench: Bench) -> None:
    fill(bench)
    bench.probe.set_position(77, bench.cycle)
    bench.drive("/RESET", LOW)
    assert bench.position == 0
    bench.wait(2)
    bench.drive("/RESET", HIGH)
    bench.wait(320)
    for row in REGISTERS:
        assert bench.seen(row.name) & (1 << row.bits) - 1 == row.reset, row.name
    assert bench.seen("SAMPLE_TIMER") == 0x40
    assert bench.seen("PRESCALER") == 0x3F
    assert bench.seen("STEP_WIDTH") == 0x0F


@pytest.mark.spec("MCP-RST-3")
@pytest.mark.parametrize(
    ("name", "value"),
    [
        ("FLAG", 0x02), ("EXCEPTION", 0x09), ("MODE", 1), ("STATUS", 0xF8),
        ("MOTOR_COMMAND", 0x80), ("SAMPLE_TIMER", 0x40), ("PRESCALER", 0x3F),
        ("STEP_WIDTH", 0x0F), ("LEAD_ZERO", 0xE5), ("LEAD_POLE", 0x40), ("LEAD_GAIN", 0x40),
        ("BREAKPOINT", -0x800000), ("MAX_ERROR", 0xFFFF), ("SATURATION", 0xF0), ("KP", 0x40),
        ("KD", 0x40), ("DERIVATIVE_SPAN", 1), ("INTEGRAL_LIMIT", 0x7FFF), ("VELOCITY", 0),
        ("ACCELERATION", 0), ("FINAL_POSITION", 0), ("JERK", 0), ("INTERPOLATOR_PRESET", 0),
    ],
)  # fmt: skip
def test_defaults_of_the_register_table(bench: Bench, name: str, value: int) -> None:
    bench.extended()
    bench.probe.reset_register(name)
    if name != "SAMPLE_TIMER":
        assert bench.get(name) == value
    assert bench.seen(name) == value


@pytest.mark.spec("MCP-RST-4", "MCP-AMB-20")
def test_soft_reset_loads_some_registers_and_keeps_the_rest(bench: Bench) -> None:
    fill(bench)
    bench.probe.set_position(77, bench.cycle)
    bench.write(0x05, 0x00)
    bench.wait(320)
    for name, value in SOFT.items():
        assert bench.seen(name) == value, name
    for name, value in KEPT.items():
        assert bench.seen(name) == value, name
    assert bench.seen("SAMPLE_TIMER") == 0x40
    assert bench.position == 0


@pytest.mark.spec("MCP-RST-5")
@pytest.mark.parametrize(("hz", "microseconds"), [(20_000_000, 16), (8_000_000, 40)])
def test_a_hard_reset_takes_320_clocks(hz: int, microseconds: int) -> None:
    bench = Bench(hz=hz, done=False)
    end = microseconds * 1_000_000
    bench.until_ps(end - 1)
    assert (bench.pin("IDLE"), bench.seen("FLAG")) == (0, 0)
    bench.until_ps(end)
    assert (bench.pin("IDLE"), bench.seen("FLAG")) == (1, 2)


@pytest.mark.spec("MCP-RST-5")
def test_a_soft_reset_from_idle_takes_320_clocks(bench: Bench) -> None:
    bench.write(0x05, 0x00)
    begun = bench.cycle
    assert (bench.pin("IDLE"), bench.seen("FLAG"), bench.seen("MODE")) == (0, 0, 0)
    bench.until(begun + 319)
    assert bench.pin("IDLE") == 0
    bench.until(begun + 320)
    assert (bench.pin("IDLE"), bench.seen("FLAG"), bench.seen("MODE")) == (1, 2, 1)


@pytest.mark.spec("MCP-RST-5")
def test_a_soft_reset_from_control_waits_for_the_end_of_the_sample(bench: Bench) -> None:
    bench.control()
    bench.samples(2)
    end = bench.sample_start()
    bench.until(end - 1000)
    bench.write(0x05, 0x00)
    bench.until(end - 1)
    assert bench.seen("MODE") == 3
    bench.until(end + 319)
    assert bench.pin("IDLE") == 0
    bench.until(end + 320)
    assert (bench.pin("IDLE"), bench.seen("MODE")) == (1, 1)


@pytest.mark.spec("MCP-RST-5")
def test_writes_inside_a_reset_are_overwritten_where_defaults_are_loaded(bench: Bench) -> None:
    bench.write(0x05, 0x00)
    bench.write(0x20, 0x11)
    bench.write(0x28, 0x22)
    assert bench.seen("LEAD_ZERO") == 0x11
    bench.wait(320)
    assert bench.seen("LEAD_ZERO") == 0xE5
    assert bench.seen("PROFILE_VELOCITY") == 0x22


@pytest.mark.spec("MCP-RST-4", "MCP-STA-2")
@pytest.mark.parametrize(("pin", "status"), [("/LIMIT", 0x78), ("/STOP", 0xB8)])
def test_an_input_that_is_low_when_a_reset_ends_has_its_flag(
    bench: Bench, pin: str, status: int
) -> None:
    bench.write(0x05, 0x00)
    bench.drive(pin, LOW)
    bench.wait(320)
    assert bench.seen("STATUS") == status


@pytest.mark.spec("MCP-MOD-1")
@pytest.mark.parametrize(("code", "shown"), [(0x03, 3), (0x04, 3), (0x80, 3), (0xFF, 3)])
def test_any_code_above_two_is_control(bench: Bench, code: int, shown: int) -> None:
    assert bench.read(0x05) == 1
    bench.write(0x05, code)
    bench.until(bench.sample_start())
    assert bench.read(0x05) == shown


@pytest.mark.spec("MCP-MOD-1", "MCP-MOD-7", "MCP-AMB-14")
def test_halt_stops_at_the_actual_position_and_holds_it_until_control(bench: Bench) -> None:
    bench.put("VELOCITY_COMMAND", 20)
    bench.put("ACCELERATION", 0x0A00)
    bench.control()
    bench.write(0x00, 0x0D)
    bench.samples(5)
    bench.probe.set_position(33, bench.cycle)
    bench.write(0x05, 0x02)
    bench.samples(1)
    assert bench.read(0x05) == 2
    assert bench.seen("FLAG") == 0
    assert bench.seen("COMMAND_POSITION") == 33
    bench.write(0x00, 0x0D)
    bench.samples(3)
    assert bench.seen("COMMAND_POSITION") == 33
    bench.write(0x05, 0x03)
    bench.samples(2)
    assert bench.read(0x05) == 3
    assert bench.seen("COMMAND_POSITION") > 33


@pytest.mark.spec("MCP-MOD-1", "MCP-MOD-7", "MCP-SMP-5")
@pytest.mark.parametrize(("before", "code"), [(3, 2), (2, 3)])
def test_a_halt_and_its_end_are_read_with_the_results_of_their_sample(
    bench: Bench, before: int, code: int
) -> None:
    bench.control()
    bench.samples(1)
    bench.write(0x05, before)
    bench.samples(1)
    start = bench.sample_start()
    bench.write(0x05, code)
    bench.until(start + 999)
    assert (bench.seen("MODE"), bench.pin("BUSY")) == (before, 1)
    bench.until(start + 1000)
    assert (bench.seen("MODE"), bench.pin("BUSY")) == (code, 0)


@pytest.mark.spec("MCP-MOD-7")
def test_halt_is_ignored_in_idle(bench: Bench) -> None:
    bench.write(0x05, 0x02)
    bench.samples(2)
    assert (bench.read(0x05), bench.pin("IDLE")) == (1, 1)


@pytest.mark.spec("MCP-MOD-2")
def test_idle_from_control_comes_at_the_next_sample_start(bench: Bench) -> None:
    bench.put("COMMAND_POSITION", 10)
    bench.control()
    bench.samples(3)
    assert bench.seen("PWM_COMMAND") != 0
    start = bench.sample_start()
    bench.until(start - 1000)
    bench.write(0x05, 0x01)
    bench.until(start - 1)
    assert (bench.pin("IDLE"), bench.seen("MODE")) == (0, 3)
    assert bench.seen("PWM_COMMAND") != 0
    bench.until(start)
    assert (bench.pin("IDLE"), bench.seen("MODE"), bench.seen("FLAG")) == (1, 1, 2)
    assert (bench.seen("MOTOR_COMMAND"), bench.seen("MOTOR_COMMAND_LOW")) == (0x80, 0)
    assert (bench.seen("PWM_COMMAND"), bench.seen("PWM_FRACTION")) == (0, 0)
    assert bench.pin("MC0-MC11") == 0x800


@pytest.mark.spec("MCP-MOD-2", "MCP-MOD-5", "MCP-FLG-4")
@pytest.mark.parametrize(
    ("flag", "register", "shown"), [(0x08, "PHASE", 2), (0x0B, "INTERPOLATOR_COUNT", 5)]
)
def test_idle_ends_what_was_under_way(bench: Bench, flag: int, register: str, shown: int) -> None:
    bench.put("FINAL_POSITION", 5000)
    bench.put("PROFILE_VELOCITY", 20)
    bench.put("ACCELERATION", 0x0100)
    bench.put("INTERPOLATOR_PRESET", 2)
    bench.write(0x00, flag)
    bench.control()
    bench.samples(4)
    assert (bench.seen(register), bench.pin("PROF")) == (shown, 1)
    bench.write(0x05, 0x01)
    bench.samples(1)
    assert (bench.seen(register), bench.pin("PROF"), bench.seen("FLAG") & 4) == (0, 0, 0)


@pytest.mark.spec("MCP-RST-3", "MCP-RST-4", "MCP-TRP-8")
def test_a_soft_reset_keeps_what_the_last_move_left_a_hard_reset_does_not(bench: Bench) -> None:
    bench.put("FINAL_POSITION", 100)
    bench.put("PROFILE_VELOCITY", 10)
    bench.put("ACCELERATION", 0x180)
    bench.write(0x00, 0x08)
    bench.control()
    bench.samples(17)
    bench.write(0x05, 0x00)
    bench.samples(1)
    bench.wait(400)
    bench.control()
    bench.samples(1)
    assert (bench.get("ACCEL_DELTA"), bench.get("DECEL_POSITION")) == (41, 71)
    bench.drive("/RESET", LOW)
    bench.wait(2)
    bench.drive("/RESET", HIGH)
    bench.wait(320)
    bench.control()
    bench.samples(1)
    assert (bench.get("ACCEL_DELTA"), bench.get("DECEL_POSITION")) == (0, 0)


@pytest.mark.spec("MCP-RST-5")
def test_the_plant_feels_the_end_of_a_reset() -> None:
    rail = Rail()
    bench = Bench(plant=rail)
    bench.write(0x0F, 0xFF)
    bench.put("COMMAND_POSITION", 5)
    bench.control()
    bench.samples(2)
    bench.write(0x05, 0x00)
    start = bench.sample_start()
    bench.until(start + 319)
    assert rail.commands[-1] == -185 / 1600
    bench.until(start + 320)
    assert rail.commands[-2:] == [-185 / 1600, 0]


@pytest.mark.spec("MCP-RST-4", "MCP-ERR-1")
def test_a_reset_forgets_the_backlash_taken_up(bench: Bench) -> None:
    bench.extended()
    bench.put("BACKLASH", 10)
    bench.control()
    for command in (0, 5, 3):
        bench.put("COMMAND_POSITION", command)
        bench.samples(1)
    assert bench.seen("POSITION_ERROR") == -7
    bench.write(0x05, 0x00)
    bench.samples(1)
    bench.wait(400)
    bench.put("COMMAND_POSITION", 3)
    bench.control()
    bench.samples(1)
    assert bench.seen("POSITION_ERROR") == 3


@pytest.mark.spec("MCP-MOD-1", "MCP-MOD-2")
def test_writing_idle_in_idle_takes_the_motor_command_away(bench: Bench) -> None:
    bench.write(0x08, 0xC0)
    bench.write(0x09, 0x20)
    bench.write(0x05, 0x01)
    assert (bench.seen("MOTOR_COMMAND"), bench.seen("PWM_COMMAND")) == (0x80, 0)


@pytest.mark.spec("MCP-MOD-3")
def test_in_idle_the_host_drives_the_outputs_unmodified() -> None:
    rail = Rail()
    bench = Bench(plant=rail)
    bench.extended()
    bench.write(0x0A, 0x7F)
    bench.write(0x01, 0x04)
    bench.write(0x08, 0x12)
    bench.write(0x4C, 0x3F)
    assert bench.pin("MC0-MC11") == 0x123
    bench.write(0x09, 0xD8)
    bench.write(0x4D, 0x0F)
    bench.samples(2)
    assert rail.commands[-1] == -40 * 16 / 1600
    assert bench.pin("MC0-MC11") == 0x123
    assert (bench.read(0x08), bench.read(0x4C)) == (0x12, 0x30)


@pytest.mark.spec("MCP-MOD-4")
def test_limit_low_in_idle_keeps_the_outputs_off(bench: Bench) -> None:
    bench.extended()
    bench.write(0x08, 0xC0)
    bench.write(0x4C, 0x50)
    bench.write(0x09, 0x20)
    bench.drive("/LIMIT", LOW)
    assert bench.seen("STATUS") == 0x78
    for name, value in (("MOTOR_COMMAND", 0x80), ("MOTOR_COMMAND_LOW", 0), ("PWM_COMMAND", 0)):
        assert bench.seen(name) == value
    bench.write(0x08, 0xC0)
    assert bench.seen("MOTOR_COMMAND") == 0x80
    bench.write(0x09, 0x20)
    assert bench.seen("PWM_COMMAND") == 0
    bench.write(0x4D, 0x10)
    assert bench.seen("PWM_FRACTION") == 0
    bench.drive("/LIMIT", HIGH)
    bench.write(0x08, 0xC0)
    assert bench.seen("MOTOR_COMMAND") == 0xC0


@pytest.mark.spec("MCP-MOD-4", "MCP-REG-40", "MCP-REG-41")
@pytest.mark.parametrize("action", range(4))
def test_limit_low_in_idle_takes_the_outputs_away_whatever_r04_says(
    bench: Bench, action: int
) -> None:
    bench.extended()
    bench.write(0x04, 0x08 | action)
    bench.write(0x08, 0xC0)
    bench.write(0x09, 0x20)
    assert (bench.pin("MC0-MC11"), bench.read(0x09)) == (0xC00, 0x20)
    bench.drive("/LIMIT", LOW)
    assert bench.seen("STATUS") & 0xF8 == 0x78
    assert (bench.pin("MC0-MC11"), bench.read(0x09)) == (0x800, 0)
    bench.write(0x08, 0xC0)
    bench.write(0x4C, 0xF0)
    bench.write(0x09, 0x20)
    bench.write(0x4D, 0xF0)
    assert bench.pin("MC0-MC11") == 0x800
    assert [bench.read(place) for place in (0x08, 0x4C, 0x09, 0x4D)] == [0x80, 0, 0, 0]
    bench.drive("/LIMIT", HIGH)
    bench.write(0x08, 0xC0)
    assert bench.pin("MC0-MC11") == 0xC00


@pytest.mark.spec("MCP-MOD-5")
def test_idle_updates_no_velocity_and_no_error_but_counts() -> None:
    rail = Rail()
    bench = Bench(plant=rail)
    rail.speed = 100_000.0
    bench.control()
    bench.samples(3)
    assert bench.seen("ACTUAL_VELOCITY") == 52
    bench.write(0x05, 0x01)
    bench.samples(1)
    error, here = bench.seen("POSITION_ERROR"), bench.position
    rail.speed = 200_000.0
    edges = bench.watch("BUSY")
    bench.samples(4)
    assert bench.seen("ACTUAL_VELOCITY") == 52
    assert bench.seen("POSITION_ERROR") == error
    assert bench.position > here + 200
    assert edges.seen == []


@pytest.mark.spec("MCP-STA-4", "MCP-MOD-5")
def test_in_position_is_updated_in_idle_at_each_sample_start(bench: Bench) -> None:
    assert bench.read(0x07) == 0xF8
    first = bench.sample_start()
    bench.until(first - 1)
    assert bench.seen("STATUS") == 0xF8
    bench.until(first)
    assert (bench.seen("STATUS"), bench.read(0x07)) == (0xFC, 0xFC)
    bench.put("PRESET_POSITION", 2)
    second = bench.sample_start()
    assert (second, bench.cycle < second) == (first + 4160, True)
    bench.until(second - 1)
    assert bench.seen("STATUS") == 0xFC
    bench.until(second)
    assert bench.seen("STATUS") == 0xF8
    bench.put("COMMAND_POSITION", 1)
    bench.until(bench.sample_start())
    assert bench.seen("STATUS") == 0xFC
    # Nothing else of a control sample is there.
    assert (bench.get("POSITION_ERROR"), bench.get("ACTUAL_VELOCITY")) == (0, 0)


@pytest.mark.spec("MCP-STA-4", "MCP-MOD-5", "MCP-AMB-35")
@pytest.mark.parametrize(
    ("deadband", "error", "inside"),
    [(0, 1, True), (0, -1, True), (0, 2, False), (0, -2, False), (2, 3, True), (2, -3, True),
     (2, 4, False), (2, -4, False), (255, 256, True), (255, -257, False)],
)  # fmt: skip
def test_in_position_in_idle_asks_for_what_it_does_in_control(
    bench: Bench, deadband: int, error: int, inside: bool
) -> None:
    bench.extended()
    bench.put("DEADBAND", deadband)
    # Across the end of the range, too.
    bench.put("PRESET_POSITION", 0x7FFFFF)
    bench.put("COMMAND_POSITION", 0x7FFFFF + error & 0xFFFFFF)
    bench.until(bench.sample_start())
    assert bench.pin("IDLE") == 1
    assert bool(bench.read(0x07) & 4) == inside
    bench.control()
    bench.samples(1)
    assert (bench.pin("IDLE"), bool(bench.read(0x07) & 4)) == (0, inside)


@pytest.mark.spec("MCP-STA-4", "MCP-ERR-1")
@pytest.mark.parametrize(("backlash", "inside"), [(10, True), (0, False)])
def test_in_position_in_idle_counts_the_backlash_taken_up(
    bench: Bench, backlash: int, inside: bool
) -> None:
    bench.extended()
    bench.put("BACKLASH", 10)
    bench.control()
    bench.samples(1)
    for command in (5, 4):
        bench.put("COMMAND_POSITION", command)
        bench.samples(1)
    bench.write(0x05, 0x01)
    bench.put("PRESET_POSITION", 4 - 10 & 0xFFFFFF)
    bench.put("BACKLASH", backlash)
    bench.samples(1)
    assert (bench.pin("IDLE"), bool(bench.read(0x07) & 4)) == (1, inside)


@pytest.mark.spec("MCP-STA-4", "MCP-MOD-5")
def test_in_position_in_idle_follows_an_encoder_however_seldom_somebody_looks() -> None:
    """A motor turned by hand, one count a sample: a plant, and an encoder on the nets."""
    turned, encoder, seldom = Bench(plant=(rail := Rail())), Bench(), Bench(plant=(other := Rail()))
    rail.speed = other.speed = 8_000_000 / 4160
    edges = [(1, 0), (0, 0), (0, 1), (1, 1)]
    for place in range(50):
        for bench in (turned, encoder):
            bench.until(bench.sample_start())
            inside = abs(bench.position) <= 1
            assert bench.read(0x07) & 4 == 4 * inside
        for name, level in zip(("CHA", "CHB"), edges[place % 4], strict=True):
            encoder.drive(name, level)
    assert (turned.position, abs(encoder.position)) == (50, 49)
    seldom.until(turned.cycle)
    asked, alone = (save(bench.chip)["axis"] for bench in (turned, seldom))
    # What the host has asked last is part of it.
    assert {**alone, "host": asked["host"]} == asked


@pytest.mark.spec("MCP-STA-4", "MCP-SMP-6", "MCP-MOD-5")
def test_a_sample_in_which_an_exception_ends_control_is_one_of_idle_mode(bench: Bench) -> None:
    bench.write(0x04, 0x01)
    bench.control()
    bench.samples(2)
    assert bench.read(0x07) & 4
    bench.put("PRESET_POSITION", 100)
    bench.drive("/LIMIT", LOW)
    bench.until(bench.sample_start())
    assert (bench.pin("IDLE"), bench.read(0x07) & 4) == (1, 0)
    bench.drive("/LIMIT", HIGH)
    bench.control()
    bench.samples(1)
    # Control again in the next sample: the motor has not moved since the last one.
    assert (bench.pin("IDLE"), bench.get("ACTUAL_VELOCITY")) == (0, 0)


@pytest.mark.spec("MCP-MOD-6")
def test_control_starts_at_the_next_timer_zero_and_copies_nothing(bench: Bench) -> None:
    bench.put("COMMAND_POSITION", 100)
    bench.probe.set_position(30, bench.cycle)
    bench.control()
    start = bench.sample_start()
    bench.until(start - 1)
    assert (bench.pin("IDLE"), bench.seen("MODE"), bench.pin("BUSY")) == (1, 1, 0)
    bench.until(start)
    assert (bench.pin("IDLE"), bench.seen("MODE"), bench.pin("BUSY")) == (0, 3, 1)
    bench.samples(1)
    assert bench.seen("COMMAND_POSITION") == 100
    assert bench.seen("POSITION_ERROR") == 70


@pytest.mark.spec("MCP-MOD-6")
def test_a_code_written_after_control_in_idle_wins(bench: Bench) -> None:
    bench.write(0x05, 0x03)
    bench.write(0x05, 0x01)
    bench.samples(2)
    assert (bench.seen("MODE"), bench.pin("IDLE")) == (1, 1)


@pytest.mark.spec("MCP-MOD-6", "MCP-MOD-8", "MCP-AMB-27")
def test_the_first_of_the_mode_flags_wins(bench: Bench) -> None:
    """F0, then F4, then F3, then F5: seen by who moves the command position, and how fast."""
    bench.put("FINAL_POSITION", 1000)
    bench.put("PROFILE_VELOCITY", 1)
    bench.put("ACCELERATION", 0x0100)
    bench.put("VELOCITY", 3 << 8)
    bench.put("INTERPOLATOR_PRESET", 0)
    bench.put("VELOCITY_COMMAND", 50)
    bench.control()
    for code in (0x0D, 0x0B, 0x0C, 0x08):
        bench.write(0x00, code)
    before = bench.seen("COMMAND_POSITION")
    bench.samples(3)
    assert bench.seen("PHASE") in (2, 4)
    bench.write(0x00, 0x00)
    bench.samples(4)
    before = bench.seen("COMMAND_POSITION")
    bench.samples(1)
    assert bench.seen("COMMAND_POSITION") - before == 3
    bench.write(0x00, 0x04)
    bench.samples(3)
    assert bench.seen("COMMAND_POSITION") == 1000
    bench.write(0x00, 0x03)
    bench.samples(1)
    assert bench.seen("COMMAND_POSITION") == 1001


@pytest.mark.spec("MCP-MOD-9")
def test_a_flag_set_in_idle_starts_its_mode_with_control(bench: Bench) -> None:
    bench.put("FINAL_POSITION", 3)
    bench.put("PROFILE_VELOCITY", 1)
    bench.put("ACCELERATION", 0x0100)
    bench.write(0x00, 0x08)
    bench.samples(2)
    assert (bench.seen("FLAG"), bench.seen("COMMAND_POSITION")) == (0x03, 0)
    bench.control()
    assert bench.trace("COMMAND_POSITION", 4) == [1, 2, 3, 3]
    assert bench.seen("FLAG") == 0


@pytest.mark.spec("MCP-RST-4", "MCP-REG-31")
def test_the_first_sample_after_a_reset_finds_no_velocity() -> None:
    bench = Bench()
    bench.control()
    bench.until(bench.sample_start() + 1500)
    assert (bench.pin("IDLE"), bench.seen("ACTUAL_VELOCITY")) == (0, 0)
