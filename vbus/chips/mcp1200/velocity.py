"""Integral velocity mode: flag F5 (MCP-VEL)."""

from typing import Final

from vbus.chips.mcp1200 import datasheet as ds
from vbus.chips.mcp1200.command import Command, acceleration
from vbus.chips.motion.ramp import toward

WIDEST: Final = 127
WIDEST_HIGH: Final = 32767
"""Largest change between two velocity commands, counts per sample (MCP-VEL-2)."""


class IntegralVelocity:
    """Runs toward the velocity command with the programmed acceleration, through positions."""

    __slots__ = ("_begun", "_goal")

    def __init__(self) -> None:
        self._begun: bool = False
        self._goal: int = 0

    def enter(self) -> None:
        """The next step is the first of the mode."""
        self._begun = False

    def step(self, command: Command, image: bytes, goal: int) -> int:
        """Make one sample toward ``goal`` (1/256 count per sample).

        Returns:
            By how many counts per sample the goal has changed too far at once, 0 if it has not.
        """
        change = abs(goal - self._goal) if self._begun else 0
        self._begun = True
        self._goal = goal
        command.move(toward(command.velocity, goal, acceleration(image)))
        command.moving = goal != 0 or command.velocity != 0
        widest = WIDEST_HIGH if image[ds.FEATURE] & ds.HIGH_RESOLUTION else WIDEST
        return change >> 8 if change > widest << 8 else 0

    def save(self) -> tuple[int, ...]:
        """Return the state."""
        return (int(self._begun), self._goal)

    def load(self, state: tuple[int, ...]) -> None:
        """Take back what :meth:`save` gave."""
        begun, self._goal = state
        self._begun = bool(begun)
