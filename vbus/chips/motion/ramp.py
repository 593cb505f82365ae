"""One sample of a velocity ramp: toward a goal by at most one acceleration.

What LM-TRJ-13, MCP-VEL-1 and PMD-TRJ-6 do while they run at a velocity, and what every chip does
when it stops smoothly (goal 0).
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
    if accel == 0:
        return velocity
    if start > 0:
        if velocity == 0:
            if goal > 0:
                return start if start < goal else goal
            return -start if -start > goal else goal
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
