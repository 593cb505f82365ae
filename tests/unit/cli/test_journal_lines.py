"""A journal as lines: equal cycles gone through at once are the lines of every entry."""

import io

from tests.unit.views.conftest import LM629, lm629_move, record
from vbus.cli.journal_lines import _explained, _Lines
from vbus.record.format import JournalReader
from vbus.record.view import Sessions, show


def every_entry(data: bytes) -> list[str]:
    reader = JournalReader(io.BytesIO(data))
    lines, sessions = _Lines(reader.header), Sessions()
    for entry in reader:
        show(entry, sessions, lines.stream)
        lines.drain()
    lines.stream.finish()
    lines.drain()
    lines.tell()
    return [str(line) for line in lines.ready]


def test_stretches_of_equal_cycles_are_the_lines_of_their_entries() -> None:
    data = record(LM629, lm629_move)
    found = [str(line) for line in _explained(JournalReader(io.BytesIO(data)))]
    assert len(found) > 20
    assert found == every_entry(data)
