"""Sockets of a running board for the tools of this computer: status, control, watching."""

import asyncio
import os
from collections.abc import Callable
from pathlib import Path
from typing import Final

from vbus.transports.base import Link
from vbus.transports.sockets import UnixTransport

READ_SIZE: Final = 1 << 16

OnEnd = Callable[["Connection"], None]


class Connection:
    """One connection to such a socket: lines are taken, bytes are sent.

    Args:
        loop: the event loop.
        link: the connection.
        on_end: called once when it is over.
    """

    LONGEST_LINE: int = 1 << 16

    def __init__(self, loop: asyncio.AbstractEventLoop, link: Link, on_end: OnEnd) -> None:
        self.loop: asyncio.AbstractEventLoop = loop
        self.pending: bytearray = bytearray()
        """What is still to be sent."""
        self.open: bool = True
        self._link: Link = link
        self._on_end: OnEnd = on_end
        self._line: bytearray = bytearray()
        self._last: bool = False

    def begin(self) -> None:
        """Serve it from now on."""
        self.loop.add_reader(self._link.fd, self._readable)

    def take(self, line: bytes) -> None:
        """Take a line, with its end."""

    def too_long(self) -> None:
        """A line is longer than :attr:`LONGEST_LINE`."""
        self.end()

    def _readable(self) -> None:
        try:
            data = os.read(self._link.fd, READ_SIZE)
        except BlockingIOError:
            return
        except OSError:
            data = b""
        self._line += data
        if not data:
            self.end()
        elif self._line.endswith(b"\n"):
            line, self._line = bytes(self._line), bytearray()
            self.take(line)
        elif len(self._line) > self.LONGEST_LINE:
            self.too_long()

    def finish(self, data: bytes) -> None:
        """Send ``data`` and hang up."""
        self.loop.remove_reader(self._link.fd)
        self._last = True
        self.pending += data
        self.flush()

    def flush(self) -> None:
        """Send what is pending; what the other end does not take now goes as soon as it does."""
        try:
            del self.pending[: os.write(self._link.fd, self.pending)]
        except BlockingIOError:
            pass
        except OSError:  # who asked has not waited for the answer
            self.end()
            return
        if self.pending:
            self.loop.add_writer(self._link.fd, self.flush)
        else:
            self.loop.remove_writer(self._link.fd)
            if self._last:
                self.end()

    def end_with_board(self) -> None:
        """The board ends: so does this."""
        self.end()

    def end(self) -> None:
        """Hang up; may be called again."""
        if self.open:
            self.open = False
            self.loop.remove_reader(self._link.fd)
            self.loop.remove_writer(self._link.fd)
            self._link.close()
            self._on_end(self)


class Telling(Connection):
    """A connection that gets what ``vbus ls --json`` shows, at once.

    Args:
        loop: the event loop.
        link: the connection.
        on_end: called once when it is over.
        tell: makes the answer.
    """

    def __init__(
        self, loop: asyncio.AbstractEventLoop, link: Link, on_end: OnEnd, tell: Callable[[], bytes]
    ) -> None:
        super().__init__(loop, link, on_end)
        self._tell: Callable[[], bytes] = tell

    def begin(self) -> None:
        """Answer."""
        self.finish(self._tell())


class LocalSocket:
    """Listens at a path, and keeps the connections made there.

    Args:
        path: the socket.
        connection: makes the object that serves a connection.

    Attributes:
        connections: those that are open.
    """

    def __init__(
        self, path: Path, connection: Callable[[asyncio.AbstractEventLoop, Link, OnEnd], Connection]
    ) -> None:
        self._transport: UnixTransport = UnixTransport(str(path), {})
        self._transport.no_room = b'{"error": "the board has no descriptor left for this"}\n'
        self._connection: Callable[[asyncio.AbstractEventLoop, Link, OnEnd], Connection] = (
            connection
        )
        self.connections: list[Connection] = []

    def open(self, loop: asyncio.AbstractEventLoop) -> None:
        """Wait for connections.

        Raises:
            TransportError: the socket cannot be made.
        """

        def linked(link: Link) -> None:
            made = self._connection(loop, link, self.connections.remove)
            self.connections.append(made)
            made.begin()

        self._transport.open(loop, linked)

    def close(self) -> None:
        """Hang up on everybody and listen no more; may be called again."""
        for connection in list(self.connections):
            connection.end_with_board()
        self._transport.close()
