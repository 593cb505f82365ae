"""Exceptions: sources, actions by mode, what repeats (MCP-EXC)."""

from collections.abc import Callable

import pytest

from tests.conformance.mcp1200.conftest import Bench, Rail, low_pulse
from vbus.core.kernel import US
from vbus.core.signals import HIGH, LOW

REPORT, GO_IDLE, DECEL, ABRUPT = range(4)


def position(bench: Bench) -> None:
    bench.put("COMMAND_POSITION", 50)
    bench.control()


def profile(bench: Bench) -> None:
    bench.put("FINAL_POSITION", 5000)
    bench.put("PROFILE_VELOCITY", 10)
    bench.put("ACCELERATION", 0x0400)
    bench.write(0x00, 0x08)
    bench.control()


def s_curve(bench: Bench) -> None:
    bench.extended()
    bench.put("JERK", 0x8000)
    bench.write(0x01, 0x10)
    profile(bench)


def velocity(bench: Bench) -> None:
    bench.put("VELOCITY_COMMAND", 10)
    bench.put("ACCELERATION", 0x0400)
    bench.write(0x00, 0x0D)
    bench.control()


def high_velocity(bench: Bench) -> None:
    bench.write(0x01, 0x20)
    bench.put("VELOCITY", 0x000A00)
    bench.put("ACCELERATION", 0x0400)
    bench.write(0x00, 0x0D)
    bench.control()


def position_interpolation(bench: Bench) -> None:
    bench.put("INTERPOLATOR_PRESET", 4)
    bench.put("FINAL_POSITION", 320)
    bench.write(0x00, 0x0B)
    bench.control()


def velocity_interpolation(bench: Bench) -> None:
    bench.put("INTERPOLATOR_PRESET", 1)
    bench.put("VELOCITY", 0x000A00)
    bench.write(0x00, 0x0C)
    bench.control()


MODES = [position, profile, s_curve, velocity, high_velocity, position_interpolation,
         velocity_interpolation]  # fmt: skip
FLAG = {position: 0, profile: 1, s_curve: 1, velocity: 0x20, high_velocity: 0x20,
        position_interpolation: 8, velocity_interpolation: 0x10}  # fmt: skip


def moving(bench: Bench, begin: Callable[[Bench], None], samples: int = 12) -> int:
    """Run a mode for some samples with the motor at 7; return the command position."""
    begin(bench)
    bench.samples(samples)
    bench.probe.set_position(7, bench.cycle)
    return bench.seen("COMMAND_POSITION")


@pytest.mark.spec("MCP-EXC-2", "MCP-MOD-2")
@pytest.mark.parametrize("begin", MODES)
def test_idle_action_from_every_mode(begin: Callable[[Bench], None]) -> None:
    bench = Bench()
    bench.write(0x04, GO_IDLE)
    moving(bench, begin)
    bench.drive("/LIMIT", LOW)
    start = bench.sample_start()
    bench.until(start - 1)
    assert bench.pin("IDLE") == 0
    bench.until(start)
    assert (bench.pin("IDLE"), bench.seen("MODE"), bench.seen("PWM_COMMAND")) == (1, 1, 0)
    assert bench.pin("BUSY") == 0
    # Mode flags stay: the manual's way off a limit clears them.
    assert bench.seen("FLAG") == 2 | FLAG[begin]


@pytest.mark.spec("MCP-EXC-2")
@pytest.mark.parametrize("begin", MODES)
def test_abrupt_action_holds_the_actual_position_in_position_control(
    begin: Callable[[Bench], None],
) -> None:
    bench = Bench()
    bench.write(0x04, ABRUPT << 2)
    moving(bench, begin)
    low_pulse(bench, "/STOP", US)
    assert bench.trace("COMMAND_POSITION", 3) == [7, 7, 7]
    assert (bench.seen("FLAG"), bench.seen("MODE"), bench.seen("PHASE")) == (0, 3, 0)


@pytest.mark.spec("MCP-EXC-2", "MCP-AMB-33")
@pytest.mark.parametrize("begin", [position, position_interpolation])
def test_deceleration_without_a_ramp_is_an_abrupt_stop(begin: Callable[[Bench], None]) -> None:
    bench = Bench()
    bench.write(0x04, DECEL << 2)
    moving(bench, begin)
    low_pulse(bench, "/STOP", US)
    assert bench.trace("COMMAND_POSITION", 3) == [7, 7, 7]
    assert bench.seen("FLAG") == FLAG[begin]
    if begin is position_interpolation:
        bench.put("INTERPOLATOR_PRESET", 0)
        bench.put("FINAL_POSITION", 11)
        assert bench.trace("COMMAND_POSITION", 3) == [9, 11, 11]


