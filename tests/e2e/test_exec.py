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
        (["--board", "BOARD", "--pinmap", "p", "true"], 3, "there is no [pinmaps.p]"),
        (
            ["--board", "BOARD", "--transcript", "/no/t", "true"],
            1,
            "/no/t: cannot be written: No such file",
        ),
        (["--board", "BOARD", "--avr", "mcu=x", "a.elf"], 2, 'unknown key "mcu"'),
        (["--board", "BOARD", "--avr", "mmcu=x", "a.elf", "b"], 2, "--avr takes one firmware file"),
        (["--board", "BOARD", "--avr", "mmcu=x", "a.elf"], 3, "chip time must follow the AVR"),
        (["--link", "unix:/nowhere", "true"], 4, "/nowhere"),
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
    assert 'no board called "other" runs on this machine; running are: bench' in none.stderr


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


# A driver of an LM629 that looks at the profile a fixed time after the start of a move: what it
# finds hangs on when the chip's next sample comes. A careful one does not print that.
SWEPT = """\
import os, sys
from vbus import connect
with connect(os.environ["VBUS_LINK"]) as bus:
    def put(code, *data):
        bus.write(0, code)
        bus.delay(50 * 10**6)
        for at in range(0, len(data), 2):
            for byte in data[at : at + 2]:
                bus.write(1, byte)
            bus.delay(50 * 10**6)
    put(0x1F, 0, 0x2A, 0, 1, 0, 0, 0, 9, 0, 0, 0, 0, 0, 9)
    put(0x01)
    bus.delay(500 * 10**6)
    bus.write(0, 0x08)
    found = []
    for _ in range(2):
        bus.delay(50 * 10**6)
        found += [bus.read(1), bus.read(1)]
    print(found if sys.argv[1:] == ["hasty"] else "done")
"""


def test_a_sweep_tells_what_hangs_on_the_chips_phase(board: Path, tmp_path: Path) -> None:
    board.write_text(BOARD.replace("[chips.x]", 'power_on = "done"\n[chips.x]'))
    script = tmp_path / "host.py"
    script.write_text(SWEPT)
    done = vbus(
        "exec", "--board", board, "--sweep", "4", "--", sys.executable, script, "hasty"
    )  # fmt: skip
    assert (done.returncode, done.stderr) == (1, "")
    assert done.stdout.splitlines() == [
        "chips       exit    stdout  bus     rules   axes",
        "+0us        a       a       a       a       a",
        "+64us       a       b       b       a       a",
        "+128us      a       a       a       a       a",
        "+192us      a       a       a       a       a",
        'stdout b: line 1 is "[0, 0, 0, 6]"; in a it is "[0, 0, 0, 3]"',
        'bus b: line 13 is "x r 1 06"; in a it is "x r 1 03"',
    ]
    done = vbus("exec", "--board", board, "--sweep", "2:100us", "--", "sh", "-c", "echo x; exit 3")
    assert (done.returncode, done.stderr) == (3, "")
    assert done.stdout == "2 runs, the chips up to 100us ahead: one outcome\n"


@pytest.mark.parametrize(
    ("part", "clock", "calls", "said"),
    [
        # The sample timer counts down from 40H, and does so 65 times in a sample (MCP-REG-14).
        ("MCP-1200", "10 MHz", "print(bus.read(0x0F))", ["64", "32"]),
        # The time is the number of cycles since the reset (PMD-CMD-77).
        (
            "MC1141A",
            "25 MHz",
            "bus.delay(4 * 10**8); bus.write(1, 0x3E); bus.delay(10**8); bus.read(0); bus.read(0);"
            " bus.delay(10**8); bus.read(0); print(bus.read(0))",
            ["0", "1"],
        ),
    ],
)
def test_a_sweep_shifts_the_cycle_of_each_family(
    board: Path, tmp_path: Path, part: str, clock: str, calls: str, said: list[str]
) -> None:
    power = f'power_on = "done"\n[chips.x]\npart = "{part}"\nclock = "{clock}"'
    board.write_text(BOARD.replace('[chips.x]\npart = "LM629N-8"\nclock = "8 MHz"', power))
    script = tmp_path / "host.py"
    script.write_text(
        "import os\nfrom vbus import connect\n"
        f'with connect(os.environ["VBUS_LINK"]) as bus:\n    {calls}\n'
    )
    done = vbus("exec", "--board", board, "--sweep", "2", "--", sys.executable, script)
    assert (done.returncode, done.stderr) == (1, "")
    assert f'stdout b: line 1 is "{said[1]}"; in a it is "{said[0]}"' in done.stdout.splitlines()


@pytest.mark.parametrize(
    ("words", "message"),
    [
        (["--board", "BOARD", "--sweep", "1"], "it takes two runs at least"),
        (["--board", "BOARD", "--sweep", "x"], "Invalid value for --sweep"),
        (["--board", "BOARD", "--sweep", "4:3"], "is no duration"),
        (["--board", "BOARD", "--sweep", "4", "--journal", "x"], "--sweep goes without records"),
        (["--link", "unix:/nowhere", "--sweep", "4"], "--sweep goes with --board"),
    ],
)
def test_a_sweep_that_cannot_be_is_refused(board: Path, words: list[str], message: str) -> None:
    done = vbus(
        "exec", *(str(board) if word == "BOARD" else word for word in words), "--", "true"
    )  # fmt: skip
    assert done.returncode == 2
    assert message in done.stderr


def test_a_sweep_needs_virtual_time(board: Path) -> None:
    board.write_text(BOARD.replace("lockstep", "realtime"))
    done = vbus("exec", "--board", board, "--sweep", "4", "--", "true")
    assert done.returncode == 3
    assert "in real time" in done.stderr


@pytest.mark.parametrize(
    ("part", "clock", "ahead"),
    [
        ("LM628N-6", "6 MHz", "341.333333us"),
        ("LM629N-8", "8 MHz", "256us"),
        ("MCP-1200", "8 MHz", "520us"),
        ("MC1141A", "25 MHz", "542.72us"),
    ],
)
def test_a_sweep_knows_the_cycle_of_each_family(
    board: Path, part: str, clock: str, ahead: str
) -> None:
    """2048 clocks, 64 x 65 after reset, 13568: LM-TRJ-17, MCP-REG-14, MCP-REG-15, PMD-CYC-2."""
    board.write_text(BOARD.replace("LM629N-8", part).replace("8 MHz", clock))
    done = vbus("exec", "--board", board, "--sweep", "2", "--", "true")
    assert (done.returncode, done.stderr) == (0, "")
    assert done.stdout == f"2 runs, the chips up to {ahead} ahead: one outcome\n"


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
