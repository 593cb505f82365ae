"""The process beside a server that sees it end; started by :mod:`vbus.serve.time.watchdog`.

It imports what it needs and no more, and nothing but the standard library: it starts while the
server does, without the paths on which others find their packages. What it knows of turns of the
processors is for all who wait for another process.

Seconds are counted in steps of :data:`LOOK`, so that those in which the machine itself stood still
are not held against the server.
"""

import os
import select
import signal
import sys
from collections.abc import Callable, Iterable
from contextlib import suppress

ENDINGS = frozenset({signal.SIGINT, signal.SIGTERM})
PATIENCE = 0.7
"""Seconds in which a server says that it has heard: Ctrl-C ends a stuck one within a second."""
CLOSING = 10.0
"""Seconds in which one that has heard closes its links and recordings: before systemd, which waits
90 s, kills it, and long enough for a journal on a slow disk."""
BUSY = 0.57
"""The share of its time in which a process that wants to run must have had the processor to be
stuck, and not starved: more than half."""
STARVED = 10.0
"""Seconds more that one has which is starved."""
LOOK = 0.05
"""Seconds between two looks at it: 14 in :data:`PATIENCE`."""
_DUMP = 0.1
"""Seconds a server has to write down where it hangs, if it has the processor."""
_TICKS = os.sysconf("SC_CLK_TCK")


def fields(pid: int, task: int = 0) -> list[str]:
    """Return what the kernel tells of a process, or of one of its threads; nothing if it is gone.

    They are those of proc_pid_stat(5) from the state on, behind the name, which may have blanks.
    """
    where = f"/proc/{pid}/task/{task}/stat" if task else f"/proc/{pid}/stat"
    try:
        with open(where, errors="replace") as file:
            return file.read().rpartition(")")[2].split()
    except OSError:
        return []


def tasks(pid: int) -> list[int]:
    """Return the threads of a process, the oldest first."""
    try:
        return sorted(map(int, os.listdir(f"/proc/{pid}/task")))
    except OSError:
        return []


def states(pid: int) -> set[str]:
    """Return what the threads of a process do, by the kernel's letters."""
    return {found[0] for task in tasks(pid) if (found := fields(pid, task))}


def seconds_computed(pid: int) -> float:
    """Return the processor's seconds of a process, and of its children that have ended."""
    return sum(map(int, fields(pid)[11:15])) / _TICKS


class Turns:
    """What processes have of the processors from now on.

    Args:
        pids: gives their numbers.
    """

    def __init__(self, pids: Callable[[], Iterable[int]]) -> None:
        self._pids = pids
        self._before = sum(map(seconds_computed, pids()))

    def lacking(self, waited: float, longest: float) -> bool:
        """Tell whether they may yet do what they should have done: others have what they need.

        Args:
            waited: seconds since they should.
            longest: seconds that they have anyway.
        """
        pids = [pid for pid in self._pids() if pid != os.getpid()]  # who asks has a turn
        doing = set().union(*map(states, pids))  # R wants the processor, D the disk
        used = sum(map(seconds_computed, pids)) - self._before
        needs = "D" in doing or ("R" in doing and used < BUSY * longest)
        return needs and waited < longest + STARVED


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
                try:
                    os.write(wake, b"\0")
                except OSError:
                    return  # it has ended
                _see_it_end(pid, signal.Signals(number).name, heard, server)
                return


def _see_it_end(pid: int, name: str, heard: int, server: int) -> None:
    poll = select.poll()
    poll.register(heard, select.POLLIN)
    poll.register(server, select.POLLIN)
    ready, waited = _wait(poll, pid, PATIENCE)
    if ready == {heard: select.POLLIN}:
        poll.modify(heard, 0)  # that it is closed is reported all the same
        ready, waited = _wait(poll, pid, CLOSING)
    if ready:
        return
    with suppress(OSError):  # who read what the server prints may have gone before it
        sys.stderr.write(
            f"vbus: {name} has not ended process {pid} within {waited:.1f} s; it is killed, and"
            " this is where it stood\n"
        )
        sys.stderr.flush()
    signal.pidfd_send_signal(server, signal.SIGABRT)
    poll.unregister(heard)
    _wait(poll, pid, _DUMP)
    signal.pidfd_send_signal(server, signal.SIGKILL)


def _wait(poll: select.poll, pid: int, longest: float) -> tuple[dict[int, int], float]:
    """Wait for what a server tells; return that, empty if nothing has come, and the seconds.

    It has longer than ``longest`` while it is starved. One that is stopped (T) has for ever.
    """
    waited, turns = 0.0, Turns(lambda: [pid])
    while not (ready := dict(poll.poll(LOOK * 1000))):
        waited += LOOK
        if waited < longest or states(pid) & {"T", "t"} or turns.lacking(waited, longest):
            continue
        break
    return ready, waited


if __name__ == "__main__":
    try:
        _watch(*map(int, sys.argv[1:]))
    except ProcessLookupError:
        sys.exit()  # it has ended
