"""Endpoints of this computer's boards and routers, so that hosts here find them by name."""

import contextlib
import fcntl
import os
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Final

from vbus.core.errors import TransportError
from vbus.core.runtime import is_trusted, subdirectory
from vbus.network.security import Security

ROUTER: Final = "router"
VARIABLE: Final = "VBUS_ZENOH"
"""Environment variable with endpoints, separated by commas."""
_held: dict[Path, int] = {}


def board_place(board: str) -> Path:
    """Return the file that tells where a board is."""
    return subdirectory("zenoh") / f"{board}.board"


def router_place() -> Path:
    """Return the file that tells where this computer's router is."""
    return subdirectory("zenoh") / ROUTER


def register(place: Path, endpoints: Sequence[str]) -> Path:
    """Write down where a board or router is reached, in place of an entry that a dead process left.

    The file stays locked as long as this process lives, so that one left behind is known.
    """
    temporary = place.with_name(f".{place.name}.{os.getpid()}")
    flags = os.O_RDWR | os.O_CREAT | os.O_TRUNC | os.O_CLOEXEC | os.O_NOFOLLOW
    with contextlib.ExitStack() as made:
        fd = os.open(temporary, flags, 0o600)
        made.callback(os.close, fd)
        made.callback(temporary.unlink)
        fcntl.flock(fd, fcntl.LOCK_SH)
        os.write(fd, "\n".join(endpoints).encode())
        temporary.replace(place)
        made.pop_all()
    _held[place] = fd
    return place


def unregister(place: Path) -> None:
    """Remove what :func:`register` wrote."""
    fd = _held.pop(place, -1)
    if fd >= 0:
        with contextlib.suppress(OSError):
            if os.stat(place).st_ino == os.fstat(fd).st_ino:
                place.unlink()
        os.close(fd)


def endpoints_at(place: Path) -> tuple[str, ...]:
    """Return where something is reached; nowhere if it does not run (any more)."""
    try:
        fd = os.open(place, os.O_RDONLY | os.O_CLOEXEC | os.O_NOFOLLOW | os.O_NONBLOCK)
    except OSError:
        return ()
    try:
        if not is_trusted(os.fstat(fd)):
            return ()
        # Who runs holds a shared lock: one that is free belongs to a process that died.
        fcntl.flock(fd, fcntl.LOCK_EX | fcntl.LOCK_NB)
    except BlockingIOError:
        return tuple(os.read(fd, 65536).decode().split())
    finally:
        os.close(fd)
    with contextlib.suppress(OSError):
        place.unlink()
    return ()


def security_of(options: Mapping[str, str], where: str) -> Security | None:
    """Return the certificates that were given, in a link or by environment variables.

    Args:
        options: ``certificate``, ``key``, ``authority``; what is missing is looked for in
            ``$VBUS_ZENOH_CERTIFICATE`` and so on.
        where: what they are for, for messages.

    Raises:
        TransportError: only some of the three are given.
    """
    names = ("certificate", "key", "authority")
    files = {
        name: options.get(name) or os.environ.get(f"{VARIABLE}_{name.upper()}", "")
        for name in names
    }
    if not any(files.values()):
        return None
    missing = [name for name in names if not files[name]]
    if missing:
        raise TransportError(
            f"{where}: {' and '.join(missing)} missing; certificate, key and authority belong"
            " together"
        )
    return Security(files["certificate"], files["key"], files["authority"])
