"""Files that a run writes: each belongs to one writer, and a result is there whole or not at all.

Two kinds share one class. A *stream* (journal, waveform of a running board, transcript) is written
under its name while things happen. A *result* (report, coverage, picture, snapshot) is written
beside its name and takes it at the end, so a full disk leaves what was there before.

Ownership is ``flock`` on what is being written: the system gives it back when a process dies. A
stream locks the file, a result locks its part, ``.NAME.part``; each then looks for a lock on the
other, so of two writers at least one is refused. Terminals, pipes and whatever is named below
``/dev`` or ``/proc`` have no owner and are written as they are.
"""

import errno
import fcntl
import os
import stat
from collections.abc import Iterator
from contextlib import ExitStack, contextmanager, suppress
from pathlib import Path
from typing import BinaryIO, Final, TextIO

from vbus.core.errors import VbusError, write_errors
from vbus.core.file_kinds import HEAD, not_replaced
from vbus.transports.runtime import PLAIN, lock, locked

LONGEST_COMMAND: Final = 120
"""Characters of a command line that a message shows."""


class OutputFile:
    """A file that this process writes; nothing of it is changed before :meth:`begin`.

    Args:
        path: the name.
        whole: whether it is a result; else it is a stream.
        begins: how it will begin, if that is known: a journal replaces no other file.

    Raises:
        VbusError: the file cannot be written, or another process or another output of this one
            writes it, or it is of another kind and would be lost; says which.
    """

    def __init__(self, path: str | Path, whole: bool = True, begins: bytes = b"") -> None:
        self.path: str = str(path)
        self._file: BinaryIO | None = None
        self._text: TextIO | None = None
        self._held: int = -1
        """The lock of the result that has its name, while the next one is written."""
        self._whole: bool = whole
        self._made: bool = False
        """Whether a stream that has not begun made the file."""
        with write_errors(path):
            place = Path(path)
            self._place: Path | None = None if _is_special(place) else place.resolve()
            if self._place is not None and self._place.is_dir():
                raise IsADirectoryError(errno.EISDIR, os.strerror(errno.EISDIR))
        self._claim()
        if self._place is not None and (refusal := not_replaced(_head(self._place), begins)):
            self.close()
            raise VbusError(f"{self.path}: {refusal}")

    def _claim(self) -> None:
        """Take the name."""
        with write_errors(self.path), ExitStack() as undo:
            place = self._place
            if place is None:
                self._file = Path(self.path).open("wb", buffering=0)  # noqa: SIM115
                return
            part = _part(place)
            if not self._whole:
                self._check(part)
            self._made = not self._whole and not place.exists()
            taken = locked(part if self._whole else place, os.O_WRONLY, 0o666, self._in_use)
            undo.callback(os.close, taken)
            if self._whole:
                undo.callback(part.unlink)
            if self._held < 0:
                self._check(place if self._whole else part)
            self._file = os.fdopen(taken, "wb", buffering=0)
            undo.pop_all()

    def _check(self, place: Path) -> None:
        """Refuse to go on where a file is locked."""
        try:
            fd = os.open(place, os.O_RDONLY | PLAIN)
        except (FileNotFoundError, PermissionError):
            return
        try:
            lock(fd, fcntl.LOCK_SH, self._in_use)
        finally:
            os.close(fd)

    def _in_use(self, fd: int) -> VbusError:
        return VbusError(f"{self.path}: {_refusal(fd)}")

    def begin(self) -> BinaryIO:
        """Return the file to write to, empty; it has no buffer of its own.

        Raises:
            VbusError: it cannot be emptied, or the part of the next result cannot be made.
        """
        if self._file is None:
            self._claim()
        assert self._file is not None
        self._made = False
        if self._place is not None:
            with write_errors(self.path):
                os.ftruncate(self._file.fileno(), 0)
        return self._file

    def begin_text(self) -> TextIO:
        """Return the file to write ASCII text to, empty.

        Raises:
            VbusError: it cannot be emptied.
        """
        fd = self.begin().fileno()
        self._text = open(fd, "w", encoding="ascii", newline="\n", closefd=False)  # noqa: SIM115
        return self._text

    def keep(self, sync: bool = True) -> None:
        """Give a result its name; the name stays this output's until :meth:`close`.

        Args:
            sync: wait until the disk has it; else it survives this process alone.

        Raises:
            VbusError: the disk does not take it; what had the name before has it still.
        """
        assert self._file is not None
        with write_errors(self.path):
            if self._text is not None:
                self._text.flush()
            if self._place is None or not self._whole:
                return
            fd = self._file.fileno()
            with suppress(FileNotFoundError):
                os.fchmod(fd, stat.S_IMODE(self._place.stat().st_mode))
            if sync:
                os.fsync(fd)
            _part(self._place).replace(self._place)
            held, self._held = self._held, os.dup(fd)
            if held >= 0:
                os.close(held)
            self._end()

    def write(self, data: bytes, sync: bool = True) -> None:
        """Write a result and give it its name, as :meth:`keep` does; may be repeated.

        Raises:
            VbusError: the disk does not take it; what had the name before has it still.
        """
        file = self.begin()
        with write_errors(self.path):
            while data:
                data = data[file.write(data) :]
        self.keep(sync)

    def _end(self) -> None:
        if self._text is not None:
            with suppress(OSError):  # what the disk has not taken was said when it was written
                self._text.close()
            self._text = None
        if self._file is not None:
            self._file.close()
            self._file = None

    def close(self) -> None:
        """Let the name go; the part of a result that is not whole is removed. May be repeated."""
        if self._file is not None and self._place is not None:
            with suppress(OSError):
                if self._whole:
                    _part(self._place).unlink()
                elif self._made:
                    self._place.unlink()
        self._end()
        if self._held >= 0:
            os.close(self._held)
            self._held = -1


