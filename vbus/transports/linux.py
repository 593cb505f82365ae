"""Linux calls that Python 3.11 does not have: timerfd, inotify, mlockall and adjtimex."""

import contextlib
import ctypes
import os
import struct
from typing import Final

IN_OPEN: Final = 0x20
IN_CLOSE: Final = 0x18
IN_MODIFY: Final = 0x02
_WATCHED: Final = IN_OPEN | IN_CLOSE | IN_MODIFY
_CLOCK_MONOTONIC: Final = 1
_CLOEXEC_NONBLOCK: Final = 0o2004000
_CURRENT_AND_FUTURE: Final = 3


class _Timespec(ctypes.Structure):
    _fields_ = [("seconds", ctypes.c_long), ("nanoseconds", ctypes.c_long)]


class _Itimerspec(ctypes.Structure):
    _fields_ = [("interval", _Timespec), ("value", _Timespec)]


class _Timex(ctypes.Structure):
    _fields_ = [
        ("modes", ctypes.c_uint), ("offset", ctypes.c_long), ("freq", ctypes.c_long),
        ("maxerror", ctypes.c_long), ("esterror", ctypes.c_long), ("status", ctypes.c_int),
        ("more", ctypes.c_long * 32),
    ]  # fmt: skip


_UNSYNCHRONISED: Final = 0x40
_PPM: Final = 65536

_libc = ctypes.CDLL(None, use_errno=True)


def _checked(result: int) -> int:
    if result < 0:
        code = ctypes.get_errno()
        raise OSError(code, os.strerror(code))
    return result


def lock_memory() -> None:
    """Keep all memory of this process, what it has and what it gets, from being paged out.

    Raises:
        OSError: it is not allowed so much.
    """
    _checked(_libc.mlockall(_CURRENT_AND_FUTURE))


def unlock_memory() -> None:
    """Let memory be paged out again."""
    _checked(_libc.munlockall())


def clock_discipline() -> tuple[int, float] | None:
    """Return how something (chrony, ptp4l, ntpd) keeps this computer's clock right; None: nothing.

    Returns:
        How far it may be from true time (us), and by how much it is slewed (ppm).

    Raises:
        OSError: the system does not tell.
    """
    clock = _Timex()
    _checked(_libc.adjtimex(ctypes.byref(clock)))
    return None if clock.status & _UNSYNCHRONISED else (clock.maxerror, clock.freq / _PPM)


class TimerFd:
    """A timer that makes a descriptor readable, late by tens of microseconds at most.

    The event loop's own timers are rounded to whole milliseconds.
    """

    def __init__(self) -> None:
        self.fd: int = _checked(_libc.timerfd_create(_CLOCK_MONOTONIC, _CLOEXEC_NONBLOCK))
        self._spec = _Itimerspec()

    def set(self, nanoseconds: int) -> None:
        """Fire once after ``nanoseconds`` (at least 1); 0 disarms."""
        self._spec.value.seconds, self._spec.value.nanoseconds = divmod(nanoseconds, 10**9)
        _checked(_libc.timerfd_settime(self.fd, 0, ctypes.byref(self._spec), None))

    def acknowledge(self) -> None:
        """Make the descriptor unreadable again."""
        with contextlib.suppress(BlockingIOError):
            os.read(self.fd, 8)

    def close(self) -> None:
        """Free the descriptor."""
        os.close(self.fd)


class Inotify:
    """Tells when files are opened, written to and closed."""

    def __init__(self) -> None:
        self.fd: int = _checked(_libc.inotify_init1(_CLOEXEC_NONBLOCK))

    def add(self, path: str) -> int:
        """Watch a file; return its number, which no other gets."""
        return _checked(_libc.inotify_add_watch(self.fd, path.encode(), _WATCHED))

    def remove(self, number: int) -> None:
        """Watch a file no more; it may be gone already."""
        _libc.inotify_rm_watch(self.fd, number)

    def read(self) -> list[tuple[int, int]]:
        """Return what happened since the last call, in order.

        Returns:
            The number of each file, and a bit of IN_OPEN, IN_CLOSE or IN_MODIFY; the number is -1
            if more happened than the system has noted.
        """
        events: list[tuple[int, int]] = []
        try:
            data = os.read(self.fd, 65536)
        except BlockingIOError:
            return events
        position = 0
        while position < len(data):
            number, mask, _, length = struct.unpack_from("iIII", data, position)
            position += 16 + length
            if mask & _WATCHED or number < 0:
                events.append((number, mask & _WATCHED))
        return events

    def close(self) -> None:
        """Free the descriptor."""
        os.close(self.fd)
