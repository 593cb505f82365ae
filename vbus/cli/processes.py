"""Processes that begin and end together, and whose output is shown with their names in front."""

import os
import selectors
import signal
import socket
import subprocess
import time
from collections import deque
from collections.abc import Callable, Sequence
from contextlib import ExitStack
from dataclasses import dataclass, field
from functools import partial
from typing import Final

from vbus.cli.child_processes import end_with_parent
from vbus.cli.proc import what_hangs
from vbus.core.errors import VbusError
from vbus.serve.registry import TURN_SECONDS
from vbus.serve.time.watchdog_process import Turns

# A traceback's last frames and its message, on one screen with the rest.
LAST_LINES: Final = 10
"""How many lines of a process that has died are repeated."""
LONGEST_LINE: Final = 65_536
"""Bytes after which a line is shown, whether it has an end or not."""
_ASKING: Final = (signal.SIGINT, signal.SIGTERM, signal.SIGHUP)


class ProcessDiedError(VbusError):
    """A process has ended that others need.

    Attributes:
        code: what it ended with; negative: the signal.
    """

    def __init__(self, text: str, code: int) -> None:
        super().__init__(text)
        self.code: int = code


@dataclass(eq=False, slots=True)
class Child:
    """One process.

    Attributes:
        name: for its lines.
        what: for sentences, such as "node x".
        popen: the process.
        taken: is given each line; returns whether it has made something of it, so that it is not
            shown.
        ready: whether it does what it is for; set by who takes its lines.
        ended: whether it has ended.
        last: its last lines that were shown.
        rest: what it has said of a line that is not whole.
    """

    name: str
    what: str
    popen: subprocess.Popen[bytes]
    taken: Callable[["Child", str], bool]
    ready: bool = False
    ended: bool = False
    last: deque[str] = field(default_factory=lambda: deque(maxlen=LAST_LINES))
    rest: bytes = b""

    @property
    def pid(self) -> int:
        """Its number."""
        return self.popen.pid

    @property
    def output(self) -> int:
        """The descriptor of what it says."""
        assert self.popen.stdout is not None
        return self.popen.stdout.fileno()

    def __str__(self) -> str:
        return f"{self.what} (process {self.pid})"


