"""The LM629 examples, run as their READMEs say: board and host are processes of their own."""

import sys
from pathlib import Path

import pytest

from tests.examples.boards import EXAMPLES, RunningBoard, compile_c, expected, run


@pytest.fixture(scope="module")
def move(tmp_path_factory: pytest.TempPathFactory) -> Path:
    program = tmp_path_factory.mktemp("lm629_c") / "move"
    return compile_c(program, "lm629_c/main.c", "lm629_c/lm629_driver.c")


@pytest.mark.slow
def test_a_c_driver_moves_an_axis_in_real_time(move: Path, tmp_path: Path) -> None:
    with RunningBoard("lm629_c", tmp_path) as board:
        assert run(move, board.link("lm629_c")) == expected("lm629_c")


@pytest.mark.slow
def test_plain_pyserial_moves_an_axis_in_real_time(tmp_path: Path) -> None:
    host = EXAMPLES / "lm629_pyserial" / "host.py"
    with RunningBoard("lm629_pyserial", tmp_path) as board:
        printed = run(sys.executable, host, board.link("lm629_pyserial"))
    assert printed == expected("lm629_pyserial")


@pytest.mark.parametrize("turn", [1, 2])
def test_in_lockstep_every_byte_is_the_same_on_every_run(
    move: Path, tmp_path: Path, turn: int
) -> None:
    with RunningBoard("lm629_lockstep", tmp_path) as board:
        assert run(move, board.link("lm629_lockstep"), "-v") == expected("lm629_lockstep")
