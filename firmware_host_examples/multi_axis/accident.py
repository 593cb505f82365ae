"""The command of an example of which a node is killed: it rejoins, and nothing has changed.

The nodes play the score themselves, as their scenario. The one that is to die keeps a snapshot.
"""

import argparse
import contextlib
import os
import signal
import subprocess
import sys
import tempfile
import time
from collections import defaultdict
from collections.abc import Callable, Iterable, Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any, NoReturn

from multi_axis.chips import Cycle
from multi_axis.command import board_text, plotted
from multi_axis.parts import Part, endpoint_of
from multi_axis.picture import Picture
from multi_axis.score import MS, US, Score
from vbus.board.config import read_board_file
from vbus.core.errors import TransportError, VbusError
from vbus.serve.nodes.nodes import read_traces
from vbus.serve.registry import ask

PATIENCE = 60
"""Seconds the others wait for the node that has died."""


@dataclass
class Accident:
    """An example of which a node is killed.

    Attributes:
        name: of its folder.
        folder: where its board.toml lies.
        title: stands above the picture.
        score: returns what the nodes play.
        result: turns the cycles of each chip into lines to print, and the picture.
        killed: the node that is killed.
        kill_at: when, or soon after (ps).
    """

    name: str
    folder: Path
    title: str
    score: Callable[[], Score]
    result: Callable[[Mapping[str, list[Cycle]]], tuple[list[str], Picture]]
    killed: str
    kill_at: int


def main(accident: Accident) -> NoReturn:
    """Run the command, and exit."""
    parser = argparse.ArgumentParser(prog="demo.py", description=accident.title)
    parser.add_argument(
        "--svg", metavar="FILE", help=f"the plot (.svg, .png, .pdf); else {accident.name}.svg"
    )
    parser.add_argument(
        "--scope",
        action="store_true",
        help="show the run of which a node is killed in a browser",
    )
    asked = parser.parse_args()
    signal.signal(signal.SIGTERM, lambda *_: sys.exit(143))
    try:
        with tempfile.TemporaryDirectory(prefix="vbus-") as folder:
            _Run(accident, Path(folder)).all(Path(asked.svg or f"{accident.name}.svg"), asked.scope)
    except (VbusError, OSError) as error:
        print(f"{accident.name}: {error}", file=sys.stderr)
        sys.exit(1)
    except KeyboardInterrupt:
        sys.exit(130)
    sys.exit(0)


