"""A link to a board: an open, non-blocking descriptor."""

import contextlib
import errno
import os
import socket
from pathlib import Path
from typing import Final

from vbus.core.errors import TransportError
from vbus.core.runtime import expanded, lock_state, pause_mark

_READ: Final = 65536
NOT_RUNNING: Final = {
    errno.ENOENT: "no such name; is the board running? (vbus ls)",
    errno.ECONNREFUSED: "no process listens there; is the board running? (vbus ls)",
}
"""By the system's error: why a link cannot be opened, and where to look."""
_GONE: Final = (errno.EIO, errno.EPIPE, errno.ECONNRESET, errno.ENXIO, errno.EBADF)


class BoardLink:
    """An open link to a board.

    Args:
        where: how it was asked for, for messages.
        fd: the descriptor; it is made non-blocking and belongs to the link from now on.
        board: the board it must lead to; empty if that is not known.
    """

    by_descriptor: bool = True
    """Whether the descriptor tells when the link takes more bytes; else it takes more when some
    have been read."""
    at_once: bool = False
    """Whether the answer to what was sent is here at once: waiting for it is a fifth of a call."""
    silent: bool = False
    """Whether no answer comes any more to what was sent: to wait for it would be in vain."""
    patience: float = 0.0
    """Seconds the link may be out of order and mend itself: replies may take so much longer."""

    def __init__(self, where: str, fd: int, board: str = "") -> None:
        self.where: str = where
        self.board: str = board
        self.fd: int = fd
        os.set_blocking(fd, False)

    def write(self, data: memoryview) -> int:
        """Send as much of ``data`` as the link takes now; return how much that was."""
        try:
            return os.write(self.fd, data)
        # Full: the caller waits until the descriptor takes more.
        except BlockingIOError:
            return 0
        except OSError as error:
            raise self._lost(error) from error

    def read(self) -> bytes:
        """Return the bytes that are here; none if there are none."""
        try:
            data = os.read(self.fd, _READ)
        except BlockingIOError:
            return b""
        except OSError as error:
            raise self._lost(error) from error
        # A descriptor that is readable and gives nothing is at its end.
        if not data:
            raise TransportError(f"{self.where}: closed by the other end")
        return data

    def replied(self) -> None:
        """Go on after a message that has been sent, and whose replies are here."""

    def until(self, deadline: float) -> float:
        """Return when to read although nothing has come, at the latest at ``deadline``."""
        return deadline

    @property
    def unanswered(self) -> bool:
        """Whether something that was sent has no answer yet, where the link itself can tell."""
        return False

    def look_for_board(self) -> None:
        """Ask whether the board is there, where a descriptor does not tell: else reading raises."""

    def end_sending(self) -> None:
        """Tell the other end that no more is sent; its answers can still be read."""
        with contextlib.suppress(OSError), socket.socket(fileno=os.dup(self.fd)) as connected:
            connected.shutdown(socket.SHUT_WR)

    def finish(self) -> None:
        """Make sure that what was sent has arrived, where the link itself can tell.

        Raises:
            TransportError: it has not; says what is lost.
        """

    def paused(self) -> bool:
        """Whether the board is paused: it answers when it goes on."""
        kind, _, path = self.where.partition(":")
        # A mark beside the link's name: a board that is paused answers nothing, not even that.
        return kind in ("pty", "unix") and pause_mark(Path(path)).exists()

    def check(self) -> None:
        """Tell whether a link that was being opened is open.

        Raises:
            TransportError: it is not; says why.
        """
        # Only TCP connects in the background; the other links are open or have failed.
        if self.where.startswith("tcp:"):
            with socket.socket(fileno=os.dup(self.fd)) as connected:
                code = connected.getsockopt(socket.SOL_SOCKET, socket.SO_ERROR)
            if code:
                reason = NOT_RUNNING.get(code, os.strerror(code))
                raise TransportError(f"{self.where} cannot be opened: {reason}")

    def check_board(self, board: str) -> None:
        """Compare the board that has answered with the one that should.

        Raises:
            TransportError: it is another one.
        """
        if self.board not in ("", board):
            raise TransportError(
                f"{self.where} leads to the board {board}, not to {self.board}: is that one still"
                " running? (vbus ls)"
            )

    def close(self) -> None:
        """Close the descriptor; again is harmless."""
        if self.fd >= 0:
            with contextlib.suppress(OSError):
                os.close(self.fd)
            self.fd = -1

    def _lost(self, error: OSError) -> TransportError:
        if error.errno in _GONE:
            return TransportError(f"{self.where}: closed by the other end")
        return TransportError(f"{self.where}: {error.strerror}")


PAUSE_SECONDS: Final = 0.02
"""Between two attempts to open a link (s); a board is ready within 120 ms (docs/performance.md)."""
START_SECONDS: Final = 5.0
"""How long a board that has begun to start may take (s): 40 times that."""


def starting(where: str) -> bool:
    """Tell whether a process has taken the name of a link that is not there yet."""
    kind, _, path = where.rpartition(":")
    name = Path(expanded(path))
    # Other links have no name beside which a lock could lie.
    if kind not in ("", "pty", "unix") or name.exists():
        return False
    try:
        held, _ = lock_state(name)
    except OSError:
        return False
    return held
