"""The lead filter of the HCTL-1100 map (R20-R22), and the PID filter (R61-R6A)."""

from typing import ClassVar, Final

from mypy_extensions import i64

from vbus.chips.mcp1200.registers import SampledRegisters
from vbus.core.state import Names

MC_MIN: Final = -2048
MC_MAX: Final = 2047
"""The 12-bit motor command, in 1/16 of an R08 step (MCP-FLT-1)."""


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
        command = 4 * gain * error - (old >> 8)
        self._error = error
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
        if not self._saturated:
            self.integral += error
        limit = sampled.integral_limit & 0x7FFF
        if self.integral > limit:
            self.integral = limit
        elif self.integral < -limit:
            self.integral = -limit
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
        command = (
            256 * sampled.kp * error
            + sampled.ki * self.integral
            + 1024 * sampled.kd * change
            + 2 * sampled.kv * velocity
            + 32 * sampled.ka * acceleration
        ) >> 9
        self._saturated = command > MC_MAX or command < MC_MIN
        return command
