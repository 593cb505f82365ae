"""What all verbs of the command line have in common."""

import json
from collections.abc import Iterator
from pathlib import Path

import click
import pytest

from tests.e2e.command import vbus
from vbus.cli.cli import cli
from vbus.cli.run import doctor

NO_DATA = {"demo", "exec", "fmu", "logs", "plot", "router", "schema", "scope", "stop", "wait"}
"""Verbs that print what a program or a board says, one document, or have nothing to say."""


def verbs(group: click.Command = cli, path: str = "") -> Iterator[tuple[str, click.Command]]:
    assert isinstance(group, click.Group)
    context = click.Context(group)
    for name in group.list_commands(context):
        command = group.get_command(context, name)
        assert command is not None
        if isinstance(command, click.Group):
            yield from verbs(command, f"{path}{name} ")
        else:
            yield f"{path}{name}", command


VERBS = list(verbs())


@pytest.mark.parametrize(("name", "command"), VERBS, ids=[name for name, _ in VERBS])
def test_help_shows_no_mark_of_its_source(name: str, command: click.Command) -> None:
    text = command.get_help(click.Context(command, info_name=name))

    assert "\\b" not in text
    assert "\b" not in text


@pytest.mark.parametrize(("name", "command"), VERBS, ids=[name for name, _ in VERBS])
def test_a_verb_with_data_prints_json(name: str, command: click.Command) -> None:
    options = {option for parameter in command.params for option in parameter.opts}

    assert ("--json" in options) or name in NO_DATA


@pytest.mark.parametrize(
    "command",
    [
        "ls nobody", "stop nobody", "logs nobody", "wait nobody --timeout 0", "monitor nobody",
        "fault list nobody", "fault arm nobody jam", "fault clear nobody", "fault log nobody",
        "snap save nobody x.snap", "wave nobody -o x.vcd",
    ],
)  # fmt: skip
def test_a_board_that_does_not_run_is_one_exit_code(
    command: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(tmp_path)

    done = vbus(*command.split())

    assert (done.returncode, done.stdout) == (4, ""), done.stderr
    assert 'no board called "nobody"' in done.stderr


def test_the_hash_of_traces_as_json(tmp_path: Path) -> None:
    (tmp_path / "node.trace").write_text("1000 0 x./CS 0\n")
    plain = vbus("trace", tmp_path / "node.trace")
    told = json.loads(vbus("trace", tmp_path / "node.trace", "--json").stdout)

    assert plain.stdout == f"{told['hash']}  {told['events']} events\n"


def test_doctor_says_what_each_missing_tool_would_give(
    monkeypatch: pytest.MonkeyPatch, tmp_path: Path
) -> None:
    monkeypatch.setenv("PATH", str(tmp_path))
    monkeypatch.delenv("VBUS_AVR", raising=False)
    monkeypatch.setattr(doctor, "find_spec", lambda name: None)

    found = {finding.what: finding for finding in doctor.optional()}

    assert [finding.state for finding in found.values()] == ["warn"] * len(doctor.OPTIONAL)
    assert str(found["multilib"]) == (
        "warn  multilib: missing; it gives 32-bit programs (vbus exec, vbus cflags)\n"
        "      apt install gcc-multilib"
    )
    assert "AVR firmware as it is" in found["simavr"].detail
    assert found["pyvcd"].advice == "pip install pyvcd"


def test_doctor_names_what_is_there(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> None:
    (tmp_path / "sigrok-cli").write_text("")
    (tmp_path / "sigrok-cli").chmod(0o755)
    monkeypatch.setenv("PATH", str(tmp_path))
    monkeypatch.setenv("VBUS_AVR", "/opt/vbus-avr")

    found = {finding.what: finding for finding in doctor.optional()}

    assert found["sigrok-cli"].state == "ok"
    assert found["sigrok-cli"].detail.endswith(f": {tmp_path}/sigrok-cli")
    assert found["simavr"].detail.endswith(": /opt/vbus-avr")
    assert found["pytest"].state == "ok"


@pytest.mark.parametrize(("limit", "state"), [("128", "ok"), ("127", "warn")])
def test_doctor_warns_of_few_file_watches(
    monkeypatch: pytest.MonkeyPatch, tmp_path: Path, limit: str, state: str
) -> None:
    (tmp_path / "limit").write_text(f"{limit}\n")
    monkeypatch.setattr(doctor, "Path", lambda _: tmp_path / "limit")

    (finding,) = doctor.inotify()

    assert finding.state == state
    assert finding.detail.startswith(f"{limit}: ")
