"""The command of an example: starts a router, the nodes and the host, and stops them again.

Every part is a process of its own, started and stopped by its id. The host is this same command
with --connect, so it also runs beside nodes that somebody else has started.
"""

import argparse
import contextlib
import os
import re
import signal
import subprocess
import sys
import tempfile
import time
from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any, NoReturn

from multi_axis.chips import Cycle
from multi_axis.parts import Part, endpoint_of
from multi_axis.picture import Picture
from multi_axis.play import Played, play
from multi_axis.result import skew
from multi_axis.score import Score
from vbus.board.config import read_board_file
from vbus.core.errors import PluginError, VbusError
from vbus.network.session import check_endpoint
from vbus.serve.nodes.nodes import read_traces

LAST_SECONDS = 3
"""How long the host may take to say what is wrong when another part has ended."""


@dataclass
class Demo:
    """An example of several axes.

    Attributes:
        name: of its folder.
        folder: where its board.toml lies.
        title: stands above the picture.
        period: of its chips (ps); in real time the score begins at a multiple of it.
        score: returns what the host does.
        result: turns the cycles of each chip into lines to print, and the picture.
        marks: whether a cycle is one of those that all axes are to see at one instant.
        variants: further options, each with its help and the score in its place.
    """

    name: str
    folder: Path
    title: str
    period: int
    score: Callable[[], Score]
    result: Callable[[Mapping[str, list[Cycle]]], tuple[list[str], Picture]]
    marks: Callable[[Cycle], bool]
    variants: Mapping[str, tuple[str, Callable[[], Score]]] = field(default_factory=dict)


def main(demo: Demo) -> NoReturn:
    """Run the command, and exit."""
    asked = _arguments(demo)
    try:
        if asked.print_board:
            print(_board(demo, asked.connect, asked.real_time), end="")
        elif asked.connect:
            _host(demo, asked)
        else:
            _all(demo, asked)
    except (VbusError, OSError) as error:
        print(f"{demo.name}: {error}", file=sys.stderr)
        sys.exit(1)
    except KeyboardInterrupt:
        sys.exit(130)
    sys.exit(0)


def _arguments(demo: Demo) -> argparse.Namespace:
    parser = argparse.ArgumentParser(prog="demo.py", description=demo.title)
    parser.add_argument(
        "--real-time", action="store_true", help="by the wall clock; else in virtual time"
    )
    parser.add_argument(
        "--svg", metavar="FILE", help=f"the plot (.svg, .png, .pdf); else {demo.name}.svg"
    )
    parser.add_argument("--traces", metavar="FOLDER", help="keep the traces of the nodes there")
    parser.add_argument(
        "--connect",
        metavar="ENDPOINT",
        help="be the host only: router and nodes run elsewhere and meet at this endpoint",
    )
    parser.add_argument(
        "--print-board",
        action="store_true",
        help="with --connect: print the board file for such nodes, and do nothing else",
    )
    parser.add_argument(
        "--listen",
        metavar="ENDPOINT",
        default="tcp/127.0.0.1:0",
        help="where the router listens; else on a free port of this computer",
    )
    parser.add_argument(
        "--remote", action="store_true", help="the router may let other computers in"
    )
    parser.add_argument(
        "--netns",
        metavar="PART=NAME",
        action="append",
        default=[],
        help="run the router, the host or a node in this network namespace; repeatable",
    )
    for option, (what, _) in demo.variants.items():
        parser.add_argument(option, action="store_true", help=what)
    asked = parser.parse_args()
    if asked.print_board and not asked.connect:
        parser.error("--print-board needs --connect: at which endpoint do the nodes meet?")
    if asked.connect and (asked.traces or asked.netns or asked.listen != "tcp/127.0.0.1:0"):
        parser.error("--connect is for a host alone: it takes no --traces, --netns or --listen")
    try:
        check_endpoint(asked.connect or asked.listen)
    except VbusError as error:
        parser.error(str(error))
    nodes = [node.name for node in read_board_file(demo.folder / "board.toml")[0].nodes]
    for place in asked.netns:
        part, equals, name = place.partition("=")
        if part not in ("router", "host", *nodes) or not equals or not name:
            parser.error(
                f'--netns "{place}": write PART=NAME, where PART is router, host, '
                + ", ".join(nodes)
            )
    return asked


def board_text(folder: Path, endpoint: str) -> str:
    """Return an example's board file with another endpoint."""
    text = (folder / "board.toml").read_text()
    return re.sub(r"^connect = .*$", f'connect = ["{endpoint}"]', text, flags=re.MULTILINE)


def _board(demo: Demo, endpoint: str, real_time: bool) -> str:
    """Return the example's board file with its own endpoint and time."""
    text = board_text(demo.folder, endpoint)
    if real_time:
        text = text.replace('time = "lockstep"', 'time = "realtime"')
        text = text.replace("awaited = true\n", "")
    return text


# -- the host --------------------------------------------------------------------------------------


