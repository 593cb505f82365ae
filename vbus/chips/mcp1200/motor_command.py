"""The motor command outputs: the 12-bit DAC port and the PWM frames."""

from typing import ClassVar, Final

from mypy_extensions import i64

from vbus.chips.mcp1200 import datasheet as ds
from vbus.chips.mcp1200.filters import MC_MAX, MC_MIN, limited
from vbus.chips.mcp1200.registers import RegisterFile, SampledRegisters
from vbus.chips.mcp1200.timer import FAR
from vbus.core.state import Names


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
    unipolar = sampled.feature & ds.UNIPOLAR
    # MCP-OUT-9, MCP-OUT-2: either takes the place of the command.
    if sampled.feature & ds.DIAGNOSTIC_DAC:
        unipolar = 0
        command = limited(error * 16)
    elif unipolar and clip and command < 0:
        command = 0
    limit = sampled.saturation
    if limit < 0x80:
        limit = ~limit & 0xFF
    code: i64
    if MC_MIN <= command <= MC_MAX:
        if unipolar and command < 0:  # MCP-OUT-2
            # 800h more than -2048 would need a 13th bit.
            code = ds.DAC_ZERO + (-command if command > MC_MIN else MC_MAX)
        else:
            code = ds.DAC_ZERO + command
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


def frame_clocks(setting: i64) -> i64:
    """Return the clocks of a PWM frame by R1A bits 3-0: 100, 150, 200, 300 to 1600 (MCP-OUT-5)."""
    if setting > 8:
        setting = 8
    clocks: i64 = 100
    if setting & 1:
        clocks = 150
    return clocks << (setting >> 1)


def sign_of(command: i64) -> i64:
    """Level of Sign for a motor command: 1 = negative."""
    if command < 0:
        return 1
    return 0


class Pwm:
    """The Pulse and Sign pins while they carry sign/magnitude PWM, frame by frame.

    A frame's duty and sign are those of the command at its start (MCP-OUT-7). Nothing runs
    between two looks at it: :meth:`roll` computes which frame is under way, and must be called
    before the command or one of its settings changes.

    Args:
        registers: the registers.

    Attributes:
        start: cycle at which the frame under way began.
        length: its clocks.
        high: how many of them Pulse is high.
        sign: level of Sign (1 = negative).
    """

    STATE: ClassVar[Names] = ("start", "length", "high", "sign")
    WIRING: ClassVar[Names] = ("_registers",)

    def __init__(self, registers: RegisterFile) -> None:
        self._registers: Final[RegisterFile] = registers
        self.start: i64 = 0
        self.length: i64 = frame_clocks(0)
        self.high: i64 = 0
        self.sign: i64 = 0

    def restart(self, cycle: i64) -> None:
        """Begin a frame at ``cycle`` with nothing before it."""
        self.start = cycle
        command = self._registers.pwm
        self.sign = sign_of(command)
        self.length = self._clocks()
        self.high = self._duty(command, self.length)

    def _clocks(self) -> i64:
        """Clocks of a frame that begins now."""
        return frame_clocks(self._registers.encoder_pwm & 0x0F)

    def _duty(self, command: i64, length: i64) -> i64:
        """Clocks for which Pulse is high in a frame of ``length`` clocks that begins now."""
        if command > ds.PWM_FULL:
            command = ds.PWM_FULL
        elif command < -ds.PWM_FULL:
            command = -ds.PWM_FULL
        if self._registers.config & ds.PWM_BIAS:
            return (ds.PWM_FULL + command) * length // (2 * ds.PWM_FULL)
        if command < 0:
            command = -command
        return command * length // ds.PWM_FULL

    def roll(self, cycle: i64) -> None:
        """Come to the frame that is under way at ``cycle``."""
        start = self.start + self.length
        if cycle < start:
            return
        command = self._registers.pwm
        sign = sign_of(command)
        changed = sign != self.sign
        self.sign = sign
        length = self._clocks()
        self.length = length
        past = cycle - start
        # Only the first whole frame after a change of sign is held low (MCP-OUT-8).
        if past < length and changed and self._registers.config & ds.SIGN_INHIBIT:
            self.high = 0
        else:
            self.high = self._duty(command, length)
        self.start = cycle - past % length

    def level(self, cycle: int) -> int:
        """Level of Pulse in a cycle of the frame under way."""
        return int(cycle - self.start < self.high)

    def next_edge(self, cycle: int) -> int:
        """Return a cycle after ``cycle`` not later than the next edge of Pulse or Sign."""
        fall = self.start + self.high
        if cycle < fall < self.start + self.length:
            return fall
        if self.steady():
            return FAR
        return self.start + self.length

    def steady(self) -> bool:
        """Whether every further frame is the same level throughout, as long as no host writes."""
        command = self._registers.pwm
        if 0 < self.high < self.length or self.sign != sign_of(command):
            return False
        length = self._clocks()
        high = self._duty(command, length)
        return (high == 0) == (self.high == 0) and (high == length) == (self.high == self.length)
