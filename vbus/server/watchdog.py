"""What ends a server that does not hear SIGINT or SIGTERM: a process beside it.

Python runs handlers of signals between two steps of the interpreter; while a step of compiled code,
or a call into somebody's library, does not return, none is run. But the byte that C's own handler
writes (``signal.set_wakeup_fd``) is written at once. A small process reads it, and wakes the
server: a signal that came just before the server went to sleep has woken nobody. If the server does
not say that it has heard, that process tells where it hangs and kills it.

Seconds are counted in steps of :data:`LOOK`, so that those in which the machine itself stood still
are not held against the server.
"""

import faulthandler
import os
import select
import signal
import subprocess
import sys
from contextlib import suppress
from types import TracebackType
from typing import Final

ENDINGS: Final = frozenset({signal.SIGINT, signal.SIGTERM})
PATIENCE: Final = 0.7
"""Seconds in which a server says that it has heard."""
CLOSING: Final = 10.0
"""Seconds in which one that has heard closes its links and recordings."""
BUSY: Final = 0.4
"""Seconds of processor time without which a server that wants to run is starved, not stuck."""
STARVED: Final = 10.0
"""Seconds after which it is killed all the same."""
LOOK: Final = 0.05
_DUMP: Final = 0.1
"""Seconds a server has to write down where it hangs."""


class Watchdog:
    """The server's side; a context in which SIGINT and SIGTERM have an effect.

    Attributes:
        wake: becomes readable when a signal has come.
    """

    def __enter__(self) -> "Watchdog":
        """Start the process; from here on C's handler tells it of signals."""
        with suppress(OSError, ValueError):  # no stderr to write to
            faulthandler.enable()
        signals, self._signals = os.pipe2(os.O_CLOEXEC | os.O_NONBLOCK)
        heard, self._heard = os.pipe2(os.O_CLOEXEC | os.O_NONBLOCK)
        self.wake, wake = os.pipe2(os.O_CLOEXEC | os.O_NONBLOCK)
        server = os.pidfd_open(os.getpid())
        passed = (signals, heard, wake, server)
        # The process inherits what is blocked: Ctrl-C is for all of a terminal, and not for it.
        unblocked = signal.pthread_sigmask(signal.SIG_BLOCK, ENDINGS)
        self._process: subprocess.Popen[bytes] | None = None
        with suppress(OSError):  # no process to be had: then without
            self._process = subprocess.Popen(
                [sys.executable, "-I", "-S", __file__, str(os.getpid()), *map(str, passed)],
                stdin=subprocess.DEVNULL, stdout=subprocess.DEVNULL, pass_fds=passed,
            )  # fmt: skip
        signal.pthread_sigmask(signal.SIG_SETMASK, unblocked)
        for fd in passed:
            os.close(fd)
        self._before: int = signal.set_wakeup_fd(self._signals, warn_on_full_buffer=False)
        return self

    def woken(self) -> bool:
        """Take what has made :attr:`wake` readable; False if nothing ever will again."""
        return bool(os.read(self.wake, 64))

    def heard(self) -> None:
        """A handler runs: the server is not stuck."""
        with suppress(OSError):  # the process has been killed
            os.write(self._heard, b"\0")

    def __exit__(
        self,
        kind: type[BaseException] | None,
        error: BaseException | None,
        trace: TracebackType | None,
    ) -> None:
        """The server has ended in order; so does the process."""
        signal.set_wakeup_fd(self._before)
        os.close(self._signals)
        os.close(self._heard)
        os.close(self.wake)
        if self._process is not None:
            self._process.wait()


# -- the process beside it ------------------------------------------------------------------------


def _watch(pid: int, signals: int, heard: int, wake: int, server: int) -> None:
    """Wait for a signal; see that the server hears it and ends."""
    poll = select.poll()
    poll.register(signals, select.POLLIN)
    poll.register(server, select.POLLIN)
    while True:
        ready = dict(poll.poll())
        if server in ready:
            return
        numbers = os.read(signals, 64)
        if not numbers:
            return
        for number in numbers:
            if number in ENDINGS:
                with suppress(OSError):  # it has ended
                    os.write(wake, b"\0")
                _see_it_end(pid, signal.Signals(number).name, heard, server)
                return


def _see_it_end(pid: int, name: str, heard: int, server: int) -> None:
    waited, longest, before = 0.0, PATIENCE, _state(pid)[1]
    poll = select.poll()
    poll.register(heard, select.POLLIN)
    poll.register(server, select.POLLIN)
    while True:
        if ready := dict(poll.poll(LOOK * 1000)):
            if ready != {heard: select.POLLIN}:
                return
            poll.modify(heard, 0)  # that it is closed is told all the same
            longest = CLOSING
            continue
        waited += LOOK
        if waited < longest:
            continue
        state, used = _state(pid)
        starved = state == "R" and used - before < BUSY
        if state in "Tt" or (starved and waited < STARVED):
            continue
        sys.stderr.write(
            f"vbus: {name} has not ended process {pid} within {waited:.1f} s; it is killed, and"
            " this is where it stood\n"
        )
        sys.stderr.flush()
        signal.pidfd_send_signal(server, signal.SIGABRT)
        poll.poll(_DUMP * 1000)
        signal.pidfd_send_signal(server, signal.SIGKILL)
        return


def _state(pid: int) -> tuple[str, float]:
    """Return the state of a process' main thread, and the seconds it has run."""
    try:
        with open(f"/proc/{pid}/task/{pid}/stat") as file:
            fields = file.read().rpartition(")")[2].split()
    except OSError:
        return "X", 0.0
    return fields[0], (int(fields[11]) + int(fields[12])) / os.sysconf("SC_CLK_TCK")


if __name__ == "__main__":
    with suppress(ProcessLookupError):
        _watch(*map(int, sys.argv[1:]))
