"""What a served board records: its files are opened, kept written, and closed here."""

import asyncio
import io
from collections.abc import Callable, Iterable
from contextlib import suppress
from pathlib import Path
from typing import BinaryIO, Final, TextIO

from vbus.board.board import Board
from vbus.board.checks import all_rules
from vbus.board.sections import RecordSection, WaveSection
from vbus.errors import VbusError
from vbus.trace.decode import settings_for_decoders
from vbus.trace.findings.formats import FORMATS, format_of
from vbus.trace.findings.report import Report
from vbus.trace.findings.suppress import Suppression, read_suppressions
from vbus.trace.journal.journal import Journal
from vbus.trace.wave.wave import Wave

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


def suppressions_of(path: str) -> list[Suppression]:
    """Return the accepted violations of a file; none if ``path`` is empty.

    Raises:
        VbusError: it cannot be read or is wrong.
    """
    if not path:
        return []
    try:
        text = Path(path).read_text()
    except (OSError, UnicodeDecodeError) as error:
        reason = error.strerror if isinstance(error, OSError) else "this is no UTF-8 text"
        raise VbusError(f"{path}: cannot be read: {reason}") from error
    return read_suppressions(text, path, [rule.name for rule in all_rules()])


def open_text(path: str) -> TextIO:
    """Open a text file for writing.

    Raises:
        VbusError: it cannot be opened.
    """
    try:
        return Path(path).open("w", encoding="ascii", newline="\n")
    except OSError as error:
        raise VbusError(f"{path}: cannot be written: {error.strerror}") from error


def wave_of(board: Board, wish: WaveSection, file: TextIO, report: Callable[[str], None]) -> Wave:
    """Return the waveform a board file, or a command line, asks for; it is not started.

    Raises:
        VbusError: trigger or signals make no sense, or pyvcd is not installed.
    """
    return Wave(
        board, file, wish.profile, wish.signals, wish.trigger, wish.before, wish.duration,
        wish.sample, report,
    )  # fmt: skip


def _families(board: Board) -> dict[str, str]:
    return {chip.name: chip.FAMILY for chip in board.chips}


class Recording:
    """Everything that a board file, or its user, wants to be recorded.

    Args:
        board: a board nobody has opened a port on.
        wanted: what to record.
        text: the board file.
        name: its name.
        report: takes sentences about recordings that had to end.
        waves: waveforms to record.
    """

    def __init__(
        self,
        board: Board,
        wanted: RecordSection,
        text: str,
        name: str,
        report: Callable[[str], None],
        waves: Iterable[WaveSection] = (),
    ) -> None:
        self._loop: asyncio.AbstractEventLoop | None = None
        self._timer: asyncio.TimerHandle | None = None
        self._files: list[BinaryIO] = []
        self._texts: list[TextIO] = []
        self.journal: Journal | None = None
        if wanted.journal:
            file = self._create(wanted.journal)
            self.journal = Journal(board, file, text, name, report)
        self._say: Callable[[str], None] = report
        self._endings: list[tuple[str, BinaryIO, Callable[[], str]]] = []
        """What is written when the board stops: its name, where to, and what makes it."""
        if wanted.report:
            self._open_report(board, wanted, name)
        if wanted.coverage:
            self._open_coverage(board, wanted.coverage)
        self._waves: list[Wave] = []
        for wave in waves:
            wave_of(board, wave, io.StringIO(), report)  # complains before a file is overwritten
            text_file = open_text(wave.file)
            self._texts.append(text_file)
            made = wave_of(board, wave, text_file, report)
            made.start()
            self._waves.append(made)

    def _open_report(self, board: Board, wanted: RecordSection, name: str) -> None:
        try:
            style = format_of(wanted.report)
        except ValueError as error:
            raise VbusError(str(error)) from None
        accepted = suppressions_of(wanted.suppress)
        file = self._create(wanted.report)
        report = Report(
            board.name,
            _families(board),
            all_rules(),
            accepted,
            name,
            settings_for_decoders(board.chips),
        )
        board.observe(report)
        self._endings.append(("report", file, lambda: FORMATS[style](report)))

    def _open_coverage(self, board: Board, path: str) -> None:
        from vbus.trace.coverage.coverage import CoverageObserver
        from vbus.trace.coverage.formats import COVERAGE_FORMATS

        style = COVERAGE_FORMATS.get(Path(path).suffix)
        if style is None:
            known = ", ".join(COVERAGE_FORMATS)
            raise VbusError(f"{path}: a coverage file's name ends in one of {known}")
        file = self._create(path)
        observer = CoverageObserver(
            _families(board), board.name, settings_for_decoders(board.chips)
        )
        board.observe(observer)
        self._endings.append(("coverage", file, lambda: style(observer.coverage)))

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
        for wave in self._waves:
            wave.stop()
        if self.journal is not None:
            self.journal.close()
        for what, file, make in self._endings:
            try:
                file.write(make().encode())
            except OSError as error:
                self._say(f"the {what} is not written: {error.strerror}")
        for file in self._files:
            file.close()
        for text in self._texts:
            with suppress(OSError):  # what it could not take has been reported
                text.close()
