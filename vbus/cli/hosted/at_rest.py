"""Whether a program waits for what cannot come, or only computes: found from states, at rest.

Where time is virtual, nothing happens on a board while no host asks for it. So a program hangs if
each of its threads, and those of the processes that come from it, is in a wait that only another of
them could end. That is looked for twice: what two looks find, with no thread scheduled in between,
was true at one instant, however busy the machine is.
"""

import asyncio
import os
from collections.abc import Callable, Iterable
from pathlib import Path
from typing import Final, NamedTuple

from vbus.cli.proc import (
    RUNS,
    SystemCall,
    call_of,
    memory,
    read,
    state,
    status,
    what_hangs,
)
from vbus.core.kernel import SECOND
from vbus.core.wall_clock import monotonic
from vbus.serve.host_limits import POLLING, HostWatch
from vbus.serve.time.watchdog_process import seconds_computed, tasks

# A look reads files of /proc for each thread: ten a second cost little of a processor.
LOOK: Final = 0.1
"""Seconds between looks at a program that does nothing on the bus."""
IN_VAIN: Final = (
    "every thread of it waits for what cannot come: nothing on the board, no timer and no other"
    " process can end a wait"
)

_FUTEX_WAITS: Final = (0, 6, 9, 11, 13)
"""Operations of the system call futex that wait."""
_CHILD: Final = ("wait4", "waitid", "waitpid")
_SIGNAL: Final = ("pause", "rt_sigsuspend", "sigsuspend")
_ENDS: Final = {"read": os.O_WRONLY, "readv": os.O_WRONLY, "write": os.O_RDONLY,
                "writev": os.O_RDONLY}  # fmt: skip
"""Which other end of a pipe a call waits for."""
_READABLE: Final = 1
_ALARM: Final = 1 << 13
_OTHERS: Final = -1 << 33
"""SIGALRM, and the signals from SIGRTMIN on, among those that a process catches or blocks."""
_TURN: Final = 200_000
"""Nanoseconds: a thread that computes has the processor for longer at a time (3 ms), however many
want it; one that calls sched_yield in a loop, for a few microseconds where another thread does."""


class _Seen(NamedTuple):
    """A process at rest.

    Attributes:
        note: the library's note about its waits; "" without one.
        switches: how often each thread has been scheduled.
    """

    note: str
    switches: tuple[tuple[int, int], ...]


class _Share(NamedTuple):
    """What a thread had of the processor.

    Attributes:
        ran: nanoseconds.
        ready: nanoseconds for which it could have run, and others did.
        turns: how often it had its turn.
        slept: how often it has given it up to sleep.
    """

    ran: int
    ready: int
    turns: int
    slept: int


