"""Runs in which one call of the system fails: the first, the second, and so on to the last."""

import os
import random
import termios
from collections.abc import Iterator
from errno import (
    EACCES,
    ECONNABORTED,
    ECONNRESET,
    EIO,
    EMFILE,
    ENOMEM,
    ENOSPC,
    EPIPE,
    errorcode,
)
from pathlib import Path
from typing import Final

from tests.simulation.run import Outcome, SimulatedFile, Simulation
from tests.simulation.transcript import Wrong
from vbus.core.errors import VbusError
from vbus.core.runtime import private_runtime

CODES: Final = {
    "accept": (EMFILE, ECONNABORTED), "bind": (EACCES,), "close": (EIO,), "epoll": (EMFILE,),
    "eventfd": (EMFILE,), "fdatasync": (EIO,), "flock": (ENOMEM,), "ftruncate": (EIO,),
    "inotify": (EMFILE,), "listen": (EACCES,), "open": (EMFILE, EACCES),
    "openpty": (EMFILE, ENOSPC), "read": (EIO, ECONNRESET), "replace": (ENOSPC,),
    "setraw": (EIO,), "socket": (EMFILE,), "symlink_to": (ENOSPC,),
    "timerfd": (EMFILE,), "ttyname": (EIO,), "unlink": (EACCES,), "write": (EPIPE, EIO, ENOSPC),
}  # fmt: skip
"""How each call may fail. EINTR is not among them: Python makes such a call again itself. What is
written short is a matter of every run."""


class Failing(Simulation):
    """A run with hosts of every kind, in which one call fails.

    Args:
        seed: of the run.
        directory: for names.
        number: of the call; -1: none.
        code: which of the ways in which it may fail.
    """

    def __init__(self, seed: int, directory: Path, number: int, code: int) -> None:
        super().__init__(seed, directory)
        self.durable = "machine"
        self.system.looks = 0
        self.system.intrusion = self.system.shortage = 0.0
        self.file = SimulatedFile(self.system, 1 << 30)
        self.calls: list[str] = []
        self._failing = number
        self._code = code
        self.failed = ""
        self.started = False
        self.system.fail = self._fail

    def _kinds(self) -> list[str]:
        return ["pty", "unix", "zenoh"]

    def _manners(self) -> dict[str, float]:
        return {"leave": 0.2, "half": 0.2}

    def _fail(self, name: str) -> None:
        self.calls.append(name)
        if len(self.calls) - 1 == self._failing:
            code = CODES[name][self._code % len(CODES[name])]
            self.failed = f"{name}, {errorcode[code]}"
            kind = termios.error if name == "setraw" else OSError
            raise kind(code, os.strerror(code))

    def _whoever_comes_is_served(self) -> None:
        before = self.failed
        try:
            super()._whoever_comes_is_served()
        except Wrong:
            if self.failed == before:
                raise
            super()._whoever_comes_is_served()  # it was one of these hosts that it struck

    def _start(self) -> None:
        super()._start()
        self.started = True


def calls(seed: int) -> list[str]:
    """Return the calls of a run in which none fails."""
    with private_runtime() as directory:
        simulation = Failing(seed, directory, -1, 0)
        simulation.run()
        return simulation.calls


def failing(seed: int, number: int, code: int) -> str:
    """Make a run in which a call fails; return what is wrong, or ""."""
    with private_runtime() as directory:
        simulation = Failing(seed, directory, number, code)
        try:
            simulation.run()
        except Wrong as wrong:
            if simulation.failed.startswith("unlink") and "these names" in str(wrong):
                return ""  # what the system does not remove remains
            return f"{simulation.failed}: {wrong}"
        except VbusError as error:
            # The server does not start, and says why; nothing of it is left.
            left = [type(file).__name__ for file in simulation.system.files.values()]
            names = sorted(path.name for path in directory.rglob("*") if not path.is_dir())
            if simulation.failed.startswith("flock"):  # a lock nobody holds, and nobody minds
                names = [name for name in names if not name.endswith(".lock")]
            if simulation.started or left or names or not str(error):
                return f"{simulation.failed}: {error!r}, and {left}, {names} are left"
        return ""


def ways(seed: int) -> Iterator[tuple[int, int]]:
    """Yield every way in which a call of a run may fail."""
    for number, name in enumerate(calls(seed)):
        for code in range(len(CODES[name])):
            yield number, code


def failures(seed: int, most: int) -> Outcome:
    """Make a run again and again, and let each of its calls fail in every way.

    Args:
        seed: of the run.
        most: how many ways are tried at most; if there are more, these are drawn by the seed.
    """
    outcome = Outcome(seed, counts={"calls that failed": 0})
    try:
        all_ways = list(ways(seed))
    except Wrong as wrong:
        return Outcome(seed, f"no call fails, {wrong}")
    for number, code in random.Random(seed).sample(all_ways, min(most, len(all_ways))):
        outcome.counts["calls that failed"] += 1
        if wrong := failing(seed, number, code):
            outcome.wrong = f"call {number}, {wrong}"
            break
    return outcome
