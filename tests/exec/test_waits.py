"""Waits with a time-out follow chip time, cost no wall time, and repeat exactly."""

import subprocess
import sys
from collections.abc import Callable
from pathlib import Path

import pytest

from tests.exec.conftest import PROGRAMS, compile_c
from tests.exec.test_programs import PORTS, REGISTERS, SERVO, execute, running, said
from tests.waiting import PATIENCE

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
        done = execute(
            tmp_path, board, programs("waits", bits), options=("--transcript", transcript)
        )
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
    done = execute(tmp_path, REGISTERS.format(time="lockstep", card=PORTS), program)
    assert said(done) == EXPECTED


WAITS = [
    "cond_timedwait", "cond_clockwait", "sem_timedwait", "sem_clockwait", "mutex_timedlock",
    "mutex_clocklock", "poll", "ppoll", "select", "pselect", "epoll", "timer",
]  # fmt: skip


def test_waits_end_when_another_thread_does_what_they_wait_for(
    programs: Callable[[str, int], Path], bits: int, tmp_path: Path
) -> None:
    """Not an hour of chip time later, though to compute takes the other thread no chip time.

    Who labours computes longer than a turn may sleep: in user space and in the kernel's poll().
    """
    board = REGISTERS.format(time="lockstep", card=PORTS)
    pairs = [(how, work) for how in WAITS for work in ("sleeps", "computes", "polls")]
    pairs += [("cond_timedwait", "labours"), ("poll", "labours")]
    script = "".join(
        f"echo {how} {work}: $({programs('meets', bits)} {how} {work})\n" for how, work in pairs
    )
    done = execute(tmp_path, board, "sh", "-c", script)
    assert said(done) == [f"{how} {work}: result 0, an hour 0" for how, work in pairs]


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
        _, errors = process.communicate(timeout=PATIENCE)
    assert process.returncode == 4
    assert "vbus exec: the board is gone" in errors


def test_a_wait_beyond_the_end_of_time_ends_the_program_clearly(
    programs: Callable[[str, int], Path], bits: int, tmp_path: Path
) -> None:
    board = REGISTERS.format(time="lockstep", card=PORTS)
    done = execute(tmp_path, board, programs("meets", bits), "sleep", "too-long")
    assert (done.returncode, done.stdout) == (1, "")
    assert "beyond the end of chip time, which is 106 days after its start" in done.stderr


# Each wait of the page "Bring your driver": what it gives when its time is over (None: it has
# none), and when the interrupt's signal comes. POSIX has some go on after the handler.
EACH = {
    "nanosleep": ("0 -", "-1 EINTR"),
    "clock_nanosleep": ("0 -", "-1 EINTR"),
    "clock_nanosleep until": ("0 -", "-1 EINTR"),
    "usleep": ("0 -", "-1 EINTR"),
    "sleep": ("0 -", "-1 EINTR"),
    "thrd_sleep": ("0 -", "-1 EINTR"),
    "select": ("0 -", "-1 EINTR"),
    "select of nothing": ("0 -", "-1 EINTR"),
    "pselect": ("0 -", "-1 EINTR"),
    "poll": ("0 -", "-1 EINTR"),
    "ppoll": ("0 -", "-1 EINTR"),
    "epoll_wait": ("0 -", "-1 EINTR"),
    "epoll_pwait": ("0 -", "-1 EINTR"),
    "read of a pipe": (None, "-1 EINTR"),
    "sigtimedwait": ("-1 EAGAIN", "29 -"),
    "sigwaitinfo": (None, "29 -"),
    "sigwait": (None, "29 -"),
    "signalfd": (None, "29 -"),
    "poll of a signalfd": ("0 -", "1 -"),
    "pause": (None, "-1 EINTR"),
    "sigsuspend": (None, "-1 EINTR"),
    "futex": ("-1 ETIMEDOUT", "-1 EINTR"),
    "sem_timedwait": ("-1 ETIMEDOUT", "-1 EINTR"),
    "sem_clockwait": ("-1 ETIMEDOUT", "-1 EINTR"),
    "pthread_cond_timedwait": ("-1 ETIMEDOUT", "-1 ETIMEDOUT"),
    "pthread_mutex_timedlock": ("-1 ETIMEDOUT", "-1 ETIMEDOUT"),
    "pthread_rwlock_timedrdlock": ("-1 ETIMEDOUT", "-1 ETIMEDOUT"),
    "pthread_timedjoin_np": ("-1 ETIMEDOUT", "-1 ETIMEDOUT"),
    "mq_timedreceive": ("-1 ETIMEDOUT", "-1 EINTR"),
    "mq_timedsend": ("-1 ETIMEDOUT", "-1 EINTR"),
    "semtimedop": ("-1 EAGAIN", "-1 EINTR"),
    "setitimer": ("-1 EINTR", "-1 EINTR"),
    "alarm": ("-1 EINTR", "-1 EINTR"),
    "timer_create": ("-1 EINTR", "-1 EINTR"),
    "timer with a thread": ("0 -", "-1 EINTR"),
    "timerfd": ("1 -", "-1 EINTR"),
}
TAKEN = {"sigtimedwait", "sigwaitinfo", "sigwait", "signalfd", "poll of a signalfd"}
"""Those that take the signal themselves: no handler runs."""
BY_SIGNAL = {"setitimer", "alarm", "timer_create"}
"""Those whose time ends with a signal."""


