"""The stepper motor integrated, beside a solver of differential equations."""

from math import cos, pi, sin
from random import Random

import pytest

from vbus.plant.stepper import MOST_PIECES, StepperMotor

SLOT = 67.84e-6
STEP = 10
"""Encoder counts of a full step."""


def motor(period: float = SLOT, **settings: float) -> StepperMotor:
    plant = StepperMotor(settings)
    plant.prepare(period)
    return plant


def solved(
    settings: dict[str, float], currents: list[tuple[float, float]], period: float
) -> list[tuple[float, float]]:
    """Return speed and place after each period of phase currents, from rest at power-on."""
    solver = pytest.importorskip("scipy.integrate")
    s = {**StepperMotor().settings, **settings}
    inertia, viscous, coulomb, static, load, holding, detent = (float(s[name]) for name in (
        "inertia", "viscous_friction", "coulomb_friction", "static_friction", "load_torque",
        "holding_torque", "detent_torque"))  # fmt: skip
    counts = 4 * float(s["encoder_lines"])
    speed, place, way = 0.0, 0.5, 0.0
    found = []
    for a, b in currents:

        def torque(place: float, a: float = a, b: float = b) -> float:
            angle = 2 * pi * (place - 0.5) / counts * 50
            field = holding * (a * cos(angle) - b * sin(angle))
            return field - detent * sin(4 * angle) - load

        def rate(_: float, y: tuple[float, float]) -> list[float]:
            return [(torque(y[1]) - viscous * y[0] - way * coulomb) / inertia,  # noqa: B023
                    counts / (2 * pi) * y[0]]  # fmt: skip

        def stops(_: float, y: tuple[float, float]) -> float:
            return y[0] * way  # noqa: B023

        stops.terminal, stops.direction = True, -1  # type: ignore[attr-defined]
        left = period
        while left > 0.0:
            if way == 0.0:
                pull = torque(place)
                if abs(pull) <= static:
                    break
                way = 1.0 if pull > 0.0 else -1.0
            done = solver.solve_ivp(
                rate, (0.0, left), (speed, place), method="DOP853", rtol=1e-13, atol=1e-14,
                max_step=period / 10, events=[stops],
            )  # fmt: skip
            speed, place = map(float, done.y[:, -1])
            left -= float(done.t[-1])
            if done.status == 1:
                speed = way = 0.0
            else:
                left = 0.0
        found.append((speed, place))
    return found


@pytest.mark.parametrize("number", range(8))
def test_it_swings_where_a_solver_of_differential_equations_swings(number: int) -> None:
    random = Random(number)
    settings = {
        "inertia": 10 ** random.uniform(-5.2, -4), "viscous_friction": random.choice((0.0, 0.003)),
        "coulomb_friction": 0.003, "static_friction": random.choice((0.003, 0.006)),
        "load_torque": random.choice((0.0, 0.05)), "detent_torque": random.choice((0.0, 0.01)),
    }  # fmt: skip
    period = random.choice((SLOT, 256e-6))
    angle, currents = random.uniform(0.0, 1.5), []
    for _ in range(60):
        angle += random.choice((0.0, 0.05, 0.3))
        currents.append((sin(angle), cos(angle)))
    plant = motor(period, **settings)
    for (a, b), (speed, place) in zip(currents, solved(settings, currents, period), strict=True):
        plant.phases(a, b, 0.0)
        assert plant.count + plant._part == pytest.approx(place, abs=1e-4 * STEP)
        assert plant.velocity == pytest.approx(speed, abs=0.01)


def test_its_error_is_of_fourth_order() -> None:
    currents = [(1.0, 0.2)] * 8
    settings = {"coulomb_friction": 0.0, "static_friction": 0.0}
    _, place = solved(settings, currents[:1], 8 * SLOT)[-1]
    errors = []
    for pieces in (8, 16):
        plant = motor(8 * SLOT / pieces, **settings)
        for _ in range(pieces):
            plant.phases(1.0, 0.2, 0.0)
        errors.append(abs(plant.count + plant._part - place))
    assert 10.0 < errors[0] / errors[1] < 24.0


def test_a_stop_is_met_where_it_stands_and_holds() -> None:
    plant = motor(stop_low=-100, stop_high=12)
    for _ in range(400):
        plant.phases(1.0, -1.0, 0.0)
    assert (plant.count, plant._part, plant.velocity) == (12, 0.5, 0.0)
    assert plant.resting()
    for _ in range(400):
        plant.phases(0.0, 1.0, 0.0)
    assert abs(plant.count) <= 1


def test_a_rotor_that_hits_a_stop_is_pulled_back_for_what_is_left_of_the_step() -> None:
    """The same in short periods, where less of a step is left: it turns back as fast."""
    found = []
    for parts in (1, 16):
        plant = motor(SLOT / parts, stop_low=-100, stop_high=STEP + 5, detent_torque=0.0)
        met = 0
        while plant.count + plant._part < STEP + 5.4:
            met += 1
            for _ in range(parts):
                plant.phases(1.0, 0.0, 0.0)
            assert met < 100
        for _ in range(parts * 3):
            plant.phases(1.0, 0.0, 0.0)
        found.append((met, plant.count + plant._part, plant.velocity))
    (met, place, speed), (met_finely, exact, velocity) = found
    assert (met, velocity < -1.0) == (met_finely, True)
    assert place == pytest.approx(exact, abs=1e-3)
    assert speed == pytest.approx(velocity, abs=0.01)


def test_a_rotor_that_is_all_friction_is_followed_implicitly() -> None:
    plant = motor(inertia=1e-12)
    assert plant._finest == MOST_PIECES
    for _ in range(3):
        plant.phases(0.7, 0.7, 0.0)
        assert abs(plant.count) <= STEP


def test_a_rotor_that_gets_more_friction_is_followed_as_finely_as_that_asks_for() -> None:
    plant = motor()
    for viscous in (3.0, 1e9):
        plant.refit(plant.mechanics()._replace(viscous=viscous))
        for _ in range(50):
            plant.phases(0.7, 0.7, 0.0)
            assert 0 <= plant.count <= STEP
            assert abs(plant.velocity) < 1.0


def test_many_pulses_are_steps_of_their_own() -> None:
    plant = motor(2e-3)
    for _ in range(100):
        plant.pulses(2)
    for _ in range(300):
        plant.pulses(0)
    assert plant.resting()
    assert plant.count == 200 * STEP
