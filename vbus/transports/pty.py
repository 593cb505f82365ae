"""A pseudo terminal with a name that stays the same."""

import asyncio
import fcntl
import os
import select
import termios
import tty
from collections.abc import Callable, Iterator
from contextlib import ExitStack, contextmanager
from pathlib import Path
from typing import Final

from msgspec import Struct

from vbus.errors import TransportError
from vbus.transports.base import REST_SECONDS, Link, Transport
from vbus.transports.open_watch import NoWatch, OpenWatch
from vbus.transports.runtime import NameLock, leads_to_terminal, sweep

_TIOCNXCL = 0x540D
_READ_SIZE = 65536
LOOK_SECONDS: Final = 0.05
"""How often is looked for clients where the system gives no watch."""


class PtyLink(Link):
    """The master side while somebody has the terminal open."""

    def __init__(self, transport: "PtyTransport", fd: int, peer: str) -> None:
        super().__init__(fd, peer)
        self._transport: PtyTransport = transport

    def close(self) -> None:
        """Make the terminal ready for the next client."""
        self._transport.ended(self)

    def hang_up(self) -> None:
        """Take the terminal from the client that has it open; the name leads to a new one."""
        self._transport.replace(self)


class _Terminal(Struct):
    """A terminal in raw mode, and what tells of those who have it open.

    Attributes:
        master: the server's side.
        name: path of the clients' side.
        watch: tells of opens.
        hangups: tells that nobody has it open any more.
        poll: looks at the master.
        close: frees all descriptors.
    """

    master: int
    name: str
    watch: OpenWatch | NoWatch
    hangups: select.epoll
    poll: select.poll
    close: Callable[[], None]

    @classmethod
    def make(cls, loop: asyncio.AbstractEventLoop, notice: Callable[[], None]) -> "_Terminal":
        """Make a terminal nobody has open; ``notice`` is called after opens and closes."""
        with ExitStack() as made:
            master, slave = os.openpty()
            made.callback(os.close, master)
            try:
                # A terminal left cooked would echo and eat 29 byte values.
                with _system_errors():
                    tty.setraw(slave)
                name = os.ttyname(slave)
            finally:
                os.close(slave)
            os.set_blocking(master, False)
            poll = select.poll()
            poll.register(master, select.POLLIN)
            hangups = made.enter_context(select.epoll())
            hangups.register(master, select.EPOLLHUP | select.EPOLLET)
            try:
                watch: OpenWatch | NoWatch = OpenWatch(loop, name, notice)
            except OSError:  # the system gives no user more than some of them
                watch = NoWatch()
            made.callback(watch.close)
            return cls(master, name, watch, hangups, poll, made.pop_all().close)

    def look(self) -> int:
        """Return what ``poll`` says of the master: POLLHUP while nobody has the terminal open."""
        return sum(state for _, state in self.poll.poll(0))

    def clean(self, slave: int) -> None:
        """Drop what the last client set and what it did not read."""
        fcntl.ioctl(slave, _TIOCNXCL)
        # Some replies are still on their way, the others wait at the slave.
        with _system_errors():
            termios.tcflush(self.master, termios.TCOFLUSH)
            termios.tcflush(slave, termios.TCIFLUSH)
            tty.setraw(slave, termios.TCSANOW)


