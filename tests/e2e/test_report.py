"""Reports of served boards: at the end of the run, and from its journal."""

import json
from pathlib import Path

import pytest

from tests.boards import BENCH
from tests.e2e.command import running, vbus
from vbus import connect

BOARD = (
    BENCH
    + """\
[record]
journal = "{folder}/run.vbj"
report = "{folder}/run.txt"
"""
)
ACCEPT = '[[suppress]]\nrule = "lm628.busy-write"\nreason = "known"\n'


@pytest.fixture
def folder(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    monkeypatch.setenv("VBUS_RUNTIME", str(tmp_path / "run"))
    (tmp_path / "bench.toml").write_text(BOARD.format(folder=tmp_path))
    (tmp_path / "accept.toml").write_text(ACCEPT)
    return tmp_path


def serve(folder: Path, *options: str | Path) -> None:
    with running(folder / "bench.toml", *options), connect(f"unix:{folder}/run/x") as bus:
        bus.chip("x").write(0, 0x02)
        bus.chip("x").write(0, 0x02)
        bus.now()


def test_a_report_is_written_when_the_board_stops(folder: Path) -> None:
    serve(folder)
    live = (folder / "run.txt").read_text()
    assert live.startswith("error: lm628.busy-write [LM-BUS-10]: x at ")
    done = vbus("report", folder / "run.vbj")
    assert done.returncode == 1
    assert done.stdout.startswith(live)
    assert done.stdout.removeprefix(
        live
    ) == "axis x: ended at 0 counts, did not move, it has no" + (
        " filter: all coefficients are 0 until LFIL and UDF\n"
    )


def test_the_command_line_stands_above_the_board_file(folder: Path) -> None:
    serve(folder, "--report", folder / "run.sarif", "--suppress", folder / "accept.toml")
    assert not (folder / "run.txt").exists()
    (run,) = json.loads((folder / "run.sarif").read_text())["runs"]
    assert run["results"][0]["suppressions"][0]["justification"] == "known"


@pytest.mark.parametrize(
    ("options", "code"),
    [
        ([], 1),
        (["--fail-on", "never"], 0),
        (["--suppress", "{folder}/accept.toml"], 0),
    ],
)
def test_the_exit_code_says_whether_something_is_not_accepted(
    folder: Path, options: list[str], code: int
) -> None:
    serve(folder)
    options = [option.format(folder=folder) for option in options]
    assert vbus("report", folder / "run.vbj", *options).returncode == code


@pytest.mark.parametrize(
    ("options", "code", "message"),
    [
        (["--report", "{folder}/run.doc"], 2, "run.doc: a report's name ends in .txt"),
        (["--suppress", "{folder}/none.toml"], 1, "none.toml: cannot be read: No such file"),
    ],
)
def test_a_report_that_cannot_be_made_stops_the_start(
    folder: Path, options: list[str], code: int, message: str
) -> None:
    done = vbus("run", folder / "bench.toml", *(o.format(folder=folder) for o in options))
    assert done.returncode == code
    assert message in done.stderr
