"""Opening links to a board: PTY, Unix socket, TCP, serial device, Zenoh."""

import errno
import os
import socket
import termios
import tty
from pathlib import Path
from typing import Final
from urllib.parse import parse_qs

from vbus.client.link import NOT_RUNNING, BoardLink
from vbus.core.errors import TransportError
from vbus.core.runtime import expanded, lock_state

KINDS: Final = (
    "pty:PATH, unix:PATH, tcp:HOST:PORT, serial:PATH?baud=RATE,"
    " zenoh:BOARD/CHIP?connect=ENDPOINT, or the path of a PTY"
)


MOST_LINKS: Final = 8
"""Names that may lead to a board's name one after the other: more are taken for a circle."""


def open_link(where: str) -> BoardLink:
    """Open a link; a TCP connection may still be on its way (see :meth:`BoardLink.check`).

    ``where`` is ``"pty:PATH"``, ``"unix:PATH"``, ``"tcp:HOST:PORT"``,
    ``"serial:PATH?baud=115200"``, ``"zenoh:BOARD/CHIP?connect=ENDPOINT"``, or the path of a PTY.
    ``$NAME`` stands for an environment variable, ``$VBUS_RUNTIME`` for the runtime directory also
    where that is not set.

    Raises:
        TransportError: the link cannot be opened; says why and what to do.
        ValueError: ``where`` is none of these.
    """
    place = expanded(where)
    kind, colon, rest = place.partition(":")
    if place.startswith(("/", ".")):
        kind, rest = "pty", place
    elif not colon:
        raise ValueError(f"{where!r} is no link; allowed are {KINDS}")
    # Imported here: Zenoh is an extra, which may not be installed.
    if kind == "zenoh" and rest:
        from vbus.client.zenoh_link import open_zenoh

        return open_zenoh(rest)
    board = ""
    opener = {"pty": _open_pty, "unix": _open_unix, "tcp": _open_tcp, "serial": _open_serial}
    if kind not in opener or not rest:
        raise ValueError(f"{where!r} is no link; allowed are {KINDS}")
    try:
        if kind == "pty":
            board = _board_at(Path(rest))
        return BoardLink(f"{kind}:{rest}", opener[kind](rest), board)
    except (OSError, termios.error) as error:
        reason = error.args[1] if len(error.args) > 1 else str(error)
        # expandvars() leaves what is not set as it is, and then no file is found.
        if "$" in rest:
            reason = "an environment variable in it is not set; vbus ls shows the link in full"
        else:
            reason = NOT_RUNNING.get(error.args[0] if error.args else 0, reason)
        raise TransportError(f"{kind}:{rest} cannot be opened: {reason}") from error


def _board_at(name: Path) -> str:
    """Return the board that has made a name; empty if it does not say.

    Raises:
        OSError: its process is gone: the terminal may be another's by now.
    """
    for _ in range(MOST_LINKS):
        if name.is_symlink() and not os.readlink(name).startswith("/dev/"):
            name = name.parent / os.readlink(name)
    try:
        held, lock = lock_state(name)
    except OSError:
        return ""
    # A terminal's number is given out again: behind it may be a shell by now.
    if not held:
        raise OSError(errno.ESTALE, "the board it led to was killed; start it again (vbus ls)")
    return lock.partition("\n")[2].strip()


def _open_pty(path: str) -> int:
    # It is not to become the terminal from which Ctrl-C comes.
    fd = os.open(path, os.O_RDWR | os.O_NOCTTY | os.O_NONBLOCK | os.O_CLOEXEC)
    try:
        if not os.isatty(fd):
            raise OSError(errno.ENOTTY, "not a PTY")
        # Now: the usual TCSAFLUSH would discard what the board has sent already.
        tty.setraw(fd, termios.TCSANOW)
    except (OSError, termios.error):
        os.close(fd)
        raise
    return fd


def _open_unix(path: str) -> int:
    with socket.socket(socket.AF_UNIX, socket.SOCK_STREAM) as link:
        link.connect(path)
        return link.detach()


def _open_tcp(address: str) -> int:
    host, _, port = address.rpartition(":")
    if not host or not port.isdecimal():
        raise ValueError(f"'tcp:{address}' is no link; allowed is tcp:HOST:PORT")
    family, kind, protocol, _, target = socket.getaddrinfo(
        host.strip("[]"), int(port), type=socket.SOCK_STREAM
    )[0]
    with socket.socket(family, kind, protocol) as link:
        # Connecting must not wait: the caller has a time limit of its own.
        link.setblocking(False)
        # Requests are a few bytes: Nagle's algorithm would hold each back for the answer before.
        link.setsockopt(socket.IPPROTO_TCP, socket.TCP_NODELAY, 1)
        code = link.connect_ex(target)
        if code not in (0, errno.EINPROGRESS):
            raise OSError(code, os.strerror(code))
        return link.detach()


def _open_serial(address: str) -> int:
    import serial

    path, _, query = address.partition("?")
    options = parse_qs(query, keep_blank_values=True)
    baud = options.pop("baud", ["115200"])[-1]
    if options or not baud.isdecimal():
        raise ValueError(f"'serial:{address}' is no link; allowed is serial:PATH?baud=RATE")
    device = serial.Serial(path, int(baud))
    fd = os.dup(device.fileno())
    device.close()
    return fd
