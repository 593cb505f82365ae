"""Programs that wait for what cannot come, or only compute: ended and named; all others are not."""

import os
import subprocess
import sys
from collections.abc import Callable
from pathlib import Path

import pytest

from tests.exec.test_programs import SERVO, execute
from tests.waiting import until
from vbus.board.build import load_board_text
from vbus.board.config import read_board_file
from vbus.cli import proc
from vbus.cli.hosted import at_rest
from vbus.cli.hosted.at_rest import AtRest
from vbus.cli.proc import RUNS, call_of, offspring, tasks
from vbus.serve.host_limits import UNBOUNDED, HostWatch, Limits
from vbus.testing.programs import run_program

Programs = Callable[[str, int], Path]
CARD = SERVO.format(time="lockstep", card="")
PLAIN = (
    '[board]\nname = "plain"\ntime = "lockstep"\n[chips.x]\npart = "LM629N-8"\nclock = "8 MHz"\n'
    'plant = "none"\n[[hosts]]\ntransport = "unix:$VBUS_RUNTIME/x.sock"\n'
)
IN_VAIN = {
    "mutex": "pthread_mutex_lock (futex), called by lock_twice",
    "join": "pthread_mutex_lock (futex), called by lock_twice",
    "semaphore": "called by main",
    "condition": "pthread_cond_wait (futex), called by main",
    "pipe": "waits in read, called by main",
    "poll": "waits in poll, called by main",
    "pause": "called by main",
    "child": "called by main",
}
"""What is told of each, of a thread of it."""
COMES = ("sleeps", "working child", "child writes", "alarm", "thread works", "timed")


def watch() -> HostWatch:
    return HostWatch(load_board_text(PLAIN, "here"), Limits(UNBOUNDED, UNBOUNDED))


def begun(program: Path, *words: str) -> subprocess.Popen[str]:
    process = subprocess.Popen(
        [program, *words], stdin=subprocess.PIPE, stdout=subprocess.PIPE, text=True
    )
    assert process.stdout is not None
    assert process.stdout.readline() == "begun\n"
    return process


def looks(process: subprocess.Popen[str], over: HostWatch, note: Path) -> AtRest:
    return AtRest(lambda: offspring([process.pid]), over, note, 0)


@pytest.mark.parametrize("how", IN_VAIN)
def test_a_program_whose_threads_all_wait_for_each_other_is_over(
    programs: Programs, bits: int, tmp_path: Path, how: str
) -> None:
    process = begun(programs("hangs", bits), how)
    over = watch()
    rest = looks(process, over, tmp_path / "note")

    def ended() -> bool:
        rest.look()
        return over.ended

    try:
        until(ended, "the end of a program that hangs")
        assert over.stuck == at_rest.IN_VAIN
        if how not in ("poll", "pipe"):
            assert any(IN_VAIN[how] in line or bits == 32 for line in over.details)
        assert {f"thread {task})" in "".join(over.details) for task in tasks(process.pid)} == {True}
    finally:
        for pid in offspring([process.pid])[::-1]:
            subprocess.run(["kill", "-9", str(pid)], check=True)
        process.communicate()


