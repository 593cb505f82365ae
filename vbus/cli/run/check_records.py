"""What ``[record]`` and ``[waves.NAME]`` ask for, looked at without opening a file to write."""

from collections.abc import Iterator
from contextlib import contextmanager

from vbus.board.board import Board
from vbus.boardfile.sections import BoardFile
from vbus.boardfile.source import Source
from vbus.core.errors import VbusError
from vbus.serve.recording import ALONE
from vbus.views.findings.suppress import suppressions_of


def check_records(file: BoardFile, board: Board, source: Source) -> None:
    """Find recordings that could not begin when the board is run.

    Raises:
        BoardFileError: there is at least one.
    """
    record = file.record

    @contextmanager
    def checked(*place: str) -> Iterator[None]:
        try:
            yield
        except (ValueError, VbusError) as error:
            source.fail(place, str(error))

    if record.durable != "no" and not record.journal:
        source.fail(("record", "durable"), ALONE)
    if record.report:
        from vbus.views.findings.formats import format_of

        with checked("record", "report"):
            format_of(record.report)
    if record.coverage:
        from vbus.views.coverage.formats import coverage_format

        with checked("record", "coverage"):
            coverage_format(record.coverage)
    if record.suppress:
        with checked("record", "suppress"):
            suppressions_of(record.suppress)
    for wave in file.waves:
        from vbus.events.condition import Condition
        from vbus.views.wave.signals import nets_of

        with checked("waves", wave.name, "signals"):
            nets_of(board, wave.signals)
        if wave.trigger:
            with checked("waves", wave.name, "trigger"):
                Condition(wave.trigger, board, "trigger")
    source.finish()