@pytest.mark.spec("MCP-EXC-2", "MCP-AMB-33", "MCP-INT-2")
def test_position_interpolation_that_was_stopped_waits_until_its_registers_change() -> None:
    bench = Bench()
    bench.write(0x04, DECEL << 2)
    moving(bench, position_interpolation)
    bench.drive("/STOP", LOW)
    bench.samples(2)
    # 320 is what it was kept from. A byte written while it is kept there does not count.
    bench.write(0x2A, 0x02)
    bench.samples(1)
    bench.drive("/STOP", HIGH)
    assert bench.trace("COMMAND_POSITION", 3) == [7, 7, 7]
    bench.put("INTERPOLATOR_PRESET", 0)
    bench.write(0x2A, 0x01)
    assert bench.trace("COMMAND_POSITION", 3) == [163, 320, 320]


@pytest.mark.spec("MCP-EXC-2")
@pytest.mark.parametrize("begin", [profile, s_curve])
def test_a_profile_decelerates_linearly_and_ends(begin: Callable[[Bench], None]) -> None:
    bench = Bench()
    bench.write(0x04, DECEL << 2)
    here = moving(bench, begin, 40)
    low_pulse(bench, "/STOP", US)
    # 10 counts a sample, 4 less in each.
    assert bench.trace("COMMAND_POSITION", 4) == [here + 6, here + 8, here + 8, here + 8]
    assert (bench.seen("FLAG"), bench.seen("PHASE")) == (0, 0)


@pytest.mark.spec("MCP-EXC-2")
@pytest.mark.parametrize("begin", [profile, s_curve])
def test_without_acceleration_a_profile_stops_at_once(begin: Callable[[Bench], None]) -> None:
    bench = Bench()
    bench.write(0x04, DECEL << 2)
    moving(bench, begin, 40)
    bench.put("ACCELERATION", 0)
    bench.samples(1)
    here = bench.seen("COMMAND_POSITION")
    low_pulse(bench, "/STOP", US)
    assert bench.trace("COMMAND_POSITION", 2) == [here, here]
    assert bench.seen("FLAG") == 0


@pytest.mark.spec("MCP-EXC-2", "MCP-EXC-3")
@pytest.mark.parametrize(
    ("begin", "name"), [(velocity, "VELOCITY_COMMAND"), (high_velocity, "VELOCITY")]
)
def test_integral_velocity_decelerates_stays_and_forgets_its_command(
    begin: Callable[[Bench], None], name: str
) -> None:
    bench = Bench()
    bench.write(0x04, DECEL << 2)
    here = moving(bench, begin)
    low_pulse(bench, "/STOP", US)
    assert bench.trace("COMMAND_POSITION", 4) == [here + 6, here + 8, here + 8, here + 8]
    assert (bench.seen("FLAG"), bench.seen(name)) == (0x20, 0)
    bench.write(0x07, 0)
    bench.samples(2)
    assert bench.seen("COMMAND_POSITION") == here + 8


@pytest.mark.spec("MCP-EXC-2", "MCP-EXC-3")
@pytest.mark.parametrize(("pin", "setting"), [("/STOP", DECEL << 2), ("/LIMIT", DECEL)])
def test_integral_velocity_stays_at_rest_until_the_flag_is_cleared(pin: str, setting: int) -> None:
    bench = Bench()
    bench.write(0x04, setting)
    here = moving(bench, velocity) + 8
    low_pulse(bench, pin, US)
    bench.samples(3)
    bench.put("VELOCITY_COMMAND", 4)
    assert bench.trace("COMMAND_POSITION", 3) == [here, here, here]
    bench.write(0x07, 0)
    bench.put("VELOCITY_COMMAND", 4)
    assert bench.trace("COMMAND_POSITION", 2) == [here + 4, here + 8]


