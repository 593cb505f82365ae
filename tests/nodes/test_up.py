"""``vbus up``: a machine of real processes, from its start to its end."""

import json
import os
import re
import signal
import socket
import subprocess
import sys
from collections.abc import Iterator
from contextlib import ExitStack
from pathlib import Path

import pytest

from tests.nodes.four_chips import BOARD, scenario
from tests.nodes.processes import patient
from tests.waiting import PATIENCE, until
from vbus.board.config import read_board_text
from vbus.core.errors import ConfigError, TransportError
from vbus.core.kernel import US
from vbus.network.session import close_session, free_endpoint, open_session
from vbus.nodes.machine import Machine
from vbus.nodes.plan import pins_of, plan_of
from vbus.nodes.scenario import read_scenario
from vbus.serve.nodes.processes import Meeting, Process, meeting_of, processes_of


def sharing(board: str, **processes: str) -> str:
    """Return the board with the nodes of each name in one process."""
    for process, nodes in processes.items():
        for node in nodes:
            board = board.replace(f"[nodes.{node}]", f'[nodes.{node}]\nprocess = "{process}"')
    return board


SHARED = sharing(BOARD, left="ac")
TWO = sharing(BOARD, left="ac", right="bd")


class Up:
    """A folder with a machine, and ``vbus up`` running it."""

    def __init__(self, folder: Path) -> None:
        self.folder = folder
        self.output = folder / "output.txt"
        self.environment = {**os.environ, "VBUS_RUNTIME": str(folder / "run")}
        self.process: subprocess.Popen[bytes] | None = None

    def start(self, board: str, *options: str) -> subprocess.Popen[bytes]:
        (self.folder / "four.toml").write_text(patient(board))
        apart = "--json" in options
        with self.output.open("wb") as output, self.output.with_suffix(".err").open("wb") as errors:
            self.process = subprocess.Popen(
                [sys.executable, "-m", "vbus", "up", "four.toml", *options],
                cwd=self.folder,
                env=self.environment,
                stdin=subprocess.DEVNULL,
                stdout=output,
                stderr=errors if apart else subprocess.STDOUT,
            )
        return self.process

    def vbus(self, *arguments: str) -> subprocess.CompletedProcess[str]:
        return subprocess.run(
            [sys.executable, "-m", "vbus", *arguments],
            cwd=self.folder,
            env=self.environment,
            capture_output=True,
            text=True,
            timeout=PATIENCE,
        )

    @property
    def said(self) -> str:
        return self.output.read_text()

    def pids(self) -> dict[str, int]:
        found = re.findall(r"^node (\w+): ready, process (\d+)$", self.said, re.MULTILINE)
        return {name: int(number) for name, number in found}

    def until_ready(self) -> dict[str, int]:
        process = self.process
        assert process is not None
        until(lambda: "\nready; " in self.said or process.poll() is not None, lambda: self.said)
        assert process.poll() is None, self.said
        return self.pids()


@pytest.fixture
def up(tmp_path: Path) -> Iterator[Up]:
    made = Up(tmp_path)
    yield made
    if made.process is not None:
        made.process.kill()  # its nodes end with it
        made.process.wait()


def test_a_machine_of_processes_that_share_nodes_does_what_one_process_does(up: Up) -> None:
    file, source = read_board_text(BOARD)
    machine = Machine(file, source, read_scenario(scenario(), "s", pins_of(file), US))
    machine.run()
    (up.folder / "four.txt").write_text(scenario())
    process = up.start(SHARED, "--scenario", "four.txt", "--trace", "all.trace")
    assert process.wait(PATIENCE) == 0, up.said
    assert f"trace hash {machine.trace_hash()} of" in up.said
    pids = up.pids()
    assert sorted(pids) == list("abcd")
    assert pids["a"] == pids["c"]
    assert len(set(pids.values())) == 3
    for label in ("a+c", "b  ", "d  "):
        assert f"\n{label}    | the scenario is over at 20.000000 ms\n" in up.said
    assert "router | " not in up.said
    assert up.vbus("trace", "all.trace").stdout.split()[0] == machine.trace_hash()


