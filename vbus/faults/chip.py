"""Faults of chips: switches that they already have, thrown while time runs."""

from typing import Any, Final

from vbus.chips.base import Chip
from vbus.kernel import NEVER
from vbus.options import Value

STUCK: Final = 10**15
"""Longer than any host waits (ps)."""


def begin(chip: Chip, name: str, values: dict[str, Value]) -> str:
    """Let a fault act on a chip; return what it changes."""
    inside: Any = chip
    chip.advance()
    text = ""
    if name == "power_on_c4":
        inside.axis._stuck_part = True
        text = "resets end with C4h"
    elif name == "reset_fails":
        text = _fail_resets(inside, int(values["times"]))
    elif name == "busy_longest" and chip.FAMILY == "lm628":
        inside.host._worst = True
        text = "each byte keeps it busy for 100 us"
    elif name == "busy_longest":
        inside.busy_stretch += int(values["extra"])
        text = f"each busy time is {values['extra']} ps longer"
    elif name == "ready_stuck":
        text = "HostRdy is low"
        inside.busy_stretch += STUCK
        if inside.port.busy_until <= chip.kernel.now:
            inside.port.busy_since = chip.kernel.now
        inside.port.busy_until = chip.kernel.now + STUCK
        inside.show_ready(False, chip.kernel.now)
    elif name == "supply_dip":
        chip.power_on(False)
        text = "the power-on reset runs"
    chip.rearm()
    chip.kernel.settle()
    return text


def end(chip: Chip, name: str, values: dict[str, Value]) -> None:
    """Let it act no more."""
    inside: Any = chip
    chip.advance()
    now = chip.kernel.now
    if name == "power_on_c4":
        inside.axis._stuck_part = inside.settings["reset_status"] == "C4"
    elif name == "busy_longest" and chip.FAMILY == "lm628":
        inside.host._worst = inside.settings["busy"] == "worst"
    elif name == "busy_longest":
        inside.busy_stretch -= int(values["extra"])
    elif name == "ready_stuck":
        inside.busy_stretch -= STUCK
        if inside.port.busy_until > now:
            inside.port.busy_until = now
            if inside.port.due() == NEVER:
                inside.show_ready(True, now)
    chip.rearm()
    chip.advance()
    chip.kernel.settle()


def restore(chip: Chip, name: str, acts: bool) -> None:
    """Throw a switch that is no part of the chip's own state, as a saved state has it."""
    inside: Any = chip
    if name == "power_on_c4":
        inside.axis._stuck_part = acts or inside.settings["reset_status"] == "C4"
    elif name == "busy_longest" and chip.FAMILY == "lm628":
        inside.host._worst = acts or inside.settings["busy"] == "worst"


def _fail_resets(inside: Any, times: int) -> str:
    """A reset that runs fails too: it is the first of them."""
    if inside._reset_end != NEVER:
        inside._reset_end = NEVER
        inside._mode = 1
        times -= 1
        inside.touched()
        inside._fails_left += times
        return f"this reset fails, and {times} more"
    inside._fails_left += times
    return f"the next {times} resets fail"
