"""Names in the runtime directory that survive a crash of their owner."""

import errno
import fcntl
import os
import stat
from collections import Counter
from collections.abc import Callable, Iterator
from contextlib import ExitStack, contextmanager, suppress
from pathlib import Path
from time import sleep
from typing import Final

from vbus.core.errors import NameInUseError, TransportError
from vbus.core.runtime import is_trusted, lock_of, locked_names, pause_mark, runtime_directory
from vbus.core.wall_clock import monotonic

PATIENCE_SECONDS: Final = 0.2
"""How long a lock is tried again that another process has taken: it may be about to end."""
# On a busy machine it may have no turn for seconds while it looks.
LOOK_SECONDS: Final = 30.0
"""How long one is tried again that others only look at: they let go of it at once."""
PAUSE_SECONDS: Final = 0.01
"""How often."""
PLAIN: Final = os.O_CLOEXEC | os.O_NOFOLLOW | os.O_NONBLOCK
"""A file is opened as it is: what others have put there is not followed, nor waited for."""
LONGEST_ADDRESS: Final = 107
"""Bytes of a Unix socket's path that the system takes."""


_PLANTED: Final = (
    "is no lock of vbus: it leads elsewhere, and would be overwritten there; remove it"
)

_HELD: Final[Counter[Path]] = Counter()
"""How many names of a directory this process owns."""


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


def lock(fd: int, how: int, refused: Callable[[int], Exception]) -> None:
    """Lock a file, or raise what ``refused`` makes of it if another process has taken it.

    Who only looks whether one has, shares the lock (LOCK_SH), and is waited for.

    Args:
        fd: the file.
        how: LOCK_EX or LOCK_SH.
        refused: returns the error.
    """
    begun = monotonic()
    while True:
        try:
            fcntl.flock(fd, how | fcntl.LOCK_NB)
            return
        except BlockingIOError:
            longest = PATIENCE_SECONDS if _is_taken(fd) else LOOK_SECONDS
            if monotonic() - begun > longest:
                raise refused(fd) from None
        sleep(PAUSE_SECONDS)


def _is_taken(fd: int) -> bool:
    """Whether another process has locked a file for itself."""
    try:
        fcntl.flock(fd, fcntl.LOCK_SH | fcntl.LOCK_NB)
    except BlockingIOError:
        return True
    fcntl.flock(fd, fcntl.LOCK_UN)
    return False


def locked(
    path: Path, flags: int, mode: int, refused: Callable[[int], Exception],
    check: Callable[[int], object] | None = None,
) -> int:  # fmt: skip
    """Return the descriptor of a file that this process alone has locked, as long as it lives.

    Args:
        path: the file; it is made if there is none.
        flags: how it is opened.
        mode: its permissions, if it is made.
        refused: see :func:`lock`.
        check: looks at the open file before it is locked, if anything does.
    """
    while True:
        with ExitStack() as closing:
            fd = os.open(path, flags | os.O_CREAT | PLAIN, mode)
            closing.callback(os.close, fd)
            if check is not None:
                check(fd)
            lock(fd, fcntl.LOCK_EX, refused)
            if _is_there(path, fd):  # else its last owner has moved or removed it meanwhile
                closing.pop_all()
                return fd


def _is_there(path: Path, fd: int) -> bool:
    try:
        return os.path.samestat(os.stat(path), os.fstat(fd))
    except FileNotFoundError:
        return False


class NameLock:
    """Ownership of a name in the file system, given back by the system when its owner dies.

    Args:
        path: the name; the lock lies beside it as ``.NAME.lock``.
    """

    def __init__(self, path: Path) -> None:
        self._path: Path = path
        self._fd: int = -1

    def take(self, board: str = "") -> None:
        """Take the name.

        Args:
            board: what the name is for.

        Raises:
            TransportError: another running process has it, or the directory cannot be written.
        """
        try:
            self._path.parent.mkdir(mode=0o700, parents=True, exist_ok=True)
            if self._fd < 0:
                self._fd = locked(lock_of(self._path), os.O_RDWR, 0o600, self._in_use, self._check)
            _HELD[self._path.parent] += 1
            os.ftruncate(self._fd, 0)
            os.write(self._fd, f"{os.getpid()}\n{board}".encode())
        except TransportError:
            raise
        except OSError as error:
            self.give_back()
            planted = f"{lock_of(self._path)} {_PLANTED}"
            said = f"{self._path}: {error.strerror or error}"
            raise TransportError(planted if error.errno == errno.ELOOP else said) from error

    def _check(self, fd: int) -> None:
        """Refuse a lock that others have put there."""
        path, found = lock_of(self._path), os.fstat(fd)
        if not stat.S_ISREG(found.st_mode) or found.st_nlink > 1:
            raise TransportError(f"{path} {_PLANTED}")
        if not is_trusted(found):
            raise TransportError(
                f"{path} is no lock of vbus: others have made it or may write to it; remove it"
            )

    def _in_use(self, fd: int) -> NameInUseError:
        owner = os.read(fd, 32).decode("ascii", "replace").partition("\n")[0] or "?"
        return NameInUseError(
            f"{self._path} is in use by process {owner}; stop it or choose another name"
        )

    def give_back(self) -> None:
        """Let the name go and remove the lock."""
        if self._fd >= 0:
            lock_of(self._path).unlink(missing_ok=True)
            os.close(self._fd)
            self._fd = -1
            _HELD[self._path.parent] -= 1

    def remove(self) -> None:
        """Remove a name, with its lock, that no process owns.

        Raises:
            OSError: one does, or the lock is none of ours.
        """
        path = lock_of(self._path)
        fd = os.open(path, os.O_RDONLY | PLAIN)
        try:
            self._check(fd)
            fcntl.flock(fd, fcntl.LOCK_SH | fcntl.LOCK_NB)  # an owner to be waits for who looks
            if _is_there(path, fd):
                self._path.unlink(missing_ok=True)
                path.unlink()
        finally:
            os.close(fd)


def mark_pause(url: str, paused: bool) -> None:
    """Leave word beside a link's name that its board answers later, or take it away."""
    kind, _, path = url.partition(":")
    if kind in ("pty", "unix"):
        mark = pause_mark(Path(path))
        with suppress(OSError):  # without the mark clients wait as for any late answer
            mark.unlink(missing_ok=True)
            if paused:
                os.close(os.open(mark, os.O_CREAT | os.O_EXCL | os.O_CLOEXEC, 0o600))


def sweep(directory: Path) -> None:
    """Remove what killed processes have left in a directory: names of terminals, sockets, locks.

    Sockets and bare locks only in the runtime directory: elsewhere they may be another program's.
    It is done with the first name a process takes there: a board of a thousand links looks once.
    """
    if _HELD[directory] > 1:
        return
    ours = runtime_directory().resolve() in (directory.resolve(), *directory.resolve().parents)
    with suppress(OSError), ExitStack() as closing:  # it cannot be read, or another process does it
        place = os.open(directory, os.O_RDONLY | os.O_DIRECTORY | os.O_CLOEXEC)
        closing.callback(os.close, place)
        # One at a time, else what one has removed and an owner has taken anew goes by the other.
        fcntl.flock(place, fcntl.LOCK_EX | fcntl.LOCK_NB)
        for name in locked_names(directory):
            if leads_to_terminal(name) or (ours and (name.is_socket() or not name.exists())):
                with suppress(OSError):
                    NameLock(name).remove()


def leads_to_terminal(name: Path) -> bool:
    """Tell whether a name is what a server leaves behind: a link to some terminal."""
    return name.is_symlink() and os.readlink(name).startswith("/dev/pts/")
