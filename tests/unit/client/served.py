"""A board's end of a link, in a thread: the byte protocol on a fake port."""

import contextlib
import os
import pty
import select
import socket
import termios
import threading
import tty
from pathlib import Path
from types import TracebackType
from typing import Self

from tests.unit.fake_port import FakePort
from vbus.core.kernel import NEVER
from vbus.protocols.byte import ByteProtocol


class Served:
    """Serves one session at a time on a link of the given kind until left.

    Args:
        kind: ``"pty"``, ``"unix"`` or ``"tcp"``.
        folder: where sockets are put.

    Attributes:
        where: what a client must be told.
        port: the port behind it.
        mute: take requests and answer nothing.
    """

    def __init__(self, kind: str, folder: Path) -> None:
        self.port = FakePort()
        self.mute = False
        self.messages: list[bytes] = []
        self._listener: socket.socket | None = None
        self._fd = self._slave = -1
        if kind == "pty":
            self._fd, self._slave = pty.openpty()
            tty.setraw(self._slave)
            self.where = "pty:" + os.ttyname(self._slave)
        elif kind == "unix":
            path = folder / "bus"
            self._listener = socket.socket(socket.AF_UNIX)
            self._listener.bind(str(path))
            self.where = f"unix:{path}"
        else:
            self._listener = socket.socket()
            self._listener.bind(("127.0.0.1", 0))
            self.where = f"tcp:127.0.0.1:{self._listener.getsockname()[1]}"
        if self._listener is not None:
            self._listener.listen()
        self._stop_read, self._stop_write = os.pipe()
        self._thread = threading.Thread(target=self._serve)

    def __enter__(self) -> Self:
        self._thread.start()
        return self

    def __exit__(
        self,
        kind: type[BaseException] | None,
        error: BaseException | None,
        trace: TracebackType | None,
    ) -> None:
        self.stop()
        for fd in (self._stop_read, self._stop_write, self._slave, self._fd):
            if fd >= 0:
                with contextlib.suppress(OSError):
                    os.close(fd)
        if self._listener is not None:
            self._listener.close()

    def stop(self) -> None:
        """Close the board's end."""
        if self._thread.is_alive():
            os.write(self._stop_write, b".")
            self._thread.join()
        if self._slave >= 0:
            os.close(self._slave)
            os.close(self._fd)
            self._slave = self._fd = -1

    def cook(self) -> None:
        """Put the terminal into the mode a fresh one has: it echoes and eats byte values."""
        mode = termios.tcgetattr(self._slave)
        mode[0] |= termios.ICRNL | termios.IXON | termios.ISTRIP
        mode[1] |= termios.OPOST | termios.ONLCR
        mode[3] |= termios.ICANON | termios.ECHO | termios.ISIG | termios.IEXTEN
        termios.tcsetattr(self._slave, termios.TCSANOW, mode)

    def _wait(self, fd: int) -> bool:
        return self._stop_read not in select.select([fd, self._stop_read], [], [])[0]

    def _serve(self) -> None:
        if self._listener is None:
            self._session(self._fd)
            return
        while self._wait(self._listener.fileno()):
            connection, _ = self._listener.accept()
            with connection:
                if not self._session(connection.fileno()):
                    return

    def _session(self, fd: int) -> bool:
        protocol = ByteProtocol(self.port)
        while self._wait(fd):
            try:
                data = os.read(fd, 4096)
            except OSError:
                data = b""
            if not data:
                return True
            mute = self.mute
            self.messages.append(data)
            protocol.receive(data)
            while self.port.held and self.port.hold_until != NEVER:
                self.port.limit = self.port.hold_until
                self.port.go_on()
                protocol.resume()
            protocol.report_events()
            answer = protocol.take()
            while answer and not mute:
                answer = answer[os.write(fd, answer) :]
        return False