@pytest.mark.spec("MCP-EXC-1", "MCP-EXC-2")
@pytest.mark.parametrize(
    ("pin", "setting"),
    [("/STOP", DECEL << 2), ("/STOP", DECEL << 2 | DECEL), ("/LIMIT", DECEL)],
)
def test_integral_velocity_waits_for_a_stop_of_idle_mode_to_be_cleared(
    pin: str, setting: int
) -> None:
    bench = Bench()
    bench.write(0x04, setting)
    low_pulse(bench, pin, US)
    velocity(bench)
    assert bench.trace("COMMAND_POSITION", 2) == [0, 0]
    bench.write(0x07, 0)
    bench.put("VELOCITY_COMMAND", 4)
    assert bench.trace("COMMAND_POSITION", 2) == [4, 8]


@pytest.mark.spec("MCP-EXC-2")
def test_a_flag_that_is_only_reported_does_not_hold_integral_velocity() -> None:
    bench = Bench()
    bench.write(0x04, 0)
    low_pulse(bench, "/STOP", US)
    low_pulse(bench, "/LIMIT", US)
    bench.put("ACCELERATION", 0x0400)
    bench.put("VELOCITY_COMMAND", 4)
    bench.write(0x00, 0x0D)
    bench.control()
    assert bench.trace("COMMAND_POSITION", 2) == [4, 8]


@pytest.mark.spec("MCP-EXC-2", "MCP-VEL-4")
def test_without_acceleration_integral_velocity_stops_at_once() -> None:
    bench = Bench()
    bench.write(0x04, DECEL << 2)
    moving(bench, velocity)
    bench.put("ACCELERATION", 0)
    bench.samples(1)
    here = bench.seen("COMMAND_POSITION")
    low_pulse(bench, "/STOP", US)
    assert bench.trace("COMMAND_POSITION", 2) == [here, here]
    assert bench.seen("FLAG") == 0x20


@pytest.mark.spec("MCP-EXC-3", "MCP-VEL-2")
def test_a_stop_from_the_highest_speed_backwards_is_no_fault_of_the_host() -> None:
    bench = Bench()
    bench.write(0x04, DECEL << 2)
    bench.put("VELOCITY_COMMAND", 0x80)
    bench.put("ACCELERATION", 0x4000)
    bench.write(0x00, 0x0D)
    bench.control()
    bench.samples(3)
    low_pulse(bench, "/STOP", US)
    bench.samples(3)
    assert bench.seen("VELOCITY_COMMAND") == 0
    assert "goal-step" not in bench.rules()


@pytest.mark.spec("MCP-EXC-1", "MCP-MOD-4")
@pytest.mark.parametrize("action", [GO_IDLE, DECEL, ABRUPT])
@pytest.mark.parametrize("source", ["/STOP", "/LIMIT", "breakpoint"])
@pytest.mark.parametrize("cleared", [False, True])
def test_what_happened_in_idle_mode_does_not_act_in_control_mode(
    source: str, action: int, cleared: bool
) -> None:
    bench = Bench()
    bench.write(0x04, action * 0x15)
    if source == "breakpoint":
        bench.put("BREAKPOINT", 0)
        bench.write(0x02, 0x10)
        bench.samples(2)
        assert bench.seen("STATUS") & 0x20 == 0
    else:
        low_pulse(bench, source, US)
    if cleared:
        bench.write(0x07, 0)
        assert bench.seen("STATUS") & 0xE0 == 0xE0
    bench.put("COMMAND_POSITION", 50)
    bench.control()
    bench.samples(2)
    assert (bench.seen("MODE"), bench.seen("COMMAND_POSITION")) == (3, 50)


@pytest.mark.spec("MCP-EXC-2")
def test_velocity_interpolation_ramps_down_over_a_segment_and_stays() -> None:
    bench = Bench()
    bench.write(0x04, DECEL << 2)
    here = moving(bench, velocity_interpolation)
    bench.drive("/STOP", LOW)
    # From 10 in four samples: 7.5, 5, 2.5, 0.
    assert bench.trace("COMMAND_POSITION", 5) == [here + way for way in (7, 12, 15, 15, 15)]
    assert (bench.seen("FLAG"), bench.seen("VELOCITY")) == (0x10, 0)
    bench.drive("/STOP", HIGH)
    bench.put("VELOCITY", 0x000400)
    bench.samples(5)
    assert bench.seen("COMMAND_POSITION") > here + 15


