"""``rfc2217:[HOST]:PORT``: a serial port over TCP, with Telnet's options (RFC 2217)."""

import asyncio
import socket
from collections.abc import Callable
from functools import partial
from typing import Final

from vbus.transports.base import Link
from vbus.transports.sockets import SocketLink, TcpTransport

READ: Final = 65536
MOST_KEPT: Final = 1 << 16
"""Bytes kept for a side that does not take them, before the other side is read no more."""


class SerialSettings:
    """What a host may set and look at: a port that takes every setting and whose lines rest.

    The board has no wire between the two: settings are remembered and change nothing.
    """

    def __init__(self) -> None:
        self.baudrate: int = 9600
        self.bytesize: int = 8
        self.parity: str = "N"
        self.stopbits: float = 1
        self.xonxoff: bool = False
        self.rtscts: bool = False
        self.dtr: bool = True
        self.rts: bool = True
        self.break_condition: bool = False
        self.cts: bool = True
        self.dsr: bool = True
        self.ri: bool = False
        self.cd: bool = True

    def reset_input_buffer(self) -> None:
        """Nothing waits in between."""

    def reset_output_buffer(self) -> None:
        """Nothing waits in between."""


class _Way:
    """One direction: bytes of ``source``, changed, to ``sink``."""

    def __init__(
        self,
        loop: asyncio.AbstractEventLoop,
        source: socket.socket,
        sink: socket.socket,
        change: Callable[[bytes], bytes],
        ended: Callable[[], None],
    ) -> None:
        self._loop = loop
        self._source = source
        self._sink = sink
        self._change = change
        self._ended = ended
        self._kept = bytearray()
        loop.add_reader(source, self._read)

    def _read(self) -> None:
        try:
            data = self._source.recv(READ)
        except BlockingIOError:
            return
        except OSError:
            data = b""
        if data:
            self.send(self._change(data))
        else:
            self._ended()

    def send(self, data: bytes) -> None:
        """Send bytes, now or when the sink takes them."""
        self._kept += data
        self._flush()

    def _flush(self) -> None:
        if self._sink.fileno() < 0:
            return
        try:
            while self._kept:
                del self._kept[: self._sink.send(self._kept)]
        except BlockingIOError:
            self._loop.add_writer(self._sink, self._flush)
            if len(self._kept) > MOST_KEPT:
                self._loop.remove_reader(self._source)
            return
        except OSError:
            self._ended()
            return
        self._loop.remove_writer(self._sink)
        if self._source.fileno() >= 0:
            self._loop.add_reader(self._source, self._read)

    def close(self) -> None:
        """Take no more."""
        self._loop.remove_reader(self._source)
        self._loop.remove_writer(self._sink)


class _Telnet:
    """Stands between a host that speaks Telnet and a session that takes plain bytes."""

    def __init__(
        self, loop: asyncio.AbstractEventLoop, host: socket.socket, board: socket.socket
    ) -> None:
        from serial.rfc2217 import PortManager

        self._sockets = (host, board)
        self._board: _Way = _Way(loop, board, host, self._escaped, self.close)
        self._host: _Way = _Way(loop, host, board, self._filtered, self.close)
        self._manager = PortManager(SerialSettings(), self)

    def write(self, data: bytes) -> None:
        """Send what the negotiation says to the host."""
        self._board.send(data)

    def _escaped(self, data: bytes) -> bytes:
        return b"".join(self._manager.escape(data))

    def _filtered(self, data: bytes) -> bytes:
        return b"".join(self._manager.filter(data))

    def close(self) -> None:
        """End both sides; again is harmless."""
        if self._sockets[0].fileno() < 0:
            return
        for way in (self._host, self._board):
            way.close()
        for end in self._sockets:
            end.close()


class Rfc2217Transport(TcpTransport):
    """``rfc2217:[HOST]:PORT``: TCP with Telnet's options for serial ports (RFC 2217)."""

    SCHEME = "rfc2217"

    def open(self, loop: asyncio.AbstractEventLoop, on_link: Callable[[Link], None]) -> None:
        """Listen."""
        super().open(loop, partial(self._linked, loop, on_link))
        self.url = self.url.replace("tcp:", "rfc2217:", 1)

    def _linked(
        self, loop: asyncio.AbstractEventLoop, on_link: Callable[[Link], None], link: Link
    ) -> None:
        inner, board = socket.socketpair()
        inner.setblocking(False)
        board.setblocking(False)
        host = socket.socket(fileno=socket.dup(link.fd))
        link.close()
        _Telnet(loop, host, inner)
        on_link(SocketLink(board, link.peer))
