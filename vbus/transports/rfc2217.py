"""``rfc2217:[HOST]:PORT``: a serial port over TCP, with Telnet's options (RFC 2217)."""

import asyncio
import select
import socket
import struct
from collections.abc import Callable
from contextlib import ExitStack, suppress
from typing import Final

from vbus.core.signals import LOW, EdgeTaker, Net
from vbus.protocols.serial_line import BREAK, DTR, RTS, mark, marked
from vbus.transports.base import Link, Served, ignore
from vbus.transports.sockets import SocketLink, TcpTransport

READ: Final = 2048
"""Bytes looked through for options at a time: some milliseconds."""
MOST_KEPT: Final = 1 << 16
"""Bytes stored for a side that does not take them, before the other side is read no more."""
MOST_OPTION: Final = 256
"""Bytes of one Telnet option; the longest of RFC 2217 has 5."""


def _line(bit: int) -> property:
    """Return a line of the host, as pyserial switches it."""

    def get(settings: "SerialSettings") -> bool:
        return bool(settings.lines & bit)

    def put(settings: "SerialSettings", on: bool) -> None:
        before = settings.lines
        settings.lines = before | bit if on else before & ~bit
        if settings.lines != before:
            settings.on_lines(settings.lines)

    return property(get, put)


class SerialSettings:
    """What a host may set and look at: a port that takes every setting.

    The board has its own speed: settings are remembered and change nothing.

    Attributes:
        lines: the host's lines that are on: DTR, RTS and break.
        on_lines: called with them when one has changed.

    Args:
        cts: the net that turns CTS on while it is low; None: it is on.
        dsr: the same for DSR.
    """

    dtr = _line(DTR)
    rts = _line(RTS)
    break_condition = _line(BREAK)

    def __init__(self, cts: Net | None = None, dsr: Net | None = None) -> None:
        self.baudrate: int = 9600
        self.bytesize: int = 8
        self.parity: str = "N"
        self.stopbits: float = 1
        self.xonxoff: bool = False
        self.rtscts: bool = False
        self.ri: bool = False
        self.cd: bool = True
        self.lines: int = 0
        self.on_lines: Callable[[int], None] = ignore
        self._cts: Net | None = cts
        self._dsr: Net | None = dsr

    @property
    def cts(self) -> bool:
        """Whether the board lets the host send."""
        return self._cts is None or self._cts.value == LOW

    @property
    def dsr(self) -> bool:
        """Whether the board is there."""
        return self._dsr is None or self._dsr.value == LOW

    def reset_input_buffer(self) -> None:
        """Nothing waits in between."""

    def reset_output_buffer(self) -> None:
        """Nothing waits in between."""


class _Way:
    """One direction: bytes of ``source``, changed, to ``sink``, and then its end.

    Args:
        loop: the event loop.
        source: where bytes come from.
        sink: where they go; a sink that takes no more loses them.
        change: what becomes of them between.
        ended: called once when all has come to the sink, and the sink knows that it is the end.
    """

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
        self._all = False
        """Whether the source has sent all."""
        self._deaf = False
        """Whether the sink takes no more."""
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
            self._all = True
            self._loop.remove_reader(self._source)
            self._flush()

    @property
    def leaving(self) -> bool:
        """Whether the source has sent all, and the sink does not know that yet."""
        if self._all or self._source.fileno() < 0:
            return bool(self._kept)
        poll = select.poll()
        poll.register(self._source.fileno(), select.POLLRDHUP)
        return bool(poll.poll(0))

    @property
    def kept(self) -> int:
        """How many bytes wait for the sink."""
        return len(self._kept)

    def send(self, data: bytes) -> None:
        """Send bytes, now or when the sink takes them."""
        if self._sink.fileno() < 0:
            return
        self._kept += data
        self._flush()

    def _flush(self) -> None:
        if self._sink.fileno() < 0:
            return
        try:
            while self._kept and not self._deaf:
                del self._kept[: self._sink.send(self._kept)]
        except BlockingIOError:
            self._loop.add_writer(self._sink, self._flush)
            if len(self._kept) > MOST_KEPT:
                self._loop.remove_reader(self._source)
            return
        except OSError:
            self._deaf = True
        if self._deaf:
            self._kept.clear()
        self._loop.remove_writer(self._sink)
        if self._all:
            with suppress(OSError):
                self._sink.shutdown(socket.SHUT_WR)
            self._ended()
        elif self._source.fileno() >= 0:
            self._loop.add_reader(self._source, self._read)

    def close(self) -> None:
        """Take no more."""
        self._loop.remove_reader(self._source)
        self._loop.remove_writer(self._sink)


