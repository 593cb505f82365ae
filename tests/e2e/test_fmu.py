"""``vbus fmu``: the unit that it makes, in FMPy."""

import subprocess
from pathlib import Path

import pytest

from tests.boards import AXIS
from tests.e2e.command import vbus
from tests.unit.board.test_block import LFIL, MOVE
from vbus.board.build import load_board_text

fmpy = pytest.importorskip("fmpy")
pytest.importorskip("pythonfmu3")


def test_a_board_runs_in_fmpy_as_it_does_by_itself(tmp_path: Path) -> None:
    from fmpy.validation import validate_fmu

    board, unit = tmp_path / "board.toml", tmp_path / "board.fmu"
    board.write_text(AXIS.format(time="slaved", model="dc_motor"))
    done = vbus("fmu", board, "-o", unit)
    assert done.returncode == 0, done.stderr
    assert done.stdout == f"{unit}: 14 variables; steps are multiples of 1e-06 s\n"
    assert validate_fmu(str(unit)) == []

    about = fmpy.read_model_description(str(unit))
    at = {one.name: one.valueReference for one in about.modelVariables}
    said: list[str] = []
    block = fmpy.instantiate_fmu(
        fmpy.extract(str(unit), tmp_path / "unit"), about, "CoSimulation",
        logger=lambda *about: said.append(about[-1].decode()),
    )  # fmt: skip
    block.enterInitializationMode()
    block.exitInitializationMode()
    native = load_board_text(board.read_text())
    native.start_trace()
    port = native.open_port("h")
    now, names = 0.0, [at["x.strobe"], at["x.address"], at["x.data"]]
    for address, byte in [*LFIL, *MOVE]:
        block.setInt32(names, [2, address, byte])
        block.doStep(now, 1e-4)
        now += 1e-4
        port.at(round(now * 1e7) * 10**5)
        port.write(address, byte)
    block.setInt32(names, [0, 0, 0])
    for _ in range(100):
        block.doStep(now, 1e-3)
        now += 1e-3
    native.run_until(round(now * 1e7) * 10**5)
    assert block.getString([at["trace_hash"]]) == [native.trace_hash()]
    assert block.getInt64([at["x.1.counts"]]) == [native.axes["x.1"].count]
    assert native.axes["x.1"].count > 300
    with pytest.raises(Exception, match="fmi3DoStep failed"):  # of FMPy
        block.doStep(now - 1e-3, 1e-3)
    assert "neither back nor over time" in said[-1]
    block.terminate()
    block.freeInstance()


def test_what_cannot_be_a_unit_is_refused(tmp_path: Path) -> None:
    board = tmp_path / "board.toml"
    board.write_text(AXIS.format(time="slaved", model="dc_moter"))
    done: subprocess.CompletedProcess[str] = vbus("fmu", board, "-o", tmp_path / "board.fmu")
    assert done.returncode == 3
    assert "did you mean" in done.stderr
    assert vbus("fmu", board, "-o", tmp_path / "board.zip").returncode == 2
