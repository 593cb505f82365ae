"""``vbus campaign``: a program in many worlds, in each of which one thing is broken."""

import json
import subprocess
import sys
from pathlib import Path
from textwrap import indent

import pytest

from tests.boards import BENCH
from tests.e2e.command import vbus
from tests.left_out import require
from tests.waiting import until

BOARD = BENCH.replace("/x", "/other.sock")

# It looks at the profile a fixed time after the start of a move: what it finds hangs on when the
# chip's next sample comes.
HASTY = """\
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
    print(found)
"""
# It loads kp, and reads nothing back; with an argument it looks at the status after each write.
LOADS = """\
import os, sys
from vbus import connect
with connect(os.environ["VBUS_LINK"]) as bus:
    for address, data in ((0, 0x1E), (1, 0), (1, 8), (1, 1), (1, 44), (0, 4)):
        bus.write(address, data)
        bus.delay("100us")
        if sys.argv[1:] and bus.read(0) & 2:
            sys.exit(f"{data:02X}h was no command")
"""

# One thread loads the gain that the other has worked out, and trusts that three looks at the status
# take longer than one.
RACE = r"""
#include <pthread.h>
#include <stdio.h>
#include <sys/io.h>

static volatile int gain;

static void *works_out(void *unused)
{
    inb(0x300);
    gain = 44;
    return unused;
}

int main(void)
{
    pthread_t other;
    int turn;

    ioperm(0x300, 2, 1);
    pthread_create(&other, NULL, works_out, NULL);
    for (turn = 0; turn < 3; turn++)
        inb(0x300);
    printf("gain %d\n", gain);
    pthread_join(other, NULL);
    return 0;
}
"""
CARD = """\
card = "slot"
[cards.slot]
base = 0x300
decode = "direct"
chips = ["x"]
"""


@pytest.fixture
def board(tmp_path: Path) -> Path:
    path = tmp_path / "board.toml"
    path.write_text(BOARD)
    return path


def script(board: Path, text: str) -> Path:
    """Return a program beside the board."""
    path = board.with_name("host.py")
    path.write_text(text)
    return path


def test_a_phase_at_which_a_program_says_something_else_is_silent(board: Path) -> None:
    host = script(board, HASTY)
    done = vbus(
        "campaign", "--board", board, "--only", "phase", "--phases", "4", "--",
        sys.executable, host,
    )  # fmt: skip
    assert done.returncode == 1
    table = [line.split() for line in done.stdout.splitlines()]
    assert table[1] == ["phase", "0", "2", "0", "0", "1", "3", "0", "0", "%"]
    assert done.stdout.splitlines()[2:] == [
        "silent: place in the sample, the chips 64us ahead",
        '    line 1 it says is "[0, 0, 0, 6]", not "[0, 0, 0, 3]"',
        f"    vbus campaign --world phase:+64us:ahead --board {board} -- {sys.executable} {host}",
    ]
    assert done.stderr.endswith("processes\n")
    line = done.stdout.splitlines()[-1].split()
    again = vbus(*line[1:])
    assert (again.returncode, again.stdout) == (0, "[0, 0, 0, 6]\n")
    assert again.stderr.splitlines()[0] == "vbus: world: the chips 64us ahead"


def test_a_campaign_goes_on_is_the_same_each_time_and_has_a_baseline(
    board: Path, tmp_path: Path
) -> None:
    host = script(board, LOADS)
    results = [tmp_path / name for name in ("a.json", "b.json")]
    words = ("campaign", "--board", board, "--only", "cycle", "--seed", "7")
    program = ("--", sys.executable, host)
    short = vbus(*words, "--worlds", "2", "--json", results[0], *program)
    assert "2 runs in" in short.stderr
    whole = vbus(*words, "--worlds", "6", "--json", results[0], *program)
    assert "4 runs in" in whole.stderr
    once = vbus(*words, "--worlds", "6", "-j", "3", "--json", results[1], *program)
    assert whole.stdout == once.stdout
    assert results[0].read_bytes() == results[1].read_bytes()
    found = json.loads(results[0].read_text())
    assert len(found["results"]) == 6
    assert {"silent", "silent, with a finding"} & {r["verdict"] for r in found["results"].values()}
    assert whole.returncode == 1
    excused = vbus(
        *words, "--worlds", "6", "--json", results[1], "--baseline", results[0],
        "--junit", tmp_path / "c.xml", "--page", tmp_path / "c.html", *program,
    )  # fmt: skip
    assert (excused.returncode, "0 runs in" in excused.stderr) == (0, True)
    assert 'failures="0"' in (tmp_path / "c.xml").read_text()
    assert "vbus campaign --world cycle:x." in (tmp_path / "c.html").read_text()


