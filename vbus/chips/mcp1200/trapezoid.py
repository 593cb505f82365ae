"""Trapezoid profile mode: flag F0 with R01 bit 4 clear (MCP-TRP)."""

from typing import ClassVar, Final

from mypy_extensions import i64

from vbus.bits import wrap_word
from vbus.chips.mcp1200.command import Command
from vbus.chips.mcp1200.registers import SampledRegisters
from vbus.chips.motion.ramp import toward
from vbus.chips.motion.trapezoid import arrived, next_velocity, stopping_distance
from vbus.state import Names

ACCELERATING: Final = 2
SLEWING: Final = 4
DECELERATING: Final = 6
"""Phases a trapezoid shows in R06 (MCP-TRP-4)."""


def stop(command: Command, accel: i64) -> bool:
    """Make one sample of a deceleration to rest, the same for every profile.

    Returns:
        Whether the axis rests. No acceleration stops it at once.
    """
    velocity: i64 = 0
    if accel:
        velocity = toward(command.velocity, 0, accel)
    command.move(velocity)
    command.phase = DECELERATING
    return velocity == 0


class Trapezoid:
    """One move at a time; acceleration and top velocity may change under way (MCP-TRP-1)."""

    STATE: ClassVar[Names] = ("_begun: bool", "_final", "_origin")

    def __init__(self) -> None:
        self._begun: bool = False
        self._final: i64 = 0
        self._origin: i64 = 0

    def enter(self) -> None:
        """The next step begins a move."""
        self._begun = False

    def step(self, command: Command, sampled: SampledRegisters) -> i64:
        """Make one sample of the move.

        Returns:
            1 when it is over, 0 while it lasts, -1 if it must stop short of a final position
            that was moved too near (MCP-TRP-6): nothing has been done in this sample then.
        """
        accel = sampled.accel
        top = sampled.top_velocity
        final = sampled.final_position
        if not self._begun:
            waits = accel == 0 or top == 0
            if waits:
                command.velocity = 0
                command.phase = 0
            if final == command.position and command.velocity == 0:
                command.fraction = 0
                return 1
            if waits:
                return 0
            self._begun = True
            self._final = final
            self._origin = command.position
            command.phase = ACCELERATING
        elif final != self._final and command.phase < DECELERATING:
            if not _reachable(command, final, accel):
                return -1
            self._final = final
        before = command.velocity
        here = command.position
        ahead = (wrap_word(self._final - here, 0x800000) << 8) - command.fraction
        velocity = next_velocity(ahead, before, top, accel)
        command.move(velocity)
        old = before
        if before < 0 < ahead or ahead < 0 < before:
            old = 0
        elif before < 0:
            old = -before
        speed = velocity
        if velocity < 0:
            speed = -velocity
        self._show_phase(command, speed, old, top, here)
        if arrived(ahead - velocity, velocity, accel):
            self._begun = False
            return 1
        return 0

    def _show_phase(self, command: Command, speed: i64, old: i64, top: i64, here: i64) -> None:
        if command.phase == DECELERATING:
            return
        if speed > old:
            command.phase = ACCELERATING
        elif speed >= top:
            # Also while a lowered top velocity is being reached: the end is not in sight yet.
            command.phase = SLEWING
        elif speed < old:
            command.phase = DECELERATING
            command.decel_position = here
            return
        if command.phase == ACCELERATING:
            way = wrap_word(command.position - self._origin, 0x800000)
            command.accel_delta = way
            if way < 0:
                command.accel_delta = -way


def _reachable(command: Command, final: i64, accel: i64) -> bool:
    """Whether ``final`` lies at least one stopping distance ahead (NOTES 30)."""
    velocity = command.velocity
    if velocity == 0:
        return True
    ahead = (wrap_word(final - command.position, 0x800000) << 8) - command.fraction
    if velocity < 0:
        ahead, velocity = -ahead, -velocity
    if ahead <= 0 or accel == 0:
        return ahead > 0
    slower = velocity - accel
    if slower < 0:
        slower = 0
    return ahead >= stopping_distance(slower, accel)
