"""A pseudo terminal with a name that stays the same."""

import asyncio
import fcntl
import os
import termios
import tty
from collections.abc import Callable
from pathlib import Path

from vbus.errors import TransportError
from vbus.transports.base import Link, Transport
from vbus.transports.linux import OpenWatch
from vbus.transports.runtime import NameLock

_TIOCNXCL = 0x540D


class PtyLink(Link):
    """The master side while a client has the terminal open."""

    def __init__(self, transport: "PtyTransport", peer: str) -> None:
        super().__init__(transport.master, peer)

    def close(self) -> None:
        """The master stays open for the next client."""


class PtyTransport(Transport):
    """``pty:PATH``: a symbolic link at PATH leads to a terminal in raw mode.

    Clients may open, close, die and come again; the session ends when the last one has closed.
    What a client left unread is not given to the next. A name left behind by a server that was
    killed is repaired at the next start.
    """

    SCHEME = "pty"

    def __init__(self, path: str, options: dict[str, str]) -> None:
        super().__init__(path, options)
        self.master: int = -1
        self._slave: int = -1
        self._name: str = ""
        self._link_path: Path = Path(path)
        self._lock: NameLock = NameLock(self._link_path)
        self._watch: OpenWatch | None = None
        self._clients: int = 0
        self._link: PtyLink | None = None
        self._loop: asyncio.AbstractEventLoop | None = None
        self._on_link: Callable[[Link], None] | None = None

    def open(self, loop: asyncio.AbstractEventLoop, on_link: Callable[[Link], None]) -> None:
        """Make the terminal and its name."""
        if not self.path:
            raise TransportError('"pty:" needs a path, e.g. "pty:$VBUS_RUNTIME/x"')
        self._lock.take()
        try:
            if self._link_path.exists() and not self._link_path.is_symlink():
                raise TransportError(
                    f"{self._link_path} exists and is not a link of ours; remove it or choose"
                    " another name"
                )
            self.master, self._slave = os.openpty()
            # A terminal left cooked would echo and eat 29 byte values.
            tty.setraw(self._slave)
            os.set_blocking(self.master, False)
            self._name = os.ttyname(self._slave)
            self._watch = OpenWatch(self._name)
            temporary = self._link_path.with_name(f".{self._link_path.name}.{os.getpid()}")
            temporary.unlink(missing_ok=True)
            temporary.symlink_to(self._name)
            temporary.replace(self._link_path)
        except OSError as error:
            self.close()
            if isinstance(error, TransportError):
                raise
            raise TransportError(f"{self._link_path}: {error.strerror or error}") from error
        self._loop = loop
        self._on_link = on_link
        loop.add_reader(self._watch.fd, self.notice)

    def notice(self) -> None:
        """Begin and end sessions as clients open and close the terminal.

        The event loop serves descriptors in the order in which they became readable, so an open or
        close is known before the bytes that came after it.
        """
        if self._watch is None:
            return
        for opened in self._watch.read():
            if opened:
                self._clients += 1
                if self._link is None and self._on_link is not None:
                    self._link = PtyLink(self, self._name)
                    self.state = "connected"
                    self._on_link(self._link)
            else:
                self._clients = max(0, self._clients - 1)
                if self._clients == 0:
                    self._end()

    def _end(self) -> None:
        link, self._link = self._link, None
        if link is not None and link.on_end is not None:
            link.on_end()
        # What the client did not read waits in the slave's input queue; nobody else may get it.
        termios.tcflush(self._slave, termios.TCIFLUSH)
        fcntl.ioctl(self._slave, _TIOCNXCL)
        tty.setraw(self._slave)
        self.state = "waiting"

    def close(self) -> None:
        """Remove the name and the terminal."""
        if self._watch is not None:
            if self._loop is not None:
                self._loop.remove_reader(self._watch.fd)
            self._watch.close()
            self._watch = None
        if self._name and self._link_path.is_symlink():
            if os.readlink(self._link_path) == self._name:
                self._link_path.unlink()
        self._lock.give_back()
        for fd in (self.master, self._slave):
            if fd >= 0:
                os.close(fd)
        self.master = self._slave = -1
