"""One chip, ready to use: its mechanics, its host and its clock."""

from dataclasses import dataclass
from typing import Any

from vbus import plugins
from vbus.board.board import Board
from vbus.chips.base import Chip
from vbus.client.bus import Bus
from vbus.errors import VbusError
from vbus.signals import Plant
from vbus.testing.around_chip import host_of, plants_of
from vbus.testing.bench import Bench
from vbus.testing.boards import typical_part
from vbus.testing.clock import BoardClock
from vbus.testing.in_process import connect_in_process


@dataclass(frozen=True, slots=True, repr=False)
class ChipBench:
    """A chip on a test's board.

    Attributes:
        board: the board.
        chip: the chip.
        plants: the mechanics behind it, axis by axis.
        bus: a client's bus, as :func:`vbus.connect` returns it.
        host: the family's client over that bus, or the calls made from its tables; None if it
            has neither.
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


def chip_bench(bench: Bench, start: str) -> ChipBench:
    """Return the first chip of a family on the test's board, out of its reset.

    Args:
        bench: the test's boards; a test without one gets one with a part of the family.
        start: how a part number of the family begins.

    Raises:
        VbusError: the test's board has no such chip.
    """
    family = plugins.family_of(start)
    part = typical_part(family, start)
    tested = bench.main(part)
    if tested.served is not None:
        raise VbusError(
            f"the board is served on {tested.address}, by vbus_pty: attach to that terminal, and"
            " take vbus_board to look at chips and plants"
        )
    board = tested.board
    cls = plugins.chip_of(family)
    kin = [chip for chip in board.chips if isinstance(chip, cls)]
    chip = next((chip for chip in kin if chip.part.startswith(start)), kin[0] if kin else None)
    if chip is None:
        have = ", ".join(f"{chip.name} = {chip.part}" for chip in board.chips)
        raise VbusError(
            f'board "{board.name}" has no {part} or kin; it has {have}. A test that names no board'
            " gets one with the chips of all fixtures among its arguments"
        )
    board.run_until(max(board.now, chip.ready_at() + bench.variant.start))
    bus = connect_in_process(board, chips=(chip.name,) if bench.of_chips else ())
    plants = plants_of(board, chip)
    return ChipBench(board, chip, plants, bus, host_of(chip, bus), tested.clock)