def test_what_is_recorded_of_a_machine_is_asked_for_once(up: Up) -> None:
    (up.folder / "four.txt").write_text(scenario())
    asked = ("--journal", "run.vbj", "--wave", "run.vcd", "--report", "run.json")
    process = up.start(
        TWO, "--scenario", "four.txt", "--trace", "all.trace", *asked, "--metrics", "127.0.0.1:0"
    )
    assert process.wait(PATIENCE) == 0, up.said
    files = sorted(path.name for path in up.folder.glob("run.*"))
    assert files == [
        *(f"run.{node}.{kind}" for node in "abcd" for kind in ("json", "vbj")), "run.vcd",
    ]  # fmt: skip
    assert len(re.findall(r"^  metrics http://127\.0\.0\.1:\d+/metrics$", up.said, re.M)) == 4
    assert "  journal run.c.vbj: of a process that is killed" in up.said
    journals = [f"run.{node}.vbj" for node in "abcd"]
    done = up.vbus("replay", *journals)
    hash_ = up.vbus("trace", "all.trace").stdout.split()[0]
    assert hash_ in done.stdout, done
    # One process that has all nodes leaves one file, too, and the same.
    done = up.vbus("run", "four.toml", "--scenario", "four.txt", "--wave", "one.vcd")
    assert done.returncode == 0, done.stderr
    assert [path.name for path in up.folder.glob("one*")] == ["one.vcd"]
    wave = (up.folder / "one.vcd").read_text()
    assert wave == (up.folder / "run.vcd").read_text()
    scopes = re.findall(r"^\$scope module (\w+) \$end$", wave, re.MULTILINE)
    assert [scope for scope in scopes if len(scope) == 1 and scope in "abcd"] == [*"abcd"]


def test_a_machine_goes_on_from_a_snapshot_and_is_shown_on_one_page(up: Up) -> None:
    process = up.start(TWO)
    up.until_ready()
    done = up.vbus("snap", "save", "four", "four.snap")
    assert done.returncode == 0, done.stderr
    process.terminate()
    assert process.wait(PATIENCE) == 0, up.said
    process = up.start(TWO, "--from", "four.snap", "--scope")
    up.until_ready()
    found = re.search(r"^a\+c *\| scope: http://127\S+ +\(process (\d+)\)$", up.said, re.MULTILINE)
    assert found, up.said
    assert up.said.count("scope: ") == 1
    os.kill(int(found[1]), signal.SIGTERM)
    process.terminate()
    assert process.wait(PATIENCE) == 0, up.said


@pytest.mark.parametrize(
    ("options", "said"),
    [
        (
            ("--metrics", "127.0.0.1:9100"),
            'each of the 2 processes has its own; write "127.0.0.1:0',
        ),
        (("--scope", "--detach"), "--scope is not for --detach; see: vbus scope NAME"),
    ],
)
def test_what_makes_no_sense_for_a_machine_is_refused(
    up: Up, options: tuple[str, ...], said: str
) -> None:
    process = up.start(TWO, *options)
    assert process.wait(PATIENCE) == 2
    assert said in " ".join(up.said.split())


def test_a_rate_in_virtual_time_is_refused_by_the_nodes(up: Up) -> None:
    process = up.start(TWO, "--rate", "2")
    assert process.wait(PATIENCE) == 2
    assert "a rate makes sense in real time only; this board is lockstep" in up.said


def test_a_node_that_is_killed_is_named_and_nothing_is_left(up: Up) -> None:
    process = up.start(TWO)
    pids = up.until_ready()
    os.kill(pids["b"], signal.SIGKILL)
    assert process.wait(PATIENCE) == 1
    assert f"vbus: nodes b and d (process {pids['b']}) died of SIGKILL, and the machine" in up.said
    assert not any(Path(f"/proc/{number}").exists() for number in pids.values())


