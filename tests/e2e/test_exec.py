"""``vbus exec``: a program beside a board of its own."""

import os
import signal
import subprocess
import sys
from pathlib import Path

import pytest

from tests.e2e.command import start, vbus

BOARD = """\
[board]
name = "bench"
time = "lockstep"
[chips.x]
part = "LM629N-8"
clock = "8 MHz"
plant = "none"
[cards.slot]
base = 0x340
decode = "direct"
chips = ["x"]
[[hosts]]
transport = "unix:$VBUS_RUNTIME/other.sock"
[[hosts]]
transport = "unix:$VBUS_RUNTIME/x.sock"
card = "slot"
"""
HELLO = """\
import os
from vbus import connect
with connect(os.environ["VBUS_LINK"]) as bus:
    print(f"{bus.read(0):02X}")
    bus.write(1, 0)
"""


@pytest.fixture
def board(tmp_path: Path) -> Path:
    path = tmp_path / "board.toml"
    path.write_text(BOARD)
    return path


def test_a_program_finds_its_board_and_its_transcript_is_kept(board: Path, tmp_path: Path) -> None:
    done = vbus(
        "exec", "--board", board, "--transcript", tmp_path / "bus.txt", "--",
        sys.executable, "-c", HELLO,
    )  # fmt: skip
    assert (done.returncode, done.stdout) == (0, "00\n")
    lines = (tmp_path / "bus.txt").read_text().splitlines()
    assert lines[0] == "x r 0 00"
    assert "x w 1 00" in lines


def test_the_exit_code_is_the_programs(board: Path) -> None:
    assert vbus("exec", "--board", board, "--", "sh", "-c", "exit 42").returncode == 42
    assert vbus("exec", "--board", board, "--", "sh", "-c", "kill -9 $$").returncode == 137


