"""The numbers of a DC motor from a recorded move, with how far the move tells them.

The motor's exact model (:mod:`vbus.plant.dc_motor`) is given the recorded drive, and its numbers
are changed until it goes where the encoder was, by the method of Gauss and Newton with Levenberg's
damping. A reading is the shaft's place rounded down to a count, so the model's is compared with
the middle of that count. What a move cannot tell does not show in what it is compared by; the
covariance of all numbers together says so. Each of them has a wide prior, which makes the equations
solvable whatever the move lacks.
"""

from collections.abc import Sequence
from dataclasses import dataclass, field
from itertools import pairwise
from math import exp, isfinite, log, sqrt
from typing import Final

from vbus.core.errors import VbusError
from vbus.core.options import Settings
from vbus.plant.dc_motor import DcMotor
from vbus.plant.shaft import TWO_PI
from vbus.views.fit.moves import RecordedMove

SURE: Final = 0.02
"""A number is sure if its error is below this part of it, at three standard deviations."""
ROUNDED: Final = sqrt(1.0 / 12.0)
"""Standard deviation of what rounding to a count adds."""
SETTLED: Final = 3e-5
"""A step so small, in units of the parameters, ends the search."""
MOST_ROUNDS: Final = 30
SEARCHES: Final = 4
"""Steps of a search, and searches, at most; both bound the time, and neither is measured."""
PROMISE: Final = 0.01
"""Squares of standard deviations that a step may still promise at the end of a search."""
ASTRAY: Final = 50.0
"""Times the square of rounding and scatter, from which on a model does not follow its motor."""

INERTIA, TORQUE, VISCOUS, COULOMB, LOAD, OFFSET = range(6)
NAMES: Final = (
    "inertia", "torque_constant", "viscous_friction", "coulomb_friction", "load_torque", "",
)  # fmt: skip
UNITS: Final = ("kg*m^2", "N*m/A", "N*m*s", "N*m", "N*m", "counts")
_PRIOR: Final = (2.3, 2.3, 2.0, 1.0, 1.0, 0.5)
"""Standard deviations of what is known before: a factor of ten for inertia and torque constant."""
_BOUNDS: Final = ((-4.6, 4.6), (-4.6, 4.6), (-1.0, 1e3), (0.0, 1e3), (-1e3, 1e3), (-1e3, 1e3))
"""A hundredth and a hundred times what the file has; friction is never below zero."""
NUDGE: Final = 1e-4
"""How far a parameter is changed to see what that changes."""

Vector = list[float]
Matrix = list[Vector]


@dataclass(frozen=True, slots=True)
class Found:
    """A number of the motor.

    Attributes:
        name: as in a board file.
        unit: of it.
        value: what it is, or what the file has, if the run does not tell it.
        error: half of the interval in which it lies with 95 %.
        sure: whether the run tells it to 2 %.
        why: why not, or "".
    """

    name: str
    unit: str
    value: float
    error: float
    sure: bool
    why: str = ""


@dataclass(slots=True)
class Fit:
    """What a move says of its motor.

    Attributes:
        found: its numbers.
        held: numbers of the file that the others hold for, because the run cannot tell them.
        ratios: what it tells of them together: title, value, error, unit.
        rms: how far off the model is, in counts.
        notes: what to know of the run.
        settings: of the motor, with what was found.
    """

    found: list[Found]
    held: list[str]
    ratios: list[tuple[str, float, float, str]]
    rms: float
    notes: list[str] = field(default_factory=list)
    settings: dict[str, float] = field(default_factory=dict)


