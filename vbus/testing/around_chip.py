"""What is around a chip: the client of its family, and the mechanics behind it."""

from typing import Any

from vbus import plugins
from vbus.board.board import Board
from vbus.chips.base import Chip
from vbus.client.bus import Bus
from vbus.signals import Plant


def host_of(chip: Chip, bus: Bus) -> Any:
    """Return the client of a chip's family over a bus, the calls of its tables, or None."""
    family = plugins.family_of(chip.part)
    client, calls = family.object("host"), family.object("calls")
    return client(bus, chip.name) if client else calls(bus.chip(chip.name)) if calls else None


def plants_of(board: Board, chip: Chip) -> tuple[Plant, ...]:
    """Return the mechanics behind a chip, axis by axis."""
    return tuple(plant for axis, plant in board.axes.items() if axis.startswith(f"{chip.name}."))
