"""The MC1241A example, run as its README says: board and host are processes of their own."""

from pathlib import Path

import pytest

from tests.examples.boards import RunningBoard, compile_c, expected, run


@pytest.fixture(scope="module")
def axes(tmp_path_factory: pytest.TempPathFactory) -> Path:
    program = tmp_path_factory.mktemp("mc1241a_isa_c") / "axes"
    folder = "mc1241a_isa_c"
    return compile_c(program, f"{folder}/main.c", f"{folder}/mc1241a_driver.c", shim="linux-io")


@pytest.mark.slow
@pytest.mark.parametrize("turn", [1, 2])
def test_two_axes_behind_the_isa_card_do_the_same_on_every_run(
    axes: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, turn: int
) -> None:
    with RunningBoard("mc1241a_isa_c", tmp_path) as board:
        monkeypatch.setenv("VBUS_LINK", f"pty:{board.link('mc1241a_isa_c')}")
        assert run(axes) == expected("mc1241a_isa_c")
