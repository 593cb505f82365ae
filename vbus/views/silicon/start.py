"""Where in a capture the comparison with a model begins: both must be in the same state there."""

from collections.abc import Iterable
from dataclasses import dataclass
from typing import Final

from vbus import plugins
from vbus.board.card.card_bus import CardBus
from vbus.chips.base import Chip
from vbus.chips.bus_watch import BusWatch, watch_by
from vbus.core.errors import CaptureError, VbusError
from vbus.protocols.quantities import format_instant
from vbus.views.silicon.capture import Sample
from vbus.views.silicon.card_watch import CardWatch
from vbus.views.silicon.channel_map import Wiring

AUTO: Final = "auto"
RESET: Final = "reset"


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


def watch_of(chip: Chip, wiring: Wiring | None = None) -> BusWatch:
    """Return a new follower of a chip's bus, or of that of a card.

    Args:
        chip: the chip, or the card's connector.
        wiring: channels of the capture, once they are known.

    Raises:
        VbusError: its family has none.
    """
    if isinstance(chip, CardBus):
        return CardWatch(chip, wiring)
    if chip.BUS is None:
        raise VbusError(f"{chip.part}: its bus is not known here, so no capture can be followed")
    return watch_by(chip.BUS)


def find_start(samples: Iterable[Sample], wiring: Wiring, chip: Chip, begin_at: str | int) -> Start:
    """Return where to begin.

    Args:
        samples: the capture.
        wiring: its channels.
        chip: the model.
        begin_at: ``"reset"``: the first hardware reset or reset command; ``"start"``: the
            beginning, where the chip is taken to have just been reset; ``"auto"``: the first reset
            if there is one, else the beginning; or an instant (ps), where the same is taken.

    Raises:
        CaptureError: there is no such place.
    """
    watch = watch_of(chip, wiring)
    family = plugins.family(chip.FAMILY)
    pin = family.reset_pin
    held = 1
    cycles = 0
    begin = -1
    """First sample before which the bus is idle, from the instant asked for on."""
    skipped = 0
    after_last = 0
    idle = False
    resets = begin_at in (AUTO, RESET)
    captured = pin in wiring.bits or pin in wiring.tied
    unknown = [name for name in watch.PINS if name in wiring.bits]
    """Control lines whose level has been unknown so far: the first one known is no edge."""
    number = -1
    floating = 0
    for number, (when, value) in enumerate(samples):
        if unknown:
            unknown = [name for name in unknown if wiring.unknown(name, value)]
            if unknown:
                continue
            after_last = number
            # The first levels that are known are no edge.
            idle = watch.idle(tuple([wiring.level(name, value) for name in watch.PINS]))
        levels = tuple([wiring.level(name, value) for name in watch.PINS])
        # Never in the midst of a cycle: half of one would be compared with nothing.
        if begin < 0 and idle and (isinstance(begin_at, str) or when >= begin_at):
            begin, skipped = number, cycles
            if not resets:
                break
        level = 1
        if captured and not wiring.unknown(pin, value):
            level = wiring.level(pin, value)
        if resets and held and not level:
            return Start(number, cycles, f"from the hardware reset at {format_instant(when)}", True)
        held = level
        found = watch.change(when, levels, wiring.byte(value))
        for cycle in found:
            if (
                resets
                and cycle.write
                and not floating
                and (cycle.address, cycle.data) == family.reset_write
            ):
                why = f"from the {family.reset_name} at {format_instant(cycle.when)}"
                return Start(after_last, cycles, why, True)
            cycles += 1
        floating = wiring.unknown_bits(value)
        if found:
            after_last = number + 1
        idle = watch.idle(levels)
    if unknown:
        raise CaptureError(f"the level of {', '.join(unknown)} is unknown (x or z) all along")
    # Asked for by name: the beginning would be another answer than was wanted.
    if begin_at == RESET:
        raise CaptureError(
            "there is no reset in the capture: neither its pin nor its command."
            " With --from start, or an instant, the chip is taken to be as after a reset there"
        )
    if begin < 0:
        raise CaptureError("the bus is never idle from there on: nothing can be compared")
    where = "its beginning" if isinstance(begin_at, str) else format_instant(begin_at)
    return Start(begin, skipped, f"from {where}, where the chip is taken to be as after a reset",
                 False)  # fmt: skip
