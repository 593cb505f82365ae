"""One sample of a velocity ramp, or of a trapezoidal move that lands exactly on its target.

By a ramp LM-TRJ-13, MCP-VEL-1 and PMD-TRJ-6 run at a velocity, and every chip stops smoothly (goal
0). A move follows the rule of MCP-TRP-2 and PMD-TRJ-2. Distances and velocities are integers in
units of 2^-f counts (f fraction bits of the chip), velocities per sample, accelerations per sample
squared. Before each sample of a move the generator knows how far it has to go and how fast it is;
it takes the largest velocity that the acceleration, the top velocity and the stopping distance
allow. Because that is decided anew in every sample, target and top velocity may change at any time.

With a *start velocity* (PMD START_VEL) a move begins and ends at that velocity instead of at 0.

The square root of ``8 * accel * remaining`` (to 2^80) is never needed here: whether a velocity can
still be stopped from is a question about one product, and where the stopping distance decides, the
answer lies within one acceleration of the present velocity. With velocity, top, accel and start
below 2^31 and the distance up to 2^61 every number in here fits 63 bits and a sign, so a compiled
build keeps them in machine words.
"""

from mypy_extensions import i64


def toward(velocity: i64, goal: i64, accel: i64, start: i64 = 0) -> i64:
    """Return the velocity of the coming sample.

    Args:
        velocity: velocity of the last sample, signed.
        goal: velocity to reach, signed.
        accel: largest change (0 or more); 0 leaves the velocity as it is.
        start: start velocity (0 or more). From rest the first sample runs at it (or at the goal,
            if that is slower); on the way to 0 or through 0, what would be slower than it becomes
            0 and the axis rests for one sample.
    """
    # MCP-VEL-4, PMD-TRJ-6: no acceleration is no change.
    if accel == 0:
        return velocity
    if start > 0:
        # PMD-TRJ-6: from rest at the start velocity, and not above the goal.
        if velocity == 0:
            if goal > 0:
                return start if start < goal else goal
            return -start if -start > goal else goal
        # PMD-TRJ-6, PMD-TRJ-10: slower than the start velocity is 0, for one cycle at a reversal.
        if velocity > 0 and goal <= 0:
            slower = velocity - accel
            return 0 if slower < start else slower
        if velocity < 0 and goal >= 0:
            slower = velocity + accel
            return 0 if slower > -start else slower
    if velocity < goal:
        velocity += accel
        return velocity if velocity < goal else goal
    velocity -= accel
    return velocity if velocity > goal else goal


def next_velocity(remaining: i64, velocity: i64, top: i64, accel: i64, start: i64 = 0) -> i64:
    """Return the velocity of the coming sample.

    Add it to the position; then ask :func:`arrived` whether the move is over.

    Args:
        remaining: target minus position before the sample, signed, not wrapped.
        velocity: velocity of the last sample, signed.
        top: largest velocity of the move (0 or more). Being faster is no error: the velocity
            falls by ``accel`` per sample until it fits.
        accel: largest change of velocity (0 or more); 0 leaves the velocity as it is.
        start: start velocity (0 or more); 0 for chips that have none.
    """
    if accel == 0:
        return velocity
    # On the target, but too fast to stay, both views of it come to the same.
    if remaining >= 0:
        return _approach(remaining, velocity, top, accel, start)
    return -_approach(-remaining, -velocity, top, accel, start)


def arrived(remaining: i64, velocity: i64, accel: i64, start: i64 = 0) -> bool:
    """Whether a move is over after a sample: on the target, and slow enough to be still next.

    Args:
        remaining: target minus position after the sample.
        velocity: velocity of that sample.
        accel: as in :func:`next_velocity`.
        start: as in :func:`next_velocity`.
    """
    return remaining == 0 and -accel - start <= velocity <= accel + start


def stopping_distance(velocity: i64, accel: i64) -> i64:
    """Return the way covered from the coming sample on, if it has ``velocity``, until rest.

    Each further sample is slower by ``accel``. ``velocity`` must not be negative and ``accel``
    not 0.
    """
    n = velocity // accel
    return (n + 1) * velocity - accel * (n * (n + 1) // 2)


def _approach(r: i64, u: i64, top: i64, accel: i64, start: i64) -> i64:
    """Step with the target ahead: ``r`` to go, ``u`` the velocity toward it (maybe negative)."""
    if u < 0:
        speed = u + accel
        # PMD-TRJ-2: moving away, the axis rests for one sample before it turns.
        if start > 0:
            return 0 if speed > -start else speed
        if speed <= 0:
            return speed
        if speed > top:
            speed = top
        # Slower than one acceleration: one more sample is all the stopping there is.
        return speed if speed < r else r

    # PMD-TRJ-2: from rest at the start velocity.
    speed = start if u == 0 and start > 0 else u + accel
    # PMD-ERR-4: a start velocity above the top velocity gives the top velocity.
    if speed > top:
        speed = top
    slowest = u - accel
    # PMD-TRJ-2: below the start velocity there is 0 alone.
    if slowest < start:
        slowest = 0
    if speed <= start:
        if speed > r:
            speed = r
        return speed if speed > slowest else slowest
    # As in stopping_distance(), with the sum at hand for what follows.
    n = (speed - start) // accel
    slowing = accel * (n * (n + 1) // 2)
    if (n + 1) * speed - slowing <= r:
        return speed if speed > slowest else slowest
    # Too fast. Two steps of ``n`` reach down to ``slowest``: below it nothing matters.
    least = n - 2
    while (n + 1) * start + slowing > r:
        if n == least:
            return slowest
        if n == 0:
            break
        slowing -= accel * n
        n -= 1
    speed = (r + slowing) // (n + 1)
    if start > 0:
        # One more step would need the next sample's start velocity too.
        ceiling = start + (n + 1) * accel - 1
        if speed > ceiling:
            speed = ceiling
    return speed if speed > slowest else slowest
