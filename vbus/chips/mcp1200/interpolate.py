"""Position and velocity interpolation: flags F3 and F4 (MCP-INT)."""

from typing import ClassVar

from mypy_extensions import i64

from vbus.bits import wrap_word
from vbus.chips.mcp1200.command import Command
from vbus.chips.mcp1200.registers import SampledRegisters
from vbus.state import Names


class Segment:
    """A straight line over 2^(R18+1) samples from one value to the next.

    Attributes:
        start: value at the segment's start.
        end: value at its end.
        left: samples still to make; 0: no segment runs.
    """

    STATE: ClassVar[Names] = ("start", "end", "left", "_shift")

    def __init__(self) -> None:
        self.start: i64 = 0
        self.end: i64 = 0
        self.left: i64 = 0
        self._shift: i64 = 1

    def begin(self, sampled: SampledRegisters, start: i64, end: i64) -> None:
        """Lay a segment; R18 is read now (MCP-INT-3)."""
        self.start = start
        self.end = end
        one: i64 = 1
        self._shift = (sampled.interpolator_preset & 7) + 1
        self.left = one << self._shift

    def next(self) -> i64:
        """Make one sample; return the value at its end (MCP-INT-1)."""
        one: i64 = 1
        self.left -= 1
        done = (one << self._shift) - self.left
        return self.start + ((self.end - self.start) * done >> self._shift)

    def slope(self) -> i64:
        """Change of the value per sample, in 1/256."""
        return (self.end - self.start << 8) >> self._shift


class PositionInterpolation(Segment):
    """Runs through a series of positions, one segment each (MCP-INT-1)."""

    def hold(self, point: i64) -> None:
        """Stay at the command position until the point to reach is another than ``point``."""
        self.left = 0
        self.end = point

    def step(self, command: Command, sampled: SampledRegisters, fresh: bool, point: i64) -> bool:
        """Make one sample; tell whether the new ``point`` has been taken.

        Args:
            command: what moves.
            sampled: the registers at the sample's start.
            fresh: a new point is there.
            point: position to reach by the next segment. If it is not new, it is that of the
                registers as they stand, and reached anew if it is another (MCP-INT-2).
        """
        begins = self.left == 0 and (fresh or point != wrap_word(self.end, 0x800000))
        if begins:
            here = command.position
            self.begin(sampled, here, here + wrap_word(point - here, 0x800000))
        if self.left == 0:
            command.rest()
            return False
        command.left = self.left
        command.moving = True
        command.fraction = 0
        command.phase = 0
        command.position = wrap_word(self.next(), 0x800000)
        command.velocity = self.slope()
        return begins and fresh


class VelocityInterpolation(Segment):
    """Runs through a series of velocities, one ramp each (MCP-INT-5)."""

    def enter(self, velocity: i64) -> None:
        """The next step begins a ramp from ``velocity``."""
        self.left = 0
        self.end = velocity

    def slow_down(self, command: Command, sampled: SampledRegisters) -> None:
        """Ramp to standstill over one segment, unless that is under way (MCP-EXC-2)."""
        if self.end != 0:
            self.begin(sampled, command.velocity, 0)

    def step(self, command: Command, sampled: SampledRegisters, fresh: bool, velocity: i64) -> bool:
        """Make one sample; tell whether the new ``velocity`` has been taken.

        The parameters are those of :meth:`PositionInterpolation.step`.
        """
        begins = self.left == 0 and (fresh or velocity != self.end)
        if begins:
            self.begin(sampled, self.end, velocity)
        command.left = self.left
        command.phase = 0
        if self.left:
            command.moving = True
            command.move(self.next())
        else:
            # The last velocity is used again: the axis runs on, and PROF says so (NOTES 26).
            command.moving = self.end != 0
            command.move(self.end)
        return begins and fresh
