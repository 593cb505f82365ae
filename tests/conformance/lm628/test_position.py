"""Position feedback: quadrature, wraparound, index, home, breakpoint, excessive error."""

import pytest

from tests.conformance.lm628.bench import SAMPLE, Bench, Course
from vbus.chips.lm628.profile import Trajectory
from vbus.core.kernel import NS, US
from vbus.core.signals import HIGH, LOW

ONE = 1 << 16
CLK = 125 * NS
LARGEST = (1 << 30) - 1
UP = (0b10, 0b11, 0b01, 0b00)
"""States of A and B in the order of counting up, after 00."""


def turn(bench: Bench, counts: int, clocks: int = 40, state: int = 0) -> int:
    """Turn the encoder by hand from ``state``; each state lasts so many clocks (at 8 MHz)."""
    order = [0b00, *UP[:3]]
    place = order.index(state)
    for _ in range(abs(counts)):
        place = (place + (1 if counts > 0 else -1)) % 4
        bench.set(A=order[place] >> 1, B=order[place] & 1)
        bench.run(clocks * CLK)
    return order[place]


def real(bench: Bench) -> int:
    bench.next_sample()
    return bench.probe.real_position


# -- quadrature ---------------------------------------------------------------------------------


@pytest.mark.spec("LM-POS-1", "LM-CMD-11")
def test_four_counts_per_line_up_while_a_leads_b_and_down_while_b_leads_a(bench):
    state = turn(bench, 9)
    assert real(bench) == 9
    turn(bench, -20, state=state)
    assert real(bench) == -11
    assert bench.report("RDRP") == -11


