"""What the plant is driven with."""

from typing import ClassVar, Final

from mypy_extensions import i64

from vbus.chips.mcp1200 import datasheet as ds
from vbus.chips.mcp1200.encoder import EncoderCourse
from vbus.chips.mcp1200.following import Following
from vbus.chips.mcp1200.registers import RegisterFile
from vbus.chips.mcp1200.stepper import Stepper
from vbus.core.options import Value
from vbus.core.state import Names

FULL: Final = 1600.0
""":data:`~vbus.chips.mcp1200.datasheet.PWM_FULL` as a float."""
ZERO: Final = 2048.0


class PlantDrive:
    """Gives the plant, period by period, the motor command or the steps that are on the pins.

    Args:
        registers: the registers.
        encoder: runs the plant.
        stepper: source of steps.
        following: where plants go that follow exactly.
        settings: the chip's board file keys: which output the amplifier takes, and what a
            unipolar one means.
    """

    STATE: ClassVar[Names] = ("_given: float", "_steps")
    WIRING: ClassVar[Names] = ("_clip", "_dac", "_encoder", "_following", "_registers", "_stepper")
    DERIVED: ClassVar[Names] = ("_command", "_level")

    def __init__(
        self,
        registers: RegisterFile,
        encoder: EncoderCourse,
        stepper: Stepper,
        following: Following,
        settings: dict[str, Value],
    ) -> None:
        self._registers: Final[RegisterFile] = registers
        self._encoder: Final[EncoderCourse] = encoder
        self._stepper: Final[Stepper] = stepper
        self._following: Final[Following] = following
        self._dac: bool = settings["drive"] == "dac"
        self._clip: bool = settings["unipolar"] == "clip"
        self._given: float = 0.0
        # The motor command of the PWM that was asked for last; a division takes its time.
        self._command: i64 = 0
        self._level: float = 0.0
        self._steps: i64 = 0

    def level(self) -> float:
        """The motor command as a fraction of full scale."""
        registers = self._registers
        if registers.step_mode:
            return 0.0
        if not self._dac:
            command = registers.pwm
            if command != self._command:
                self._command = command
                if command > ds.PWM_FULL:
                    command = ds.PWM_FULL
                elif command < -ds.PWM_FULL:
                    command = -ds.PWM_FULL
                self._level = float(command) / FULL
            return self._level
        return self._dac_level()

    def _dac_level(self) -> float:
        """The code of the DAC port as a fraction of full scale."""
        registers = self._registers
        code = registers.dac - ds.DAC_ZERO
        if registers.feature & ds.UNIPOLAR and registers.pwm < 0 and not self._clip:
            # An amplifier that gets a magnitude takes its direction from Sign.
            code = -code
        return float(code) / ZERO

    def at_rest(self) -> bool:
        """Whether another period would change nothing."""
        return self._encoder.resting() and self._given == self.level()

    def period(self, end: i64, aiming: bool) -> None:
        """Run the plant from where its last period ended to ``end``.

        Args:
            end: next instant at which its drive may change.
            aiming: the loop is closed; it pulls the axis to where it aims.
        """
        self._given = self.level()
        if self._registers.step_mode:
            sent = self._stepper.sent(end)
            self._encoder.run(end, self._given, 0, True, sent - self._steps)
            self._steps = sent
            return
        error: i64 = 0
        if aiming:
            error = self._encoder.error(self._following.aim())
        self._encoder.run(end, self._given, error, False, 0)
