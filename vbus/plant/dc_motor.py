"""A brushed DC motor behind a voltage amplifier."""

from typing import ClassVar, Final

from mypy_extensions import i64

from vbus.core.options import Option, Settings
from vbus.core.signals import Value, ValueTable
from vbus.core.state import Names
from vbus.plant.encoder import bounded, floor
from vbus.plant.response import NONE, TICKS, Motor, Response, response_of
from vbus.plant.shaft import LOAD_TORQUE, SHAFT_OPTIONS, TWO_PI, Mechanics, Shaft, mass_options
from vbus.plant.travel import NOWHERE, Travel

MOST_DRIVEN: Final = 10.0
"""Times what its voltages drive: no motor takes that; a saved current is checked by it."""
NO_CURRENT: Final = 1e-12
"""Amperes below which a decaying current is over; it would fade for hundreds of periods more."""
CORNERS: Final = 64
"""Straight pieces that the course of a period is drawn in, if the motor changes in its midst."""
_PARTS: Final = 17179869184.0
"""Ticks of a period."""
_STANDS: Final = Travel(Motor(1.0, 0.0, 0.0, 0.0, 1.0, 0.0, 1.0))
"""The way of a motor whose numbers are not known yet: none."""


class DcMotor(Shaft):
    """Amplifier, armature and shaft; the defaults are a small 24 V servo motor.

    Armature and shaft are solved exactly, from one change of direction, stop or break-away to the
    next, and so is every place within a period. No choice of parameters and period makes them
    unstable; without inductance the current follows at once.

    With a servo period of 256 us and 500 lines, the defaults run at up to 65 counts a period,
    and have a mechanical time constant of 14 ms.
    """

    TAKES: ClassVar[tuple[str, ...]] = ("drive",)
    OPTIONS: ClassVar[tuple[Option, ...]] = (
        *SHAFT_OPTIONS,
        Option("supply", "V", 24.0, "supply of the amplifier, where its output saturates",
               low=0.0),
        Option("gain", "V", 24.0, "output of the amplifier at full command"),
        Option("resistance", "ohm", 2.5, "resistance of armature and amplifier", low=1e-6),
        Option("inductance", "H", 0.0005, "inductance of the armature; 0 to neglect it", low=0.0),
        Option("torque_constant", "N*m/A", 0.03, "torque for each ampere", low=0.0),
        Option("back_emf", "V*s", 0.03, "voltage induced for each rad/s", low=0.0),
        *mass_options(inertia=5e-6, viscous=1e-6, coulomb=0.002, static=0.0025),
    )  # fmt: skip

    VALUES: ClassVar[ValueTable] = ValueTable(
        Value("motor current", "current", unit="A", key="current", lane="current", step=1e-4),
        LOAD_TORQUE,
    )
    STATE: ClassVar[Names] = (
        "current: float", *Shaft.STATE, "_volts: float", "_began: float",
        "departed: float", "_solved: bool",
    )  # fmt: skip
    WIRING: ClassVar[Names] = ("_supply", "_torque_constant")
    DERIVED: ClassVar[Names] = ("_other_period", "_response", "_other_response", "_travel")

    def __init__(self, settings: Settings | None = None) -> None:
        super().__init__(settings)
        self.current: float = 0.0
        """Current in the armature (A)."""
        self._supply: float = float(self.settings["supply"])
        self._amplifier: float = float(self.settings["gain"])
        self._resistance: float = float(self.settings["resistance"])
        self._inductance: float = float(self.settings["inductance"])
        self._torque_constant: float = float(self.settings["torque_constant"])
        self._back_emf: float = float(self.settings["back_emf"])
        # Amplifier and current at the start of the last period.
        self._volts: float = 0.0
        self._began: float = 0.0
        # The course of the last period follows from its beginning.
        self._solved: bool = False
        # What a period comes to, and one of the length before this one.
        self._other_period: float = 0.0
        self._response: Response = NONE
        self._other_response: Response = self._response
        self._travel: Travel = _STANDS
        self.prepare(256e-6)

    def after_load(self) -> None:
        """Refuse a current that cannot be; the shaft does the rest."""
        super().after_load()
        # A stop takes the speed at once; the current that the speed has driven fades.
        driving = float(self.settings["supply"]) + self._back_emf * self.fastest
        if abs(self.current) * self._resistance > MOST_DRIVEN * driving:
            raise ValueError(f"a motor that takes {self.current:g} A")

    def prepare(self, period: float) -> None:
        """Set the length of a period in seconds."""
        # Chips that change their drive twice a sample have two lengths by turns. Fast way: a period
        # and its length take half as long as with each length worked out anew (fast_ways.py).
        before = self.seconds
        again = period == self._other_period
        response = self._response
        self._response = self._other_response
        self._other_response = response
        super().prepare(period)
        if not again:
            self._solve()
        self._other_period = before

    def mechanics(self) -> Mechanics:
        """Return the numbers as they are now; change them and give them to :meth:`refit`."""
        return super().mechanics()._replace(torque=self._torque_constant, supply=self._supply)

    def refit(self, mechanics: Mechanics) -> None:
        """Turn with other numbers from the next period on; the one under way keeps its course."""
        super().refit(mechanics)
        self._torque_constant = mechanics.torque
        self._supply = mechanics.supply
        self._solve()

    def _solve(self) -> None:
        """Make what a period, and what may happen in it, is worked out with."""
        # What was prepared before may be of another motor: faults change it.
        self._other_period = 0.0
        motor = Motor(
            self._resistance, self._inductance, self._torque_constant, self._back_emf,
            self.inertia, self.viscous, self.revolution / TWO_PI,
        )  # fmt: skip
        self._response = response_of(motor, self.seconds)
        travel = self._travel = Travel(motor)
        travel.load, travel.coulomb, travel.static = self.load, self.coulomb, self.static

    def drive(self, command: float, error: i64) -> i64:
        """Run one period with ``command`` of full scale (-1.0 to 1.0) at the amplifier."""
        self.depart()
        volts = command * self._amplifier
        supply = self._supply
        if volts > supply:
            volts = supply
        elif volts < -supply:
            volts = -supply
        self._volts, self._began, self.departed = volts, self.current, self.velocity
        self.untraced = True
        self._solved = True
        here = self.settled(self._leap(volts))
        self.rests = (
            here == self.first and self.velocity == self.departed and self.current == self._began
        )
        return self.arrive(here)

    def _leap(self, volts: float) -> float:
        """Run the period in one, if nothing happens in it; return where it leads."""
        current, speed = self.current, self.velocity
        if speed == 0.0 or self._response.coarsest > 0 or self._response.instant:
            return self._go(TICKS)
        span = self._response.whole
        way = 1.0 if speed > 0.0 else -1.0
        torque = -self.load - way * self.coulomb
        constant, viscous = self._torque_constant, self.viscous
        pull = constant * current - viscous * speed + torque
        after = current + (
            span.current_of_current * current + span.current_of_speed * speed
            + (span.current_of_volts * volts + span.current_of_torque * torque)
        )  # fmt: skip
        faster = speed + (
            span.speed_of_current * current + span.speed_of_speed * speed
            + (span.speed_of_volts * volts + span.speed_of_torque * torque)
        )  # fmt: skip
        if way * faster <= 0.0:
            return self._go(TICKS)
        if way * pull < 0.0 and way * (constant * after - viscous * faster + torque) > 0.0:
            travel = self._travel
            travel.response = self._response
            travel.volts = volts
            if not travel.clear(way, current, speed, torque, span.seconds):
                return self._go(TICKS)
        here = self.first + (
            span.place_of_current * current + span.place_of_speed * speed
            + (span.place_of_volts * volts + span.place_of_torque * torque)
        )  # fmt: skip
        if self.has_stops and (
            here >= float(self.high - self.base) + 0.5 or here <= float(self.low - self.base) + 0.5
        ):
            return self._go(TICKS)
        self.current = after
        self.velocity = faster
        return here

    def _go(self, until: i64) -> float:
        """Go through the last period as far as ``until``, and be there; return the place."""
        travel = self._travel
        self._from_the_beginning()
        travel.go(until, 0.0, 0.0)
        current = travel.current
        if travel.speed == 0.0 and -NO_CURRENT < current < NO_CURRENT:
            current = 0.0
        self.current = current
        self.velocity = travel.speed
        return travel.place

    def _from_the_beginning(self) -> None:
        travel = self._travel
        travel.response = self._response
        travel.volts = self._volts
        travel.current = self._began
        travel.speed = self.departed
        travel.place = self.first
        if self.has_stops:
            travel.low = float(self.low - self.base) + 0.5
            travel.high = float(self.high - self.base) + 0.5
        else:
            travel.low, travel.high = -NOWHERE, NOWHERE

    def count_at(self, fraction: float) -> i64:
        """Return the count at ``fraction`` (0.0 to 1.0) of the last period."""
        if not self._solved or fraction <= 0.0:
            return super().count_at(fraction)
        if fraction >= 1.0:
            return self.count
        self._from_the_beginning()
        tick: i64 = int(fraction * _PARTS)
        self._travel.go(tick, 0.0, 0.0)
        return self.base + floor(self._travel.place)

    def fraction_at(self, count: i64) -> float:
        """Return when, as a fraction of the last period, the encoder first reached ``count``."""
        if not self._solved:
            return super().fraction_at(count)
        away = count - self.base
        start = floor(self.first)
        if away == start:
            return 0.0
        rising = away > start
        self._from_the_beginning()
        # Going down, a count is reached when the shaft leaves the one above it.
        if not self._travel.go(
            TICKS, float(away) if rising else float(away) + 1.0, 1.0 if rising else -1.0
        ):
            return 1.0
        fraction = float(self._travel.tick) / _PARTS
        return self.reached(count, fraction, rising)

    def course(self) -> list[float]:
        """Return the course of the last period in straight pieces, and keep it so.

        Callers that change the motor within a period call it first: the course so far must stay.
        """
        if self._solved:
            places = [self.first]
            tick: i64 = 0
            while tick < TICKS:
                tick += TICKS // CORNERS
                self._from_the_beginning()
                self._travel.go(tick, 0.0, 0.0)
                places.append(bounded(self._travel.place))
            places[CORNERS] = self.last
            self._solved = False
            self.write_pieces(CORNERS, self.first)[:] = places
        return super().course()

    def forget_course(self) -> None:
        """Nor is the motor solved any more."""
        self._solved = False
        super().forget_course()

    def before_save(self) -> None:
        """Write the course down that the state has; a solved one follows from its beginning."""
        if self._solved:
            self.write_pieces(1, self.first)[1] = self.last
        else:
            super().before_save()
