"""The examples of several axes: one command each, here and over computers joined by cables."""

import asyncio
import contextlib
import importlib.util
import os
import re
import runpy
import signal
import subprocess
import sys
import tempfile
import time
import xml.etree.ElementTree as ElementTree
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import pytest

from tests.examples.boards import EXAMPLES, as_installed, expected
from tests.namespaces import computers
from tests.waiting import Starved, until
from vbus.board.config import read_board_file
from vbus.core.errors import TransportError, VbusError
from vbus.core.kernel import MS, US
from vbus.nodes.machine import Machine
from vbus.nodes.plan import pins_of
from vbus.nodes.scenario import read_scenario
from vbus.protocols.info import ChipInfo, PortInfo
from vbus.serve.registry import ask

BOUNDS = {
    # What is printed of the contour begins with this; largest distance (counts).
    "xy_circle_lm629": ("contour error: ", 3.0),
    "interpolated_mcp1200": ("contour error of X, Y, Z: ", 2.5),
    "gear_mc1241a": ("gear error of q, -1.25: ", 6.0),
}
PATIENCE = 120
LATE = ("is a node overloaded?", " ms too late", "marks in time")
"""What a run in real time says that the computer has kept waiting."""
DEMOS = pytest.mark.parametrize("demo", BOUNDS)


def demo_of(name: str) -> Any:
    """Return an example's command as a module."""
    place = EXAMPLES / name / "demo.py"
    spec = importlib.util.spec_from_file_location(f"{name}_demo", place)
    assert spec is not None
    assert spec.loader is not None
    module = importlib.util.module_from_spec(spec)
    path = [*sys.path]
    try:
        spec.loader.exec_module(module)
    finally:
        sys.path[:] = path
    return module


def played(name: str, score: Any) -> tuple[dict[str, list[Any]], str]:
    """Play a score on all nodes in this process; return the cycles of each chip, and the hash."""
    Cycle = demo_of(name).Cycle

    file, source = read_board_file(EXAMPLES / name / "board.toml")
    scenario = read_scenario(f"{score.lines()}end {score.end + US}ps\n", name, pins_of(file), US)
    machine = Machine(file, source, scenario)
    machine.run()
    cycles: dict[str, list[Any]] = {chip.name: [] for chip in file.chips}
    for node in machine.nodes:
        node.board.catch_up()
        assert node.trace is not None
        for when, text in node.trace.lines():
            words = text.split()
            if words[0] in ("r", "w"):
                write, address, data = words[0] == "w", int(words[2], 16), int(words[3], 16)
                cycles[words[1]].append(Cycle(when, write, address, data))
    return cycles, machine.trace_hash()


@contextlib.contextmanager
def started(name: str, folder: Path, *options: str) -> Iterator[subprocess.Popen[str]]:
    """Start an example's command in a folder of its own; stop what is left at the end."""
    process = subprocess.Popen(
        [sys.executable, str(EXAMPLES / name / "demo.py"), *options],
        cwd=folder,
        env={**as_installed(), "PYTHONHASHSEED": str(len(options))},
        stdin=subprocess.DEVNULL,
        stdout=subprocess.PIPE,
        stderr=subprocess.PIPE,
        text=True,
    )
    try:
        yield process
    finally:
        if process.poll() is None:
            process.send_signal(signal.SIGTERM)
            process.wait(PATIENCE)
        for stream in (process.stdout, process.stderr):
            if stream is not None:
                stream.close()


def run(name: str, folder: Path, *options: str) -> str:
    """Run an example to its end; return what it printed."""
    with started(name, folder, *options) as process:
        out, errors = process.communicate(timeout=PATIENCE)
        if any(said in out + errors for said in LATE):
            raise Starved(out + errors)
        assert process.returncode == 0, out + errors
        assert errors == ""
        return out


def wait_for_parts(pid: int, count: int) -> dict[int, list[str]]:
    """Wait until a process has so many children; return their ids and command lines."""
    children = Path(f"/proc/{pid}/task/{pid}/children")
    parent = Path(f"/proc/{pid}/cmdline").read_text()
    found: dict[int, str] = {}

    def there() -> bool:
        found.clear()
        for child in children.read_text().split():
            found[int(child)] = Path("/proc", child, "cmdline").read_text()
        # A child has its parent's command line until it has begun.
        return len(found) >= count and all(found.values()) and parent not in found.values()

    until(there, f"{count} children")
    return {child: words.split("\0") for child, words in found.items()}


