"""Integral velocity mode: flag F5 (MCP-VEL)."""

from typing import ClassVar, Final

from mypy_extensions import i64

from vbus.chips.mcp1200 import datasheet as ds
from vbus.chips.mcp1200.command import Command
from vbus.chips.mcp1200.registers import SampledRegisters
from vbus.chips.motion.ramp import toward
from vbus.state import Names

WIDEST: Final = 127
WIDEST_HIGH: Final = 32767
"""Largest change between two velocity commands, counts per sample (MCP-VEL-2)."""


class IntegralVelocity:
    """Runs toward the velocity command with the programmed acceleration, through positions."""

    STATE: ClassVar[Names] = ("_begun: bool", "_goal")

    def __init__(self) -> None:
        self._begun: bool = False
        self._goal: i64 = 0

    def enter(self) -> None:
        """The next step is the first of the mode."""
        self._begun = False

    def step(self, command: Command, sampled: SampledRegisters, goal: i64) -> i64:
        """Make one sample toward ``goal`` (1/256 count per sample).

        Returns:
            By how many counts per sample the goal has changed too far at once, 0 if it has not.
        """
        change: i64 = 0
        if self._begun:
            change = goal - self._goal
            if change < 0:
                change = -change
        self._begun = True
        self._goal = goal
        command.move(toward(command.velocity, goal, sampled.accel))
        command.moving = goal != 0 or command.velocity != 0
        widest: i64 = WIDEST
        if sampled.feature & ds.HIGH_RESOLUTION:
            widest = WIDEST_HIGH
        if change <= widest << 8:
            return 0
        return change >> 8
