"""The stepper motor: it follows while it can, loses whole electrical cycles when it cannot."""

from math import cos, pi, sin

import pytest

from vbus.core.state import save
from vbus.plant.stepper import MOST_PIECES, StepperMotor

SAMPLE = 520e-6
"""Default sample period of an MCP-1200 at 8 MHz."""
SLOT = 67.84e-6
"""Microstep period of an MC1241A."""
STEP = 10
"""Encoder counts of a full step: 2000 counts, 200 steps a revolution."""


def motor(period: float = SAMPLE, **settings: float) -> StepperMotor:
    plant = StepperMotor(settings)
    plant.prepare(period)
    return plant


def settle(plant: StepperMotor) -> int:
    """Give no pulses until it rests; return the count."""
    for _ in range(3000):
        plant.pulses(0)
        if plant.resting():
            return plant.count
    raise AssertionError("it does not come to rest")


def travel(plant: StepperMotor, steps: int, top: float, acceleration: float = 5000.0) -> int:
    """Make ``steps`` steps, ramping up to ``top`` steps a second; return the count at rest."""
    sign = 1 if steps > 0 else -1
    speed = place = 0.0
    made = 0
    while made < abs(steps):
        speed = min(speed + acceleration * SAMPLE, top)
        place = min(place + speed * SAMPLE, abs(steps))
        plant.pulses(sign * (int(place) - made))
        made = int(place)
    return settle(plant)


def currents(microsteps: float, three: bool, amplitude: float = 1.0) -> tuple[float, float, float]:
    """Phase currents at an angle given in 1/256 of an electrical cycle."""
    turn = 2 * pi * microsteps / 256
    a = amplitude * sin(turn)
    if not three:
        return a, amplitude * cos(turn), 0.0
    b = amplitude * sin(turn + 2 * pi / 3)
    return a, b, -(a + b)


@pytest.mark.parametrize("top", [50, 100, 200, 235, 300, 500, 1000])
@pytest.mark.parametrize("sign", [1, -1])
def test_below_pull_out_every_step_is_made(top, sign):
    assert travel(motor(), sign * 400, top) == sign * 400 * STEP


def test_without_a_ramp_it_starts_up_to_a_thousand_steps_a_second():
    assert travel(motor(), 400, 1000, 1e9) == 400 * STEP
    assert travel(motor(), 400, 3000, 1e9) != 400 * STEP


@pytest.mark.parametrize(
    ("top", "settings"), [(4000, {}), (800, {"viscous_friction": 0.02}), (800, {"inertia": 1e-3})]
)
def test_overloaded_it_loses_whole_electrical_cycles(top, settings):
    plant = motor(**settings)
    rest = settle(plant)
    lost = 600 * STEP - (travel(plant, 600, top) - rest)
    assert lost != 0
    # Four full steps to an electrical cycle; rest is found within friction's play.
    assert abs((lost + 20) % (4 * STEP) - 20) <= 1


@pytest.mark.parametrize(("least", "holds"), [(0.53, True), (0.46, False)])
@pytest.mark.parametrize("sign", [1, -1])
@pytest.mark.parametrize("three", [False, True])
def test_the_holding_torque_goes_with_the_current_and_carries_a_load_below_it(
    least, holds, sign, three
):
    # 0.5 of 0.4 N*m is the load; friction adds 0.007 N*m at rest. Weakened slowly, as a load
    # that comes suddenly swings through.
    plant = motor(SLOT, load_torque=sign * 0.2, detent_torque=0.0)
    for slot in range(6000):
        plant.phases(*currents(0, three, max(least, 1.0 - slot / 4000)))
    assert (abs(plant.count) <= STEP) is holds
    assert plant.resting() is holds
    if not holds:
        assert plant.count * sign < -10 * STEP


@pytest.mark.parametrize(("load", "holds"), [(0.28, True), (0.42, False)])
def test_a_motor_under_pulses_holds_at_full_torque(load, holds):
    plant = motor(load_torque=load)
    for _ in range(2000):
        plant.pulses(0)
    assert (abs(plant.count) <= STEP) is holds


@pytest.mark.parametrize(("load", "holds"), [(0.03, True), (0.06, False)])
def test_without_current_the_detents_and_friction_hold(load, holds):
    plant = motor(SLOT, load_torque=load, detent_torque=0.04)
    for _ in range(8000):
        plant.phases(0.0, 0.0, 0.0)
    assert (abs(plant.count) <= STEP) is holds


