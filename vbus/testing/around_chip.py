"""What is around a chip: the client of its family, and the mechanics behind it."""

from typing import Any

from vbus import plugins
from vbus.board.board import Board
from vbus.chips.base import Chip
from vbus.chips.family import Family
from vbus.client.aio.access import Packets, RegisterCycles, calls_of
from vbus.client.blocking import blocking
from vbus.client.bus import Bus
from vbus.signals import Plant


def host_of(chip: Chip, bus: Bus) -> Any:
    """Return the client of a chip's family over a bus, the calls of its tables, or None."""
    family = plugins.family_of(chip.part)
    client = family.object("host")
    if client is not None:
        return blocking(client)(bus, chip.name)
    calls = table_calls(family)
    return None if calls is None else blocking(calls)(bus.chip(chip.name))


def table_calls(family: Family) -> Any:
    """Return the class of the calls made from a family's tables, for asyncio; None without any."""
    if family.tables is None or not (family.commands or family.registers):
        return None
    base = family.object("access") or (RegisterCycles if family.registers else Packets)
    return calls_of("Calls", base, family.tables)


def plants_of(board: Board, chip: Chip) -> tuple[Plant, ...]:
    """Return the mechanics behind a chip, axis by axis."""
    return tuple(plant for axis, plant in board.axes.items() if axis.startswith(f"{chip.name}."))