def test_a_machine_in_the_background_is_waited_for_and_stopped_by_its_name(up: Up) -> None:
    hosts = "".join(
        f'[[hosts]]\ntransport = "unix:$VBUS_RUNTIME/{chip}"\nchips = ["{chip}"]\n' for chip in "xy"
    )
    process = up.start(TWO + hosts, "--detach")
    assert process.wait(PATIENCE) == 0, up.said
    assert up.said.endswith('ready; "vbus stop four" stops it\n')
    assert re.search(r"link unix:\S*/x: byte protocol, to x\n", up.said)
    assert up.vbus("wait", "four", "--timeout", "0").returncode == 0
    assert up.vbus("stop", "four").returncode == 0
    assert up.vbus("wait", "four", "--timeout", "0").returncode == 4
    until(lambda: "and the machine with it" in up.vbus("logs", "four").stdout, "it says so")


def test_ctrl_c_is_no_failure_and_a_node_that_cannot_start_is_one(up: Up) -> None:
    process = up.start(TWO, "--json")
    until(lambda: "\n" in up.said, "a line")
    told = json.loads(up.said)
    boards = {status["board"] for status in told["nodes"]}
    assert boards == {"four.a", "four.b", "four.c", "four.d"}
    assert told["board"] == "four"
    process.send_signal(signal.SIGINT)
    assert process.wait(PATIENCE) == 0, up.said
    no_folder = up.folder / "four.toml"
    bad = TWO + f'[[hosts]]\ntransport = "unix:{no_folder}/x"\nchips = ["x"]\n'
    assert up.start(bad).wait(PATIENCE) == 4
    assert re.search(r"vbus: nodes a and c \(process \d+\) ended with exit code 4", up.said)
    assert f"\n  vbus: {no_folder}/x: " in up.said


# -- without processes -------------------------------------------------------------------------


def test_the_plan_of_processes_follows_the_file_and_changes_nothing_that_happens() -> None:
    shared, apart = read_board_text(SHARED)[0], read_board_text(BOARD)[0]
    assert processes_of(shared) == (
        Process("left", ("a", "c")),
        Process("b", ("b",)),
        Process("d", ("d",)),
    )
    assert [process.nodes for process in processes_of(apart)] == [("a",), ("b",), ("c",), ("d",)]
    assert plan_of(shared).digest == plan_of(apart).digest


def test_a_board_without_nodes_is_no_machine() -> None:
    file, _ = read_board_text('[chips.x]\npart = "LM629N-8"\nclock = "8 MHz"\nplant = "none"\n')
    with pytest.raises(ConfigError, match='"vbus run" runs a board without nodes'):
        processes_of(file)


def test_a_mistake_in_the_name_of_a_process_is_named() -> None:
    with pytest.raises(ConfigError, match="a name begins with a letter"):
        read_board_text(BOARD.replace("[nodes.a]", '[nodes.a]\nprocess = "a b"'))


def test_where_processes_meet_is_what_the_file_says_or_a_router_of_their_own(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setenv("VBUS_RUNTIME", str(tmp_path))
    endpoint = free_endpoint()

    def meeting(addition: str = "", router: str = "", board: str = BOARD) -> Meeting:
        return meeting_of(read_board_text(board + addition)[0], router)

    own = meeting()
    assert own.router.startswith("tcp/127.0.0.1:")
    assert own.connect == (own.router,)
    assert meeting(router=endpoint) == Meeting(endpoint, (endpoint,), endpoint)
    with ExitStack() as held:
        # A router takes a while to start: nobody else has its port until it listens there.
        kept = meeting_of(read_board_text(BOARD)[0], "tcp/127.0.0.1:0", held).router
        address = ("127.0.0.1", int(kept.rpartition(":")[2]))
        with socket.socket() as other, pytest.raises(OSError, match="in use"):
            other.bind(address)
        close_session(open_session(listen=[kept]))
    named = meeting(f'[zenoh]\nconnect = ["{endpoint}"]\n')
    assert named == Meeting(endpoint, (), endpoint)
    hub = BOARD.replace("[nodes.b]", f'[nodes.b]\nlisten = "{endpoint}"')
    assert meeting(board=hub) == Meeting(said=f"{endpoint}, where node b listens")
    with pytest.raises(TransportError, match=r"no process listens at tcp/router\.invalid:7447"):
        meeting('[zenoh]\nconnect = ["tcp/router.invalid:7447"]\n')
    assert meeting(board=sharing(BOARD, all="abcd")) == Meeting()
