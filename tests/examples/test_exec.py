"""The plain binaries under ``vbus exec``, run as their READMEs say."""

import subprocess
from pathlib import Path

import pytest

from tests.examples.boards import EXAMPLES, expected, vbus
from tests.left_out import require

SOURCES = {
    "lm629_portio": ["main.c", "lm629_card.c"],
    "mcp1200_mmio": ["main.c", "../mcp1200_c/mcp1200_driver.c", "-I../mcp1200_c"],
    "mc1241a_isa_interrupt": [
        "main.c",
        "../mc1241a_isa_c/mc1241a_driver.c",
        "-I../mc1241a_isa_c",
    ],
}


def compiled(example: str, program: Path, *flags: str) -> Path:
    """Compile an example for the real computer: no header and no library of vbus."""
    done = subprocess.run(
        [require("cc"), "-std=gnu99", "-O2", "-Wall", "-Wextra", "-Werror", *flags, "-o",
         str(program), *SOURCES[example]],
        cwd=EXAMPLES / example, capture_output=True, text=True,
    )  # fmt: skip
    assert done.returncode == 0, done.stderr
    return program


@pytest.mark.parametrize("example", SOURCES)
def test_a_plain_binary_does_the_same_on_every_run(example: str, tmp_path: Path) -> None:
    program = compiled(example, tmp_path / "program")
    assert b"vbus" not in program.read_bytes()
    board = EXAMPLES / example / "board.toml"
    transcripts = []
    for turn in ("first", "second"):
        transcript = tmp_path / f"{turn}.txt"
        done = subprocess.run(
            vbus("exec", "--board", str(board), "--transcript", str(transcript), "--",
                 str(program)),
            capture_output=True, text=True, timeout=60,
        )  # fmt: skip
        assert (done.returncode, done.stderr) == (0, "")  # no violation either
        assert done.stdout == expected(example)
        transcripts.append(transcript.read_text())
    assert transcripts[0] == transcripts[1]
    assert len(transcripts[0].splitlines()) > 50


def test_a_card_with_a_reset_latch_beside_its_chip(tmp_path: Path) -> None:
    done = subprocess.run(
        [require("cc"), "-std=gnu99", "-O2", "-Wall", "-Wextra", "-Werror", "-I../mcp1200_c", "-o",
         str(tmp_path / "program"), "vme_card.c", "../mcp1200_c/mcp1200_driver.c"],
        cwd=EXAMPLES / "mcp1200_mmio", capture_output=True, text=True,
    )  # fmt: skip
    assert done.returncode == 0, done.stderr
    board = EXAMPLES / "mcp1200_mmio" / "vme_card.toml"
    done = subprocess.run(
        vbus("exec", "--board", str(board), "--", str(tmp_path / "program")),
        capture_output=True, text=True, timeout=60,
    )  # fmt: skip
    assert (done.returncode, done.stderr) == (0, "")
    assert done.stdout.splitlines() == [
        "latch 00h", "status F8h, latch 01h", "moved, position reached",
        "position 0 after the reset",
    ]  # fmt: skip


def test_it_can_be_watched_in_gdb(tmp_path: Path) -> None:
    """As the page "Bring your driver" says: each trapped access is a signal gdb passes on."""
    gdb = require("gdb")
    program = compiled("lm629_portio", tmp_path / "program", "-g", "-O0")
    done = subprocess.run(
        vbus("exec", "--board", str(EXAMPLES / "lm629_portio" / "board.toml"), "--",
             gdb, "-nx", "-q", "-batch", "-ex", "handle SIGSEGV nostop noprint pass",
             "-ex", "break lm629_load_filter", "-ex", "run", "-ex", "print filter->kd",
             "-ex", "delete", "-ex", "continue", str(program)),
        capture_output=True, text=True, timeout=60,
    )  # fmt: skip
    assert "$1 = 2000\n" in done.stdout, done.stdout + done.stderr
    last = expected("lm629_portio").splitlines()[1:]
    assert [line for line in done.stdout.splitlines() if line in last] == last


def test_the_address_sanitizer_finds_what_it_should_and_nothing_else(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setenv("ASAN_OPTIONS", "handle_segv=0:verify_asan_link_order=0:detect_leaks=0")
    program = compiled("lm629_portio", tmp_path / "program", "-fsanitize=address")
    command = vbus("exec", "--board", str(EXAMPLES / "lm629_portio" / "board.toml"), "--")
    done = subprocess.run([*command, str(program)], capture_output=True, text=True, timeout=60)
    assert (done.returncode, done.stderr) == (0, "")
    assert done.stdout == expected("lm629_portio")

    (tmp_path / "wrong.c").write_text(
        "#include <stdlib.h>\n#include <sys/io.h>\nint main(void)\n{\n"
        "    volatile unsigned char *copy = malloc(1);\n    ioperm(0x340, 2, 1);\n"
        "    copy[inb(0x340) & 0x80 ? 1 : 0] = 0;\n    return 0;\n}\n"
    )
    subprocess.run(
        [require("cc"), "-g", "-fsanitize=address", "-o", "wrong", "wrong.c"],
        cwd=tmp_path, check=True,
    )  # fmt: skip
    done = subprocess.run(
        [*command, str(tmp_path / "wrong")], capture_output=True, text=True, timeout=60
    )
    assert done.returncode != 0
    assert "heap-buffer-overflow" in done.stderr


TEN = {("thread", "lockstep"), ("signal", "slaved")}
WAITS = {
    "thread": ("board.toml", "3 interrupts"),
    "signal": ("signal.toml", "each sleep ended by the signal"),
    "timer": ("board.toml", "looked more than nine times"),
}


@pytest.mark.parametrize("policy", ["lockstep", "slaved", "realtime"])
@pytest.mark.parametrize("name", WAITS)
def test_runs_of_a_driver_that_waits_are_the_same(tmp_path: Path, name: str, policy: str) -> None:
    """In real time what they print is, but not when the cycles come.

    What could come at another moment makes ten runs, a thread in one virtual time and a signal in
    the other.
    """
    folder = EXAMPLES / "lm629_interrupts"
    done = subprocess.run(
        [require("cc"), "-std=gnu99", "-O2", "-Wall", "-Wextra", "-Werror", "-I../lm629_portio",
         "-o", str(tmp_path / name), f"{name}.c", "axis.c", "../lm629_portio/lm629_card.c",
         "-lpthread"],
        cwd=folder, capture_output=True, text=True,
    )  # fmt: skip
    assert done.returncode == 0, done.stderr
    board, last = WAITS[name]
    text = (folder / board).read_text().replace('"lockstep"', f'"{policy}"')
    (tmp_path / "board.toml").write_text(text)
    transcripts = set()
    for _ in range(1 if policy == "realtime" else 10 if (name, policy) in TEN else 3):
        done = subprocess.run(
            vbus("exec", "--board", str(tmp_path / "board.toml"), "--transcript",
                 str(tmp_path / "bus.txt"), "--", str(tmp_path / name)),
            capture_output=True, text=True, timeout=60,
        )  # fmt: skip
        assert (done.returncode, done.stderr) == (0, "")
        moves, _, told = done.stdout.rpartition(last)
        if (name, policy) != ("timer", "realtime"):  # a busy machine looks less often
            assert (moves, told) == (expected("lm629_interrupts"), "\n")
        assert done.stdout.startswith(expected("lm629_interrupts"))
        transcripts.add((tmp_path / "bus.txt").read_text())
    assert len(transcripts) == 1
