"""A real serial device, with a board at its other end."""

import asyncio
import contextlib
import errno
import os
import termios
from typing import TYPE_CHECKING, Final

from vbus.core.errors import TransportError
from vbus.transports.base import Link, Transport

if TYPE_CHECKING:
    from serial import Serial

RETRY_SECONDS: Final = 0.5
"""How often an unplugged device is looked for (s): a person plugs it in."""
_ADVICE: Final = {
    errno.ENOENT: "; plug the device in, or write the name that it has in /dev",
    errno.EACCES: "; join the group that owns it (often dialout)",
    errno.EAGAIN: "; another program has it: end that first",
}
"""What to do about errors of the system."""


class SerialLink(Link):
    """The device while it is plugged in."""

    def __init__(self, transport: "SerialTransport", port: "Serial") -> None:
        super().__init__(port.fileno(), transport.path)
        self.tells_end = False
        self._transport: SerialTransport = transport
        self._port: Serial = port

    def close(self) -> None:
        """The device is gone, or the server ends: look for it again if it still runs."""
        with contextlib.suppress(OSError):  # the descriptor of an unplugged device
            self._port.close()
        self._transport.lost()


class SerialTransport(Transport):
    """``serial:DEVICE?baud=115200``: 8 data bits, no parity, 1 stop bit.

    An unplugged device is reported, looked for and taken into use again.
    """

    SCHEME = "serial"
    PROTOCOL = "framed"

    OPTIONS = ("baud",)

    _baud: int
    _retry: asyncio.TimerHandle | None = None

    def begin(self) -> None:
        """Open the device.

        Raises:
            TransportError: it is not there, in use, or refuses the speed.
        """
        baud = self.options.get("baud", "115200")
        if not baud.isdigit() or int(baud) == 0:
            raise TransportError(f"{self.url}: baud={baud!r} is not a speed, e.g. baud=115200")
        self._baud = int(baud)
        self.url = f"serial:{self.path}?baud={self._baud}"
        self._connect()

    def _connect(self) -> None:
        from serial import Serial, SerialException

        try:
            # Exclusive: a second program would take some of the host's bytes.
            port = Serial(self.path, self._baud, timeout=0, write_timeout=0, exclusive=True)
            try:
                _prepare(port.fileno())
            except BaseException:
                port.close()
                raise
        except (SerialException, ValueError, OSError, termios.error) as error:
            # pyserial repeats the system's error within its own text, at times twice.
            number: int = getattr(error, "errno", None) or 0
            reason = os.strerror(number) if number else str(error)
            raise TransportError(f"{self.url}: {reason}{_ADVICE.get(number, '')}") from error
        self.state = "connected"
        self.on_link(SerialLink(self, port))

    def lost(self) -> None:
        """The device is gone: report it and look for it."""
        if not self.closing:
            self.state = "unplugged"
            self.report(f"{self.path} was unplugged; waiting for it")
            self._look_again()

    def _look_again(self) -> None:
        self._retry = self.loop.call_later(RETRY_SECONDS, self._again)

    def _again(self) -> None:
        try:
            self._connect()
        except TransportError:
            self._look_again()
        else:
            self.report(f"{self.path} is back")

    def close(self) -> None:
        """Stop looking for the device."""
        self.closing = True
        if self._retry is not None:
            self._retry.cancel()


def _prepare(fd: int) -> None:
    os.set_blocking(fd, False)
    # With pyserial's VMIN of 0 a read that finds nothing looks like a closed line.
    attributes = termios.tcgetattr(fd)
    attributes[6][termios.VMIN] = 1
    termios.tcsetattr(fd, termios.TCSANOW, attributes)
