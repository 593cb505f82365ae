"""Unmodified Linux programs under ``vbus exec``, with 64 and 32 bits."""

import os
import re
import signal
import struct
import subprocess
import sys
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path

import pytest

from tests.examples.boards import vbus
from tests.exec.conftest import PROGRAMS, compile_c
from tests.exec.forms import processor
from tests.left_out import require
from tests.unit.board.test_leases import Leasing, reset_and_move
from tests.waiting import PATIENCE
from vbus.board.build import load_board
from vbus.cli.hosted.reach import warnings_for

REGISTERS = """
[board]
name = "bench"
time = "{time}"
power_on = "done"
[chips.x]
part = "MCP-1200"
clock = "10 MHz"
plant = "none"
[cards.slot]
{card}
[[hosts]]
transport = "unix:$VBUS_RUNTIME/x.sock"
card = "slot"
"""
PORTS = 'base = 0x300\ndecode = "direct"\nchips = ["x"]'
LOW_PORTS = 'base = 0x20\nports = [{ offset = 0, chip = "x", address = 0x20 }]'
MEMORY = 'base = 0x40000000\nmemory = true\ndecode = "direct"\nchips = ["x"]'

SERVO = """
[board]
name = "bench"
time = "{time}"
[chips.x]
part = "LM629N-8"
clock = "8 MHz"
plant = "m"
[plants.m]
model = "dc_motor"
supply = "24 V"
resistance = "2 ohm"
torque_constant = "0.05 N*m/A"
inertia = "1e-5 kg*m^2"
[cards.slot]
base = 0x340
decode = "direct"
chips = ["x"]
interrupt = "x.HI"
{card}
[[hosts]]
transport = "unix:$VBUS_RUNTIME/x.sock"
card = "slot"
"""

LONGEST = 300.0
"""Seconds: some scripts run forty programs, one after the other."""

Done = subprocess.CompletedProcess[str]


def execute(
    folder: Path, board: str, *command: str | Path, options: tuple[str | Path, ...] = ()
) -> Done:
    """Run a command under ``vbus exec`` on a board file of its own."""
    (folder / "board.toml").write_text(board)
    return subprocess.run(
        vbus("exec", "--board", str(folder / "board.toml"), *map(str, options), "--",
             *map(str, command)),
        capture_output=True, text=True, timeout=LONGEST, check=False,
    )  # fmt: skip


@pytest.fixture
def probe(programs: Callable[[str, int], Path], bits: int, tmp_path: Path) -> Callable[..., Done]:
    """Run a part of ``probe.c``."""

    def run(part: str, card: str = PORTS, time: str = "lockstep") -> Done:
        board = REGISTERS.format(time=time, card=card)
        return execute(tmp_path, board, programs("probe", bits), part)

    return run


LEFT = "hi-stands|interrupt-stands|errors-stand|left-loaded"
STANDS = re.compile(rf"vbus: note: \w+: \w+\.(?:{LEFT}) .*\n")


def said(done: Done) -> list[str]:
    """Return what a program has printed; what stands as it ends may be noted, and no more."""
    assert (done.returncode, STANDS.sub("", done.stderr)) == (0, "")
    return done.stdout.splitlines()


# -- ports -----------------------------------------------------------------------------------------


@pytest.mark.parametrize("time", ["lockstep", "slaved", "realtime"])
def test_every_form_of_in_and_out_becomes_byte_cycles(
    probe: Callable[..., Done], time: str
) -> None:
    done = probe("ports", time=time)
    assert done.returncode == 0
    assert done.stdout.splitlines() == [
        "byte 5a", "word 2211 11 22", "long 332211", "outsb 16", "insb 16 16", "words 2423 2423",
        "longs 434241", "immediate ff",
    ]  # fmt: skip
    assert "no chip answers a write of 1 byte at port 0x20; it is lost" in done.stderr


def test_a_port_number_in_the_instruction_reaches_the_card(probe: Callable[..., Done]) -> None:
    done = probe("ports", card=LOW_PORTS)
    assert "immediate 77" in done.stdout


