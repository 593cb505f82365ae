"""Encoder input, position capture, stall detection, motor on and off (PMD-ENC, CAP, STL, MTR)."""

import pytest

from tests.conformance.mc1241a.conftest import CYCLE, SLOT, Bench
from vbus.core.kernel import NS, US
from vbus.core.signals import Switch
from vbus.plant.ideal import IdealPlant
from vbus.plant.stepper import StepperMotor

spec = pytest.mark.spec

UP = ((1, 0), (1, 1), (0, 1), (0, 0))


def turn(bench: Bench, *states: tuple[int, int], dwell: int = 1000) -> None:
    """Give encoder 1 the states (A, B), each for ``dwell`` ns."""
    for a, b in states:
        bench.drive("QuadA1", a)
        bench.drive("QuadB1", b)
        bench.run_for(dwell * NS)


# -- counting ---------------------------------------------------------------------------------


@spec("PMD-ENC-1")
def test_four_counts_a_line_upwards_when_a_leads(chip: Bench) -> None:
    turn(chip, *UP, *UP)
    chip.next_cycle()
    assert chip.seen("actual") == 8
    turn(chip, *reversed(UP[:3]), (0, 0), (0, 1))
    chip.next_cycle()
    assert chip.seen("actual") == 3


@spec("PMD-ENC-1", "PMD-ENC-2", "PMD-AMB-21")
@pytest.mark.parametrize(("width", "counts"), [(480, 1), (479, 0), (300, 0)])
def test_a_level_must_last_three_clocks_of_160_ns(chip: Bench, width: int, counts: int) -> None:
    chip.next_cycle()
    chip.run_for(CYCLE - width * NS)  # so that the cycle reads just then
    chip.drive("QuadA1", 1)
    chip.run_for(width * NS)
    assert chip.seen("actual") == counts


@spec("PMD-ENC-1")
def test_noise_shorter_than_the_filter_counts_nothing(chip: Bench) -> None:
    for _ in range(50):
        chip.drive("QuadA1", 1)
        chip.run_for(300 * NS)
        chip.drive("QuadA1", 0)
        chip.run_for(300 * NS)
    chip.next_cycle()
    assert chip.seen("actual") == 0


@spec("PMD-ENC-2")
def test_the_fastest_encoder_of_1_75_mcounts_a_second_is_counted(chip: Bench) -> None:
    turn(chip, *(UP * 50), dwell=571)
    chip.next_cycle()
    assert chip.seen("actual") == 200


@spec("PMD-ENC-1")
def test_both_channels_at_once_count_nothing_and_are_reported(chip: Bench) -> None:
    turn(chip, (1, 1))
    chip.next_cycle()
    assert chip.seen("actual") == 0
    assert chip.rules() == ["quadrature"]


@spec("PMD-ENC-1")
def test_positions_wrap_at_31_bits(chip: Bench) -> None:
    chip.send("SET_ACTL_POS", -1_073_741_824)
    turn(chip, (0, 1))
    chip.next_cycle()
    assert chip.send("GET_ACTL_POS") == 1_073_741_823
    assert chip.status() == 0x0302


@spec("PMD-ENC-1")
@pytest.mark.parametrize("pin", ["QuadA1", "QuadB1"])
def test_one_driven_channel_outranks_the_plant_s_encoder(pin: str) -> None:
    bench = Bench()
    bench.chip.connect(0, IdealPlant({"encoder_lines": 3200}))
    bench.send("SET_PHASE_2")
    bench.load(buf_mtr_cmd=0x7FFF)
    bench.drive(pin, 1)
    bench.move(pos=100, vel=8 << 16, acc=8 << 16)
    bench.next_cycle(20)
    assert bench.seen("actual") == (1 if pin == "QuadA1" else -1)


@spec("PMD-ENC-1")
def test_the_second_axis_has_its_own_encoder(chip: Bench) -> None:
    chip.drive("QuadB2", 1)
    chip.next_cycle()
    assert (chip.seen("actual", 1), chip.seen("actual", 2)) == (0, -1)


