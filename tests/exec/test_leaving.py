"""Programs under ``vbus exec`` that close descriptors, start other programs, or are ended."""

import signal
import subprocess
import sys
from collections.abc import Callable
from pathlib import Path

import pytest

from tests.exec.test_programs import PORTS, REGISTERS, SERVO, execute, running, said

Programs = Callable[[str, int], Path]
LOCKSTEP = REGISTERS.format(time="lockstep", card=PORTS)


@pytest.mark.parametrize("how", ["closefrom", "close_range", "dup2"])
def test_the_session_survives_a_program_that_takes_every_descriptor(
    programs: Programs, bits: int, tmp_path: Path, how: str
) -> None:
    done = execute(tmp_path, LOCKSTEP, programs("leaving", bits), "closes", how)
    assert said(done)[-1] == "42"


def test_a_daemon_goes_on_with_a_session_of_its_own(programs: Programs, tmp_path: Path) -> None:
    """Its board must outlive the process that was started: one that runs already."""
    with running(tmp_path, LOCKSTEP):
        done = subprocess.run(
            [sys.executable, "-m", "vbus", "exec", "--link", f"unix:{tmp_path}/x.sock", "--",
             str(programs("leaving", 64)), "closes", "daemon"],
            capture_output=True, text=True, timeout=30, check=False,
        )  # fmt: skip
    assert (done.returncode, done.stdout, done.stderr) == (0, "42\n", "")


@pytest.mark.parametrize(
    ("how", "lines"),
    [
        ("execv", ["still here 1", "21"]),
        ("execle", ["11"]),
        ("spawn", ["11", "12"]),
        ("system", ["11", "12"]),
        ("vfork", ["11", "12"]),
    ],
)
def test_what_another_program_does_comes_after_what_was_kept_back(
    programs: Programs, tmp_path: Path, how: str, lines: list[str]
) -> None:
    done = execute(tmp_path, LOCKSTEP, programs("leaving", 64), "starts", how)
    assert said(done) == lines


@pytest.mark.parametrize("number", [signal.SIGTERM, signal.SIGFPE, signal.SIGRTMIN])
def test_a_signal_that_ends_the_program_lets_its_last_writes_out(
    programs: Programs, tmp_path: Path, number: int
) -> None:
    transcript = tmp_path / "bus.txt"
    done = execute(
        tmp_path, LOCKSTEP, programs("leaving", 64), "dies", str(int(number)),
        options=("--transcript", transcript),
    )  # fmt: skip
    assert done.returncode == 128 + number
    assert done.stdout.splitlines() == ["default 1 1handler 1", "own 1", "default 1"]
    assert transcript.read_text().splitlines()[-1] == "x w 20 0E"


@pytest.mark.parametrize("time", ["lockstep", "realtime"])
def test_a_program_killed_in_the_middle_of_a_packet_leaves_the_bus_to_the_next(
    programs: Programs, tmp_path: Path, time: str
) -> None:
    """The chip still waits for a byte, as on a real card; the next program's reset ends that."""
    program, transcript = programs("leaving", 64), tmp_path / "bus.txt"
    board = SERVO.format(time=time, card="").replace(
        f'time = "{time}"', f'time = "{time}"\npower_on = "done"'
    )
    script = f"{program} cut; echo $?; exec {program} whole"
    done = execute(
        tmp_path, board, "bash", "-c", script, options=("--transcript", transcript)
    )  # fmt: skip
    assert done.returncode == 0, done.stderr
    lines = [line for line in transcript.read_text().splitlines() if line.startswith("x ")]
    assert [line[:5] for line in lines[:3]] == ["x w 0", "x w 1", "x r 0"]
    assert lines[:2] == ["x w 0 1E", "x w 1 12"]
    assert lines[3] == "x w 0 00"  # the next program's, after its look at the status
    assert done.stdout.splitlines()[0] == "137"
    assert done.stdout.splitlines()[-1] in ("84", "C4")


def test_waiting_for_a_reply_asks_the_kernel_for_no_clock(
    programs: Programs, bits: int, tmp_path: Path
) -> None:
    done = execute(
        tmp_path, REGISTERS.format(time="realtime", card=PORTS), programs("leaving", bits), "clocks"
    )
    if done.stdout in ("no seccomp\n", "no vDSO\n"):
        pytest.skip(f"needs what this computer lacks: {done.stdout.strip()}")
    assert said(done) == ["read"]


def test_a_shells_redirection_from_the_device_reaches_the_card(
    programs: Programs, tmp_path: Path
) -> None:
    script = (
        r"printf '\x5d' | dd of=/dev/port bs=1 seek=800 status=none conv=notrunc;"
        " dd bs=1 skip=800 count=1 status=none < /dev/port | od -An -tx1"
    )
    done = execute(tmp_path, LOCKSTEP, "bash", "-c", script)
    assert said(done) == [" 5d"]
