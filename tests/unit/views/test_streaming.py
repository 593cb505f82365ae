"""Long journals: decoded as they are read, in memory that does not grow with them."""

import json
import os
import pty
import subprocess
import sys
from contextlib import suppress
from pathlib import Path

import pytest

import vbus
from tests.e2e.command import ROOT
from tests.unit.views.memory import recorded
from vbus.cli import output
from vbus.cli.output import bar

HOME = Path(next(iter(vbus.__path__))).parent


@pytest.fixture(scope="module")
def journals(tmp_path_factory: pytest.TempPathFactory) -> tuple[Path, Path]:
    folder = tmp_path_factory.mktemp("long")
    return recorded(folder / "short.vbj", 12_000), recorded(folder / "long.vbj", 48_000)


def peaks(work: str, *amounts: object) -> list[list[int]]:
    """Return the most memory (bytes) and the steps of each amount of work."""
    # In a process of its own: what other tests left behind would be measured as well.
    return json.loads(  # type: ignore[no-any-return]
        subprocess.check_output(
            [sys.executable, "-m", "tests.unit.views.memory", work, *map(str, amounts)],
            cwd=HOME, env={**os.environ, "PYTHONPATH": f"{HOME}:{ROOT}"}, timeout=300,
        )
    )  # fmt: skip


@pytest.mark.slow
@pytest.mark.parametrize("work", ["lines", "report", "replay"])
def test_four_times_the_journal_takes_no_more_memory(
    journals: tuple[Path, Path], work: str
) -> None:
    short, long = peaks(work, *journals)
    assert long[0] < 1.3 * short[0] + 100_000
    if work == "lines":
        assert long[1] > 3.9 * short[1]


def test_recording_keeps_nothing_either() -> None:
    short, long = peaks("record", 10_000, 40_000)
    assert long[0] < 1.3 * short[0] + 100_000


# -- the bar ------------------------------------------------------------------------------------


def shown(*arguments: str | Path) -> str:
    """Run ``vbus`` with a terminal for its errors and a file for its output."""
    leader, follower = pty.openpty()
    process = subprocess.Popen(
        [sys.executable, "-m", "vbus", *map(str, arguments)], cwd=HOME, stdout=subprocess.DEVNULL,
        stderr=follower, env={**os.environ, "TERM": "xterm", "COLUMNS": "80"},
    )  # fmt: skip
    os.close(follower)
    text = b""
    with suppress(OSError):  # the other side of the terminal has been closed
        while data := os.read(leader, 4096):
            text += data
    os.close(leader)
    assert process.wait(timeout=60) == 0
    return text.decode()


@pytest.mark.slow
def test_a_terminal_gets_a_bar_on_standard_error_unless_it_wants_none(
    journals: tuple[Path, Path],
) -> None:
    journal = journals[0]
    commands: list[tuple[str, list[str | Path]]] = [
        ("decoding", ["explain", journal]),
        ("reading", ["report", journal, "--fail-on", "never"]),
        ("replaying", ["replay", journal]),
    ]
    for word, arguments in commands:
        assert word in shown(*arguments)
    assert shown(*commands[1][1], "--no-progress") == ""


def test_a_bar_is_moved_to_its_place_and_only_on_a_terminal(
    monkeypatch: pytest.MonkeyPatch, capfd: pytest.CaptureFixture[str]
) -> None:
    with bar("working", 10, lambda: 5, False) as move:
        move()
    assert capfd.readouterr() == ("", "")
    monkeypatch.setattr(output.sys.stderr, "isatty", lambda: True)
    with bar("working", 10, lambda: 5, True) as move:
        move()
    assert capfd.readouterr() == ("", "")
