"""What a demonstration is made of, and how its host tells what it does: a JSON object a line.

``{"step": ...}`` when it begins something, ``{"done": ...}`` with what it expected and what it
found. Judging is the business of who runs it.
"""

import json
from collections.abc import Callable, Mapping
from dataclasses import dataclass

from vbus.client.bus import Bus


@dataclass(frozen=True, slots=True)
class Demo:
    """One demonstration.

    Attributes:
        title: one line for people.
        board: the board file; its name and its link are set by the caller.
        chip: the chip that is shown.
        shown: keys of the values that are shown, each with that of a full bar in either direction;
            0: without a bar. Values with bits are shown as lamps.
        host: what the host does, in a process of its own.
        rest: encoder count at which each motor must stand in the end.
        tolerance: how far from it is near enough.
    """

    title: str
    board: str
    chip: str
    shown: Mapping[str, float]
    host: Callable[[Bus], None]
    rest: tuple[int, ...]
    tolerance: int = 2


def tell(**what: object) -> None:
    """Print one line for the demonstration."""
    print(json.dumps(what), flush=True)


class Step:
    """One thing the host does, from its announcement to its result.

    Args:
        bus: gives chip time.
        title: what it is, for people.
    """

    def __init__(self, bus: Bus, title: str) -> None:
        self._bus: Bus = bus
        self._title: str = title
        self._began: int = bus.now()
        tell(step=title)

    def found(
        self, what: str, expected: int, found: int, tolerance: int = 0, digits: int = 0
    ) -> None:
        """Tell a result.

        Args:
            what: name of the number.
            expected: what the manual or the move prescribes.
            found: what was read from the chip.
            tolerance: how far apart they may be.
            digits: hexadecimal digits to show it with; 0 for decimal.
        """
        seconds = (self._bus.now() - self._began) * 1e-12
        tell(
            done=self._title, what=what, expected=expected, found=found, tolerance=tolerance,
            digits=digits, seconds=round(seconds, 6),
        )  # fmt: skip
