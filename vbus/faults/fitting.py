"""How a fault gets at what is inside a chip: its plant, its levels, its rest."""

from typing import Any, Final

from vbus.chips.base import Chip
from vbus.signals import Plant

STROBES: Final = {
    "lm628": ("/RD", "/WR"), "mc1241a": ("~HostRead", "~HostWrite"), "mcp1200": ("/CS", "/CS"),
}  # fmt: skip
"""The strobes that fall for a read and for a write cycle, by chip family."""
LIMITS: Final = {
    "mc1241a": {"limit+": "PosLimit{}", "limit-": "NegLimit{}"},
    "mcp1200": {"limit+": "/LIMIT", "limit-": "/LIMIT"},
}
"""The input a limit switch is wired to, by chip family; ``{}`` is the number of the axis."""


def exchange(chip: Chip, axis: int, old: Plant, new: Plant) -> None:
    """Put ``new`` where ``old`` was behind an axis (0-based): between two periods.

    A chip of another package has a method ``exchange_plant(axis, plant)`` for it.

    Raises:
        ValueError: it has none.
    """
    inside: Any = chip
    chip.advance()
    if chip.FAMILY == "lm628":
        inside.encoder.plant = new
    elif chip.FAMILY == "mcp1200":
        inside.works.encoder.plant = new
    elif chip.FAMILY == "mc1241a":
        inside.cycles.motors[axis] = new
        for each in inside.axes:
            if each.encoder._plant is old:
                each.encoder._plant = new
            if each.encoder._mechanics is old:
                each.encoder._mechanics = new
    elif hasattr(inside, "exchange_plant"):
        inside.exchange_plant(axis, new)
    else:
        raise ValueError(f"{chip.part}: this chip does not let its plant be exchanged")


def disturb(chip: Chip) -> None:
    """Tell a chip that something behind it is different now: rest is over."""
    inside: Any = chip
    if chip.FAMILY == "lm628":
        inside.touched()
    elif chip.FAMILY == "mcp1200":
        inside.works.rest.disturb()
        inside.side.look(inside.cycle_now())
        inside.changed()
    else:
        if chip.FAMILY == "mc1241a":
            for each in inside.axes:
                each.encoder._limit_moved()
        chip.rearm()


def filter_ps(chip: Chip, axis: int) -> int:
    """Return the shortest level at an encoder input that the chip believes (ps); 0 if unknown."""
    inside: Any = chip
    if chip.FAMILY == "lm628":
        return int(inside.encoder.inputs._a.dwell)
    if chip.FAMILY == "mc1241a":
        return int(inside.axes[axis].encoder._decoder._a.dwell)
    if chip.FAMILY == "mcp1200":
        return int(chip.clock.span_up(inside.encoder_pins.decoder._a.dwell))
    return 0
