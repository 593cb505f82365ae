"""What the server asks of the operating system, as objects in memory; the clock is a number.

Descriptors, terminals, stream sockets, epoll, inotify and timers behave as Linux has them behave.
Nothing waits: when nobody has anything to do, the clock goes on to the next thing that happens.
"""

import errno
import fcntl
import heapq
import os
import select
import socket
import tty
from collections.abc import Callable
from contextlib import ExitStack, contextmanager
from itertools import count
from math import ceil
from pathlib import Path
from random import Random
from types import TracebackType
from typing import Any, Final
from unittest import mock

from vbus.serve import detached_waits, local_socket, loop, recording
from vbus.serve.time import pacer
from vbus.transports import base, open_watch, pty, runtime, sockets, zenoh_inbox
from vbus.transports.linux import IN_CLOSE, IN_MODIFY, IN_OPEN

FIRST: Final = 10_000
"""Lowest descriptor that is not one of the real system."""
SECOND_NS: Final = 10**9


def failure(code: int) -> OSError:
    return OSError(code, os.strerror(code))


class File:
    """What a descriptor stands for."""

    def __init__(self, system: "System", numbered: bool = True) -> None:
        self.system = system
        self.wakes = 0
        """How often its state has changed: what an edge-triggered epoll goes by."""
        self.fd = system.number_of(self) if numbered else -1

    def ready(self) -> int:
        return 0

    def read(self, size: int) -> bytes:
        raise failure(errno.EINVAL)

    def write(self, data: bytes) -> int:
        raise failure(errno.EINVAL)

    def closed(self) -> None:
        """Do what the end of the last descriptor does."""

    def close(self) -> None:
        self.system.close(self.fd)

    def fileno(self) -> int:
        return self.fd

    def __enter__(self) -> "File":
        return self

    def __exit__(
        self,
        kind: type[BaseException] | None,
        error: BaseException | None,
        trace: TracebackType | None,
    ) -> None:
        self.close()


class End(File):
    """One end of a connection."""

    def __init__(self, system: "System", numbered: bool = True) -> None:
        super().__init__(system, numbered)
        self.peer: End | None = None
        self.arrived = bytearray()
        self.capacity = system.capacity()
        self.ended = False
        """Whether the peer sends no more."""
        self.reset = False
        self.transcript: Any = None
        """The client's notes of this connection, at its own end."""

    def ready(self) -> int:
        peer = self.peer
        state = select.EPOLLIN if self.arrived or self.ended or self.reset else 0
        if peer is None or len(peer.arrived) < peer.capacity:
            state |= select.EPOLLOUT
        if peer is None:
            state |= select.EPOLLHUP | (select.EPOLLERR if self.reset else 0)
        return state

    def read(self, size: int) -> bytes:
        if self.arrived:
            data = bytes(self.arrived[:size])
            del self.arrived[:size]
            return data
        if self.reset:
            self.reset = False
            raise failure(errno.ECONNRESET)
        if self.ended:
            return b""
        raise failure(errno.EAGAIN)

    def write(self, data: bytes) -> int:
        peer = self.peer
        if peer is None:
            raise failure(errno.EPIPE)
        taken = data[: peer.capacity - len(peer.arrived)]
        if not taken:
            raise failure(errno.EAGAIN)
        peer.arrived += taken
        peer.wakes += 1
        return len(taken)

    def shut(self) -> None:
        """Send no more."""
        if self.peer is not None:
            self.peer.ended = True
            self.peer.wakes += 1

    def closed(self) -> None:
        peer, self.peer = self.peer, None
        if peer is not None:
            peer.peer = None
            peer.ended = True
            peer.reset = bool(self.arrived)
            peer.wakes += 1

    # -- what a socket object has beside it ----------------------------------------------------

    def setblocking(self, blocking: bool) -> None:
        assert not blocking

    def send(self, data: bytes) -> int:
        return self.write(data)

    def recv(self, size: int) -> bytes:
        return self.read(size)

    def shutdown(self, how: int) -> None:
        self.shut()

    def setsockopt(self, level: int, option: int, value: int) -> None:
        pass


