"""Every call of the system fails in turn: nothing leaks, hangs or lies."""

import io
import os
from pathlib import Path
from typing import Any

import pytest

from tests.simulation.failures import CODES, calls, failing, ways
from tests.unit.faults.bench import build
from vbus.core.errors import VbusError
from vbus.record.journal import Journal
from vbus.serve.output_file import write_file

SHORT = 5
"""Seed of a run with few calls."""


@pytest.mark.slow
def test_whichever_call_fails_nothing_leaks_hangs_or_lies() -> None:
    wrong = {way: failing(SHORT, *way) for way in ways(SHORT)}
    assert not {way: said for way, said in wrong.items() if said}


def test_the_run_has_calls_of_every_kind() -> None:
    assert set(calls(SHORT)) == set(CODES)


class Short(io.BytesIO):
    """Takes three bytes of each write."""

    def write(self, data: Any) -> int:
        return super().write(bytes(data)[:3])


def test_a_journal_that_is_written_in_pieces_counts_them_all() -> None:
    file = Short()
    board = build()
    journal = Journal(board, file, "", "b.toml")
    board.open_port("host0")
    journal.close()
    assert journal.bytes == len(file.getvalue())


FAILING = ("write", "fsync", "replace")


@pytest.mark.parametrize("name", FAILING)
@pytest.mark.parametrize("before", [None, b"old"])
def test_a_snapshot_is_whole_or_what_was_there_before(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, name: str, before: bytes | None
) -> None:
    path = tmp_path / "s.snap"
    if before is not None:
        path.write_bytes(before)

    def fails(*args: object) -> None:
        raise OSError(28, os.strerror(28))

    class Full(io.FileIO):
        def write(self, data: Any) -> int:
            if name == "write":
                super().write(bytes(data)[:2])
                fails()
            return super().write(data)

    monkeypatch.setattr(os, "fdopen", lambda fd, mode, buffering: Full(fd, mode[0]))
    if name == "fsync":
        monkeypatch.setattr(os, "fsync", fails)
    if name == "replace":
        monkeypatch.setattr(Path, "replace", fails)
    with pytest.raises(VbusError, match=r"s\.snap: cannot be written: No space left on device"):
        write_file(path, b"snapshot")
    monkeypatch.undo()
    assert [one.name for one in tmp_path.iterdir()] == ([] if before is None else ["s.snap"])
    assert before is None or path.read_bytes() == before
    write_file(path, b"snapshot")
    assert path.read_bytes() == b"snapshot"


def test_what_is_no_file_is_written_as_it_is() -> None:
    read, write = os.pipe()
    write_file(Path(f"/proc/self/fd/{write}"), b"snapshot")
    assert os.read(read, 100) == b"snapshot"
    os.close(read)
    os.close(write)
