"""Rules for what a driver does: each with its mistake, and with what looks like it and is right."""

import pytest

from tests.conformance.mcp1200.conftest import Bench, Follower, Rail, low_pulse
from vbus.chips.mcp1200 import datasheet as ds

F0, PID, FINE, STEPS = 0x08, 0x08, 0x20, 0x02


def found(bench: Bench) -> list[tuple[str, str]]:
    """Return the rules broken so far, each with its severity."""
    bench.chip.advance()
    return [(v.rule.partition(".")[2], v.severity) for v in bench.violations]


def left(bench: Bench) -> list[tuple[str, str]]:
    """Return what a run that ended now would leave."""
    return [(rule.name.partition(".")[2], text) for rule, text in bench.chip.left_over()]


@pytest.fixture
def away() -> Bench:
    """A chip in idle mode whose axis stands at 1000 counts."""
    bench = Bench(plant=Follower())
    bench.put("PRESET_POSITION", 1000)
    return bench


# -- addresses and values -------------------------------------------------------------------------


@pytest.mark.spec("MCP-BUS-9")
@pytest.mark.parametrize(("register", "hit"), [(0x61, "R21"), (0x63, "R23"), (0x49, "R09")])
def test_an_extended_register_without_extended_addressing_is_found(bench, register, hit):
    bench.write(register, 0x20)
    assert found(bench) == [("extended-off", "warning")]
    assert bench.violations[0].detail == (f"R{register:02X} = 20H goes to {hit}: bit 0 of R02 is 0")
    assert bench.read(int(hit[1:], 16)) == 0x20


@pytest.mark.spec("MCP-BUS-9")
def test_extended_addressing_is_what_the_rule_asks_for(bench):
    bench.extended()
    bench.write(0x61, 0x20)
    bench.write(0x02, 0x00)
    bench.write(0x21, 0x20)
    assert found(bench) == []


@pytest.mark.spec("MCP-BUS-9")
def test_reading_with_six_address_bits_is_no_mistake(bench):
    assert bench.read(0x47) == bench.read(0x07)
    assert found(bench) == []


@pytest.mark.spec("MCP-REG-26", "MCP-REG-25", "MCP-REG-18")
@pytest.mark.parametrize(("register", "most"), [(0x28, 0x7F), (0x27, 0x7F), (0x18, 0x07)])
def test_a_value_beyond_what_the_manual_lists_is_found(bench, register, most):
    bench.write(register, most)
    assert found(bench) == []
    bench.write(register, most + 1)
    assert found(bench) == [("range", "warning")]
    assert f"lists 00H to {most:02X}H" in bench.violations[0].detail


@pytest.mark.spec("MCP-OUT-1")
@pytest.mark.parametrize(
    ("limit", "forceless"), [(0x7F, True), (0x80, True), (0x81, False), (0, False)]
)
def test_a_saturation_limit_that_gives_no_force_is_found(bench, limit, forceless):
    bench.extended()
    bench.write(0x4B, limit)
    assert found(bench) == ([("no-force", "warning")] if forceless else [])


# -- entering control -----------------------------------------------------------------------------


@pytest.mark.spec("MCP-MOD-6")
def test_control_at_an_old_command_position_is_found(away):
    away.control()
    away.samples()
    assert found(away) == [("jump", "warning")]
    assert away.violations[0].detail == "control begins at 1000 counts, and R0C to R0E have 0"


@pytest.mark.spec("MCP-MOD-6")
@pytest.mark.parametrize("command", [1000, 0])
def test_a_command_position_that_the_host_has_written_is_meant(away, command):
    away.put("COMMAND_POSITION", command)
    away.control()
    away.samples()
    assert found(away) == []


@pytest.mark.spec("MCP-MOD-6")
def test_a_small_drift_in_idle_mode_is_no_mistake(bench):
    bench.put("PRESET_POSITION", 127)
    bench.control()
    bench.samples()
    assert found(bench) == []


@pytest.mark.spec("MCP-MOD-6", "MCP-STP-1")
def test_steps_toward_an_old_command_position_are_found_and_need_no_gain(bench):
    bench.write(0x02, STEPS)
    bench.write(0x22, 0)
    bench.put("PRESET_POSITION", 128)
    bench.control()
    bench.samples()
    assert ("jump", "warning") in found(bench)
    assert ("no-gain", "warning") not in found(bench)


@pytest.mark.spec("MCP-MOD-6")
def test_control_entered_anew_wants_the_command_position_anew(away):
    away.put("COMMAND_POSITION", 1000)
    away.control()
    away.samples(2)
    away.write(0x05, 0x01)
    away.samples(2)
    away.put("PRESET_POSITION", 0)
    away.control()
    away.samples()
    assert found(away) == [("jump", "warning")]