class _Run:
    """One run: its folder, and its processes."""

    def __init__(self, accident: Accident, folder: Path) -> None:
        self.accident = accident
        self.folder = folder
        self.parts: list[Part] = []
        self.dead: Part | None = None
        self.board = folder / "board.toml"
        self.snapshot = folder / "node.snap"
        self.board.write_text((accident.folder / "board.toml").read_text())
        score = accident.score()
        score.of({chip.name for chip in read_board_file(self.board)[0].chips})
        self.scenario = folder / "score.txt"
        self.scenario.write_text(f"{score.lines()}end {score.end + US}ps\n")

    def all(self, picture_file: Path, scope: bool) -> None:
        """Run it without and with the accident; print what has come of it.

        Raises:
            VbusError: a part has failed, or the accident has changed something.
        """
        try:
            undisturbed = self._in_one_process()
            disturbed = self._with_the_accident(scope)
        finally:
            for part in reversed(self.parts):
                part.stop()
        lines, picture = self.accident.result(_cycles(disturbed))
        nodes = len(disturbed)
        print(f"{self.accident.name}: {nodes} nodes, {self.accident.killed} killed and rejoined")
        for line in lines:
            print(line)
        print(plotted(picture, picture_file))
        hashes = [
            read_traces([str(file) for file in files])[1] for files in (disturbed, [undisturbed])
        ]
        print(f"trace hash: {hashes[0]}")
        if hashes[0] != hashes[1]:
            raise VbusError(f"in one process, with nobody killed, the hash is {hashes[1]}")
        print("in one process, with nobody killed: the same")

    def _start(self, name: str, *words: str, shown: bool = False, **more: int | None) -> Part:
        part = Part(
            name,
            [sys.executable, "-m", "vbus", *words],
            None if shown else self.folder / f"{len(self.parts)}.log",
            env={**os.environ, "VBUS_RUNTIME": str(self.folder / "run")},
            **more,
        )
        self.parts.append(part)
        return part

    def _run(self, name: str, trace: Path, *options: str, shown: bool = False) -> Part:
        words = ["run", str(self.board), *options, "--scenario", str(self.scenario)]
        words += ["--trace", str(trace)]
        return self._start(name, *words, shown=shown, stdout=subprocess.DEVNULL)

    def _in_one_process(self) -> Path:
        """Run all nodes in one process; return its trace."""
        trace = self.folder / "one.trace"
        self._ends([self._run("the nodes", trace)])
        return trace

    def _with_the_accident(self, scope: bool) -> list[Path]:
        """Run each node in a process, kill one, and let it rejoin; return their traces."""
        router = self._start(
            "router", "router", "--listen", "tcp/127.0.0.1:0", stdout=subprocess.PIPE
        )
        self.board.write_text(board_text(self.accident.folder, endpoint_of(router)))
        nodes = [node.name for node in read_board_file(self.board)[0].nodes]
        traces = {node: self.folder / f"{node}.trace" for node in nodes}
        patience = ("--patience", str(PATIENCE))
        running = {}
        *_, last = (node for node in nodes if node != self.accident.killed)
        # The page is there before time begins, with all nodes that are.
        for node in sorted(nodes, key=last.__eq__):
            more = ["--snapshot", str(self.snapshot)] if node == self.accident.killed else []
            shown = scope and node == last
            if shown:
                self._await(running)
                more += ["--scope"]
            options = ("--node", node, *patience, *more)
            running[node] = self._run(node, traces[node], *options, shown=shown)
        self._kill(running)
        again = ("--node", self.accident.killed, "--from", str(self.snapshot), *patience)
        running[self.accident.killed] = self._run(
            self.accident.killed, traces[self.accident.killed], *again
        )
        self._ends(running.values())
        return list(traces.values())

    def _kill(self, running: dict[str, Part]) -> None:
        """Kill the node in the middle of the run, and wait until the others miss it.

        Raises:
            VbusError: it has ended before.
        """
        name = self.accident.killed
        victim = running[name]
        now = 0
        while now < self.accident.kill_at or not self.snapshot.exists():
            if victim.process.poll() is not None:
                raise VbusError(f"node {name} {victim.end()} before it could be killed")
            self._whole()
            now = self._told(name).get("granted_ps", 0)
            time.sleep(0.005)
        self.dead = victim
        victim.process.kill()
        victim.process.wait()
        print(f"node {name} was killed at {now / MS:.0f} ms of chip time", file=sys.stderr)
        for other in running.keys() - {name}:
            while self._told(other).get("others", {}).get(name) != "lost":
                self._whole()
                time.sleep(0.02)

    def _await(self, nodes: Iterable[str]) -> None:
        """Wait until these can be watched."""
        while not all(self._told(node) for node in nodes):
            self._whole()
            time.sleep(0.02)

    def _told(self, node: str) -> dict[str, Any]:
        """Return what a node tells of itself; nothing while it does not answer."""
        board = read_board_file(self.board)[0].board.name
        with contextlib.suppress(TransportError):
            told: dict[str, Any] = ask(self.folder / "run" / "boards" / f"{board}.{node}.sock")
            return dict(told["node"])
        return {}

    def _ends(self, parts: Iterable[Part]) -> None:
        """Wait until these have ended."""
        while any(part.process.poll() is None for part in parts):
            self._whole()
            time.sleep(0.02)
        self._whole()

    def _whole(self) -> None:
        """See that nothing has failed.

        Raises:
            VbusError: a part has; says what it said.
        """
        failed = [part for part in self.parts if part.process.poll() and part is not self.dead]
        if failed:
            said = "\n".join(f"  {part.name} {part.end()}" for part in failed)
            raise VbusError(f"the run has failed\n{said}")


def _cycles(traces: Iterable[Path]) -> dict[str, list[Cycle]]:
    """Return the bus cycles of each chip."""
    found: dict[str, list[Cycle]] = defaultdict(list)
    for file in traces:
        for line in file.read_text().splitlines():
            when, _, verb, chip, *words = line.split(" ")
            if verb in ("r", "w"):
                address, data = (int(word, 16) for word in words[:2])
                found[chip].append(Cycle(int(when), verb == "w", address, data))
    return found
