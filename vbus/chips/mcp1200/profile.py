"""The command position, and all that moves it: profile mode, flag F0, by a trapezoid (MCP-TRP) or
an S-curve (MCP-SCV), integral velocity mode (MCP-VEL) and interpolation (MCP-INT)."""

from typing import ClassVar, Final

from mypy_extensions import i64

from vbus.chips.mcp1200 import datasheet as ds
from vbus.chips.mcp1200.registers import SampledRegisters
from vbus.chips.motion.scurve import SCurve
from vbus.chips.motion.trapezoid import arrived, next_velocity, stopping_distance, toward
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


WIDEST: Final = 127
WIDEST_HIGH: Final = 32767


def widest(sampled: SampledRegisters) -> i64:
    """Return the largest change between two velocity commands, counts per sample (MCP-VEL-2)."""
    if sampled.feature & ds.HIGH_RESOLUTION:
        return WIDEST_HIGH
    return WIDEST


class CommandedMotion:
    """Commanded position and velocity of the axis; every generator moves this.

    Attributes:
        position: 24-bit command position.
        fraction: 1/256 counts beyond it, 0..255.
        velocity: 1/256 count per sample in the last sample.
        moving: a profile or interpolation runs: the in-motion flag F2.
        phase: what R06 shows.
        left: what R19 shows.
        accel_delta: what R31-R33 show.
        decel_position: what R39-R3B show.
    """

    STATE: ClassVar[Names] = (
        "position", "fraction", "velocity", "moving: bool", "phase", "left", "accel_delta",
        "decel_position",
    )  # fmt: skip

    def __init__(self) -> None:
        self.position: i64 = 0
        self.accel_delta: i64 = 0
        self.decel_position: i64 = 0
        self.fraction: i64 = 0
        self.velocity: i64 = 0
        self.moving: bool = False
        self.phase: i64 = 0
        self.left: i64 = 0

    def rest(self) -> None:
        """Stand where the command is; the fraction is dropped."""
        self.fraction = 0
        self.velocity = 0
        self.moving = False
        self.phase = 0
        self.left = 0

    def move(self, velocity: i64) -> None:
        """Go on by ``velocity`` (MCP-POS-2)."""
        total = self.fraction + velocity
        # MCP-POS-2, MCP-TRP-7: 24 bits come round; the fraction is carried on.
        self.position = wrap_word(self.position + (total >> 8), 0x800000)
        self.fraction = total & 0xFF
        self.velocity = velocity


class IntegralVelocity:
    """Runs toward the velocity command with the programmed acceleration, through positions.

    Attributes:
        begun: a step has been made with a velocity command of the host's.
    """

    STATE: ClassVar[Names] = ("begun: bool", "_goal")

    def __init__(self) -> None:
        self.begun: bool = False
        self._goal: i64 = 0

    def step(self, command: CommandedMotion, sampled: SampledRegisters, goal: i64) -> i64:
        """Make one sample toward ``goal`` (1/256 count per sample).

        Returns:
            By how many counts per sample the goal has changed too far at once, 0 if it has not.
        """
        change: i64 = 0
        if self.begun:
            change = goal - self._goal
            if change < 0:
                change = -change
        self.begun = True
        self._goal = goal
        # MCP-VEL-1, MCP-VEL-4: by at most A, which 0 makes none.
        command.move(toward(command.velocity, goal, sampled.accel))
        # MCP-FLG-4: F2 is up while velocity or command is not 0.
        command.moving = goal != 0 or command.velocity != 0
        if change <= widest(sampled) << 8:
            return 0
        return change >> 8


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
        # MCP-REG-18, MCP-INT-3: the lower 3 bits of R18, as it is now.
        self._shift = (sampled.interpolator_preset & 7) + 1
        self.left = one << self._shift

    def hold(self, value: i64) -> None:
        """Stay at ``value`` until another is to be reached."""
        self.left = 0
        self.end = value

    def next(self) -> i64:
        """Make one sample; return the value at its end (MCP-INT-1)."""
        one: i64 = 1
        self.left -= 1
        done = (one << self._shift) - self.left
        # MCP-INT-1, MCP-INT-5: rounded down; exactly the end at the last sample.
        return self.start + ((self.end - self.start) * done >> self._shift)

    def slope(self) -> i64:
        """Change of the value per sample, in 1/256."""
        return (self.end - self.start << 8) >> self._shift


class PositionInterpolation(Segment):
    """Runs through a series of positions, one segment each (MCP-INT-1)."""

    def step(
        self, command: CommandedMotion, sampled: SampledRegisters, fresh: bool, point: i64
    ) -> bool:
        """Make one sample; tell whether the new ``point`` has been taken.

        Args:
            command: what moves.
            sampled: the registers at the sample's start.
            fresh: a new point is there.
            point: position to reach by the next segment. If it is not new, it is that of the
                registers as they stand, and reached anew if it is another (MCP-INT-2).
        """
        # MCP-INT-4: unless the registers have changed, the axis stays.
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

    def slow_down(self, command: CommandedMotion, sampled: SampledRegisters) -> None:
        """Ramp to standstill over one segment, unless that is under way (MCP-EXC-2)."""
        if self.end != 0:
            self.begin(sampled, command.velocity, 0)

    def step(
        self, command: CommandedMotion, sampled: SampledRegisters, fresh: bool, velocity: i64
    ) -> bool:
        """Make one sample; tell whether the new ``velocity`` has been taken.

        The parameters are those of :meth:`PositionInterpolation.step`.
        """
        # MCP-INT-4: the velocity in the registers is used again.
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
            # MCP-TRP-5: nothing to do: F0 is cleared in this sample.
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
            # MCP-TRP-6, MCP-AMB-31: taken while the axis does not brake yet.
            if not _reachable(command, final, accel):
                return -1
            self._final = final
        before = command.velocity
        here = command.position
        # MCP-TRP-7, MCP-POS-2: the shorter way round, in 1/256 count.
        ahead = (wrap_word(self._final - here, 0x800000) << 8) - command.fraction
        velocity = next_velocity(ahead, before, top, accel)
        command.move(velocity)
        old = before
        # MCP-TRP-4: a move that turns round accelerates from 0 on.
        if before < 0 < ahead or ahead < 0 < before:
            old = 0
        elif before < 0:
            old = -before
        speed = velocity
        if velocity < 0:
            speed = -velocity
        self._show_phase(command, speed, old, top, here)
        # MCP-TRP-2: exactly there, and slower than one A.
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
        # MCP-TRP-8: kept from the end of phase 2 on.
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
    # MCP-TRP-6: the coming sample may brake already, so it counts as the first slower one.
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
            # MCP-TRP-5: nothing to do, as with a trapezoid.
            if way == 0:
                return 1
            top = sampled.top_velocity << 8
            # MCP-SCV-1, MCP-SCV-4: with V, A or J 0 F0 stays set, and the plan is tried anew.
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
        # MCP-TRP-8: R31 to R33 stay as they are from the end of phase 3 on.
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
        # MCP-SCV-5: shortened in phase 4 alone.
        if distance < plan.distance and plan.phase != SLEWING:
            return False
        return plan.retarget(distance)