@pytest.mark.spec("MCP-FLT-3")
def test_control_with_all_gains_0_is_found(bench):
    bench.extended()
    bench.write(0x01, PID)
    bench.write(0x61, 0, 0, 0)
    bench.control()
    bench.samples()
    assert found(bench) == [("no-gain", "warning")]
    assert bench.violations[0].measured == 0


@pytest.mark.spec("MCP-FLT-2")
def test_control_with_a_lead_filter_of_gain_0_is_found(bench):
    bench.write(0x22, 0)
    bench.control()
    bench.samples()
    assert found(bench) == [("no-gain", "warning")]


@pytest.mark.spec("MCP-FLT-3")
def test_an_integral_gain_that_its_limit_cuts_to_0_all_the_time_is_none(bench):
    bench.extended()
    bench.write(0x01, PID)
    bench.write(0x61, 1, 0x20, 0)
    bench.put("INTEGRAL_LIMIT", 0)
    assert left(bench) == [], "control has not begun"
    bench.control()
    bench.samples()
    assert found(bench) == []
    text = "control has begun with Ki 32, and R66:R65 have been 0 ever since"
    assert left(bench) == [("no-integral", text)]
    bench.put("DEADBAND", 1)
    assert left(bench) == [("no-integral", text)]
    bench.put("INTEGRAL_LIMIT", 0x100)
    bench.put("INTEGRAL_LIMIT", 0)
    assert left(bench) == [], "it may be turned off again"


@pytest.mark.spec("MCP-FLT-3")
def test_an_integral_gain_that_is_taken_back_needs_no_limit(bench):
    bench.extended()
    bench.write(0x01, PID)
    bench.write(0x61, 1, 0x20, 0)
    bench.put("INTEGRAL_LIMIT", 0)
    bench.control()
    bench.samples()
    bench.write(0x62, 0)
    assert left(bench) == []


@pytest.mark.spec("MCP-REG-2")
@pytest.mark.parametrize(("feature", "noted"), [(0, True), (PID, False)])
def test_gains_of_the_pid_filter_beside_the_lead_filter_are_noted(bench, feature, noted):
    bench.extended()
    bench.write(0x01, feature)
    bench.write(0x61, 5, 0, 5)
    bench.control()
    bench.samples()
    assert found(bench) == ([("pid-unused", "note")] if noted else [])


@pytest.mark.spec("MCP-REG-2")
@pytest.mark.parametrize(("lead", "rules"), [(False, [("other-filter", "warning")]), (True, [])])
def test_a_mode_with_the_filter_that_was_not_tuned_is_found(bench, lead, rules):
    bench.extended()
    bench.write(0x61, 5, 0, 5)
    if lead:
        bench.write(0x22, 0x20)
    bench.control()
    bench.samples()
    bench.put("ACCELERATION", 0x100)
    bench.write(0x00, 0x0D)
    assert found(bench)[1:] == rules


@pytest.mark.spec("MCP-REG-2")
@pytest.mark.parametrize("own", [False, True])
@pytest.mark.parametrize("config", [0x01, 0x01 | STEPS])
def test_the_pid_filter_with_only_the_lead_filter_tuned_is_found(bench, own, config):
    bench.write(0x02, config)
    bench.write(0x01, PID)
    bench.write(0x22, 0x20)
    if own:
        bench.write(0x61, 0x40, 0, 0x40)  # as after a reset, and meant
    bench.control()
    bench.samples()
    bench.put("ACCELERATION", 0x100)
    bench.write(0x00, 0x0D)
    wrong = not own and not config & STEPS
    assert found(bench) == ([("other-filter", "warning")] if wrong else [])
    if wrong:
        assert bench.violations[0].detail == (
            "F5 is set with R20 to R22 written, and the PID filter runs as the reset has left it"
        )


@pytest.mark.spec("MCP-FLT-3", "MCP-FLT-4")
@pytest.mark.parametrize("gain", ["KP", "KI", "KD", "KV", "KA"])
def test_one_gain_is_enough_also_one_of_feed_forward(bench, gain):
    bench.extended()
    bench.write(0x01, PID)
    bench.write(0x61, 0, 0, 0)
    bench.put(gain, 1)
    bench.control()
    bench.samples()
    assert found(bench) == []


