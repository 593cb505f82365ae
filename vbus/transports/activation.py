"""Sockets that systemd has opened: hosts may connect before the board is there."""

import contextlib
import os
import socket
from typing import Final

FIRST: Final = 3
"""The first descriptor that is handed over."""


def handed_over(family: int, address: object) -> socket.socket | None:
    """Return the listening socket at an address that this process was given, if there is one.

    Args:
        family: such as ``socket.AF_UNIX``.
        address: as ``getsockname()`` has it; of TCP the host and the port.
    """
    if os.environ.get("LISTEN_PID") != str(os.getpid()):
        return None
    count = os.environ.get("LISTEN_FDS", "")
    for descriptor in range(FIRST, FIRST + int(count if count.isdecimal() else 0)):
        with contextlib.suppress(OSError):  # it is no socket
            found = socket.socket(fileno=os.dup(descriptor))
            name = found.getsockname()
            place = name[:2] if isinstance(name, tuple) else name
            listens = found.getsockopt(socket.SOL_SOCKET, socket.SO_ACCEPTCONN)
            if found.family == family and place == address and listens:
                return found
            found.close()
    return None
