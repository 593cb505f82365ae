"""The DC motor solved exactly, beside a solver of differential equations."""

from collections.abc import Callable
from dataclasses import dataclass
from math import floor, inf, log, pi
from random import Random

import pytest

from vbus.core.state import load, save
from vbus.plant.dc_motor import DcMotor
from vbus.plant.response import TICKS

PERIOD = 256e-6
TOLERANCE = 1e-9


def motor(period: float = PERIOD, **settings: float) -> DcMotor:
    plant = DcMotor(settings)
    plant.prepare(period)
    return plant


# -- beside a solver --------------------------------------------------------------------------


@dataclass
class Model:
    """The motor's equations, written down once more."""

    settings: dict[str, float]
    current: float = 0.0
    speed: float = 0.0
    place: float = 0.5
    turning: float = 0.0
    """1.0 or -1.0: the way it turns; 0.0: it stands."""

    def __post_init__(self) -> None:
        s = {**DcMotor().settings, **self.settings}
        self.r, self.l, self.kt, self.ke, self.j, self.b = (float(s[name]) for name in (
            "resistance", "inductance", "torque_constant", "back_emf", "inertia",
            "viscous_friction"))  # fmt: skip
        self.load, self.coulomb, self.static = (
            float(s[name]) for name in ("load_torque", "coulomb_friction", "static_friction")
        )
        self.counts = 4 * float(s["encoder_lines"]) / (2 * pi)
        stopped = s["stop_low"] != s["stop_high"]
        self.low = float(s["stop_low"]) + 0.5 if stopped else -inf
        self.high = float(s["stop_high"]) + 0.5 if stopped else inf
        self.now = 0.0
        self.events = 0

    def amperes(self, current: float, speed: float, volts: float) -> float:
        return current if self.l else (volts - self.ke * speed) / self.r

    def rates(self, volts: float) -> Callable[[float, tuple[float, ...]], list[float]]:
        def rate(_: float, y: tuple[float, ...]) -> list[float]:
            current, speed, _place = y
            amperes = self.amperes(current, speed, volts)
            moved = (volts - self.r * current - self.ke * speed) / self.l if self.l else 0.0
            if self.turning == 0.0:
                return [moved, 0.0, 0.0]
            torque = self.kt * amperes - self.b * speed - self.load - self.turning * self.coulomb
            return [moved, torque / self.j, self.counts * speed]

        return rate

    def pull(self, volts: float) -> float:
        return self.kt * self.amperes(self.current, self.speed, volts) - self.load

    def run(self, volts: float, seconds: float) -> None:
        """Go on for so long."""
        solver = pytest.importorskip("scipy.integrate")
        left = seconds
        while left > 0.0:
            if self.speed == 0.0 and self.turning == 0.0:
                pull = self.pull(volts)
                if pull > self.static and self.place < self.high:
                    self.turning = 1.0
                elif pull < -self.static and self.place > self.low:
                    self.turning = -1.0

            def stops(_: float, y: tuple[float, ...]) -> float:
                return y[1] * self.turning

            def breaks(_: float, y: tuple[float, ...]) -> float:
                pull = self.kt * self.amperes(y[0], 0.0, volts) - self.load
                up = self.static - pull if self.place < self.high else 1.0
                down = self.static + pull if self.place > self.low else 1.0
                return min(up, down)

            def meets(_: float, y: tuple[float, ...]) -> float:
                return self.high - y[2] if self.turning > 0.0 else y[2] - self.low

            stops.terminal = breaks.terminal = meets.terminal = True  # type: ignore[attr-defined]
            stops.direction = breaks.direction = meets.direction = -1  # type: ignore[attr-defined]
            events = [breaks]
            if self.turning != 0.0:
                events = [stops, *([meets] if self.high < inf else [])]
            found = solver.solve_ivp(
                self.rates(volts), (0.0, left), (self.current, self.speed, self.place),
                method="DOP853", rtol=3e-14, atol=1e-15, max_step=seconds / 30, events=events,
            )  # fmt: skip
            assert found.success
            self.current, self.speed, self.place = map(float, found.y[:, -1])
            if found.status == 1:
                self.events += 1
                left -= float(found.t[-1])
                if self.turning == 0.0:
                    self.turning = 1.0 if self.pull(volts) > 0.0 else -1.0
                else:
                    if len(found.t_events) > 1 and len(found.t_events[1]):
                        self.place = self.high if self.turning > 0.0 else self.low
                    self.speed = self.turning = 0.0
            else:
                left = 0.0
        self.current = self.amperes(self.current, self.speed, volts)


