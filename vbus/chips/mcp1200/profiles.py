"""Profile mode, flag F0: trapezoid (MCP-TRP), or S-curve with R01 bit 4 set (MCP-SCV)."""

from typing import ClassVar, Final

from mypy_extensions import i64

from vbus.chips.mcp1200.command import CommandedMotion
from vbus.chips.mcp1200.registers import SampledRegisters
from vbus.chips.motion.ramp import toward
from vbus.chips.motion.scurve import SCurve
from vbus.chips.motion.trapezoid import arrived, next_velocity, stopping_distance
from vbus.core.bits import wrap, wrap_word
from vbus.core.state import Names

ACCELERATING: Final = 2
SLEWING: Final = 4
DECELERATING: Final = 6
"""Phases a trapezoid shows in R06 (MCP-TRP-4)."""
UNIT: Final = 16
"""Fraction bits of the plan: distances in 1/65536 count."""
LAST_RISING: Final = 3
FIRST_FALLING: Final = 5


def stop(command: CommandedMotion, accel: i64) -> bool:
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
    """One move at a time; acceleration and top velocity may change under way (MCP-TRP-1).

    Attributes:
        begun: a move is under way; without, the next step begins one.
    """

    STATE: ClassVar[Names] = ("begun: bool", "_final", "_origin")

    def __init__(self) -> None:
        self.begun: bool = False
        self._final: i64 = 0
        self._origin: i64 = 0

    def step(self, command: CommandedMotion, sampled: SampledRegisters) -> i64:
        """Make one sample of the move.

        Returns:
            1 when it is over, 0 while it lasts, -1 if it must stop short of a final position
            that was moved too near: nothing has been done in this sample then.
        """
        accel = sampled.accel
        top = sampled.top_velocity
        final = sampled.final_position
        if not self.begun:
            waits = accel == 0 or top == 0  # MCP-TRP-5
            if waits:  # MCP-TRP-5
                command.velocity = 0
                command.phase = 0
            if final == command.position and command.velocity == 0:
                command.fraction = 0
                return 1
            if waits:
                return 0
            self.begun = True
            self._final = final
            self._origin = command.position
            command.phase = ACCELERATING
        elif final != self._final and command.phase < DECELERATING:
            # MCP-TRP-6
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
            self.begun = False
            return 1
        return 0

    def _show_phase(
        self, command: CommandedMotion, speed: i64, old: i64, top: i64, here: i64
    ) -> None:
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


def _reachable(command: CommandedMotion, final: i64, accel: i64) -> bool:
    """Whether ``final`` lies at least one stopping distance ahead (NOTES 30)."""
    velocity = command.velocity
    if velocity == 0:
        return True
    ahead = (wrap_word(final - command.position, 0x800000) << 8) - command.fraction
    if velocity < 0:
        ahead, velocity = -ahead, -velocity
    if ahead <= 0 or accel == 0:
        return ahead > 0
    return velocity <= accel or ahead >= stopping_distance(velocity - accel, accel)


class SCurveMove:
    """One planned move at a time, laid from the command position at its start.

    Attributes:
        begun: a move is under way; without, the next step begins one.
    """

    STATE: ClassVar[Names] = ("begun: bool", "_final", "_origin", "_sign", "_plan: part")

    def __init__(self) -> None:
        self._plan: SCurve = SCurve()
        self.begun: bool = False
        self._final: int = 0
        self._origin: int = 0
        self._sign: int = 1

    def step(self, command: CommandedMotion, sampled: SampledRegisters) -> int:
        """Make one sample; the result is that of :meth:`Trapezoid.step`."""
        final: int = sampled.final_position
        plan = self._plan
        if not self.begun:
            command.fraction = 0
            command.velocity = 0
            command.phase = 0
            way = wrap(final - command.position, 24)
            if way == 0:
                return 1
            top = sampled.top_velocity << 8
            if not plan.plan(abs(way) << UNIT, top, sampled.accel << 8, sampled.jerk):
                return 0
            self.begun = True
            self._final = final
            self._origin = command.position
            self._sign = 1 if way > 0 else -1
        elif final != self._final and plan.phase <= SLEWING:
            if not self._retarget(command, final):
                self.begun = False
                return -1
            self._final = final
        before = plan.offset
        last = plan.phase
        phase = plan.coming_phase()
        offset = plan.step()
        command.position = wrap(self._origin + self._sign * (offset >> UNIT), 24)
        command.velocity = self._sign * (offset - before >> 8)
        command.phase = plan.phase
        if phase <= LAST_RISING:
            command.accel_delta = offset >> UNIT
        if last < FIRST_FALLING <= phase:
            start = plan.distance - plan.deceleration_distance
            command.decel_position = wrap(self._origin + self._sign * (start >> UNIT), 24)
        if plan.done:
            self.begun = False
            return 1
        return 0

    def _retarget(self, command: CommandedMotion, final: int) -> bool:
        """Lengthen the move, or shorten it in phase 4, if the new end can be reached."""
        plan = self._plan
        way = self._sign * wrap(final - command.position, 24)
        distance = (plan.offset >> UNIT) + way << UNIT
        if distance < plan.distance and plan.phase != SLEWING:
            return False
        return plan.retarget(distance)
