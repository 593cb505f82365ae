"""The profile generator of one axis: trapezoid, velocity contouring, S-curve and gear."""

from typing import ClassVar, Final

from vbus.chips.mc1241a import datasheet as ds
from vbus.chips.mc1241a.chipset import ProfileRegisters
from vbus.chips.motion.scurve import SCurve
from vbus.chips.motion.trapezoid import arrived, next_velocity, toward
from vbus.core.bits import wrap, wrap_word
from vbus.core.state import Names

DONE: Final = 0
"""Nothing to do: before the first move, or after one has ended by itself."""
RUNNING: Final = 1
HALTED: Final = 2
"""Stopped by STOP, a limit switch or the motor's being off: waits for an update, also in gear."""

MAGNITUDE_MASK: Final = (1 << ds.MAGNITUDE_BITS) - 1
WORD_BITS: Final = ds.POSITION_BITS + 32
"""A position with its 32 fraction bits (PMD-TRJ-1)."""
_HALF_ACCELERATION: Final = 1 << ds.ACCELERATION_BITS - 1
_FAR_INSIDE: Final = 1 << 61
"""Positions nearer to 0 are far from the ends of their range, and fit a machine word."""


def _can_begin(active: ProfileRegisters) -> bool:
    """Whether a trapezoid with these registers ever leaves rest (NOTES 21)."""
    return active.velocity != 0 and active.acceleration & MAGNITUDE_MASK != 0


