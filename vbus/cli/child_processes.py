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

from vbus.cli.output import complain
from vbus.cli.proc import children, name_of, offspring, what_hangs
from vbus.serve.time.watchdog_process import Turns

# Longer than a program's clean-up takes, shorter than a person waits after Ctrl-C.
PATIENCE: Final = 0.7
"""Seconds a program has, after SIGTERM or SIGINT, to end by itself; counted in steps of
:data:`_LOOK`, so that those in which this process stood still are not held against it."""

# Short beside PATIENCE: what has ended is not waited for much longer than it took.
_LOOK: Final = 0.02
"""Seconds between looks whether it has ended."""

_DEATH_SIGNAL: Final = 1
_SUBREAPER: Final = 36
"""What the system call prctl is asked for: PR_SET_PDEATHSIG, PR_SET_CHILD_SUBREAPER."""


class ChildProcesses:
    """The program and the processes that come from it, also where their parents have ended.

    Those become children of this process, as long as this object is in use.

    Args:
        report: takes sentences about them.
    """

    def __init__(self, report: Callable[[str], None]) -> None:
        self._report = report
        # Children that this process had before are none of the program's: they are left alone.
        self._others = set(children(os.getpid()))
        self._waited = 0.0
        _ask(_SUBREAPER, 1)

    def close(self) -> None:
        """Care for orphans no more."""
        # What ended before the first look, or was killed, would stay in the table of processes.
        self.reap()
        _ask(_SUBREAPER, 0)

    def there(self) -> list[int]:
        """Return those that run, the youngest last."""
        return offspring(child for child in children(os.getpid()) if child not in self._others)

    def reap(self, program: int = 0) -> None:
        """Take notice of the ends of orphans; the end of the program is awaited elsewhere."""
        for child in children(os.getpid()):
            # Not the program: the loop waits for it, and its exit code is there once.
            if child not in self._others and child != program:
                with suppress(ChildProcessError):
                    os.waitpid(child, os.WNOHANG)

    def send(self, number: int) -> None:
        """Send a signal to those that run."""
        for pid in self.there():
            with suppress(ProcessLookupError):
                os.kill(pid, number)

    async def see_end(self, number: int, program: int = 0) -> None:
        """Kill what has not ended after a signal, and say what it was doing.

        The time they have counts from the first call on.

        Args:
            number: the signal.
            program: its end is awaited elsewhere; 0: it has ended.
        """
        turns = Turns(self.there)
        while there := self.there():
            if self._waited >= PATIENCE and not turns.lacking(self._waited, PATIENCE):
                break
            await asyncio.sleep(_LOOK)
            self._waited += _LOOK
            # Orphans are no children of the loop's own: asyncio calls no handler for their end.
            self.reap(program)
        if not there:
            return
        hangs = what_hangs(there)
        self.send(signal.SIGKILL)
        name = signal.Signals(number).name
        waited = max(self._waited, PATIENCE)
        self._report(f"{name} has not ended the program within {waited:.1f} s; it is killed")
        for line in hangs:
            self._report(line)
        await asyncio.sleep(_LOOK)

    def say_left(self, pids: list[int]) -> None:
        """Name the processes that a program has left behind on a board that ends with it."""
        names = ", ".join(f"{name_of(pid)} (process {pid})" for pid in pids)
        self._report(
            f"the program has ended and left behind: {names}; that ends too, with the board; what"
            " shall go on needs a board that runs already (--join)"
        )

    def explain(self, code: int, note: Path, interrupt: int, line: str) -> None:
        """Say why a program died of a signal that the library has to do with.

        Args:
            code: what the process ended with, negative for a signal.
            note: the file the library makes when the fault is the program's own.
            interrupt: the signal that the card's interrupt sends; 0: none.
            line: which line that is, and when it last interrupted, as far as it is known.
        """
        if interrupt and code == -interrupt:
            name = signal.Signals(interrupt).name
            self._report(
                f"the program died of {name}, which an interrupt sends ({line}): it had no handler"
                " for it then, and what the system does without one is to end the program. Install"
                " the handler before the chip can interrupt (some do so after a reset), block the"
                " signal until then, or take signal out of the card in the board file"
            )
        if code == -signal.SIGSEGV and not note.exists():
            self._report(
                "the program died of SIGSEGV and the library was not asked: by a system call"
                " of its own, not by the C library, it has blocked that signal or taken its handler"
                " away, and each access to the card needs both; a program without the C library"
                " cannot be served"
            )


def end_with_parent(number: int = signal.SIGTERM) -> Callable[[], None]:
    """Return what a child of this process calls before its program.

    The system sends it signal ``number`` once this process is no more, however it has ended.
    """
    parent = os.getpid()

    def agree() -> None:
        _ask(_DEATH_SIGNAL, number)
        # The parent may have ended before the request: no signal would come then.
        if os.getppid() != parent:
            os.kill(os.getpid(), signal.SIGKILL)

    return agree


def _ask(what: int, value: int) -> None:
    if sys.platform == "linux":
        # Python has no prctl.
        ctypes.CDLL(None).prctl(what, value, 0, 0, 0)


def say(sentence: str) -> None:
    """Print a sentence of ``vbus exec`` on standard error."""
    complain(sentence, "vbus exec: ")