def test_a_port_that_was_not_asked_for_faults_as_on_a_real_computer(
    probe: Callable[..., Done],
) -> None:
    done = probe("forbidden")
    assert (done.returncode, done.stdout) == (128 + signal.SIGSEGV, "allowed\n")
    assert "for which it has not called ioperm or iopl" in done.stderr


def test_an_access_nobody_answers_is_reported_once_with_its_place(
    probe: Callable[..., Done],
) -> None:
    done = probe("nobody")
    assert done.stdout.splitlines() == ["ff", "ff", "ff", "ff80"]
    lines = done.stderr.splitlines()
    assert lines[0] == "vbus exec: no chip answers a read of 1 byte at port 0x7300; FFh is read"
    assert "by the instruction at 0x" in lines[1]
    assert "/probe" in lines[1]
    assert lines[2] == "vbus exec: the card answers reads at 0x300 to 0x37f"
    assert len(lines) == 3


def test_dev_port_is_read_and_written_in_every_way(probe: Callable[..., Done]) -> None:
    assert said(probe("device")) == [
        "pwrite 1", "pread 1 31", "write 3", "read 2 02 03 at 323", "stream 3c", "openat 1",
    ]  # fmt: skip


# -- memory ----------------------------------------------------------------------------------------

BYTES = ["bytes 41 42", "word 5251", "changed d1 53", "block 66 66 66"]


@pytest.mark.parametrize("part", ["memory", "uio"])
def test_a_mapped_card_is_read_and_written_by_loads_and_stores(
    probe: Callable[..., Done], part: str
) -> None:
    assert said(probe(part, card=MEMORY)) == BYTES


def test_a_card_at_a_fixed_address_needs_no_mapping(probe: Callable[..., Done]) -> None:
    assert said(probe("fixed", card=MEMORY + "\nfixed = 0x50000000")) == BYTES


def test_bytes_on_a_wide_bus_stand_apart(probe: Callable[..., Done]) -> None:
    """Nobody drives the other three bytes of each word."""
    assert said(probe("strided", card=MEMORY + "\nstride = 4")) == ["ffffff78 ffffff9a", "9a"]


def test_a_big_endian_card_turns_the_bytes_of_a_word(probe: Callable[..., Done]) -> None:
    """The byte for the lowest address is now the most significant one of what is written."""
    assert said(probe("strided", card=MEMORY + "\nstride = 4\nbig_endian = true")) == [
        "12ffffff 00ffffff", "00",
    ]  # fmt: skip


def test_an_instruction_of_an_unknown_kind_is_refused_by_its_bytes(
    probe: Callable[..., Done],
) -> None:
    done = probe("unsupported", card=MEMORY)
    assert (done.returncode, done.stdout) == (1, "")
    assert "an SSE or MMX instruction that is no plain move touches the card" in done.stderr
    assert "the instruction's bytes (and what follows it): 0F FC " in done.stderr
    assert "access the card through volatile integers" in done.stderr


WIDE = [
    "structure 03020100 0b0a0908", "fild 0706050403020100", "fld 0b0a090807060504",
    "quotient 233", "quotient 0",
]  # fmt: skip


@pytest.mark.parametrize("level", ["-O0", "-O2", "-O3", "-O3 -mavx", "-Os -mno-sse"])
def test_structures_are_copied_and_divisors_read_as_compilers_do_it(
    bits: int, tmp_path: Path, level: str
) -> None:
    """A byte cycle for each byte of the structure, in the order of addresses."""
    if "avx" in level and "avx" not in processor():
        pytest.skip("the processor has no AVX")
    if bits == 64 and "no-sse" in level:
        level = "-Os"
    program = compile_c(tmp_path / "wide", f"-m{bits}", *level.split(), PROGRAMS / "wide.c")
    transcript = tmp_path / "bus.txt"
    board = REGISTERS.format(time="lockstep", card=MEMORY)
    done = execute(tmp_path, board, program, "handled", options=("--transcript", transcript))
    assert done.stdout.splitlines() == [*WIDE, "signal 8, code 1, at the instruction 1"]
    cycles = [line for line in transcript.read_text().splitlines() if not line.startswith("!")]
    assert cycles[:32] == [f"x w {0x20 + turn:02X} {turn:02X}" for turn in range(32)]
    assert [line[:6] for line in cycles[32:64]] == [f"x r {0x20 + n:02X}" for n in range(32)]