@pytest.mark.spec("LM-POS-1", "LM-T-16")
@pytest.mark.parametrize(("hz", "rate"), [(8_000_000, 1_000_000), (6_000_000, 750_000)])
def test_the_highest_state_rate_is_counted_without_loss(hz, rate):
    bench = Bench("strobe", hz=hz)
    step = -(-(10**12) // rate)
    order = UP * 250
    for number, state in enumerate(order):
        bench.at(US + number * step)
        bench.set(A=state >> 1, B=state & 1)
    bench.run(step)
    assert real(bench) == 1000
    assert bench.violations == []


@pytest.mark.spec("LM-POS-1", "LM-T-16")
def test_a_state_of_7_clocks_is_lost():
    bench = Bench("strobe")
    bench.chip.timing_checked = False
    turn(bench, 1)
    turn(bench, 1, clocks=7, state=0b10)
    turn(bench, -1, state=0b11)
    assert real(bench) == 1
    turn(bench, 1, clocks=8, state=0b10)
    turn(bench, -1, clocks=8, state=0b11)
    bench.run(SAMPLE)
    assert real(bench) == 1
    bench.set(A=0, B=0)
    bench.run(8 * CLK - 1)
    assert bench.probe.decoded_count() == 1
    bench.run(1)
    bench.chip.advance()
    assert bench.probe.decoded_count() == 0


@pytest.mark.spec("LM-POS-1")
def test_a_step_of_both_inputs_counts_nothing_and_is_reported(bench):
    bench.set(A=1, B=1)
    bench.run(10 * US)
    assert real(bench) == 0
    assert [(v.rule, v.when) for v in bench.violations] == [("lm628.double-edge", 8 * CLK)]
    turn(bench, 1, state=0b11)
    assert real(bench) == 1


@pytest.mark.spec("LM-POS-1")
def test_the_encoder_nets_are_not_looked_at_while_a_plant_has_the_encoder(make):
    bench = make(plant=Course([5]))
    turn(bench, 3)
    assert real(bench) == 5
    assert bench.violations == []


@pytest.mark.spec("LM-POS-1")
def test_levels_at_power_on_are_a_beginning_and_no_edge():
    bench = Bench("strobe", done=None)
    bench.set(A=1, B=1, **{"/IN": LOW})
    bench.chip.power_on(True)
    bench.command("SIP")
    assert real(bench) == 0
    turn(bench, 1, state=0b11)
    assert real(bench) == 1
    assert bench.rules() == []


# -- range --------------------------------------------------------------------------------------


@pytest.mark.spec("LM-POS-2", "LM-T-11")
@pytest.mark.parametrize(("start", "step", "after"), [(LARGEST, 1, -LARGEST - 1),
                                                      (-LARGEST - 1, -1, LARGEST)])  # fmt: skip
def test_the_real_position_wraps_and_sets_its_flag(make, start, step, after):
    plant = Course()
    bench = make(plant=plant)
    bench.probe.real_position = start
    bench.command("RSTI", 0)
    bench.next_sample()
    assert bench.status() == 0x80
    plant.counts = [step]
    bench.next_sample()
    bench.next_sample()

    assert bench.report("RDRP") == after
    assert bench.status() == 0x90
    assert bench.report("RDRV") == step
    bench.command("RSTI", 0)
    bench.next_sample()
    assert bench.status() == 0x80


@pytest.mark.spec("LM-POS-2", "LM-TRJ-11", "LM-TRJ-13")
def test_the_desired_position_wraps_and_sets_the_same_flag(bench):
    bench.move(0x1800, accel=8 * ONE, velocity=8 * ONE)
    bench.next_sample()
    bench.probe.desired_position = (LARGEST - 3) << 16
    bench.command("RSTI", 0)
    bench.chip.input_changed()
    bench.next_sample()

    assert bench.report("RDDP") == -LARGEST - 1 + 4
    assert bench.probe.target_position == -LARGEST - 1 + 4
    assert bench.status() == 0x10
    bench.command("RSTI", 0)
    bench.next_sample()
    assert bench.status() == 0x00, "once"


@pytest.mark.spec("LM-POS-2", "LM-TRJ-13")
@pytest.mark.parametrize(
    ("start", "after", "status"),
    [(-LARGEST + 3, LARGEST - 3, 0x10), (-LARGEST + 7, -LARGEST - 1, 0x00)],
)
def test_the_desired_position_goes_down_to_its_very_end(bench, start, after, status):
    bench.move(0x0800, accel=8 * ONE, velocity=8 * ONE)
    bench.next_sample()
    bench.probe.desired_position = start << 16
    bench.command("RSTI", 0)
    bench.chip.input_changed()
    bench.next_sample()

    assert bench.report("RDDP") == after
    assert bench.status() == status


# -- index --------------------------------------------------------------------------------------


@pytest.mark.spec("LM-POS-3", "LM-CMD-4", "LM-CMD-10", "LM-AMB-10")
def test_an_armed_index_stores_the_real_position_where_all_three_inputs_are_low(bench):
    bench.command("RSTI", 0)
    assert bench.report("RDIP") == 0
    bench.command("SIP")
    assert bench.report("RDIP") == 0, "SIP alone changes nothing"
    state = turn(bench, 7)
    bench.set(**{"/IN": LOW})
    assert bench.status() == 0x80
    # The state 00 is entered by the next step, and believed 8 clocks later.
    bench.set(A=0, B=0)
    fell = bench.now
    assert state == 0b01
    bench.at(fell + 8 * CLK - 1)
    assert (bench.probe.flags, bench.probe.sip) == (0x00, True)
    bench.at(fell + 8 * CLK)
    assert (bench.probe.flags, bench.probe.sip) == (0x08, False)
    turn(bench, 1)
    bench.set(**{"/IN": HIGH})

    assert bench.report("RDIP") == 8
    assert bench.report("RDSIGS") & 0x09 == 0x08
    assert bench.rules() == ["early-index"]


@pytest.mark.spec("LM-POS-3")
def test_a_second_pulse_does_nothing_until_sip_is_given_again(bench):
    def pulse() -> None:
        turn(bench, 3)
        bench.set(**{"/IN": LOW})
        turn(bench, 1, state=0b01)
        turn(bench, 1)
        bench.set(**{"/IN": HIGH})
        turn(bench, 3, state=0b10)

    pulse()
    assert bench.probe.flags & 0x08 == 0, "not armed"
    bench.command("SIP")
    pulse()
    assert bench.report("RDIP") == 12
    bench.command("RSTI", 0)
    pulse()
    assert bench.report("RDIP") == 12
    assert bench.status() == 0x80
    bench.command("SIP")
    pulse()
    assert bench.report("RDIP") == 28


@pytest.mark.spec("LM-POS-3")
def test_arming_inside_the_index_waits_for_the_next_entry(bench):
    turn(bench, 3)
    bench.set(**{"/IN": LOW})
    turn(bench, 1, state=0b01)
    bench.command("SIP")
    bench.run(SAMPLE)
    assert bench.probe.sip

    turn(bench, 1)
    turn(bench, -1, state=0b10)
    assert not bench.probe.sip
    assert bench.probe.index_position == 4


@pytest.mark.spec("LM-POS-3")
def test_a_switch_on_the_index_input_can_record_the_position_too():
    bench = Bench("cycle")
    turn(bench, 4)
    bench.next_sample()
    bench.command("SIP")
    bench.set(**{"/IN": LOW})
    assert bench.probe.index_position == 4
    assert bench.probe.flags & 0x08


@pytest.mark.spec("LM-POS-3")
def test_an_index_input_held_low_for_more_than_a_turn_is_reported_once(make):
    bench = make(counts_per_turn=40)
    bench.chip.timing_checked = False
    state = turn(bench, 44)
    bench.set(**{"/IN": LOW})
    state = turn(bench, 40, state=state)
    assert bench.rules() == []
    state = turn(bench, 1, state=state)
    assert [(v.rule, v.measured, v.limit) for v in bench.violations] == [
        ("lm628.index-grounded", 41, 40)
    ]
    turn(bench, 60, state=state)
    assert bench.rules() == ["index-grounded"]


@pytest.mark.spec("LM-POS-3")
def test_an_index_input_held_low_since_power_up_is_reported_too(make):
    bench = make(counts_per_turn=40, done=None)
    bench.chip.timing_checked = False
    bench.set(**{"/IN": LOW})
    bench.chip.power_on(True)
    state = turn(bench, 40)
    assert bench.rules() == []
    turn(bench, 1, state=state)
    assert [(v.rule, v.measured, v.limit) for v in bench.violations] == [
        ("lm628.index-grounded", 41, 40)
    ]


def test_a_chip_without_mechanics_comes_to_rest(bench):
    for _ in range(3):
        bench.next_sample()
    bench.chip.advance()
    assert bench.chip.resting()


@pytest.mark.spec("LM-POS-3")
def test_the_index_of_a_plant_is_captured_at_its_own_instant_inside_the_sample(make):
    bench = make(plant=Course([0, 0, 100, 200, 200], turn=150))
    bench.command("RSTI", 0)
    bench.command("SIP")
    # Counts 100 to 200 pass during sample 3 to 4: 150 in the middle.
    middle = 3 * SAMPLE + SAMPLE // 2
    bench.at(middle - 1)
    assert (bench.probe.sip, bench.probe.flags, bench.probe.index_position) == (True, 0, 0)
    bench.at(middle)
    assert (bench.probe.sip, bench.probe.flags, bench.probe.index_position) == (False, 0x08, 150)
    assert bench.pin("HI") == HIGH
    assert bench.report("RDRP") == 100, "the position register is that of the last sample"


@pytest.mark.spec("LM-POS-3")
@pytest.mark.parametrize(
    ("armed_at", "index"), [(0.19, 20), (0.5, 60), (0.21, 40), (0.59, 60), (0.95, 100), (1.05, 120)]
)
def test_the_first_index_after_arming_counts(make, armed_at, index):
    """100 counts from sample 1 to 2 with an index every 20 of them; then 20 more."""
    bench = make(plant=Course([0, 100, 120], turn=20))
    # SIP has its effect when busy falls.
    bench.at(int((1 + armed_at) * SAMPLE) - 15 * US - 210 * NS)
    bench.write(0, 0x03)
    bench.sample(4)
    assert bench.probe.index_position == index
    assert not bench.probe.sip


@pytest.mark.spec("LM-POS-3")
@pytest.mark.parametrize(("early", "index"), [(1, 50), (0, 100)])
def test_an_index_at_the_very_end_of_busy_of_sip_comes_too_early(make, early, index):
    bench = make(plant=Course([0, 100], turn=50))
    middle = SAMPLE + SAMPLE // 2
    bench.at(middle - 15 * US - 210 * NS - early)
    bench.write(0, 0x03)
    assert bench.chip.ready_at() == middle - early
    bench.sample(4)
    assert bench.probe.index_position == index


# -- home ---------------------------------------------------------------------------------------


@pytest.mark.spec("LM-POS-4", "LM-CMD-3")
def test_home_shifts_real_desired_and_active_target_and_nothing_else(make):
    plant = Course()
    bench = make(plant=plant)
    bench.filter(kp=10)
    bench.move(0, accel=ONE, velocity=0x18000, position=300)
    plant.counts = [10, 20, 30]
    for _ in range(6):
        bench.next_sample()
    bench.command("SBPA", 0, 200)
    bench.probe.index_position = 77
    axis = bench.probe
    before = (axis.desired_position, axis.real_position)
    assert before[1] == 30
    assert before[0] % ONE
    error = axis.position_error
    bench.command("DFH")

    assert axis.real_position == 0
    assert axis.desired_position == before[0] - 30 * ONE, "the fraction stays"
    assert axis.target_position == 270
    assert axis.position_loaded == 300, "the buffer keeps its number"
    assert (axis.index_position, axis.breakpoint) == (77, 200)
    bench.next_sample()
    assert abs(axis.position_error - error) <= 4, "the loop feels nothing"
    assert axis.real_change == 0


@pytest.mark.spec("LM-POS-4")
def test_after_home_a_move_ends_in_the_same_place_unless_stt_is_given(make):
    plant = Course([40])
    bench = make(plant=plant)
    bench.next_sample()
    bench.next_sample()
    bench.move(0, accel=4 * ONE, velocity=4 * ONE, position=100)
    bench.next_sample()
    bench.command("DFH")
    for _ in range(30):
        bench.next_sample()
    assert bench.probe.desired_position == 60 * ONE
    assert bench.probe.on_target

    bench.command("STT")
    for _ in range(30):
        bench.next_sample()
    assert bench.probe.desired_position == 100 * ONE


# -- breakpoint ---------------------------------------------------------------------------------


@pytest.mark.spec("LM-POS-5", "LM-CMD-21", "LM-AMB-6")
@pytest.mark.parametrize("sign", [1, -1])
@pytest.mark.parametrize("course", [[40, 99, 100], [40, 99, 150]], ids=["reached", "passed"])
def test_a_breakpoint_fires_in_the_first_sample_at_or_beyond_it(make, sign, course):
    plant = Course()
    bench = make(plant=plant)
    bench.command("RSTI", 0)
    bench.next_sample()
    at = sign * 100 & 0xFFFFFFFF
    bench.command("SBPA", at >> 16, at & 0xFFFF)
    plant.counts = [sign * count for count in course]
    for _ in range(3):
        bench.next_sample()
        assert bench.status() == 0x80
    sample = bench.now // SAMPLE + 1
    bench.at(sample * SAMPLE - 1)
    assert bench.probe.flags == 0
    bench.at(sample * SAMPLE)
    assert bench.probe.flags == 0x40
    assert bench.pin("HI") == LOW, "masked after reset"


@pytest.mark.spec("LM-POS-5")
def test_a_breakpoint_fires_once(make):
    plant = Course()
    bench = make(plant=plant)
    bench.command("SBPA", 0, 10)
    plant.counts = [20, 0, 20]
    for _ in range(4):
        bench.next_sample()
    bench.command("RSTI", 0)
    plant.counts += [0, 20, 0]
    for _ in range(4):
        bench.next_sample()
    assert bench.status() == 0x80
    assert not bench.probe.breakpoint_armed


@pytest.mark.spec("LM-POS-5")
def test_a_breakpoint_at_the_present_position_fires_in_the_next_sample(bench):
    bench.command("RSTI", 0)
    bench.next_sample()
    bench.command("SBPA", 0, 0)
    assert bench.status() == 0x80
    bench.next_sample()
    assert bench.status() == 0xC0


def pass_samples(bench: Bench, number: int) -> None:
    for _ in range(number):
        bench.next_sample()


@pytest.mark.spec("LM-POS-4", "LM-POS-5", "LM-CMD-3")
@pytest.mark.parametrize("sign", [1, -1])
def test_home_does_not_fire_a_breakpoint_that_is_not_reached(make, sign):
    plant = Course([sign * 1000] * 2)
    bench = make(plant=plant)
    pass_samples(bench, 3)
    at = sign * 500 & 0xFFFFFFFF
    bench.command("SBPA", at >> 16, at & 0xFFFF)
    bench.command("RSTI", 0)
    bench.command("DFH")
    plant.counts += [sign * 1499] * 3 + [sign * 1500]
    seen = []
    for _ in range(6):
        bench.next_sample()
        seen.append((sign * bench.probe.real_position, bench.status()))
    assert set(seen) == {(0, 0x80), (499, 0x80), (500, 0xC0)}, "500 is ahead of the new home"


@pytest.mark.spec("LM-POS-5", "LM-POS-4")
def test_a_breakpoint_at_the_new_home_fires_there(make):
    bench = make(plant=Course([100] * 2))
    pass_samples(bench, 3)
    bench.command("SBPA", 0, 0)
    bench.command("RSTI", 0)
    bench.command("DFH")
    assert bench.status() == 0x80
    bench.next_sample()
    assert bench.status() == 0xC0


@pytest.mark.spec("LM-POS-5", "LM-POS-2")
@pytest.mark.parametrize("sign", [1, -1])
@pytest.mark.parametrize(
    ("place", "way", "fires"),
    [
        (0, 20, False),
        (LARGEST - 1, 20, True),
        (LARGEST, 20, True),
        (-LARGEST + 4, 20, True),
        (-LARGEST + 100, 20, False),
        (LARGEST - 500, 20, False),
    ],
)
def test_coming_round_fires_only_a_breakpoint_on_the_way(make, sign, place, way, fires):
    start = LARGEST - 2
    plant = Course([sign * start] * 3)
    bench = make(plant=plant)
    pass_samples(bench, 3)
    at = sign * place & 0xFFFFFFFF
    bench.command("SBPA", at >> 16, at & 0xFFFF)
    bench.command("RSTI", 0)
    plant.counts += [sign * (start + way)]
    pass_samples(bench, 3)
    assert bench.probe.flags & 0x10, "come round"
    assert bool(bench.probe.flags & 0x40) == fires
    if place == -LARGEST + 100:
        plant.counts += [sign * (start + 200)]
        pass_samples(bench, 3)
        assert bench.probe.flags & 0x40, "reached later, from its new side"


@pytest.mark.spec("LM-POS-5", "LM-POS-2")
@pytest.mark.parametrize("sign", [1, -1])
def test_a_breakpoint_here_fires_in_the_next_sample_though_positions_come_round(make, sign):
    bench = make(plant=Course([0, 0, 0, sign * (LARGEST + 100)]))
    pass_samples(bench, 3)
    bench.command("SBPA", 0, 0)
    bench.command("RSTI", 0)
    bench.next_sample()
    assert bench.probe.real_position == sign * (98 - LARGEST)
    assert bench.probe.flags & 0x50 == 0x50


@pytest.mark.spec("LM-CMD-22", "LM-AMB-5", "LM-POS-5")
def test_sbpr_counts_from_the_active_target_and_not_from_buffer_or_real_position(make):
    bench = make(plant=Course([7]))
    bench.move(0, accel=0, velocity=0, position=1000)
    bench.next_sample()
    bench.load(0, position=5000)
    bench.command("SBPR", 0xFFFF, 0xFF9C)
    assert bench.probe.breakpoint == 900
    bench.probe.target_position = LARGEST
    bench.command("SBPR", 0, 2)
    assert bench.probe.breakpoint == -LARGEST, "wrapped to 31 bits"


# -- excessive error ----------------------------------------------------------------------------


def lagging(make, name: str, threshold: int) -> Bench:
    """A bench that holds position 0, with an error limit, and counts yet to come."""
    bench = make(plant=Course())
    bench.filter(kp=100)
    bench.move(0)
    bench.next_sample()
    bench.next_sample()
    bench.command(name, threshold)
    bench.command("RSTI", 0)
    bench.next_sample()
    assert bench.status() == 0x00
    return bench


@pytest.mark.spec("LM-POS-6", "LM-CMD-16")
@pytest.mark.parametrize("sign", [1, -1])
@pytest.mark.parametrize("limit", [50, 0])
def test_an_error_above_the_limit_is_flagged_in_its_sample_and_one_at_it_is_not(make, limit, sign):
    bench = lagging(make, "LPEI", limit)
    bench.plant.counts = [sign * limit, sign * (limit + 1)]
    bench.next_sample()
    bench.next_sample()
    assert (bench.probe.position_error, bench.probe.flags) == (-sign * limit, 0)
    sample = bench.now // SAMPLE + 1
    bench.at(sample * SAMPLE - 1)
    assert bench.probe.flags == 0
    bench.at(sample * SAMPLE)
    assert bench.probe.flags == 0x20
    assert bench.status() == 0x20, "the motor stays on"
    assert bench.probe.motor_command == -sign * (limit + 1) * 100


@pytest.mark.spec("LM-POS-6")
def test_rsti_clears_the_error_flag_only_until_the_next_sample(make):
    bench = lagging(make, "LPEI", 50)
    bench.plant.counts = [60]
    for _ in range(2):
        bench.next_sample()
    bench.command("RSTI", 0)
    assert bench.status() == 0x00
    bench.next_sample()
    assert bench.status() == 0x20
    bench.command("LPEI", 60)
    bench.command("RSTI", 0)
    bench.next_sample()
    assert bench.status() == 0x00


@pytest.mark.spec("LM-POS-6", "LM-CMD-15", "LM-STA-4", "LM-STA-6", "LM-TRJ-10")
def test_lpes_turns_the_motor_off_in_the_very_sample(make):
    bench = lagging(make, "LPES", 50)
    bench.plant.counts = [-60]
    bench.next_sample()
    assert bench.plant.commands[-1] == 0
    bench.next_sample()

    axis = bench.probe
    assert bench.status() == 0xA0, "on target before: trajectory-complete does not rise again"
    assert (axis.motor_command, bench.probe.output_code()) == (0, 0x80)
    assert bench.plant.commands[-1] == 0, "no sample of drive at that error"
    bench.command("RSTI", 0)
    bench.next_sample()
    assert bench.status() == 0x80, "with the motor off the error is not looked at"
    bench.move(0)
    bench.next_sample()
    assert bench.status() == 0x04 or bench.status() == 0x00


@pytest.mark.spec("LM-POS-6", "LM-STA-4")
def test_lpes_in_motion_also_completes_the_trajectory(make):
    bench = make(plant=Course())
    bench.command("LPES", 5)
    bench.move(0x1800, accel=ONE, velocity=ONE)
    bench.command("RSTI", 0)
    while bench.probe.desired_position < 5 * ONE:
        bench.next_sample()
    assert (bench.probe.position_error, bench.status()) == (5, 0x00)
    bench.next_sample()
    assert (bench.probe.position_error, bench.status()) == (6, 0xA4)
    position = bench.probe.desired_position
    bench.next_sample()
    assert (bench.probe.desired_position, bench.probe.desired_velocity) == (position, 0)


@pytest.mark.spec("LM-POS-2")
@pytest.mark.parametrize(("position", "wraps"), [(LARGEST - 1, False), (LARGEST, True)])
def test_the_desired_position_wraps_at_the_first_count_too_many(position: int, wraps: bool) -> None:
    profile = Trajectory()
    profile.hold(position)
    profile.velocity_mode = profile.forward = True
    profile.top = profile.accel = ONE
    profile.step()
    assert profile.wrapped is wraps
    assert profile.desired_position == (-LARGEST - 1 if wraps else LARGEST)
