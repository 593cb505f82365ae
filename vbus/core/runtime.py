"""The runtime directory, where whatever runs leaves its names."""

import fcntl
import os
import stat
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

from vbus.core.errors import TransportError


def runtime_directory() -> Path:
    """Return the directory for links and status files, made if need be.

    ``$VBUS_RUNTIME`` if set, else ``$XDG_RUNTIME_DIR/vbus``, else ``/run/vbus`` if it can be
    written, else a private directory (0700) below the system's temporary one.

    Raises:
        TransportError: the directory cannot be made or written, belongs to another user, or
            others may write in it or replace it.
    """
    given = os.environ.get("VBUS_RUNTIME")
    if given:
        return _strict(Path(given))
    xdg = os.environ.get("XDG_RUNTIME_DIR")
    if xdg and os.access(xdg, os.W_OK):
        return _strict(Path(xdg) / "vbus")
    # Root in a container has no XDG_RUNTIME_DIR, and need not hide from others.
    if os.access("/run/vbus", os.W_OK) or os.access("/run", os.W_OK):
        return _strict(Path("/run/vbus"))
    from tempfile import gettempdir

    return _private(Path(gettempdir()) / f"vbus-{os.getuid()}")


def subdirectory(name: str) -> Path:
    """Return a directory of the runtime directory, made if need be, and as private.

    Raises:
        TransportError: as :func:`runtime_directory`.
    """
    # Made by this user alone, even where the runtime directory is one that others may read.
    return _private(runtime_directory() / name)


def is_trusted(found: os.stat_result) -> bool:
    """Whether only this user and root can have made a file or folder, and may write to it."""
    return found.st_uid in (os.geteuid(), 0) and not found.st_mode & (stat.S_IWGRP | stat.S_IWOTH)


@contextmanager
def private_runtime(unless_named: bool = False) -> Iterator[Path]:
    """Give a new private folder for links, while this lasts.

    It is the runtime directory, or is not where the user has named one and that shall stay. So
    runs of one board beside each other, as in CI, do not meet.
    """
    from tempfile import TemporaryDirectory

    named = os.environ.get("VBUS_RUNTIME")
    with TemporaryDirectory(prefix="vbus-") as folder:
        # Set for child processes, too, which find links by it.
        if named is None or not unless_named:
            os.environ["VBUS_RUNTIME"] = folder
        try:
            yield Path(folder)
        finally:
            if named is None:
                del os.environ["VBUS_RUNTIME"]
            else:
                os.environ["VBUS_RUNTIME"] = named


def pause_mark(name: Path) -> Path:
    """Return the file that is there as long as the board behind a link's name is paused."""
    return name.parent / f".{name.name}.paused"


def lock_of(name: Path) -> Path:
    """Return the file that is locked as long as the process lives that made ``name``.

    It holds the number of the process and the name of its board, a line each.
    """
    return name.parent / f".{name.name}.lock"


def lock_state(name: Path) -> tuple[bool, str]:
    """Return whether the process lives that made ``name``, and what its lock holds.

    Raises:
        OSError: no process has locked it, or others may not look.
    """
    # Never through a link, and never waiting: the folder may be another user's.
    flags = os.O_RDONLY | os.O_CLOEXEC | os.O_NOFOLLOW | os.O_NONBLOCK
    lock = os.open(lock_of(name), flags)
    try:
        fcntl.flock(lock, fcntl.LOCK_SH | fcntl.LOCK_NB)
    except BlockingIOError:
        return True, os.read(lock, 4096).decode("utf-8", "replace")
    finally:
        os.close(lock)
    return False, ""


def locked_names(directory: Path) -> list[Path]:
    """Return the names in a directory beside which a lock lies."""
    return [
        directory / lock.name[1:].removesuffix(".lock")
        for lock in sorted(directory.glob(".*.lock"))
    ]


def expanded(path: str) -> str:
    """Return a path with its variables replaced; ``$VBUS_RUNTIME`` stands for the directory above.

    Raises:
        TransportError: as :func:`runtime_directory`.
    """
    if "$VBUS_RUNTIME" in path or "${VBUS_RUNTIME}" in path:
        directory = str(runtime_directory())
        # Before expandvars(), which knows only what the environment has.
        path = path.replace("${VBUS_RUNTIME}", directory).replace("$VBUS_RUNTIME", directory)
    return os.path.expandvars(os.path.expanduser(path))


def _made(path: Path) -> Path:
    try:
        path.mkdir(mode=0o700, parents=True, exist_ok=True)
    except OSError as error:
        raise TransportError(f"runtime directory {path}: {error.strerror or error}") from error
    # Made by another user before: mkdir() does not mind.
    if not os.access(path, os.W_OK | os.X_OK):
        raise TransportError(
            f"runtime directory {path} belongs to {_owner(path)}; set VBUS_RUNTIME to one of your"
            " own"
        )
    return path


def _strict(path: Path) -> Path:
    """Make a directory: one in which others may write, or which they may replace, is refused."""
    real = _made(path).resolve()
    found = real.stat()
    if not is_trusted(found):
        raise TransportError(
            f"runtime directory {path} is open to others (owner {_owner(path)}, mode"
            f" {stat.S_IMODE(found.st_mode):o}): make it yours and chmod go-w, or set VBUS_RUNTIME"
            " to one of your own"
        )
    # A parent that others may write in lets them put another directory in its place.
    for place in real.parents:
        mode = place.stat().st_mode
        if mode & (stat.S_IWGRP | stat.S_IWOTH) and not mode & stat.S_ISVTX:
            raise TransportError(
                f"runtime directory {path}: others may replace it, because they may write in"
                f" {place} (mode {stat.S_IMODE(mode):o}); chmod go-w {place}, or set VBUS_RUNTIME"
                " to a directory elsewhere"
            )
    return path


def _private(path: Path) -> Path:
    """Make a directory where everybody may make directories: trust only one of our own."""
    _made(path)
    # lstat(): a link that waits there would lead anywhere.
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
