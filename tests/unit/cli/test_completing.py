"""What a shell completes after ``vbus``."""

from collections.abc import Callable
from pathlib import Path

import click
import pytest
from click.shell_completion import ShellComplete

from vbus.cli.cli import cli
from vbus.serve.registry import boards_directory

Complete = Callable[[str], list[str]]


@pytest.fixture
def complete(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> Complete:
    """Completes a command line; the last word is what was begun."""
    monkeypatch.setenv("_VBUS_COMPLETE", "bash_complete")
    monkeypatch.setenv("VBUS_RUNTIME", str(tmp_path / "run"))
    monkeypatch.chdir(tmp_path)

    def completed(line: str) -> list[str]:
        *before, begun = line.split(" ")
        items = ShellComplete(cli, {}, "vbus", "_VBUS_COMPLETE").get_completions(before, begun)
        return [
            f"{item.type}:{item.value}" if item.type != "plain" else item.value for item in items
        ]

    return completed


def test_commands_and_options(complete: Complete) -> None:
    assert complete("re") == ["replay", "report"]
    assert complete("fault ") == ["arm", "clear", "list", "log"]
    assert complete("run --jo") == ["--journal"]


@pytest.mark.parametrize("line", ["monitor ", "ls ", "fault arm ", "fault log ", "snap save "])
def test_names_of_running_boards(complete: Complete, line: str) -> None:
    for name in ("bench", "bend", "second"):
        (boards_directory() / f"{name}.sock").touch()

    assert complete(line) == ["bench", "bend", "second"]
    assert complete(f"{line}ben") == ["bench", "bend"]


def test_faults_parts_and_demonstrations(complete: Complete) -> None:
    assert complete("fault arm bench ja") == ["jam"]
    assert complete("conform LM629N") == ["LM629N-6", "LM629N-8"]
    assert complete("demo mc") == ["mc1241a", "mcp1200"]


def test_journals_and_board_files(complete: Complete, tmp_path: Path) -> None:
    assert complete("replay ") == ["file:"]
    (tmp_path / "logs").mkdir()
    for name in ("a.vbj", "b.toml", "logs/c.vbj", "logs/d.txt"):
        (tmp_path / name).touch()

    assert complete("replay ") == complete("wave ") == ["a.vbj"]
    assert complete("explain logs/") == ["logs/c.vbj"]
    assert complete("replay x") == ["file:x"]
    assert complete("run ") == ["b.toml"]
    assert complete("run b.toml --journal ") == ["file:"]


def test_nothing_of_it_touches_a_command_that_runs(
    complete: Complete,
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    assert complete("replay ") == ["file:"]
    monkeypatch.delenv("_VBUS_COMPLETE")

    command = cli.get_command(click.Context(cli), "replay")

    assert command is not None
    assert isinstance(command.params[0].type, click.Path)
