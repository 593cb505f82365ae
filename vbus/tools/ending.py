"""The end of processes we have started: what hangs or is left behind is ended, and named."""

import asyncio
import ctypes
import os
import signal
import sys
from collections.abc import Callable
from contextlib import suppress
from pathlib import Path
from typing import Final

import click

PATIENCE: Final = 0.7
"""Seconds a program has, after SIGTERM or SIGINT, to end by itself."""

_LOOK: Final = 0.02
"""Seconds between looks whether what was left behind has ended."""

_DEATH_SIGNAL: Final = 1
_SUBREAPER: Final = 36
"""What the system call prctl is asked for: PR_SET_PDEATHSIG, PR_SET_CHILD_SUBREAPER."""

_STATES: Final = {
    "R": "is running", "S": "sleeps in the kernel", "D": "waits for a device", "T": "is stopped",
    "t": "is stopped by a debugger",
}  # fmt: skip


class Offspring:
    """The program and the processes that come from it, also where their parents have ended.

    Those become children of this process, as long as this object is in use.
    """

    def __init__(self) -> None:
        self._others = set(_children(os.getpid()))
        self._parent = os.getpid()
        _ask(_SUBREAPER, 1)

    def close(self) -> None:
        """Care for orphans no more."""
        _ask(_SUBREAPER, 0)

    def die_with_parent(self) -> None:
        """Have the system kill this process, the program's, once its parent is no more."""
        _ask(_DEATH_SIGNAL, signal.SIGKILL)
        if os.getppid() != self._parent:
            os.kill(os.getpid(), signal.SIGKILL)

    def there(self) -> list[int]:
        """Return those that run, the youngest last."""
        found = [child for child in _children(os.getpid()) if child not in self._others]
        for one in found:
            found += _children(one)
        return [pid for pid in found if _state(pid) not in ("", "Z", "X")]

    def bury(self, program: int = 0) -> None:
        """Take notice of the ends of orphans; of the program's somebody else does."""
        for child in _children(os.getpid()):
            if child not in self._others and child != program:
                with suppress(ChildProcessError):
                    os.waitpid(child, os.WNOHANG)

    def slay(self) -> None:
        """Kill those that run."""
        for pid in self.there():
            with suppress(ProcessLookupError):
                os.kill(pid, signal.SIGKILL)

    def kill(self, number: int) -> None:
        """Kill what has not ended after signal ``number``, and say what it was doing."""
        hangs = what_hangs(self.there())
        self.slay()
        _say(
            f"{signal.Signals(number).name} has not ended the program within {PATIENCE:g} s; it is"
            " killed",
            *hangs,
        )

    async def end(self, until: float) -> None:
        """End those that run: by SIGTERM, and by SIGKILL at ``until`` by the loop's clock."""
        loop = asyncio.get_running_loop()
        for pid in self.there():
            with suppress(ProcessLookupError):
                os.kill(pid, signal.SIGTERM)
        while self.there() and loop.time() < until:
            await asyncio.sleep(_LOOK)
            self.bury()
        if self.there():
            self.kill(signal.SIGTERM)


def end_with_parent() -> Callable[[], None]:
    """Return what a child of this process calls before its program: SIGTERM ends both as one.

    The system sends it that signal once this process is no more, however it has ended.
    """
    parent = os.getpid()

    def agree() -> None:
        _ask(_DEATH_SIGNAL, signal.SIGTERM)
        if os.getppid() != parent:
            os.kill(os.getpid(), signal.SIGKILL)

    return agree


def _ask(what: int, value: int) -> None:
    if sys.platform == "linux":
        ctypes.CDLL(None).prctl(what, value, 0, 0, 0)


def _children(pid: int) -> list[int]:
    texts = [_read(f"/proc/{pid}/task/{task}/children") for task in _tasks(pid)]
    return [int(child) for text in texts for child in text.split()]


def _state(pid: int, task: int | str = "") -> str:
    """Return the letter that the kernel has for what a process, or a thread, does; "" for none."""
    where = f"/proc/{pid}/task/{task}/stat" if task else f"/proc/{pid}/stat"
    return next(iter(_read(where).rpartition(")")[2].split()), "")


def _say(*sentences: str) -> None:
    with suppress(OSError):  # nobody may be there who reads it
        for sentence in sentences:
            click.echo(f"vbus exec: {sentence}", err=True)


def say_left(pids: list[int]) -> None:
    """Name the processes that a program has left behind on a board that ends with it."""
    names = ", ".join(f"{_read(f'/proc/{pid}/comm').strip()} (process {pid})" for pid in pids)
    _say(
        f"the program has ended and left behind: {names}; that ends too, with the board; what shall"
        " go on needs a board that runs already (--join)"
    )


def _tasks(pid: int) -> list[str]:
    try:
        return sorted(os.listdir(f"/proc/{pid}/task"), key=int)
    except OSError:
        return []


def _read(path: str) -> str:
    try:
        return Path(path).read_text()
    except OSError:
        return ""


def what_hangs(pids: list[int]) -> list[str]:
    """Return a sentence for each thread of these processes."""
    lines = []
    for one in pids:
        for task in _tasks(one):
            name = _read(f"/proc/{one}/task/{task}/comm").strip()
            state = _state(one, task)
            if state in ("", "Z", "X"):
                continue
            where = _read(f"/proc/{one}/task/{task}/wchan").strip("0")
            does = _STATES.get(state, f"is in state {state}")
            lines.append(
                f"{name} (process {one}, thread {task}) {does}" + (f" in {where}" if where else "")
            )
    return lines


def explain(code: int, note: Path) -> None:
    """Say why a program died of SIGSEGV that the library was not asked about.

    Args:
        code: what the process ended with, negative for a signal.
        note: the file the library makes when the fault is the program's own.
    """
    if code == -signal.SIGSEGV and not note.exists():
        _say(
            "the program died of SIGSEGV and the library was not asked: by a system call"
            " of its own, not by the C library, it has blocked that signal or taken its handler"
            " away, and each access to the card needs both; a program without the C library"
            " cannot be served"
        )
