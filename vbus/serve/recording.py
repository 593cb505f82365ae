"""What a served board records: its files are opened, written, and closed here."""

import asyncio
import io
import os
from collections.abc import Callable, Iterable
from contextlib import ExitStack
from functools import partial
from typing import TYPE_CHECKING, Any, Final, NoReturn, TextIO

from vbus.board.board import Board
from vbus.board.check.checks import all_rules
from vbus.boardfile.sections import RecordSection, WaveSection
from vbus.core.errors import ConfigError, OptionError, VbusError, write_errors
from vbus.core.signals import Observer
from vbus.serve.output_file import OutputFile, output
from vbus.serve.registry import journal_path

if TYPE_CHECKING:
    from vbus.record.journal import Journal
    from vbus.views.wave.wave import Wave

FLUSH_SECONDS: Final = 0.2
"""How long an entry of a journal may wait for company: what a killed process loses."""
LARGEST: Final = 1 << 30
"""Bytes of a journal copied at once; not measured."""
ALONE: Final = "durable is what a journal survives, and none is written; give its file as journal"

LACKING: Final = "not all is recorded"
UNREPORTED: Final = (
    "suppress accepts violations in a report, and none is written; give its file as report"
)


def wave_of(board: Board, wave: WaveSection, file: TextIO, report: Callable[[str], None]) -> "Wave":
    """Return the waveform a board file, or a command line, asks for; it is not started.

    Raises:
        VbusError: name, trigger or signals make no sense, or pyvcd is not installed.
    """
    from vbus.views.wave.signals import vcd_name
    from vbus.views.wave.wave import Wave

    vcd_name(wave.file)
    return Wave(
        board, file, wave.profile, wave.signals, wave.trigger, wave.before, wave.duration,
        wave.sample, report,
    )  # fmt: skip


def no_journal(request: dict[str, Any]) -> NoReturn:
    """Refuse to save a journal of a board that keeps none.

    Raises:
        ValueError: always.
    """
    raise ValueError(
        "this board keeps no journal, which begins at power-on: run it with --journal FILE"
    )


def _families(board: Board) -> dict[str, str]:
    return {chip.name: chip.FAMILY for chip in board.chips}


