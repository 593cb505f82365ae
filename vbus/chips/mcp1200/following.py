"""From command and actual position to the error the filters see: backlash, deadband, limits."""

from typing import ClassVar

from mypy_extensions import i64

from vbus.chips.mcp1200.generated.registers import Registers
from vbus.chips.mcp1200.registers import SampledRegisters
from vbus.core.bits import wrap_word
from vbus.core.state import Names


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
            if self._direction == -direction:
                self.offset += direction * backlash
            self._direction = direction
        error = wrap_word(command + self.offset - actual, 0x800000)
        size = error
        if error < 0:
            size = -error
        # Of larger errors the chip sees FFFF, which exceeds no limit of FFFF (MCP-ERR-2).
        self.too_large = size > sampled.max_error and sampled.max_error < 0xFFFF
        deadband = sampled.deadband
        self.in_position = size <= deadband + 1  # MCP-STA-4
        # MCP-ERR-4: 16 bits.
        if size <= deadband:
            error = 0
        elif error > 0x7FFF:
            error = 0x7FFF
        elif error < -0x8000:
            error = -0x8000
        self.error = error
        return change
