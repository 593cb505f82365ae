"""Processes of an example: started, and stopped by their ids."""

import contextlib
import signal
import subprocess
from pathlib import Path
from typing import Any

from vbus.core.errors import VbusError

STOP_SECONDS = 20


class Part:
    """A process of the example; without a log its errors are those of the command."""

    def __init__(self, name: str, command: list[str], log: Path | None, **more: Any) -> None:
        self.name = name
        self.log = log
        self.errors = log.open("w") if log is not None else None
        self.process = subprocess.Popen(
            command, stdin=subprocess.DEVNULL, stderr=self.errors, text=True, **more
        )

    def stop(self) -> None:
        """End it as Ctrl-C would, and wait; what does not end is killed."""
        with contextlib.suppress(ProcessLookupError):
            self.process.send_signal(signal.SIGINT)
        try:
            self.process.wait(STOP_SECONDS)
        except subprocess.TimeoutExpired:
            self.process.kill()
            self.process.wait()
        if self.process.stdout is not None:
            self.process.stdout.close()
        if self.errors is not None:
            self.errors.close()

    def said(self) -> str:
        """Return what it has written to its standard error."""
        return self.log.read_text().strip() if self.log is not None else ""

    def end(self) -> str:
        """Return how it has ended, and what it has said."""
        code = self.process.returncode
        how = f"ended with code {code}" if code >= 0 else f"was killed by signal {-code}"
        return f"{how}: {said}" if (said := self.said()) else how


def endpoint_of(router: Part) -> str:
    """Return where the router listens, once it does."""
    assert router.process.stdout is not None
    endpoint = ""
    for line in router.process.stdout:
        if line.startswith("router: "):
            endpoint = str(line).removeprefix("router: ").strip()
        if line.startswith("ready"):
            return endpoint
    raise VbusError(f"the router has not started: {router.said()}")