@pytest.mark.parametrize("ignores", [(), ("ignored",)])
def test_a_division_by_what_is_0_ends_the_program_as_ever(
    programs: Callable[[str, int], Path], bits: int, tmp_path: Path, ignores: tuple[str, ...]
) -> None:
    board = REGISTERS.format(time="lockstep", card=MEMORY)
    done = execute(tmp_path, board, programs("wide", bits), *ignores)
    assert (done.returncode, done.stdout.splitlines()) == (128 + signal.SIGFPE, WIDE)


# -- the program's own affairs ---------------------------------------------------------------------


def test_the_programs_own_fault_handlers_see_its_own_faults(probe: Callable[..., Done]) -> None:
    assert said(probe("faults")) == [
        "caught", "still 21", "signal 11 at 0x8", "handler 1", "blocked 21",
    ]  # fmt: skip


def test_a_signal_handler_may_touch_the_card(probe: Callable[..., Done]) -> None:
    assert said(probe("handler")) == ["in a handler 19"]


def test_a_crash_ends_the_program_as_ever_and_says_where(probe: Callable[..., Done]) -> None:
    done = probe("crash")
    assert (done.returncode, done.stdout) == (128 + signal.SIGSEGV, "e5\n")
    assert "the program faults at address 0x8" in done.stderr


def test_threads_share_the_card(probe: Callable[..., Done]) -> None:
    assert said(probe("threads")) == ["wrong 0"] * 3


def test_a_forked_child_opens_a_session_of_its_own(probe: Callable[..., Done]) -> None:
    assert said(probe("forks")) == ["child 0a", "parent 0b, child's code 5"]


def test_a_program_that_closes_all_descriptors_keeps_its_card(probe: Callable[..., Done]) -> None:
    assert said(probe("closes")) == ["low descriptor 3", "after closing all 0c"]


def test_what_is_kept_back_is_sent_when_the_program_leaves_at_once(
    programs: Callable[[str, int], Path], bits: int, tmp_path: Path
) -> None:
    board = REGISTERS.format(time="lockstep", card=PORTS)
    transcript = tmp_path / "bus.txt"
    program = programs("probe", bits)
    execute(tmp_path, board, program, "posted", options=("--transcript", transcript))
    assert transcript.read_text() == "x w 20 0D\n"


@pytest.mark.parametrize("end", ["fault", "abort"])
def test_what_is_kept_back_is_sent_when_the_program_dies(tmp_path: Path, end: str) -> None:
    """There the last cycles are wanted most."""
    dies = "*(volatile int *)where = 1;" if end == "fault" else "abort();"
    (tmp_path / "dies.c").write_text(
        "#include <stdlib.h>\n#include <sys/io.h>\nchar *volatile where = (char *)8;\n"
        f"int main(void) {{ iopl(3); outb(0x0E, 0x320); {dies} return 0; }}\n"
    )
    program = compile_c(tmp_path / "dies", tmp_path / "dies.c")
    board = REGISTERS.format(time="lockstep", card=PORTS)
    transcript = tmp_path / "bus.txt"
    done = execute(tmp_path, board, program, options=("--transcript", transcript))
    assert done.returncode == 128 + (signal.SIGSEGV if end == "fault" else signal.SIGABRT)
    assert transcript.read_text() == "x w 20 0E\n"


def test_a_tree_of_processes_works_one_after_the_other(
    programs: Callable[[str, int], Path], bits: int, tmp_path: Path
) -> None:
    program = programs("probe", bits)
    script = f"sleep 0.01; BYTE=2b {program} store && {program} show; date > /dev/null"
    board = REGISTERS.format(time="lockstep", card=PORTS)
    assert said(execute(tmp_path, board, "timeout", "20", "bash", "-c", script)) == ["2b"]


def test_two_programs_at_once_take_turns_cycle_by_cycle(
    programs: Callable[[str, int], Path], tmp_path: Path
) -> None:
    program = programs("probe", 64)
    script = f"{program} threads & {program} show > /dev/null; wait"
    done = execute(tmp_path, REGISTERS.format(time="lockstep", card=PORTS), "bash", "-c", script)
    assert said(done) == ["wrong 0"] * 3