@pytest.mark.spec("MCP-MOD-1")
def test_a_mode_that_the_next_replaces_is_found(bench):
    bench.control()
    bench.samples(2)
    bench.write(0x05, 0x01)
    bench.write(0x05, 0x03)
    bench.samples()
    assert found(bench) == [("mode-lost", "warning")]
    assert bench.violations[0].detail == ("R05 = 03 comes before the sample that obeys R05 = 01")
    assert bench.read(0x05) == 0x03


@pytest.mark.spec("MCP-MOD-1", "MCP-MOD-7")
def test_a_halt_before_control_has_begun_is_found(bench):
    bench.control()
    bench.write(0x05, 0x02)
    bench.samples(2)
    assert found(bench) == [("mode-lost", "warning")]
    assert bench.read(0x05) == 0x01


@pytest.mark.spec("MCP-MOD-1")
@pytest.mark.parametrize("modes", [(1, 0), (2, 1), (2, 0), (3, 3), (1, 1), (3, 1), (3, 0)])
def test_the_stronger_of_two_modes_within_a_sample_is_no_mistake(bench, modes):
    bench.control()
    bench.samples(2)
    for mode in modes:
        bench.write(0x05, mode)
    bench.samples(2)
    assert found(bench) == []


# -- profiles -------------------------------------------------------------------------------------


@pytest.fixture
def ready(bench: Bench) -> Bench:
    """A chip in control, with rates and a way to go."""
    bench.put("ACCELERATION", 0x100)
    bench.put("PROFILE_VELOCITY", 4)
    bench.put("FINAL_POSITION", 200)
    bench.control()
    return bench


@pytest.mark.spec("MCP-FLG-4", "MCP-FLG-1", "MCP-FLG-2", "MCP-REG-1")
def test_a_flag_set_before_control_is_noted(ready):
    ready.write(0x00, F0)
    assert ready.read(0x00) & 0x04 == 0, "a host that polls for the fall of F2 thinks it is over"
    assert found(ready) == [("flag-before-control", "note")]


@pytest.mark.spec("MCP-FLG-4")
def test_a_flag_set_in_control_or_long_before_is_right(ready):
    ready.samples()
    ready.write(0x00, F0)
    assert ready.read(0x00) & 0x04
    ready.write(0x05, 0x01)
    ready.samples()
    ready.write(0x00, 0x00)
    ready.write(0x00, F0)
    ready.control()
    ready.samples()
    assert found(ready) == []


@pytest.mark.spec("MCP-TRP-1")
@pytest.mark.parametrize("fine", [False, True])
def test_a_velocity_in_the_register_of_the_other_resolution_is_found(bench, fine):
    bench.put("ACCELERATION", 0x100)
    bench.write(0x01, FINE if fine else 0)
    bench.put("PROFILE_VELOCITY" if fine else "VELOCITY", 4)
    bench.put("FINAL_POSITION", 200)
    bench.control()
    bench.samples()
    bench.write(0x00, F0)
    bench.samples(3)
    assert found(bench) == [("other-velocity", "warning")]
    assert bench.seen("COMMAND_POSITION") == 0


@pytest.mark.spec("MCP-TRP-1")
@pytest.mark.parametrize("fine", [False, True])
def test_a_velocity_in_both_registers_is_right(bench, fine):
    bench.put("ACCELERATION", 0x100)
    bench.write(0x01, FINE if fine else 0)
    bench.put("PROFILE_VELOCITY", 4)
    bench.put("FINAL_POSITION", 200)
    bench.put("VELOCITY", 0x400)
    bench.control()
    bench.samples()
    bench.write(0x00, F0)
    assert found(bench) == []


@pytest.mark.spec("MCP-TRP-5")
@pytest.mark.parametrize(("name", "what"), [("ACCELERATION", 0), ("PROFILE_VELOCITY", 0)])
def test_a_profile_that_waits_for_its_rates_is_noted(ready, name, what):
    ready.samples()
    ready.put(name, what)
    ready.write(0x00, F0)
    assert found(ready) == [("no-rate", "note")]
    assert ready.violations[0].measured == 0


@pytest.mark.spec("MCP-TRP-1", "MCP-REG-27")
def test_a_profile_started_before_its_position_is_whole_is_found(ready):
    ready.samples()
    ready.write(0x29, 0x34)
    ready.write(0x2A, 0x12)
    ready.write(0x00, F0)
    ready.write(0x2B, 0x01)
    assert found(ready) == [("part-position", "note"), ("split-position", "warning")]
    assert "of the final position R2B stayed as before" in ready.violations[0].detail


@pytest.mark.spec("MCP-TRP-1", "MCP-REG-27", "MCP-TRP-6")
def test_a_final_position_changed_as_a_whole_under_way_is_right(ready):
    ready.samples()
    for number in (3000, 4000, 5000):
        ready.put("FINAL_POSITION", number)
        ready.write(0x00, F0)
        ready.samples(2)
    ready.put("FINAL_POSITION", 6000)
    ready.write(0x00, F0)
    assert found(ready) == []


