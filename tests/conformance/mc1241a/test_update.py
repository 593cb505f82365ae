"""Update, stops, command errors, breakpoints (PMD-UPD, PMD-ERR, PMD-TRJ-9 to -12, PMD-CMD)."""

import pytest

from tests.conformance.mc1241a.conftest import CYCLE, Bench
from vbus.core.state import save

spec = pytest.mark.spec


def cruise(bench: Bench, pos: int = 100_000, vel: int = 4) -> None:
    """Move axis 1 and come to speed."""
    bench.move(pos=pos, vel=vel << 16, acc=vel << 16)
    bench.next_cycle(3)


def values(registers: object) -> tuple[int, ...]:
    return tuple(save(registers).values())


def speed(bench: Bench) -> float:
    return bench.probe.profile_velocity / 2**32


@spec("PMD-UPD-1", "PMD-CMD-36")
def test_an_update_copies_every_buffered_register(chip: Bench) -> None:
    chip.load(pos=1, vel=2, acc=3, max_acc=4, jerk=5, ratio=6, buf_mtr_cmd=7)
    for name in ("STOP", "SMOOTH_STOP", "SYNCH_PRFL"):
        chip.send(name)
    chip.send("UPDATE")
    chip.next_cycle()
    axis = chip.probe
    assert values(axis.active)[:7] == (1, 2, 3, 4, 5, 6, 7)
    assert values(axis.buffer) == (1, 2, 3, 4, 5, 6, 7, 0, 0, 0)


@spec("PMD-UPD-1")
def test_without_an_update_loading_has_no_effect(chip: Bench) -> None:
    cruise(chip)
    chip.load(pos=0, vel=1 << 16)
    for name in ("STOP", "SYNCH_PRFL"):
        chip.send(name)
    chip.next_cycle(3)
    assert speed(chip) == 4
    assert chip.status() == 0x0700


@spec("PMD-UPD-1")
def test_action_flags_act_once_and_registers_stay(chip: Bench) -> None:
    chip.send("STOP")
    chip.move(pos=500, vel=4 << 16, acc=4 << 16)
    chip.next_cycle()
    assert chip.seen("target") == 0
    chip.move()
    chip.next_cycle(2)
    assert chip.seen("target") == 8
    assert chip.rules() == []


# -- STOP, SMOOTH_STOP, SYNCH_PRFL ------------------------------------------------------------