def random_motor(random: Random, number: int) -> dict[str, float]:
    """Return a motor with a mechanical time constant of some periods to some thousand."""
    resistance = 10 ** random.uniform(-0.5, 1.5)
    constant = 10 ** random.uniform(-2, -0.7)
    inertia = constant * constant / resistance * 10 ** random.uniform(-3, -1)
    stall = constant * 24.0 / resistance
    coulomb = stall * random.choice((0.002, 0.01, 0.1))
    made = {
        "resistance": resistance,
        "inductance": resistance * 10 ** random.uniform(-4.5, -2.5) if number % 5 else 0.0,
        "torque_constant": constant, "back_emf": constant * random.uniform(0.9, 1.0),
        "inertia": inertia, "viscous_friction": random.choice((0.0, constant**2 * 0.01)),
        "coulomb_friction": coulomb, "static_friction": coulomb * random.choice((1.0, 1.5)),
        "load_torque": stall * random.choice((0.0, 0.0, 0.05, -0.3)),
    }  # fmt: skip
    if number % 3 == 0:
        made |= {"stop_low": -random.randrange(1, 60), "stop_high": random.randrange(1, 60)}
    return made


@pytest.mark.parametrize("number", range(24))
def test_it_goes_where_a_solver_of_differential_equations_goes(number: int) -> None:
    random = Random(number)
    settings = random_motor(random, number)
    period = random.choice((67.84e-6, 256e-6, 1e-3))
    plant, model = motor(period, **settings), Model(settings)
    for _ in range(6):
        command = random.choice((0.0, 1.0, -1.0, random.uniform(-1, 1), random.uniform(-0.1, 0.1)))
        for _ in range(random.randrange(1, 4)):
            plant.drive(command, 0)
            model.run(24.0 * command, period)
            most = 24.0 / settings["resistance"]
            assert plant.current == pytest.approx(
                model.current, rel=TOLERANCE, abs=TOLERANCE * most
            )
            assert plant.velocity == pytest.approx(
                model.speed, rel=TOLERANCE, abs=TOLERANCE * 24.0 / settings["back_emf"]
            )
            assert plant.count + plant._part == pytest.approx(model.place, rel=1e-9, abs=1e-8)


def test_its_course_within_a_period_is_the_solvers() -> None:
    random = Random(5)
    settings = {"stop_low": -30, "stop_high": 30}
    plant, model = motor(**settings), Model(settings)
    for command in (1.0, 1.0, 1.0, -1.0, -1.0, -1.0, -1.0, -1.0, 0.0, 0.0):
        before = Model(settings, model.current, model.speed, model.place, model.turning)
        plant.drive(command, 0)
        start = plant.count_at(0.0)
        seen = {start}
        for part in sorted(random.random() for _ in range(8)):
            there = Model(settings, before.current, before.speed, before.place, before.turning)
            there.run(24.0 * command, part * PERIOD)
            assert plant.count_at(part) == floor(there.place)
            seen.add(plant.count_at(part))
        model.run(24.0 * command, PERIOD)
        for count in seen - {start}:
            there = Model(settings, before.current, before.speed, before.place, before.turning)
            part = plant.fraction_at(count)
            there.run(24.0 * command, part * PERIOD)
            # Going down, a count is reached when the one above it is left.
            border = count if count > start else count + 1
            assert there.place == pytest.approx(border, abs=1e-8)


# -- what happens within a period -------------------------------------------------------------


@pytest.mark.parametrize("way", [1.0, -1.0])
def test_a_speed_that_comes_down_to_nothing_and_rises_again_within_a_period_is_seen(way) -> None:
    # Braked by its current, which the amplifier turns round within the period.
    free = {"coulomb_friction": 0.002, "static_friction": 0.002, "inductance": 0.002}
    found = set()
    for hundredths in range(20, 900):
        plant, model = motor(1e-3, **free), Model(free)
        plant.current = model.current = -way * 2.0
        plant.velocity = model.speed = way * hundredths / 100
        model.turning = way
        if hundredths % 20 == 0:
            model.run(way * 24.0, 1e-3)
            plant.drive(way, 0)
            assert plant.velocity == pytest.approx(model.speed, abs=1e-7)
            assert plant.count + plant._part == pytest.approx(model.place, abs=1e-8)
            found.add(model.events)
    assert found == {0, 2}, "some pass zero twice, and some do not"