@pytest.mark.spec("MCP-REG-27")
def test_a_final_position_of_which_one_byte_is_written_is_noted_and_no_more(ready):
    ready.samples()
    ready.write(0x00, F0)
    ready.samples(400)
    ready.write(0x29, 5)
    ready.write(0x00, F0)
    ready.write(0x29, 6)
    ready.write(0x2A, 1)
    ready.write(0x2B, 0)
    assert found(ready) == [("part-position", "note")]


@pytest.mark.spec("MCP-TRP-5")
def test_a_profile_without_a_way_to_go_is_noted(ready):
    ready.samples()
    ready.write(0x00, F0)
    ready.samples(400)
    ready.write(0x00, F0)
    ready.samples(2)
    ready.put("FINAL_POSITION", 0)
    assert found(ready) == [("no-way", "note")]


@pytest.mark.spec("MCP-TRP-1")
@pytest.mark.parametrize(("where", "rules"), [(5, ["split-position"]), (200, [])])
def test_a_final_position_written_just_after_the_flag_is_found(ready, where, rules):
    ready.samples()
    ready.write(0x00, F0)
    ready.samples(400)
    ready.write(0x00, F0)
    ready.put("FINAL_POSITION", where)
    assert [rule for rule, _ in found(ready)] == ["no-way", *rules]


@pytest.mark.spec("MCP-TRP-5")
def test_a_final_position_written_where_the_axis_stands_is_right(ready):
    ready.samples()
    ready.put("FINAL_POSITION", 0)
    ready.write(0x00, F0)
    assert found(ready) == []


# -- the counter ----------------------------------------------------------------------------------


@pytest.mark.spec("MCP-REG-17", "MCP-REG-16")
@pytest.mark.parametrize("way", ["preset", "clear"])
def test_a_counter_set_in_a_closed_loop_is_noted(away, way):
    away.put("COMMAND_POSITION", 1000)
    away.control()
    away.samples(2)
    if way == "clear":
        away.write(0x13, 0)
    else:
        away.put("PRESET_POSITION", 0)
    assert found(away) == [("preset-in-control", "note")]
    assert away.violations[0].detail == (
        "the counter is set from 1000 to 0 while the loop is closed"
    )
    assert away.violations[0].measured == -1000


@pytest.mark.spec("MCP-REG-17")
def test_a_counter_set_in_idle_mode_or_to_where_it_is_is_right(away):
    away.put("PRESET_POSITION", 3000)
    away.put("COMMAND_POSITION", 3000)
    away.control()
    away.samples(2)
    away.put("PRESET_POSITION", 3000)
    assert found(away) == []


# -- the end of a run -----------------------------------------------------------------------------


@pytest.mark.spec("MCP-STA-2")
def test_errors_that_stand_at_the_end_are_noted():
    bench = Bench(plant=Rail())
    assert left(bench) == []
    bench.drive("/STOP", 0)
    bench.control()
    bench.samples(2)
    assert left(bench) == [
        ("errors-stand", "in R07 these are 0 at the end, and mean errors: STOP_OK")
    ]
    bench.drive("/STOP", 1)
    bench.samples(1)
    bench.write(0x07, 0)
    assert left(bench) == []


# -- values of several bytes ----------------------------------------------------------------------


@pytest.mark.spec("MCP-REG-25", "MCP-REG-38")
@pytest.mark.parametrize(
    ("register", "missing"), [(0x26, "ACCELERATION R27"), (0x49, "MAX_ERROR R4A")]
)
def test_a_value_that_is_never_written_as_a_whole_is_noted(bench, register, missing):
    bench.extended()
    bench.write(register, 0x10)
    name, byte = missing.split()
    assert left(bench) == [("part-value", f"of {name} {byte} have not been written since a reset")]
    bench.write(register + 1, 0)
    assert left(bench) == []


@pytest.mark.spec("MCP-REG-13", "MCP-REG-17")
@pytest.mark.parametrize(("msb", "last"), [(0x0C, "R0E"), (0x15, "R17")])
def test_bytes_that_the_last_one_has_not_loaded_are_noted(bench, msb, last):
    bench.write(msb + 2, 1)
    bench.write(msb + 1, 2)
    bench.write(msb, 3)
    names = f"R{msb:02X} and R{msb + 1:02X}"
    assert left(bench) == [("left-held", f"{names} wait for a byte written to {last}")]
    bench.write(msb + 2, 1)
    assert left(bench) == []


