"""A stepper motor: step pulses or phase currents to torque, and steps lost under overload."""

from typing import ClassVar, Final

from vbus.options import Option, Settings
from vbus.plant.angle import sine
from vbus.plant.shaft import SHAFT_OPTIONS, Shaft, mass_options
from vbus.plant.windings import STEP_OPTIONS, field

MOST_PIECES: Final = 4096
"""Sub-steps a period is cut into at most; pulses that come faster move the field in leaps."""


class StepperMotor(Shaft):
    """Field and rotor of a stepper motor; the defaults are a motor of frame size 17.

    The field pulls the rotor with the holding torque times the sine of the electrical angle
    between them. Asked for more than that, the rotor falls behind by a whole electrical cycle (four
    full steps) or stalls, and the encoder shows it.

    Step pulses go to a driver with constant current; pulse j of n comes at j/n of the period.
    Phase currents make a field as strong as they are, so that full scale gives the holding torque.
    """

    TAKES: ClassVar[tuple[str, ...]] = ("pulses", "phases")
    OPTIONS: ClassVar[tuple[Option, ...]] = (
        *SHAFT_OPTIONS,
        *STEP_OPTIONS,
        Option("holding_torque", "N*m", 0.4, "torque against which the motor holds at full"
               " current", low=0.0),
        Option("detent_torque", "N*m", 0.01, "torque against which it holds without current",
               low=0.0),
        *mass_options(inertia=1e-5, viscous=0.003, coulomb=0.005, static=0.007),
    )  # fmt: skip

    def __init__(self, settings: Settings | None = None) -> None:
        super().__init__(settings)
        full_steps = int(self.settings["full_steps"])
        if full_steps % 4:
            raise ValueError(
                f"full_steps = {full_steps}: four full steps make an electrical cycle,"
                " so it must be a multiple of 4"
            )
        self._cycles: int = full_steps // 4
        self._steps_per_rev: int = int(self.settings["steps_per_rev"])
        self._holding: float = float(self.settings["holding_torque"])
        self._detent: float = float(self.settings["detent_torque"])
        # The pulses so far, within one revolution of the field.
        self._steps: int = 0
        self._three: bool = False
        # Sub-steps in a period that the rotor's natural frequency asks for; those prepared for.
        self._finest: int = 1
        self._divided: int = 0
        self.prepare(256e-6)

    def prepare(self, period: float) -> None:
        """Set the length of a period in seconds."""
        # Eight sub-steps to a radian of the rotor's swing at its natural frequency.
        stiffness = (self._holding + 4.0 * self._detent) * self._cycles
        pieces = self._substeps
        while (
            pieces < MOST_PIECES
            and 64.0 * stiffness * period * period > self._inertia * pieces * pieces
        ):
            pieces = min(2 * pieces, MOST_PIECES)
        self._finest = pieces
        self._divided = 0
        self._period = period

    def _divide(self, substeps: int) -> None:
        if substeps != self._divided:
            self._divided = substeps
            super()._divide(substeps)

    def pulses(self, steps: int) -> int:
        """Run one period with ``steps`` signed step pulses spread evenly over it."""
        total = steps if steps >= 0 else -steps
        sign = 1 if steps >= 0 else -1
        pieces = self._finest
        if total > 0:
            # Every pulse at the beginning of a sub-step.
            pieces = min(total * -(-pieces // total), MOST_PIECES)
        speed = self.velocity
        self._divide(pieces)
        self._begin(pieces)
        issued = 0
        across = along = 0.0
        for piece in range(pieces):
            due = piece * total // pieces + 1 if total > 0 else 0
            if piece == 0 or due != issued:
                issued = due
                place = (self._steps + sign * issued) * self._cycles % self._steps_per_rev
                turns = place / self._steps_per_rev
                across = sine(turns)
                along = sine(turns + 0.25)
            self._pull(piece, across, along)
        self._steps = (self._steps + steps) % self._steps_per_rev
        self._resting = steps == 0 and speed == self.velocity and not self._moved()
        return self._end()

    def phases(self, a: float, b: float, c: float) -> int:
        """Run one period with phase currents, each -1.0 to 1.0 (``c`` is 0 with two phases)."""
        across, along, self._three = field(a, b, c, self._three)
        speed = self.velocity
        pieces = self._finest
        self._divide(pieces)
        self._begin(pieces)
        for piece in range(pieces):
            self._pull(piece, across, along)
        self._resting = speed == self.velocity and not self._moved()
        return self._end()

    def _pull(self, piece: int, across: float, along: float) -> None:
        """Run one sub-step with the sine and cosine part of the field."""
        counts = self.encoder.counts
        # The middle of count 0 is angle 0.
        place = self._base * self._cycles % counts + (self._points[piece] - 0.5) * self._cycles
        turns = place / counts
        torque = self._holding * (across * sine(turns + 0.25) - along * sine(turns))
        if self._detent > 0.0:
            torque -= self._detent * sine(4.0 * turns)
        self._turn(piece, torque)

    def save(self) -> tuple[float, ...]:
        """Return the whole state."""
        return (self._steps, int(self._three), *self._save_shaft())

    def load(self, state: tuple[float, ...]) -> None:
        """Take back what :meth:`save` gave."""
        self._steps = int(state[0])
        self._three = state[1] != 0
        self._load_shaft(state[2:])
