"""The MCP-1200 example, run as its README says: board and host are processes of their own."""

from pathlib import Path

import pytest

from tests.examples.boards import RunningBoard, compile_c, expected, run


@pytest.fixture(scope="module")
def axis(tmp_path_factory: pytest.TempPathFactory) -> Path:
    program = tmp_path_factory.mktemp("mcp1200_c") / "axis"
    return compile_c(program, "mcp1200_c/main.c", "mcp1200_c/mcp1200_driver.c")


@pytest.mark.parametrize("turn", [1, 2])
def test_homing_profiles_and_pulses_are_the_same_on_every_run(
    axis: Path, tmp_path: Path, turn: int
) -> None:
    with RunningBoard("mcp1200_c", tmp_path) as board:
        assert run(axis, board.link("mcp1200_c")) == expected("mcp1200_c")