def until_granted(folder: Path, node: str, instant: int) -> None:
    """Wait until a node of an example started in ``folder`` may run so far (ps)."""

    def granted() -> bool:
        for place in folder.glob(f"*/run/boards/{node}.sock"):
            with contextlib.suppress(TransportError):
                return bool(ask(place)["node"]["granted_ps"] >= instant)
        return False

    until(granted, f"node {node} may run to {instant} ps")


def worst(name: str, out: str) -> float:
    """Return the largest distance from the path that is printed (counts)."""
    begins, _ = BOUNDS[name]
    found = re.search(rf"^{re.escape(begins)}.* max ([\d.]+) counts", out, re.MULTILINE)
    assert found is not None, out
    return float(found[1])


@DEMOS
def test_a_machine_over_a_network_moves_as_in_one_process(demo: str, tmp_path: Path) -> None:
    nodes = [node.name for node in read_board_file(EXAMPLES / demo / "board.toml")[0].nodes]
    with computers(len(nodes) + 1) as network:
        parts = [*nodes, "host"]
        places = [f"--netns=router={network.hub.name}"]
        places += [
            f"--netns={part}={computer.name}"
            for part, computer in zip(parts, network.around, strict=True)
        ]
        out = run(demo, tmp_path, "--remote", f"--listen=tcp/{network.hub.address}:7447", *places)

    printed, _, digest = out.partition("trace hash: ")
    assert printed == expected(demo)
    assert worst(demo, out) <= BOUNDS[demo][1]
    assert digest.strip() == played(demo, demo_of(demo).score())[1]
    assert ElementTree.parse(tmp_path / f"{demo}.svg").getroot().tag.endswith("svg")


