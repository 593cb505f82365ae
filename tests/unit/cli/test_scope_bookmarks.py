"""The file of bookmarks: of which run they are, what is refused, what is kept."""

from pathlib import Path
from typing import Any

import pytest

from vbus.cli.look.scope_bookmarks import LONGEST, MOST, RUNS, Bookmarks, of_journal
from vbus.core.errors import VbusError


def mark(at: int, text: str = "here") -> dict[str, str]:
    return {"at": str(at), "text": text}


def test_they_are_there_again_in_order_of_time(tmp_path: Path) -> None:
    kept = Bookmarks(tmp_path / "b.json", "run")
    for at in (30, 4, 200):
        assert kept.add(mark(at)) == ""
    assert kept.add(mark(4)) == ""
    kept.remove(mark(30))
    kept.remove(mark(31))
    assert Bookmarks(tmp_path / "b.json", "run").all == [mark(4), mark(200)]
    assert Bookmarks(tmp_path / "b.json", "other").all == []


def test_the_runs_of_one_file_keep_their_own_the_oldest_go_first(tmp_path: Path) -> None:
    for run in range(RUNS + 2):
        assert Bookmarks(tmp_path / "b.json", f"run {run}").add(mark(run)) == ""
    assert Bookmarks(tmp_path / "b.json", "run 1").all == []
    for run in range(2, RUNS + 2):
        assert Bookmarks(tmp_path / "b.json", f"run {run}").all == [mark(run)]


def test_another_journal_of_the_same_name_has_none(tmp_path: Path) -> None:
    journal = tmp_path / "run.vbj"
    journal.write_bytes(b"one")
    of_journal(journal).add(mark(1))
    assert (tmp_path / "run.vbj.bookmarks.json").exists()
    journal.write_bytes(b"two")
    assert of_journal(journal).all == []
    journal.write_bytes(b"one")
    assert of_journal(journal).all == [mark(1)]


@pytest.mark.parametrize(
    "bookmark",
    [
        None, [], {}, {"at": 1, "text": "a"}, {"at": "-1", "text": "a"}, {"at": "1", "text": ""},
        {"at": "1" * 25, "text": "a"}, {"at": "1", "text": "a" * (LONGEST + 1)},
        {"at": "1", "text": "a\nb"}, {"at": "1", "text": "a", "more": 1}, {"at": "١", "text": "a"},
    ],
)  # fmt: skip
def test_what_is_no_bookmark_is_refused(tmp_path: Path, bookmark: Any) -> None:
    kept = Bookmarks(tmp_path / "b.json", "run")
    assert kept.add(bookmark) == "a bookmark has an instant and a line of text"
    assert not (tmp_path / "b.json").exists()


def test_there_is_a_most(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    kept = Bookmarks(tmp_path / "b.json", "run")
    kept.all = [mark(at) for at in range(MOST)]
    assert kept.add(mark(MOST)) == f"more than {MOST} bookmarks are not saved"


@pytest.mark.parametrize("text", ["", "[]", '{"runs": []}', '{"runs": {"a": 1}}', "\udc80"])
def test_a_file_of_something_else_is_left_as_it_is(tmp_path: Path, text: str) -> None:
    path = tmp_path / "b.json"
    path.write_bytes(text.encode(errors="surrogateescape"))
    with pytest.raises(VbusError, match=r"b\.json: these are no bookmarks; move the file away"):
        Bookmarks(path, "run")
    path.write_text('{"runs": {"run": [1, {"at": "1", "text": "a"}]}}')
    assert Bookmarks(path, "run").all == [mark(1, "a")]


def test_one_that_cannot_be_written_is_there_all_the_same(tmp_path: Path) -> None:
    kept = Bookmarks(tmp_path / "none" / "b.json", "run")
    with pytest.raises(VbusError):
        kept.add(mark(1))
    assert kept.all == [mark(1)]
