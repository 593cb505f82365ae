"""A motor's shaft and what hangs on it: inertia, friction, load, end stops."""

from typing import ClassVar, Final, NamedTuple

from mypy_extensions import i64

from vbus.core.options import Option, Settings
from vbus.core.signals import Value, ValueTable
from vbus.core.state import Names
from vbus.plant.encoder import ENCODER_OPTIONS, MOST_TURNED, EncodedPlant, bounded

SHAFT_OPTIONS: Final = (
    *ENCODER_OPTIONS,
    Option("load_torque", "N*m", 0.0, "constant torque of the load; positive pulls backward"),
    Option("stop_low", "count", 0, "count of the lower end stop; none while both are equal",
           low=-(1 << 30), high=1 << 30),
    Option("stop_high", "count", 0, "count of the upper end stop",
           low=-(1 << 30), high=1 << 30),
)  # fmt: skip
"""Settings of every motor; defaults of inertia and friction are its own (:func:`mass_options`)."""

MOST_COUNTS: Final = 1e9
"""Counts a second that a shaft turns at most: 500 times what a chip can count."""
TWO_PI: Final = 6.283185307179586

LOAD_TORQUE: Final = Value("load torque", "load", unit="N*m", key="load", lane="load", step=1e-6)


def mass_options(
    inertia: float, viscous: float, coulomb: float, static: float
) -> tuple[Option, ...]:
    """Return the settings of inertia and friction with these defaults."""
    return (
        Option("inertia", "kg*m^2", inertia, "inertia of rotor and load", low=1e-12),
        Option("viscous_friction", "N*m*s", viscous, "friction that grows with speed", low=0.0),
        Option("coulomb_friction", "N*m", coulomb, "dry friction while turning", low=0.0),
        Option("static_friction", "N*m", static, "torque needed to break away", low=0.0),
    )


class Mechanics(NamedTuple):
    """The numbers of a motor and its shaft that may change while it turns.

    Attributes:
        load: constant torque of the load (N*m); positive pulls backward.
        coulomb: dry friction while turning (N*m).
        static: torque needed to break away (N*m).
        viscous: friction that grows with speed (N*m*s).
        torque: a DC motor's torque for each ampere (N*m/A), a stepper's holding torque (N*m).
        supply: where a DC motor's amplifier saturates (V); -1 for a stepper, which has none.
        low: count of the lower end stop.
        high: count of the upper end stop.
        stopped: whether there are end stops.
    """

    load: float
    coulomb: float
    static: float
    viscous: float
    torque: float
    supply: float
    low: int
    high: int
    stopped: bool


class Shaft(EncodedPlant):
    """A stiff shaft that a motor turns.

    Friction is dry and viscous. Dry friction stops the shaft exactly where it would pass through
    standstill, and a shaft at rest leaves its place only when the other torques exceed static
    friction.

    End stops are hard and take the whole impact: the shaft stands in the middle of their count.
    """

    VALUES: ClassVar[ValueTable] = ValueTable(LOAD_TORQUE)
    STATE: ClassVar[Names] = (
        "period: float", "velocity: float", "rests: bool", *EncodedPlant.STATE,
    )  # fmt: skip
    WIRING: ClassVar[Names] = (
        "viscous", "coulomb", "static", "load", "low", "high", "has_stops",
    )  # fmt: skip
    DERIVED: ClassVar[Names] = ("seconds", "departed")

    def __init__(self, settings: Settings | None = None) -> None:
        super().__init__(settings)
        self.velocity: float = 0.0
        """Speed of the shaft in rad/s."""
        self.inertia: float = float(self.settings["inertia"])
        self.viscous: float = float(self.settings["viscous_friction"])
        self.coulomb: float = float(self.settings["coulomb_friction"])
        self.static: float = float(self.settings["static_friction"])
        self.load: float = float(self.settings["load_torque"])
        self.low: i64 = int(self.settings["stop_low"])
        self.high: i64 = int(self.settings["stop_high"])
        self.revolution: float = float(self.encoder.counts)
        self.has_stops: bool = self.low != self.high
        self.fastest: float = MOST_COUNTS * TWO_PI / self.revolution
        """Speed beyond which nothing drives the shaft (rad/s)."""
        if self.static < self.coulomb:
            raise ValueError(
                f"static_friction = {self.static:g} N*m is below coulomb_friction ="
                f" {self.coulomb:g} N*m; a shaft is never easier to start than to keep going"
            )
        if self.low > self.high or (self.has_stops and not self.low <= 0 <= self.high):
            raise ValueError(
                f"stop_low = {self.low}, stop_high = {self.high}: the shaft starts at count 0,"
                " which must lie between them"
            )
        self.seconds: float = 0.0
        self.rests: bool = False
        # Speed at the start of the last period.
        self.departed: float = 0.0

    @property
    def period(self) -> float:
        """The length of a period in seconds; it is prepared for before the rest is loaded."""
        return self.seconds

    @period.setter
    def period(self, period: float) -> None:
        self.prepare(period)

    def after_load(self) -> None:
        """Refuse a speed that no shaft has, and work out where the course begins and ends."""
        if abs(self.velocity) > self.fastest:
            raise ValueError(f"a shaft that turns at {self.velocity:g} rad/s")
        super().after_load()

    def settled(self, here: float) -> float:
        """Return where a period ends that would lead to ``here``; its speed has a bound too."""
        fastest = self.fastest
        speed = self.velocity
        if -fastest <= speed <= fastest and -MOST_TURNED <= here <= MOST_TURNED:
            return here
        self.velocity = min(max(speed, -fastest), fastest)
        return bounded(here)

    def prepare(self, period: float) -> None:
        """Set the length of a period in seconds."""
        self.forget_course()
        self.rests = False
        self.seconds = period

    def mechanics(self) -> Mechanics:
        """Return the numbers as they are now; change them and give them to :meth:`refit`."""
        return Mechanics(
            self.load, self.coulomb, self.static, self.viscous, 0.0, -1.0,
            self.low, self.high, self.has_stops,
        )  # fmt: skip

    def refit(self, mechanics: Mechanics) -> None:
        """Turn with other numbers from the next period on; the one under way keeps its course."""
        self.course()
        self.load = mechanics.load
        self.coulomb = mechanics.coulomb
        self.static = mechanics.static
        self.viscous = mechanics.viscous
        self.low, self.high = mechanics.low, mechanics.high
        self.has_stops = mechanics.stopped
        self.rests = False

    def jam(self) -> None:
        """Stand still from now on, until a torque breaks the shaft away again."""
        self.course()
        self.velocity = 0.0

    def resting(self) -> bool:
        """Whether the last period has left every bit of state as it was."""
        return self.rests