@pytest.mark.slow
def test_a_cable_pulled_for_5_s_in_the_middle_changes_nothing(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    demo = "gear_mc1241a"
    # The nodes' sockets lie there: a short path.
    with computers(2) as network, tempfile.TemporaryDirectory() as scratch:
        monkeypatch.setenv("TMPDIR", scratch)
        left, right = network.around
        options = ["--remote", f"--listen=tcp/{network.hub.address}:7447"]
        places = {"router": network.hub, "host": network.hub, "left": left, "right": right}
        options += [f"--netns={part}={place.name}" for part, place in places.items()]
        with started(demo, tmp_path, *options) as process:
            until_granted(Path(scratch), "gear.right", 200 * MS)
            right.cut()
            time.sleep(5)
            assert process.poll() is None, process.communicate()
            right.mend()
            out, errors = process.communicate(timeout=PATIENCE)

    assert process.returncode == 0, out + errors
    printed, _, digest = out.partition("trace hash: ")
    assert printed == expected(demo)
    assert digest.strip() == played(demo, demo_of(demo).score())[1]


def test_in_real_time_the_contour_is_the_same_and_skew_is_told(tmp_path: Path) -> None:
    out = run("xy_circle_lm629", tmp_path, "--real-time", "--svg=circle.svg", "--traces=kept")

    lines = out.splitlines()
    assert lines[0] == "xy_circle_lm629: 2 nodes, real time"
    assert worst("xy_circle_lm629", out) <= BOUNDS["xy_circle_lm629"][1]
    assert "skew of common bus cycles, chip time: p50 0 us, p99 0 us, max 0 us" in lines[2]
    assert re.match(r"skew between nodes, wall time: p50 \d+ us, p99 \d+ us, max \d+ us", lines[3])
    if lines[4] != "late: 0 bus cycles, 0 edges on wires":
        raise Starved(lines[4])
    assert (tmp_path / "circle.svg").exists()
    assert sorted(file.name for file in (tmp_path / "kept").iterdir()) == [
        "left.trace",
        "right.trace",
    ]
    assert "trace hash" not in out


def test_without_matplotlib_there_is_no_plot_and_it_is_said(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    demo_of("gear_mc1241a")
    command, picture = sys.modules["multi_axis.command"], sys.modules["multi_axis.picture"]
    made = picture.Picture("title", "x", "y", "error")
    made.path("real", [(0.0, 0.0), (1.0, 2.0)])
    made.curve("error", [(0.0, 0.0), (1.0, 2.0)])
    file = tmp_path / "a.svg"
    assert command.plotted(made, file) == f"plot: {file}"
    assert ElementTree.parse(file).getroot().tag.endswith("svg")
    file.unlink()
    monkeypatch.setitem(sys.modules, "matplotlib", None)
    assert command.plotted(made, file).startswith("no plot: pictures need matplotlib; install it")
    assert not file.exists()


def test_a_part_that_cannot_start_ends_the_run_with_its_reason(tmp_path: Path) -> None:
    with started("xy_circle_lm629", tmp_path, "--remote", "--listen=tcp/192.0.2.1:7447") as process:
        out, errors = process.communicate(timeout=PATIENCE)

    assert process.returncode == 1
    assert out == ""
    assert "the router has not started" in errors
    assert "cannot listen on tcp/192.0.2.1:7447" in errors


def test_a_node_that_is_killed_ends_the_run_and_nothing_is_left(tmp_path: Path) -> None:
    with started("xy_circle_lm629", tmp_path, "--real-time") as process:
        parts = wait_for_parts(process.pid, 4)
        node = next(pid for pid, words in parts.items() if "--node" in words and "right" in words)
        os.kill(node, signal.SIGKILL)
        _, errors = process.communicate(timeout=PATIENCE)

    assert process.returncode == 1
    assert "the run has failed" in errors
    assert "right was killed by signal 9" in errors
    assert not any(Path("/proc", str(pid)).exists() for pid in parts)


def test_without_sync_the_axes_leave_the_path_further() -> None:
    name = "interpolated_mcp1200"
    demo = demo_of(name)
    cycles, _ = played(name, demo.score(synchronised=False))
    assert worst(name, "\n".join(demo.result(cycles)[0])) > 1.5 * worst(name, expected(name))


def command(
    monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str], *options: str
) -> tuple[int, str]:
    """Run the gear's command in this process; return its exit code and what it printed."""
    place = str(EXAMPLES / "gear_mc1241a" / "demo.py")
    monkeypatch.setattr(sys, "argv", [place, *options])
    monkeypatch.setattr(sys, "path", [*sys.path])
    with pytest.raises(SystemExit) as ended:
        runpy.run_path(place, run_name="__main__")
    assert isinstance(ended.value.code, int)
    return ended.value.code, "".join(capsys.readouterr())


@pytest.mark.parametrize(
    ("options", "said"),
    [
        (["--print-board"], "--print-board needs --connect"),
        (["--connect=nowhere"], '"nowhere" is no endpoint'),
        (["--netns=middle=a"], "PART is router, host, left, right"),
        (["--connect=tcp/127.0.0.1:1", "--traces=t"], "--connect is for a host alone"),
    ],
)
def test_a_wrong_command_line_is_told(
    options: list[str],
    said: str,
    monkeypatch: pytest.MonkeyPatch,
    capsys: pytest.CaptureFixture[str],
) -> None:
    code, printed = command(monkeypatch, capsys, *options)
    assert code == 2
    assert said in printed


def test_the_board_file_for_nodes_elsewhere_is_printed(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    place = "tcp/10.1.2.3:7447"
    code, text = command(monkeypatch, capsys, "--print-board", "--connect", place, "--real-time")
    assert code == 0
    board = tmp_path / "board.toml"
    board.write_text(text)
    file, _ = read_board_file(board)
    assert file.zenoh.connect == (place,)
    assert file.board.time == "realtime"


def test_an_axis_that_is_behind_on_the_way_makes_no_contour_error() -> None:
    demo = demo_of("xy_circle_lm629")
    late = [(t / 100, demo.path(t / 100 - 0.004)) for t in range(20, 140)]
    assert max(distance for distance, _ in demo.nearest(late, demo.path)) < 0.01
    assert all(
        abs(t - 0.004 - place) < 1e-4
        for (t, _), (_, place) in zip(late, demo.nearest(late, demo.path), strict=True)
    )
    wide = [(t, (x, y - 5)) for t, (x, y) in late[60:61]]
    assert 4.5 < demo.nearest(wide, demo.path)[0][0] <= 5


def test_a_score_whose_cycles_overlap_on_a_bus_is_refused() -> None:
    score = demo_of("xy_circle_lm629").Score()
    score.write(10 * US, "x", 0, 1, 2)
    score.write(10 * US + US // 2, "y", 0, 1)
    assert [event.at // US for event in score.of({"x"})] == [10, 11]
    score.read(10 * US + US // 2, "x", 0)
    with pytest.raises(ValueError, match="two bus cycles of x overlap"):
        score.of({"x"})


@pytest.mark.parametrize(
    ("policy", "now", "said"),
    [
        ("realtime", 0, "circle.left runs in realtime; give --real-time here too"),
        ("lockstep", 5_000_000_000, "time of circle.left stands at 5 ms: start the nodes anew"),
    ],
)
def test_nodes_that_do_not_fit_the_run_are_named(policy: str, now: int, said: str) -> None:
    class Nodes:
        info = PortInfo("circle.left", policy, 0, [ChipInfo("x", "LM629N-8", "lm628", 1, US)])

        async def now(self) -> int:
            return now

    demo_of("xy_circle_lm629")
    play = sys.modules["multi_axis.play"]
    with pytest.raises(VbusError, match=said):
        asyncio.run(play._run(Nodes(), [], set(), 0))