def test_a_thread_that_runs_when_it_is_described_is_looked_at_again(
    programs: Programs, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Those of vbus exec's library wake now and then, and wait again."""
    process = begun(programs("hangs", 64), "join")
    over = watch()
    rest = looks(process, over, tmp_path / "note")
    real, seen = proc._syscall, [0]

    def woken(pid: int, task: int) -> str:
        seen[0] += 1
        return "running\n" if len(described) == 1 and seen[0] == 2 else real(pid, task)

    described: list[int] = []

    def describe(pids: list[int]) -> list[str]:
        described.append(len(pids))
        seen[0] = 0
        return proc.what_hangs(pids)

    monkeypatch.setattr(proc, "_syscall", woken)
    monkeypatch.setattr(at_rest, "what_hangs", describe)
    until(lambda: (rest.look(), over.ended)[1], "the end of a program that hangs")
    process.kill()
    process.communicate()
    assert len(described) == 2
    threads = [line for line in over.details if "thread " in line]
    assert len(threads) == 2
    assert all(" waits in " in line for line in threads)
    over.add_threads(["it is running"])  # those that end a program look at it once more
    assert "it is running" not in over.details


@pytest.mark.parametrize("how", [*COMES, "stdin"])
def test_one_that_waits_for_what_comes_is_left_alone(
    programs: Programs, bits: int, tmp_path: Path, how: str
) -> None:
    process = begun(programs("hangs", bits), how)
    over = watch()
    rest = looks(process, over, tmp_path / "note")
    if how == "stdin":
        until(lambda: (call_of(process.pid, process.pid) or ("",))[0] == "read", "its read")
        for _ in range(30):
            rest.look()
    else:
        until(lambda: (rest.look(), process.poll() is not None)[1], "its end")
    assert not over.ended
    process.communicate("x")
    assert process.returncode == 0


def test_one_that_computes_is_over_after_so_much_wall_clock_time(
    programs: Programs, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(at_rest, "POLLING", 0.2)
    process = begun(programs("hangs", 64), "computes")
    over = watch()
    rest = looks(process, over, tmp_path / "note")
    until(lambda: (rest.look(), over.ended)[1], "the end of a program that computes")
    assert over.stuck.startswith("it has computed for 0.2 s of wall-clock time, all of them on the")
    assert over.details[0].endswith(f"(process {process.pid}, thread {process.pid}) is running")
    process.kill()
    process.communicate()


def test_one_that_gives_way_in_a_loop_is_over_as_soon_where_others_compute(
    programs: Programs, bits: int, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """It has a few microseconds of the processor, now and then."""
    monkeypatch.setattr(at_rest, "POLLING", 2.0)
    cpu = min(os.sched_getaffinity(0))
    busy = subprocess.Popen([sys.executable, "-c", "while True: pass"])
    process = begun(programs("hangs", bits), "yields")
    try:
        for one in (busy, process):
            os.sched_setaffinity(one.pid, {cpu})
        over = watch()
        rest = looks(process, over, tmp_path / "note")
        until(lambda: (rest.look(), over.ended)[1], "the end of a program that yields")
        assert over.stuck.startswith("it has computed for 2 s of wall-clock time")
    finally:
        for one in (busy, process):
            one.kill()
            one.communicate()


@pytest.mark.parametrize("how", IN_VAIN)
@pytest.mark.parametrize("board", [CARD, PLAIN], ids=["card", "link"])
def test_vbus_exec_ends_it_and_names_what_each_thread_does(
    programs: Programs, tmp_path: Path, how: str, board: str
) -> None:
    words = ["card"] if board == CARD else []
    done = execute(
        tmp_path, board, programs("hangs", 64), how, *words,
        options=("--limit", "2 s", "--no-summary"),
    )  # fmt: skip
    assert (done.returncode, done.stdout) == (137, "begun\n")
    first, *rest = done.stderr.splitlines()
    assert first == f"vbus: the program hangs: {at_rest.IN_VAIN}"
    assert "called by " in "\n".join(rest)
    assert not [line for line in rest if "left behind" in line or line.endswith(RUNS)]


@pytest.mark.parametrize("how", COMES)
def test_vbus_exec_leaves_alone_what_waits_for_what_comes(
    programs: Programs, tmp_path: Path, bits: int, how: str
) -> None:
    done = execute(
        tmp_path, CARD, programs("hangs", bits), how, "card",
        options=("--limit", "20 s", "--no-summary"),
    )  # fmt: skip
    assert (done.returncode, done.stderr) == (0, "")


def test_a_program_that_its_interrupt_kills_is_told_of_it(
    programs: Programs, tmp_path: Path
) -> None:
    board = SERVO.format(time="lockstep", card='signal = "SIGIO"')
    done = execute(tmp_path, board, programs("killed", 64), options=("--no-summary",))
    assert done.returncode == 128 + 29
    assert "the program died of SIGIO, which an interrupt sends (x.HI, which moved" in done.stderr
    assert "last at " in done.stderr
    assert "Install the handler before the chip can interrupt" in done.stderr


def test_a_program_of_a_test_that_waits_in_vain_ends_at_once(
    programs: Programs, tmp_path: Path
) -> None:
    (tmp_path / "board.toml").write_text(CARD)
    file, source = read_board_file(str(tmp_path / "board.toml"))
    command = [str(programs("hangs", 64)), "join", "card"]
    outcome = run_program(file, source, command, Limits(wall=600.0))
    assert (outcome.stuck, outcome.code, outcome.output) == (at_rest.IN_VAIN, 137, "begun\n")
    assert len([line for line in outcome.details if " waits in " in line]) == 2
