"""``rfc2217:[HOST]:PORT``: a serial port over TCP, with Telnet's options (RFC 2217)."""

import asyncio
import errno
import os
import socket
import struct
from collections.abc import Callable
from types import SimpleNamespace
from typing import Final

from vbus.core.signals import LOW, EdgeTaker, Net
from vbus.protocols.serial_line import BREAK, DTR, RTS, mark, marked
from vbus.transports.base import REST_SECONDS, Link, Served, ignore
from vbus.transports.sockets import SocketLink, TcpTransport

IAC: Final = b"\xff"
"""Begins an option of Telnet."""
MOST_READS: Final = 16
"""Reads in a row that give options alone: some milliseconds."""
MOST_OWED: Final = 1 << 16
"""Bytes of the negotiation stored for a host that does not take them."""
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


class Rfc2217Link(SocketLink):
    """A host that speaks Telnet: its session reads and writes plain bytes.

    Args:
        loop: the event loop.
        connection: the connection.
        peer: who is at the other end, for people.
        settings: what the host may set.
        marks: whether the session gets, among the bytes, marks for lines that change.
        ended: called once when it is closed.
    """

    def __init__(
        self,
        loop: asyncio.AbstractEventLoop,
        connection: socket.socket,
        peer: str,
        settings: SerialSettings,
        marks: bool,
        ended: Callable[["Rfc2217Link"], None],
    ) -> None:
        from serial.rfc2217 import PortManager

        super().__init__(connection, peer)
        self.read = self._read
        self.write = self._write
        self._loop: asyncio.AbstractEventLoop = loop
        self._marks: bool = marks
        self._ended: Callable[[Rfc2217Link], None] = ended
        self._plain: bytearray = bytearray()
        self._owed: bytearray = bytearray()
        """What the negotiation says and the system has not taken."""
        self._half: int = 0
        """1: of a doubled byte the first has been sent."""
        self._broken: bool = False
        """Whether the host's options make no sense, or it reads none of what answers them."""
        if marks:
            settings.on_lines = self._lines_changed
        self._manager = PortManager(settings, SimpleNamespace(write=self._negotiate))

    def _lines_changed(self, lines: int) -> None:
        self._plain += mark(lines)

    def tell_lines(self) -> None:
        """Tell the host of CTS and DSR, if they have changed."""
        self._manager.check_modem_lines()

    def _read(self, fd: int, size: int) -> bytes:
        """Read; options are for the negotiation, and the session is given what stands between."""
        for _ in range(MOST_READS):
            data = b"" if self._broken else os.read(fd, size)
            plain = self._filtered(data)
            if self._broken:
                raise ConnectionResetError(errno.ECONNRESET, os.strerror(errno.ECONNRESET))
            if plain or not data:
                return plain
        raise BlockingIOError

    def _filtered(self, data: bytes) -> bytes:
        self._plain.clear()
        try:
            for byte in self._manager.filter(data):
                self._plain += marked(byte) if self._marks else byte
            self._broken |= len(self._manager.suboption or b"") > MOST_OPTION
        except (TypeError, ValueError, LookupError, struct.error):  # options that make no sense
            self._broken = True
        return bytes(self._plain)

    def _write(self, fd: int, data: bytearray) -> int:
        """Write; a byte that begins an option goes twice."""
        if not self._half:
            self._pay()
        doubled = data.replace(IAC, IAC + IAC)
        sent = os.write(fd, doubled[self._half :]) + self._half
        self._half = 0
        if sent == len(doubled):
            return len(data)
        plain = 0
        while sent > (again := int(data[plain] == IAC[0])):
            sent -= 1 + again
            plain += 1
        self._half = sent
        return plain

    def _negotiate(self, data: bytes) -> None:
        """Send what the negotiation says to the host, unless it has stopped reading that."""
        self._broken |= len(self._owed) > MOST_OWED
        if not self._broken:
            late = bool(self._owed)
            self._owed += data
            if not late:
                self._pay_in_time()

    def _pay(self) -> None:
        """Send what the negotiation has said.

        Raises:
            OSError: the host does not take it now, or has gone.
        """
        while self._owed:
            del self._owed[: os.write(self.fd, self._owed)]

    def _pay_in_time(self) -> None:
        if self._owed and self.connection.fileno() >= 0:
            try:
                if self._half:
                    raise BlockingIOError
                self._pay()
            except BlockingIOError:
                self._loop.call_later(REST_SECONDS, self._pay_in_time)
            except OSError:  # reading tells that the host has gone
                self._owed.clear()

    def close(self) -> None:
        """Close the connection."""
        super().close()
        self._ended(self)


class Rfc2217Transport(TcpTransport):
    """``rfc2217:[HOST]:PORT``: TCP with Telnet's options for serial ports (RFC 2217)."""

    SCHEME = "rfc2217"

    def __init__(self, path: str, options: dict[str, str]) -> None:
        super().__init__(path, options)
        self._hosts: set[Rfc2217Link] = set()
        self._nets: dict[str, Net] = {}

    def serves(self, served: Served) -> None:
        """Find the nets that CTS and DSR follow."""
        for key, name in self.line.sensed.items():
            if name:
                self._nets[key] = served.board.find_pin(name).net

    def begin(self) -> None:
        """Listen."""
        super().begin()
        self.url = self.url.replace("tcp:", "rfc2217:", 1)
        for net in self._nets.values():
            watch = EdgeTaker(lambda *_: self.loop.call_soon(self._tell_lines))
            net.observe(watch)
            self.opened.callback(net.unobserve, watch)

    def _tell_lines(self) -> None:
        for host in tuple(self._hosts):
            host.tell_lines()

    def link(self, connection: socket.socket, peer: str) -> Link:
        """Return the link of a host that has connected, as a serial port."""
        settings = SerialSettings(self._nets.get("cts"), self._nets.get("dsr"))
        marks = any(self.line.driven.values())
        link = Rfc2217Link(self.loop, connection, peer, settings, marks, self._hosts.discard)
        self._hosts.add(link)
        return link
