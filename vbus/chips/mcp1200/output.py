"""The motor command outputs: the 12-bit DAC port and the PWM frames."""

from typing import Final

from mypy_extensions import i64

from vbus.bits import clamp, sign_extend
from vbus.chips.mcp1200 import datasheet as ds
from vbus.chips.mcp1200.lead import MC_MAX, MC_MIN
from vbus.chips.mcp1200.timer import FAR

DAC_ZERO: Final = 0x800


def dac_code(image: bytes, command: int) -> int:
    """Return the 12-bit code for an unlimited motor command in control (MCP-OUT-1 to 3)."""
    limit = image[ds.SATURATION]
    if limit < 0x80:
        limit = ~limit & 0xFF
    unipolar = image[ds.FEATURE] & ds.UNIPOLAR
    if MC_MIN <= command <= MC_MAX:
        if unipolar and command < 0:
            # 800h more than -2048 would need a 13th bit.
            code = DAC_ZERO + min(-command, MC_MAX)
        else:
            code = DAC_ZERO + command
    elif command > 0 or unipolar:
        code = limit << 4
    else:
        code = (~limit & 0xFF) << 4
    return clamp(code + sign_extend(image[ds.DAC_OFFSET], 8), 0, 0xFFF)


class Pwm:
    """The Pulse and Sign pins while they carry sign/magnitude PWM, frame by frame.

    A frame's duty and sign are those of the command at its start (MCP-OUT-7). Nothing runs
    between two looks at it: :meth:`roll` computes which frame is under way, and must be called
    before the command or one of its settings changes.

    Args:
        registers: the register bytes.

    Attributes:
        start: cycle at which the frame under way began.
        length: its clocks.
        high: how many of them Pulse is high.
        sign: level of Sign (1 = negative).
    """

    __slots__ = ("_bytes", "high", "length", "sign", "start")

    def __init__(self, registers: bytearray) -> None:
        self._bytes: bytearray = registers
        self.start: i64 = 0
        self.length: i64 = ds.PWM_RESOLUTION[0]
        self.high: i64 = 0
        self.sign: i64 = 0

    def command(self) -> int:
        """The motor command in R09 and R4D, in 1/16 of an R09 step."""
        data = self._bytes
        return sign_extend(data[ds.PWM_COMMAND] << 4 | data[ds.PWM_FRACTION] >> 4, 12)

    def restart(self, cycle: int) -> None:
        """Begin a frame at ``cycle`` with nothing before it."""
        self.start = cycle
        self.sign = int(self.command() < 0)
        self._begin(False)

    def _begin(self, inhibited: bool) -> None:
        data = self._bytes
        command = clamp(self.command(), -ds.PWM_FULL, ds.PWM_FULL)
        self.length = ds.PWM_RESOLUTION[data[ds.ENCODER_PWM] & 0x0F]
        if inhibited:
            self.high = 0
        elif data[ds.CONFIG] & ds.PWM_BIAS:
            self.high = (ds.PWM_FULL + command) * self.length // (2 * ds.PWM_FULL)
        else:
            self.high = abs(command) * self.length // ds.PWM_FULL

    def roll(self, cycle: int) -> None:
        """Come to the frame that is under way at ``cycle``."""
        if cycle < self.start + self.length:
            return
        self.start += self.length
        sign = int(self.command() < 0)
        changed = sign != self.sign
        self.sign = sign
        # Only the first whole frame after a change of sign is held low (MCP-OUT-8).
        self._begin(changed and bool(self._bytes[ds.CONFIG] & ds.SIGN_INHIBIT))
        if cycle >= self.start + self.length:
            self.start += self.length
            self._begin(False)
            self.start += (cycle - self.start) // self.length * self.length

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
        """Whether every further frame is the same level throughout, as long as nobody writes."""
        if 0 < self.high < self.length or self.sign != int(self.command() < 0):
            return False
        high, length = self.high, self.length
        self._begin(False)
        same = (self.high == 0) == (high == 0) and (self.high == self.length) == (high == length)
        self.high, self.length = high, length
        return same

    def save(self) -> tuple[int, ...]:
        """Return the state."""
        return (self.start, self.length, self.high, self.sign)

    def load(self, state: tuple[int, ...]) -> None:
        """Take back what :meth:`save` gave."""
        self.start, self.length, self.high, self.sign = state