# -- time ------------------------------------------------------------------------------------------


@pytest.mark.parametrize("policy", ["lockstep", "slaved"])
def test_waiting_follows_chip_time_and_costs_no_wall_time(
    probe: Callable[..., Done], policy: str
) -> None:
    lines = said(probe("times", time=policy))
    assert lines == [
        "sleep 3600000001", "usleep 2501", "nanosleep 1000000001", "until 500000",
        "select 0 30000001", "poll 0 700001", "poll 1", "step 1", "time 7", "condition 1",
        "busy loop ends",
    ]  # fmt: skip


@pytest.mark.parametrize("policy", ["lockstep", "slaved"])
@pytest.mark.parametrize("sleeps", [(), ("sleeps",)], ids=["polls only", "sleeps"])
def test_runs_repeat_exactly(
    programs: Callable[[str, int], Path], bits: int, tmp_path: Path, policy: str,
    sleeps: tuple[str, ...],
) -> None:  # fmt: skip
    board = SERVO.format(time=policy, card="")
    transcript = tmp_path / "bus.txt"
    runs = []
    for _ in range(2):
        done = execute(
            tmp_path, board, programs("polls", bits), *sleeps, options=("--transcript", transcript)
        )
        runs.append((said(done), transcript.read_text()))
    assert runs[0] == runs[1]
    if policy == "lockstep" and not sleeps:
        port = load_board(tmp_path / "board.toml").open_port("in process")
        assert [int(line) for line in runs[0][0]] == reset_and_move(Leasing(port, False))


# -- interrupts ------------------------------------------------------------------------------------


@pytest.mark.parametrize("policy", ["lockstep", "slaved"])
@pytest.mark.parametrize(
    ("how", "lines"),
    [
        ("uio", ["interrupt 1", "done 04, signals 0", "again 2"]),
        ("early", ["interrupt 2", "done 04, signals 0", "again 3"]),
        ("poll", ["poll 0", "poll 1", "interrupt 1", "done 04, signals 0", "again 2"]),
        ("select", ["select 1", "interrupt 1", "done 04, signals 0", "again 2"]),
        ("signal", ["done 04, signals 1"]),
        ("sleep", ["nanosleep -1, 1, more than 90 s left: 1", "done 04, signals 1"]),
    ],
)
def test_an_interrupt_arrives(
    programs: Callable[[str, int], Path], tmp_path: Path, policy: str, how: str, lines: list[str]
) -> None:
    sends = 'signal = "SIGIO"' if how in ("signal", "sleep") else ""
    board = SERVO.format(time=policy, card=sends)
    assert said(execute(tmp_path, board, programs("interrupts", 64), how)) == [
        "moving 80", *lines,
    ]  # fmt: skip


@pytest.mark.parametrize(
    ("how", "lines"),
    [
        ("uio", ["interrupt 1", "done 04, signals 0", "again 2"]),
        ("early", ["interrupt 2", "done 04, signals 0", "again 3"]),
        ("poll", ["poll 1", "interrupt 1", "done 04, signals 0", "again 2"]),
        ("select", ["select 1", "interrupt 1", "done 04, signals 0", "again 2"]),
        ("signal", ["done 04, signals 1"]),
    ],
)
def test_an_interrupt_arrives_in_real_time(
    programs: Callable[[str, int], Path], tmp_path: Path, how: str, lines: list[str]
) -> None:
    sends = 'signal = "SIGIO"' if how == "signal" else ""
    board = SERVO.format(time="realtime", card=sends)
    done = execute(tmp_path, board, programs("interrupts", 64), how)
    assert done.returncode == 0
    assert done.stdout.splitlines()[-len(lines) :] == lines  # what comes before hangs on the pace


@pytest.mark.parametrize("policy", ["lockstep", "slaved", "realtime"])
def test_an_interrupt_sends_one_signal_which_is_there_at_the_next_access(
    programs: Callable[[str, int], Path], bits: int, tmp_path: Path, policy: str
) -> None:
    board = SERVO.format(time=policy, card='signal = "SIGIO"')
    assert said(execute(tmp_path, board, programs("interrupts", bits), "count")) == [
        f"{20 * '1'} signals of 20 resets"
    ]


