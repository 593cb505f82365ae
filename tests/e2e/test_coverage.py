"""``vbus coverage``: of journals and of running boards."""

import json
from pathlib import Path

import pytest

from tests.boards import BENCH
from tests.e2e.command import running, vbus
from vbus import connect


@pytest.fixture
def folder(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    monkeypatch.setenv("VBUS_RUNTIME", str(tmp_path / "run"))
    (tmp_path / "bench.toml").write_text(BENCH)
    for name, code in (("a", 0x02), ("b", 0x04)):
        options = ("--journal", tmp_path / f"{name}.vbj", "--coverage", tmp_path / f"{name}.json")
        with running(tmp_path / "bench.toml", *options), connect(f"unix:{tmp_path}/run/x") as bus:
            bus.chip("x").write(0, code)
            bus.now()
    return tmp_path


def test_a_journal_and_the_running_board_give_the_same(folder: Path) -> None:
    done = vbus("coverage", folder / "a.vbj", "--format", "json")
    live = json.loads((folder / "a.json").read_text())
    later = json.loads(done.stdout)
    assert later["families"] == live["families"]
    assert live["families"]["lm628"]["groups"]["commands"]["DFH"] == 1


def test_runs_are_merged_compared_and_held_to_a_limit(folder: Path) -> None:
    text = vbus("coverage", folder / "a.vbj", folder / "b.json", "--all").stdout
    assert "commands: 2 of 23" in text
    assert "1 x DFH" in text
    assert "1 x UDF" in text
    assert "never LTRJ  Load Trajectory" in text
    assert "[LM-CMD-" in text

    lines = vbus("coverage", "--diff", folder / "a.vbj", folder / "b.json").stdout.splitlines()
    assert lines[0].startswith("+ lm628 commands: UDF")
    assert lines[1].startswith("- lm628 commands: DFH")

    low = vbus("coverage", folder / "a.vbj", "--fail-under", "50")
    assert (low.returncode, low.stderr) == (1, "vbus: 1.4% exercised, 50% wanted\n")


def test_pages_and_mistakes(folder: Path) -> None:
    page = folder / "page.html"
    assert vbus("coverage", folder / "a.vbj", "--format", "html", "--output", page).stdout == ""
    assert page.read_text().startswith("<!doctype html>")

    (folder / "other.txt").write_text("{ nothing")
    wrong = vbus("coverage", folder / "other.txt")
    assert wrong.returncode == 1
    assert "other.txt: neither a journal nor a coverage file" in wrong.stderr

    wrong = vbus("run", folder / "bench.toml", "--coverage", folder / "x.pdf")
    assert "x.pdf: a coverage file's name ends in one of .txt, .json, .html" in wrong.stderr