class AtRest:
    """Looks at a program and what comes from it.

    Args:
        roots: gives the processes to look at, with theirs.
        watch: ends the program.
        note: the file whose name the library gets; beside it, it says what threads wait for.
        limit: chip time the program may take (ps): it may compute as long without the bus, and
            for :data:`POLLING` seconds in any case.
    """

    def __init__(
        self,
        roots: Callable[[], Iterable[int]],
        watch: HostWatch,
        note: Path,
        limit: int,
    ) -> None:
        self._roots = roots
        self._watch = watch
        self._note = note
        self._longest = max(limit / SECOND, POLLING)
        self._board: tuple[int, int] = (-1, -1)
        self._since = (0.0, 0.0)
        self._before: dict[int, _Seen] | None = None
        self._shares: dict[tuple[int, int], _Share] = {}
        self._gave: float = 0.0

    async def go_on(self) -> None:
        """Look again and again, until it is cancelled."""
        while True:
            await asyncio.sleep(LOOK)
            self.look()

    def look(self) -> None:
        """Look once; end the program if it hangs."""
        watch = self._watch
        if watch.ended:
            return
        pids = list(self._roots())
        now = monotonic(), sum(map(seconds_computed, pids)) + self._given_way(pids)
        board = watch.progress
        if board != self._board:
            self._board, self._since, self._before = board, now, None
            return
        seen = {pid: self._at_rest(pid, pids) for pid in pids}
        whole = {pid: one for pid, one in seen.items() if one is not None}
        if not whole or len(whole) < len(seen):
            self._before = None
        elif self._before is None or (moved := _moved(self._before, whole)):
            self._before = whole
        elif moved is not None and list(self._roots()) == pids:
            # Threads of the library wake now and then, and wait again: the next look finds that.
            threads = what_hangs(pids)
            if not any(line.endswith(RUNS) for line in threads):
                self._end(IN_VAIN, threads)
        wall, computed = (new - old for new, old in zip(now, self._since, strict=True))
        if min(wall, computed) > self._longest:
            self._end(
                f"it has computed for {self._longest:g} s of wall-clock time, all of them on the"
                " processor, without an access to the bus, and no chip time passes meanwhile (if it"
                " may: raise the limit)",
                what_hangs(pids),
            )

    def _given_way(self, pids: list[int]) -> float:
        """Return for how long threads have given their turns to others, without a sleep (s).

        A loop of sched_yield computes for ever, and has next to nothing of a busy processor.
        """
        shares = {(pid, task): _share(pid, task) for pid in pids for task in tasks(pid)}
        for key, now in shares.items():
            old = self._shares.get(key, now)
            if now.slept == old.slept and now.ran - old.ran < _TURN * (now.turns - old.turns):
                self._gave += (now.ready - old.ready) / 1e9
        self._shares = shares
        return self._gave

    def _end(self, sentence: str, threads: list[str]) -> None:
        self._watch.pass_bound(sentence, threads)

    def _at_rest(self, pid: int, pids: list[int]) -> _Seen | None:
        """Return how a process is found if nothing can end its waits but these processes."""
        text = read(f"{self._note}.{pid}")
        known = _known_waits(text)
        # The note's first line ends in whether the library has taken over timers.
        ours = text.partition("\n")[0].endswith(" 1")
        """Whether the library has the timers of the process in hand."""
        switches = []
        for task in tasks(pid):
            facts = status(pid, task)
            # One that runs, or is about to be woken, is not at rest.
            if state(pid, task) != "S" or _pending(facts):
                return None
            if not ours and _timed(pid, facts):
                return None
            if task in known:
                if not all(_inside(pid, fd, events, pids) for fd, events in known[task]):
                    return None
            elif not _in_vain(pid, task, pids):
                return None
            count = (
                facts.get("voluntary_ctxt_switches", "0"),
                facts.get("nonvoluntary_ctxt_switches", "0"),
            )
            switches.append((task, sum(map(int, count))))
        return _Seen(text, tuple(switches)) if switches else None


def _known_waits(text: str) -> dict[int, list[tuple[int, int]]]:
    """Return the descriptors, with what is awaited of each, that known threads wait for.

    Not among them are threads in calls of the kernel, and those that wait for memory which other
    programs may share: the kernel says what becomes of those.
    """
    lines = text.splitlines()
    if not lines or lines[-1] != "end":
        return {}
    found = {}
    for line in lines[1:-1]:
        task, kind, *waits = line.split()
        if kind == "w":
            pairs = [wait.partition("/") for wait in waits]
            found[int(task)] = [(int(fd), int(events)) for fd, _, events in pairs]
    return found


def _share(pid: int, task: int) -> _Share:
    """Return what a thread had of the processor; nothing where the system does not count it."""
    ran, ready, turns = (*map(int, read(f"/proc/{pid}/task/{task}/schedstat").split()), 0, 0, 0)[:3]
    return _Share(ran, ready, turns, int(status(pid, task).get("voluntary_ctxt_switches", "0")))


def _pending(facts: dict[str, str]) -> int:
    """Return the signals that a thread is about to get."""
    pending = int(facts.get("SigPnd", "0"), 16) | int(facts.get("ShdPnd", "0"), 16)
    return pending & ~int(facts.get("SigBlk", "0"), 16)


def _timed(pid: int, facts: dict[str, str]) -> bool:
    """Tell whether a timer, which is nowhere to be seen, may send a process a signal it awaits."""
    awaited = int(facts.get("SigCgt", "0"), 16) | int(facts.get("SigBlk", "0"), 16)
    return bool(awaited & (_ALARM | _OTHERS) or read(f"/proc/{pid}/timers"))


