"""Programs under ``vbus exec`` that close descriptors, start other programs, or are ended."""

import re
import signal
import subprocess
import sys
from collections.abc import Callable
from contextlib import nullcontext
from pathlib import Path

import pytest

from tests.exec.conftest import PROGRAMS, compile_c
from tests.exec.test_programs import PORTS, REGISTERS, SERVO, execute, running, said
from tests.waiting import PATIENCE, until

Programs = Callable[[str, int], Path]
KILLED = re.compile(
    r"vbus exec: SIGTERM has not ended the program within (0\.[7-9]|\d+\.\d) s; it is killed"
)
LOCKSTEP = REGISTERS.format(time="lockstep", card=PORTS)


def lives(process: str) -> bool:
    """Whether a process runs: one that is dead is there until somebody asks how it ended."""
    try:
        text = Path(f"/proc/{process}/stat").read_text()
    except (FileNotFoundError, ProcessLookupError):
        return False
    return text.rpartition(")")[2].split()[0] not in "ZX"


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
            capture_output=True, text=True, timeout=PATIENCE, check=False,
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


def test_last_writes_come_out_though_their_thread_has_no_processor(
    programs: Programs, tmp_path: Path
) -> None:
    """It is about to send them when another thread gets the signal."""
    slow = compile_c(tmp_path / "slow.so", "-shared", "-fPIC", PROGRAMS / "slow.c")
    script = f"LD_PRELOAD=$LD_PRELOAD:{slow} exec {programs('takes_turns', 64)} writes"
    transcript = tmp_path / "bus.txt"
    done = execute(tmp_path, LOCKSTEP, "sh", "-c", script, options=("--transcript", transcript))
    assert (done.returncode, done.stderr) == (128 + signal.SIGTERM, "")
    assert " w 20 0D x" in transcript.read_text()


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


# -- the end ---------------------------------------------------------------------------------------


@pytest.mark.parametrize("number", [signal.SIGTERM, signal.SIGINT])
@pytest.mark.parametrize("time", ["lockstep", "realtime"])
@pytest.mark.parametrize("how", ["polls", "threads", "deadlock", "spins", "pauses"])
def test_a_signal_always_ends_it(
    programs: Programs, tmp_path: Path, number: int, time: str, how: str
) -> None:
    (tmp_path / "board.toml").write_text(REGISTERS.format(time=time, card=PORTS))
    process = subprocess.Popen(
        [sys.executable, "-m", "vbus", "exec", "--board", str(tmp_path / "board.toml"), "--",
         str(programs("ends", 64)), how],
        stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True,
    )  # fmt: skip
    assert process.stdout is not None
    assert process.stdout.readline() == "up\n"
    process.send_signal(number)
    _, errors = process.communicate(timeout=PATIENCE)
    assert (process.returncode, errors) == (128 + number, "")


@pytest.mark.parametrize("link", [False, True], ids=["a board of its own", "a running board"])
@pytest.mark.parametrize("how", ["stubborn", "handler"])
def test_what_does_not_end_is_killed_and_it_is_said_what_it_did(
    programs: Programs, tmp_path: Path, how: str, link: bool
) -> None:
    with running(tmp_path, LOCKSTEP) if link else nullcontext():
        (tmp_path / "board.toml").write_text(LOCKSTEP)
        where = ["--link", f"unix:{tmp_path}/x.sock"] if link else ["--board", "board.toml"]
        process = subprocess.Popen(
            [sys.executable, "-m", "vbus", "exec", *where, "--", str(programs("ends", 64)), how],
            stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True, cwd=tmp_path,
        )  # fmt: skip
        assert process.stdout is not None
        assert process.stdout.readline() == "up\n"
        process.send_signal(signal.SIGTERM)
        _, errors = process.communicate(timeout=PATIENCE)
    assert process.returncode == 128 + signal.SIGKILL
    lines = errors.splitlines()
    assert KILLED.fullmatch(lines[0])
    assert lines[1].startswith("vbus exec: ends64 (process ")
    assert re.search("waits in .*called by|is running", lines[1]), "by chance between two naps"


