"""From command and actual position to the motor command: position error, the lead filter of the
HCTL-1100 map (R20-R22) or the PID filter (R61-R6A), and the codes of the two outputs."""

from typing import ClassVar, Final

from mypy_extensions import i64

from vbus.chips.mcp1200 import datasheet as ds
from vbus.chips.mcp1200.generated.registers import Registers
from vbus.chips.mcp1200.registers import SampledRegisters
from vbus.core.bits import wrap_word
from vbus.core.state import Names

MC_MIN: Final = -2048
MC_MAX: Final = 2047
"""The 12-bit motor command, in 1/16 of an R08 step (MCP-FLT-1)."""


class Following:
    """Position error of one sample, and the backlash offset hidden in it.

    Attributes:
        offset: counts added to the command by backlash compensation.
        error: PE, 16 bits, after the deadband.
        in_position: the error before the deadband is at most R45 + 1.
        too_large: it exceeds R4A:R49.
    """

    STATE: ClassVar[Names] = (
        "_command", "_direction", "offset", "error", "in_position: bool", "too_large: bool",
    )  # fmt: skip

    def __init__(self) -> None:
        self._command: i64 = 0
        self._direction: i64 = 0
        self.offset: i64 = 0
        self.error: i64 = 0
        self.in_position: bool = False
        self.too_large: bool = False

    def clear(self) -> None:
        """Forget the compensation: a reset."""
        self._command = 0
        self._direction = 0
        self.offset = 0
        self.error = 0

    def begin(self, command: i64) -> None:
        """Control starts with this command position: no change so far."""
        self._command = command

    def aim(self) -> i64:
        """Where the loop pulls the axis to: command and backlash offset."""
        return self._command + self.offset

    def near(self, registers: Registers, actual: i64) -> bool:
        """Whether a sample of idle mode finds the axis in position (NOTES 32)."""
        deadband = registers.deadband
        if registers.backlash == 0:
            self.offset = 0
        error = wrap_word(registers.command_position + self.offset - actual, 0x800000)
        return -deadband - 1 <= error <= deadband + 1

    def step(self, sampled: SampledRegisters, command: i64, actual: i64) -> i64:
        """Compute one sample; return by how much the command has changed (24 bits)."""
        change = wrap_word(command - self._command, 0x800000)
        self._command = command
        backlash = sampled.backlash
        if backlash == 0:
            self.offset = 0  # MCP-ERR-1
        # MCP-ERR-1; kept without compensation too: R44 is written once a move has taken the
        # backlash out.
        if change != 0:
            direction: i64 = -1
            if change > 0:
                direction = 1
            # MCP-ERR-1: not at the first change, which turns nothing round.
            if self._direction == -direction:
                self.offset += direction * backlash
            self._direction = direction
        # MCP-ERR-2, MCP-POS-2: command plus offset minus actual, modulo 2^24.
        error = wrap_word(command + self.offset - actual, 0x800000)
        size = error
        if error < 0:
            size = -error
        # Of larger errors the chip sees FFFF, which exceeds no limit of FFFF (MCP-ERR-2).
        self.too_large = size > sampled.max_error and sampled.max_error < 0xFFFF
        deadband = sampled.deadband
        self.in_position = size <= deadband + 1  # MCP-STA-4, MCP-AMB-35
        # MCP-ERR-4: 16 bits.
        # MCP-ERR-3, MCP-AMB-17: less or equal.
        if size <= deadband:
            error = 0
        elif error > 0x7FFF:
            error = 0x7FFF
        elif error < -0x8000:
            error = -0x8000
        self.error = error
        return change


def limited(command: i64) -> i64:
    """Limit a motor command to 12 bits."""
    if command > MC_MAX:
        return MC_MAX
    if command < MC_MIN:
        return MC_MIN
    return command


class LeadFilter:
    """MC(n) = K/4 E(n) - [A/256 K/4 E(n-1) + B/256 MC(n-1)], in 1/16 of an R08 step.

    The old motor command enters as it was sent, limited to 12 bits; one floor for both old
    terms (MCP-FLT-2).
    """

    STATE: ClassVar[Names] = ("_error", "_command")

    def __init__(self) -> None:
        self._error: i64 = 0
        self._command: i64 = 0

    def step(self, sampled: SampledRegisters, error: i64) -> i64:
        """Return the motor command, not limited, for position error ``error`` (16 bits)."""
        gain = sampled.lead_gain
        old = 4 * sampled.lead_zero * gain * self._error + sampled.lead_pole * self._command
        # MCP-FLT-2, MCP-AMB-26: in 1/16 of an R08 step; one floor for both old terms.
        command = 4 * gain * error - (old >> 8)
        self._error = error
        # MCP-FLT-2: the old motor command as it was sent.
        self._command = limited(command)
        return command


