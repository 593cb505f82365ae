"""Bookmarks: instants with a text, and the file that has those of recordings and running boards."""

import hashlib
import json
import os
import select
from contextlib import suppress
from pathlib import Path
from typing import Any, Final, TypeGuard

from vbus.cli.output import complain
from vbus.cli.proc import handle_of
from vbus.core.errors import VbusError, read_errors
from vbus.serve.output_file import write_file

# A page draws all of them at once.
MOST: Final = 1000
"""Bookmarks of a recording."""
LONGEST: Final = 200
"""Characters of a text."""
DIGITS: Final = 24
"""Digits of an instant at most."""

Bookmark = dict[str, str]
"""``at``, an instant in ps from the begin of the recording as a decimal, and ``text``."""


def is_bookmark(value: Any) -> TypeGuard[Bookmark]:
    """Whether something a page or a file has said is a bookmark."""
    if not isinstance(value, dict) or set(value) != {"at", "text"}:
        return False
    at, text = value["at"], value["text"]
    return (
        isinstance(at, str) and at.isascii() and at.isdigit() and len(at) <= DIGITS
        and isinstance(text, str) and 0 < len(text) <= LONGEST and text.isprintable()
    )  # fmt: skip


def place(bookmark: Bookmark) -> tuple[int, str]:
    """Return what bookmarks are put in order by."""
    return int(bookmark["at"]), bookmark["text"]


# A board that is started each day keeps the notes of some weeks.
RUNS: Final = 20
"""Runs of which a file keeps bookmarks; those of the oldest go first."""
# Its journal is closed after its links: a long one, on a slow disk, takes seconds.
CLOSING: Final = 10.0
"""Seconds that a board whose links are closed may take to end."""
# Some three times 20 runs of 1,000 texts of 200 letters.
LARGEST: Final = 1 << 24
"""Bytes of a file that is read."""


class Bookmarks:
    """The bookmarks of one run, in a file that may have those of others too.

    Args:
        path: the file; it need not be there.
        run: what tells the run from others of its name.

    Attributes:
        all: they, in order of time.

    Raises:
        VbusError: the file is there and cannot be read, or is none of bookmarks.
    """

    def __init__(self, path: Path, run: str) -> None:
        self._path: Path = path
        self._run: str = run
        self.all: list[Bookmark] = []
        found = self._runs().get(run, [])
        self.all += sorted((one for one in found if is_bookmark(one)), key=place)

    def _runs(self) -> dict[str, list[Any]]:
        if not self._path.exists():
            return {}
        with read_errors(str(self._path)):
            if self._path.stat().st_size > LARGEST:
                raise VbusError(f"{self._path}: more than {LARGEST} bytes are no bookmarks")
            data = self._path.read_bytes()
        try:
            runs = json.loads(data)["runs"]
            if all(isinstance(one, list) for one in runs.values()):
                return dict(runs)
        # Whatever JSON holds in other places: it is another program's file, and stays as it is.
        except (ValueError, KeyError, TypeError, AttributeError, RecursionError):
            pass
        raise VbusError(f"{self._path}: these are no bookmarks; move the file away")

    def add(self, bookmark: Any) -> str:
        """Take one; return why it is refused, or nothing.

        Raises:
            VbusError: the file cannot be written; the bookmark is there all the same.
        """
        if not is_bookmark(bookmark):
            return "a bookmark has an instant and a line of text"
        if len(self.all) >= MOST:
            return f"more than {MOST} bookmarks are not saved"
        if bookmark not in self.all:
            self.all = sorted([*self.all, bookmark], key=place)
            self._write()
        return ""

    def remove(self, bookmark: Any) -> None:
        """Forget one.

        Raises:
            VbusError: the file cannot be written.
        """
        if bookmark in self.all:
            self.all.remove(bookmark)
            self._write()

    def _write(self) -> None:
        runs = self._runs()
        # The order in the file is that of writing: the oldest runs stand first.
        runs.pop(self._run, None)
        runs = dict(list(runs.items())[-RUNS + 1 :]) | ({self._run: self.all} if self.all else {})
        text = json.dumps({"format": 1, "runs": runs}, indent=1, ensure_ascii=False)
        write_file(self._path, text.encode() + b"\n")


def of_journal(path: Path) -> Bookmarks:
    """Return the bookmarks of a journal, which are saved beside it.

    Raises:
        VbusError: as :class:`Bookmarks`, or the journal cannot be read.
    """
    with read_errors(str(path)), path.open("rb") as file:
        run = hashlib.file_digest(file, "sha256").hexdigest()
    return Bookmarks(path.with_name(f"{path.name}.bookmarks.json"), run)


def of_board(name: str) -> Bookmarks:
    """Return the bookmarks of a board that runs, which are saved in the runtime directory.

    Raises:
        VbusError: as :class:`Bookmarks`, or the board has gone.
    """
    from vbus.serve.registry import socket_path

    path = socket_path(name)
    with read_errors(str(path)):
        # Another run of the same name has another socket.
        found = path.lstat()
    return Bookmarks(path.with_suffix(".bookmarks.json"), f"{found.st_ino}-{found.st_mtime_ns}")


def journal_of(status: dict[str, Any]) -> Path | None:
    """Return the journal that a running board keeps, if any, by what it says of itself."""
    if "journal" not in status:
        return None
    with suppress(OSError):  # it is not ours, or has gone
        return Path(os.readlink(f"/proc/{status['pid']}/cwd"), status["journal"]["file"])
    return None


def keep_with_journal(bookmarks: Bookmarks, journal: Path | None, status: dict[str, Any]) -> None:
    """Put the bookmarks of a board beside its journal too, if it has ended."""
    if journal is None or not bookmarks.all or not _has_ended(status["board"], status["pid"]):
        return
    try:
        saved = of_journal(journal)
        for bookmark in bookmarks.all:
            saved.add(bookmark)
    except VbusError as error:
        complain(f"bookmarks are not saved with the journal: {error}")


def _has_ended(name: str, process: int) -> bool:
    """Tell whether a board has ended; one whose names have gone is about to close its journal."""
    from vbus.serve.registry import socket_path

    with suppress(ProcessLookupError), handle_of(process) as handle:
        wait = 0.0 if socket_path(name).exists() else CLOSING
        return bool(select.select([handle], [], [], wait)[0])
    return True
