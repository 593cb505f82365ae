"""The parts of glue as they will stand on the board, and which block comes before which."""

from collections.abc import Callable, Mapping
from graphlib import CycleError, TopologicalSorter
from itertools import pairwise

from msgspec import Struct

from vbus.boardfile.lines import Path
from vbus.chips.tables import PinRow
from vbus.core.values.settings import listed
from vbus.glue.part import bundled
from vbus.glue.table import Block

Fail = Callable[[Path, str], None]
Place = tuple[str, int]
"""A block: name of its part, and its number among the blocks that are used."""


class Planned(Struct, frozen=True):
    """A part of glue as it will stand on the board.

    Attributes:
        name: its name.
        delay: of its outputs (ps).
        pin_rows: its pins that are wired.
        blocks: those that are used.
        taps: inputs that are one wire of a bundle: the pin, and the number of the wire.
        tied: inputs with a fixed level.
        inner: wires inside it.
    """

    name: str
    delay: int
    pin_rows: tuple[PinRow, ...]
    blocks: tuple[Block, ...]
    taps: Mapping[str, tuple[str, int]]
    tied: Mapping[str, int]
    inner: tuple[PinRow, ...] = ()


def order_of(parts: list[Planned], root: Callable[[str], str], fail: Fail) -> list[Place]:
    """Return the blocks in an order in which none comes before one it follows.

    Args:
        parts: the parts.
        root: gives the name of the wire that a pin is on.
        fail: is called with a loop.
    """
    drivers: dict[str, list[Place]] = {}
    follows: dict[Place, tuple[str, ...]] = {}
    for part in parts:
        inside = {
            pin: row.name for row in part.pin_rows if row.width == 8
            for pin in bundled(row.name)
        }  # fmt: skip
        for number, block in enumerate(part.blocks):
            place = (part.name, number)
            ends = [
                part.taps[pin][0] if pin in part.taps
                else f"{part.name}.{inside.get(pin, pin)}"
                for pin in block.follows
            ]  # fmt: skip
            follows[place] = tuple(root(end) for end in ends)
            for pin in block.outputs:
                wire = root(f"{part.name}.{inside.get(pin, pin)}")
                drivers.setdefault(wire, []).append(place)
    graph = {
        place: {driver for wire in wires for driver in drivers.get(wire, ())}
        for place, wires in follows.items()
    }
    try:
        return list(TopologicalSorter(graph).static_order())
    except CycleError as error:
        ring: list[Place] = error.args[1][::-1]
        shown = " -> ".join(
            wire.removeprefix("=")
            for here, there in pairwise(ring)
            for wire in [_between(here, there, drivers, follows)]
        )
        fail(
            ("glue", ring[0][0]),
            f"a loop without a clock: {shown} -> and round again, through"
            f" {listed(dict.fromkeys(name for name, _ in ring))}; put a register into it, or"
            " take one wire out",
        )
        return []


def _between(
    here: Place,
    there: Place,
    drivers: Mapping[str, list[Place]],
    follows: Mapping[Place, tuple[str, ...]],
) -> str:
    return next(
        (wire for wire in follows[here] if there in drivers.get(wire, ())),
        next((wire for wire in follows[there] if here in drivers.get(wire, ())), ""),
    )