@pytest.mark.spec("MCP-REG-16")
def test_an_actual_position_read_highest_byte_first_is_noted_once(bench):
    for _ in range(2):
        for address in (0x12, 0x13, 0x14):
            bench.read(address)
    assert found(bench) == [("stale-read", "note")]


@pytest.mark.spec("MCP-REG-16")
@pytest.mark.parametrize(
    ("order", "rules"),
    [
        ((0x12, 0x13, 0x14), [("stale-position", "warning")]),
        ((0x11, 0x12, 0x13, 0x14), []),  # a dump
        ((0x14, 0x12, 0x13, 0x14), []),
        ((0x14, 0x13, 0x12), []),
    ],
)
def test_a_position_made_of_two_instants_is_found(away, order, rules):
    away.read(0x14)
    away.put("PRESET_POSITION", -5)
    for address in order:
        away.read(address)
    assert found(away) == rules


@pytest.mark.spec("MCP-REG-13", "MCP-REG-17")
@pytest.mark.parametrize(("last", "rules"), [(False, [("held-at-control", "warning")]), (True, [])])
@pytest.mark.parametrize("msb", [0x0C, 0x15])
def test_bytes_held_when_control_begins_are_found(bench, msb, last, rules):
    for address in (msb + 2, msb + 1, msb, msb + 2)[: 4 if last else 3]:
        bench.write(address, 0)
    bench.control()
    bench.samples()
    assert found(bench) == rules


@pytest.mark.spec("MCP-CAP-2")
@pytest.mark.parametrize(
    ("control", "order", "rules"),
    [
        (0x00, (0x30, 0x2F, 0x2E), [("no-capture", "warning")]),
        (0x10, (0x30, 0x2F, 0x2E), []),
        (0x00, (0x2D, 0x2E, 0x2F, 0x30), []),  # a dump
    ],
)
def test_a_capture_that_is_not_enabled_is_found_where_it_is_read(bench, control, order, rules):
    bench.write(0x03, control)
    bench.put("PRESET_POSITION", 7)
    low_pulse(bench, "INDEX", 8_000_000)
    assert bench.read(0x03) & 0x08
    bench.write(0x03, 0x08)  # off, and the latch stays
    for address in order:
        bench.read(address)
    assert found(bench) == rules


@pytest.mark.spec("MCP-REG-16")
def test_an_actual_position_read_lowest_byte_first_is_right(bench):
    for address in (0x14, 0x13, 0x12, 0x14, 0x12, 0x13):
        bench.read(address)
    assert found(bench) == []


# -- modes and interpolation ----------------------------------------------------------------------


@pytest.mark.spec("MCP-MOD-8")
def test_a_mode_flag_set_beside_another_is_found(ready):
    ready.samples()
    ready.write(0x00, 0x0D)
    ready.write(0x00, F0)
    assert found(ready) == [("two-modes", "warning")]
    assert ready.violations[0].detail == "F0 is set beside F5"


@pytest.mark.spec("MCP-MOD-8")
def test_a_mode_flag_set_after_the_other_was_cleared_is_right(ready):
    ready.samples()
    ready.write(0x00, 0x0D)
    ready.write(0x00, 0x05)
    ready.write(0x00, F0)
    ready.write(0x00, F0)
    assert found(ready) == []


@pytest.mark.spec("MCP-VEL-3")
@pytest.mark.parametrize(("ends", "rules"), [(False, [("cleared-at-speed", "note")]), (True, [])])
def test_a_velocity_mode_left_at_speed_is_noted(bench, ends, rules):
    bench.put("ACCELERATION", 0x400)
    bench.control()
    bench.samples()
    bench.put("VELOCITY_COMMAND", 4)
    bench.write(0x00, 0x0D)
    bench.samples(4)
    if ends:
        bench.put("VELOCITY_COMMAND", 0)
        bench.samples(4)
    bench.write(0x00, 0x05)
    assert found(bench) == rules


@pytest.mark.spec("MCP-VEL-3")
@pytest.mark.parametrize(
    ("samples", "rules"), [(2, [("ramp-cut", "warning")]), (8, [("cleared-at-speed", "note")])]
)
def test_a_ramp_down_cut_short_is_found_and_its_last_count_is_not(bench, samples, rules):
    bench.put("ACCELERATION", 0x100)
    bench.control()
    bench.samples()
    bench.put("VELOCITY_COMMAND", 10)
    bench.write(0x00, 0x0D)
    bench.samples(20)
    bench.put("VELOCITY_COMMAND", 0)
    bench.samples(samples)
    bench.write(0x00, 0x05)
    assert found(bench) == rules