def test_a_driver_that_looks_detects_what_a_driver_that_does_not_look_passes_over(
    board: Path,
) -> None:
    host = script(board, LOADS)
    world = ("campaign", "--board", board, "--world", "cycle:x.1:flip7")
    done = vbus(*world, "--", sys.executable, host)
    assert done.returncode == 0
    assert "vbus: silent, with a finding: x status byte is" in done.stderr
    done = vbus(*world, "--", sys.executable, host, "looks")
    assert done.returncode == 1
    assert "vbus: detected: exit code 1: 1Eh was no command" in done.stderr
    says = script(board, "print('ready')\n" + LOADS.replace("sys.exit(", "print("))
    done = vbus(*world, "--failed", "no command", "--", sys.executable, says, "looks")
    assert done.returncode == 1
    assert "vbus: detected: exit code 1" in done.stderr


def test_a_world_that_does_not_come_about_is_told(board: Path) -> None:
    host = script(board, LOADS)
    done = vbus(
        "campaign", "--board", board, "--world", "cycle:x.99:lost", "--", sys.executable, host
    )
    assert done.returncode == 0
    assert "no effect: nothing was broken: the run ended before cycle 99" in done.stderr


def test_results_are_of_one_function_and_of_its_modules(board: Path) -> None:
    module = board.with_name("gains.py")
    module.write_text("KP = 44\n")
    host = script(
        board,
        "import gains\n"
        "def loads(bus, check=False):\n"
        "    for address, data in ((0, 0x1E), (1, 0), (1, 8), (1, 1), (1, gains.KP), (0, 4)):\n"
        "        bus.write(address, data)\n"
        "        bus.delay('100us')\n"
        "        assert not (check and bus.read(0) & 2)\n"
        "def looks(bus):\n"
        "    loads(bus, True)\n",
    )
    results = board.with_name("a.json")

    def runs(name: str, only: str = "cycle") -> str:
        done = vbus("campaign", "--board", board, "--host", f"{host}:{name}", "--only", only,
                    "--worlds", "6", "--json", results)  # fmt: skip
        return done.stderr.partition(" runs in ")[0]

    assert [runs("loads"), runs("loads"), runs("looks"), runs("loads")] == [
        "vbus: 6", "vbus: 0", "vbus: 6", "vbus: 6",
    ]  # fmt: skip
    keys = json.loads(results.read_text())["keys"]
    assert (keys != [], runs("loads", "phase")) == (True, "vbus: 6")
    # What other dimensions have come to stays in a baseline.
    assert json.loads(results.read_text())["keys"] == keys
    module.write_text("KP = 45\n")
    assert runs("loads") == "vbus: 6"


def test_processes_of_a_campaign_die_with_it(board: Path) -> None:
    """However it ends: a worker that waits for work has no pipe that closes."""
    host = script(board, "def host(bus):\n bus.reads(0, 200)\n")
    words = [sys.executable, "-m", "vbus", "campaign", "-j", "2", "--board", str(board), "--host"]
    null = subprocess.DEVNULL
    with subprocess.Popen([*words, f"{host}:host"], stdout=null, stderr=null) as campaign:
        listed = Path(f"/proc/{campaign.pid}/task/{campaign.pid}/children")
        until(lambda: len(listed.read_text().split()) == 2, "the processes of the campaign")
        workers = [Path(f"/proc/{pid}") for pid in listed.read_text().split()]
        campaign.kill()
    until(lambda: not any(worker.exists() for worker in workers), "their end")


@pytest.mark.parametrize(
    ("words", "message"),
    [
        (["--board", "b.toml", "--", "pytest", "tests"], "each test says its board"),
        (["--board", "b.toml", "--", "python3", "-m", "pytest"], "each test says its board"),
        (["--", "python3", "test_x.py"], "name a board with --board, or run: vbus campaign --"),
    ],
)
def test_pytest_is_known_by_its_words(words: list[str], message: str) -> None:
    done = vbus("campaign", *words)
    assert done.returncode == 2
    assert message in done.stderr


