"""What a demonstration is made of, and how its host tells what it does: a JSON object a line.

``{"step": ...}`` when it begins something, ``{"done": ...}`` with what it expected and what it
found. Judging is the business of who runs it.

``python -m vbus.client.demo NAME LINK`` is the host, which knows its link alone. The exit code
is 0 if all went through, whether or not the results are right.
"""

import json
import os
import sys
from collections.abc import Callable, Mapping
from dataclasses import dataclass

from vbus import plugins
from vbus.client import connect
from vbus.client.bus import Bus
from vbus.core.errors import VbusError


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


def demos() -> tuple[str, ...]:
    """Return the names of the demonstrations; the first is the default."""
    return tuple(family.demo_name for family in plugins.families() if family.demo)


def demo_of(name: str) -> Demo:
    """Return the demonstration called ``name``."""
    families = {family.demo_name: family for family in plugins.families() if family.demo}
    row: Demo = families[name].object("demo")
    return row


def main(name: str, link: str) -> int:
    """Do it; return the exit code."""
    try:
        with connect(link) as bus:
            chips = [f"{chip.name} ({chip.part})" for chip in bus.info.chips]
            tell(hello=link, pid=os.getpid(), chips=chips)
            demo_of(name).host(bus)
    except VbusError as error:
        tell(failed=str(error))
        return 1
    tell(end=True)
    return 0


if __name__ == "__main__":
    sys.exit(main(*sys.argv[1:3]))
