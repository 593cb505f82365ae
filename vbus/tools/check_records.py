"""What ``[record]`` and ``[waves.NAME]`` ask for, looked at without opening a file to write."""

from pathlib import Path

from vbus.board.board import Board
from vbus.board.sections import BoardFile
from vbus.board.source import Source
from vbus.errors import VbusError


def check_records(file: BoardFile, board: Board, source: Source) -> None:
    """Find recordings that could not begin when the board is run.

    Raises:
        BoardFileError: there is at least one.
    """
    record = file.record
    if record.report:
        from vbus.trace.findings.formats import format_of

        try:
            format_of(record.report)
        except ValueError as error:
            source.fail(("record", "report"), str(error))
    if record.coverage:
        from vbus.trace.coverage.formats import COVERAGE_FORMATS

        if Path(record.coverage).suffix not in COVERAGE_FORMATS:
            known = ", ".join(COVERAGE_FORMATS)
            source.fail(
                ("record", "coverage"),
                f"{record.coverage}: a coverage file's name ends in one of {known}",
            )
    if record.suppress:
        from vbus.server.recording import suppressions_of

        try:
            suppressions_of(record.suppress)
        except VbusError as error:
            source.fail(("record", "suppress"), str(error))
    for wave in file.waves:
        from vbus.trace.wave.signals import nets_of
        from vbus.trace.wave.trigger import Trigger

        try:
            nets_of(board, wave.signals)
        except VbusError as error:
            source.fail(("waves", wave.name, "signals"), str(error))
        try:
            if wave.trigger:
                Trigger(wave.trigger, board)
        except VbusError as error:
            source.fail(("waves", wave.name, "trigger"), str(error))
    source.finish()
