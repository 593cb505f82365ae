"""Programs with threads: where time is virtual one runs at a time, and every run is the same."""

import os
import subprocess
from collections.abc import Callable
from pathlib import Path

import pytest

from tests.examples.boards import vbus
from tests.exec.conftest import PROGRAMS, compile_c
from tests.exec.test_programs import PORTS, REGISTERS, SERVO, execute, said

Programs = Callable[[str, int], Path]

# What the main thread prints, by what it does meanwhile; the interrupt comes 58.5 ms after STT.
SERVED = {
    "poll": (58623, 58483, 58879, 217),
    "clock": (58623, 58483, 58879, 217),
    "sleep": (58619, 195, 58937, 1),
    "condition": (58616, 0, 58872, 0),
    "semaphore": (58616, 0, 58872, 0),
}


def served(work: str, later: int = 0) -> list[str]:
    """Return the program's lines; `later`: the thread takes its turn that much later."""
    first, polls, second, more = SERVED[work]
    return [
        "100 inb took 101 us",
        "interrupt 1, status 04",
        f"move 1 after {first + later} us, {polls + later} polls",
        "interrupt 2, status 04",
        f"move 2 after {second + later} us, {more} polls",
        "ended 1",
    ]


@pytest.mark.parametrize("policy", ["lockstep", "slaved"])
@pytest.mark.parametrize("work", SERVED)
def test_an_interrupt_reaches_its_thread_at_the_same_cycle_of_the_other(
    programs: Programs, tmp_path: Path, policy: str, work: str
) -> None:
    done = execute(
        tmp_path, SERVO.format(time=policy, card=""), programs("threads", 64), "read", work
    )
    assert said(done) == served(work)


@pytest.mark.parametrize("how", ["poll", "select", "epoll"])
def test_a_thread_that_waits_for_an_interrupt_costs_the_other_no_chip_time(
    programs: Programs, bits: int, tmp_path: Path, how: str
) -> None:
    """A hundred cycles of 1 us, and a look at the clock."""
    board = SERVO.format(time="lockstep", card="")
    assert said(execute(tmp_path, board, programs("threads", bits), "nobody")) == [
        "100 inb took 101 us"
    ]
    assert said(execute(tmp_path, board, programs("threads", bits), how, "poll")) == served(
        "poll", later=1
    )


def test_runs_with_threads_are_the_same_under_load_and_on_one_core(
    programs: Programs, tmp_path: Path
) -> None:
    """Four at once, two of them on one processor."""
    (tmp_path / "board.toml").write_text(SERVO.format(time="lockstep", card=""))
    runs = []
    for number in range(4):
        pin = ["taskset", "-c", str(min(os.sched_getaffinity(0)))] if number < 2 else []
        runs.append(
            subprocess.Popen(
                [*pin, *vbus("exec", "--board", str(tmp_path / "board.toml"),
                             "--transcript", str(tmp_path / f"{number}.txt"), "--",
                             str(programs("threads", 64)), "read", "poll")],
                stdout=subprocess.PIPE, text=True,
            )
        )  # fmt: skip
    assert [run.communicate(timeout=120)[0].splitlines() for run in runs] == [served("poll")] * 4
    transcripts = {(tmp_path / f"{number}.txt").read_text() for number in range(4)}
    assert len(transcripts) == 1


@pytest.mark.parametrize(
    ("what", "order"), [("begins", "abcdefabcdef"), ("asks", "mmammammammammamma")]
)
def test_turns_are_the_same_where_the_processor_is_elsewhere(
    programs: Programs, tmp_path: Path, what: str, order: str
) -> None:
    """Each time a thread wakes another, and while one asks the kernel for a child."""
    slow = compile_c(tmp_path / "slow.so", "-shared", "-fPIC", PROGRAMS / "slow.c")
    program = programs("takes_turns", 64)
    for before in ("", f"LD_PRELOAD=$LD_PRELOAD:{slow} "):
        done = execute(
            tmp_path, REGISTERS.format(time="lockstep", card=PORTS), "sh", "-c",
            f"{before}exec {program} {what}",
        )  # fmt: skip
        assert said(done) == [order]


def test_who_reads_what_a_thread_prints_may_be_slow(programs: Programs, tmp_path: Path) -> None:
    """It prints more than a pipe holds, and keeps its turn until that is read."""
    program = programs("takes_turns", 64)
    for seconds in ("0", "0.2"):
        done = execute(
            tmp_path, REGISTERS.format(time="lockstep", card=PORTS), "sh", "-c",
            f"{program} prints | {{ sleep {seconds}; tail -n 1; }}",
        )  # fmt: skip
        assert said(done) == ["mamammmm"]


def test_a_thread_that_spins_on_memory_is_named_and_sees_what_it_waits_for(
    programs: Programs, bits: int, tmp_path: Path
) -> None:
    """It stands aside while others run: the instants are those of one that waits."""
    board = SERVO.format(time="lockstep", card="")
    done = execute(tmp_path, board, programs("threads", bits), "read", "spin")
    assert done.stdout.splitlines() == served("condition")
    assert done.stderr.count("vbus exec: thread 1 waits for memory to change") == 1
    assert "it is at the instruction at 0x" in done.stderr
    assert "/threads" in done.stderr


