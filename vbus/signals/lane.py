"""What a number that a part tells of itself means to people, and how exactly it is told."""

from dataclasses import dataclass


@dataclass(frozen=True, slots=True)
class LaneRow:
    """A number told by ``telemetry()``, as people draw it over time.

    Attributes:
        name: short, the same for the same thing of every part: ``"real"``.
        title: for people: ``"real position"``.
        unit: ``"counts"``; "" for a fraction of full scale.
        key: its name in the telemetry, ``{}`` for the number of the axis.
        scale: the step it is told in, in that unit.
        register: the register that reads the same, if there is one.
    """

    name: str
    title: str
    unit: str
    key: str
    scale: float = 1.0
    register: str = ""


def nearest(steps: float) -> int:
    """Return the whole number of steps nearest to a value; halfway lies the one farther from 0."""
    return int(steps + 0.5) if steps >= 0.0 else -int(0.5 - steps)