@pytest.mark.spec("MCP-REG-9", "MCP-REG-10")
@pytest.mark.parametrize("register", [0x08, 0x09, 0x4C, 0x4D])
def test_a_motor_command_written_in_control_is_found(bench, register):
    bench.extended()
    bench.write(register, 0x90)
    bench.write(register, 0x80 if register == 0x08 else 0)
    bench.control()
    bench.samples()
    assert found(bench) == []
    bench.write(register, 0x90)
    assert found(bench) == [("output-in-control", "warning")]


@pytest.mark.spec("MCP-REG-9", "MCP-REG-10")
def test_a_motor_command_of_idle_mode_that_is_left_is_noted(bench):
    bench.write(0x09, 20)
    assert left(bench) == [("output-left", "in idle mode at the end R08 is 80H, R09 14H")]
    assert found(bench) == []
    bench.control()
    bench.samples()
    assert found(bench) == [("output-left", "note")]
    assert left(bench) == []


# -- registers of another kind -------------------------------------------------------------------


@pytest.mark.spec("MCP-REG-16")
@pytest.mark.parametrize(
    ("register", "rules"), [(0x12, 2), (0x14, 2), (0x06, 2), (0x2E, 2), (0x34, 2), (0x13, 0)]
)
def test_a_byte_for_a_register_that_can_only_be_read_is_found(bench, register, rules):
    bench.write(register, 0)
    bench.write(register, 1)
    assert found(bench) == [("read-only", "warning")] * rules


@pytest.mark.spec("MCP-RST-5")
@pytest.mark.parametrize("control", [False, True])
@pytest.mark.parametrize("wait", [False, True])
def test_a_byte_that_comes_before_a_reset_is_over_is_found(bench, control, wait):
    if control:
        bench.control()
        bench.samples(2)
    bench.write(0x05, 0x00)
    if wait:
        bench.samples(2)
        assert bench.read(0x00) & 0x02
    bench.write(0x20, 0x12)
    assert found(bench) == ([] if wait else [("reset-write", "warning")])


@pytest.mark.spec("MCP-REG-20", "MCP-REG-6")
@pytest.mark.parametrize(
    ("register", "data", "right"),
    [(0x1A, 0xF8, True), (0x1A, 0x09, False), (0x05, 0x03, True), (0x05, 0x04, False)],
)
def test_a_number_that_the_manual_does_not_list_is_found(bench, register, data, right):
    bench.write(register, data)
    assert found(bench) == ([] if right else [("range", "warning")])


@pytest.mark.spec("MCP-CAP-2")
@pytest.mark.parametrize(("data", "right"), [(0x02, False), (0x06, True), (0x10, True)])
def test_a_capture_by_a_trig_that_is_an_output_is_found(bench, data, right):
    bench.write(0x03, data)
    assert found(bench) == ([] if right else [("trig-output", "warning")])


@pytest.mark.spec("MCP-REG-2", "MCP-FLT-6")
@pytest.mark.parametrize(
    ("closed", "lead", "right"), [(True, False, False), (False, False, True), (True, True, True)]
)
def test_a_filter_that_gives_way_to_one_of_the_reset_is_found(bench, closed, lead, right):
    bench.write(0x01, PID)
    if lead:
        bench.write(0x22, 0x20)
    if closed:
        bench.control()
        bench.samples()
    bench.write(0x01, PID | FINE)
    assert found(bench) == []
    bench.write(0x01, FINE)
    assert found(bench) == ([] if right else [("filter-changed", "warning")])


@pytest.mark.spec("MCP-POS-1")
def test_an_increment_that_the_next_one_replaces_is_found(bench):
    bench.control()
    for _ in range(2):
        bench.samples()
        bench.write(0x0B, 5)
    assert found(bench) == []
    bench.write(0x0B, 6)
    assert found(bench) == [("increment-lost", "warning")]


@pytest.mark.spec("MCP-POS-1")
def test_an_increment_for_later_is_noted(ready):
    ready.samples()
    ready.write(0x00, 0x0D)
    ready.samples(2)
    ready.write(0x0B, 5)
    assert ("increment-waits", "note") in found(ready)


@pytest.mark.spec("MCP-TRP-6")
@pytest.mark.parametrize("phase", [4, 6])
def test_a_final_position_that_comes_too_late_for_its_profile_is_noted(ready, phase):
    ready.samples()
    ready.write(0x00, F0)
    while ready.read(0x06) != phase:
        ready.samples()
    ready.put("FINAL_POSITION", 5000)
    assert found(ready) == ([("late-position", "note")] if phase == 6 else [])


