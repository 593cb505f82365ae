"""What a demonstration is made of."""

from collections.abc import Callable, Mapping
from dataclasses import dataclass

from vbus.chips.tables import Bit
from vbus.client import Bus


@dataclass(frozen=True, slots=True)
class Gauge:
    """One value in the live view.

    Attributes:
        title: what it is called, with its unit.
        key: name in the chip's telemetry.
        full: value of a full bar in either direction; 0 for no bar.
        digits: digits behind the point.
    """

    title: str
    key: str
    full: float = 0.0
    digits: int = 0


@dataclass(frozen=True, slots=True)
class Demo:
    """One demonstration.

    Attributes:
        title: one line for people.
        board: the board file; its name and its link are set by whoever runs it.
        chip: the chip that is shown.
        gauges: values shown.
        flags: words in the chip's telemetry and the names of their bits.
        explain: tells a bus cycle (write, address, data) in the manual's words.
        host: what the host does, in a process of its own.
        rest: encoder count at which each motor must stand in the end.
        tolerance: how far from it is near enough.
    """

    title: str
    board: str
    chip: str
    gauges: tuple[Gauge, ...]
    flags: Mapping[str, tuple[Bit, ...]]
    explain: Callable[[bool, int, int], str]
    host: Callable[[Bus], None]
    rest: tuple[int, ...]
    tolerance: int = 2
