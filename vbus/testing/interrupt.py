"""Ends a host of this process that hangs on a terminal, in the main thread or in another one."""

import ctypes
import signal
import sys
import threading
from collections.abc import Iterator
from types import FrameType
from typing import Any, Final, Self

from vbus.core.errors import VbusError
from vbus.testing.limits import HostStuck, HostWatch
from vbus.testing.serving import THREAD

NUMBER: Final = signal.SIGRTMAX - 1
"""A signal that other libraries rarely use; SIGALRM is that of pytest-timeout."""
_WAITS: Final = ("threading.py", "concurrent/futures/thread.py")
"""Files of Python in which a thread stands that has nothing to do."""
_AGAIN: Final = 100
"""Bus cycles after which a thread that goes on is interrupted once more."""
_END: Final = 10.0
"""Seconds that a thread has to end after its last interruption, on a machine that is busy, too."""


class Interrupt:
    """From entering the block to leaving it, a bound that is passed interrupts the host.

    That is each thread the test has started (``asyncio.to_thread``) and which works; without one it
    is the main thread, by a signal, whatever it waits for. A test that runs in another thread
    cannot be interrupted; it fails at its end.

    Args:
        watch: whose bounds.

    Attributes:
        allowed: whether the main thread runs the test now, and may be interrupted.
    """

    def __init__(self, watch: HostWatch) -> None:
        self.allowed: bool = True
        self._watch: Final = watch
        self._sent: bool = False
        self._before: Any = None
        self._main: Final = threading.main_thread()
        self._others: Final = set(threading.enumerate())
        """Threads that were there before."""
        self._at: dict[threading.Thread, int] = {}
        """Those that were interrupted, and at which bus cycle last."""

    def __enter__(self) -> Self:
        if threading.current_thread() is self._main:
            self._before = signal.signal(NUMBER, self._interrupted)
            self._watch.over = self._send
        return self

    def __exit__(self, *_: object) -> None:
        if self._watch.over is not None:
            self._watch.over = None
            signal.signal(NUMBER, self._before)

    def _working(self) -> Iterator[threading.Thread]:
        """Give the threads of the test that do not wait for something to do."""
        frames = sys._current_frames()
        for thread in threading.enumerate():
            frame = frames.get(thread.ident or 0)
            older = thread in self._others and not thread.name.startswith("asyncio_")
            if thread is self._main or older or thread.name == THREAD or frame is None:
                continue
            if not frame.f_code.co_filename.endswith(_WAITS):
                yield thread

    def _send(self, sentence: str) -> None:
        working = list(self._working())
        for thread in working:
            if self._watch.cycles >= self._at.get(thread, -_AGAIN) + _AGAIN:
                self._at[thread] = self._watch.cycles
                _raise_in(thread, self._watch.report())
        # One at a time: none may come while the last one is being answered.
        if not working and not self._sent and self._main.ident is not None:
            self._sent = True
            signal.pthread_kill(self._main.ident, NUMBER)

    def check_threads(self) -> None:
        """The terminal is gone: see that threads which hung on it end.

        Raises:
            VbusError: one goes on.
        """
        left = []
        for thread in self._at:
            thread.join(_END if thread in set(self._working()) else 0)
            if thread in set(self._working()):
                frame = sys._current_frames().get(thread.ident or 0)
                code = frame.f_code if frame is not None else None
                where = f" at {code.co_filename}:{frame.f_lineno}" if code and frame else ""
                left.append(f"{thread.name}{where}")
        if left:
            raise VbusError(
                "the test has left behind what hung on its terminal, and it goes on in the thread"
                f" {', '.join(left)}"
            )

    def _interrupted(self, number: int, frame: FrameType | None) -> None:
        __tracebackhide__ = True
        self._sent = False
        if self.allowed:
            self._watch.check()


def _raise_in(thread: threading.Thread, text: str) -> None:
    """Raise :class:`HostStuck` in another thread, when it runs its next line of Python."""

    class Hangs(HostStuck):
        def __init__(self) -> None:  # Python makes it itself, and has nothing to give it
            super().__init__(text)

    Hangs.__name__ = Hangs.__qualname__ = HostStuck.__name__
    Hangs.__module__ = HostStuck.__module__
    ctypes.pythonapi.PyThreadState_SetAsyncExc(
        ctypes.c_ulong(thread.ident or 0), ctypes.py_object(Hangs)
    )
