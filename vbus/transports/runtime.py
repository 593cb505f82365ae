"""The runtime directory, and names in it that survive a crash of their owner."""

import fcntl
import os
import stat
import tempfile
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Final

from vbus.errors import NameInUseError, TransportError

LONGEST_ADDRESS: Final = 107
"""Bytes of a Unix socket's path that the system takes."""


def runtime_directory() -> Path:
    """Return the directory for links and status files, made if need be.

    ``$VBUS_RUNTIME`` if set, else ``$XDG_RUNTIME_DIR/vbus``, else ``/run/vbus`` if it can be
    written, else a private directory (0700) below the system's temporary one.

    Raises:
        TransportError: the directory cannot be made or written, or others may write in it.
    """
    given = os.environ.get("VBUS_RUNTIME")
    if given:
        return _made(Path(given))
    xdg = os.environ.get("XDG_RUNTIME_DIR")
    if xdg and os.access(xdg, os.W_OK):
        return _made(Path(xdg) / "vbus")
    if os.access("/run/vbus", os.W_OK) or os.access("/run", os.W_OK):
        return _made(Path("/run/vbus"))
    return _private(Path(tempfile.gettempdir()) / f"vbus-{os.getuid()}")


def _made(path: Path) -> Path:
    try:
        path.mkdir(mode=0o700, parents=True, exist_ok=True)
    except OSError as error:
        raise TransportError(f"runtime directory {path}: {error.strerror or error}") from error
    if not os.access(path, os.W_OK | os.X_OK):
        raise TransportError(
            f"runtime directory {path} belongs to {_owner(path)}; set VBUS_RUNTIME to one of your"
            " own"
        )
    return path


def _private(path: Path) -> Path:
    """Make a directory where everybody may make directories: trust only one of our own."""
    _made(path)
    found = path.lstat()
    if not stat.S_ISDIR(found.st_mode) or found.st_uid != os.getuid() or found.st_mode & 0o077:
        raise TransportError(
            f"runtime directory {path} is open to others (owner {_owner(path)}, mode"
            f" {stat.S_IMODE(found.st_mode):o}); remove it, or set VBUS_RUNTIME to one of your own"
        )
    return path


def _owner(path: Path) -> str:
    try:
        return path.owner()
    except KeyError:
        return f"user {path.stat().st_uid}"


@contextmanager
def socket_address(path: Path) -> Iterator[str]:
    """Give the address of a Unix socket at ``path``, however long the path is.

    The system takes 107 bytes at most; a longer path is reached through its open directory.
    """
    if len(os.fsencode(path)) <= LONGEST_ADDRESS:
        yield str(path)
        return
    directory = os.open(path.parent, os.O_PATH | os.O_DIRECTORY | os.O_CLOEXEC)
    try:
        yield f"/proc/self/fd/{directory}/{path.name}"
    finally:
        os.close(directory)


class NameLock:
    """Ownership of a name in the file system, given back by the system when its owner dies.

    Args:
        path: the name; the lock lies beside it as ``.NAME.lock``.
    """

    def __init__(self, path: Path) -> None:
        self._lock_path: Path = path.parent / f".{path.name}.lock"
        self._fd: int = -1
        self._path: Path = path

    def take(self) -> None:
        """Take the name.

        Raises:
            TransportError: another running process has it, or the directory cannot be written.
        """
        try:
            self._path.parent.mkdir(mode=0o700, parents=True, exist_ok=True)
            while True:
                fd = os.open(self._lock_path, os.O_RDWR | os.O_CREAT | os.O_CLOEXEC, 0o600)
                try:
                    fcntl.flock(fd, fcntl.LOCK_EX | fcntl.LOCK_NB)
                    if os.stat(self._lock_path).st_ino == os.fstat(fd).st_ino:
                        break
                except BlockingIOError:
                    owner = os.read(fd, 32).decode("ascii", "replace").strip() or "?"
                    raise NameInUseError(
                        f"{self._path} is in use by process {owner}; stop it or choose another name"
                    ) from None
                except FileNotFoundError:
                    pass
                except BaseException:
                    os.close(fd)
                    raise
                os.close(fd)
        except TransportError:
            os.close(fd)
            raise
        except OSError as error:
            raise TransportError(f"{self._path}: {error.strerror or error}") from error
        os.ftruncate(fd, 0)
        os.write(fd, f"{os.getpid()}\n".encode())
        self._fd = fd

    def give_back(self) -> None:
        """Let the name go and remove the lock."""
        if self._fd >= 0:
            self._lock_path.unlink(missing_ok=True)
            os.close(self._fd)
            self._fd = -1