def _host(demo: Demo, asked: argparse.Namespace) -> None:
    """Play the score, and print what has come of it."""
    score = demo.score
    for option, (_, other) in demo.variants.items():
        if getattr(asked, option.removeprefix("--").replace("-", "_")):
            score = other
    with tempfile.TemporaryDirectory() as folder:
        board = Path(folder, "board.toml")
        board.write_text(_board(demo, asked.connect, asked.real_time))
        played = play(board, score(), asked.connect, demo.period)
    lines, picture = demo.result(played.cycles)
    nodes = len(read_board_file(demo.folder / "board.toml")[0].nodes)
    print(f"{demo.name}: {nodes} nodes, {'real' if asked.real_time else 'virtual'} time")
    for line in lines:
        print(line)
    marks = [[c.when for c in found if demo.marks(c)] for found in played.cycles.values()]
    print(skew(marks).line("skew of common bus cycles, chip time"))
    if asked.real_time:
        _print_wall_time(played)
    file = Path(asked.svg or f"{demo.name}.svg")
    print(plotted(picture, file))


def plotted(picture: Picture, file: Path) -> str:
    """Write the plot, if there is what draws it; return what is said of that."""
    try:
        picture.write(file)
    except PluginError as error:
        return f"no plot: {error}"
    return f"plot: {file}"


def _print_wall_time(played: Played) -> None:
    """Print how well the nodes kept to the wall clock; nothing promises that."""
    measured = [node["skew"] for node in played.status.values() if node["skew"]["marks"]]
    if not measured:
        print("skew between nodes, wall time: no node heard of another's marks in time")
    else:
        most = max(measured, key=lambda one: one["marks"])
        values = ", ".join(f"{p} {most[f'{p}_ns'] / 1000:.0f} us" for p in ("p50", "p99", "max"))
        print(f"skew between nodes, wall time: {values}, over {most['marks']} marks")
    late = sum(node["late_orders"] for node in played.status.values())
    edges = sum(node["late_edges"] for node in played.status.values())
    print(f"late: {late} bus cycles, {edges} edges on wires")


# -- all of it -------------------------------------------------------------------------------------


def _all(demo: Demo, asked: argparse.Namespace) -> None:
    """Start everything, wait for the host, stop everything, and print the hash.

    Raises:
        VbusError: a part has failed; says what it said.
    """
    signal.signal(signal.SIGTERM, lambda *_: sys.exit(143))
    with tempfile.TemporaryDirectory(prefix="vbus-") as made:
        folder = Path(made)
        traces = Path(asked.traces) if asked.traces else folder
        traces.mkdir(parents=True, exist_ok=True)
        with _running(demo, asked, folder, traces) as (parts, host):
            _wait(parts, host)
            failed = [part for part in parts if part.process.poll() is not None]
            if failed != [host] or host.process.returncode:
                said = "\n".join(f"  {part.name} {part.end()}" for part in failed)
                raise VbusError(f"the run has failed\n{said}")
        files = sorted(traces.glob("*.trace"))
        _, digest = read_traces([str(file) for file in files])
        if not asked.real_time:
            print(f"trace hash: {digest}")


def _wait(parts: list[Part], host: Part) -> None:
    """Wait for the end of the host; or, if another part ends before it, a little longer."""
    end = float("inf")
    while host.process.poll() is None and time.monotonic() < end:
        if end == float("inf") and any(p.process.poll() is not None for p in parts):
            end = time.monotonic() + LAST_SECONDS
        time.sleep(0.05)


@contextlib.contextmanager
def _running(
    demo: Demo, asked: argparse.Namespace, folder: Path, traces: Path
) -> Iterator[tuple[list[Part], Part]]:
    """Start router, nodes and host; stop them by their ids, whatever has happened."""
    runtime = {"VBUS_RUNTIME": str(folder / "run")}
    environment = {**os.environ, **runtime}
    places = dict(place.split("=", 1) for place in asked.netns)
    parts: list[Part] = []

    def start(name: str, command: list[str], **more: Any) -> Part:
        inside = ["ip", "netns", "exec", places[name]] if name in places else []
        log = folder / f"{name}.log"
        part = Part(name, [*inside, sys.executable, *command], log, env=environment, **more)
        parts.append(part)
        return part

    try:
        remote = ["--remote"] if asked.remote else []
        router = start(
            "router",
            ["-m", "vbus", "router", "--listen", asked.listen, *remote],
            stdout=subprocess.PIPE,
        )
        endpoint = endpoint_of(router)
        board = folder / "board.toml"
        board.write_text(_board(demo, endpoint, asked.real_time))
        for node in read_board_file(board)[0].nodes:
            trace = traces / f"{node.name}.trace"
            command = ["-m", "vbus", "run", str(board), "--node", node.name, "--trace", str(trace)]
            command += ["--patience", "30"]
            start(node.name, command, stdout=subprocess.DEVNULL)
        options = [
            option for option in demo.variants if getattr(asked, option[2:].replace("-", "_"))
        ]
        options += ["--real-time"] if asked.real_time else []
        options += ["--svg", asked.svg] if asked.svg else []
        host = start("host", [sys.argv[0], "--connect", endpoint, *options])
        yield parts, host
    finally:
        for part in reversed(parts):
            part.stop()