@pytest.mark.spec("MCP-ERR-2")
@pytest.mark.parametrize(
    ("limit", "config", "noted"), [(0xFFFF, 0x01, True), (400, 0x01, False), (0xFFFF, 0x03, False)]
)
def test_an_action_without_a_limit_of_the_error_is_noted_at_the_end(bench, limit, config, noted):
    bench.write(0x02, config)
    bench.put("MAX_ERROR", limit)
    bench.write(0x04, 0x49)
    text = "R04 = 49H has an action, and R4A:R49 are FFFFH"
    assert left(bench) == ([("no-max-error", text)] if noted else [])


@pytest.mark.spec("MCP-TRP-5", "MCP-VEL-1")
@pytest.mark.parametrize("acceleration", [0, 1])
def test_a_velocity_without_an_acceleration_is_noted(bench, acceleration):
    bench.control()
    bench.samples()
    bench.put("ACCELERATION", acceleration)
    bench.write(0x00, 0x0D)
    assert found(bench) == ([] if acceleration else [("no-rate", "note")])


@pytest.mark.spec("MCP-INT-6")
def test_an_interpolation_that_is_over_and_not_left_is_noted_at_the_end(bench):
    bench.control()
    bench.samples()
    bench.put("FINAL_POSITION", 10)
    bench.write(0x00, 0x0B)
    bench.samples(10)
    assert left(bench) == [("flag-left", "at the end the axis stands, and has F3")]
    bench.write(0x00, 0x03)
    assert left(bench) == []


@pytest.mark.spec("MCP-INT-2")
@pytest.mark.parametrize("order", [(0x2B, 0x2A, 0x29), (0x29, 0x2A, 0x2B), (0x2A, 0x2B, 0x29)])
def test_a_point_whose_bytes_come_after_the_last_one_is_found(bench, order):
    bench.control()
    bench.samples()
    right = order[-1] == 0x29
    for point in (10, 300, 600):
        while bench.read(0x03) & 0x80:
            bench.samples()
        for register in order:
            bench.write(register, point >> 8 * (register - 0x29) & 0xFF)
        bench.write(0x00, 0x0B)
    rules = [rule for rule, _ in found(bench)]
    assert rules == ([] if right else ["early-point"] * len(rules))
    assert right or rules


@pytest.mark.spec("MCP-REG-2")
@pytest.mark.parametrize(("feature", "noted"), [(0, True), (0x10, False)])
def test_a_jerk_beside_a_trapezoid_is_noted_once(ready, feature, noted):
    ready.extended()
    ready.put("JERK", 0x4000)
    ready.write(0x01, feature)
    ready.samples()
    for _ in range(2):
        ready.write(0x00, F0)
        ready.samples(200)
        ready.put("FINAL_POSITION", 0)
    assert found(ready) == ([("jerk-unused", "note")] if noted else [])


@pytest.mark.spec("MCP-INT-2")
@pytest.mark.parametrize("wait", [False, True])
def test_a_point_written_before_the_one_before_was_taken_is_found(bench, wait):
    bench.control()
    bench.samples()
    bench.put("FINAL_POSITION", 10)
    bench.write(0x00, 0x0B)
    for point in (20, 30):
        while wait and bench.read(0x03) & 0x80:
            bench.samples()
        bench.put("FINAL_POSITION", point)
    assert found(bench) == ([] if wait else [("point-lost", "warning")] * 2)


@pytest.mark.spec("MCP-INT-2")
@pytest.mark.parametrize(
    ("flag", "name", "rules"),
    [
        (0x0C, "FINAL_POSITION", ["other-point"]),
        (0x0B, "VELOCITY", ["other-point"]),
        (0x0C, "VELOCITY", []),
    ],
)
def test_a_point_for_the_other_interpolation_is_found(bench, flag, name, rules):
    bench.control()
    bench.samples()
    bench.write(0x00, flag)
    bench.put(name, 10)
    assert [rule for rule, _ in found(bench)] == rules


@pytest.mark.spec("MCP-MOD-9")
def test_a_mode_flag_that_stands_in_idle_mode_is_noted_at_the_end(ready):
    ready.samples()
    ready.write(0x00, 0x0B)
    ready.samples(2)
    assert left(ready) == []
    ready.write(0x05, 0x01)
    ready.samples(2)
    assert left(ready) == [("flag-left", "in idle mode at the end: F3")]
    ready.write(0x00, 0x03)
    assert left(ready) == []


