"""S-curve profile mode: flag F0 with R01 bit 4 set (MCP-SCV)."""

from typing import ClassVar, Final

from vbus.bits import wrap
from vbus.chips.mcp1200.command import Command
from vbus.chips.mcp1200.registers import SampledRegisters
from vbus.chips.motion.scurve import SCurve
from vbus.state import Names

UNIT: Final = 16
"""Fraction bits of the plan: distances in 1/65536 count."""
LAST_RISING: Final = 3
SLEWING: Final = 4
FIRST_FALLING: Final = 5


class SCurveMove:
    """One planned move at a time, laid from the command position at its start."""

    STATE: ClassVar[Names] = ("_begun: bool", "_final", "_origin", "_sign", "_plan: part")

    def __init__(self) -> None:
        self._plan: SCurve = SCurve()
        self._begun: bool = False
        self._final: int = 0
        self._origin: int = 0
        self._sign: int = 1

    def enter(self) -> None:
        """The next step begins a move."""
        self._begun = False

    def step(self, command: Command, sampled: SampledRegisters) -> int:
        """Make one sample; the result is that of ``Trapezoid.step``."""
        final: int = sampled.final_position
        plan = self._plan
        if not self._begun:
            command.fraction = 0
            command.velocity = 0
            command.phase = 0
            way = wrap(final - command.position, 24)
            if way == 0:
                return 1
            top = sampled.top_velocity << 8
            if not plan.plan(abs(way) << UNIT, top, sampled.accel << 8, sampled.jerk):
                return 0
            self._begun = True
            self._final = final
            self._origin = command.position
            self._sign = 1 if way > 0 else -1
        elif final != self._final and plan.phase <= SLEWING:
            if not self._retarget(command, final):
                self._begun = False
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
            self._begun = False
            return 1
        return 0

    def _retarget(self, command: Command, final: int) -> bool:
        """Lengthen the move, or shorten it in phase 4, if the new end can be reached."""
        plan = self._plan
        way = self._sign * wrap(final - command.position, 24)
        distance = (plan.offset >> UNIT) + way << UNIT
        if distance < plan.distance and plan.phase != SLEWING:
            return False
        return plan.retarget(distance)
