"""Journals of served boards: written, killed, played again."""

import json
import os
import resource
import signal
import socket
from pathlib import Path

import pytest

from tests.e2e.command import running, start, vbus
from tests.waiting import until
from vbus import connect
from vbus.client.lm628 import Lm628
from vbus.record.format import Entry, JournalReader

BOARD = """\
[board]
name = "bench"
time = "{time}"
[chips.x]
part = "LM629N-8"
clock = "8 MHz"
plant = "m"
[plants.m]
model = "dc_motor"
[[hosts]]
transport = "pty:$VBUS_RUNTIME/x"
[record]
journal = "{folder}/file.vbj"
"""


@pytest.fixture(autouse=True)
def runtime(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("VBUS_RUNTIME", str(tmp_path / "run"))


def drive(folder: Path) -> None:
    with connect(f"pty:{folder}/run/x") as bus:
        axis = Lm628(bus)
        axis.check_reset()
        axis.load_filter(kp=300, kd=2000)
        axis.move(400, acc=40, vel=2 << 16)


def operations(journal: Path) -> set[str]:
    """Return what the entries say that a file has so far."""
    with journal.open("rb") as file:
        return {entry.op for entry in JournalReader(file)}


def served(folder: Path, time_policy: str, end: int, *options: str) -> Path:
    """Serve a board to a host, end it with a signal, and return the board file."""
    file = folder / "board.toml"
    file.write_text(BOARD.format(time=time_policy, folder=folder))
    process = start("run", file, *options)
    assert process.stdout is not None
    while not process.stdout.readline().startswith("ready"):
        pass
    drive(folder)
    if end == signal.SIGKILL:
        # An entry waits for company at most a fifth of a second: the last is the host's departure.
        until(
            lambda: "close" in operations(Path(options[-1])), "the end of the host in the journal"
        )
    os.kill(process.pid, end)
    process.communicate(timeout=60)
    return file


@pytest.mark.slow
@pytest.mark.parametrize("policy", ["realtime", "lockstep"])
def test_a_run_plays_again_without_a_difference(tmp_path: Path, policy: str) -> None:
    served(tmp_path, policy, signal.SIGINT)
    done = vbus("replay", tmp_path / "file.vbj")
    assert (done.returncode, done.stderr) == (0, "")
    assert done.stdout.startswith("no difference in ")
    assert "not closed" not in done.stdout


@pytest.mark.slow
def test_what_a_killed_board_had_written_plays_again(tmp_path: Path) -> None:
    served(tmp_path, "realtime", signal.SIGKILL, "--journal", str(tmp_path / "own.vbj"))
    assert not (tmp_path / "file.vbj").exists()
    done = vbus("replay", "--json", tmp_path / "own.vbj")
    assert done.returncode == 0
    outcome = json.loads(done.stdout)
    assert outcome["cycles"] > 50
    assert outcome["ended"] is False


@pytest.mark.slow
def test_a_replay_on_another_board_shows_the_first_difference(tmp_path: Path) -> None:
    file = served(tmp_path, "lockstep", signal.SIGINT)
    slow = tmp_path / "slow.toml"
    slow.write_text(file.read_text().replace("8 MHz", "6 MHz").replace("N-8", "N-6"))
    done = vbus("replay", tmp_path / "file.vbj", "--board", slow)
    assert done.returncode == 1
    first, recorded, now = done.stdout.splitlines()
    assert ": reply differs: host0, x: read 0  [LM-CMD-23]" in first
    assert recorded == "  recorded: 84H in RDSTAT 84H MOTOR_OFF TRAJECTORY_COMPLETE"
    assert now == "  now:      85H in RDSTAT 85H MOTOR_OFF TRAJECTORY_COMPLETE BUSY"


@pytest.mark.slow
def test_a_journal_is_explained_as_packets_or_as_entries(tmp_path: Path) -> None:
    served(tmp_path, "lockstep", signal.SIGINT)
    lines = vbus("explain", tmp_path / "file.vbj").stdout.splitlines()
    assert f'file.vbj: board "bench" of {tmp_path}/board.toml (SHA-256 ' in lines[0]
    assert lines[0].endswith("format 1")
    assert any(" x LFIL kp=300 kd=2000 ds=1 samples  [LM-CMD-19]" in line for line in lines)
    assert any(" x LTRJ pos=+400" in line for line in lines)
    entries = vbus("explain", f"{tmp_path}/file.vbj:0-2").stdout.splitlines()
    assert entries[0] == "0: 0us host0 x open host0 ['x'] 0"
    assert vbus("explain", f"{tmp_path}/file.vbj:99999999").stderr.startswith(
        "vbus: the journal has no entry 99999999; its last one is "
    )


def test_a_journal_that_cannot_be_written_stops_the_start(tmp_path: Path) -> None:
    file = tmp_path / "board.toml"
    file.write_text(BOARD.format(time="lockstep", folder=tmp_path / "missing"))
    done = vbus("run", file)
    assert done.returncode == 1
    assert done.stderr == (
        f"vbus: {tmp_path}/missing/file.vbj: cannot be written: No such file or directory; there is"
        f" no folder {tmp_path}/missing: make it first\n"
    )


def test_what_is_no_journal_is_refused(tmp_path: Path) -> None:
    other = tmp_path / "other.vbj"
    other.write_bytes(b"something else")
    done = vbus("replay", other)
    assert done.returncode == 1
    assert done.stderr.startswith(f"vbus: {other} is no journal of version 1: it looks like")
    refused = "cannot be read: No such file or directory; check its name\n"
    assert vbus("replay", tmp_path / "none").stderr.endswith(refused)


def answered_and_killed(folder: Path, *options: str) -> tuple[int, list[Entry]]:
    """Kill a board while a host reads; return the answers it got, and the journal's reads."""
    file = folder / "board.toml"
    file.write_text(BOARD.format(time="lockstep", folder=folder))
    process = start("run", file, *options)
    assert process.stdout is not None
    while not process.stdout.readline().startswith("ready"):
        pass
    with connect(f"pty:{folder}/run/x") as bus:
        for _ in range(25):
            bus.read(0)
        process.kill()
        process.communicate(timeout=60)
    with (folder / "file.vbj").open("rb") as journal:
        return 25, [entry for entry in JournalReader(journal) if entry.op == "read"]


@pytest.mark.parametrize("durable", ["process", "machine"])
def test_a_durable_journal_has_all_that_was_answered(tmp_path: Path, durable: str) -> None:
    answered, reads = answered_and_killed(tmp_path, "--durable", durable)
    assert len(reads) == answered


def test_what_a_journal_may_lose_is_said_when_the_board_is_ready(tmp_path: Path) -> None:
    file = tmp_path / "board.toml"
    file.write_text(BOARD.format(time="lockstep", folder=tmp_path))
    for options, said in (
        ((), "of a process that is killed, the last 0.2 s may be missing"),
        (("--durable", "process"), "has all that was answered, also if the process is killed"),
        (("--durable", "machine"), "has all that was answered, also if the machine fails"),
    ):
        with running(file, *options) as (_, lines):
            assert f"  journal {tmp_path}/file.vbj: {said}" in lines
            (listed,) = json.loads(vbus("ls", "--json").stdout)
            assert listed["journal"]["file"] == f"{tmp_path}/file.vbj"


def test_durable_without_a_journal_is_refused(tmp_path: Path) -> None:
    file = tmp_path / "board.toml"
    text = BOARD.format(time="lockstep", folder=tmp_path)
    file.write_text(text.replace(f'journal = "{tmp_path}/file.vbj"', 'durable = "process"'))
    for done in (vbus("run", file), vbus("check", file)):
        assert done.returncode != 0
        assert "durable is what a journal survives, and none is written" in done.stderr


def test_what_a_durable_journal_cannot_hold_is_not_answered(tmp_path: Path) -> None:
    file = tmp_path / "board.toml"
    text = BOARD.format(time="lockstep", folder=tmp_path)
    file.write_text(text.replace("pty:$VBUS_RUNTIME/x", "unix:$VBUS_RUNTIME/x"))
    journal = tmp_path / "short.vbj"
    process = start("run", file, "--journal", journal, "--durable", "process")
    assert process.stdout is not None
    while not process.stdout.readline().startswith("ready"):
        pass
    size = journal.stat().st_size
    resource.prlimit(process.pid, resource.RLIMIT_FSIZE, (size, size))
    with socket.socket(socket.AF_UNIX) as host:
        host.settimeout(60)
        host.connect(f"{tmp_path}/run/x")
        host.sendall(b"\x02\x01")
        assert host.recv(10) == b""
    process.terminate()
    _, told = process.communicate(timeout=60)
    why = f"{journal}: the journal ends after {size} bytes: File too large\n"
    assert told == f"vbus: {why}vbus: not all is recorded: {why}"
    assert process.returncode == 1


def test_a_journal_on_a_full_disk_stops_the_start(tmp_path: Path) -> None:
    file = tmp_path / "board.toml"
    file.write_text(BOARD.format(time="lockstep", folder=tmp_path))
    done = vbus("run", file, "--journal", "/dev/full")
    why = "/dev/full: the journal ends after 0 bytes: No space left on device"
    assert (done.returncode, done.stderr) == (1, f"vbus: {why}\n")