TWO = SERVO.replace(
    "[cards.slot]", '[chips.y]\npart = "LM629N-8"\nclock = "8 MHz"\nplant = "none"\n[cards.slot]'
)
CIRCUIT = """acknowledge = "{access}"
acknowledge_at = 4
sense = "{sense}"
"""


@pytest.mark.parametrize("policy", ["lockstep", "slaved", "realtime"])
@pytest.mark.parametrize(("access", "byte"), [("read", "ff "), ("write", "")])
@pytest.mark.parametrize(
    ("sense", "comes"),
    [("level", [1, 1, 0, 1, 1]), ("edge", [0, 0, 0, 1, 0])],
)
def test_an_interrupt_is_acknowledged_by_an_access(
    programs: Callable[[str, int], Path], tmp_path: Path, policy: str, access: str, byte: str,
    sense: str, comes: list[int],
) -> None:  # fmt: skip
    """A level stays while a chip's line is up, and is kept until then; an edge counts once."""
    board = TWO.format(time=policy, card=CIRCUIT.format(access=access, sense=sense))
    board = board.replace('chips = ["x"]', 'chips = ["x", "y"]').replace('"x.HI"', '"x.HI y.HI"')
    steps = [f"{byte}acknowledged", "cleared", f"{byte}acknowledged", "reset", "enabled again"]
    assert said(execute(tmp_path, board, programs("acknowledge", 64), access)) == [
        f"{step}: {'interrupt' if come else 'none'}"
        for step, come in zip(steps, comes, strict=True)
    ]


@pytest.mark.parametrize("sense", ["level", "edge"])
def test_a_line_of_two_cards_stands_as_long_as_one_of_them_interrupts(
    programs: Callable[[str, int], Path], tmp_path: Path, sense: str
) -> None:
    """The other card's LM629 has interrupted at its reset, and nobody serves it."""
    shared = f'line = "irq5"\nsense = "{sense}"\n'
    board = TWO.format(time="lockstep", card=shared).replace(
        "[[hosts]]",
        '[cards.other]\nbase = 0x350\ndecode = "direct"\nchips = ["y"]\ninterrupt = "y.HI"\n'
        f"{shared}[[hosts]]",
    )
    come = {"level": "interrupt", "edge": "none"}[sense]
    assert said(execute(tmp_path, board, programs("acknowledge", 64), "shared")) == [
        f"own chip served: {come}"
    ]


# -- faults ----------------------------------------------------------------------------------------


@contextmanager
def running(folder: Path, board: str) -> Iterator[subprocess.Popen[str]]:
    (folder / "board.toml").write_text(board)
    process = subprocess.Popen(
        [sys.executable, "-m", "vbus", "run", str(folder / "board.toml")],
        env={**os.environ, "VBUS_RUNTIME": str(folder)}, stdout=subprocess.PIPE, text=True,
    )  # fmt: skip
    try:
        assert process.stdout is not None
        for line in process.stdout:
            if line.startswith("ready"):
                break
        yield process
    finally:
        process.kill()
        process.communicate()


def start_endless(folder: Path, program: Path) -> subprocess.Popen[str]:
    process = subprocess.Popen(
        [sys.executable, "-m", "vbus", "exec", "--link", f"unix:{folder}/x.sock", "--",
         str(program), "endless"],
        stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True,
    )  # fmt: skip
    assert process.stdout is not None
    assert process.stdout.readline() == "polling\n"
    return process


def test_a_board_that_dies_under_a_trapped_access_ends_the_program_clearly(
    programs: Callable[[str, int], Path], bits: int, tmp_path: Path
) -> None:
    with running(tmp_path, REGISTERS.format(time="lockstep", card=PORTS)) as board:
        process = start_endless(tmp_path, programs("probe", bits))
        board.kill()
        _, errors = process.communicate(timeout=60)
    assert process.returncode == 4
    assert "vbus exec: the board is gone" in errors
    assert "it was needed by the instruction at 0x" in errors


