"""The orders that keep an axis to a path, by the manual's rule of how it obeys them."""

from collections.abc import Sequence

_RATE_MAX = 0x3FFFFFFF


def lm629_after(
    position: int, velocity: int, goal: int, acceleration: int, samples: int
) -> tuple[int, int]:
    """Return what an LM629 makes of a new velocity (LM-TRJ-13).

    Args:
        position: desired position when it counts (1/65536 counts).
        velocity: desired velocity then (1/65536 counts/sample).
        goal: the new velocity.
        acceleration: of the chip (1/65536 counts/sample/sample).
        samples: how long it lasts.

    Returns:
        Position and velocity at its end.
    """
    sign = 1 if goal > velocity else -1
    ramp = min(abs(goal - velocity) // acceleration, samples)
    moved = ramp * velocity + sign * acceleration * ramp * (ramp + 1) // 2
    if ramp == samples:
        return position + moved, velocity + sign * acceleration * samples
    return position + moved + (samples - ramp) * goal, goal


def lm629_velocities(aims: Sequence[float], acceleration: int, samples: int) -> list[int]:
    """Return the velocities that bring an LM629 to a path at the end of each; the last one is 0.

    Args:
        aims: where it is to be then (counts).
        acceleration: of the chip (1/65536 counts/sample/sample).
        samples: how long each lasts.
    """
    goals = []
    position = velocity = 0
    for number, aim in enumerate(aims, 1):
        low, high = -_RATE_MAX, _RATE_MAX
        while high - low > 1:
            middle = (low + high) // 2
            if lm629_after(position, velocity, middle, acceleration, samples)[0] > round(
                aim * 65536
            ):
                high = middle
            else:
                low = middle
        if number == len(aims):
            low = 0
        position, velocity = lm629_after(position, velocity, low, acceleration, samples)
        goals.append(low)
    return goals


def mc1241a_accelerations(aims: Sequence[float], cycles: int) -> list[int]:
    """Return the accelerations that keep an MC1241A in velocity contouring to a path (PMD-TRJ-6).

    The chip adds the acceleration to its velocity each cycle, and that to its position. To be at
    each point exactly it would have to swing; instead, in each order it gets to the speed that in
    two of them would bring it to the point after the next.

    Args:
        aims: where it is to be at the end of each (microsteps).
        cycles: how long each lasts.
    """
    pushes = []
    position = velocity = 0
    for aim in (*aims[1:], aims[-1]):
        speed = (aim * 65536 - position) / (2 * cycles)
        push = round((speed - velocity) / cycles)
        position += cycles * velocity + push * cycles * (cycles + 1) // 2
        velocity += cycles * push
        pushes.append(push)
    return pushes