@pytest.mark.spec("MCP-EXC-2")
def test_velocity_interpolation_ramps_down_from_the_middle_of_a_segment() -> None:
    bench = Bench()
    bench.write(0x04, DECEL << 2)
    here = moving(bench, velocity_interpolation, 2)
    bench.drive("/STOP", LOW)
    # Of the four samples up to 10 two are made, to 7.5; from 5 in four more: 3.75, 2.5, 1.25, 0.
    assert bench.trace("COMMAND_POSITION", 5) == [here + way for way in (4, 6, 8, 8, 8)]


@pytest.mark.spec("MCP-EXC-2", "MCP-EXC-5", "MCP-INT-2")
@pytest.mark.parametrize("whole", [True, False])
def test_a_velocity_written_while_the_pin_is_low_is_lost(whole: bool) -> None:
    bench = Bench()
    bench.write(0x04, DECEL << 2)
    moving(bench, velocity_interpolation)
    bench.drive("/STOP", LOW)
    bench.samples(6)
    here = bench.seen("COMMAND_POSITION")
    if whole:
        bench.put("VELOCITY", 0x000400)
    else:
        bench.write(0x24, 0x04)
    assert bench.trace("COMMAND_POSITION", 3) == [here] * 3
    bench.drive("/STOP", HIGH)
    assert bench.trace("COMMAND_POSITION", 3) == [here] * 3
    assert bench.seen("VELOCITY") == 0


@pytest.mark.spec("MCP-EXC-2")
def test_a_velocity_loaded_before_a_deceleration_is_forgotten() -> None:
    bench = Bench()
    bench.write(0x04, DECEL << 2)
    moving(bench, velocity_interpolation, 13)
    bench.put("VELOCITY", 0x000A00)
    assert bench.seen("CAPTURE_CONTROL") & 0x80
    low_pulse(bench, "/STOP", US)
    bench.samples(4)
    here = bench.seen("COMMAND_POSITION")
    assert bench.trace("COMMAND_POSITION", 8) == [here] * 8


@pytest.mark.spec("MCP-EXC-2")
@pytest.mark.parametrize("begin", MODES)
def test_report_action_sets_the_flag_and_nothing_else(begin: Callable[[Bench], None]) -> None:
    bench, other = Bench(), Bench()
    for one in (bench, other):
        one.write(0x04, REPORT)
        moving(one, begin)
    bench.drive("/STOP", LOW)
    bench.drive("/LIMIT", LOW)
    assert bench.trace("COMMAND_POSITION", 5) == other.trace("COMMAND_POSITION", 5)
    assert bench.seen("STATUS") & 0xC0 == 0


@pytest.mark.spec("MCP-EXC-5", "MCP-EXC-1", "MCP-REG-5", "MCP-AMB-7", "MCP-AMB-34")
@pytest.mark.parametrize(
    ("source", "shift"), [("limit", 0), ("stop", 2), ("breakpoint", 4), ("error", 6)]
)
@pytest.mark.parametrize("action", [GO_IDLE, ABRUPT])
def test_every_source_has_its_two_bits(source: str, shift: int, action: int) -> None:
    bench = Bench()
    bench.extended()
    bench.write(0x04, action << shift)
    moving(bench, velocity)
    if source == "limit":
        low_pulse(bench, "/LIMIT", US)
    elif source == "stop":
        low_pulse(bench, "/STOP", US)
    elif source == "breakpoint":
        bench.put("BREAKPOINT", 7)
        bench.samples(1)
        bench.write(0x02, 0x11)
    else:
        bench.put("MAX_ERROR", 3)
        bench.samples(1)
    bench.samples(2)
    if action == GO_IDLE:
        assert bench.pin("IDLE") == 1
    else:
        assert (bench.seen("COMMAND_POSITION"), bench.seen("FLAG")) == (7, 0)


@pytest.mark.spec("MCP-EXC-1")
@pytest.mark.parametrize(
    ("limit", "stop", "outcome"),
    [(GO_IDLE, ABRUPT, "idle"), (DECEL, GO_IDLE, "idle"), (ABRUPT, DECEL, "abrupt"),
     (DECEL, ABRUPT, "abrupt"), (REPORT, DECEL, "decel"), (DECEL, REPORT, "decel")],
)  # fmt: skip
def test_the_strongest_of_several_actions_wins(limit: int, stop: int, outcome: str) -> None:
    bench = Bench()
    bench.write(0x04, limit | stop << 2)
    here = moving(bench, velocity)
    bench.drive("/LIMIT", LOW)
    bench.drive("/STOP", LOW)
    bench.samples(1)
    assert bench.pin("IDLE") == (outcome == "idle")
    assert bench.seen("COMMAND_POSITION") == {"idle": here, "abrupt": 7, "decel": here + 6}[outcome]


