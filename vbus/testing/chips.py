"""One chip, ready to use: its mechanics, its host and its clock."""

from dataclasses import dataclass
from importlib import import_module
from typing import Any, Final

from vbus.board.board import Board
from vbus.chips.base import Chip
from vbus.client.bus import Bus
from vbus.errors import VbusError
from vbus.signals import Plant
from vbus.testing.bench import Bench
from vbus.testing.clock import BoardClock
from vbus.testing.in_process import connect_in_process

_CLIENTS: Final = {"lm628": "Lm628", "mc1241a": "Mc1241a", "mcp1200": "Mcp1200"}


@dataclass(frozen=True, slots=True, repr=False)
class ChipBench:
    """A chip on a test's board.

    Attributes:
        board: the board.
        chip: the chip.
        plants: the mechanics behind it, axis by axis.
        bus: a client's bus, as :func:`vbus.connect` returns it.
        host: the chip's commands over that bus: an ``Lm628``, ``Mc1241a`` or ``Mcp1200``.
        clock: chip time.
    """

    board: Board
    chip: Chip
    plants: tuple[Plant, ...]
    bus: Bus
    host: Any
    clock: BoardClock

    def __repr__(self) -> str:
        return f'<{self.chip.part} {self.chip.name} on board "{self.board.name}">'

    @property
    def plant(self) -> Plant:
        """The mechanics of the first axis."""
        return self.plants[0]


def chip_bench(bench: Bench, family: str, part: str) -> ChipBench:
    """Return the first chip of ``family`` on the test's board, out of its reset.

    A test without a board of its own gets one with ``part``.

    Raises:
        VbusError: the test's board has no such chip.
    """
    fitted = bench.main(part)
    if fitted.served is not None:
        raise VbusError(
            f"the board is served on {fitted.address}, by vbus_pty: attach to that terminal, and"
            " take vbus_board to look at chips and plants"
        )
    board = fitted.board
    chip = next((chip for chip in board.chips if family == chip.FAMILY), None)
    if chip is None:
        have = ", ".join(f"{chip.name} = {chip.part}" for chip in board.chips)
        raise VbusError(f'board "{board.name}" has no {part} or kin; it has {have}')
    board.run_until(max(board.now, chip.ready_at()))
    bus = connect_in_process(board)
    client = getattr(import_module(f"vbus.client.{family}"), _CLIENTS[family])
    plants = tuple(plant for axis, plant in board.axes.items() if axis.startswith(f"{chip.name}."))
    return ChipBench(board, chip, plants, bus, client(bus, chip.name), fitted.clock)
