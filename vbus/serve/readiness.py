"""Reports to the parent process, such as systemd, that the board is ready."""

import contextlib
import os
import socket


def tell_ready() -> None:
    """Say once that every link is open, where ``$NOTIFY_SOCKET`` asks for it."""
    place = os.environ.pop("NOTIFY_SOCKET", "")
    if not place:
        return
    address = f"\0{place[1:]}" if place.startswith("@") else place
    with (
        contextlib.suppress(OSError),  # who wanted to know has gone
        socket.socket(socket.AF_UNIX, socket.SOCK_DGRAM) as link,
    ):
        link.sendto(f"READY=1\nMAINPID={os.getpid()}\n".encode(), address)