@pytest.mark.parametrize("looks", ["left > 0", "__atomic_fetch_add(&left, 0, 5) > 0"])
def test_a_loop_goes_round_once_for_each_change_of_what_it_looks_at(
    tmp_path: Path, looks: str
) -> None:
    """An atomic addition is not followed: the processor carries it out."""
    (tmp_path / "counts.c").write_text(
        "#include <signal.h>\n#include <stdio.h>\n#include <sys/io.h>\n#include <sys/time.h>\n"
        "#include <time.h>\n"
        "static volatile int left = 5;\n"
        "static void tick(int number) { (void)number; left--; }\n"
        "static long now(void)\n{\n    struct timespec when;\n"
        "    clock_gettime(CLOCK_MONOTONIC, &when);\n"
        "    return when.tv_sec * 1000000 + when.tv_nsec / 1000;\n}\n"
        "int main(void)\n{\n    struct itimerval every = {{0, 1000}, {0, 1000}};\n    long start;\n"
        "    iopl(3);\n    inb(0x320);\n    signal(SIGALRM, tick);\n"
        "    setitimer(ITIMER_REAL, &every, NULL);\n    start = now();\n"
        f"    while ({looks})\n        ;\n"
        '    printf("%ld us\\n", now() - start);\n    return 0;\n}\n'
    )
    program = compile_c(tmp_path / "counts", "-O1", tmp_path / "counts.c")
    done = execute(tmp_path, REGISTERS.format(time="lockstep", card=PORTS), program)
    assert (done.returncode, done.stdout) == (0, "5000 us\n")
    assert done.stderr.count("waits for memory to change") == 1


def test_a_loop_that_works_is_named_when_it_keeps_others_waiting(tmp_path: Path) -> None:
    (tmp_path / "works.c").write_text(
        "#include <pthread.h>\n#include <sys/io.h>\n#include <time.h>\n#include <unistd.h>\n"
        "static void *waits(void *data) { usleep(1000); return data; }\n"
        "int main(void)\n{\n    volatile unsigned long turn = 0;\n    pthread_t thread;\n"
        "    iopl(3);\n    inb(0x320);\n    pthread_create(&thread, NULL, waits, NULL);\n"
        "    while (clock() < 3 * CLOCKS_PER_SEC / 2)\n        turn++;\n"
        "    return pthread_join(thread, NULL);\n}\n"
    )
    program = compile_c(tmp_path / "works", "-O1", tmp_path / "works.c")
    done = execute(tmp_path, REGISTERS.format(time="lockstep", card=PORTS), program)
    assert (done.returncode, done.stdout) == (0, "")
    assert "thread 1 has worked for a second of processor time" in done.stderr
    assert "no other thread has a turn" in done.stderr


SYNCHRONISED = [
    "mutex 20000 of 20000", "order abcabcabc", "barrier 1 serial of 3", "once 1",
    "rwlock 2 readers, then 1 writer", "c11 3", "timed join 110, then 0", "cancelled 1 in sleep",
    "cancelled 1 in condition", "cancelled 1 in access", "cancelled 1 after an access",
    "left by exit 5", "semaphores 3", "futex 0", "spinlock 2000", "detached 1",
]  # fmt: skip


@pytest.mark.parametrize("policy", ["lockstep", "slaved", "realtime"])
def test_what_threads_wait_for_of_each_other_works(
    programs: Programs, bits: int, tmp_path: Path, policy: str
) -> None:
    done = execute(tmp_path, REGISTERS.format(time=policy, card=PORTS), programs("meetings", bits))
    assert said(done) == SYNCHRONISED


TWO = SERVO.replace(
    "[cards.slot]",
    '[chips.y]\npart = "LM629N-8"\nclock = "8 MHz"\nplant = "none"\n[cards.slot]\nblock = 2',
)
TWO = TWO.replace('chips = ["x"]', 'chips = ["x", "y"]').replace('"x.HI"', '"x.HI y.HI"')


@pytest.mark.parametrize("policy", ["lockstep", "slaved", "realtime"])
def test_two_outputs_are_one_interrupt(programs: Programs, tmp_path: Path, policy: str) -> None:
    """It stands until both chips have been served."""
    done = execute(
        tmp_path, TWO.format(time=policy, card=""), programs("lines", 64),
        options=("--no-summary",),
    )  # fmt: skip
    assert said(done) == [
        "after reset: interrupt 1", "one served: interrupt 2", "both served: interrupt 0",
        "one reset again: interrupt 3",
    ]  # fmt: skip


def test_a_write_that_nobody_takes_is_told_where_writes_are_answered(tmp_path: Path) -> None:
    """The ISA circuit of the MC1241A's manual reads at other ports than it writes (PMD-BUS-12)."""
    (tmp_path / "lost.c").write_text(
        "#include <sys/io.h>\nint main(void) { iopl(3); outb(1, 0x304); inb(0x302); return 0; }\n"
    )
    program = compile_c(tmp_path / "lost", "-O2", tmp_path / "lost.c")
    board = REGISTERS.replace("MCP-1200", "MC1141A").replace("10 MHz", "25 MHz")
    card = 'base = 0x300\ndecode = "isa"\nchips = ["x"]'
    done = execute(tmp_path, board.format(time="lockstep", card=card), program)
    lines = done.stderr.splitlines()
    assert lines[0] == ("vbus exec: no chip answers a write of 1 byte at port 0x304; it is lost")
    assert lines[2] == "vbus exec: the card answers writes at 0x300, 0x302, 0x308"
    assert lines[3] == "vbus exec: no chip answers a read of 1 byte at port 0x302; FFh is read"
    assert lines[5] == "vbus exec: the card answers reads at 0x300, 0x304"
