"""What is around a chip: the client of its family, and the mechanics behind it."""

from dataclasses import dataclass
from typing import Any, Self

from vbus import plugins
from vbus.board.board import Board
from vbus.boardfile.sections import BoardFile
from vbus.chips.base import Chip
from vbus.chips.family import Family
from vbus.client.aio.access import Packets, RegisterCycles, calls_of
from vbus.client.blocking import blocking
from vbus.client.bus import Bus
from vbus.core.signals import Plant
from vbus.testing.clock import BoardClock


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


def out_of_reset(chip: Chip, file: BoardFile) -> int:
    """Return when a chip is out of the reset that follows power-on (ps)."""
    clocks = plugins.family_of(chip.part).object("reset")
    if not clocks or file.board.power_on == "done":
        return chip.ready_at()
    return max(chip.ready_at(), chip.clock.span_up(int(clocks)))


@dataclass(frozen=True, slots=True, repr=False)
class ChipBench:
    """A chip on a test's board, or on a node of a test's machine.

    Attributes:
        board: the board.
        chip: the chip.
        plants: the mechanics behind it, axis by axis.
        bus: a client's bus, as :func:`vbus.connect` returns it.
        host: the family's client over that bus, or the calls made from its tables; None if it
            has neither.
        clock: chip time.
        node: name of its node; "" on a board without nodes.
    """

    board: Board
    chip: Chip
    plants: tuple[Plant, ...]
    bus: Bus
    host: Any
    clock: BoardClock
    node: str = ""

    @classmethod
    def of(cls, board: Board, chip: Chip, bus: Bus, clock: BoardClock, node: str = "") -> Self:
        """Return a chip with what is around it."""
        axes = board.axes.items()
        plants = tuple(plant for axis, plant in axes if axis.startswith(f"{chip.name}."))
        return cls(board, chip, plants, bus, host_of(chip, bus), clock, node)

    def __repr__(self) -> str:
        where = f'node "{self.node}"' if self.node else f'board "{self.board.name}"'
        return f"<{self.chip.part} {self.chip.name} on {where}>"

    @property
    def plant(self) -> Plant:
        """The mechanics of the first axis."""
        return self.plants[0]
