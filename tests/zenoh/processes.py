"""Boards and routers in processes of their own, and what tests say to them."""

import os
import signal
import subprocess
import sys
import time
from collections.abc import Sequence
from pathlib import Path

import zenoh

from tests.ports import free_endpoint
from tests.waiting import PATIENCE
from vbus.network.security import Security
from vbus.network.session import open_session

CHIPS = """
[board]
name = "{name}"
time = "{time}"
power_on = "done"
[chips.x]
part = "LM629N-8"
clock = "8 MHz"
plant = "m"
[chips.y]
part = "LM629N-8"
clock = "8 MHz"
plant = "n"
[plants.m]
model = "ideal"
[plants.n]
model = "ideal"
"""
BOARD = (
    CHIPS
    + """[[hosts]]
transport = "zenoh:"
{more}
"""
)


def session_at(endpoint: str, security: Security | None = None) -> zenoh.Session:
    """Open a session that is not given up while this process has no turn on a busy machine.

    A host of vbus repeats what is lost when its link is; who speaks Zenoh by himself does not.
    """
    lease = round(1000 * PATIENCE)
    return open_session(connect=[endpoint], mode="client", security=security, lease_ms=lease)


PATIENT = (
    "-c",
    "import sys; from vbus.network import session; from vbus.__main__ import main\n"
    f"session.ROUTER_LEASE_MS = lease = {round(1000 * PATIENCE)}\n"
    "session.open_session.__defaults__ = (*session.open_session.__defaults__[:-1], lease)\n"
    "sys.exit(main())",
)
"""``vbus`` with a lease as long as tests wait."""


class Process:
    """One ``vbus`` command that runs until it is stopped.

    ``inside`` stands before the command: what runs it on another computer. One that is ``patient``
    is not given up by others while it has no turn.
    """

    def __init__(
        self,
        arguments: list[str],
        folder: Path,
        runtime: str = "",
        inside: Sequence[str] = (),
        patient: bool = True,
    ) -> None:
        environment = {**os.environ, "VBUS_RUNTIME": runtime or os.environ["VBUS_RUNTIME"]}
        self.errors = folder / f"errors-{time.monotonic_ns()}"
        with self.errors.open("w") as errors:
            self.popen = subprocess.Popen(
                [*inside, sys.executable, *(PATIENT if patient else ("-m", "vbus")), *arguments],
                stdout=subprocess.PIPE,
                stderr=errors,
                text=True,
                cwd=folder,
                env=environment,
            )
        self.lines: list[str] = []
        assert self.popen.stdout is not None
        for line in self.popen.stdout:
            self.lines.append(line.rstrip())
            if line.startswith("ready"):
                break

    @property
    def said(self) -> str:
        return self.errors.read_text()

    @property
    def ready(self) -> bool:
        return bool(self.lines) and self.lines[-1].startswith("ready")

    def send(self, number: int) -> None:
        self.popen.send_signal(number)

    def stop(self, number: int = signal.SIGTERM) -> int:
        if self.popen.poll() is None:
            self.popen.send_signal(signal.SIGCONT)
            self.popen.send_signal(number)
        code = self.popen.wait(PATIENCE)
        assert self.popen.stdout is not None
        self.popen.stdout.close()
        return code


class Processes:
    """What a test has started."""

    def __init__(self, folder: Path) -> None:
        self.folder = folder
        self.running: list[Process] = []

    def start(self, *arguments: str) -> Process:
        process = Process(list(arguments), self.folder)
        self.running.append(process)
        return process

    def router(self, endpoint: str = "") -> tuple[Process, str]:
        endpoint = endpoint or free_endpoint()
        process = self.start("router", "--listen", endpoint)
        assert process.ready, process.said
        return process, endpoint

    def board(self, name: str = "bench", more: str = "", time: str = "lockstep") -> Process:
        process = self.try_board(name, more, time)
        assert process.ready, process.said
        return process

    def try_board(self, name: str, more: str = "", time: str = "lockstep") -> Process:
        path = self.folder / f"{name}-{len(self.running)}.toml"
        path.write_text(BOARD.format(name=name, more=more, time=time))
        return self.start("run", str(path))

    def start_elsewhere(self, name: str, more: str, runtime: Path) -> Process:
        """Start a board as if on another computer: with a runtime directory of its own."""
        path = self.folder / f"{name}-{len(self.running)}.toml"
        path.write_text(BOARD.format(name=name, more=more, time="lockstep"))
        process = Process(["run", str(path)], self.folder, str(runtime))
        self.running.append(process)
        return process

    def stop(self) -> None:
        for process in self.running:
            process.stop()


def connected_to(endpoint: str, more: str = "") -> str:
    """Return ``[zenoh]`` of a board that connects to a router."""
    return f'[zenoh]\nconnect = ["{endpoint}"]\n{more}'
