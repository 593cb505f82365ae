"""What ends a server that does not hear SIGINT or SIGTERM: a process beside it.

Python runs handlers of signals between two steps of the interpreter; while a step of compiled code,
or a call into another library, does not return, none is run. But the byte that C's own handler
writes (``signal.set_wakeup_fd``) is written at once. A small process reads it, and wakes the
server: a signal that came just before the server went to sleep has not woken it. If the server does
not say that it has heard, that process reports where it hangs and kills it; it is
:mod:`vbus.serve.time.watchdog_process`.
"""

import faulthandler
import os
import signal
import subprocess
import sys
from contextlib import suppress
from types import TracebackType

from vbus.serve.time import watchdog_process
from vbus.serve.time.watchdog_process import ENDINGS


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
                [sys.executable, "-I", "-S", watchdog_process.__file__,
                 *map(str, (os.getpid(), *passed))],
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