class Listener(File):
    """A socket before it is connected: it listens."""

    def __init__(self, system: "System", family: int, kind: int) -> None:
        super().__init__(system)
        self.waiting: list[End] = []
        self.inode = 0

    def ready(self) -> int:
        return select.EPOLLIN if self.waiting else 0

    def bind(self, address: str) -> None:
        self.system.fail("bind")
        with socket.socket(socket.AF_UNIX, socket.SOCK_STREAM) as real:
            real.bind(address)  # the name is a real one, and may be changed
        self.inode = os.stat(address).st_ino

    def listen(self, backlog: int) -> None:
        self.system.fail("listen")
        self.system.listeners[self.inode] = self

    def setblocking(self, blocking: bool) -> None:
        assert not blocking

    def accept(self) -> tuple[End, str]:
        self.system.called()
        self.system.fail("accept")
        if not self.waiting:
            raise failure(errno.EAGAIN)
        if self.system.short_of_descriptors():
            raise failure(errno.EMFILE)
        end = self.waiting.pop(0)
        end.fd = self.system.number_of(end)
        return end, ""

    def closed(self) -> None:
        self.system.listeners.pop(self.inode, None)
        for end in self.waiting:
            end.closed()


class Terminal(File):
    """The master's side of a pseudo terminal."""

    def __init__(self, system: "System") -> None:
        super().__init__(system)
        self.name = f"/dev/pts/{system.next_terminal()}"
        self.open_slaves = 0
        self.to_master = bytearray()
        self.to_slave = bytearray()
        self.capacity = system.capacity()
        self.exclusive = False
        self.gone = False
        self.watches: list[tuple[Inotify, int]] = []
        system.terminals[self.name] = self

    def ready(self) -> int:
        state = select.EPOLLIN if self.to_master else 0
        if not self.open_slaves:
            state |= select.EPOLLHUP
        return state | (select.EPOLLOUT if len(self.to_slave) < self.capacity else 0)

    def read(self, size: int) -> bytes:
        if self.to_master:
            data = bytes(self.to_master[:size])
            del self.to_master[:size]
            return data
        raise failure(errno.EAGAIN if self.open_slaves else errno.EIO)

    def write(self, data: bytes) -> int:
        taken = data[: self.capacity - len(self.to_slave)]
        if not taken:
            raise failure(errno.EAGAIN)
        self.to_slave += taken
        return len(taken)

    def closed(self) -> None:
        self.gone = True
        del self.system.terminals[self.name]


class Slave(File):
    """The clients' side."""

    def __init__(self, system: "System", terminal: Terminal) -> None:
        super().__init__(system)
        self.terminal = terminal
        self.transcript: Any = None
        terminal.open_slaves += 1
        for inotify, number in terminal.watches:
            inotify.tell(number, IN_OPEN)

    def read(self, size: int) -> bytes:
        terminal = self.terminal
        if terminal.to_slave:
            data = bytes(terminal.to_slave[:size])
            del terminal.to_slave[:size]
            terminal.wakes += 1
            return data
        if terminal.gone:
            return b""
        raise failure(errno.EAGAIN)

    def write(self, data: bytes) -> int:
        terminal = self.terminal
        if terminal.gone:
            raise failure(errno.EIO)
        taken = data[: 4096 - len(terminal.to_master)]
        if not taken:
            raise failure(errno.EAGAIN)
        terminal.to_master += taken
        terminal.wakes += 1
        for inotify, number in terminal.watches:
            inotify.tell(number, IN_MODIFY)
        return len(taken)

    def closed(self) -> None:
        terminal = self.terminal
        terminal.open_slaves -= 1
        for inotify, number in terminal.watches:
            inotify.tell(number, IN_CLOSE)
        if not terminal.open_slaves:
            terminal.wakes += 1


class Inotify(File):
    """Stands for :class:`vbus.transports.linux.Inotify`: two like reports in a row are one."""

    def __init__(self, system: "System") -> None:
        system.fail("inotify")
        if system.short_of_descriptors():
            raise failure(errno.EMFILE)
        super().__init__(system)
        self.events: list[tuple[int, int]] = []
        self.numbers = count(1)

    def add(self, name: str) -> int:
        self.system.fail("inotify")
        number = next(self.numbers)
        self.system.terminals[name].watches.append((self, number))
        return number

    def remove(self, number: int) -> None:
        for terminal in self.system.terminals.values():
            terminal.watches = [one for one in terminal.watches if one != (self, number)]

    def ready(self) -> int:
        return select.EPOLLIN if self.events else 0

    def tell(self, number: int, event: int) -> None:
        if not self.events or self.events[-1] != (number, event):
            self.events.append((number, event))
            self.wakes += 1

    def read(self) -> list[tuple[int, int]]:  # type: ignore[override]
        self.system.called()
        events, self.events = self.events, []
        return events