def each(program: Path, folder: Path, policy: str, how: str, names: list[str]) -> list[str]:
    board = SERVO.format(time=policy, card='signal = "SIGIO"')
    quoted = " ".join(f"'{name}'" for name in names)
    script = f'for name in {quoted}; do {program} "$name" {how}; done'
    done = execute(folder, board, "sh", "-c", script, options=("--no-summary",))
    assert done.stderr == ""
    return done.stdout.splitlines()


@pytest.mark.parametrize("policy", ["lockstep", "slaved", "realtime"])
def test_each_wait_ends_by_chip_time(
    programs: Callable[[str, int], Path], bits: int, tmp_path: Path, policy: str
) -> None:
    names = [name for name, (ends, _) in EACH.items() if ends is not None]
    lines = each(programs("each_wait", bits), tmp_path, policy, "time", names)
    for name, line in zip(names, lines, strict=True):
        ms = 1000.0 if name in ("sleep", "alarm") else 20.0
        said, took = line.removesuffix(" ms").rsplit(", ", 1)
        assert f"{name}: {said}" == f"{name}: {EACH[name][0]}, signals {int(name in BY_SIGNAL)}"
        assert float(took) == ms if policy != "realtime" else float(took) >= ms, name


@pytest.mark.parametrize("policy", ["lockstep", "slaved", "realtime"])
def test_each_wait_is_ended_by_the_interrupts_signal(
    programs: Callable[[str, int], Path], bits: int, tmp_path: Path, policy: str
) -> None:
    how = "later" if policy == "realtime" else "signal"
    lines = each(programs("each_wait", bits), tmp_path, policy, how, list(EACH))
    assert dict(zip(EACH, lines, strict=True)) == {
        name: f"{ended}, signals {int(name not in TAKEN)}, at once"
        for name, (_, ended) in EACH.items()
    }


def test_the_page_has_every_wait() -> None:
    page = Path("docs/bring-your-driver.md").read_text()
    table = page[page.index("### Waits") :]
    names = {name.removesuffix(" until").split(" of ")[-1].split(" with ")[0] for name in EACH}
    names = names - {"nothing", "a pipe", "a signalfd", "timer"}
    assert [name for name in sorted(names) if f"`{name}`" not in table] == []


@pytest.mark.parametrize(
    "how", ["sleeps", "polls nothing", "looks at the clock", "waits for an interrupt"]
)
@pytest.mark.parametrize("policy", ["lockstep", "slaved"])
def test_a_limit_ends_a_wait_without_a_bus_cycle(
    programs: Callable[[str, int], Path], tmp_path: Path, how: str, policy: str
) -> None:
    """The board knows of no time that a program keeps to itself: it is told beyond the limit."""
    board = SERVO.format(time=policy, card="")
    done = execute(
        tmp_path, board, programs("for_ever", 64), how, options=("--limit", "2 s")
    )  # fmt: skip
    assert (done.returncode, done.stdout) == (137, "begun\n")
    sentence = "vbus: the program hangs: it was not done after 2 s of chip time"
    assert done.stderr.splitlines()[0] == sentence
