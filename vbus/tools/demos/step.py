"""How a demonstration's host tells what it does: one JSON object on each line.

``{"step": ...}`` when it begins something, ``{"done": ...}`` with what it expected and what it
found. Judging is the demonstration's business.
"""

import json

from vbus.client import Bus


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