class Recording:
    """Everything that a board file, or its user, wants to be recorded.

    Args:
        board: a board without open ports.
        text: the board file.
        name: its name.
        report: takes sentences about recordings that had to end.

    Attributes:
        journal: the one that is written, if any.
        settle: called before a host gets its answer; tells whether the journal holds what is
            answered. None where it need not.
        about: what ``vbus ls --json`` shows of the journal.
        failures: why files have not all they should have, a sentence each.
        others: what else is recorded, as people call it.
    """

    def __init__(self, board: Board, text: str, name: str, report: Callable[[str], None]) -> None:
        self.journal: Journal | None = None
        self.settle: Callable[[], bool] | None = None
        self.about: dict[str, str] = {}
        self.others: list[str] = []
        self._board: Board = board
        self._text: str = text
        self._name: str = name
        self._report: Callable[[str], None] = report
        self._timer: asyncio.TimerHandle | None = None
        self._opened: ExitStack = ExitStack()
        self._opening: bool = False
        self._served: bool = False
        self.failures: list[str] = []

    def open(self, wanted: RecordSection, waves: Iterable[WaveSection] = ()) -> None:
        """Open every file and begin to record; none is changed unless all can be.

        The board's name must be this process's (:func:`~vbus.serve.registry.own_board`).

        Raises:
            ConfigError: the board file wants a format that is none; options were refused before.
            OptionError: what is wanted makes no sense.
            VbusError: a file cannot be written.
        """
        if wanted.durable != "no" and not wanted.journal:
            raise OptionError(ALONE)
        if wanted.suppress and not wanted.report:
            raise OptionError(UNREPORTED)
        # Every file is opened before the first is emptied: a mistake in one costs no other.
        begin = []
        if wanted.journal:
            from vbus.record.format import MAGIC

            opened = self._output(wanted.journal, False, MAGIC)
            begin.append(self._journal(opened, wanted.durable))
        if wanted.report:
            self._begin_report(wanted.report, wanted.suppress)
        if wanted.coverage:
            self._begin_coverage(wanted.coverage)
        begin += [self._wave(wave) for wave in waves]
        self._opening = True
        for one in begin:
            one()
        self._opening = False

    def _output(self, path: str, whole: bool, begins: bytes = b"") -> OutputFile:
        file = OutputFile(path, whole, begins)
        self._opened.callback(file.close)
        return file

    def fail(self, sentence: str) -> None:
        """Note that a file takes no more; while files are opened that is an error."""
        if self._opening:
            raise VbusError(sentence)
        self.failures.append(sentence)
        self._report(sentence)

    def _failing(self, path: str) -> Callable[[str], None]:
        return lambda sentence: self.fail(f"{path}: {sentence}")

    def _journal(self, opened: OutputFile, durable: str) -> Callable[[], None]:
        from vbus.record.journal import Journal

        path = opened.path

        def begin() -> None:
            file = opened.begin()
            self.journal = Journal(self._board, file, self._text, self._name, self._failing(path))
            self._opened.callback(self.journal.close)
            if durable != "no":
                sync = partial(os.fdatasync, file.fileno()) if durable == "machine" else None
                self.settle = partial(self.journal.settle, sync)
            self.about = {"file": path, "durable": durable}

        return begin

    def _begin_report(self, path: str, suppress_file: str) -> None:
        from vbus.views.findings.formats import FORMATS, format_of
        from vbus.views.findings.report import Report
        from vbus.views.findings.suppress import suppressions_of

        try:
            style = FORMATS[format_of(path)]
        except ValueError as error:
            raise ConfigError(f"{self._name}: record.report: {error}") from None
        accepted = suppressions_of(suppress_file)
        board = self._board
        report = Report(board.name, _families(board), all_rules(), accepted, self._name)
        self._write_at_end("report", path, report, lambda: style(report))

    def _begin_coverage(self, path: str) -> None:
        from vbus.views.coverage.coverage import CoverageObserver
        from vbus.views.coverage.formats import coverage_format

        try:
            style = coverage_format(path)
        except ValueError as error:
            raise ConfigError(f"{self._name}: record.coverage: {error}") from None
        board = self._board
        observer = CoverageObserver(_families(board), board.name)
        self._write_at_end("coverage", path, observer, lambda: style(observer.coverage))

    def _wave(self, section: WaveSection) -> Callable[[], None]:
        fail = self._failing(section.file)
        # Complains before a file is overwritten.
        wave_of(self._board, section, io.StringIO(), fail)
        file = self._output(section.file, False)

        def begin() -> None:
            wave = wave_of(self._board, section, file.begin_text(), fail)
            self._opened.callback(wave.stop)
            self.others.append(f"the waveform in {section.file}")
            wave.start()

        return begin

    def _write_at_end(
        self, what: str, path: str, observer: Observer, make: Callable[[], str]
    ) -> None:
        file = self._output(path, True)
        self.others.append(f"the {what} in {path}")

        def write() -> None:
            if self._served:
                try:
                    file.write(make().encode())
                except VbusError as error:
                    self.fail(str(error))

        self._board.observe(observer)
        self._opened.callback(write)

    def start(self, loop: asyncio.AbstractEventLoop) -> None:
        """The board is served: write the journal at times, also while no host does anything."""
        self._served = True
        if self.journal is not None:
            self.journal.flush()
            self._timer = loop.call_later(FLUSH_SECONDS, self.start, loop)

    def save(self, request: dict[str, Any]) -> dict[str, str]:
        """Write a copy of the journal, as if the run ended now, in the runtime directory.

        Returns:
            Where the copy is, and the instant of its end (ps).

        Raises:
            VbusError: it cannot be written.
        """
        if self.journal is None:
            no_journal(request)
        from vbus.record.format import MAGIC

        board = self._board
        path = journal_path(board.name, board.now)
        ending = self.journal.ending()
        with (
            output(path, begins=MAGIC) as copy,
            write_errors(path),
            open(self.about["file"], "rb") as journal,
        ):
            file = copy.begin()
            # Copied by the system: a journal of gigabytes does not go through this process.
            while os.sendfile(file.fileno(), journal.fileno(), None, LARGEST):
                pass
            while ending:
                ending = ending[file.write(ending) :]
        return {"file": str(path), "when_ps": str(board.now)}

    def close(self) -> None:
        """The board has stopped: end every recording.

        Results of a board that was never served are not written.
        """
        if self._timer is not None:
            self._timer.cancel()
        self._opened.close()

    def check(self) -> None:
        """Raise what makes an exit code, once a run is over that is not all recorded.

        Raises:
            VbusError: a file has not all it should have; says which, and why.
        """
        if self.failures:
            raise VbusError(f"{LACKING}: {'; '.join(self.failures)}")
