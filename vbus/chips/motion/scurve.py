"""A move with limited jerk: planned once, then counted out sample by sample, in integers.

The plan of MCP-SCV-1 to 5 and PMD-TRJ-4, 5 and 10. All quantities are integers in one unit of the
chip's choosing (MCP-1200 2^-16 count, MC1241A 2^-32 microstep): distance in units, velocity per
sample, acceleration per sample squared, jerk per sample cubed.

Acceleration rises for ``m`` samples, holds for ``t`` and falls for ``m``; deceleration mirrors it.
Two counters make that shape: ``k`` counts the acceleration, ``c`` sums it up, and the velocity is
``c`` times a rational quantum chosen so that everything adds up to the distance with no remainder:
where the distance is no multiple of the top velocity, the move lasts up to one sample longer and
peaks a little lower. So velocity, acceleration and jerk keep their limits exactly, but around one
sample that a changed end may need (:meth:`SCurve.retarget`).

No number is ever rounded; only what is read from outside is cut down to whole units. Python's
integers hold the products however long a move is (PMD distances need 2^63 and more). A compiled
build multiplies in machine words what is below 2^30: of the MCP-1200, moves of less than 16384
counts and those whose way is a multiple of the top velocity. All others take it some 0.2 us more in
each sample.
"""

from math import isqrt
from typing import ClassVar

from vbus.core.state import Names