class MotorFit:
    """A search for the numbers of one motor.

    Args:
        settings: of the motor: what is known of it, and where the search begins.
        move: a move that begins at rest.
        name: what errors call the run.

    Raises:
        VbusError: the motor in the file is none that could move.
    """

    def __init__(self, settings: Settings, move: RecordedMove, name: str) -> None:
        motor = DcMotor(settings)
        self._given: dict[str, float] = {key: float(value) for key, value in motor.settings.items()}
        given = self._given
        volts = min(given["supply"], abs(given["gain"]))
        if not given["torque_constant"] or not given["back_emf"] or not volts:
            raise VbusError(
                f"{name}: a motor with torque_constant, back_emf, gain or supply 0 goes nowhere;"
                " write about what its data sheet says into [plants]"
            )
        self._move = move
        self._induced = given["back_emf"] / given["torque_constant"]
        self._breakaway = (
            given["static_friction"] / given["coulomb_friction"] if given["coulomb_friction"]
            else 1.0
        )  # fmt: skip
        # Friction is counted in parts of what the motor itself brakes with, and can turn at all.
        self._units: Vector = [
            given["inertia"], given["torque_constant"],
            given["torque_constant"] * given["back_emf"] / given["resistance"],
            0.2 * given["torque_constant"] * volts / given["resistance"],
            0.2 * given["torque_constant"] * volts / given["resistance"], 1.0,
        ]  # fmt: skip
        self._start: Vector = [
            0.0, 0.0, given["viscous_friction"] / self._units[VISCOUS],
            given["coulomb_friction"] / self._units[COULOMB],
            given["load_torque"] / self._units[LOAD], 0.0,
        ]  # fmt: skip
        self._seen = [n for n, step in enumerate(move.steps) if step.counted is not None]
        # The same count again and again is one reading: its rounding does not average out.
        self._weights: Vector = []
        counts = [move.steps[n].counted or 0 for n in self._seen]
        run = 0
        for place, count in enumerate(counts):
            if place + 1 == len(counts) or counts[place + 1] != count:
                length = place + 1 - run
                self._weights += [1.0 / length] * length
                run = place + 1
        self._amperes = [n for n, step in enumerate(move.steps) if step.current is not None]
        self._targets: Vector = [count + 0.5 - move.first for count in counts]
        self._targets += [move.steps[n].current or 0.0 for n in self._amperes]
        self._promise = 0.0
        """What a step would gain where the search has ended, in squares of standard deviations."""
        self._astray = 1.0
        """How many times the square of what is left is that of rounding and scatter."""
        self._scatter = [ROUNDED, self._current_scatter()]
        """Standard deviations of a count and of a current."""

    def _current_scatter(self) -> float:
        """Return what the current's readings scatter by, as the curve of three in a row says."""
        values = [self._move.steps[n].current or 0.0 for n in self._amperes]
        curves = sorted(
            abs(a - 2 * b + c) for a, b, c in zip(values[2:], values[1:], values, strict=False)
        )
        grid = sorted(set(values))
        if len(grid) < 2:
            self._amperes = []
            del self._targets[len(self._seen) :]
            return 1.0
        # Steps of the drive are few, so the median is of readings between them; Gauss's has 0.67
        # standard deviations, and a curve has the variance of six readings.
        scatter = curves[len(curves) // 2] / (0.6745 * sqrt(6.0))
        return max(scatter, ROUNDED * min(b - a for a, b in pairwise(grid)))

    # -- the model --------------------------------------------------------------------------------

    def values(self, at: Sequence[float]) -> Vector:
        """Return the numbers in SI units that parameters stand for.

        All torques are counted beside the torque constant, and viscous friction together with what
        back EMF brakes: a change of the torque constant alone then changes little of a motion, so
        the search need not follow a bend.
        """
        units, torque = self._units, exp(at[TORQUE])
        braking = units[VISCOUS] * torque * (1.0 + at[VISCOUS] - torque)
        return [
            units[INERTIA] * exp(at[INERTIA]) * torque, units[TORQUE] * torque, max(braking, 0.0),
            *(unit * one * torque for unit, one in zip(units[COULOMB:], at[COULOMB:], strict=True)),
        ]  # fmt: skip

    def settings(self, values: Sequence[float]) -> dict[str, float]:
        """Return the settings of a motor with these numbers."""
        settings = dict(self._given)
        settings.update(zip(NAMES[:OFFSET], values, strict=False))
        settings["back_emf"] = self._induced * values[TORQUE]
        settings["static_friction"] = self._breakaway * values[COULOMB]
        return settings

    def _run(self, at: Sequence[float]) -> Vector:
        """Return where a motor goes, and what it takes, at the instants that were recorded."""
        motor = DcMotor(self.settings(self.values(at)))
        places: Vector = []
        currents: Vector = []
        period = 0.0
        for step in self._move.steps:
            if step.seconds != period:
                period = step.seconds
                motor.prepare(period)
            motor.drive(step.command, 0)
            if step.counted is not None:
                places.append(motor.place + at[OFFSET])
            if step.current is not None and self._amperes:
                currents.append(motor.current)
        return places + currents

    # -- the search -------------------------------------------------------------------------------

    def _sigmas(self) -> Vector:
        counts, amperes = self._scatter
        return [counts / sqrt(w) for w in self._weights] + [amperes] * len(self._amperes)

    def _misses(self, at: Vector) -> tuple[Vector, float]:
        """Return how far off the model is, and what is to be as small as may be."""
        misses = [
            (target - value) / sigma
            for target, value, sigma in zip(
                self._targets, self._run(at), self._sigmas(), strict=True
            )
        ]
        known = sum(
            ((one - was) / prior) ** 2
            for one, was, prior in zip(at, self._start, _PRIOR, strict=True)
        )
        return misses, sum(miss * miss for miss in misses) + known

    def _slopes(self, at: Vector, free: Sequence[int], misses: Vector) -> Matrix:
        """Return, for each parameter, how what is compared changes with it."""
        slopes: Matrix = []
        for one in free:
            there = list(at)
            there[one] += NUDGE
            after, _ = self._misses(there)
            slopes.append([(a - b) / NUDGE for a, b in zip(misses, after, strict=True)])
        return slopes

    def _normal(self, slopes: Matrix, free: Sequence[int]) -> Matrix:
        normal = [[sum(map(_times, row, column)) for column in slopes] for row in slopes]
        for place, one in enumerate(free):
            normal[place][place] += 1.0 / _PRIOR[one] ** 2
        return normal

    def _pull(self, at: Vector, free: Sequence[int], slopes: Matrix, misses: Vector) -> Vector:
        return [
            sum(map(_times, row, misses)) + (self._start[one] - at[one]) / _PRIOR[one] ** 2
            for row, one in zip(slopes, free, strict=True)
        ]

    def search(self, at: Vector, free: Sequence[int]) -> Vector:
        """Return the parameters that fit best; those that are not free stay."""
        damping = 1e-3
        misses, cost = self._misses(at)
        slopes = self._slopes(at, free, misses)
        for _ in range(MOST_ROUNDS):
            normal = self._normal(slopes, free)
            pull = self._pull(at, free, slopes, misses)
            damped = [
                [value * (1.0 + damping) if n == place else value for n, value in enumerate(row)]
                for place, row in enumerate(normal)
            ]
            ways = solved(damped, [pull])[0]
            there = list(at)
            for one, way in zip(free, ways, strict=True):
                there[one] += max(-1.0, min(1.0, way))
                low, high = _BOUNDS[one]
                there[one] = max(low, min(high, there[one]))
            # No viscous friction: back EMF alone brakes.
            there[VISCOUS] = max(there[VISCOUS], exp(there[TORQUE]) - 1.0)
            step = max(abs(b - a) for a, b in zip(at, there, strict=True))
            found, less = self._misses(there)
            if isfinite(less) and less <= cost:
                at, misses, cost, damping = there, found, less, max(damping * 0.1, 1e-9)
                if step < SETTLED:
                    break
                slopes = self._slopes(at, free, misses)
            elif step < SETTLED:
                break
            else:
                damping *= 10.0
        return at

    def covariance(self, at: Vector, free: Sequence[int]) -> Matrix:
        """Return how far parameters may be off together."""
        misses, _ = self._misses(at)
        slopes = self._slopes(at, free, misses)
        normal = self._normal(slopes, free)
        unit = [[float(n == m) for n in range(len(free))] for m in range(len(free))]
        # What is left is no noise of its own in each reading, so there are fewer of them than rows.
        counted = misses[: len(self._seen)]
        whole = sum(map(_times, counted, counted)) or 1.0
        echo = sum(map(_times, counted, counted[1:])) / whole
        more = max((1.0 + echo) / (1.0 - echo), 1.0) if echo < 0.999 else 2000.0
        self._astray = max(1.0, whole / sum(self._weights), self._current_astray(misses))
        # At the best fit no step promises more; one that does was not to be had, at a kink.
        pull = self._pull(at, free, slopes, misses)
        self._promise = sum(map(_times, pull, solved(normal, [pull])[0])) / self._astray
        return [[more * self._astray * value for value in row] for row in solved(normal, unit)]

    def _current_astray(self, misses: Vector) -> float:
        off = misses[len(self._seen) :]
        return sum(map(_times, off, off)) / len(off) if off else 0.0

    def fit(self) -> Fit:
        """Return what the move says."""
        every = list(range(6))
        # Without a current, back EMF and friction brake alike: torques are known beside each other
        # alone, and the torque constant of the file is taken.
        free = every if self._amperes else [one for one in every if one != TORQUE]
        at = list(self._start)
        at[TORQUE] = self._first_torque() if self._amperes else 0.0
        at[VISCOUS] += exp(at[TORQUE]) - 1.0
        at = self.search(at, [INERTIA, OFFSET])
        # Where the shaft sticks is no smooth function of the numbers: a search that has become
        # timid there is begun again.
        for _ in range(SEARCHES):
            at = self.search(at, free)
        return self._told(at, free)

    def _first_torque(self) -> float:
        """Return about which torque constant the current says: what is left of the voltage."""
        given, before = self._given, float(self._move.first)
        left = squares = 0.0
        for step in self._move.steps:
            if step.counted is not None and step.current is not None:
                speed = (step.counted - before) / step.seconds * TWO_PI / 4 / given["encoder_lines"]
                volts = max(-given["supply"], min(given["supply"], step.command * given["gain"]))
                left += speed * (volts - given["resistance"] * step.current)
                squares += speed * speed
                before = float(step.counted)
        found = left / squares / given["back_emf"] if squares else 1.0
        return log(max(0.1, min(10.0, found)))

    # -- what came of it --------------------------------------------------------------------------

    def _told(self, at: Vector, free: Sequence[int]) -> Fit:
        values = self.values(at)
        spread = self.covariance(at, free)
        errors = [0.0] * 6
        nudged = []
        for one in free:
            there = list(at)
            there[one] += NUDGE
            nudged.append(self.values(there))
        for one in range(OFFSET):
            slope = [(row[one] - values[one]) / NUDGE for row in nudged]
            along = [sum(map(_times, slope, row)) for row in spread]
            errors[one] = 1.96 * sqrt(max(sum(map(_times, slope, along)), 0.0))
        found = [
            self._one(one, values, errors) for one in range(OFFSET) if one in free
        ]  # fmt: skip
        held = [] if TORQUE in free else ["torque_constant", "back_emf"]
        off = [a - b for a, b in zip(self._targets, self._run(at), strict=True)][: len(self._seen)]
        fit = Fit(
            found,
            held,
            [],
            sqrt(sum(miss * miss for miss in off) / len(off)),
            settings=self.settings(values),
        )
        if held:
            share = sqrt(max(spread[free.index(INERTIA)][free.index(INERTIA)], 0.0))
            per = values[INERTIA] / values[TORQUE]
            fit.ratios.append(
                ("inertia / torque_constant", per, 1.96 * share * per, "kg*m^2*A/(N*m)")
            )
        self._note(fit, values)
        return fit

    def _one(self, one: int, values: Vector, errors: Vector) -> Found:
        value, error = values[one], errors[one]
        size = max(abs(value), values[COULOMB]) if one == LOAD else abs(value)
        sure = (
            self._astray < ASTRAY and self._promise < PROMISE and 3.0 / 1.96 * error <= SURE * size
        )
        return Found(
            NAMES[one], UNITS[one], value, error, sure, "" if sure else self._why(one, values)
        )

    def _why(self, one: int, values: Vector) -> str:
        """Return what the run lacks for a number."""
        if self._astray >= ASTRAY:
            return "the model does not follow this run"
        counts = [self._move.steps[n].counted or 0 for n in self._seen]
        low, high = min(counts), max(counts)
        first = self._move.first
        one_way = min(high - first, first - low) * 20 < high - low and not any(
            (b - a) * (high - first - (first - low)) < 0 and abs(b - a) > 1
            for a, b in pairwise(counts)
        )  # fmt: skip
        if one in (COULOMB, LOAD) and one_way:
            return "the axis never turns back: dry friction and load pull alike all the way"
        seconds = sum(step.seconds for step in self._move.steps)
        braking = values[VISCOUS] + (
            self._induced * values[TORQUE] ** 2 / self._given["resistance"]
        )  # fmt: skip
        settles = values[INERTIA] / braking
        if seconds < 2 * settles:
            return (
                f"the move takes {1000 * seconds:.3g} ms, and the mechanical time constant is"
                f" {1000 * settles:.3g} ms; record one of some time constants"
            )
        if one == VISCOUS and values[one] < 0.2 * braking:
            return "the motor's own back EMF brakes far more; a current would tell them apart"
        if self._promise >= PROMISE:
            return "the search has not settled: choose another part of the run with --from and --to"
        return "its part of the motion is too small beside the rounding to counts"

    def _note(self, fit: Fit, values: Vector) -> None:
        turned = 360 * fit.rms / (4 * self._given["encoder_lines"])
        if self._astray >= ASTRAY:
            fit.notes.append(
                f"the model is {fit.rms:.3g} counts ({turned:.2g} degrees) off in the mean: look at"
                " resistance, supply, gain and encoder_lines of the file, and at what hangs on the"
                " shaft; the errors are no more than a hint then"
            )
        if fit.held:
            fit.notes.append(
                "no current was recorded: a run tells torques beside each other alone, so inertia,"
                " friction and load hold for the file's torque_constant ="
                f" {values[TORQUE]:g} N*m/A and back_emf = {self._induced * values[TORQUE]:g} V*s"
            )


def _times(a: float, b: float) -> float:
    return a * b


def solved(matrix: Matrix, columns: Matrix) -> Matrix:
    """Return the solutions of linear equations whose matrix is positive, by Gauss' elimination.

    Args:
        matrix: its rows.
        columns: right sides.
    """
    size = len(matrix)
    rows = [list(row) + [column[n] for column in columns] for n, row in enumerate(matrix)]
    for n in range(size):
        pivot = max(range(n, size), key=lambda m: abs(rows[m][n]))
        rows[n], rows[pivot] = rows[pivot], rows[n]
        rows[n] = [value / rows[n][n] for value in rows[n]]
        for m in range(size):
            if m != n:
                rows[m] = [a - rows[m][n] * b for a, b in zip(rows[m], rows[n], strict=True)]
    return [[row[size + n] for row in rows] for n in range(len(columns))]
