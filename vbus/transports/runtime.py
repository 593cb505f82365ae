"""Names in the runtime directory that survive a crash of their owner."""

import fcntl
import os
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Final

from vbus.errors import NameInUseError, TransportError
from vbus.runtime import runtime_directory as runtime_directory

LONGEST_ADDRESS: Final = 107
"""Bytes of a Unix socket's path that the system takes."""


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
