"""Running a program beside a board that lives as long as the program does."""

import asyncio
import os
import signal
import tempfile
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path

import click

from vbus.errors import VbusError
from vbus.server.server import Server
from vbus.signals import Observer, Violation


class Findings(Observer):
    """Remembers the first violation of each rule by each chip, and counts the others."""

    def __init__(self) -> None:
        self.first: dict[tuple[str, str], Violation] = {}
        self.count: dict[tuple[str, str], int] = {}

    def violation(self, violation: Violation) -> None:
        """Note one."""
        key = (violation.chip, violation.rule)
        self.first.setdefault(key, violation)
        self.count[key] = self.count.get(key, 0) + 1

    def lines(self) -> list[str]:
        """Return a sentence for each rule that was broken, in the order of the first breach."""
        lines = []
        for key, violation in self.first.items():
            others = self.count[key] - 1
            more = f" (and {others} more)" if others else ""
            when = violation.when / 1e6
            lines.append(
                f"{violation.severity}: {violation.chip}: {violation.rule} ({violation.clause})"
                f" at {when:.3f} us: {violation.detail}{more}"
            )
        return lines


@contextmanager
def private_runtime() -> Iterator[Path]:
    """Give a folder for links; it is the runtime directory unless the user has named one.

    So runs of one board beside each other, as in CI, do not meet.
    """
    with tempfile.TemporaryDirectory(prefix="vbus-") as folder:
        named = os.environ.get("VBUS_RUNTIME")
        if named is None:
            os.environ["VBUS_RUNTIME"] = folder
        try:
            yield Path(folder)
        finally:
            if named is None:
                del os.environ["VBUS_RUNTIME"]


def run_beside(server: Server, command: list[str], on_end: Callable[[], None] | None = None) -> int:
    """Serve a board while ``command`` runs; return the command's exit code.

    SIGINT and SIGTERM are passed on to it. A command that died of a signal gives 128 + its number.

    Args:
        server: the board with its links, not yet started.
        command: program and arguments; it inherits the standard streams.
        on_end: called when it has ended and before the links are closed.

    Raises:
        TransportError: a link cannot be opened.
        VbusError: the program cannot be started.
    """
    return asyncio.run(_run_beside(server, command, on_end))


async def _run_beside(server: Server, command: list[str], on_end: Callable[[], None] | None) -> int:
    loop = asyncio.get_running_loop()
    server.start(loop)
    try:
        try:
            process = await asyncio.create_subprocess_exec(*command)
        except OSError as error:
            raise VbusError(f"{command[0]}: {error.strerror}") from error
        for number in (signal.SIGINT, signal.SIGTERM):
            loop.add_signal_handler(number, _pass_on, process, number)
        code = await process.wait()
        # What the program sent last may still be on its way.
        await asyncio.sleep(0)
        if on_end is not None:
            on_end()
    finally:
        server.stop()
    return code if code >= 0 else 128 - code


def _pass_on(process: asyncio.subprocess.Process, number: int) -> None:
    if process.returncode is None:
        process.send_signal(number)


def tell(findings: Findings) -> None:
    """Print what a host has broken where errors belong."""
    for line in findings.lines():
        click.echo(f"vbus: {line}", err=True)
