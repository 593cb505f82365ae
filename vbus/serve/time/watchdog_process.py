"""The process beside a server that sees it end; started by :mod:`vbus.serve.time.watchdog`.

It imports what it needs and no more: it starts while the server does.

Seconds are counted in steps of :data:`LOOK`, so that those in which the machine itself stood still
are not held against the server.
"""

import os
import select
import signal
import sys

ENDINGS = frozenset({signal.SIGINT, signal.SIGTERM})
PATIENCE = 0.7
"""Seconds in which a server says that it has heard: Ctrl-C ends a stuck one within a second."""
CLOSING = 10.0
"""Seconds in which one that has heard closes its links and recordings: before systemd, which waits
90 s, kills it, and long enough for a journal on a slow disk."""
BUSY = 0.4
"""Seconds of processor time without which a server that wants to run is starved, not stuck:
more than half of :data:`PATIENCE`."""
STARVED = 10.0
"""Seconds after which it is killed all the same."""
LOOK = 0.05
"""Seconds between two looks at it: 14 in :data:`PATIENCE`."""
_DUMP = 0.1
"""Seconds a server has to write down where it hangs."""


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
    waited, longest, before = 0.0, PATIENCE, _state(pid)[1]
    poll = select.poll()
    poll.register(heard, select.POLLIN)
    poll.register(server, select.POLLIN)
    while True:
        if ready := dict(poll.poll(LOOK * 1000)):
            if ready != {heard: select.POLLIN}:
                return
            poll.modify(heard, 0)  # that it is closed is reported all the same
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
    try:
        _watch(*map(int, sys.argv[1:]))
    except ProcessLookupError:
        sys.exit()  # it has ended
