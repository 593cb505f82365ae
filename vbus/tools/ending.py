"""The end of a program under ``vbus exec``: signals passed on, and what is said when it hangs."""

import os
import signal
from contextlib import suppress
from pathlib import Path
from typing import Final

import click

PATIENCE: Final = 0.7
"""Seconds a program has, after SIGTERM or SIGINT, to end by itself."""

_STATES: Final = {
    "R": "is running", "S": "sleeps in the kernel", "D": "waits for a device", "T": "is stopped",
    "t": "is stopped by a debugger",
}  # fmt: skip


def descendants(pid: int) -> list[int]:
    """Return a process and all that come from it, the youngest last."""
    found = [pid]
    for one in found:
        for task in _tasks(one):
            children = _read(f"/proc/{one}/task/{task}/children")
            found += [int(child) for child in children.split()]
    return found


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


def what_hangs(pid: int) -> list[str]:
    """Return a sentence for each thread of the processes that are left."""
    lines = []
    for one in descendants(pid):
        for task in _tasks(one):
            name = _read(f"/proc/{one}/task/{task}/comm").strip()
            state = _read(f"/proc/{one}/task/{task}/stat").rpartition(")")[2].split()[:1]
            if not state or state[0] in "ZX":
                continue
            where = _read(f"/proc/{one}/task/{task}/wchan").strip("0")
            does = _STATES.get(state[0], f"is in state {state[0]}")
            lines.append(
                f"{name} (process {one}, thread {task}) {does}" + (f" in {where}" if where else "")
            )
    return lines


def end(pid: int, number: int) -> None:
    """Kill what has not ended, and say what it was doing."""
    hangs = what_hangs(pid)
    for one in descendants(pid):
        with suppress(ProcessLookupError):
            os.kill(one, signal.SIGKILL)
    with suppress(OSError):  # nobody may be there who reads it
        click.echo(
            f"vbus exec: {signal.Signals(number).name} has not ended the program within"
            f" {PATIENCE:g} s; it is killed",
            err=True,
        )
        for line in hangs:
            click.echo(f"vbus exec: {line}", err=True)


def explain(code: int, note: Path) -> None:
    """Say why a program died of SIGSEGV that the library was not asked about.

    Args:
        code: what the process ended with, negative for a signal.
        note: the file the library makes when the fault is the program's own.
    """
    if code == -signal.SIGSEGV and not note.exists():
        click.echo(
            "vbus exec: the program died of SIGSEGV and the library was not asked: by a system call"
            " of its own, not by the C library, it has blocked that signal or taken its handler"
            " away, and each access to the card needs both; a program without the C library"
            " cannot be served",
            err=True,
        )