@pytest.mark.spec("MCP-EXC-4", "MCP-T-21")
@pytest.mark.parametrize(("pin", "bit"), [("/LIMIT", 0x80), ("/STOP", 0x40)])
def test_a_pin_s_flag_needs_the_pin_high_and_a_write(pin: str, bit: int) -> None:
    bench = Bench()
    bench.write(0x04, REPORT)
    bench.control()
    bench.samples(1)
    low_pulse(bench, pin, US)
    bench.samples(2)
    assert not bench.seen("STATUS") & bit
    bench.write(0x07, 0)
    assert bench.seen("STATUS") & bit
    bench.drive(pin, LOW)
    bench.write(0x07, 0)
    assert not bench.seen("STATUS") & bit


@pytest.mark.spec("MCP-EXC-5")
@pytest.mark.parametrize(("pin", "setting"), [("/STOP", ABRUPT << 2), ("/LIMIT", ABRUPT)])
def test_an_abrupt_stop_repeats_while_the_pin_is_low(pin: str, setting: int) -> None:
    bench = Bench()
    bench.write(0x04, setting)
    moving(bench, position)
    bench.drive(pin, LOW)
    bench.samples(1)
    assert bench.seen("COMMAND_POSITION") == 7
    bench.probe.set_position(9, bench.cycle)
    bench.samples(1)
    assert bench.seen("COMMAND_POSITION") == 9
    bench.drive(pin, HIGH)
    bench.put("COMMAND_POSITION", 77)
    bench.samples(2)
    assert bench.seen("COMMAND_POSITION") == 77


@pytest.mark.spec("MCP-EXC-5", "MCP-EXC-6", "MCP-REG-37", "MCP-EXC-1")
@pytest.mark.parametrize("action", [GO_IDLE, DECEL, ABRUPT])
def test_a_forced_exception_acts_until_it_is_zeroed_and_sets_no_flag(action: int) -> None:
    bench = Bench()
    bench.extended()
    bench.write(0x04, REPORT)
    here = moving(bench, velocity)
    bench.write(0x46, 0xFC | action)
    bench.samples(1)
    assert bench.seen("STATUS") & 0xF8 == 0xF8
    if action == GO_IDLE:
        assert bench.pin("IDLE") == 1
        bench.control()
        bench.samples(2)
        assert bench.pin("IDLE") == 1
        bench.write(0x46, 0)
        bench.control()
        bench.samples(2)
        assert bench.pin("IDLE") == 0
    elif action == DECEL:
        assert bench.seen("COMMAND_POSITION") == here + 6
        bench.put("VELOCITY_COMMAND", 10)
        bench.samples(3)
        assert (bench.seen("COMMAND_POSITION"), bench.seen("VELOCITY_COMMAND")) == (here + 8, 0)
        bench.write(0x46, 0)
        bench.put("VELOCITY_COMMAND", 10)
        bench.samples(1)
        assert bench.seen("COMMAND_POSITION") == here + 12
    else:
        assert (bench.seen("COMMAND_POSITION"), bench.seen("FLAG")) == (7, 0)


@pytest.mark.spec("MCP-EXC-6", "MCP-STA-1")
@pytest.mark.parametrize("source", ["breakpoint", "error", "forced"])
@pytest.mark.parametrize("action", [REPORT, GO_IDLE, DECEL, ABRUPT])
def test_the_handler_sets_the_flags_of_pins_for_no_other_source(source: str, action: int) -> None:
    bench = Bench()
    bench.extended()
    bench.write(0x04, action * 0x50)
    moving(bench, velocity)
    if source == "breakpoint":
        bench.put("BREAKPOINT", 7)
        bench.samples(1)
        bench.write(0x02, 0x11)
    elif source == "error":
        bench.put("MAX_ERROR", 3)
    else:
        bench.write(0x46, action)
    bench.samples(3)
    assert bench.pin("IDLE") == (action == GO_IDLE)
    assert bench.seen("STATUS") & 0xC8 == 0xC8


