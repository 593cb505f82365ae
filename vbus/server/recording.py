"""What a served board records: its files are opened, kept written, and closed here."""

import asyncio
from collections.abc import Callable
from pathlib import Path
from typing import BinaryIO, Final

from vbus.board.board import Board
from vbus.board.sections import RecordSection
from vbus.errors import VbusError
from vbus.trace.journal import Journal

FLUSH_SECONDS: Final = 0.2
"""How long an entry of a journal may wait for company."""


def create(path: str) -> BinaryIO:
    """Open a file for writing, without a buffer: what is written survives the process.

    Raises:
        VbusError: it cannot be opened.
    """
    try:
        return Path(path).open("wb", buffering=0)
    except OSError as error:
        raise VbusError(f"{path}: cannot be written: {error.strerror}") from error


class Recording:
    """Everything that a board file, or its user, wants to be recorded.

    Args:
        board: a board nobody has opened a port on.
        wishes: what to record.
        text: the board file.
        name: its name.
        report: takes sentences about recordings that had to end.
    """

    def __init__(
        self,
        board: Board,
        wishes: RecordSection,
        text: str,
        name: str,
        report: Callable[[str], None],
    ) -> None:
        self._loop: asyncio.AbstractEventLoop | None = None
        self._timer: asyncio.TimerHandle | None = None
        self._files: list[BinaryIO] = []
        self.journal: Journal | None = None
        if wishes.journal:
            file = self._create(wishes.journal)
            self.journal = Journal(board, file, text, name, report)

    def _create(self, path: str) -> BinaryIO:
        file = create(path)
        self._files.append(file)
        return file

    def start(self, loop: asyncio.AbstractEventLoop) -> None:
        """Begin to write at times, also while no host does anything."""
        self._loop = loop
        if self.journal is not None:
            self._again()

    def _again(self) -> None:
        if self._loop is not None and self.journal is not None:
            self.journal.flush()
            self._timer = self._loop.call_later(FLUSH_SECONDS, self._again)

    def close(self) -> None:
        """The board has stopped: end every recording."""
        self._loop = None
        if self._timer is not None:
            self._timer.cancel()
        if self.journal is not None:
            self.journal.close()
        for file in self._files:
            file.close()
