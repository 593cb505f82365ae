"""Where in a capture the comparison with a model begins: both must be in the same state there."""

from collections.abc import Iterable
from dataclasses import dataclass
from typing import Final

from vbus.errors import CaptureError
from vbus.protocols.quantities import format_instant
from vbus.trace.bus_watch import WATCHES
from vbus.trace.capture import Sample
from vbus.trace.channel_map import Wiring
from vbus.trace.packets import Cycle

AUTO: Final = "auto"
RESET: Final = "reset"

RESET_PINS: Final = {"lm628": "/RST", "mc1241a": "~Reset", "mcp1200": "/RESET"}
RESET_WRITES: Final = {"lm628": (0, 0x00), "mc1241a": (1, 0x39), "mcp1200": (0x05, 0x00)}
"""Address and byte of the command, or register write, that resets the chip."""


@dataclass(frozen=True, slots=True)
class Start:
    """Where to begin.

    Attributes:
        sample: number of the first sample that is driven into the model; the one before it, or the
            first of all, gives the levels the model begins with.
        skipped: bus cycles before it.
        why: a clause for people: ``"from the RESET command at 12us"``.
        reset: whether a reset of the capture comes first.
    """

    sample: int
    skipped: int
    why: str
    reset: bool


def find_start(samples: Iterable[Sample], wiring: Wiring, family: str, wish: str | int) -> Start:
    """Return where to begin.

    Args:
        samples: the capture.
        wiring: its channels.
        family: of the chip.
        wish: ``"reset"``: the first hardware reset or reset command; ``"start"``: the beginning,
            where the chip is taken to have just been reset; ``"auto"``: the first reset if there
            is one, else the beginning; or an instant (ps), where the same is taken.

    Raises:
        CaptureError: there is no such place.
    """
    watch = WATCHES[family]()
    pin = RESET_PINS[family]
    held = 1
    cycles = 0
    begin = -1
    """First sample before which the bus is idle, from the instant wished on."""
    skipped = 0
    after_last = 0
    idle = False
    resets = wish in (AUTO, RESET)
    known = pin in wiring.bits or pin in wiring.tied
    number = -1
    for number, (when, value) in enumerate(samples):
        levels = tuple([wiring.level(name, value) for name in watch.PINS])
        if begin < 0 and (idle or number == 0) and (isinstance(wish, str) or when >= wish):
            idle_here = idle or watch.idle(levels)
            if idle_here:
                begin, skipped = number, cycles
                if not resets:
                    break
        if resets and known and not wiring.level(pin, value) and held:
            return Start(number, cycles, f"from the hardware reset at {format_instant(when)}", True)
        held = wiring.level(pin, value) if known else 1
        found = watch.change(when, levels, wiring.byte(value))
        for cycle in found:
            if resets and cycle.write and (cycle.address, cycle.data) == RESET_WRITES[family]:
                return Start(after_last, cycles, f"from {_reset_name(family, cycle)}", True)
            cycles += 1
        if found:
            after_last = number + 1
        idle = watch.idle(levels)
    if wish == RESET:
        raise CaptureError(
            "there is no reset in the capture: neither its pin nor its command."
            " With --from start, or an instant, the chip is taken to be as after a reset there"
        )
    if begin < 0:
        raise CaptureError("the bus is never idle from there on: nothing can be compared")
    where = "its beginning" if isinstance(wish, str) else format_instant(wish)
    return Start(begin, skipped, f"from {where}, where the chip is taken to be as after a reset",
                 False)  # fmt: skip


def _reset_name(family: str, cycle: Cycle) -> str:
    name = "soft reset" if family == "mcp1200" else "RESET command"
    return f"the {name} at {format_instant(cycle.when)}"