@pytest.mark.spec("MCP-RST-5")
def test_a_byte_in_the_reset_at_power_on_has_a_hint(bench):
    late = 320 * bench.chip.clock.span_up(1) + 1
    assert 'power_on = "done"' in bench.chip.hint("mcp1200.reset-write", 1)
    assert bench.chip.hint("mcp1200.reset-write", late) == ""
    assert bench.chip.hint("mcp1200.range", 1) == ""


@pytest.mark.spec("MCP-EXC-8")
@pytest.mark.parametrize(
    ("pin", "taken_back", "rule", "was"),
    [("/LIMIT", 0x08, "limit-unguarded", "idle"), ("/STOP", 0x01, "stop-unguarded", "decelerate")],
)
def test_an_action_taken_back_on_a_switch_is_put_back(bench, pin, taken_back, rule, was):
    bench.control()
    bench.samples()
    bench.drive(pin, 0)
    bench.samples()
    bench.write(0x04, taken_back)
    bench.drive(pin, 1)
    bench.write(0x07, 0)
    bench.samples()
    text = f"R04 = {taken_back:02X}H only reports {pin} since it was left: {was} stood there"
    assert left(bench) == [(rule, text)]
    severities = {one.name: one.severity for one in ds.RULES}
    assert severities[f"mcp1200.{rule}"] == ("warning" if pin == "/LIMIT" else "note")
    bench.write(0x04, 0x0A)
    assert left(bench) == []


@pytest.mark.spec("MCP-EXC-8")
def test_an_action_that_is_not_wanted_is_none_that_was_taken_back(bench):
    bench.drive("/LIMIT", 0)
    bench.write(0x04, 0x08)  # an axis is set up on its switch
    bench.drive("/LIMIT", 1)
    bench.write(0x07, 0)
    assert left(bench) == []
    bench.control()
    bench.samples()
    bench.write(0x04, 0x09)
    bench.write(0x04, 0x08)  # away from the switch
    assert left(bench) == []
    bench.write(0x04, 0x09)
    bench.drive("/LIMIT", 0)
    bench.samples()
    bench.write(0x04, 0x08)
    bench.drive("/LIMIT", 1)
    bench.write(0x05, 0)  # a soft reset puts the action back
    bench.samples(2)
    assert left(bench) == []
    bench.write(0x04, 0x08)
    assert left(bench) == []


# -- resets ---------------------------------------------------------------------------------------


@pytest.mark.spec("MCP-RST-4")
@pytest.mark.parametrize(
    ("register", "value", "lost"), [(0x0F, 0x3B, True), (0x0F, 0x40, False), (0x1B, 0x20, False)]
)
def test_a_setting_that_a_soft_reset_has_undone_before_it_served_is_found(
    bench, register, value, lost
):
    bench.write(register, value)
    bench.write(0x05, 0)
    bench.samples(2)
    bench.control()
    bench.samples()
    assert found(bench) == ([("lost-in-reset", "warning")] if lost else [])
    if lost:
        assert bench.violations[0].detail == (
            "control begins with R0F as a soft reset has left them: they were written before it,"
            " and not since"
        )


@pytest.mark.spec("MCP-RST-4")
@pytest.mark.parametrize("how", ["again", "served", "in control"])
def test_a_setting_that_has_served_or_is_written_again_may_be_lost_in_a_reset(bench, how):
    if how != "in control":
        bench.write(0x22, 0x20)
    if how != "again":
        bench.control()
        bench.samples()
        bench.write(0x22, 0x30)
    bench.write(0x05, 0)
    bench.samples(3)
    if how == "again":
        bench.write(0x22, 0x20)
    bench.control()
    bench.samples()
    assert found(bench) == []


@pytest.mark.spec("MCP-BRK-2", "MCP-BRK-3")
@pytest.mark.parametrize("waits", [False, True])
def test_a_first_breakpoint_that_no_sample_has_loaded_is_found(bench, waits):
    bench.write(0x02, 0x10)
    bench.put("BREAKPOINT", 15000)
    if waits:
        bench.samples(2)
    bench.write(0x02, 0x30)
    bench.put("BREAKPOINT", 2500)
    assert found(bench) == ([] if waits else [("breakpoint-lost", "warning")])
    if not waits:
        text = "repeat mode is chosen before a sample has loaded the breakpoint 15000"
        assert bench.violations[0].detail == f"{text}: it stays at -8388608"


@pytest.mark.spec("MCP-BRK-3")
def test_repeat_mode_from_the_start_or_while_the_feature_is_off_loses_nothing(bench):
    bench.put("BREAKPOINT", 15000)
    bench.write(0x02, 0x20)
    bench.write(0x02, 0x30)
    bench.write(0x02, 0x10)
    bench.samples(2)
    bench.write(0x02, 0x30)
    assert found(bench) == []
