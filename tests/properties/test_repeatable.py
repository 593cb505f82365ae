"""The same inputs give the same bytes: in this process, in another, with any hash seed."""

import importlib
import os
import subprocess
import sys
from pathlib import Path
from random import Random

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from vbus.board.board import Board
from vbus.board.build import load_board_text
from vbus.core.kernel import MS, US

ROOT = Path(__file__).parents[2]

BOARD = """
[board]
name = "repeatable"
time = "lockstep"
seed = 7

[chips.x]
part = "LM629N-8"
clock = "8 MHz"
plant = "mx"
busy_jitter_clk = 40

[chips.y]
part = "LM629N-6"
clock = "6 MHz"
plant = "my"
busy_jitter_clk = 40

[chips.m]
part = "MCP-1200"
clock = "20 MHz"
plant = "mm"

[chips.p]
part = "MC1241A"
clock = "25 MHz"
plants = ["p1", "p2"]

[plants.mx]
model = "dc_motor"
[plants.my]
model = "dc_motor"
[plants.mm]
model = "dc_motor"
[plants.p1]
model = "stepper"
[plants.p2]
model = "stepper"

[buses.lm]
chips = ["x", "y"]

[nets]
alarm = ["x.HI", "m.INDEX"]
"""


def both_lm629(port: object, code: int, *words: int) -> None:
    """Give both LM629 one command in the same strobes."""
    wait = port.wait  # type: ignore[attr-defined]
    write = port.write  # type: ignore[attr-defined]
    wait(10 * MS)
    write(0, code)
    for word in words:
        wait(10 * MS)
        write(1, word >> 8)
        write(1, word & 0xFF)


def play(looks: int = -1) -> tuple[str, tuple[int, ...], str, str]:
    """Drive all chips of a board; return replies, encoder counts, trace hash and state hash.

    With ``looks`` (a seed; 0: none) there is no trace, and somebody looks at the board now and
    then.
    """
    board: Board = load_board_text(BOARD)
    if looks < 0:
        board.start_trace()
    stream = Random(looks)
    port = board.open_port("host", ["x", "y", "m", "p"])
    replies = []
    port.select(0b0011)
    port.wait(10 * MS)
    both_lm629(port, 0x1D, 0)
    both_lm629(port, 0x1E, 0x000A, 200, 1000)
    both_lm629(port, 0x04)
    both_lm629(port, 0x1F, 0x002A, 0, 40, 3, 0, 0, 3000)
    both_lm629(port, 0x01)
    port.select(0b1000)
    for code, *words in ((0x77, 24000), (0x10, 0, 20000), (0x11, 20, 0), (0x12, 0, 9000), (0x1A,)):
        port.wait(10 * MS)
        port.write(1, code)
        for word in words:
            port.wait(10 * MS)
            port.write(0, word >> 8)
            port.write(0, word & 0xFF)
    for step in range(400):
        port.select(1 << step % 4)
        replies.append(port.read((0, 0, 0x14, 1)[step % 4]))
        if looks > 0 and stream.random() < 0.3:
            end = board.now + step * 60 * US
            board.run_until(stream.randint(board.now, end))
            board.catch_up()
            board.run_until(end)
        else:
            port.delay(step * 60 * US)
    board.catch_up()
    counts = tuple(plant.count for plant in board.plants)
    trace = board.trace_hash() if looks < 0 else ""
    return bytes(replies).hex(), counts, trace, board.state_hash()


def test_being_looked_at_changes_nothing_not_even_the_state() -> None:
    unseen = play(0)
    for seed in (1, 2, 3):
        assert play(seed) == unseen


def test_two_runs_in_one_process_are_the_same() -> None:
    first = play()

    assert first == play()
    assert abs(first[1][0] - 3000) < 20
    assert abs(first[1][1] - 3000) < 20
    assert first[1][3] > 0, "the stepper has moved too"


def test_runs_with_different_hash_seeds_are_the_same() -> None:
    expected = repr(play())
    for seed in ("0", "1", "4711"):
        other = subprocess.run(
            [sys.executable, "-c", "from tests.properties.test_repeatable import *; print(play())"],
            cwd=ROOT,
            env={**os.environ, "PYTHONHASHSEED": seed},
            capture_output=True,
            text=True,
            check=True,
        )
        assert other.stdout.strip() == expected


def test_examples_are_the_same_whichever_tests_came_before(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Modules that other tests have imported are no reason to draw what stands in them."""
    seen: list[int] = []

    @settings(max_examples=300)
    @given(st.integers())
    def draw(number: int) -> None:
        seen.append(number)

    draw()
    before, seen[:] = list(seen), ()
    monkeypatch.syspath_prepend(tmp_path)
    (tmp_path / "imported_before.py").write_text(f"NUMBERS = {[n * 99_991 for n in range(300)]}")
    importlib.import_module("imported_before")
    draw()
    assert seen == before
