"""One chip, ready to use: its mechanics, its host and its clock."""

from vbus import plugins
from vbus.core.errors import VbusError
from vbus.testing.bench import Bench
from vbus.testing.boards import typical_part
from vbus.testing.checks.around_chip import ChipBench
from vbus.testing.in_process import connect_in_process


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
    board.run_until(max(board.now, chip.ready_at() + bench.variant.world.ahead))
    bus = connect_in_process(board, chips=(chip.name,) if bench.of_chips else ())
    return ChipBench.of(board, chip, bus, tested.clock)