def test_what_does_not_end_is_killed_also_if_nobody_reads_why(
    programs: Programs, tmp_path: Path
) -> None:
    (tmp_path / "board.toml").write_text(LOCKSTEP)
    process = subprocess.Popen(
        [sys.executable, "-m", "vbus", "exec", "--board", "board.toml", "--",
         str(programs("ends", 64)), "stubborn"],
        stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True, cwd=tmp_path,
    )  # fmt: skip
    assert process.stdout is not None
    assert process.stderr is not None
    assert process.stdout.readline() == "up\n"
    process.stderr.close()
    process.send_signal(signal.SIGTERM)
    try:
        assert process.wait(timeout=PATIENCE) == 128 + signal.SIGKILL
    finally:
        process.kill()
        process.stdout.close()


@pytest.mark.parametrize("time", ["lockstep", "realtime"])
@pytest.mark.parametrize("how", ["child", "orphan", "stubborn"])
def test_what_a_program_leaves_behind_ends_with_its_board(
    programs: Programs, tmp_path: Path, time: str, how: str
) -> None:
    """By SIGTERM, while the board still answers."""
    (tmp_path / "board.toml").write_text(REGISTERS.format(time=time, card=PORTS))
    process = subprocess.Popen(
        [sys.executable, "-m", "vbus", "exec", "--board", "board.toml", "--transcript", "bus.txt",
         "--", str(programs("leaving", 64)), "leaves", how],
        stdin=subprocess.PIPE, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True,
        cwd=tmp_path,
    )  # fmt: skip
    assert process.stdout is not None
    child = process.stdout.readline().strip()
    _, errors = process.communicate("\n", timeout=PATIENCE)
    assert process.returncode == 0
    until(lambda: not lives(child), f"process {child} lives on")
    lines = errors.splitlines()
    assert lines[0] == (
        f"vbus exec: the program has ended and left behind: leaving64 (process {child}); that ends"
        " too, with the board; what shall go on needs a board that runs already (--join)"
    )
    last = (tmp_path / "bus.txt").read_text().splitlines()[-1]
    if how == "stubborn":
        assert KILLED.fullmatch(lines[1])
        assert last == "x r 20 01"
    else:
        assert (last, len(lines)) == ("x w 20 0F", 1)


def test_a_signal_ends_what_a_shell_has_started_too(programs: Programs, tmp_path: Path) -> None:
    (tmp_path / "board.toml").write_text(LOCKSTEP)
    script = f"{programs('ends', 64)} pauses & echo $!; wait"
    process = subprocess.Popen(
        [sys.executable, "-m", "vbus", "exec", "--board", "board.toml", "--", "sh", "-c", script],
        stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True, cwd=tmp_path,
    )  # fmt: skip
    assert process.stdout is not None
    lines = {process.stdout.readline().strip(), process.stdout.readline().strip()}
    process.send_signal(signal.SIGTERM)
    _, errors = process.communicate(timeout=PATIENCE)
    assert (process.returncode, errors) == (128 + signal.SIGTERM, "")
    (child,) = lines - {"up"}
    until(lambda: not lives(child), f"process {child} lives on")


def test_a_program_does_not_outlive_its_board_that_is_killed(
    programs: Programs, tmp_path: Path
) -> None:
    """Though it waits for something else, in real time."""
    (tmp_path / "board.toml").write_text(REGISTERS.format(time="realtime", card=PORTS))
    process = subprocess.Popen(
        [sys.executable, "-m", "vbus", "exec", "--board", "board.toml", "--",
         str(programs("ends", 64)), "stubborn"],
        stdout=subprocess.PIPE, text=True, cwd=tmp_path,
    )  # fmt: skip
    assert process.stdout is not None
    assert process.stdout.readline() == "up\n"
    process.kill()
    process.communicate(timeout=PATIENCE)  # its end closes the pipe


def test_a_wild_pointer_is_called_one(programs: Programs, tmp_path: Path) -> None:
    done = execute(tmp_path, LOCKSTEP, programs("ends", 64), "wild")
    assert (done.returncode, done.stdout) == (128 + signal.SIGSEGV, "up\n")
    assert "at an address no program can have (not canonical)" in done.stderr
    assert "privileged" not in done.stderr
    assert "the library was not asked" not in done.stderr


def test_a_program_that_blocks_the_trap_by_a_system_call_is_told_why_it_died(
    programs: Programs, bits: int, tmp_path: Path
) -> None:
    done = execute(tmp_path, LOCKSTEP, programs("ends", bits), "raw")
    assert (done.returncode, done.stdout) == (128 + signal.SIGSEGV, "up\n")
    assert "the program died of SIGSEGV and the library was not asked" in done.stderr
