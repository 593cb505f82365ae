"""Real time on request: a process ahead of all others, in locked memory, on one processor."""

import os
import resource
from typing import Final

from msgspec import Struct

from vbus.core.errors import OptionError, VbusError
from vbus.transports.linux import lock_memory, unlock_memory

FIFO: Final = 10
"""Priority of ``fifo`` alone: above all that is not real time, below the kernel's own threads."""
LIMITS: Final = "/etc/security/limits.conf"


class Priority(Struct, frozen=True):
    """What a process asks of the system, for itself and not for the processes it starts.

    Attributes:
        fifo: priority in the class SCHED_FIFO (1 to 99), with all memory locked; 0: the usual
            class.
        cpu: the one processor to run on; -1: any.
    """

    fifo: int = 0
    cpu: int = -1

    @classmethod
    def of(cls, priority: str | None, cpu: int | None) -> "Priority":
        """Return what a command line asks for.

        Args:
            priority: ``"fifo"`` or ``"fifo:N"``.
            cpu: number of a processor.

        Raises:
            ValueError: the text is none of these.
        """
        fifo = 0
        if priority is not None:
            kind, _, number = priority.partition(":")
            fifo = FIFO if priority == "fifo" else int(number) if number.isdecimal() else 0
            if kind != "fifo" or not 1 <= fifo <= os.sched_get_priority_max(os.SCHED_FIFO):
                raise ValueError(f'"{priority}" is none; write fifo, or fifo:1 to fifo:99')
        return cls(fifo, -1 if cpu is None else cpu)

    def take(self) -> None:
        """Enter the class and lock the memory; see that the processor can be had.

        Raises:
            OptionError: there is no such processor for it.
            VbusError: the system does not permit it; says what to do.
        """
        allowed = os.sched_getaffinity(0)
        if self.cpu >= 0 and self.cpu not in allowed:
            there = ", ".join(map(str, sorted(allowed)))
            raise OptionError(f"--cpu {self.cpu}: this process may run on processors {there} only")
        if not self.fifo:
            return
        try:
            # What this process starts is of the usual class again.
            how = os.SCHED_FIFO | os.SCHED_RESET_ON_FORK
            os.sched_setscheduler(0, how, os.sched_param(self.fifo))
        except OSError as error:
            raise VbusError(
                f"--priority fifo:{self.fifo}: {error.strerror}; {rights('rtprio', 'sys_nice')}"
            ) from None
        try:
            lock_memory()
        except OSError as error:
            os.sched_setscheduler(0, os.SCHED_OTHER, os.sched_param(0))
            limit = resource.getrlimit(resource.RLIMIT_MEMLOCK)[0] >> 10
            raise VbusError(
                f"--priority fifo:{self.fifo}: memory cannot be locked: {error.strerror}, and"
                f" {limit} KiB are allowed; {rights('memlock', 'ipc_lock')}"
            ) from None

    def give_back(self) -> None:
        """Be of the usual class again, and let memory be paged out."""
        if self.fifo:
            os.sched_setscheduler(0, os.SCHED_OTHER, os.sched_param(0))
            unlock_memory()

    def pin(self) -> None:
        """Run on the one processor from now on; processes that were started before do not."""
        if self.cpu >= 0:
            os.sched_setaffinity(0, {self.cpu})

    def __str__(self) -> str:
        words = [f"SCHED_FIFO {self.fifo}, memory locked"] if self.fifo else []
        words += [f"processor {self.cpu}"] if self.cpu >= 0 else []
        return ", ".join(words)


def rights(limit: str, capability: str) -> str:
    """Say how a user comes by what the system has refused."""
    most = "unlimited" if limit == "memlock" else "99"
    return (
        f'write "USER - {limit} {most}" in {LIMITS} and log in again, or give the container or'
        f" service the capability CAP_{capability.upper()}"
    )
