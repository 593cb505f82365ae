"""The lead filter of the HCTL-1100 map (R20 zero A, R21 pole B, R22 gain K)."""

from typing import ClassVar, Final

from mypy_extensions import i64

from vbus.chips.mcp1200.registers import SampledRegisters
from vbus.state import Names

MC_MIN: Final = -2048
MC_MAX: Final = 2047
"""The 12-bit motor command, in 1/16 of an R08 step (MCP-FLT-1)."""


class LeadFilter:
    """MC(n) = K/4 E(n) - [A/256 K/4 E(n-1) + B/256 MC(n-1)], in 1/16 of an R08 step.

    The old motor command enters as it was sent, limited to 12 bits; one floor for both old
    terms (MCP-FLT-2).
    """

    STATE: ClassVar[Names] = ("_error", "_command")

    def __init__(self) -> None:
        self._error: i64 = 0
        self._command: i64 = 0

    def clear(self) -> None:
        """Forget old samples (MCP-FLT-5)."""
        self._error = 0
        self._command = 0

    def step(self, sampled: SampledRegisters, error: i64) -> i64:
        """Return the motor command, not limited, for position error ``error`` (16 bits)."""
        gain = sampled.lead_gain
        old = 4 * sampled.lead_zero * gain * self._error + sampled.lead_pole * self._command
        command = 4 * gain * error - (old >> 8)
        self._error = error
        self._command = command
        if command > MC_MAX:
            self._command = MC_MAX
        elif command < MC_MIN:
            self._command = MC_MIN
        return command
