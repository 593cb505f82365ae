"""The demonstrations as a table: board, host, and what a watcher is shown."""

from collections.abc import Callable
from dataclasses import dataclass
from typing import Final

from vbus.chips.tables import Bit


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
        flags: telemetry keys of status words, and the names of their bits.
        explain: tells a bus cycle (write, address, data) in the manual's words.
        rest: encoder count at which each motor must stand in the end.
        tolerance: how far from it is near enough.
    """

    title: str
    board: str
    chip: str
    gauges: tuple[Gauge, ...]
    flags: Callable[[], dict[str, tuple[Bit, ...]]]
    explain: Callable[[bool, int, int], str]
    rest: tuple[int, ...]
    tolerance: int = 2


_LM629: Final = """\
[chips.x]
part = "LM629N-8"
clock = "8 MHz"
plant = "motor"

[plants.motor]
model = "dc_motor"
encoder_lines = 500
"""


def _lm629_flags() -> dict[str, tuple[Bit, ...]]:
    from vbus.chips.lm628.datasheet import STATUS

    return {"status": STATUS}


def _lm629_cycle(write: bool, address: int, data: int) -> str:
    from vbus.chips.lm628.datasheet import COMMAND_PORT, COMMANDS

    if address != COMMAND_PORT:
        return f"data   {'<-' if write else '->'} {data:02X}h"
    if not write:
        return f"status -> {data:02X}h"
    row = COMMANDS.by_code(data)
    return f"{row.name}: {row.title}" if row is not None else f"undefined command {data:02X}h"


DEMOS: Final[dict[str, Demo]] = {
    "lm629": Demo(
        title="LM629 and a brushed DC motor",
        board=_LM629,
        chip="x",
        gauges=(
            Gauge("desired position (counts)", "desired", 15_000, 1),
            Gauge("real position (counts)", "real", 15_000),
            Gauge("position error (counts)", "error", 20),
            Gauge("velocity (counts/sample)", "velocity", 8, 3),
            Gauge("PWM (of full scale)", "output", 1.0, 3),
        ),
        flags=_lm629_flags,
        explain=_lm629_cycle,
        rest=(0,),
    ),
}
"""Demonstrations by name; the first is the default."""