def test_a_shaft_breaks_away_when_its_current_holds_it_no_longer() -> None:
    # 1 A of 9.6 A at 0.03 N*m/A: after ln(9.6 / 8.6) time constants of 2 ms.
    plant = motor(inductance=5e-3, static_friction=0.03, coulomb_friction=0.03)
    plant.drive(1.0, 0)
    travel = plant._travel
    after = log(9.6 / 8.6) * 2e-3 / PERIOD
    instants = []
    for part in (after - 1e-9, after + 1e-9):
        plant._from_the_beginning()
        tick = int(part * TICKS)
        travel.go(tick, 0.0, 0.0)
        instants.append(travel.speed > 0.0)
    assert instants == [False, True]


def test_a_shaft_that_friction_neither_holds_nor_lets_go_is_held_in_the_end() -> None:
    # At the very torque of dry friction rounding decides; a period still comes to an end.
    plant = motor(inductance=0.0, static_friction=0.0, coulomb_friction=0.0, viscous_friction=0.0)
    for torque in (0.0, 1e-18, -1e-18, 0.288):
        plant.load = torque
        plant._solve()
        for command in (0.0, 1.0, 1.0, 0.0, -1.0, 0.0):
            plant.drive(command, 0)
            assert abs(plant.velocity) < 801.0 + torque * 1e5


def test_two_periods_are_one_of_twice_the_length() -> None:
    fine, coarse = motor(PERIOD / 2), motor(PERIOD)
    for command in (1.0, 0.4, -1.0, -0.02, 0.02, 0.0, 0.0):
        for _ in range(20):
            fine.drive(command, 0)
            fine.drive(command, 0)
            coarse.drive(command, 0)
            assert fine.current == pytest.approx(coarse.current, rel=1e-11, abs=1e-11)
            assert fine.velocity == pytest.approx(coarse.velocity, rel=1e-11, abs=1e-9)
            assert fine.count + fine._part == pytest.approx(coarse.count + coarse._part, abs=1e-9)


def test_two_lengths_by_turns_are_those_of_a_motor_that_knows_neither() -> None:
    """A motor keeps what the length before this one comes to: the fast way of ``prepare``."""
    plant, other = motor(), motor()
    for turn, command in enumerate((1.0, 0.4, -1.0, -0.02, 0.02, 0.0) * 20):
        period = PERIOD * ((1.0, 1.7)[turn % 2] if turn % 9 else 2.3)
        plant.prepare(period)
        other.prepare(3 * PERIOD)
        other.prepare(5 * PERIOD)
        other.prepare(period)
        assert plant.drive(command, 0) == other.drive(command, 0)
        assert save(plant) == save(other)


# -- what is kept -----------------------------------------------------------------------------


def test_saved_within_a_period_it_has_the_same_course() -> None:
    plant = motor(stop_high=70, stop_low=-5)
    for command in (1.0, 1.0, 1.0, 1.0, -1.0, -1.0):
        plant.drive(command, 0)
        copy = motor(stop_high=70, stop_low=-5)
        load(copy, save(plant))
        parts = [number / 97 for number in range(98)]
        assert [copy.count_at(part) for part in parts] == [plant.count_at(part) for part in parts]
        counts = range(min(plant.count_at(0.0), plant.count), plant.count + 1)
        assert [copy.fraction_at(n) for n in counts] == [plant.fraction_at(n) for n in counts]


def test_a_motor_that_changes_within_a_period_ends_it_as_it_began_it() -> None:
    plant, other = motor(), motor()
    for _ in range(30):
        plant.drive(1.0, 0)
        other.drive(1.0, 0)
    plant.refit(plant.mechanics()._replace(load=0.2))
    for part in range(17):
        assert plant.count_at(part / 16) == other.count_at(part / 16)
    assert plant.fraction_at(plant.count) == pytest.approx(other.fraction_at(plant.count), abs=1e-4)
    plant.drive(1.0, 0)
    other.drive(1.0, 0)
    assert plant.velocity < other.velocity
    plant.jam()
    assert plant.velocity == 0.0
    assert plant.count_at(0.5) > plant.count_at(0.0)


def test_a_shaft_that_leaves_what_a_stop_has_come_to_within_a_period_is_not_moved_by_it() -> None:
    places = []
    for stopped in (False, True):
        plant = motor()
        for _ in range(200):
            plant.drive(-1.0, 0)
        if stopped:
            stop = {"low": -100_000, "high": plant.count - 5, "stopped": True}
            plant.refit(plant.mechanics()._replace(**stop))
        plant.drive(-1.0, 0)
        places.append((plant.count, plant._part, plant.velocity))
    assert places[0] == places[1]


def test_motors_of_a_kind_share_what_they_are_worked_out_with() -> None:
    assert motor()._response is motor()._response
    assert motor()._response is not motor(inertia=6e-6)._response
