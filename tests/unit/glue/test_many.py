"""What a board file costs grows with its parts and not with their square."""

import sys
from collections.abc import Callable
from types import FrameType
from typing import Any

import pytest

from vbus.board.build import load_board_text
from vbus.core.values.settings import MOST_LISTED, listed

CHIP = '[chips.x]\npart = "LM629N-8"\nclock = "8 MHz"\nplant = "none"\n'


def equations(count: int) -> str:
    """Return a board on which equations follow one another."""
    lines = [f'o{n} = "o{n - 1} & !A1"' for n in range(1, count)]
    return "\n".join((
        CHIP, "[glue.pal]", 'part = "PLD"', 'delay = "10 ns"', 'hosts = ["A1", "A2"]',
        "[glue.pal.equations]", 'o0 = "A1 & A2"', *lines, f'"x./CS" = "o{count - 1}"',
    ))  # fmt: skip


def registers(count: int) -> str:
    """Return a board with a card of so many registers."""
    rows = [
        f'[cards.c.registers.r{n}]\nat = {2 + n % 250}\nkind = "fixed"\nvalues = "01"'
        for n in range(count)
    ]
    return "\n".join((
        CHIP, "[cards.c]", 'bus = "ISA"', "base = 0x300", "stride = 1", "size = 256",
        "[cards.c.selects]", '"x./CS" = ["0-1"]', "[cards.c.pins]", 'A0 = "x./PS"',
        '"/IOR" = "x./RD"', '"/IOW" = "x./WR"', '"D0-D7" = "x.D0-D7"', *rows,
    ))  # fmt: skip


def lines_run(text: str) -> int:
    """Return how many lines of Python the building of a board takes."""
    count = 0

    def trace(frame: FrameType, event: str, argument: Any) -> Callable[..., Any]:
        nonlocal count
        count += 1
        return trace

    before = sys.gettrace()
    sys.settrace(trace)
    try:
        load_board_text(text)
    finally:
        sys.settrace(before)
    return count


@pytest.mark.parametrize("board", [equations, registers])
def test_four_times_as_many_cost_four_times_as_much(board: Callable[[int], str]) -> None:
    load_board_text(board(2))  # what is imported once
    few, many = lines_run(board(50)), lines_run(board(200))
    assert many < 5 * few


def test_a_message_lists_a_screen_of_names() -> None:
    names = [f"n{n}" for n in range(MOST_LISTED + 5)]
    assert listed(names[:MOST_LISTED]) == ", ".join(names[:MOST_LISTED])
    assert listed(names) == ", ".join(names[:MOST_LISTED]) + " and 5 more"