class PidFilter:
    """MC = P/32 + I/8192 + D/8 + V/16 + A in R08 steps, in 1/16 of a step, one floor at the end.

    The integrator takes no error in a sample after a saturated one, but is kept within the
    integral limit in every sample (MCP-FLT-3).

    Attributes:
        integral: the accumulator IACC.
    """

    STATE: ClassVar[Names] = (
        "_error_1", "_error_2", "_error_3", "_error_4", "_error_5", "_error_6", "_error_7",
        "_error_8", "integral", "_velocity", "_saturated: bool",
    )  # fmt: skip

    def __init__(self) -> None:
        # Errors of the last samples, one word each: a list would make objects of them.
        self._error_1: i64 = 0
        self._error_2: i64 = 0
        self._error_3: i64 = 0
        self._error_4: i64 = 0
        self._error_5: i64 = 0
        self._error_6: i64 = 0
        self._error_7: i64 = 0
        self._error_8: i64 = 0
        self.integral: i64 = 0
        self._velocity: i64 = 0
        self._saturated: bool = False

    def step(self, sampled: SampledRegisters, error: i64, velocity: i64) -> i64:
        """Return the motor command, not limited. All on the way to it fits 48 bits.

        Args:
            sampled: the registers at the sample's start.
            error: position error after the deadband (16 bits).
            velocity: command velocity in 1/256 count per sample.
        """
        # MCP-FLT-3: no error is added after a sample that was saturated.
        if not self._saturated:
            self.integral += error
        limit = sampled.integral_limit & 0x7FFF
        # MCP-FLT-3, MCP-REG-46: 15 bits; in every sample, saturated or not.
        if self.integral > limit:
            self.integral = limit
        elif self.integral < -limit:
            self.integral = -limit
        # MCP-REG-45, MCP-AMB-8: 1, 2, 3, 4 or 8 samples; anything else is 1.
        span = sampled.derivative_span
        if span == 2:
            change = error - self._error_2
        elif span == 3:
            change = error - self._error_3
        elif span == 4:
            change = error - self._error_4
        elif span == 8:
            change = error - self._error_8
        else:
            change = error - self._error_1
        self._error_8 = self._error_7
        self._error_7 = self._error_6
        self._error_6 = self._error_5
        self._error_5 = self._error_4
        self._error_4 = self._error_3
        self._error_3 = self._error_2
        self._error_2 = self._error_1
        self._error_1 = error
        acceleration = velocity - self._velocity  # MCP-FLT-4
        self._velocity = velocity  # MCP-FLT-4
        # MCP-FLT-3, MCP-AMB-24: one floor at the end; the acceleration term has no factor.
        command = (
            256 * sampled.kp * error
            + sampled.ki * self.integral
            + 1024 * sampled.kd * change
            + 2 * sampled.kv * velocity
            + 32 * sampled.ka * acceleration
        ) >> 9
        self._saturated = command > MC_MAX or command < MC_MIN
        return command


def pwm_command(sampled: SampledRegisters, command: i64, error: i64) -> i64:
    """Return the PWM's command for an unlimited motor command in control (MCP-OUT-4, 9)."""
    return limited(error * 16 if sampled.feature & ds.DIAGNOSTIC_PWM else command)


def dac_code(sampled: SampledRegisters, command: i64, error: i64, clip: bool) -> i64:
    """Return the 12-bit code for an unlimited motor command in control (MCP-OUT-1).

    Args:
        sampled: the registers at the sample's start.
        command: the motor command.
        error: position error, sent instead for diagnosis; it keeps its sign (NOTES 22).
        clip: of a negative command a unipolar output gives zero, not the magnitude (NOTES 22).
    """
    # MCP-AMB-4: by bit 2 of R01: F2, which one sentence names, shows motion in this chip.
    unipolar = sampled.feature & ds.UNIPOLAR
    # MCP-OUT-9, MCP-OUT-2: either takes the place of the command.
    if sampled.feature & ds.DIAGNOSTIC_DAC:
        unipolar = 0
        command = limited(error * 16)
    # MCP-OUT-2, MCP-AMB-5: a setting, as the manual does not say which.
    elif unipolar and clip and command < 0:
        command = 0
    limit = sampled.saturation
    # MCP-OUT-1: below 80h it means the other side's limit.
    if limit < 0x80:
        limit = ~limit & 0xFF
    code: i64
    if MC_MIN <= command <= MC_MAX:
        if unipolar and command < 0:  # MCP-OUT-2
            # 800h more than -2048 would need a 13th bit.
            code = ds.DAC_ZERO + (-command if command > MC_MIN else MC_MAX)
        else:
            code = ds.DAC_ZERO + command
    # MCP-OUT-1, MCP-AMB-11: the lower 4 bits of a limiting code are 0.
    elif command > 0 or unipolar:
        code = limit << 4
    else:
        code = (~limit & 0xFF) << 4
    code += sampled.dac_offset  # MCP-OUT-3
    if code < 0:  # MCP-OUT-3
        return 0
    if code > 0xFFF:  # MCP-OUT-3
        return 0xFFF
    return code