def _ceil_div(a: int, b: int) -> int:
    return -(-a // b)


def _ceil_sqrt(value: int) -> int:
    """Smallest integer whose square is at least ``value`` (1 or more)."""
    return isqrt(value - 1) + 1


def _ceil_cbrt(value: int) -> int:
    """Smallest integer whose cube is at least ``value`` (1 or more)."""
    if value <= 1:
        return 1
    # Newton's iteration from above ends at the largest root whose cube is not above the argument.
    # No float: beyond 2^53 it would have rounded, and the last bit decides here.
    value -= 1
    root = 1 << (value.bit_length() + 2) // 3
    while True:
        better = (2 * root + value // (root * root)) // 3
        if better >= root:
            return root + 1
        root = better


class SCurve:
    """One move of an axis, counted from its start; the chip applies sign and starting place.

    Call :meth:`plan`, then :meth:`step` once per sample until :attr:`done`.

    Attributes:
        distance: whole way of the move, in units.
        offset: way covered so far, cut down to whole units.
        velocity: velocity of the last sample, cut down; 0 once the move is done.
        phase: 1..7, the phase of the last sample; 0 before the first and once the move is done.
        done: the last sample that moves has been made (MCP-SCV-4).
        rise: samples over which acceleration rises, and falls (``m``).
        flat: samples of constant acceleration (``t``).
        hold: samples at peak velocity (``Tv``).
    """

    STATE: ClassVar[Names] = (
        "distance: int", "offset: int", "velocity: int", "phase: int", "done: bool", "rise: int",
        "flat: int", "hold: int", "_num: int", "_den: int", "_part: int", "_end_part: int",
        "_rest: int", "_k: int", "_c: int", "_peak: int", "_left: int", "_stopping: bool",
    )  # fmt: skip

    def __init__(self) -> None:
        self.plan(0, 0, 0, 0)

    def plan(self, distance: int, top: int, accel: int, jerk: int) -> bool:
        """Plan a move from rest (MCP-SCV-1).

        Args:
            distance: way to go, 0 or more; with 0 the move is done at once.
            top: largest velocity.
            accel: largest acceleration.
            jerk: largest jerk.

        Returns:
            Whether it moves. With ``top``, ``accel`` or ``jerk`` 0 it does not and is never done
            (MCP-SCV-4).
        """
        self.distance: int = distance
        self.offset: int = 0
        self.velocity: int = 0
        self.phase: int = 0
        self.done: bool = distance == 0
        self.rise: int = 0
        self.flat: int = 0
        self.hold: int = 0
        # Velocity is c * _num / _den; _part / _den is what ``offset`` was cut down by.
        self._num: int = 0
        self._den: int = 1
        self._part: int = 0
        self._end_part: int = 0
        # Velocity of the one sample that a changed end may need (MCP-SCV-3), times _den.
        self._rest: int = 0
        self._k: int = 0
        self._c: int = 0
        self._peak: int = 0
        self._left: int = 0
        self._stopping: bool = False
        # MCP-SCV-4: no plan: the move waits for numbers that move it.
        if self.done or top == 0 or accel == 0 or jerk == 0:
            return False

        # MCP-SCV-1: whether the acceleration reaches its limit before the velocity does.
        if accel * accel >= top * jerk:
            rise = _ceil_sqrt(_ceil_div(top, jerk))
            flat = 0
        else:
            rise = _ceil_div(accel, jerk)
            flat = max(0, _ceil_div(top, accel) - rise)
        # MCP-SCV-1: a short move never reaches its top velocity, and perhaps not its acceleration.
        if distance < top * (2 * rise + flat):
            rise = _ceil_cbrt(_ceil_div(distance, 2 * jerk))
            flat = 0
            if distance > 2 * accel * rise * rise:
                rise = _ceil_div(accel, jerk)
                root = _ceil_sqrt(rise * rise + 4 * _ceil_div(distance, accel))
                # At least 1: the distance is more than 2 * accel * rise * rise with this rise, too.
                flat = _ceil_div(root - 3 * rise, 2)
        ramps = 2 * rise + flat
        # As many samples at the peak velocity as the whole move is worth.
        # MCP-SCV-1, MCP-SCV-3: the way is spread over whole samples: no remainder is left.
        samples = max(ramps, _ceil_div(distance, top))
        self.rise = rise
        self.flat = flat
        self.hold = samples - ramps
        self._peak = rise * (rise + flat)
        if distance == samples * top:
            # The same velocity as below, in smaller numbers.
            self._num = top
            self._den = self._peak
        else:
            self._num = distance
            self._den = samples * self._peak
        return True

    def step(self) -> int:
        """Make one sample; return :attr:`offset` after it.

        Without a plan, or once the move is done, nothing changes.
        """
        if self.done or self._peak == 0:
            return self.offset
        phase = self.coming_phase()
        if phase != self.phase:
            self.phase = phase
            self._left = self._samples(phase)

        c = self._c
        k = self._k
        # MCP-SCV-2: k rises in phases 1 and 5, falls in 3 and 7, and stands in the others.
        if phase == 1 or phase == 5:
            k += 1
        elif phase == 3 or phase == 7:
            k -= 1
        # MCP-SCV-2: c adds k up before the peak, and takes it away after.
        if phase < 4:
            c += k
        elif phase > 4:
            c -= k
        way = self._num * c
        # MCP-SCV-3: the extra sample, before the first that is not faster.
        if phase > 4 and self._rest > 0 and way <= self._rest:
            way = self._rest
            self._rest = 0
        else:
            self._k = k
            self._c = c
            self._left -= 1

        whole = way // self._den
        part = self._part + way - whole * self._den
        self.offset += whole
        if part >= self._den:
            part -= self._den
            self.offset += 1
        self._part = part
        if self.offset == self.distance and part == self._end_part:
            # MCP-SCV-4: complete with the last sample that moves.
            self.done = True
            self.phase = 0
            self.velocity = 0
        else:
            self.velocity = whole
        return self.offset

    def coming_phase(self) -> int:
        """Return the phase of the coming sample, the last one of the move too.

        A hold can be lengthened after its last sample, so this is known only now.
        """
        phase = self.phase if self.phase > 0 else 1
        left = self._left if self.phase > 0 else self.rise
        while left == 0 and phase < 7:
            phase += 1
            left = self._samples(phase)
        return phase

    def retarget(self, distance: int) -> bool:
        """Change the whole way of a move under way, at the same peak velocity (MCP-SCV-5).

        What the new way is more than a multiple of that velocity takes one sample of its own in
        phases 5 to 7, around which the jerk limit is not kept (MCP-SCV-3).

        Args:
            distance: new way, counted from the start of the move.

        Returns:
            Whether it was taken: only in phases 1 to 4, and if the new end can still be reached
            by a longer or shorter hold. Otherwise nothing has changed. A chip that does not allow
            shortening before phase 4 asks for that itself.
        """
        # MCP-SCV-5, PMD-TRJ-5: in phases 1 to 4 alone.
        if self.done or self._stopping or self._peak == 0 or self.phase > 4:
            return False
        held = self.hold - self._left if self.phase == 4 else 0
        ramps = 2 * self.rise + self.flat
        peak = self._num * self._peak
        samples = distance * self._den // peak
        # MCP-SCV-5: what is left of the hold is too short to take it from.
        if samples < ramps + held:
            return False
        self.distance = distance
        self.hold = samples - ramps
        self._rest = distance * self._den - samples * peak
        if self.phase == 4:
            self._left = self.hold - held
        return True

    def stop(self) -> None:
        """Stop smoothly: decelerate as the mirror image of the acceleration so far (PMD-TRJ-10).

        :attr:`distance` becomes the resting place. In phases 5 to 7 the move just goes on.
        """
        if self.done or self.phase > 4:
            return
        if self.phase == 0:
            self.distance = 0
            self.done = True
            return
        # PMD-TRJ-10: what has been run of phase 1, or of 2, is what is mirrored.
        if self.phase == 1:
            self.rise -= self._left
            self.flat = 0
        elif self.phase == 2:
            self.flat -= self._left
        self.hold = self.hold - self._left if self.phase == 4 else 0
        if self.phase != 3:
            self._left = 0
        self._stopping = True
        self._rest = 0
        self._peak = self.rise * (self.rise + self.flat)
        total = self._num * self._peak * (2 * self.rise + self.flat + self.hold)
        self.distance = total // self._den
        self._end_part = total - self.distance * self._den

    @property
    def deceleration_distance(self) -> int:
        """Way from the beginning of phase 5 to the end, cut down (MCP R39-R3B).

        Without the one sample that a changed end may need (MCP-SCV-3).
        """
        return self._num * self._peak * max(0, 2 * self.rise + self.flat - 2) // (2 * self._den)

    def _samples(self, phase: int) -> int:
        if phase == 4:
            return self.hold
        return self.flat if phase == 2 or phase == 6 else self.rise
