"""A pseudo terminal with a name that stays the same."""

import asyncio
import fcntl
import os
import select
import termios
import tty
from collections.abc import Callable
from pathlib import Path

from vbus.errors import TransportError
from vbus.transports.base import Link, Transport
from vbus.transports.linux import OpenWatch
from vbus.transports.runtime import NameLock

_TIOCNXCL = 0x540D
_READ_SIZE = 65536


class PtyLink(Link):
    """The master side while somebody has the terminal open."""

    def __init__(self, transport: "PtyTransport", fd: int, peer: str) -> None:
        super().__init__(fd, peer)
        self._transport: PtyTransport = transport

    def close(self) -> None:
        """Make the terminal ready for the next client."""
        self._transport.ended(self)


class PtyTransport(Transport):
    """``pty:PATH``: a symbolic link at PATH leads to a terminal in raw mode.

    Clients may open, close, die and come again; the session ends when the last one has closed.
    Several descriptors open at a time share one session. What a client left unread is not given
    to the next, as far as that one leaves the server time to notice. A name left behind by a
    server that was killed is repaired at the next start.

    Whether somebody has the terminal open is known from the master: it reports a hang-up while
    nobody has. An edge-triggered epoll makes an event of that state, an inotify watch tells of
    opens. Counting the watch's reports would not do: the system reports two like ones in a row as
    one, and a close before it takes effect.
    """

    SCHEME = "pty"

    def __init__(self, path: str, options: dict[str, str]) -> None:
        super().__init__(path, options)
        self._master: int = -1
        self._name: str = ""
        self._link_path: Path = Path(path)
        self._lock: NameLock = NameLock(self._link_path)
        self._watch: OpenWatch | None = None
        self._poll: select.poll = select.poll()
        self._hangups: select.epoll | None = None
        self._clients: int = 0
        self._owed: bool = False
        self._turned: bool = False
        self._link: PtyLink | None = None
        self._loop: asyncio.AbstractEventLoop | None = None
        self._on_link: Callable[[Link], None] | None = None

    def open(self, loop: asyncio.AbstractEventLoop, on_link: Callable[[Link], None]) -> None:
        """Make the terminal and its name."""
        if not self.path:
            raise TransportError('"pty:" needs a path, e.g. "pty:$VBUS_RUNTIME/x"')
        self._lock.take()
        self._loop = loop
        self._on_link = on_link
        try:
            if os.path.lexists(self._link_path) and not self._is_ours():
                raise TransportError(
                    f"{self._link_path} exists and is not a link of ours; remove it or choose"
                    " another name"
                )
            self._make()
        except OSError as error:
            self.close()
            if isinstance(error, TransportError):
                raise
            raise TransportError(f"{self._link_path}: {error.strerror or error}") from error

    def _is_ours(self) -> bool:
        """Tell whether the name is what a server leaves behind: a link to some terminal."""
        path = self._link_path
        return path.is_symlink() and os.readlink(path).startswith("/dev/pts/")

    def _make(self) -> None:
        """Make a terminal and let the name lead to it."""
        assert self._loop is not None
        self._master, slave = os.openpty()
        # A terminal left cooked would echo and eat 29 byte values.
        tty.setraw(slave)
        self._name = os.ttyname(slave)
        os.close(slave)
        os.set_blocking(self._master, False)
        self._poll = select.poll()
        self._poll.register(self._master, select.POLLIN)
        self._hangups = select.epoll()
        self._hangups.register(self._master, select.EPOLLHUP | select.EPOLLET)
        self._watch = OpenWatch(self._name)
        temporary = self._link_path.with_name(f".{self._link_path.name}.{os.getpid()}")
        temporary.unlink(missing_ok=True)
        temporary.symlink_to(self._name)
        temporary.replace(self._link_path)
        self._loop.add_reader(self._watch.fd, self._notice)
        self._loop.add_reader(self._hangups.fileno(), self._notice)

    def _unmake(self) -> None:
        if self._hangups is not None:
            if self._loop is not None:
                self._loop.remove_reader(self._hangups.fileno())
            self._hangups.close()
            self._hangups = None
        if self._watch is not None:
            if self._loop is not None:
                self._loop.remove_reader(self._watch.fd)
            self._watch.close()
            self._watch = None
        if self._master >= 0:
            os.close(self._master)
            self._master = -1

    # -- clients come and go --------------------------------------------------------------------

    def _notice(self, data: bytes = b"") -> None:
        """Begin and end sessions as clients open and close the terminal.

        ``data`` has just been read: it belongs to whoever has the terminal open now, or, if
        nobody has, to the client that was there.
        """
        if self._watch is None or self._hangups is None:
            return
        self._hangups.poll(0)
        self._turned = self._count(self._watch.read())
        state = self._look()
        link = self._link
        if link is not None and self._turned and not state & select.POLLHUP:
            # One client closed and another opened before we looked.
            link.on_end(False)
            link = self._link
        if link is None and (state & select.POLLIN or not state & select.POLLHUP or data):
            link = self._begin()
        if link is not None:
            if data:
                link.on_data(data)
            if state & select.POLLHUP:
                link.on_end(True)

    def _count(self, events: list[bool]) -> bool:
        """Take what happened; tell whether a client came after the last one had gone.

        The number is an estimate (see above), good enough to tell one client from the next when
        they follow each other faster than the server looks.
        """
        turned = False
        for opened in events:
            if not opened:
                self._clients = max(0, self._clients - 1)
                self._owed = False
            elif self._owed:
                # The terminal was seen open before the report came: this client is counted.
                self._owed = False
            else:
                turned = turned or not self._clients
                self._clients += 1
        return turned

    def _look(self) -> int:
        """Return what ``poll`` says of the master: POLLHUP while nobody has the terminal open."""
        return sum(state for _, state in self._poll.poll(0))

    def _begin(self) -> PtyLink:
        assert self._watch is not None
        assert self._on_link is not None
        self._owed = not self._clients
        self._clients = max(1, self._clients)
        self._turned = False
        link = self._link = PtyLink(self, self._master, self._name)
        link.changed = self._watch.happened
        link.sort = self._notice
        self.state = "connected"
        self._on_link(link)
        return link

    def ended(self, link: PtyLink) -> None:
        """Make the terminal as good as new: a session has ended."""
        if self._link is not link:
            return
        self._link = None
        self.state = "waiting"
        if self._watch is None or self._loop is None:
            return
        left = self._rest()
        try:
            slave = os.open(self._name, os.O_RDWR | os.O_NOCTTY | os.O_NONBLOCK | os.O_CLOEXEC)
        except OSError:
            if self._look() & select.POLLHUP:
                self._renew()
        else:
            self._clean(slave)
            os.close(slave)
            # Those are our own open and close. Whoever came meanwhile is seen by looking.
            self._watch.read()
        self._clients = 0
        self._loop.call_soon(self._notice, left)

    def _renew(self) -> None:
        """Replace a terminal that a client has left in exclusive use: only root could open it."""
        self._unmake()
        try:
            self._make()
        except OSError as error:
            self.state = f"lost: {error.strerror or error}"
            self.report(f"{self._link_path}: {self.state}")

    def _rest(self) -> bytes:
        """Return the next client's bytes; drop those of one that went while it was held."""
        assert self._watch is not None
        try:
            left = os.read(self._master, _READ_SIZE)
        except OSError:
            return b""
        return left if self._turned or any(self._watch.read()) else b""

    def _clean(self, slave: int) -> None:
        fcntl.ioctl(slave, _TIOCNXCL)
        # Replies that nobody read: some are still on their way, the others wait at the slave.
        termios.tcflush(self._master, termios.TCOFLUSH)
        termios.tcflush(slave, termios.TCIFLUSH)
        tty.setraw(slave, termios.TCSANOW)

    def close(self) -> None:
        """Remove the name and the terminal."""
        self._unmake()
        if self._name and self._link_path.is_symlink():
            if os.readlink(self._link_path) == self._name:
                self._link_path.unlink()
        self._lock.give_back()
