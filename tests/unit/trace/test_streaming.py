"""Long journals: decoded as they are read, in memory that does not grow with them."""

import gc
import os
import pty
import subprocess
import sys
import tracemalloc
from collections.abc import Iterator
from contextlib import suppress
from pathlib import Path

import pytest

from tests.e2e.command import ROOT
from tests.unit.trace.conftest import LM629, lm629_command
from vbus.board.build import load_board_text
from vbus.board.checks import all_rules
from vbus.board.host_bus import HostBus
from vbus.tools import journal_lines
from vbus.tools.journal_lines import bar, decoded, opened
from vbus.trace.journal import Journal
from vbus.trace.journal_view import play
from vbus.trace.replay import Replay
from vbus.trace.report import Report


def asking(port: HostBus, cycles: int) -> None:
    """Ask for positions without end; a careless one that sometimes does not wait."""
    counters = port.board.counters
    while counters["reads"] + counters["writes"] < cycles:
        lm629_command(port, 0x0A)
        for _ in range(2):
            while port.read(0) & 1:
                pass
            port.read(1)
            port.read(1)
        port.write(0, 0x02)
        port.write(0, 0x02)


def recorded(path: Path, cycles: int) -> Path:
    board = load_board_text(LM629)
    with path.open("wb", buffering=0) as file:
        journal = Journal(board, file, LM629)
        port = board.open_port("h")
        asking(port, cycles)
        port.close()
        journal.close()
    return path


@pytest.fixture(scope="module")
def journals(tmp_path_factory: pytest.TempPathFactory) -> tuple[Path, Path]:
    folder = tmp_path_factory.mktemp("long")
    return recorded(folder / "short.vbj", 12_000), recorded(folder / "long.vbj", 48_000)


def peak(run: Iterator[object]) -> tuple[int, int]:
    """Return the most memory (bytes) that running to the end takes, and the number of steps."""
    gc.collect()
    tracemalloc.start()
    try:
        steps = sum(1 for _ in run)
        return tracemalloc.get_traced_memory()[1], steps
    finally:
        tracemalloc.stop()


def lines(path: Path) -> Iterator[object]:
    yield from decoded(path, 0, None)


def report(path: Path) -> Iterator[object]:
    with opened(path) as (reader, _):
        found = Report("bench", reader.header.families, all_rules())
        play(reader, found)
        yield found
        assert found.cycles > 11_000
        assert found.left_out() > 100


def replay(path: Path) -> Iterator[object]:
    with opened(path) as (reader, _):
        outcome = Replay(load_board_text(LM629), reader, reader.header.families).run()
        assert outcome.divergence is None
        yield outcome


@pytest.mark.slow
@pytest.mark.parametrize("work", [lines, report, replay])
def test_four_times_the_journal_takes_no_more_memory(
    journals: tuple[Path, Path], work: object
) -> None:
    short, long = (peak(work(path)) for path in journals)  # type: ignore[operator]
    assert long[0] < 1.3 * short[0] + 100_000
    if work is lines:
        assert long[1] > 3.9 * short[1]


def test_recording_keeps_nothing_either(tmp_path: Path) -> None:
    def run(cycles: int) -> Iterator[object]:
        yield recorded(tmp_path / f"{cycles}.vbj", cycles)

    assert peak(run(20_000))[0] < 1.3 * peak(run(5_000))[0] + 100_000


# -- the bar ------------------------------------------------------------------------------------


def shown(*arguments: str | Path) -> str:
    """Run ``vbus`` with a terminal for its errors and a file for its output."""
    leader, follower = pty.openpty()
    process = subprocess.Popen(
        [sys.executable, "-m", "vbus", *map(str, arguments)], cwd=ROOT, stdout=subprocess.DEVNULL,
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
    monkeypatch.setattr(journal_lines.sys.stderr, "isatty", lambda: True)
    with bar("working", 10, lambda: 5, True) as move:
        move()
    assert capfd.readouterr() == ("", "")