def test_runs_beside_each_other_do_not_meet(board: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.delenv("VBUS_RUNTIME")
    nap = [start("exec", "--board", board, "--", "sleep", "1") for _ in range(2)]
    assert [process.communicate(timeout=60)[1] for process in nap] == ["", ""]
    assert [process.returncode for process in nap] == [0, 0]


def test_an_interrupt_is_passed_on(board: Path) -> None:
    process = start(
        "exec",
        "--board",
        board,
        "--",
        "sh",
        "-c",
        "trap 'exit 9' TERM; echo up; while :; do :; done",
    )
    assert process.stdout is not None
    assert process.stdout.readline() == "up\n"
    process.send_signal(signal.SIGTERM)
    process.communicate(timeout=60)
    assert process.returncode == 9


@pytest.mark.parametrize(
    ("arguments", "code", "message"),
    [
        (["true"], 2, "name either a board file with --board or a link with --link"),
        (["--board", "b", "--link", "l", "true"], 2, "name either a board file"),
        (["--board", "BOARD", "/no/program"], 127, "/no/program: there is no such program"),
        (["--board", "none.toml", "true"], 3, "none.toml: cannot be read"),
        (["--board", "BOARD", "--pinmap", "p", "true"], 2, "there is no [pinmaps.p]"),
        (
            ["--board", "BOARD", "--transcript", "/no/t", "true"],
            1,
            "/no/t: cannot be written: No such file",
        ),
        (["--board", "BOARD", "--avr", "mcu=x", "a.elf"], 2, 'unknown key "mcu"'),
        (["--board", "BOARD", "--avr", "mmcu=x", "a.elf", "b"], 2, "--avr takes one firmware file"),
        (["--board", "BOARD", "--avr", "mmcu=x", "a.elf"], 3, "chip time must follow the AVR"),
        (["--link", "unix:/nowhere", "true"], 4, "/nowhere"),
        (["--link", "l", "--pinmap", "p", "true"], 2, "--pinmap goes with --board; a link of a"),
        (["--join", "b", "--cpu", "cortex-m3", "a.elf"], 2, "--cpu goes with --board"),
    ],
)
def test_what_is_wrong_is_said(board: Path, arguments: list[str], code: int, message: str) -> None:
    done = vbus("exec", *(str(board) if word == "BOARD" else word for word in arguments))
    assert done.returncode == code
    assert message in done.stderr


def test_a_board_that_dies_ends_a_program_that_uses_it(board: Path, tmp_path: Path) -> None:
    """The program is inside a bus cycle, or on its way to one."""
    script = tmp_path / "host.py"
    script.write_text(HELLO.replace("    bus.write(1, 0)\n", "    while True: bus.read(0)\n"))
    process = start("run", board, "--json")
    assert process.stdout is not None
    process.stdout.readline()
    link = f"unix:{os.environ['VBUS_RUNTIME']}/x.sock"
    host = subprocess.Popen(
        [sys.executable, "-u", script],
        env={**os.environ, "VBUS_LINK": link},
        stdout=subprocess.PIPE,
        stderr=subprocess.PIPE,
        text=True,
    )
    assert host.stdout is not None
    host.stdout.readline()
    process.kill()
    process.communicate()
    _, errors = host.communicate(timeout=60)
    assert host.returncode == 1
    assert "closed" in errors


def test_a_running_board_is_joined_by_its_name(board: Path) -> None:
    """Of its links the one with the card is taken: there is something to trap."""
    server = start("run", board, "--json")
    assert server.stdout is not None
    server.stdout.readline()
    try:
        done = vbus("exec", "--join", "bench", "--", sys.executable, "-c", HELLO)
        card = vbus("exec", "--join", "bench", "--", "sh", "-c", "echo $VBUS_LINK; env")
        none = vbus("exec", "--join", "other", "--", "true")
    finally:
        server.terminate()
        server.communicate()
    assert (done.returncode, done.stdout) == (0, "00\n")
    assert card.stdout.splitlines()[0].endswith("/x.sock")
    assert "VBUS_EXEC=policy=lockstep" in card.stdout
    assert none.returncode == 4
    assert 'no board called "other" runs on this machine; "vbus ls" shows which run' in none.stderr


def test_a_board_without_a_byte_link_cannot_be_joined(board: Path) -> None:
    board.write_text(BOARD.replace("[[hosts]]\n", '[[hosts]]\nprotocol = "text"\n'))
    server = start("run", board, "--json")
    assert server.stdout is not None
    server.stdout.readline()
    try:
        done = vbus("exec", "--join", "bench", "--", "true")
    finally:
        server.terminate()
        server.communicate()
    assert done.returncode == 4
    assert "bench has no link a program could join by" in done.stderr
    assert "other.sock (text)" in done.stderr


def test_the_summary_of_broken_rules_can_be_left_out(board: Path) -> None:
    program = ["--", sys.executable, "-c", HELLO]
    told = vbus("exec", "--board", board, *program)
    quiet = vbus("exec", "--board", board, "--no-summary", *program)
    assert "vbus: error: x: " in told.stderr
    assert (told.returncode, quiet.returncode, quiet.stderr) == (0, 0, "")


RECORDED = BOARD.replace("[chips.x]", "{record}\n[chips.x]")
FILES = ("journal", "report", "coverage", "wave")


@pytest.mark.parametrize("way", ["options", "board file"])
def test_one_command_leaves_everything_behind(board: Path, tmp_path: Path, way: str) -> None:
    """And the journal replays to the same end."""
    names = {"journal": "run.vbj", "report": "run.json", "coverage": "run.txt", "wave": "run.vcd"}
    paths = {what: tmp_path / name for what, name in names.items()}
    given: list[str | Path] = []
    record = ""
    if way == "options":
        given = [word for what in FILES for word in (f"--{what}", paths[what])]
    else:
        kept = "".join(f'{what} = "{paths[what]}"\n' for what in FILES[:3])
        record = f'[record]\n{kept}[waves.all]\nfile = "{paths["wave"]}"\n'
    board.write_text(RECORDED.format(record=record))
    done = vbus("exec", "--board", board, *given, "--", sys.executable, "-c", HELLO)
    assert (done.returncode, done.stdout) == (0, "00\n")
    lines = done.stderr.splitlines()
    assert lines[:4] == [f"vbus: {what}: {paths[what]}" for what in FILES]
    assert any(line.startswith("vbus: error: x: lm628.") for line in lines)
    assert lines[-1] == (
        "vbus: x: ended at 0 counts, did not move, it has no filter: all coefficients are 0 until"
        " LFIL and UDF"
    )
    assert all(path.stat().st_size > 0 for path in paths.values())
    assert vbus("replay", paths["journal"]).returncode == 0


def test_records_are_for_a_board_of_its_own() -> None:
    done = vbus("exec", "--link", "unix:/nowhere", "--wave", "x.vcd", "--", "true")
    assert done.returncode == 2
    assert "--wave goes with --board" in done.stderr


def test_metrics_are_served_while_the_program_runs(board: Path) -> None:
    done = vbus("exec", "--board", board, "--metrics", "127.0.0.1:0", "--", "true")
    assert done.returncode == 0
    assert done.stderr.startswith("vbus: metrics: http://127.0.0.1:")


def test_equal_polls_of_a_journal_are_one_line(board: Path, tmp_path: Path) -> None:
    script = HELLO.replace("bus.write(1, 0)", "_ = [bus.read(0) for _ in range(49)]")
    journal = tmp_path / "run.vbj"
    vbus("exec", "--board", board, "--journal", journal, "--", sys.executable, "-c", script)
    lines = vbus("explain", journal).stdout.splitlines()
    assert lines[1:] == ["1us x RDSTAT 00H -  [LM-CMD-23]  x 50, 0.049 ms"]


@pytest.mark.parametrize(
    ("words", "example"),
    [
        (["exec"], "  vbus exec --board board.toml -- ./host          finds the board's link"),
        (["snap", "bisect"], "  or a pin's level                        x.HI=1"),
    ],
)
def test_help_prints_examples_as_written(words: list[str], example: str) -> None:
    lines = vbus(*words, "--help").stdout.splitlines()
    assert any(line.startswith(example) for line in lines)


POLLS = """\
import os, sys
from vbus import connect
with connect(os.environ["VBUS_LINK"]) as bus:
    bus.delay("2 ms")
    bus.write(0, 0x00)
    loop = compile(sys.argv[1], "loop", "exec")
    while True:
        exec(loop)
"""


@pytest.mark.parametrize(
    ("limit", "loop", "said"),
    [
        (
            "100 ms",
            "bus.read(0)",
            "it polled 10000 times and read nothing new, and nothing on the board",
        ),
        ("4 ms", "bus.write(0, 0); bus.read(0)", "it was not done after 0.004 s of chip time"),
        ("100 ms", "bus.delay('10 ms'); bus.echo()", "it was not done after 0.1 s of chip time"),
    ],
)
def test_a_program_that_hangs_is_ended_by_a_limit(
    board: Path, limit: str, loop: str, said: str
) -> None:
    program = ("--", sys.executable, "-c", POLLS, loop)
    done = vbus("exec", "--board", board, "--no-summary", "--limit", limit, *program)
    assert done.returncode == 137
    first, state, *rest = done.stderr.splitlines()
    assert first.startswith(f"vbus: the program hangs: {said}")
    assert state.startswith("vbus: x has desired 0.0, target 0, ")
    assert rest[0] == "vbus: commands before:"
    assert rest[1].startswith("vbus:     ")
    assert "x RESET" in rest[1]


def test_a_program_that_ends_before_its_limit_is_left_alone(board: Path) -> None:
    assert vbus("exec", "--board", board, "--limit", "9 s", "--", "true").returncode == 0


def test_a_limit_is_for_a_board_of_its_own() -> None:
    done = vbus("exec", "--link", "unix:/nowhere", "--limit", "1 s", "--", "true")
    assert done.returncode == 2
    assert "only a board that ends with the program can end it" in done.stderr
