"""A brushed DC motor behind a voltage amplifier."""

from typing import ClassVar, Final

from mypy_extensions import i64

from vbus.options import Option, Settings
from vbus.plant.shaft import SHAFT_OPTIONS, Mechanics, Shaft, mass_options
from vbus.state import Names

NO_CURRENT: Final = 1e-12
"""Amperes below which a decaying current is over; it would fade for hundreds of periods more."""


class DcMotor(Shaft):
    """Amplifier, armature and shaft; the defaults are a small 24 V servo motor.

    Armature and shaft are solved together and implicitly in each sub-step, so that no choice of
    parameters and period makes them unstable; without inductance the current follows at once.

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

    STATE: ClassVar[Names] = ("current: float", *Shaft.STATE)
    WIRING: ClassVar[Names] = (
        "_supply", "_amplifier", "_resistance", "_inductance", "_torque_constant", "_back_emf",
        "_viscous",
    )  # fmt: skip
    DERIVED: ClassVar[Names] = (
        "_keep", "_admit", "_induced", "_other_period", "_other_keep", "_other_admit",
        "_other_induced", "_other_gain", "_other_ease", "_other_loss", "_other_turn", "_volts",
        "_began",
    )  # fmt: skip

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
        self._viscous: float = self._damping
        # What a sub-step leaves of the current, and what a volt adds to it.
        self._keep: float = 0.0
        self._admit: float = 0.0
        # Current that 1 rad/s takes away again.
        self._induced: float = 0.0
        # The same, and what the shaft makes of a sub-step, for the period before this one.
        self._other_period: float = 0.0
        self._other_keep: float = 0.0
        self._other_admit: float = 0.0
        self._other_induced: float = 0.0
        self._other_gain: float = 0.0
        self._other_ease: float = 1.0
        self._other_loss: float = 0.0
        self._other_turn: float = 0.0
        # Amplifier and current at the start of the last period.
        self._volts: float = 0.0
        self._began: float = 0.0
        self.prepare(256e-6)

    def prepare(self, period: float) -> None:
        """Set the length of a period in seconds."""
        # Chips that change their drive twice a sample have two lengths by turns.
        before = self._period
        again = period == self._other_period
        self._exchange()
        if again:
            self._forget_course()
            self._resting = False
            self._period = period
        else:
            super().prepare(period)
        self._other_period = before

    def mechanics(self) -> Mechanics:
        """Return the numbers as they are now; change them and give them to :meth:`refit`."""
        mechanics = super().mechanics()
        mechanics.viscous = self._viscous
        mechanics.torque = self._torque_constant
        mechanics.supply = self._supply
        return mechanics

    def refit(self, mechanics: Mechanics) -> None:
        """Turn with other numbers from the next period on; the one under way keeps its course."""
        super().refit(mechanics)
        self._viscous = mechanics.viscous
        self._torque_constant = mechanics.torque
        self._supply = mechanics.supply
        self._divide(self._substeps)

    def _exchange(self) -> None:
        """Let what the last two periods were prepared with change places."""
        keep, admit, induced = self._keep, self._admit, self._induced
        self._keep, self._admit = self._other_keep, self._other_admit
        self._induced = self._other_induced
        self._other_keep, self._other_admit, self._other_induced = keep, admit, induced
        gain, ease, loss, turn = self._gain, self._ease, self._loss, self._turn_counts
        self._gain, self._ease = self._other_gain, self._other_ease
        self._loss, self._turn_counts = self._other_loss, self._other_turn
        self._other_gain, self._other_ease = gain, ease
        self._other_loss, self._other_turn = loss, turn

    def _divide(self, substeps: i64) -> None:
        # What was prepared before may be of another motor: faults change it.
        self._other_period = 0.0
        step = self._period / float(substeps)
        impedance = self._inductance + step * self._resistance
        self._keep = self._inductance / impedance
        self._admit = step / impedance
        self._induced = self._admit * self._back_emf
        self._damping = self._viscous + self._torque_constant * self._admit * self._back_emf
        super()._divide(substeps)

    def drive(self, command: float, error: i64) -> i64:
        """Run one period with ``command`` of full scale (-1.0 to 1.0) at the amplifier."""
        volts = command * self._amplifier
        if volts > self._supply:
            volts = self._supply
        elif volts < -self._supply:
            volts = -self._supply
        self._volts = volts
        self._began = self.current
        self._departed = self.velocity
        first = self._depart()
        self._untraced = True
        here = self._spin(None)
        self._resting = (
            self.current == self._began and self.velocity == self._departed and here == first
        )
        return self._arrive(here)

    def _trace(self) -> None:
        self._spin(self._write_pieces(self._substeps, self._first))

    def _spin(self, points: list[float] | None) -> float:
        """Run the period from its beginning; return where it leads, and note its pieces."""
        keep, induced, constant = self._keep, self._induced, self._torque_constant
        admitted = self._admit * self._volts
        turn = self._turn_counts
        current = self._began
        speed = self._departed
        here = self._first
        piece: i64 = 0
        while piece < self._substeps:
            piece += 1
            current = keep * current + admitted
            speed = self._accelerate(speed, constant * current)
            here += speed * turn
            if self._stopped:
                here = self._meet_stop(here, speed)
                speed = self.velocity
            current -= induced * speed
            if points is not None:
                points[piece] = here
        if -NO_CURRENT < current < NO_CURRENT:
            current = 0.0
        self.current = current
        self.velocity = speed
        return here
