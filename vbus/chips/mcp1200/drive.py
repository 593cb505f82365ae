"""What the plant is driven with."""

from vbus.bits import clamp, wrap
from vbus.chips.mcp1200 import datasheet as ds
from vbus.chips.mcp1200.encoder import Encoder
from vbus.chips.mcp1200.output import DAC_ZERO, Pwm
from vbus.chips.mcp1200.stepper import Stepper


class PlantDrive:
    """Gives the plant, period by period, the motor command or the steps that are on the pins.

    Args:
        registers: the register bytes.
        encoder: runs the plant.
        stepper: source of steps.
        pwm: source of the PWM command.
        dac: the amplifier takes the DAC port, not the PWM.
    """

    __slots__ = ("_bytes", "_dac", "_encoder", "_given", "_pwm", "_stepper", "_steps")

    def __init__(
        self, registers: bytearray, encoder: Encoder, stepper: Stepper, pwm: Pwm, dac: bool
    ) -> None:
        self._bytes: bytearray = registers
        self._encoder: Encoder = encoder
        self._stepper: Stepper = stepper
        self._pwm: Pwm = pwm
        self._dac: bool = dac
        self._given: float = 0.0
        self._steps: int = 0

    def level(self) -> float:
        """The motor command as a fraction of full scale."""
        data = self._bytes
        if data[ds.CONFIG] & ds.STEP_MODE:
            return 0.0
        if not self._dac:
            return clamp(self._pwm.command(), -ds.PWM_FULL, ds.PWM_FULL) / ds.PWM_FULL
        code = (data[ds.MOTOR_COMMAND] << 4 | data[ds.MOTOR_COMMAND_LOW] >> 4) - DAC_ZERO
        if data[ds.FEATURE] & ds.UNIPOLAR and self._pwm.command() < 0:
            # A unipolar amplifier takes its direction from Sign.
            code = -code
        return code / DAC_ZERO

    def at_rest(self) -> bool:
        """Whether another period would change nothing."""
        return self._encoder.resting() and self._given == self.level()

    def period(self, cycle: int, end: int, aiming: bool, aim: int) -> None:
        """Run the plant from ``cycle`` to ``end``.

        Args:
            cycle: where its last period ended.
            end: next instant at which its drive may change.
            aiming: the loop is closed, and pulls the axis to ``aim``.
            aim: position for plants that follow exactly.
        """
        error = 0
        steps = 0
        self._given = self.level()
        stepping = bool(self._bytes[ds.CONFIG] & ds.STEP_MODE)
        if stepping:
            sent = self._stepper.sent(end)
            steps, self._steps = sent - self._steps, sent
        elif aiming:
            error = wrap(aim - self._encoder.position(cycle), 24)
        self._encoder.begin(cycle, end, self._given, error, steps, stepping)

    def save(self) -> tuple[float, int]:
        """Return the state."""
        return (self._given, self._steps)

    def load(self, state: tuple[float, int]) -> None:
        """Take back what :meth:`save` gave."""
        self._given, self._steps = state
