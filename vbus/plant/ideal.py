"""A plant without mechanics: it is where it should be, one period later, in whole counts."""

from typing import ClassVar, Final

from mypy_extensions import i64

from vbus.core.options import Option, Settings
from vbus.core.state import Names
from vbus.plant.angle import turns_of
from vbus.plant.encoder import ENCODER_OPTIONS, EncodedPlant, bounded
from vbus.plant.stepper import STEP_OPTIONS, field

MICROSTEPS: Final = 256
"""Steps of an electrical cycle in which phase currents are followed."""


class IdealPlant(EncodedPlant):
    """Follows exactly, for golden traces and for trying out hosts.

    With a servo command it moves by the position error in each period; with step pulses or phase
    currents it makes every step. Its course through a period is a straight line of at most
    :data:`~vbus.plant.encoder.MOST_TURNED` counts; the rest of a longer way is for later periods.
    """

    TAKES: ClassVar[tuple[str, ...]] = ("drive", "pulses", "phases")
    OPTIONS: ClassVar[tuple[Option, ...]] = (
        *ENCODER_OPTIONS,
        *STEP_OPTIONS,
    )

    STATE: ClassVar[Names] = ("_steps", "_three: bool", "_resting: bool", *EncodedPlant.STATE)

    def __init__(self, settings: Settings | None = None) -> None:
        super().__init__(settings)
        self._steps_per_rev: i64 = int(self.settings["steps_per_rev"])
        self._microsteps_per_rev: i64 = int(self.settings["full_steps"]) * (MICROSTEPS // 4)
        # Step pulses or microsteps since power-on, whichever the chip gives.
        self._steps: i64 = 0
        self._three: bool = False
        self._resting: bool = False

    def prepare(self, period: float) -> None:
        """Accept any period: how long it is makes no difference."""

    def drive(self, command: float, error: i64) -> i64:
        """Move by ``error`` counts."""
        return self._move(error, error == 0)

    def pulses(self, steps: i64) -> i64:
        """Make ``steps`` steps."""
        self._steps += steps
        return self._go(self._steps_per_rev, steps == 0)

    def phases(self, a: float, b: float, c: float) -> i64:
        """Turn to the angle of the field, by the shorter way; without currents stay."""
        before = self._steps
        across, along, self._three = field(a, b, c, self._three)
        if across != 0.0 or along != 0.0:
            angle: i64 = int(turns_of(across, along) * MICROSTEPS + 0.5)
            turn = (angle - self._steps) % MICROSTEPS
            self._steps += turn if turn < MICROSTEPS // 2 else turn - MICROSTEPS
        return self._go(self._microsteps_per_rev, self._steps == before)

    def _go(self, steps_per_rev: i64, still: bool) -> i64:
        return self._move(self._steps * self.encoder.counts // steps_per_rev - self.count, still)

    def _move(self, counts: i64, still: bool) -> i64:
        self._resting = still and counts == 0
        self.begin(1)
        self.points[1] = bounded(self.first + float(counts))
        return self.end()

    def resting(self) -> bool:
        """Whether the last period has asked for no motion."""
        return self._resting
