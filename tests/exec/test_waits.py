"""Waits with a time-out follow chip time, cost no wall time, and repeat exactly."""

import subprocess
import sys
import time
from collections.abc import Callable
from pathlib import Path

import pytest

from tests.exec.conftest import PROGRAMS, compile_c
from tests.exec.test_programs import PORTS, REGISTERS, execute, running, said
from vbus.tools.preload import library


@pytest.fixture(autouse=True, scope="module")
def _built() -> None:
    """Compiling the library is no part of what is waited for."""
    library()


EXPECTED = [
    "nanosleep 0 600000", "absolute 0 1200000", "gettimeofday 5, time 5",
    "timedwait 1 1000000", "monotonic 1 2000000", "clockwait 1 3000000", "semaphore 1 4000000",
    "sem_clockwait 1 5000000", "posted 0 55", "mutex 1 7000000",
    "settime 0 0", "timer 1 200000", "missed 2 450000", "again 1 500000", "left 9 of 10",
    "poll 1 100000", "select 1 100000", "epoll 1 100000", "epoll short 0 40000",
    "epoll empty 0 9000000", "ppoll 0 8000000", "pselect 0 8000000", "ready 1 8000000",
    "writev 3 readv 3 616263", "pwritev 3 preadv 3 716263",
]  # fmt: skip


@pytest.mark.parametrize("policy", ["lockstep", "slaved"])
def test_every_wait_takes_chip_time_only_and_repeats_exactly(
    programs: Callable[[str, int], Path], bits: int, tmp_path: Path, policy: str
) -> None:
    """The program waits for more than an hour of its time."""
    board, transcript = REGISTERS.format(time=policy, card=PORTS), tmp_path / "bus.txt"
    runs = []
    for _ in range(2):
        before = time.monotonic()
        done = execute(
            tmp_path, board, programs("waits", bits), options=("--transcript", transcript)
        )
        assert time.monotonic() - before < 30
        runs.append((said(done), transcript.read_text()))
    assert runs[0] == runs[1]
    assert runs[0][0] == EXPECTED


def test_32_bit_programs_with_a_wide_time_t_follow_chip_time_too(
    can_32_bits: bool, tmp_path: Path
) -> None:
    if not can_32_bits:
        pytest.skip("needs a 32-bit compiler (gcc-multilib)")
    program = compile_c(
        tmp_path / "waits", "-m32", "-O2", "-D_TIME_BITS=64", "-D_FILE_OFFSET_BITS=64",
        PROGRAMS / "waits.c",
    )  # fmt: skip
    before = time.monotonic()
    done = execute(tmp_path, REGISTERS.format(time="lockstep", card=PORTS), program)
    assert time.monotonic() - before < 30
    assert said(done) == EXPECTED


WAITS = [
    "cond_timedwait", "cond_clockwait", "sem_timedwait", "sem_clockwait", "mutex_timedlock",
    "mutex_clocklock", "poll", "ppoll", "select", "pselect", "epoll", "timer",
]  # fmt: skip


def test_waits_end_when_another_thread_does_what_they_wait_for(
    programs: Callable[[str, int], Path], bits: int, tmp_path: Path
) -> None:
    """Not an hour of chip time later, though to compute takes the other thread no chip time."""
    board = REGISTERS.format(time="lockstep", card=PORTS)
    works = ["sleeps", "computes", "polls"]
    script = (
        f"for how in {' '.join(WAITS)}; do for work in {' '.join(works)}; do"
        f" echo $how $work: $({programs('meets', bits)} $how $work); done; done"
    )
    done = execute(tmp_path, board, "sh", "-c", script)
    assert said(done) == [f"{how} {work}: result 0, an hour 0" for how in WAITS for work in works]


@pytest.mark.parametrize("how", ["cond_timedwait", "epoll", "poll", "timer", "sleep"])
def test_a_board_that_dies_in_a_wait_ends_the_program_clearly(
    programs: Callable[[str, int], Path], tmp_path: Path, how: str
) -> None:
    program = programs("meets", 64)
    with running(tmp_path, REGISTERS.format(time="lockstep", card=PORTS)) as board:
        process = subprocess.Popen(
            [sys.executable, "-m", "vbus", "exec", "--link", f"unix:{tmp_path}/x.sock", "--",
             str(program), how, "for-ever"],
            stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True,
        )  # fmt: skip
        assert process.stdout is not None
        assert process.stdout.readline() == "waiting\n"
        board.kill()
        _, errors = process.communicate(timeout=30)
    assert process.returncode == 4
    assert "vbus exec: the board is gone" in errors


def test_a_wait_beyond_the_end_of_time_ends_the_program_clearly(
    programs: Callable[[str, int], Path], bits: int, tmp_path: Path
) -> None:
    board = REGISTERS.format(time="lockstep", card=PORTS)
    done = execute(tmp_path, board, programs("meets", bits), "sleep", "too-long")
    assert (done.returncode, done.stdout) == (1, "")
    assert "beyond the end of chip time, which is 106 days after its start" in done.stderr