def _moved(before: dict[int, _Seen], now: dict[int, _Seen]) -> bool | None:
    """Tell whether anything has moved from one look to the next; None: it is not certain yet.

    A thread of the library looks again and again whether something has come. It must have looked:
    its threads have woken more often than all of them can without a whole look in between.
    """
    if before.keys() != now.keys():
        return True
    certain = True
    for pid, seen in now.items():
        old = before[pid]
        if seen.note != old.note or [n for n, _ in seen.switches] != [n for n, _ in old.switches]:
            return True
        known = _known_waits(seen.note)
        counts = zip(seen.switches, old.switches, strict=True)
        woken = {task: count - was for (task, count), (_, was) in counts}
        if any(count for task, count in woken.items() if task not in known):
            return True
        certain = certain and (not known or sum(woken.values()) >= 8 + 4 * len(woken))
    return False if certain else None


def _in_vain(pid: int, task: int, pids: list[int]) -> bool:
    """Tell whether only these processes can end the system call that a thread is in.

    Args:
        pid: its process.
        task: the thread.
        pids: these processes.
    """
    call = call_of(pid, task)
    if call is None:
        return False
    if call.name in _CHILD or call.name in _SIGNAL:
        return True
    first, second, third, fourth = call.arguments[:4]
    if call.name == "futex":
        waits = second & 0x7F in _FUTEX_WAITS and not fourth
        return waits and (bool(second & 0x80) or not _shared(pid, first))
    if call.name in _ENDS:
        return _pipe(pid, first, _ENDS[call.name], pids)
    if call.name in ("poll", "ppoll"):
        # poll(2): a negative number of milliseconds; ppoll(2): no time given.
        for_ever = third & 0x80000000 if call.name == "poll" else not third
        return bool(for_ever) and _polls(pid, call, pids)
    return False


def _shared(pid: int, address: int) -> bool:
    """Tell whether memory may be another program's, too."""
    for line in read(f"/proc/{pid}/maps").splitlines():
        begin, _, end = line.partition(" ")[0].partition("-")
        if int(begin, 16) <= address < int(end, 16):
            return line.split()[1].endswith("s")
    return True


def _polls(pid: int, call: SystemCall, pids: list[int]) -> bool:
    """Tell whether a poll waits for these processes alone."""
    count = call.arguments[1]
    # A list that long is more memory than a look should read.
    if count > 1024:
        return False
    rows = memory(pid, call.arguments[0], 8 * count)
    if len(rows) != 8 * count:
        return False
    for place in range(0, len(rows), 8):
        fd = int.from_bytes(rows[place : place + 4], "little", signed=True)
        events = int.from_bytes(rows[place + 4 : place + 6], "little")
        if fd >= 0 and not _inside(pid, fd, events, pids):
            return False
    return True


def _inside(pid: int, fd: int, events: int, pids: list[int]) -> bool:
    """Tell whether what is awaited of a descriptor can come from these processes alone."""
    return _pipe(pid, fd, os.O_WRONLY if events & _READABLE else os.O_RDONLY, pids)


def _pipe(pid: int, fd: int, end: int, pids: list[int]) -> bool:
    """Tell whether a descriptor is a pipe whose other end these processes alone have.

    A pipe that this process has too comes from outside: what is behind it may be hidden.
    """
    target = _target(f"/proc/{pid}/fd/{fd}")
    if not target.startswith("pipe:"):
        return False
    for name in os.listdir("/proc"):
        if not name.isdecimal() or int(name) in pids:
            continue
        try:
            held = os.listdir(f"/proc/{name}/fd")
        except OSError:
            continue
        for one in held:
            if _target(f"/proc/{name}/fd/{one}") == target:
                if int(name) == os.getpid():
                    return False
                flags = read(f"/proc/{name}/fdinfo/{one}").partition("flags:")[2].split()
                if not flags or int(flags[0], 8) & 3 in (end, os.O_RDWR):
                    return False
    return True


def _target(path: str) -> str:
    try:
        return os.readlink(path)
    except OSError:
        return ""