@contextmanager
def _system_errors() -> Iterator[None]:
    """Give what went wrong with a terminal as any other error of the system."""
    try:
        yield
    except termios.error as error:
        raise OSError(*error.args) from error


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

    _loop: asyncio.AbstractEventLoop
    _on_link: Callable[[Link], None]

    def __init__(self, path: str, options: dict[str, str]) -> None:
        super().__init__(path, options)
        self._link_path: Path = Path(path)
        self._terminal: _Terminal | None = None
        self._clients: int = 0
        self._owed: bool = False
        self._replaced: bool = False
        self._left: bytes = b""
        """What has been read behind the end of a session: the next client's."""
        self._link: PtyLink | None = None

    def open(self, loop: asyncio.AbstractEventLoop, on_link: Callable[[Link], None]) -> None:
        """Make the terminal and its name."""
        if not self.path:
            raise TransportError('"pty:" needs a path, e.g. "pty:$VBUS_RUNTIME/x"')
        self._loop = loop
        self._on_link = on_link
        with self.opening(self._link_path) as opened:
            lock = NameLock(self._link_path)
            lock.take(self.board)
            opened.callback(lock.give_back)
            sweep(self._link_path.parent)
            if os.path.lexists(self._link_path) and not leads_to_terminal(self._link_path):
                raise TransportError(
                    f"{self._link_path} exists and is not a link of ours; remove it or choose"
                    " another name"
                )
            opened.callback(self._unmake)
            self._make()
            opened.callback(self._remove_name)

    def _make(self) -> None:
        """Make a terminal and let the name lead to it."""
        terminal = _Terminal.make(self._loop, self._notice)
        with ExitStack() as made:
            made.callback(terminal.close)
            temporary = self._link_path.with_name(f".{self._link_path.name}.{os.getpid()}")
            temporary.unlink(missing_ok=True)
            temporary.symlink_to(terminal.name)
            made.callback(temporary.unlink)
            temporary.replace(self._link_path)
            made.pop_all()
        self._terminal = terminal
        self._loop.add_reader(terminal.hangups.fileno(), self._notice)
        if isinstance(terminal.watch, NoWatch):
            self._look_at_times(terminal)

    def _look_at_times(self, terminal: _Terminal) -> None:
        """Do without a watch: whoever opens the terminal is noticed a little later."""
        if terminal is self._terminal:
            self._notice()
            self._loop.call_later(LOOK_SECONDS, self._look_at_times, terminal)

    def _unmake(self) -> None:
        terminal, self._terminal = self._terminal, None
        if terminal is not None:
            self._loop.remove_reader(terminal.hangups.fileno())
            terminal.close()

    def _remove_name(self) -> None:
        """Remove the name, if it is not another's by now."""
        if self._terminal is not None:
            self._remove_name_of(self._terminal)

    def _remove_name_of(self, terminal: _Terminal) -> None:
        if leads_to_terminal(self._link_path):
            if os.readlink(self._link_path) == terminal.name:
                self._link_path.unlink()

    # -- clients come and go --------------------------------------------------------------------

    def _notice(self, data: bytes = b"") -> None:
        """Begin and end sessions as clients open and close the terminal.

        ``data`` has just been read: it belongs to whoever has the terminal open now, or, if
        nobody has, to the client that was there.
        """
        terminal = self._terminal
        if terminal is None:
            return
        data = self._take_left() + data
        hung_up = terminal.hangups.poll(0)
        seen = terminal.watch.read()
        self._replaced = self._count(seen)
        state = terminal.look()
        link = self._link
        if link is not None and self._replaced and not state & select.POLLHUP:
            # One client closed and another opened before we looked.
            link.on_end(False)
            link = self._link
            data += self._take_left()
        if link is None and (state & select.POLLIN or not state & select.POLLHUP or data):
            link = self._begin(terminal)
        elif link is None and (seen or (hung_up and isinstance(terminal.watch, NoWatch))):
            self._clean(terminal)  # somebody came and went unseen, and may have set something
            self._loop.call_soon(self._notice)  # whoever came meanwhile is seen by looking
        if link is not None:
            if data:
                link.on_data(data)
            if state & select.POLLHUP:
                # Nobody had it open: whoever opens it from here on is another.
                self._clients = 0
                self._owed = False
                link.on_end(True)

    def _take_left(self) -> bytes:
        left, self._left = self._left, b""
        return left

    def _count(self, events: list[bool]) -> bool:
        """Take what happened; tell whether a client has replaced the last one.

        The number is an estimate (see above), good enough to tell one client from the next when
        they follow each other faster than the server looks.
        """
        replaced = False
        for opened in events:
            if not opened:
                self._clients = max(0, self._clients - 1)
                self._owed = False
            elif self._owed:
                # The terminal was seen open before the report came: this client is counted.
                self._owed = False
            else:
                replaced = replaced or not self._clients
                self._clients += 1
        return replaced

    def _begin(self, terminal: _Terminal) -> PtyLink:
        self._owed = not self._clients
        self._clients = max(1, self._clients)
        self._replaced = False
        link = self._link = PtyLink(self, terminal.master, terminal.name)
        link.changed = terminal.watch.happened
        link.sort = self._notice
        self._on_link(link)
        return link

    def ended(self, link: PtyLink) -> None:
        """Make the terminal as good as new: a session has ended."""
        if self._link is not link:
            return
        self._link = None
        terminal = self._terminal
        if terminal is None:
            return
        # Whoever is noticed first gets it first, before what is read from now on.
        self._left += self._rest(terminal)
        self._loop.call_soon(self._notice)
        self._clean(terminal)

    def _clean(self, terminal: _Terminal) -> None:
        """Drop what a client has left in the terminal; replace one that cannot be opened."""
        self._clients = 0
        try:
            slave = os.open(terminal.name, os.O_RDWR | os.O_NOCTTY | os.O_NONBLOCK | os.O_CLOEXEC)
        except OSError:
            if terminal.look() & select.POLLHUP:
                self._renew()
            return
        try:
            try:
                terminal.clean(slave)
            finally:
                os.close(slave)
        except OSError:
            self._renew()
            return
        # Those are our own open and close. Whoever came meanwhile is seen by looking.
        terminal.watch.read()
        terminal.hangups.poll(0)

    def replace(self, link: PtyLink) -> None:
        """End a session with its terminal."""
        if self._link is link:
            self._link = None
            self._clients = 0
            self._renew()

    def _renew(self) -> None:
        """Replace the terminal: one left in exclusive use could be opened by root alone."""
        terminal = self._terminal
        self._unmake()
        try:
            self._make()
        except OSError as error:
            if terminal is not None:  # another program may get its number
                self._remove_name_of(terminal)
            lost = f"lost: {error.strerror or error}"
            if self.state != lost:
                self.report(f"{self._link_path}: {lost}; it is tried again")
            self.state = lost
            self._loop.call_later(REST_SECONDS, self._try_again)
        else:
            self.state = "waiting"

    def _try_again(self) -> None:
        """Make a terminal, now that there may be what was missing."""
        if self._terminal is None and not self.closing:
            self._renew()

    def _rest(self, terminal: _Terminal) -> bytes:
        """Return the next client's bytes; drop those of one that went while it was held."""
        try:
            left = os.read(terminal.master, _READ_SIZE)
        except OSError:
            return b""
        return left if self._replaced or any(terminal.watch.read()) else b""