class TimerFd(File):
    """Stands for :class:`vbus.transports.linux.TimerFd`."""

    def __init__(self, system: "System") -> None:
        system.fail("timerfd")
        super().__init__(system)
        self.due = -1
        system.timers.append(self)

    def set(self, nanoseconds: int) -> None:
        self.due = self.system.ns + nanoseconds if nanoseconds else -1
        self.wakes += 1

    def ready(self) -> int:
        return select.EPOLLIN if 0 <= self.due <= self.system.ns else 0

    def acknowledge(self) -> None:
        if self.ready():
            self.due = -1

    def closed(self) -> None:
        self.system.timers.remove(self)


class EventFd(File):
    """A counter that wakes whoever waits for it."""

    def __init__(self, system: "System") -> None:
        super().__init__(system)
        self.count = 0

    def ready(self) -> int:
        return select.EPOLLIN if self.count else 0


class Epoll(File):
    """Level-triggered, or by wakes where EPOLLET asks for it."""

    def __init__(self, system: "System") -> None:
        super().__init__(system)
        self.entries: dict[int, list[int]] = {}

    def register(self, fd: int, mask: int = select.EPOLLIN) -> None:
        self.system.called()
        if fd not in self.system.files:
            raise failure(errno.EBADF)
        if fd in self.entries:
            raise failure(errno.EEXIST)
        self.entries[fd] = [mask, -1]

    def modify(self, fd: int, mask: int) -> None:
        self._entry(fd)[:] = [mask, -1]

    def unregister(self, fd: int) -> None:
        self._entry(fd)
        del self.entries[fd]

    def _entry(self, fd: int) -> list[int]:
        if fd not in self.system.files:
            raise failure(errno.EBADF)
        if fd not in self.entries:
            raise failure(errno.ENOENT)
        return self.entries[fd]

    def found(self) -> list[tuple[int, int]]:
        always = select.EPOLLHUP | select.EPOLLERR
        events = []
        for fd, (mask, seen) in self.entries.items():
            file = self.system.files[fd]
            state = file.ready() & (mask | always)
            if state and not (mask & select.EPOLLET and seen == file.wakes):
                events.append((fd, state))
        return events

    def ready(self) -> int:
        return select.EPOLLIN if self.found() else 0

    def poll(self, timeout: float = -1, maxevents: int = -1) -> list[tuple[int, int]]:
        self.system.called()
        found = self.found()
        for fd, _ in found:
            self.entries[fd][1] = self.system.files[fd].wakes
        return found


class LoopEpoll(Epoll):
    """That of the event loop: where it waits, the world goes on."""

    def poll(self, timeout: float = -1, maxevents: int = -1) -> list[tuple[int, int]]:
        system = self.system
        system.step()
        deadline = system.ns + ceil(timeout * SECOND_NS) if timeout >= 0 else -1
        while not (found := self.found()):
            if not system.go_on(deadline):
                return []
        system.random.shuffle(found)
        return found[: system.random.choice((1, 2, maxevents))]


class Poll:
    """A ``select.poll`` object."""

    def __init__(self, system: "System") -> None:
        self._system = system
        self._masks: dict[int, int] = {}

    def register(self, fd: int, mask: int) -> None:
        self._masks[fd] = mask

    def poll(self, timeout: float) -> list[tuple[int, int]]:
        self._system.called()
        always = select.POLLHUP | select.POLLERR
        states = {
            fd: self._system.files[fd].ready() & (mask | always) for fd, mask in self._masks.items()
        }
        return [(fd, state) for fd, state in states.items() if state]


class _Module:
    """A module some of whose functions are exchanged."""

    def __init__(self, real: Any, **exchanged: Any) -> None:
        self.__dict__.update(exchanged)
        self._real = real

    def __getattr__(self, name: str) -> Any:
        return getattr(self._real, name)