@pytest.mark.parametrize("three", [False, True])
@pytest.mark.parametrize(("speed", "way"), [(0.25, 6400), (-0.25, -6400), (2.0, 12800)])
def test_it_follows_microsteps_smoothly(three, speed, way):
    plant = motor(SLOT)
    place = 0.0
    largest = 0
    while place != way:
        place += speed
        before = plant.count
        plant.phases(*currents(place, three))
        largest = max(largest, abs(plant.count - before))
    while not plant.resting():
        plant.phases(*currents(place, three))
    # 12800 microsteps are 2000 counts.
    assert plant.count == way * 2000 // 12800
    assert largest <= 2


def test_negative_amplitude_pulls_to_the_opposite_side():
    plant = motor(SLOT)
    for _ in range(5000):
        plant.phases(*currents(1, False, -1.0))
    assert abs(plant.count) == 2 * STEP


def test_pulses_are_spread_evenly_over_the_period():
    # A quarter of a second, two pulses: the second comes halfway.
    plant = motor(0.25)
    plant.pulses(2)
    assert plant.count_at(0.45) == STEP
    assert plant.count_at(0.499) == STEP
    assert plant.count_at(0.503) > STEP
    assert plant.count_at(1.0) == 2 * STEP
    assert 0.0 < plant.fraction_at(1) < 0.01
    assert 0.5 < plant.fraction_at(2 * STEP) < 0.51
    for number in range(5):
        plant.pulses(5)
        assert plant.count == (2 + 5 * (number + 1)) * STEP
        for pulse in range(5):
            place = plant.count_at((pulse + 0.95) / 5)
            assert place == (2 + 5 * number + pulse + 1) * STEP


def test_a_microstepping_driver_makes_smaller_steps():
    plant = motor(steps_per_rev=1600)
    for _ in range(100):
        plant.pulses(1)
    assert settle(plant) == pytest.approx(100 * 2000 / 1600, abs=1)


def test_a_pulse_train_beyond_all_reason_moves_the_field_in_leaps():
    plant = motor()
    plant.pulses(1_000_000)
    assert len(plant.course()) == MOST_PIECES + 1
    assert abs(plant.count) < 100
    assert settle(plant) % (4 * STEP) == 0


def test_at_rest_another_period_changes_no_bit():
    plant = motor()
    travel(plant, 37, 500)
    before = save(plant)
    plant.pulses(0)
    assert save(plant) == before
    plant = motor(SLOT)
    for _ in range(8000):
        plant.phases(0.3, 0.4, 0.0)
    assert plant.resting()
    before = save(plant)
    plant.phases(0.3, 0.4, 0.0)
    assert save(plant) == before


def test_a_pulse_that_moves_nothing_is_no_rest():
    plant = motor(steps_per_rev=1 << 20)
    plant.pulses(1)
    assert not plant.resting()


def test_an_end_stop_makes_it_lose_steps():
    plant = motor(stop_low=-1000, stop_high=333)
    assert travel(plant, 200, 500) <= 333
    travel(plant, -200, 500)
    assert plant.count < 0


def test_slow_periods_are_cut_finely_enough_for_the_rotor():
    plant = motor(0.5)
    plant.pulses(1)
    assert settle(plant) == STEP
    assert len(plant.course()) - 1 > 0.5 / 130e-6


def test_full_steps_that_make_no_whole_electrical_cycles_are_refused():
    with pytest.raises(ValueError, match="must be a multiple of 4"):
        StepperMotor({"full_steps": 202})


def test_a_shaft_that_gains_speed_does_not_rest_though_its_place_stays() -> None:
    plant = StepperMotor({"inertia": 1e15, "static_friction": 0.0, "coulomb_friction": 0.0})
    assert plant.phases(0.7, 0.7, 0.0) == 0
    assert plant.velocity != 0.0
    assert not plant.resting()


def test_a_period_of_one_piece_is_divided_anew_when_it_gets_longer():
    speeds = []
    for first in (1e-6, 2e-6):
        plant = motor()
        plant.prepare(first)
        plant.phases(0.0, 0.0, 0.0)
        plant.prepare(2e-6)
        plant.phases(0.7, 0.7, 0.0)
        speeds.append(plant.velocity)
    assert speeds[0] == speeds[1] != 0.0
