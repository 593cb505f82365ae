"""The process beside a server that sees it end; started by :mod:`vbus.serve.time.watchdog`.

It imports what it needs and no more: it starts while the server does.

Seconds are counted in steps of :data:`LOOK`, so that those in which the machine itself stood still
are not held against the server.
"""

import os
import select
import signal
import sys
from collections.abc import Set
from contextlib import suppress

ENDINGS = frozenset({signal.SIGINT, signal.SIGTERM})
PATIENCE = 0.7
"""Seconds in which a server says that it has heard: Ctrl-C ends a stuck one within a second."""
CLOSING = 10.0
"""Seconds in which one that has heard closes its links and recordings: before systemd, which waits
90 s, kills it, and long enough for a journal on a slow disk."""
BUSY = 0.57
"""The share of its time in which a server that wants to run must have had the processor to be
stuck, and not starved: more than half."""
STARVED = 10.0
"""Seconds more after which it is killed all the same."""
LOOK = 0.05
"""Seconds between two looks at it: 14 in :data:`PATIENCE`."""
_DUMP = 0.1
"""Seconds a server has to write down where it hangs, if it has the processor."""


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
    waited, before = 0.0, _state(pid)[1]
    while not (ready := dict(poll.poll(LOOK * 1000))):
        waited += LOOK
        if waited < longest:
            continue
        state, used = _state(pid)
        if state not in ("T", "t") and not starved({state}, used - before, waited, longest):
            break
    return ready, waited


def starved(states: Set[str], used: float, waited: float, longest: float) -> bool:
    """Tell whether a process may yet do what it should have done: others have what it needs.

    Args:
        states: those of its threads, as the system calls them: R wants the processor, D the disk.
        used: seconds of processor time that it has had since it should.
        waited: seconds since then.
        longest: seconds that it has anyway.
    """
    needs = "D" in states or ("R" in states and used < BUSY * longest)
    return needs and waited < longest + STARVED


def _state(pid: int) -> tuple[str, float]:
    """Return the state of a process' main thread, and the seconds it has run."""
    try:
        with open(f"/proc/{pid}/task/{pid}/stat") as file:
            fields = file.read().rpartition(")")[2].split()
    except OSError:
        return "X", 0.0
    return fields[0], (int(fields[11]) + int(fields[12])) / os.sysconf("SC_CLK_TCK")


if __name__ == "__main__":
    try:
        _watch(*map(int, sys.argv[1:]))
    except ProcessLookupError:
        sys.exit()  # it has ended