class System:
    """Everything outside the server.

    Args:
        random: decides whatever a system leaves open.

    Attributes:
        ns: the time.
        files: by descriptor.
        intrude: called within a call of the server, now and then: others act meanwhile.
        step: called each time the event loop looks for what there is to do.
        looks: how often a session looks for a next message before it sleeps.
        shortage: how likely it is that the system has no more descriptors.
        fail: called with the name of each call of the server; may raise what the call then gives.
    """

    def __init__(self, random: Random) -> None:
        self.random = random
        self.ns = SECOND_NS
        self.files: dict[int, File] = {}
        self.listeners: dict[int, Listener] = {}
        self.terminals: dict[str, Terminal] = {}
        self.timers: list[TimerFd] = []
        self.intrude: Callable[[], None] = lambda: None
        self.step: Callable[[], None] = lambda: None
        self.fail: Callable[[str], None] = lambda name: None
        self.intrusion = random.choice((0.0, 0.01, 0.1))
        self.looks = random.choice((0, 24))
        self.shortage = random.choice((0.0, 0.0, 0.1))
        self._events: list[tuple[int, int, Callable[[], None]]] = []
        self._numbers = count()
        self._terminals = count()
        self._intruding = False

    # -- descriptors ----------------------------------------------------------------------------

    def number_of(self, file: File) -> int:
        """Return the lowest free descriptor for a file: they are used again, as ever."""
        fd = next(fd for fd in count(FIRST) if fd not in self.files)
        self.files[fd] = file
        return fd

    def next_terminal(self) -> int:
        return next(self._terminals)

    def capacity(self) -> int:
        return self.random.choice((16, 300, 4096, 1 << 16))

    def short_of_descriptors(self) -> bool:
        return self.random.random() < self.shortage

    def close(self, fd: int) -> None:
        file = self.files.pop(fd, None)
        if file is None:
            raise failure(errno.EBADF)
        for other in self.files.values():
            if isinstance(other, Epoll):
                other.entries.pop(fd, None)
        file.closed()

    # -- time -----------------------------------------------------------------------------------

    def clock(self) -> int:
        """Return the time (ns); looking takes some."""
        self.ns += self.random.randrange(200)
        return self.ns

    def at(self, ns: int, act: Callable[[], None]) -> None:
        heapq.heappush(self._events, (ns, next(self._numbers), act))

    def after(self, ns: int, act: Callable[[], None]) -> None:
        self.at(self.ns + ns, act)

    def act(self) -> None:
        """Let happen what is due."""
        while self._events and self._events[0][0] <= self.ns:
            heapq.heappop(self._events)[2]()

    def go_on(self, deadline: int) -> bool:
        """Nobody has anything to do: go on to what comes next; False if that is the deadline."""
        due = [event[0] for event in self._events[:1]]
        due += [timer.due for timer in self.timers if timer.due >= 0]
        following = min(due, default=-1)
        if deadline >= 0 and (following < 0 or following > deadline):
            self.ns = max(self.ns, deadline)
            return False
        assert following >= 0, "the server waits for ever"
        self.ns = max(self.ns, following)
        self.act()
        return True

    def called(self) -> None:
        """The server has called the system: time passes, and others may act."""
        self.ns += self.random.randrange(3000)
        if not self._intruding and self.random.random() < self.intrusion:
            self._intruding = True
            self.intrude()
            self._intruding = False

    # -- clients --------------------------------------------------------------------------------

    def connect(self, path: str) -> End | None:
        """Return a client's end of a connection to a Unix socket; None if nobody listens."""
        try:
            listener = self.listeners.get(os.stat(path).st_ino)
        except OSError:
            return None
        if listener is None:
            return None
        client, end = End(self), End(self, numbered=False)
        client.peer, end.peer = end, client
        listener.waiting.append(end)
        listener.wakes += 1
        return client

    def open(self, path: str) -> Slave | None:
        """Return a client's descriptor of the terminal a name leads to; None if it cannot."""
        try:
            terminal = self.terminals.get(os.readlink(path))
        except OSError:
            return None
        if terminal is None or terminal.exclusive:
            return None
        return Slave(self, terminal)

    # -- what the server's modules see ------------------------------------------------------------

    def _read(self, fd: int, size: int) -> bytes:
        if fd < FIRST:
            return os.read(fd, size)
        self.called()
        return self._file(fd).read(size)

    def _write(self, fd: int, data: bytes) -> int:
        if fd < FIRST:
            return os.write(fd, data)
        self.called()
        file = self._file(fd)
        return file.write(bytes(data[: self.random.choice((len(data), len(data), 1, 7))]))

    def _file(self, fd: int) -> File:
        if fd not in self.files:
            raise failure(errno.EBADF)
        return self.files[fd]

    def _close(self, fd: int) -> None:
        if fd < FIRST:
            os.close(fd)
        else:
            self.called()
            self.close(fd)
            self.fail("close")  # it is closed all the same

    def _openpty(self) -> tuple[int, int]:
        if self.short_of_descriptors():
            raise failure(errno.EMFILE)
        terminal = Terminal(self)
        return terminal.fd, Slave(self, terminal).fd

    def _ttyname(self, fd: int) -> str:
        slave = self._file(fd)
        assert isinstance(slave, Slave)
        return slave.terminal.name

    def _open(self, path: str, flags: int, mode: int = 0o777) -> int:
        terminal = self.terminals.get(path)
        if terminal is None:
            return os.open(path, flags, mode)
        self.called()
        if terminal.exclusive:
            raise failure(errno.EBUSY)
        if self.short_of_descriptors():
            raise failure(errno.EMFILE)
        return Slave(self, terminal).fd

    def _eventfd_write(self, fd: int, count: int) -> None:
        self._event(fd).count += count

    def _eventfd_read(self, fd: int) -> int:
        self.called()
        event = self._event(fd)
        if not event.count:
            raise failure(errno.EAGAIN)
        count, event.count = event.count, 0
        return count

    def _event(self, fd: int) -> EventFd:
        file = self._file(fd)
        assert isinstance(file, EventFd)
        return file

    def _trying(self, name: str, call: Callable[..., Any]) -> Callable[..., Any]:
        """Return a call of the system that may fail."""

        def tried(*args: Any, **keys: Any) -> Any:
            self.fail(name)
            return call(*args, **keys)

        return tried

    def _tried(self, real: Any, **exchanged: Callable[..., Any]) -> Any:
        """Return a module, some of whose functions are exchanged and may fail."""
        return _Module(real, **{name: self._trying(name, it) for name, it in exchanged.items()})

    @contextmanager
    def installed(self) -> Any:
        """Let the server's modules see this system instead of the real one."""
        system, tried = self, self._tried
        face = tried(
            os, read=self._read, write=self._write, openpty=self._openpty, ttyname=self._ttyname,
            open=self._open, eventfd=lambda start, flags: EventFd(system).fd,
        )  # fmt: skip
        face.close = self._close
        face.set_blocking = lambda fd, blocking: None
        face.eventfd_read, face.eventfd_write = self._eventfd_read, self._eventfd_write
        polls = tried(select, epoll=lambda: Epoll(system))
        polls.poll = lambda: Poll(system)

        class Selector(loop.DirectSelector):
            _selector_cls = staticmethod(lambda: LoopEpoll(system))

        exchanged: list[tuple[Any, str, Any]] = [
            (module, "os", face) for module in (local_socket, base, pty, zenoh_inbox)
        ]
        exchanged += [(module, "select", polls) for module in (detached_waits, pty)]
        exchanged += [
            (pty, "tty", tried(tty, setraw=lambda fd, when=0: None)),
            (open_watch, "Inotify", lambda: Inotify(system)),
            (pacer, "TimerFd", lambda: TimerFd(system)),
            (sockets, "socket", tried(socket, socket=lambda f, k: Listener(system, f, k))),
            (loop, "DirectSelector", Selector),
            (sockets, "os", tried(os, open=os.open)),
            (runtime, "os", tried(os, open=os.open, ftruncate=os.ftruncate, write=os.write)),
            (runtime, "fcntl", tried(fcntl, flock=fcntl.flock)),
            (recording, "os", tried(os, fdatasync=lambda fd: None)),
        ]
        exchanged += [
            (Path, name, self._trying(name, getattr(Path, name)))
            for name in ("symlink_to", "replace", "unlink")
        ]
        with ExitStack() as stack:
            for module, name, new in exchanged:
                stack.enter_context(mock.patch.object(module, name, new))
            yield


class SimulatedLoop(loop.HostLoop):
    """The server's own event loop, with a system's clock and descriptors."""

    def __init__(self, system: System) -> None:
        self._system = system
        super().__init__()

    def time(self) -> float:
        return self._system.ns / SECOND_NS

    def _make_self_pipe(self) -> None:
        pass

    def _close_self_pipe(self) -> None:
        pass


def names_in(directory: Path) -> list[str]:
    """Return what a directory holds, at any depth, that is no directory."""
    return sorted(
        str(path.relative_to(directory)) for path in directory.rglob("*") if not path.is_dir()
    )