class _Telnet:
    """Stands between a host that speaks Telnet and a session that takes plain bytes.

    Args:
        loop: the event loop.
        host: the end towards the host.
        board: the end towards the session.
        settings: what the host may set.
        marks: whether the session gets, among the bytes, marks for lines that change.
        ended: called once when it is over.
    """

    def __init__(
        self,
        loop: asyncio.AbstractEventLoop,
        host: socket.socket,
        board: socket.socket,
        settings: SerialSettings,
        marks: bool,
        ended: Callable[["_Telnet"], None],
    ) -> None:
        from serial.rfc2217 import PortManager

        self._sockets = (host, board)
        self._marks: bool = marks
        self._plain: bytearray = bytearray()
        self._ended: Callable[[_Telnet], None] = ended
        # The host's end is that of what it sends; the session's is the end of both.
        self._board: _Way = _Way(loop, board, host, self._escaped, self.close)
        self._host: _Way = _Way(loop, host, board, self._filtered, ignore)
        if marks:
            settings.on_lines = self._lines_changed
        self._manager = PortManager(settings, self)

    def _lines_changed(self, lines: int) -> None:
        self._plain += mark(lines)

    @property
    def leaving(self) -> bool:
        """Whether the host has gone, and not all it has sent has come to its session."""
        return self._host.leaving

    def tell_lines(self) -> None:
        """Tell the host of CTS and DSR, if they have changed."""
        if self._sockets[0].fileno() >= 0:
            self._manager.check_modem_lines()

    def write(self, data: bytes) -> None:
        """Send what the negotiation says to the host, unless it has stopped reading that."""
        if self._board.kept + len(data) > 2 * MOST_KEPT:
            self.close()
        else:
            self._board.send(data)

    def _escaped(self, data: bytes) -> bytes:
        return b"".join(self._manager.escape(data))

    def _filtered(self, data: bytes) -> bytes:
        self._plain.clear()
        try:
            for byte in self._manager.filter(data):
                self._plain += marked(byte) if self._marks else byte
        except (TypeError, ValueError, LookupError, struct.error):  # options that make no sense
            self.close()
            return b""
        if len(self._manager.suboption or b"") > MOST_OPTION:
            self.close()
        return bytes(self._plain)

    def close(self) -> None:
        """End both sides; again is harmless."""
        if self._sockets[0].fileno() < 0:
            return
        for way in (self._host, self._board):
            way.close()
        for end in self._sockets:
            end.close()
        self._ended(self)


class Rfc2217Transport(TcpTransport):
    """``rfc2217:[HOST]:PORT``: TCP with Telnet's options for serial ports (RFC 2217)."""

    SCHEME = "rfc2217"

    def __init__(self, path: str, options: dict[str, str]) -> None:
        super().__init__(path, options)
        self._hosts: set[_Telnet] = set()
        self._nets: dict[str, Net] = {}
        self._plain: Callable[[Link], None] = ignore
        """Takes the links of plain bytes."""

    def serves(self, served: Served) -> None:
        """Find the nets that CTS and DSR follow."""
        for key, name in self.line.sensed.items():
            if name:
                self._nets[key] = served.board.find_pin(name).net

    def begin(self) -> None:
        """Listen."""
        self._plain, self.on_link = self.on_link, self._linked
        super().begin()
        self.url = self.url.replace("tcp:", "rfc2217:", 1)
        for net in self._nets.values():
            watch = EdgeTaker(lambda *_: self.loop.call_soon(self._tell_lines))
            net.observe(watch)
            self.opened.callback(net.unobserve, watch)

    def waiting(self) -> bool:
        """Tell whether a host waits to be accepted, or has left something on its way."""
        return super().waiting() or any(host.leaving for host in self._hosts)

    def _tell_lines(self) -> None:
        for host in tuple(self._hosts):
            host.tell_lines()

    def _linked(self, link: Link) -> None:
        with ExitStack() as opened:
            inner, board = (opened.enter_context(end) for end in socket.socketpair())
            inner.setblocking(False)
            board.setblocking(False)
            host = socket.socket(fileno=socket.dup(link.fd))
            opened.pop_all()
        link.close()
        settings = SerialSettings(self._nets.get("cts"), self._nets.get("dsr"))
        marks = any(self.line.driven.values())
        self._hosts.add(_Telnet(self.loop, host, inner, settings, marks, self._hosts.discard))
        self._plain(SocketLink(board, link.peer))