@pytest.mark.spec("MCP-EXC-4", "MCP-EXC-2", "MCP-RST-4")
@pytest.mark.parametrize(("pin", "bit"), [("/LIMIT", 0x80), ("/STOP", 0x40)])
def test_the_handler_sets_the_flag_of_a_pin_that_is_low_anew(
    bench: Bench, pin: str, bit: int
) -> None:
    bench.drive(pin, LOW)
    for code, idle in ((0x00, 1), (0x03, 0), (0x01, 1)):
        bench.write(0x05, code)
        bench.wait(5000)
        assert (bench.pin("IDLE"), bench.read(0x07) & bit) == (idle, 0)
        bench.write(0x07, 0)
        assert not bench.read(0x07) & bit
        bench.write(0x04, 0)
    bench.drive(pin, HIGH)
    assert not bench.read(0x07) & bit
    bench.write(0x07, 0)
    assert bench.read(0x07) & bit


@pytest.mark.spec("MCP-EXC-2", "MCP-MOD-2", "MCP-RST-4")
@pytest.mark.parametrize("source", ["/LIMIT", "/STOP", "forced"])
def test_the_idle_action_of_the_handler_is_no_reset(bench: Bench, source: str) -> None:
    bench.extended()
    bench.write(0x04, GO_IDLE | GO_IDLE << 2)
    here = moving(bench, velocity)
    bench.put("LEAD_GAIN", 0x21)
    bench.put("MAX_ERROR", 0x7000)
    if source == "forced":
        bench.write(0x46, GO_IDLE)
    else:
        bench.drive(source, LOW)
    start = bench.sample_start()
    bench.until(start)
    # At once, without the 320 clocks of a reset; and the sample timer goes on as it was.
    assert (bench.pin("IDLE"), bench.sample_start()) == (1, start + 4160)
    assert (bench.read(0x04), bench.get("LEAD_GAIN"), bench.get("MAX_ERROR")) == (5, 0x21, 0x7000)
    assert (bench.get("COMMAND_POSITION"), bench.get("ACTUAL_POSITION")) == (here, 7)
    assert bench.read(0x07) & 0xC0 == {"/LIMIT": 0x40, "/STOP": 0x80, "forced": 0xC0}[source]


@pytest.mark.spec("MCP-EXC-6")
def test_a_forced_exception_of_zero_does_nothing() -> None:
    bench = Bench()
    bench.extended()
    here = moving(bench, velocity)
    bench.write(0x46, 0xFC)
    bench.samples(2)
    assert bench.seen("COMMAND_POSITION") == here + 20


@pytest.mark.spec("MCP-EXC-7")
def test_a_pin_is_acted_on_within_one_sample() -> None:
    bench = Bench()
    bench.write(0x04, ABRUPT << 2)
    moving(bench, position)
    start = bench.sample_start()
    # A pulse just after the start of this sample was looked at waits for the next one.
    bench.until(start + 1)
    low_pulse(bench, "/STOP", US)
    bench.until(start + 4160 - 1)
    assert bench.seen("COMMAND_POSITION") == 50
    bench.until(start + 4160 + 1000)
    assert bench.seen("COMMAND_POSITION") == 7


@pytest.mark.spec("MCP-EXC-7", "MCP-MOD-4")
def test_limit_in_idle_acts_at_once() -> None:
    bench = Bench()
    bench.write(0x08, 0xFF)
    bench.wait_ps(777)
    bench.drive("/LIMIT", LOW)
    assert (bench.pin("MC0-MC11"), bench.seen("STATUS")) == (0x800, 0x78)


@pytest.mark.spec("MCP-AMB-29", "MCP-AMB-34")
def test_the_manual_s_way_off_a_limit() -> None:
    bench = Bench(plant=Rail())
    moving(bench, velocity)
    bench.drive("/LIMIT", LOW)
    bench.samples(2)
    assert bench.pin("IDLE") == 1
    bench.write(0x04, 0x08)
    bench.write(0x00, 0x05)
    bench.put("VELOCITY_COMMAND", 0xFB)
    bench.put("COMMAND_POSITION", 7)
    bench.control()
    bench.write(0x00, 0x0D)
    bench.samples(5)
    assert bench.seen("COMMAND_POSITION") < 0
    bench.write(0x07, 0)
    assert not bench.seen("STATUS") & 0x80
    bench.drive("/LIMIT", HIGH)
    bench.write(0x07, 0)
    assert bench.seen("STATUS") & 0x80
    bench.write(0x04, 0x09)
    bench.samples(3)
    assert bench.pin("IDLE") == 0
