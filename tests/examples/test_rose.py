"""Six axes on three nodes, one of which is killed: one command, and nothing has changed."""

import os
import re
import signal
import sys
from pathlib import Path

import pytest

from tests.e2e.pages import blocks_of
from tests.e2e.test_scope import seen_by_a_page
from tests.examples.boards import EXAMPLES, expected
from tests.examples.test_multi_axis import PATIENCE, demo_of, played, started
from vbus.core.kernel import MS

NAME = "rose_six_axes"


def test_a_node_is_killed_and_rejoins_and_the_rose_is_the_same(tmp_path: Path) -> None:
    typed = blocks_of((EXAMPLES / NAME / "README.md").read_text())
    assert [block.text for block in typed] == ["python demo.py\n"]  # and two options more
    with started(NAME, tmp_path, "--svg=rose.svg", "--scope") as process:
        assert process.stderr is not None
        told = process.stderr.readline()
        page = re.match(r"scope: (http://127\.0\.0\.1:\d+/#\S+) +\(process (\d+)\)$", told)
        assert page is not None, told
        try:
            end = demo_of(NAME).score().end
            seen = seen_by_a_page(page[1], lambda seen: seen.now >= end)
            process.wait(PATIENCE)
        finally:  # the page stays when the run has ended
            os.kill(int(page[2]), signal.SIGTERM)
        out, errors = process.communicate(timeout=PATIENCE)

    assert process.returncode == 0, out + errors
    printed, _, told = out.partition("trace hash: ")
    assert printed == expected(NAME).replace(f"{NAME}.svg", "rose.svg")
    assert (tmp_path / "rose.svg").exists()
    # Each line is from a process of its own.
    said = r"node red (was killed at (?:[7-9]\d\d|1\d{3}) ms|has died or was cut off|is back)"
    assert sorted(line[:3] for line in re.findall(said, errors)) == ["has", "is ", "was"], errors
    nodes = [mark["text"] for _, mark in seen.rows["nodes"]]
    assert any(text.startswith("red is back at ") for text in nodes)
    for axis in ("blue_x", "red_y", "green_x"):
        assert seen.rows[f"{axis}.real"][-1][0] > 1_500 * MS, axis
    digest, same = told.splitlines()
    assert same == "in one process, with nobody killed: the same"
    assert digest == played(NAME, demo_of(NAME).score())[1]


def test_a_run_that_the_accident_has_changed_is_told(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    demo = demo_of(NAME)
    accident = sys.modules["multi_axis.accident"]
    for name in ("one", "other"):
        (tmp_path / name).write_text(f"1 0 w {name} 0 0\n")
    monkeypatch.setattr(accident._Run, "_in_one_process", lambda self: tmp_path / "one")
    monkeypatch.setattr(
        accident._Run, "_with_the_accident", lambda self, scope: [tmp_path / "other"]
    )
    made = accident.Accident(
        NAME, Path(demo.__file__).parent, "", demo.score, lambda cycles: ([], None), "red", 0
    )
    monkeypatch.setattr(accident, "plotted", lambda picture, file: "no plot")
    monkeypatch.setattr(sys, "argv", ["demo.py"])
    with pytest.raises(SystemExit) as ended:
        accident.main(made)
    assert ended.value.code == 1
    out, errors = capsys.readouterr()
    assert "the same" not in out
    assert "in one process, with nobody killed, the hash is " in errors
