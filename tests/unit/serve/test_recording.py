"""What a served board records, while it is served."""

from pathlib import Path

import pytest

from tests.unit.faults.bench import build
from vbus.boardfile.sections import RecordSection
from vbus.record.format import JournalReader
from vbus.serve import recording
from vbus.serve.recording import Recording


def test_a_journal_is_copied_whole_however_little_the_system_copies_at_once(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    run, copy = tmp_path / "run.vbj", tmp_path / "copy.vbj"
    monkeypatch.setattr(recording, "LARGEST", 100)
    monkeypatch.setattr(recording, "journal_path", lambda *_: copy)
    board = build()
    made = Recording(board, board.text, "b.toml", pytest.fail)
    made.open(RecordSection(journal=str(run)))
    assert made.journal is not None
    made.journal.flush()
    begun = run.read_bytes()
    made.save({})
    made.close()
    assert made.journal not in board.listeners
    assert len(begun) > 200
    assert copy.read_bytes().startswith(begun)
    with copy.open("rb") as file:
        assert [entry.op for entry in JournalReader(file)] == ["end"]