def test_a_program_whose_threads_are_right_in_one_order_alone_is_found(board: Path) -> None:
    compiler = require("gcc")
    board.write_text(BOARD + CARD)
    source, race = board.with_name("race.c"), board.with_name("race")
    source.write_text(RACE)
    subprocess.run([compiler, "-o", str(race), str(source), "-lpthread"], check=True)
    words = ("campaign", "--board", board, "--only", "threads", "--seed", "3")
    done = vbus(*words, "--", race)
    assert done.returncode == 1
    assert vbus(*words, "-j", "1", "--", race).stdout == done.stdout
    table = [line.split() for line in done.stdout.splitlines()]
    assert (table[1][0], table[1][6]) == ("threads", "8")
    assert 'line 1 it says is "gain 0", not "gain 44"' in done.stdout
    again = vbus(*done.stdout.splitlines()[-1].split()[1:])
    assert again.stdout == "gain 0\n"
    assert "in the order of seed" in again.stderr


def test_a_fault_of_links_is_tried_where_its_run_repeats(board: Path) -> None:
    host = script(board, "import sys\ntry:\n" + indent(LOADS, " ")
                  + "except OSError as error:\n sys.exit(str(error))\n")  # fmt: skip
    world = ("campaign", "--board", board, "--world", "fault:host0@150000000:answer_lost")
    done = vbus(*world, "--", sys.executable, host, "looks")
    assert done.returncode == 1
    assert "no reply to READ" in done.stderr
    # A function's own waits for an answer need no clock.
    reads = script(board, "def host(bus):\n for _ in range(400): bus.read(0)")
    done = vbus(*world, "--host", f"{reads}:host")
    assert done.returncode == 1
    assert "detected: exit code 1: TransportError: board bench: no reply to READ4" in done.stderr
    only = ("campaign", "--board", board, "--only", "fault", "--worlds", "1")
    done = vbus(*only, "--", sys.executable, host)
    assert "try one by --world fault:host0@" in done.stdout


@pytest.mark.parametrize(
    ("words", "code", "message"),
    [
        (["--only", "cycles"], 2, 'did you mean "cycle"'),
        (["--world", "cycle:x.1"], 2, "DIMENSION:WHERE:HOW"),
        (["--world", "cycle:y.1:lost"], 2, "y"),
        (["--world", "threads:program:order7"], 3, "only threads of a program with a card"),
        (["--journal", "x"], 2, "--journal goes with --world"),
        (["--json", "x", "--world", "cycle:x.1:lost"], 2, "--json goes with a campaign"),
        (["--seed", "0", "--world", "cycle:x.1:lost"], 2, "--seed goes with a campaign"),
        (["-j", "2", "--world", "cycle:x.1:lost"], 2, "--jobs goes with a campaign"),
        (["--baseline", "x", "--world", "cycle:x.1:lost"], 2, "--baseline goes with a campaign"),
        (["--for", "0m"], 2, "no run ends in no time"),
        (["--only", "cycle", "--phases", "4"], 2, "--phases is for the dimension phase"),
        (["--json", "x", "--baseline", "./x"], 2, "x: this campaign reads it"),
        (["--page", "host.py"], 2, "give what is written another file"),
        (["--for", "5 weeks"], 2, "is no duration"),
        (["--for", "1us"], 1, "no world was tried: --for was over after the reference runs"),
        (["--only", "threads"], 1, "no world was tried: none applies here"),
        (["--baseline", "host.py"], 1, "is no file of vbus campaign --json"),
    ],
)
def test_what_cannot_be_is_refused(
    board: Path, words: list[str], code: int, message: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    host = script(board, LOADS)
    monkeypatch.chdir(board.parent)
    done = vbus("campaign", "--board", board, *words, "--", sys.executable, host)
    assert done.returncode == code
    assert message in done.stderr


def test_a_reference_run_that_fails_or_does_not_repeat_is_refused(board: Path) -> None:
    done = vbus("campaign", "--board", board, "--", "sh", "-c", "echo x; exit 3")
    assert (done.returncode, done.stdout) == (1, "x\n")
    assert "the reference run, with nothing broken, fails: it ends with exit code 3" in done.stderr
    done = vbus("campaign", "--board", board, "--", "sh", "-c", "echo $$x")
    assert done.returncode == 1
    assert "two runs with nothing broken differ" in done.stderr
    board.write_text(BOARD.replace("lockstep", "realtime"))
    done = vbus("campaign", "--board", board, "--", "true")
    assert done.returncode == 3
    assert "in real time" in done.stderr