@contextmanager
def output(path: str | Path, whole: bool = True, begins: bytes = b"") -> Iterator[OutputFile]:
    """Give an output file; a result takes its name at the end, unless there is an error."""
    file = OutputFile(path, whole, begins)
    try:
        yield file
        file.keep()
    finally:
        file.close()


def write_file(path: str | Path, data: bytes) -> None:
    """Write a file: it is there whole, or what was there before is.

    Raises:
        VbusError: it cannot be written, as :class:`OutputFile` says.
    """
    file = OutputFile(path, begins=data[:HEAD])
    try:
        file.write(data)
    finally:
        file.close()


def _head(place: Path) -> bytes:
    """Return how a file begins, if it may be read."""
    with suppress(OSError), place.open("rb") as there:
        return there.read(HEAD)
    return b""


def _part(place: Path) -> Path:
    return place.with_name(f".{place.name}.part")


def _is_special(place: Path) -> bool:
    """Tell whether a name is of something that is written as it is."""
    absolute = place.absolute()
    if absolute.is_relative_to("/dev/shm"):
        return False
    if absolute.is_relative_to("/dev") or absolute.is_relative_to("/proc"):
        return True
    return place.exists() and not place.is_file() and not place.is_dir()


def _refusal(fd: int) -> str:
    """Say who has locked a file, and what to do."""
    holder = _holder(os.fstat(fd))
    if holder == os.getpid():
        return "two outputs of this run are to go into this file; give each a file of its own"
    who = "another process"
    if holder is not None:
        who = f"process {holder}"
        with suppress(OSError):
            words = Path(f"/proc/{holder}/cmdline").read_bytes().split(b"\0")
            command = os.fsdecode(b" ".join(words).strip())[:LONGEST_COMMAND]
            who += f" ({command})" if command.isprintable() and command else ""
    return f"{who} writes this file; stop it, or give another file"


def _holder(found: os.stat_result) -> int | None:
    """Return the process that has locked a file, if it may be seen.

    The device in ``/proc/locks`` is not always that of ``stat`` (overlays, btrfs), so a process
    counts that has the file open.
    """
    with suppress(OSError):
        for line in Path("/proc/locks").read_text().splitlines():
            words = line.split()
            if "FLOCK" not in words or not words[-3].endswith(f":{found.st_ino}"):
                continue
            process = int(words[-4])
            with suppress(OSError):
                for opened in Path(f"/proc/{process}/fd").iterdir():
                    with suppress(OSError):
                        if os.path.samestat(opened.stat(), found):
                            return process
    return None