@spec("PMD-TRJ-9", "PMD-CMD-15", "PMD-TRJ-12")
@pytest.mark.parametrize("mode", ["TRAP", "VEL", "S_CRV"])
def test_stop_ends_the_motion_in_the_update_s_cycle(chip: Bench, mode: str) -> None:
    chip.send("SET_PRFL_" + mode)
    chip.move(pos=100_000, vel=4 << 16, acc=1 << 16, max_acc=0x7000, jerk=1 << 29)
    chip.next_cycle(20)
    at = chip.seen("target")
    chip.send("STOP")
    chip.move()
    chip.run_until((chip.now // CYCLE + 1) * CYCLE - 1)
    assert speed(chip) == 4
    chip.run_for(1)
    assert speed(chip) == 0
    assert chip.seen("target") == at > 50
    assert chip.status() == 0x0301


@spec("PMD-TRJ-9")
def test_stop_completes_motion_at_rest_too(chip: Bench) -> None:
    chip.send("STOP")
    chip.move()
    chip.next_cycle()
    assert chip.status() == 0x0301


@spec("PMD-TRJ-9", "PMD-TRJ-10")
@pytest.mark.parametrize("stop", ["STOP", "SMOOTH_STOP"])
def test_the_buffered_destination_outlives_a_stop(chip: Bench, stop: str) -> None:
    cruise(chip, pos=400)
    chip.send(stop)
    chip.move()
    chip.next_cycle(50)
    at = chip.seen("target")
    assert at < 100
    assert chip.send("GET_POS") == 400
    chip.move()
    chip.next_cycle(150)
    assert chip.seen("target") == 400


@spec("PMD-TRJ-10", "PMD-CMD-16", "PMD-TRJ-12")
@pytest.mark.parametrize("mode", ["TRAP", "VEL"])
def test_smooth_stop_slows_down_at_the_acceleration(chip: Bench, mode: str) -> None:
    chip.send("SET_PRFL_" + mode)
    chip.move(pos=100_000, vel=6 << 16, acc=2 << 16)
    chip.next_cycle(10)
    at = chip.seen("target")
    chip.send("SMOOTH_STOP")
    chip.move()
    chip.next_cycle()
    assert speed(chip) == 4
    assert chip.seen("status") == 0x0700
    chip.next_cycle()
    assert speed(chip) == 2
    chip.next_cycle()
    assert speed(chip) == 0
    assert chip.seen("status") == 0x0301
    chip.next_cycle(10)
    assert chip.seen("status") == 0x0301
    assert at < chip.seen("target") < 200


@spec("PMD-TRJ-10")
def test_smooth_stop_ends_below_the_start_velocity(chip: Bench) -> None:
    chip.send("SET_START_VEL", 3 << 16)
    chip.send("SET_PRFL_VEL")
    chip.move(vel=6 << 16, acc=2 << 16)
    chip.next_cycle(5)
    chip.send("SMOOTH_STOP")
    chip.move()
    chip.next_cycle()
    assert speed(chip) == 4
    chip.next_cycle()
    assert speed(chip) == 0


@spec("PMD-TRJ-10")
def test_smooth_stop_at_rest_or_without_an_acceleration_is_over_at_once(chip: Bench) -> None:
    chip.send("SMOOTH_STOP")
    chip.move()
    chip.next_cycle()
    assert chip.status() == 0x0301
    chip.send("SET_PRFL_VEL")
    chip.move(vel=6 << 16, acc=2 << 16)
    chip.next_cycle(5)
    chip.send("SMOOTH_STOP")
    chip.move(acc=0)
    chip.next_cycle()
    assert speed(chip) == 0


@spec("PMD-TRJ-10", "PMD-TRJ-12", "PMD-MTR-2")
@pytest.mark.parametrize("mode", ["TRAP", "VEL", "S_CRV"])
@pytest.mark.parametrize("first", [True, False])
def test_smooth_stop_completes_motion_with_the_motor_off_too(
    chip: Bench, mode: str, first: bool
) -> None:
    chip.send("SET_PRFL_" + mode)
    chip.next_cycle()
    for name in ("MTR_OFF", "SMOOTH_STOP", "UPDATE") if first else (
        "SMOOTH_STOP", "UPDATE", "MTR_OFF",
    ):  # fmt: skip
        chip.send(name)
    assert chip.seen("status") == 0x0200
    chip.next_cycle()
    assert chip.seen("status") == 0x0201


@spec("PMD-TRJ-11", "PMD-STA-3", "PMD-TRJ-8")
def test_stop_wins_over_smooth_stop_and_over_a_new_position(chip: Bench) -> None:
    cruise(chip)
    chip.send("SMOOTH_STOP")
    chip.send("STOP")
    chip.move(pos=50_000)
    chip.next_cycle()
    assert speed(chip) == 0
    assert chip.rules("abrupt-stop") == ["two-stops"]
    assert chip.violations[-1].detail == "axis 1: STOP wins over SMOOTH_STOP"
    assert chip.status() & 0x0400 == 0, "it is not in motion"
    assert (chip.probe.stop_buffered, chip.probe.smooth_stop_buffered) == (0, 0)
    chip.next_cycle(3)
    assert speed(chip) == 0
    assert chip.send("GET_POS") == 50_000
    assert chip.probe.position == 50_000


@spec("PMD-CMD-17", "PMD-AMB-5", "PMD-UPD-1")
def test_synch_prfl_copies_the_actual_position_to_the_target_and_keeps_the_velocity(
    chip: Bench,
) -> None:
    chip.send("SET_ACTL_POS", 1000)
    chip.send("SET_STEP_RATIO", 256)
    chip.send("SET_PRFL_VEL")
    chip.move(vel=4 << 16, acc=4 << 16)
    chip.next_cycle(3)
    assert chip.seen("target") == 1012
    assert chip.seen("error") == 12
    chip.send("SYNCH_PRFL")
    chip.move()
    chip.next_cycle()
    assert chip.seen("target") == 1004
    assert speed(chip) == 4
    assert chip.seen("error") == 4
    assert chip.send("GET_ACTL_POS") == 1000


@spec("PMD-CMD-17")
def test_a_synchronised_s_curve_still_ends_on_its_destination(chip: Bench) -> None:
    chip.send("SET_PRFL_S_CRV")
    chip.move(pos=2000, vel=10 << 16, max_acc=0x2000, jerk=1 << 24)
    chip.next_cycle(120)
    chip.send("SYNCH_PRFL")
    chip.move()
    chip.next_cycle()
    assert chip.seen("target") == 10
    chip.next_cycle(500)
    assert chip.seen("target") == 2000


# -- two updates in one cycle -----------------------------------------------------------------


def at_rest(way: str, mode: str, phase: int, complete: bool) -> Bench:
    """Return an axis at rest some twentieths of a cycle after the beginning of a cycle.

    Args:
        way: how bytes reach the chip.
        mode: profile mode.
        phase: how many twentieths.
        complete: whether motion has been completed before.
    """
    bench = Bench(way)
    bench.send("SET_PRFL_" + mode)
    bench.load(vel=10 << 16, acc=1 << 14, max_acc=0x2000, jerk=1 << 24, brk_pnt=-5)
    if complete:
        bench.send("STOP")
        bench.send("UPDATE")
    bench.next_cycle()
    assert bench.seen("status") == 0x0300 | complete
    bench.run_for(phase * CYCLE // 20)
    return bench


@spec("PMD-TRJ-10", "PMD-UPD-2", "PMD-CMD-32")
@pytest.mark.parametrize("way", ["cycle", "strobe"])
@pytest.mark.parametrize("mode", ["TRAP", "S_CRV"])
@pytest.mark.parametrize("first", ["SMOOTH_STOP", "STOP", "SET_POS"])
def test_a_move_after_a_stop_at_rest_begins_in_every_phase_of_the_cycle(
    way: str, mode: str, first: str
) -> None:
    """The breakpoint's update comes in the stop's own cycle, or in the next.

    It brings a parameter that no move under way would take (PMD-ERR-1, PMD-ERR-2).
    """
    together = set()
    changed = {"acc": 1 << 15} if mode == "TRAP" else {"jerk": 1 << 25}
    for phase in range(20):
        bench = at_rest(way, mode, phase, complete=True)
        bench.send(first)
        bench.send("UPDATE")
        acts = bench.now // CYCLE
        bench.load(pos=185, **changed)
        bench.send("SET_MTN_CMPLT_BRK")
        together.add(bench.now // CYCLE == acts)
        bench.next_cycle(400)
        assert (bench.seen("target"), bench.seen("status")) == (185, 0x0305), phase
    assert together == {True, False}


@spec("PMD-TRJ-10", "PMD-TRJ-12", "PMD-UPD-2")
@pytest.mark.parametrize("way", ["cycle", "strobe"])
@pytest.mark.parametrize(
    ("mode", "first"),
    [(mode, stop) for mode in ("TRAP", "S_CRV", "VEL") for stop in ("SMOOTH_STOP", "STOP")]
    + [("TRAP", "SET_POS"), ("S_CRV", "SET_POS")],
)
def test_what_completes_motion_at_rest_does_in_every_phase_of_the_cycle(
    way: str, mode: str, first: str
) -> None:
    """Also if a breakpoint's update follows in the same cycle."""
    for phase in range(20):
        bench = at_rest(way, mode, phase, complete=False)
        if mode == "VEL":
            bench.load(vel=0)
        bench.send(first)
        bench.send("UPDATE")
        bench.send("SET_POS_BRK")
        bench.next_cycle(2)
        assert (bench.seen("target"), bench.seen("status")) == (0, 0x0305), phase


@spec("PMD-TRJ-10", "PMD-UPD-2")
@pytest.mark.parametrize("mode", ["TRAP", "S_CRV"])
def test_a_move_that_is_smoothly_stopped_in_its_first_cycle_is_complete(
    chip: Bench, mode: str
) -> None:
    chip.send("SET_PRFL_" + mode)
    chip.load(pos=185, vel=10 << 16, acc=1 << 14, max_acc=0x2000, jerk=1 << 24)
    chip.next_cycle()
    chip.send("UPDATE")
    chip.send("SMOOTH_STOP")
    chip.send("SET_POS_BRK")
    chip.next_cycle()
    assert (chip.seen("target"), chip.seen("status")) == (0, 0x0305)
    chip.next_cycle(5)
    assert (chip.seen("target"), chip.seen("status")) == (0, 0x0305)


@spec("PMD-TRJ-9", "PMD-TRJ-10", "PMD-CMD-17", "PMD-BUS-9")
@pytest.mark.parametrize("name", ["STOP", "SMOOTH_STOP", "SYNCH_PRFL"])
def test_an_action_outlives_a_second_update_in_its_cycle(bench: Bench, name: str) -> None:
    cruise(bench)
    target = bench.seen("target")
    bench.send(name)
    bench.send("UPDATE")
    bench.send("UPDATE")
    bench.next_cycle()
    if name == "SYNCH_PRFL":
        assert (bench.seen("target"), bench.seen("status")) == (4, 0x0700)
    else:
        assert (bench.seen("target"), bench.seen("status")) == (target, 0x0301)


@spec("PMD-TRJ-12", "PMD-BUS-9")
def test_a_given_present_position_outlives_a_second_update_in_its_cycle(bench: Bench) -> None:
    bench.load(vel=4 << 16, acc=4 << 16)
    bench.next_cycle()
    bench.send("SET_POS", 0)
    bench.send("UPDATE")
    bench.send("UPDATE")
    bench.next_cycle()
    assert bench.seen("status") == 0x0301


# -- command errors ---------------------------------------------------------------------------


@spec("PMD-ERR-1", "PMD-AMB-13", "PMD-TRJ-3")
def test_a_new_acceleration_in_a_trapezoidal_move_is_refused_with_the_velocity(
    chip: Bench,
) -> None:
    cruise(chip)
    chip.move(pos=-7, vel=9 << 16, acc=1 << 16, max_acc=8, jerk=9, ratio=10, buf_mtr_cmd=11)
    chip.next_cycle()
    assert chip.status() == 0x0780
    assert values(chip.probe.active)[:7] == (-7, 4 << 16, 4 << 16, 8, 9, 10, 11)
    assert chip.rules("other-profile") == ["command-error"]
    assert chip.violations[-1].detail.startswith("axis 1: ")
    chip.next_cycle(50)
    assert chip.seen("target") == -7  # the position was accepted


@spec("PMD-ERR-1")
@pytest.mark.parametrize("by", [-1, 1, -(4 << 16), 4 << 16])
@pytest.mark.parametrize("vel", [4, 9])
def test_any_other_acceleration_is_refused_as_often_as_it_is_asked_for(
    chip: Bench, by: int, vel: int
) -> None:
    cruise(chip)
    chip.move(vel=vel << 16, acc=(4 << 16) + by)
    chip.next_cycle()
    active = chip.probe
    assert (active.velocity, active.acceleration) == (4 << 16, 4 << 16)
    assert chip.status() == 0x0780
    chip.send("CLR_STATUS")
    chip.move(pos=-7)  # the buffer still has the other acceleration
    chip.next_cycle()
    assert (active.velocity, active.acceleration, active.position) == (4 << 16, 4 << 16, -7)
    assert chip.status() == 0x0780
    assert chip.rules() == ["command-error"] * 2
    chip.send("CLR_STATUS")
    chip.move(acc=4 << 16)
    chip.next_cycle()
    assert (active.velocity, chip.status()) == (vel << 16, 0x0700)


@spec("PMD-ERR-1")
def test_at_constant_velocity_another_acceleration_is_no_error(chip: Bench) -> None:
    chip.send("SET_PRFL_VEL")
    cruise(chip)
    chip.move(vel=9 << 16, acc=1 << 16)
    chip.next_cycle()
    assert chip.status() == 0x0700
    assert speed(chip) == 5
    assert chip.rules() == []


@spec("PMD-ERR-1")
def test_the_same_acceleration_again_is_no_error_and_at_rest_any_is_taken(chip: Bench) -> None:
    cruise(chip, pos=40)
    chip.move(vel=9 << 16, acc=4 << 16)
    chip.next_cycle(50)
    assert chip.status() == 0x0301
    chip.move(acc=1 << 16)
    chip.next_cycle()
    assert chip.status() == 0x0301
    assert chip.probe.acceleration == 1 << 16


@spec("PMD-CMD-14", "PMD-ERR-1")
def test_the_start_velocity_cannot_change_in_motion(chip: Bench) -> None:
    chip.send("SET_START_VEL", 5)
    cruise(chip)
    chip.send("SET_START_VEL", 6)
    assert chip.send("GET_START_VEL") == 5
    assert chip.status() == 0x0780


@spec("PMD-ERR-3", "PMD-LIM-3")
@pytest.mark.parametrize("mode", ["TRAP", "S_CRV"])
@pytest.mark.parametrize(("switch", "sign"), [("PosLimit1", 1), ("NegLimit1", -1)])
def test_a_move_toward_an_active_limit_switch_is_ignored(
    chip: Bench, mode: str, switch: str, sign: int
) -> None:
    chip.send("SET_PRFL_" + mode)
    chip.drive(switch, 1)
    chip.next_cycle()
    chip.send("CLR_STATUS")
    chip.move(pos=100 * sign, vel=4 << 16, acc=4 << 16, max_acc=0x7000, jerk=1 << 29, ratio=3)
    chip.next_cycle(3)
    assert chip.status() & 0x04FF == 0x0080
    assert chip.seen("target") == 0
    assert chip.send("GET_POS") == 100 * sign
    assert chip.probe.gear_ratio == 3
    chip.move(pos=-100 * sign)  # away from it
    chip.next_cycle(100)
    assert chip.seen("target") == -100 * sign


@spec("PMD-ERR-3", "PMD-TRJ-13", "PMD-UPD-1")
@pytest.mark.parametrize("sign", [1, -1])
def test_a_refused_destination_is_not_the_one_of_a_later_change_of_mode(
    chip: Bench, sign: int
) -> None:
    chip.drive("PosLimit1" if sign > 0 else "NegLimit1", 1)
    chip.next_cycle(2)
    chip.send("CLR_STATUS")
    chip.move(pos=-20_000 * sign, vel=2 << 16, acc=1 << 12)
    chip.next_cycle(60)
    chip.move(pos=937 * sign)
    chip.next_cycle(2)
    assert chip.status() == 0x0780
    at = chip.seen("target")
    assert (at, speed(chip)) == (-93 * sign, -2 * sign)
    chip.send("SET_PRFL_GEAR")
    chip.send("SET_PRFL_TRAP")
    assert chip.trace("target", 3) == [at - 2 * n * sign for n in (1, 2, 3)]
    chip.next_cycle(10_000)
    assert (chip.seen("target"), chip.seen("status")) == (-20_000 * sign, 0x0381)


@spec("PMD-ERR-3", "PMD-TRJ-13")
def test_a_destination_refused_in_an_s_curve_is_not_the_one_of_a_trapezoid(chip: Bench) -> None:
    chip.drive("PosLimit1", 1)
    chip.next_cycle(2)
    chip.send("CLR_STATUS")
    chip.send("SET_PRFL_S_CRV")
    chip.move(pos=-2000, vel=10 << 16, max_acc=0x2000, jerk=1 << 24, acc=1 << 14)
    chip.next_cycle(100)
    chip.move(pos=937)
    chip.next_cycle()
    assert chip.status() == 0x0780
    chip.send("SET_PRFL_TRAP")
    chip.next_cycle(400)
    assert (chip.seen("target"), chip.seen("status")) == (-2000, 0x0381)


@spec("PMD-ERR-3", "PMD-TRJ-12")
@pytest.mark.parametrize("switch", ["PosLimit1", "NegLimit1"])
def test_the_present_position_leads_toward_no_limit_switch(bench: Bench, switch: str) -> None:
    bench.drive(switch, 1)
    bench.next_cycle()
    bench.send("CLR_STATUS")
    bench.move(pos=0, vel=4 << 16, acc=4 << 16)
    bench.next_cycle()
    assert bench.status() == 0x0301
    assert bench.rules() == []


@spec("PMD-ERR-3")
def test_with_sensing_off_the_switches_stop_no_move(chip: Bench) -> None:
    chip.send("LMTS_OFF")
    chip.drive("PosLimit1", 1)
    chip.move(pos=10, vel=4 << 16, acc=4 << 16)
    chip.next_cycle(10)
    assert chip.seen("target") == 10
    assert chip.status() == 0x0301


# -- breakpoints ------------------------------------------------------------------------------


def stop_at(bench: Bench, mode: str, value: int = 0) -> None:
    """Arm a breakpoint that stops the axis."""
    bench.send("SET_BRK_PNT", value)
    bench.send("STOP")
    bench.send(mode)


@spec("PMD-UPD-2", "PMD-CMD-27")
def test_time_breakpoint_fires_in_the_cycle_of_that_number(chip: Bench) -> None:
    cruise(chip)
    stop_at(chip, "SET_TIME_BRK", 100)
    chip.run_until(100 * CYCLE - 1)
    assert speed(chip) == 4
    chip.run_for(1)
    assert speed(chip) == 0
    assert chip.seen("status") == 0x0305


@spec("PMD-CMD-27")
@pytest.mark.parametrize("time", [0x7FFF_FFFF, 0xFFFF_FFFF])
@pytest.mark.parametrize("before", [0, 1])
def test_a_time_breakpoint_counts_all_32_bits(chip: Bench, time: int, before: int) -> None:
    cruise(chip)
    stop_at(chip, "SET_TIME_BRK", time - before)
    for bit in range(32):
        chip.probe.time = (time - before ^ 1 << bit) - 1 & 0xFFFF_FFFF
        chip.next_cycle()
        assert speed(chip) == 4
    chip.probe.time = time - before - 1
    chip.next_cycle()
    assert speed(chip) == 0


@spec("PMD-UPD-2")
def test_a_time_that_has_passed_does_not_fire(chip: Bench) -> None:
    chip.next_cycle(50)
    stop_at(chip, "SET_TIME_BRK", 40)
    chip.next_cycle(200)
    assert chip.status() == 0x0300


@spec("PMD-CMD-28", "PMD-UPD-3")
@pytest.mark.parametrize(("value", "stopped"), [(100, 100), (101, 104)])
def test_positive_target_breakpoint(chip: Bench, value: int, stopped: int) -> None:
    cruise(chip)
    stop_at(chip, "SET_POS_BRK", value)
    chip.next_cycle(200)
    # Reached at the end of one cycle, seen at the start of the next.
    assert chip.seen("target") == stopped
    assert chip.status() == 0x0305


@spec("PMD-CMD-28", "PMD-CMD-29", "PMD-UPD-3")
@pytest.mark.parametrize(("mode", "beyond"), [("SET_POS_BRK", -50), ("SET_NEG_BRK", 50)])
def test_a_target_that_is_beyond_the_breakpoint_already_fires(
    chip: Bench, mode: str, beyond: int
) -> None:
    stop_at(chip, mode, beyond)
    chip.next_cycle()
    assert chip.status() == 0x0305


@spec("PMD-CMD-29")
def test_negative_target_breakpoint(chip: Bench) -> None:
    chip.move(pos=-100_000, vel=4 << 16, acc=4 << 16)
    stop_at(chip, "SET_NEG_BRK", -100)
    chip.next_cycle(200)
    assert chip.seen("target") == -100
    assert chip.status() == 0x0305


@spec("PMD-CMD-30", "PMD-CMD-31")
@pytest.mark.parametrize(("mode", "sign"), [("SET_ACTL_POS_BRK", 1), ("SET_ACTL_NEG_BRK", -1)])
def test_actual_position_breakpoints(chip: Bench, mode: str, sign: int) -> None:
    cruise(chip)
    stop_at(chip, mode, sign)
    chip.next_cycle(3)
    assert speed(chip) == 4
    chip.drive("QuadA1" if sign > 0 else "QuadB1", 1)
    chip.next_cycle()
    assert speed(chip) == 0
    assert chip.status() == 0x0305


@spec("PMD-CMD-32", "PMD-UPD-3")
def test_motion_complete_breakpoint_starts_the_next_move(chip: Bench) -> None:
    chip.move(pos=8, vel=4 << 16, acc=4 << 16)
    chip.load(pos=-8)
    chip.send("SET_MTN_CMPLT_BRK")
    chip.next_cycle(20)
    assert chip.seen("target") == -8
    assert chip.status() == 0x0305


@spec("PMD-UPD-3", "PMD-CMD-32")
def test_a_breakpoint_sees_motion_complete_in_the_cycle_after_it(chip: Bench) -> None:
    chip.load(pos=8, vel=4 << 16, acc=4 << 16, buf_mtr_cmd=5)
    chip.send("SET_MTN_CMPLT_BRK")
    chip.send("STOP")
    chip.send("UPDATE")
    chip.next_cycle()
    assert chip.seen("status") == 0x0301
    chip.next_cycle()
    assert chip.seen("status") & 0x0005 == 0x0005


@spec("PMD-CMD-33", "PMD-T-15", "PMD-AMB-30")
def test_the_manual_s_homing_sequence(bench: Bench) -> None:
    assert bench.send("GET_HOME") & 1
    bench.load(pos=12345, vel=23456, acc=345)
    bench.next_cycle()
    bench.send("UPDATE")
    bench.send("SET_EXT_BRK")
    bench.send("STOP")  # long before the cycle in which the update acts
    bench.next_cycle(300)
    assert bench.status() == 0x0700
    bench.drive("~Home1", 0)
    bench.run_until((bench.now // CYCLE + 1) * CYCLE - 1)
    assert speed(bench) > 0
    bench.run_for(1)
    assert speed(bench) == 0
    assert bench.status() == 0x0305


@spec("PMD-CMD-34")
def test_breakpoints_can_be_called_off(chip: Bench) -> None:
    cruise(chip)
    stop_at(chip, "SET_POS_BRK", 100)
    chip.send("SET_BRK_OFF")
    chip.next_cycle(100)
    assert chip.status() == 0x0700


@spec("PMD-UPD-2", "PMD-CMD-38", "PMD-CMD-39")
def test_without_auto_update_a_breakpoint_only_tells(chip: Bench) -> None:
    chip.send("SET_AUTO_UPDATE_OFF")
    cruise(chip)
    stop_at(chip, "SET_POS_BRK", 100)
    chip.next_cycle(100)
    assert chip.status() == 0x0704
    assert speed(chip) == 4
    chip.send("UPDATE")
    chip.next_cycle()
    assert speed(chip) == 0


@spec("PMD-UPD-2")
def test_a_condition_that_holds_already_fires_in_the_next_cycle_and_only_once(
    chip: Bench,
) -> None:
    chip.next_cycle()
    stop_at(chip, "SET_POS_BRK", -5)
    chip.next_cycle()
    assert chip.seen("status") == 0x0305
    assert chip.probe.breakpoint_mode == 0
    chip.send("CLR_STATUS")
    chip.next_cycle(5)
    assert chip.seen("status") == 0x0300


@spec("PMD-UPD-2")
def test_each_axis_has_its_own_breakpoint(chip: Bench) -> None:
    chip.send("SET_2")
    stop_at(chip, "SET_TIME_BRK", 30)
    chip.send("SET_1")
    chip.run_until(31 * CYCLE)
    assert chip.seen("status", 1) == 0x0300
    assert chip.seen("status", 2) == 0x1305