def test_a_program_that_is_killed_leaves_a_clean_session_to_the_next(
    programs: Callable[[str, int], Path], bits: int, tmp_path: Path
) -> None:
    program = programs("probe", bits)
    with running(tmp_path, REGISTERS.format(time="lockstep", card=PORTS)):
        process = start_endless(tmp_path, program)
        children = Path(f"/proc/{process.pid}/task/{process.pid}/children").read_text().split()
        os.kill(int(children[0]), signal.SIGKILL)
        process.communicate(timeout=60)
        assert process.returncode == 137
        command = [sys.executable, "-m", "vbus", "exec", "--link", f"unix:{tmp_path}/x.sock", "--"]
        for part, expected in (("store", ""), ("show", "3d\n")):
            done = subprocess.run(
                [*command, str(program), part], env={**os.environ, "BYTE": "3d"},
                capture_output=True, text=True, timeout=60, check=False,
            )  # fmt: skip
            assert (done.returncode, done.stdout) == (0, expected)


def test_without_a_compiler_it_says_what_is_missing(
    programs: Callable[[str, int], Path], tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setenv("XDG_CACHE_HOME", str(tmp_path / "cache"))
    monkeypatch.setenv("PATH", str(tmp_path))
    done = execute(tmp_path, REGISTERS.format(time="lockstep", card=PORTS), "/bin/true")
    assert done.returncode == 1
    assert "there is no gcc; install gcc" in done.stderr


def test_what_several_need_at_once_is_compiled_once(tmp_path: Path) -> None:
    """The compiler is one that notes each call, and takes a while."""
    gcc = tmp_path / "gcc"
    gcc.write_text(
        f'#!/bin/sh\nfor made; do :; done\necho >> {tmp_path}/calls\nsleep 0.3\n: > "$made"\n'
    )
    gcc.chmod(0o755)
    known = {**os.environ, "XDG_CACHE_HOME": str(tmp_path / "cache")}
    known["PATH"] = f"{tmp_path}:{known['PATH']}"
    command = [sys.executable, "-c", "from vbus.cli.hosted import preload; preload.library()"]
    needs = [subprocess.Popen(command, env=known) for _ in range(3)]
    assert [process.wait(PATIENCE) for process in needs] == [0, 0, 0]
    assert (tmp_path / "calls").read_text() == "\n" * 2  # for 64 and for 32 bits


# -- tools -----------------------------------------------------------------------------------------


@pytest.mark.parametrize(("part", "card"), [("ports", PORTS), ("memory", MEMORY)])
def test_under_gdb_the_bus_sees_the_same(
    programs: Callable[[str, int], Path], tmp_path: Path, part: str, card: str
) -> None:
    gdb, program = require("gdb"), programs("probe", 64)
    board, transcript = REGISTERS.format(time="lockstep", card=card), tmp_path / "bus.txt"
    keep: tuple[str | Path, ...] = ("--transcript", transcript)
    plain = execute(tmp_path, board, program, part, options=keep), transcript.read_text()
    done = execute(
        tmp_path, board, gdb, "-batch", "-nx", "-ex", "handle SIGSEGV nostop noprint pass",
        "-ex", "run", "--args", program, part, options=keep,
    )  # fmt: skip
    assert plain[0].returncode == 0
    assert plain[0].stdout in done.stdout
    assert "exited normally" in done.stdout
    assert transcript.read_text() == plain[1] != ""


@pytest.mark.parametrize(("part", "card"), [("ports", PORTS), ("strided", MEMORY + "\nstride = 4")])
def test_with_address_sanitizer_the_bus_sees_the_same(
    programs: Callable[[str, int], Path], tmp_path: Path, monkeypatch: pytest.MonkeyPatch,
    part: str, card: str,
) -> None:  # fmt: skip
    sanitized = tmp_path / "asan"
    command = [require("gcc"), "-O2", "-fsanitize=address", "-o", str(sanitized)]
    if subprocess.run([*command, str(PROGRAMS / "probe.c")], capture_output=True).returncode:
        pytest.skip("needs the address sanitizer's library")
    monkeypatch.setenv("ASAN_OPTIONS", "handle_segv=0:verify_asan_link_order=0:detect_leaks=0")
    board, transcript = REGISTERS.format(time="lockstep", card=card), tmp_path / "bus.txt"
    runs = []
    for program in (programs("probe", 64), sanitized):
        done = execute(tmp_path, board, program, part, options=("--transcript", transcript))
        runs.append((done.returncode, done.stdout, transcript.read_text()))
    assert runs[0] == runs[1]
    assert runs[0][0] == 0


def test_calls_by_number_that_are_not_bent_are_told_or_refused(probe: Callable[..., Done]) -> None:
    done = probe("numbers")
    assert (done.returncode, done.stdout.splitlines()) == (
        0, ["ppoll 0 0", "io_uring -1, as if it were not there 1", "vDSO 0"],
    )  # fmt: skip
    assert done.stderr.splitlines() == [
        "vbus exec: the program calls ppoll by its number: that waits in real time, and chip time"
        " stands still meanwhile; the C library's function of that name follows chip time",
        "vbus exec: io_uring is refused where time is virtual: its waits are the kernel's own",
    ]


@pytest.mark.parametrize("time", ["lockstep", "realtime"])
def test_what_keeps_a_time_of_its_own_is_named_at_the_start(tmp_path: Path, time: str) -> None:
    """A library for io_uring, and the processor's counter; by a script's interpreter too."""
    (tmp_path / "none.c").write_text("int none(void) { return 0; }\n")
    (tmp_path / "own.c").write_text(
        "#include <stdio.h>\n#include <x86intrin.h>\nextern int none(void);\n"
        "int main(void) { return __rdtsc() == 0 ? none() : 0; }\n"
    )
    library = tmp_path / "liburing.so.2"
    compile_c(library, "-shared", "-Wl,-soname,liburing.so.2", tmp_path / "none.c")
    program = compile_c(
        tmp_path / "own", "-O2", tmp_path / "own.c", library, f"-Wl,-rpath,{tmp_path}"
    )
    script = tmp_path / "script"
    script.write_text(f"#!{program} -x\n")
    script.chmod(0o755)
    says = f"vbus exec: warning: {program}"
    real = "which stays real time while the card's time is virtual"
    warnings = [
        f"{says} waits by io_uring (liburing), past the C library: by a clock {real}",
        f"{says} reads the processor's counter (rdtsc), {real}",
    ]
    for command in (program, script):
        done = execute(tmp_path, REGISTERS.format(time=time, card=PORTS), command)
        assert done.returncode == 0
        assert done.stderr.splitlines() == (warnings if time == "lockstep" else [])


@pytest.mark.parametrize(
    ("what", "says"),
    [
        (b"\x04\0\0\0\x04\0\0\0\x04\0\0\0Go\0\0abcd", "is written in Go"),
        (b"/lib/ld-musl-x86_64.so.1\0", "uses musl in place of glibc"),
    ],
)
def test_what_has_another_library_is_named(tmp_path: Path, what: bytes, says: str) -> None:
    """The head of such a program: what it holds follows its one program header, PT_INTERP."""
    head = struct.pack(
        "<16sHHIQQQIHHHHHH", b"\x7fELF\x02\x01\x01", 3, 62, 1, 0, 64, 0, 0, 64, 56, 1, 0, 0, 0
    )
    program = tmp_path / "own"
    program.write_bytes(head + struct.pack("<II", 3, 4).ljust(56, b"\0") + what)
    program.chmod(0o755)
    (warning,) = warnings_for(str(program), True, False)
    assert warning.startswith(f"{program} {says}")
    assert "its port and memory accesses do not reach the card" in warning


@pytest.mark.parametrize("kind", ["static", "static-pie", "set-user-ID"])
def test_a_program_that_no_library_can_enter_is_named(tmp_path: Path, kind: str) -> None:
    (tmp_path / "own.c").write_text("int main(void) { return 7; }\n")
    program = tmp_path / "own"
    if kind == "set-user-ID":
        compile_c(program, tmp_path / "own.c")
        program.chmod(0o4755)
    else:
        compile_c(program, f"-{kind}", tmp_path / "own.c")
    done = execute(tmp_path, REGISTERS.format(time="lockstep", card=PORTS), program)
    assert done.returncode == 7
    reason = "set-user-ID" if kind == "set-user-ID" else "is linked statically"
    assert f"vbus exec: warning: {program} is" in done.stderr
    assert reason in done.stderr
    assert "its port and memory accesses do not reach the card" in done.stderr
