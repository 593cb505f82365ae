"""Whether a process that is waited for has turns: a busy machine may give it none for seconds."""

import os
import socket
import struct
from contextlib import suppress
from typing import Final

from vbus.core.wall_clock import monotonic
from vbus.serve.time.watchdog_process import BUSY

_TICKS: Final = os.sysconf("SC_CLK_TCK")
_CREDENTIALS: Final = struct.Struct("3i")


def process_behind(link: socket.socket) -> tuple[int, int]:
    """Return the other process of a Unix socket, and its user, as the system knows them."""
    found = link.getsockopt(socket.SOL_SOCKET, socket.SO_PEERCRED, _CREDENTIALS.size)
    process, user, _ = _CREDENTIALS.unpack(found)
    return process, user


class Turns:
    """What a process has of the processors from now on.

    Args:
        pid: its number.
    """

    def __init__(self, pid: int) -> None:
        self._pid: int = pid
        self._begun: float = monotonic()
        self._before: int = _look(pid)[1]

    def lacking(self) -> bool:
        """Whether it would go on if others did not have the processors, or the disk."""
        if self._pid == os.getpid():  # it asks
            return False
        waits, used = _look(self._pid)
        return waits and used - self._before < BUSY * (monotonic() - self._begun) * _TICKS


def _look(pid: int) -> tuple[bool, int]:
    """Return whether a thread of a process wants to run (R) or waits for a disk (D); its ticks."""
    waits, used = False, 0
    with suppress(OSError):  # it has ended
        for task in os.listdir(f"/proc/{pid}/task"):
            with open(f"/proc/{pid}/task/{task}/stat") as file:
                fields = file.read().rpartition(")")[2].split()
            waits |= fields[0] in ("R", "D")
            used += int(fields[11]) + int(fields[12])
    return waits, used
