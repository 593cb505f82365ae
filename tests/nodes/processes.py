"""Nodes of the four-chip machine in processes of their own, joined by real Zenoh sessions."""

import os
import re
import subprocess
import sys
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import Any

from tests.nodes.four_chips import BOARD, scenario
from tests.ports import free_endpoint
from tests.waiting import PATIENCE, Starved, until


def patient(board: str) -> str:
    """Return a board whose nodes may be silent for as long as tests wait, unless it says how long.

    On a busy machine nobody hears of one for seconds, and the others would give it up.
    """
    if "deadline" in board:
        return board
    return re.sub(r"(?m)^\[nodes\..*\]$", rf'\g<0>\ndeadline = "{PATIENCE:g} s"', board)


class Bench:
    """A folder with a board file and a scenario, and the processes started in it."""

    def __init__(
        self,
        folder: Path,
        board: str = BOARD,
        script: str = "",
        make: bool = False,
        endpoint: str = "",
    ) -> None:
        self.folder = folder
        if make:
            folder.mkdir()
        self.endpoint = endpoint or free_endpoint()
        text = patient(board).replace("[nodes.a]", f'[nodes.a]\nlisten = "{self.endpoint}"')
        if endpoint.startswith("tcp/"):  # an address that other computers reach
            text += "\n[zenoh]\nremote = true\n"
        self.board = folder / "four.toml"
        self.board.write_text(text)
        self.script = folder / "four.txt"
        self.script.write_text(script or scenario())
        self.started: list[subprocess.Popen[str]] = []
        self.routers: list[subprocess.Popen[str]] = []

    def start(
        self,
        nodes: str,
        *options: str,
        disturb: str = "",
        hash_seed: int = 0,
        script: bool = True,
        board: Path | None = None,
        inside: Sequence[str] = (),
    ) -> subprocess.Popen[str]:
        """Start the nodes with these one-letter names in one process.

        ``inside`` stands before the command: what runs it on another computer.
        """
        arguments = [word for node in nodes for word in ("--node", node)]
        if script:
            arguments += ["--scenario", str(self.script), "--trace", str(self.trace(nodes))]
        file = str(board or self.board)
        process = subprocess.Popen(
            [*inside, sys.executable, "-m", "vbus", "run", file, *arguments, *options],
            cwd=self.folder,
            env={
                **os.environ,
                "VBUS_RUNTIME": str(self.folder / "run"),
                "PYTHONHASHSEED": str(hash_seed),
                **({"VBUS_TEST_DISTURB": disturb} if disturb else {}),
            },
            stdin=subprocess.DEVNULL,
            stdout=subprocess.PIPE,
            stderr=subprocess.STDOUT,
            text=True,
        )
        self.started.append(process)
        return process

    def trace(self, nodes: str) -> Path:
        return self.folder / f"{nodes}.trace"

    def vbus(self, *arguments: str) -> subprocess.CompletedProcess[str]:
        return subprocess.run(
            [sys.executable, "-m", "vbus", *arguments],
            cwd=self.folder,
            env={**os.environ, "VBUS_RUNTIME": str(self.folder / "run")},
            capture_output=True,
            text=True,
            timeout=PATIENCE,
        )

    def merged(self, groups: Sequence[str]) -> str:
        """Return the hash of a run whose processes ran these nodes."""
        return self.vbus("trace", *(str(self.trace(nodes)) for nodes in groups)).stdout.split()[0]

    def node(self, name: str) -> dict[str, Any]:
        """Return what ``vbus ls`` tells of a node; empty if it does not run."""
        from vbus.core.errors import TransportError
        from vbus.serve.registry import ask

        try:
            state: dict[str, Any] = ask(self.folder / "run" / "boards" / f"four.{name}.sock")
        except TransportError:
            return {}
        node: dict[str, Any] = state["node"]
        return node

    def until(self, condition: Callable[[], bool]) -> None:
        """Wait for a condition."""

        def holds() -> bool:
            codes = [process.poll() for process in self.started]
            assert not any((code or 0) > 0 for code in codes), self.outputs()
            if condition():
                return True
            if None not in codes:
                raise Starved(f"all had ended before it was seen: {self.outputs()}")
            return False

        until(holds, self.outputs)

    def outputs(self) -> list[str]:
        """Stop all processes; return what each has printed that nobody has read."""
        printed = []
        for process in self.started:
            if process.poll() is None:
                process.kill()
            assert process.stdout is not None
            if not process.stdout.closed:
                printed.append(process.communicate()[0])
        return printed

    def close(self) -> None:
        self.outputs()
        for router in self.routers:
            router.kill()
            router.communicate()


def ended(process: subprocess.Popen[str]) -> tuple[int, str]:
    """Wait for a process; return its exit code and what it printed."""
    out, _ = process.communicate(timeout=PATIENCE)
    assert "Traceback" not in out, out
    return process.returncode, out