@spec("PMD-ENC-1", "PMD-CAP-1")
@pytest.mark.parametrize(("before", "cycles"), [(480, 1), (479, 2)])
def test_an_edge_that_nothing_follows_is_taken_in_by_the_cycle_after_the_filter(
    chip: Bench, before: int, cycles: int
) -> None:
    chip.send("SET_2")
    chip.send("SET_CAPT_HOME")
    chip.run_until((chip.now // CYCLE + 1) * CYCLE - before * NS)
    chip.drive("QuadA1", 1)
    chip.drive("~Home2", 0)
    assert chip.trace("actual", 2) == [2 - cycles, 1]
    assert chip.send("GET_STATUS") == 0x1308


# -- capture ----------------------------------------------------------------------------------


@spec("PMD-CAP-1", "PMD-CMD-50", "PMD-CMD-52")
def test_the_index_captures_at_the_later_edge_of_a_and_b(chip: Bench) -> None:
    turn(chip, (1, 0), (1, 1), (0, 1))
    chip.drive("~Index1", 0)
    chip.run_for(2 * US)
    chip.next_cycle()
    assert chip.status() == 0x0300
    turn(chip, (0, 0))
    chip.next_cycle()
    assert chip.status() == 0x0308
    turn(chip, (1, 0), (1, 1))
    chip.next_cycle()
    assert chip.seen("actual") == 6
    assert chip.send("GET_CAPT") == 4


@spec("PMD-CAP-1")
def test_an_index_that_falls_last_captures_nothing(chip: Bench) -> None:
    turn(chip, (0, 1), (0, 0))
    chip.drive("~Index1", 0)
    chip.run_for(5 * US)
    chip.next_cycle()
    assert chip.status() == 0x0300


@spec("PMD-CAP-1", "PMD-ENC-1")
@pytest.mark.parametrize(("width", "captured"), [(480, True), (479, False)])
def test_home_captures_when_it_falls_alone(chip: Bench, width: int, captured: bool) -> None:
    chip.send("SET_CAPT_HOME")
    turn(chip, (1, 0), (1, 1))
    chip.drive("~Home1", 0)
    chip.run_for(width * NS)
    chip.drive("~Home1", 1)
    turn(chip, (0, 1))
    chip.next_cycle()
    assert chip.status() == (0x0308 if captured else 0x0300)
    assert chip.send("GET_CAPT") == (2 if captured else 0)


@spec("PMD-CAP-1")
def test_a_count_of_the_same_instant_is_in_the_captured_position(chip: Bench) -> None:
    chip.send("SET_CAPT_HOME")
    turn(chip, (1, 0))
    chip.drive("QuadB1", 1)
    chip.drive("~Home1", 0)
    chip.next_cycle()
    assert chip.send("GET_CAPT") == 2


@spec("PMD-CAP-1", "PMD-CMD-51")
def test_only_the_chosen_source_captures(chip: Bench) -> None:
    chip.drive("~Home1", 0)
    chip.run_for(5 * US)
    chip.next_cycle()
    assert chip.status() == 0x0300
    chip.send("SET_CAPT_HOME")
    turn(chip, (0, 1))
    chip.drive("~Index1", 0)
    turn(chip, (0, 0))
    chip.next_cycle()
    assert chip.status() == 0x0300


@spec("PMD-CMD-52")
def test_a_position_is_read_in_the_cycle_in_which_it_is_captured(chip: Bench) -> None:
    chip.send("SET_CAPT_HOME")
    chip.next_cycle()
    turn(chip, *UP)
    chip.drive("~Home1", 0)
    begun = chip.now // CYCLE
    assert chip.send("GET_CAPT") == 4
    assert chip.now // CYCLE == begun


@spec("PMD-CAP-1", "PMD-CMD-52")
def test_a_second_trigger_is_lost_until_the_capture_is_read(chip: Bench) -> None:
    chip.send("SET_CAPT_HOME")

    def trigger() -> None:
        turn(chip, *UP)
        chip.drive("~Home1", 0)
        chip.run_for(US)
        chip.drive("~Home1", 1)
        chip.run_for(US)

    trigger()
    trigger()
    chip.next_cycle()
    assert chip.send("GET_CAPT") == 4
    assert chip.send("GET_CAPT") == 4
    trigger()
    chip.next_cycle()
    assert chip.send("GET_CAPT") == 12


@spec("PMD-CAP-2")
def test_choosing_a_source_arms_again_and_keeps_the_stored_value(chip: Bench) -> None:
    chip.send("SET_CAPT_HOME")
    turn(chip, *UP)
    chip.drive("~Home1", 0)
    chip.run_for(US)
    chip.send("SET_CAPT_INDEX")
    turn(chip, (1, 0), (1, 1), (0, 1))
    chip.drive("~Index1", 0)
    turn(chip, (0, 0))
    chip.next_cycle()
    assert chip.send("GET_CAPT") == 8


@spec("PMD-CAP-2")
def test_a_stored_value_survives_a_change_of_source(chip: Bench) -> None:
    chip.send("SET_CAPT_HOME")
    turn(chip, *UP)
    chip.drive("~Home1", 0)
    chip.run_for(US)
    chip.send("SET_CAPT_INDEX")
    assert chip.send("GET_CAPT") == 4


def motored(**switches: Switch) -> tuple[Bench, IdealPlant]:
    """Return a bench with an ideal motor on axis 1: one count a microstep, index each 12800."""
    plant = IdealPlant({"encoder_lines": 3200, "index_offset": 600})
    plant.switches.update({name.replace("_", "-"): s for name, s in switches.items()})
    bench = Bench()
    bench.chip.connect(0, plant)
    bench.load(buf_mtr_cmd=0x7FFF)
    bench.send("SET_PHASE_2")
    bench.send("UPDATE")
    bench.next_cycle(2)
    return bench, plant


@spec("PMD-CAP-1")
def test_the_plant_s_index_is_captured_where_it_lies() -> None:
    bench, _ = motored()
    bench.move(pos=1000, vel=7 << 16, acc=7 << 16)
    bench.next_cycle(200)
    assert bench.seen("actual") == 1000
    assert bench.status() == 0x0309
    assert bench.send("GET_CAPT") == 600


@spec("PMD-CAP-1")
@pytest.mark.parametrize("active", [0, 1])
def test_the_plant_s_home_switch_is_captured_where_it_falls(active: int) -> None:
    bench, _ = motored(home=Switch(100, 200, active))
    bench.send("SET_CAPT_HOME")
    assert bench.send("GET_HOME") & 1 == 1 - active
    bench.move(pos=1000, vel=7 << 16, acc=7 << 16)
    bench.next_cycle(200)
    assert bench.send("GET_CAPT") == (100 if active == 0 else 200)
    bench.send("GET_CAPT")
    bench.send("CLR_STATUS")
    bench.move(pos=-50)
    bench.next_cycle(200)
    assert bench.status() == 0x0309
    assert bench.send("GET_CAPT") == (199 if active == 0 else 99)


@spec("PMD-CAP-1")
@pytest.mark.parametrize(("source", "place"), [(1, 100), (0, 600)])
def test_arming_in_the_middle_of_a_slot_misses_what_has_gone_by_in_it(
    source: int, place: int
) -> None:
    for offset, captured in ((-10, True), (10, False)):
        bench, plant = motored(home=Switch(100, 200))
        bench.send("SET_CAPT_HOME" if source else "SET_CAPT_INDEX")
        bench.move(pos=1000, vel=8 << 16, acc=8 << 16)  # one count a slot
        # The place comes in this slot.
        start = (bench.now // CYCLE + 1) * CYCLE + (place - 1) * SLOT
        bench.run_until(start)
        assert (plant.count, plant.count_at(0.0)) == (place, place - 1)
        crossing = start + int(plant.fraction_at(place) * SLOT)
        bench.run_until(crossing + offset * NS)
        bench.probe.follow_encoders()
        bench.probe.set_capture_source(source)
        bench.run_until(start + 20 * SLOT)
        # Armed before the edge it captures; what was captured by the first arming is forgotten.
        assert bench.probe.capture_armed is not captured


@spec("PMD-CAP-1")
@pytest.mark.parametrize("wired", [False, True])
def test_home_of_one_axis_captures_the_encoder_it_has_wherever_that_is(wired: bool) -> None:
    bench = Bench(encoder_2="axis 1")
    master, slave = IdealPlant({"encoder_lines": 3200}), IdealPlant({"encoder_lines": 3200})
    slave.switches["home"] = Switch(100, 200)
    bench.chip.connect(0, master)
    bench.chip.connect(1, slave)
    for axis in ("SET_1", "SET_2"):
        bench.send(axis)
        bench.send("SET_PHASE_2")
        bench.load(buf_mtr_cmd=0x7FFF, pos=1000, acc=8 << 16)
        bench.load(vel=(4 if axis == "SET_1" else 8) << 16)
    if wired:
        bench.drive("QuadA2", 1)
    bench.send("SET_CAPT_HOME")
    bench.send("MULTI_UPDATE", 3)
    bench.next_cycle(40)
    # Axis 2 comes to 100 when axis 1, at half its speed, is at 50; wires have stood still.
    assert bench.send("GET_CAPT") == (1 if wired else 50)


@spec("PMD-CMD-69")
def test_set_actl_pos_takes_the_place_of_its_instant() -> None:
    bench, _ = motored()
    bench.move(pos=5000, vel=16 << 16, acc=16 << 16)
    bench.next_cycle(50)
    bench.send("STOP")
    bench.move()
    bench.next_cycle(3)
    bench.send("SET_ACTL_POS", -77)
    bench.next_cycle(2)
    assert bench.seen("actual") == -77
    assert bench.seen("target") == -77


# -- position error and stall -----------------------------------------------------------------


@spec("PMD-STL-1", "PMD-CMD-59", "PMD-AMB-26")
def test_the_position_error_is_target_minus_actual_in_counts(chip: Bench) -> None:
    chip.send("SET_STEP_RATIO", 80)
    chip.move(pos=100, vel=100 << 16, acc=100 << 16)
    chip.next_cycle()
    assert chip.send("GET_ACTL_POS_ERR") == 100 * 80 // 256  # 31
    turn(chip, *UP, *UP)
    chip.next_cycle()
    assert chip.send("GET_ACTL_POS_ERR") == 31 - 8


@spec("PMD-STL-1")
@pytest.mark.parametrize(("pos", "error"), [(30_000_000, 32767), (-30_000_000, -32768)])
def test_the_position_error_is_clamped_to_16_bits(chip: Bench, pos: int, error: int) -> None:
    chip.send("SET_STEP_RATIO", 256)
    chip.send("SET_AUTO_STOP_OFF")
    chip.move(pos=pos, vel=2**30 - 1, acc=2**30 - 1)
    chip.next_cycle(10)
    assert chip.send("GET_ACTL_POS_ERR") == error


@spec("PMD-STL-1")
def test_without_a_step_ratio_there_is_no_stall_test(chip: Bench) -> None:
    chip.send("SET_POS_ERR", 0)
    chip.move(pos=100, vel=100 << 16, acc=100 << 16)
    chip.next_cycle(5)
    assert chip.send("GET_ACTL_POS_ERR") == 0
    assert chip.status() == 0x0301


@spec("PMD-STL-1", "PMD-CMD-55", "PMD-CMD-57", "PMD-MTR-2")
def test_an_error_over_the_limit_stops_the_motor_in_its_cycle(chip: Bench) -> None:
    chip.send("SET_STEP_RATIO", 256)
    chip.send("SET_POS_ERR", 12)
    chip.move(pos=1000, vel=4 << 16, acc=4 << 16)
    chip.next_cycle(3)
    assert chip.seen("status") == 0x0700
    assert chip.seen("error") == 12
    chip.next_cycle()
    assert chip.seen("status") == 0x0211
    assert chip.seen("target") == 16
    chip.next_cycle(5)
    assert chip.seen("target") == 16


@spec("PMD-STL-1", "PMD-CMD-56")
def test_without_auto_stop_only_the_bit_is_set(chip: Bench) -> None:
    chip.send("SET_AUTO_STOP_OFF")
    chip.send("SET_STEP_RATIO", 256)
    chip.send("SET_POS_ERR", 12)
    chip.move(pos=1000, vel=4 << 16, acc=4 << 16)
    chip.next_cycle(5)
    assert chip.seen("status") == 0x0710


@spec("PMD-CMD-53", "PMD-STL-2", "PMD-MTR-1")
@pytest.mark.parametrize("command", ["MTR_ON", "SET_ACTL_POS", "SYNCH_PRFL", "SET_STEP_RATIO"])
def test_four_commands_make_the_error_0(chip: Bench, command: str) -> None:
    chip.send("SET_STEP_RATIO", 256)
    chip.move(pos=1000, vel=4 << 16, acc=4 << 16)
    chip.next_cycle(5)
    chip.send("STOP")
    chip.move()
    chip.next_cycle()
    assert chip.seen("error") == 20
    chip.send(command, 256 if command == "SET_STEP_RATIO" else 500)
    if command != "SYNCH_PRFL":  # which acts at the next update
        assert chip.seen("error") == 0
    if command == "SYNCH_PRFL":
        chip.move()
    chip.send("STOP")
    chip.move()
    chip.next_cycle(2)
    assert chip.seen("error") == 0


@spec("PMD-STL-1")
def test_a_wrap_of_the_target_is_no_position_error(chip: Bench) -> None:
    chip.send("SET_STEP_RATIO", 80)
    chip.send("SET_ACTL_POS", 2**30 - 10)
    chip.send("SET_PRFL_VEL")
    chip.move(vel=4 << 16, acc=4 << 16)
    chip.next_cycle(10)
    assert chip.seen("target") < 0
    assert chip.seen("error") in range(10, 15)


@spec("PMD-STL-1", "PMD-TRJ-1")
@pytest.mark.parametrize("sign", [1, -1])
def test_wraps_out_and_back_again_are_no_position_error(bench: Bench, sign: int) -> None:
    bench.send("SET_STEP_RATIO", 256)
    bench.send("SET_ACTL_POS", 2**30 - 10 if sign > 0 else 10 - 2**30)
    bench.send("SET_PRFL_VEL")
    bench.move(vel=4 << 16, acc=sign * (4 << 16))
    bench.next_cycle(5)
    end = sign * (10 - 2**30)
    assert (bench.seen("target"), bench.seen("error")) == (end, 20 * sign)
    bench.move(acc=-sign * (4 << 16))
    bench.next_cycle(6)  # through rest, and five cycles back
    end = sign * (2**30 - 10)
    assert (bench.seen("target"), bench.seen("error")) == (end, 0)
    bench.next_cycle(2)
    assert bench.seen("error") == -8 * sign
    assert bench.status() == 0x0702


# -- motor on and off -------------------------------------------------------------------------


@spec("PMD-MTR-1", "PMD-CMD-62")
def test_motor_on_waits_for_an_update(chip: Bench) -> None:
    chip.send("SET_PRFL_VEL")
    chip.move(vel=4 << 16, acc=4 << 16)
    chip.next_cycle(3)
    chip.send("MTR_OFF")
    chip.send("MTR_ON")
    assert chip.status() & 0x0500 == 0x0100
    at = chip.seen("target")
    chip.next_cycle(5)
    assert chip.seen("target") == at
    chip.send("UPDATE")
    chip.next_cycle()
    assert chip.seen("target") == at + 4


@spec("PMD-MTR-1", "PMD-CMD-62")
def test_motor_on_in_motion_stops_the_axis_too(chip: Bench) -> None:
    chip.move(pos=1000, vel=4 << 16, acc=4 << 16)
    chip.next_cycle(3)
    chip.send("MTR_ON")
    assert chip.status() == 0x0301
    at = chip.seen("target")
    chip.next_cycle(3)
    assert chip.seen("target") == at


@spec("PMD-MTR-2", "PMD-CMD-63")
def test_motor_off_freezes_the_angle_and_holds(chip: Bench) -> None:
    chip.load(buf_mtr_cmd=0x7FFF)
    chip.move(pos=10_000, vel=5 << 16, acc=5 << 16)
    chip.next_cycle(4)
    chip.send("MTR_OFF")
    assert chip.status() == 0x0201
    chip.next_cycle()
    a, b = chip.seen("phase A"), chip.seen("phase B")
    assert a == 15446  # 20 microsteps of 256
    chip.next_cycle(20)
    assert (chip.seen("phase A"), chip.seen("phase B")) == (a, b)


@spec("PMD-MTR-2")
def test_updates_with_the_motor_off_copy_and_start_nothing(chip: Bench) -> None:
    chip.send("MTR_OFF")
    chip.move(pos=500, vel=4 << 16, acc=4 << 16, buf_mtr_cmd=0x1000)
    chip.next_cycle(5)
    assert chip.status() == 0x0200
    assert chip.seen("target") == 0
    assert chip.send("GET_MTR_CMD") == 0x1000
    chip.send("MTR_ON")
    chip.next_cycle(3)
    assert chip.seen("target") == 0


# -- a real motor -----------------------------------------------------------------------------


def stepper(bench: Bench, axis: int = 0, **settings: float) -> StepperMotor:
    motor = StepperMotor({"encoder_lines": 500, "static_friction": 0.007, **settings})
    bench.chip.connect(axis, motor)
    return motor


@spec("PMD-STL-1")
@pytest.mark.parametrize("waveform", ["SET_PHASE_2", "SET_PHASE_3"])
def test_a_stepper_motor_follows_its_phases(waveform: str) -> None:
    bench = Bench()
    stepper(bench)
    bench.send(waveform)
    bench.send("SET_STEP_RATIO", 40)  # 2000 counts for 12800 microsteps
    bench.load(buf_mtr_cmd=0x6000)
    bench.move(pos=12_800, vel=20 << 16, acc=1 << 15)
    bench.next_cycle(1000)
    assert bench.status() & 0x0411 == 0x0001
    assert abs(bench.send("GET_ACTL_POS") - 2000) <= 3


@spec("PMD-STL-1")
def test_an_overloaded_stepper_loses_steps_and_is_stopped() -> None:
    bench = Bench()
    stepper(bench, load_torque=0.5)  # more than its holding torque of 0.4 N*m
    bench.send("SET_PHASE_2")
    bench.send("SET_STEP_RATIO", 40)
    bench.send("SET_POS_ERR", 30)
    bench.load(buf_mtr_cmd=0x7FFF)
    bench.move(pos=12_800, vel=20 << 16, acc=1 << 15)
    bench.next_cycle(300)
    assert bench.status() & 0x0110 == 0x0010
    assert bench.send("GET_ACTL_POS") < 0


def test_the_second_encoder_can_be_turned_by_the_first_motor() -> None:
    bench = Bench(encoder_2="axis 1")
    bench.chip.connect(0, IdealPlant({"encoder_lines": 3200}))
    slave = IdealPlant({"encoder_lines": 3200})
    bench.chip.connect(1, slave)
    for axis in (1, 2):
        bench.send(f"SET_{axis}")
        bench.send("SET_PHASE_2")
        bench.load(buf_mtr_cmd=0x7FFF)
    bench.send("SET_PRFL_GEAR")
    bench.load(ratio=-(1 << 15))
    bench.send("SET_1")
    bench.load(pos=4000, vel=10 << 16, acc=1 << 16)
    bench.send("MULTI_UPDATE", 3)
    bench.next_cycle(500)
    assert bench.seen("target", 1) == 4000
    assert bench.seen("actual", 2) == 4000
    assert bench.seen("target", 2) == -2000
    assert slave.count == -2000


def test_an_encoder_cannot_be_turned_by_a_motor_the_part_does_not_have() -> None:
    with pytest.raises(ValueError, match="encoder_1: the MC1141A has no axis 2"):
        Bench(part="MC1141A", encoder_1="axis 2")
    with pytest.raises(ValueError, match="the MC1141A has no axis 2"):
        Bench(part="MC1141A").chip.connect(1, IdealPlant())