class Profile:
    """Target position and velocity, and the mode that moves them once a cycle.

    Positions have 32 fraction bits (PMD-TRJ-1); trapezoid, velocity contouring and gear use the
    upper 16 of them.
    """

    STATE: ClassVar[Names] = (
        "mode", "position", "velocity", "moved", "_state", "_smooth: bool", "_destination",
        "_turns", "_sign", "_start", "_curve: part",
    )  # fmt: skip

    def __init__(self) -> None:
        self._curve: SCurve = SCurve()
        self.reset()

    def reset(self) -> None:
        """Position 0, trapezoidal, at rest."""
        self.mode: int = ds.TRAPEZOIDAL
        self.position: int = 0
        """Target position (2^-32 usteps), wrapped."""
        self.velocity: int = 0
        """Target velocity (2^-32 usteps/cycle)."""
        self.moved: int = 0
        """Way of the last cycle (2^-32 usteps)."""
        self._state: int = DONE
        self._smooth: bool = False
        self._destination: int = 0
        self._turns: int = 0
        self._sign: int = 1
        self._start: int = 0
        self._clear_curve()

    def _clear_curve(self) -> None:
        self._curve.plan(0, 0, 0, 0)

    # -- what others ask ----------------------------------------------------------------------

    @property
    def target_position(self) -> int:
        """The target position in whole usteps (PMD-CMD-25)."""
        return self.position >> 32

    @property
    def target_velocity(self) -> int:
        """The target velocity, 16.16 (PMD-CMD-26)."""
        return self.velocity >> 16

    def travelled(self) -> int:
        """Return the target position as if it did not wrap, for the comparison with an encoder."""
        return self.target_position + (self._turns << ds.POSITION_BITS)

    def phase(self) -> int:
        """Return the S-curve phase, 1 to 7, or 0 at rest (PMD-STA-5)."""
        return self._curve.phase if self._state == RUNNING else 0

    def in_motion(self) -> bool:
        """Whether the trajectory is in motion (PMD-TRJ-8, PMD-STA-3)."""
        # PMD-STA-3: in gear mode bit 10 stays 0.
        if self.mode == ds.GEAR:
            return False
        # PMD-TRJ-8: in velocity mode the velocity alone decides.
        if self.mode == ds.VELOCITY:
            return self.velocity != 0
        return self._state == RUNNING

    def resting(self, active: ProfileRegisters) -> bool:
        """Whether further cycles with the same registers and a resting encoder change nothing.

        Motion shows in the microstepper, which is not still.
        """
        if self._state != RUNNING or self.mode == ds.GEAR:
            return True
        return self.mode == ds.VELOCITY and (active.velocity == 0 or active.acceleration == 0)

    # -- what commands and updates do ---------------------------------------------------------

    def set_mode(self, mode: int, destination: int) -> bool:
        """Change the mode; tell whether the axis should have been at rest (PMD-TRJ-13).

        Args:
            mode: the new mode.
            destination: the active one, where a trapezoid entered in motion goes (usteps).
        """
        if mode == self.mode:
            return False
        # A trapezoid that turns round has velocity 0 on the way.
        moving = self.velocity != 0 or self.in_motion()
        rude = moving and mode in (ds.TRAPEZOIDAL, ds.S_CURVE)
        # PMD-TRJ-13: at once, at any time.
        self.mode = mode
        self._clear_curve()
        self._destination = destination
        # PMD-TRJ-13: a trapezoid goes on with the velocity there is; an S-curve begins from rest.
        if mode == ds.S_CURVE:
            self.velocity = 0
            moving = False
        if self._state != HALTED:
            self._state = RUNNING if moving else DONE
        return rude

    def set_target(self, position: int) -> None:
        """Give the target another number (usteps) without a step; the velocity stays.

        A running S-curve still ends on its destination if it can, else as far away as planned.
        """
        before = self.position
        self.position = position << 32
        # PMD-AMB-5: motion goes on, as the reference warns; the end is the destination in the new
        # numbers.
        if self.mode == ds.S_CURVE and self._state == RUNNING:
            self._start += self.position - before
            self._retarget(self._destination)

    def halt(self) -> None:
        """Stop at once; wait for the next update (PMD-TRJ-9)."""
        self.velocity = 0
        # PMD-TRJ-9: a gear waits for the next update, too.
        self._state = HALTED
        self._smooth = False
        self._clear_curve()

    def smooth_stop(self) -> bool:
        """Begin to decelerate; tell whether motion is complete at once: at rest (PMD-TRJ-10).

        Not for electronic gear.
        """
        # PMD-TRJ-10: phases 5, 6 and 7 mirror what has been run of 1, 2 and 3.
        if self.mode == ds.S_CURVE:
            self._curve.stop()
            rests = self._curve.done
        else:
            rests = self.velocity == 0
        self._smooth = not rests
        self._state = DONE if rests else RUNNING
        return rests

    def start(self, active: ProfileRegisters, given: bool) -> bool:
        """Go on after an update, toward the active destination.

        Args:
            active: the active registers.
            given: a destination was given, be it the present position (PMD-TRJ-12).

        Returns:
            Whether motion is complete at once: the axis rests on the destination given.
        """
        if self.mode in (ds.VELOCITY, ds.GEAR):
            self._smooth = False  # PMD-TRJ-10
            self._state = RUNNING
            return False
        running = self._state == RUNNING
        if self.mode == ds.S_CURVE and running:
            # PMD-TRJ-5: taken now if the new end can be had, else by a later update.
            if self._retarget(active.position):
                self._destination = active.position
            return False
        self._smooth = False  # PMD-TRJ-10
        self._destination = active.position
        way = (active.position << 32) - self.position
        # PMD-TRJ-12: an update that moves nothing completes nothing, unless it names a destination.
        if way == 0 and self.velocity == 0 and not given and not running:
            self._state = DONE
            return False
        if self.mode == ds.S_CURVE:
            # PMD-TRJ-4: planned as a way forward, of any length, and run with its sign.
            self._sign = -1 if way < 0 else 1
            self._start = self.position
            # PMD-TRJ-4: the plan counts all of them in 2^-32 usteps.
            moves = self._curve.plan(
                abs(way), active.velocity << 16, active.max_acceleration << 16, active.jerk
            )
        else:
            moves = self.velocity != 0 or (way != 0 and _can_begin(active))
        # PMD-TRJ-8: a profile that cannot move is at rest, not in motion.
        self._state = RUNNING if moves else DONE
        # What cannot begin has not ended either (NOTES 21).
        return not moves and (way == 0 or running)

    def stuck(self, active: ProfileRegisters) -> bool:
        """Whether a trapezoid that has been started stands, away from its destination."""
        if self.mode != ds.TRAPEZOIDAL or self._state == RUNNING:
            return False
        return self.position != active.position << 32 and not _can_begin(active)

    def settled(self, active: ProfileRegisters) -> bool:
        """Whether :meth:`start` would leave a point-to-point move as it is: under way, or over."""
        if self.mode in (ds.VELOCITY, ds.GEAR):
            return self._state == RUNNING and not self._smooth
        if self._state == RUNNING:
            return not self._smooth and self._destination == active.position
        return self.velocity == 0 and self.position == active.position << 32

    def _retarget(self, destination: int) -> bool:
        """Stretch or cut a running S-curve to end elsewhere, if that can be (PMD-TRJ-5)."""
        return self._curve.retarget(((destination << 32) - self._start) * self._sign)

    # -- once a cycle -------------------------------------------------------------------------

    def step(self, active: ProfileRegisters, start_velocity: int, counts: int) -> int:
        """Run one cycle; return the status events it caused.

        Args:
            active: the active registers.
            start_velocity: in 1/65536 usteps/cycle.
            counts: how far the encoder has moved since the last cycle.
        """
        self.moved = 0
        if self.mode == ds.GEAR:
            if self._state != HALTED:
                # The encoder's way times the ratio, fraction carried (PMD-TRJ-7).
                # PMD-TRJ-7: the change since the last cycle alone: entering the mode, and a new
                # ratio, make no jump.
                self.velocity = self.moved = counts * active.ratio << 16
            return self._advance()
        # PMD-MTR-2: a motor that is off generates nothing; its state waits.
        if self._state != RUNNING:
            return 0
        if self.mode == ds.TRAPEZOIDAL:
            done = self._trapezoid(active, start_velocity)
        elif self.mode == ds.VELOCITY:
            done = self._contour(active, start_velocity)
        else:
            done = self._s_curve()
        events = self._advance()
        return events | ds.MOTION_COMPLETE if done else events

    def _trapezoid(self, active: ProfileRegisters, start_velocity: int) -> bool:
        """PMD-TRJ-2, in 1/65536 usteps: finer fractions left by an S-curve are dropped."""
        acceleration = active.acceleration & MAGNITUDE_MASK
        if self._smooth:
            return self._slow_down(acceleration, start_velocity)
        position = self.position >> 16
        remaining = (self._destination << 16) - position
        velocity: int = next_velocity(
            remaining, self.velocity >> 16, active.velocity, acceleration, start_velocity
        )
        self._run_at(velocity)
        # PMD-TRJ-2, PMD-TRJ-12: exactly there and slow enough; a top velocity lowered to 0 ends
        # where it stands.
        if arrived(remaining - velocity, velocity, acceleration, start_velocity) or (
            velocity == 0 and not _can_begin(active)
        ):
            self.velocity = 0
            self._state = DONE
            return True
        return False

    def _contour(self, active: ProfileRegisters, start_velocity: int) -> bool:
        """PMD-TRJ-6: toward +V or -V, as the acceleration's sign says."""
        acceleration: int = wrap_word(active.acceleration, _HALF_ACCELERATION)
        if self._smooth:
            return self._slow_down(abs(acceleration), start_velocity)
        before = self.velocity >> 16
        # PMD-TRJ-6: the acceleration's sign is the direction; with 0 the velocity stays.
        goal = active.velocity if acceleration >= 0 else -active.velocity
        velocity: int = toward(before, goal, abs(acceleration), start_velocity)
        self._run_at(velocity)
        # PMD-TRJ-12: complete when the velocity that is asked for is 0 and has been reached.
        return velocity == 0 and before != 0 and goal == 0

    def _run_at(self, velocity: int) -> None:
        """Move by a velocity in 1/65536 usteps; finer fractions of the position are dropped."""
        self.velocity = velocity << 16
        self.moved = (self.position >> 16 << 16) - self.position + self.velocity

    def _slow_down(self, acceleration: int, start_velocity: int) -> bool:
        """Smooth stop: linear, at once without an acceleration (PMD-TRJ-10, NOTES 8)."""
        velocity: int = toward(self.velocity >> 16, 0, acceleration, start_velocity)
        # PMD-TRJ-10: without an acceleration it would never end.
        if acceleration == 0:
            velocity = 0
        self._run_at(velocity)
        return velocity == 0 and self._stopped()

    def _stopped(self) -> bool:
        self._smooth = False
        self._state = DONE
        return True

    def _s_curve(self) -> bool:
        """PMD-TRJ-4: the plan decides; its last step ends on the destination."""
        curve = self._curve
        before = curve.offset
        self.moved = (curve.step() - before) * self._sign
        self.velocity = curve.velocity * self._sign
        return curve.done and self._stopped()

    def _advance(self) -> int:
        """Move the target; it goes on at the other end of its range (PMD-TRJ-1)."""
        position = self.position + self.moved
        # Far from both ends, as nearly always, there is nothing to wrap.
        if -_FAR_INSIDE < position < _FAR_INSIDE:
            self.position = position
            return 0
        self.position = wrap(position, WORD_BITS)
        if position == self.position:
            return 0
        # PMD-STL-1: the error is compared without wraps.
        self._turns += (position - self.position) >> WORD_BITS
        if self.mode == ds.S_CURVE:
            self._start += self.position - position
        return ds.WRAP