class Processes:
    """Starts processes, shows what they say, and ends all of them, whatever happens.

    SIGINT, SIGTERM and SIGHUP ask for the end; a second one kills what has not ended. As long as
    this object is in use they do nothing else. Processes end with this one, however that ends.

    Args:
        show: takes lines.
        patience: seconds a process may take to end, once it is asked to.
        width: of the longest name.
    """

    def __init__(self, show: Callable[[str], None], patience: float, width: int = 0) -> None:
        self._show: Callable[[str], None] = show
        self._patience: float = patience
        self._width: int = width
        self.children: list[Child] = []
        self.asked: int = 0
        self.killed: list[str] = []
        self._died: list[Child] = []
        """Those whose end :meth:`_step` has seen."""
        self._stack: ExitStack = ExitStack()
        self._selector: selectors.BaseSelector = selectors.DefaultSelector()

    def __enter__(self) -> "Processes":
        woken, wake = socket.socketpair()
        for end in (woken, wake):
            self._stack.enter_context(end)
            end.setblocking(False)
        # A signal becomes a byte for select(): no handler runs in the midst of what this does.
        before = signal.set_wakeup_fd(wake.fileno(), warn_on_full_buffer=False)
        self._stack.callback(signal.set_wakeup_fd, before)
        for number in _ASKING:
            handler = signal.signal(number, lambda *_: None)
            self._stack.callback(signal.signal, number, handler)
        self._stack.enter_context(self._selector)
        self._watch(woken.fileno(), lambda: self._signalled(woken.recv(64)))
        return self

    def _watch(self, descriptor: int, happened: Callable[[], object]) -> None:
        self._selector.register(descriptor, selectors.EVENT_READ, happened)

    def _signalled(self, numbers: bytes) -> None:
        self.asked += sum(number in _ASKING for number in numbers)

    def __exit__(self, *_: object) -> None:
        with self._stack:
            self.end()

    def start(
        self,
        name: str,
        what: str,
        command: Sequence[str],
        taken: Callable[[Child, str], bool] = lambda child, line: False,
    ) -> Child:
        """Start a process with a group of its own, so that Ctrl-C does not reach it.

        Args:
            name: stands in front of its lines.
            what: how sentences name it.
            command: program and arguments.
            taken: see :class:`Child`.
        """
        # Who waits for our own word that all is ready shall not take a child's for it.
        known = {key: value for key, value in os.environ.items() if key != "NOTIFY_SOCKET"}
        popen = subprocess.Popen(
            command,
            env=known,
            stdin=subprocess.DEVNULL,
            stdout=subprocess.PIPE,
            stderr=subprocess.STDOUT,
            # Lines are put together here: a buffer would hold back what a process says last.
            bufsize=0,
            process_group=0,
            preexec_fn=end_with_parent(),
        )
        child = Child(name, what, popen, taken)
        self.children.append(child)
        os.set_blocking(child.output, False)
        # The end of a process is an event beside its lines: no handler of SIGCHLD is needed.
        ended = os.pidfd_open(child.pid)
        self._stack.callback(os.close, ended)
        if popen.stdout is not None:
            self._stack.enter_context(popen.stdout)
        self._watch(ended, partial(self._ended, child, ended))
        self._watch(child.output, partial(self._read, child))
        return child

    def until(
        self, condition: Callable[[], bool], may_end: Callable[[Child], bool] = lambda child: False
    ) -> bool:
        """Show what processes say until a condition holds.

        Args:
            condition: looked at whenever something has happened.
            may_end: tells whether a process may have ended, if it has ended well.

        Returns:
            Whether it holds; if not, the user has asked for the end.

        Raises:
            ProcessDiedError: a process has ended; names it.
        """
        while True:
            # An end with an error counts even where the process was allowed to end.
            died = [child for child in self._step() if _code(child) or not may_end(child)]
            if self.asked:
                return False
            if died:
                # Who was killed is the cause; others may have ended because of it.
                raise self._death(min(died, key=lambda child: min(_code(child), 0)))
            if condition():
                return True

    def end(self) -> None:
        """End all that run, the youngest first asked, and wait for them; kill what takes too long.

        What had to be killed is named in :attr:`killed`.
        """
        for child in reversed(self.children):
            if not child.ended:
                # In reverse order of their start: nodes go before the router at which they meet.
                for number in (signal.SIGTERM, signal.SIGCONT):
                    # One that was stopped (Ctrl-Z) would not hear of it.
                    os.kill(child.pid, number)
        began = time.monotonic()
        turns = [(child, Turns(partial(list, (child.pid,)))) for child in self.children]
        while any(not child.ended for child in self.children):
            waited = time.monotonic() - began
            # One that has no turn, because others have the processors, has longer.
            late = waited >= self._patience and not any(
                not child.ended and one.lacking(waited, self._patience) for child, one in turns
            )
            if late or self.asked > 1:
                self._kill()
                return
            self._step(max(self._patience - waited, TURN_SECONDS))

    def _kill(self) -> None:
        """Kill what runs, and say so."""
        for child in [child for child in self.children if not child.ended]:
            hangs = what_hangs([child.pid])
            os.kill(child.pid, signal.SIGKILL)
            sentence = f"{child} did not end within {self._patience:g} s; it is killed"
            if self.asked > 1:
                sentence = f"{child} did not end when it was asked again; it is killed"
            self.killed.append("\n  ".join([sentence, *hangs]))
        while any(not child.ended for child in self.children):
            self._step()

    def _step(self, seconds: float | None = None) -> list[Child]:
        """Wait until something happens, and take it in; return who has ended."""
        for key, _ in self._selector.select(seconds):
            key.data()
        died, self._died = self._died, []
        return died

    def _ended(self, child: Child, descriptor: int) -> None:
        self._selector.unregister(descriptor)
        child.popen.wait()
        child.ended = True
        while self._read(child):  # what comes from it may go on, and say more
            pass
        self._finish_line(child)
        self._died.append(child)

    def _read(self, child: Child) -> bool:
        """Show what a process has said; tell whether there may be more."""
        if child.output not in self._selector.get_map():
            return False
        try:
            data = os.read(child.output, LONGEST_LINE)
        except BlockingIOError:
            return False
        if not data:
            self._selector.unregister(child.output)
            return False
        *lines, child.rest = (child.rest + data).split(b"\n")
        for line in lines:
            self._line(child, line)
        # Before it is ready its one long line is JSON, which is taken whole.
        if len(child.rest) > LONGEST_LINE and child.ready:
            self._finish_line(child)
        return True

    def _finish_line(self, child: Child) -> None:
        rest, child.rest = child.rest, b""
        if rest:
            self._line(child, rest)

    def _line(self, child: Child, data: bytes) -> None:
        line = data.decode(errors="replace")
        if not child.taken(child, line):
            child.last.append(line)
            self._show(f"{child.name:<{self._width}} | {line}")

    def _death(self, child: Child) -> ProcessDiedError:
        code = _code(child)
        if not code:  # an order has stopped it
            return ProcessDiedError(f"{child} ended, and the machine with it", 0)
        how = f"ended with exit code {code}"
        if code < 0:
            how = f"died of {signal.Signals(-code).name}"
        last = ["its last lines:", *child.last] if child.last else ["nothing was said"]
        text = "\n  ".join([f"{child} {how}, and the machine with it; {last[0]}", *last[1:]])
        return ProcessDiedError(text, code)


def _code(child: Child) -> int:
    """Return what a process that has ended ended with."""
    code = child.popen.returncode
    assert code is not None
    return code
