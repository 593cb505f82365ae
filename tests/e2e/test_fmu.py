"""``vbus fmu``: the unit that it makes, in FMPy."""

import os
import subprocess
import sys
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


POISON = """
#include <malloc.h>
#include <stddef.h>

/* What C++ has freed reads as the last hold on an object; letting go of that is a crash. */
void _ZdlPv(void *freed)
{
    for (size_t word = 0; freed && word < malloc_usable_size(freed) / 8; word++)
        ((long *)freed)[word] = 0x100000001;
}

void _ZdlPvm(void *freed, size_t size)
{
    _ZdlPv(freed);
}
"""
TWO = """
import sys
import fmpy

blocks = []
for step, unit in zip((1e-3, 1e-6), sys.argv[1:], strict=True):
    about = fmpy.read_model_description(unit)
    block = fmpy.instantiate_fmu(fmpy.extract(unit), about, "CoSimulation")
    block.enterInitializationMode()
    block.exitInitializationMode()
    block.doStep(0, step)
    blocks.append(block)
for block in blocks:
    block.terminate()
    block.freeInstance()
print("end")
"""


def test_two_units_in_one_process_are_two_boards_and_end_it_in_order(tmp_path: Path) -> None:
    (tmp_path / "poison.c").write_text(POISON)
    (tmp_path / "two.py").write_text(TWO)
    poison, board = tmp_path / "poison.so", tmp_path / "board.toml"
    build = ["gcc", "-shared", "-fPIC", "-o", poison, tmp_path / "poison.c"]
    subprocess.run(build, check=True, timeout=60)
    board.write_text(AXIS.format(time="slaved", model="dc_motor"))
    units = [tmp_path / "coarse.fmu", tmp_path / "fine.fmu"]
    for unit, step in zip(units, ("1 ms", "1 us"), strict=True):
        assert vbus("fmu", board, "-o", unit, "--step", step).returncode == 0
    done = subprocess.run(
        [sys.executable, tmp_path / "two.py", *units], check=False, capture_output=True, text=True,
        timeout=60, env={**os.environ, "LD_PRELOAD": str(poison)},
    )  # fmt: skip
    assert (done.returncode, done.stdout) == (0, "end\n"), done.stderr


def test_what_cannot_be_a_unit_is_refused(tmp_path: Path) -> None:
    board = tmp_path / "board.toml"
    board.write_text(AXIS.format(time="slaved", model="dc_moter"))
    done: subprocess.CompletedProcess[str] = vbus("fmu", board, "-o", tmp_path / "board.fmu")
    assert done.returncode == 3
    assert "did you mean" in done.stderr
    assert vbus("fmu", board, "-o", tmp_path / "board.zip").returncode == 2
