"""The step of a lane: how exactly it shows a number of a part."""


def nearest(steps: float) -> int:
    """Return the whole number of steps nearest to a value; halfway lies the one farther from 0."""
    return int(steps + 0.5) if steps >= 0.0 else -int(0.5 - steps)
