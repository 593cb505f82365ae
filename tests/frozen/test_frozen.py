"""Recorded runs give the same hashes, save for what rulings have changed."""

import tomllib
from collections.abc import Iterable
from typing import Any

import pytest

from tests.frozen import generate
from tests.frozen.frozen import (
    BEGIN,
    END,
    HASHES,
    README,
    RUNS,
    STATES,
    Run,
    first_difference,
    hashes_of,
    play,
    read_journal,
    read_rulings,
    read_runs,
    table,
)
from vbus.board import snapshot

RECORDED = read_runs(HASHES.read_text())
RULINGS = ("LM-TRJ-6",)


@pytest.mark.parametrize("run", RECORDED, ids=lambda run: run.name)
def test_a_frozen_run_comes_to_what_it_came_to(run: Run) -> None:
    expected = run.expected()
    now = play(run)
    different = [name for name in expected if now.get(name) != expected[name]]
    assert not different, (
        f"{run.name} ({run.covers}) differs in {', '.join(different)};"
        f" first difference: {first_difference(run.name)}"
    )
    assert now.keys() == expected.keys()


def complaints(run: Run, rulings: Iterable[str] = read_rulings()) -> list[str]:
    """Say what is wrong with what is written beside a run's frozen hashes."""
    found = []
    base = dict(run.hashes)
    for part, entry in (("changed", run.changed), ("state_changed", run.state_changed)):
        new = hashes_of(entry)
        if not entry:
            continue
        if not entry.get("why"):
            found.append(f"{part} gives no reason")
        if not new:
            found.append(f"{part} changes nothing")
        for key, value in new.items():
            if key not in base:
                found.append(f"{part}: {key} is no hash of this run")
            elif base[key] == value:
                found.append(f"{part}: {key} is what it was")
        base |= new
    if run.changed and not run.rulings:
        found.append("changed names no ruling")
    if "ruling" in run.state_changed or not hashes_of(run.state_changed).keys() <= STATES:
        found.append("state_changed is for states alone")
    found += [f"no ruling {name}" for name in run.rulings if name not in rulings]
    return found


def test_only_what_a_ruling_changes_stands_beside_the_frozen_hashes() -> None:
    assert {run.name: complaints(run) for run in RECORDED if complaints(run)} == {}


def made(**parts: dict[str, Any]) -> Run:
    beside = {"changed": {}, "state_changed": {}, **parts}
    return Run("r", "", (), 0, 0, {"trace": "1", "state": "2"}, **beside)


@pytest.mark.parametrize(
    ("run", "complaint"),
    [
        (made(changed={"ruling": "LM-TRJ-6", "why": "w", "trace": "1"}), "trace is what it was"),
        (made(changed={"ruling": "LM-TRJ-6", "why": "w"}), "changes nothing"),
        (made(changed={"ruling": "LM-TRJ-6", "trace": "3"}), "no reason"),
        (made(changed={"why": "w", "trace": "3"}), "names no ruling"),
        (made(changed={"ruling": "X-1", "why": "w", "trace": "3"}), "no ruling X-1"),
        (made(changed={"ruling": "LM-TRJ-6", "why": "w", "reply": "3"}), "no hash of this run"),
        (made(state_changed={"why": "w", "trace": "3"}), "states alone"),
        (made(state_changed={"why": "w", "state": "2"}), "state is what it was"),
    ],
)
def test_an_entry_that_says_nothing_or_too_much_is_refused(run: Run, complaint: str) -> None:
    assert any(complaint in found for found in complaints(run, RULINGS))


def test_new_hashes_stand_above_the_frozen_ones() -> None:
    changed = {"ruling": "LM-TRJ-6", "why": "w", "trace": "3", "state": "4"}
    run = made(changed=changed, state_changed={"why": "w", "state": "5"})
    assert complaints(run, RULINGS) == []
    assert run.expected() == {"trace": "3", "state": "5"}


def updated(monkeypatch: pytest.MonkeyPatch, run: Run, alone: bool, **now: str) -> str:
    monkeypatch.setattr(generate, "play", lambda _: now)
    return generate.update(run, "" if alone else "LM-TRJ-6", "w", alone)


def test_an_update_writes_what_differs_beside_the_frozen_hashes(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    run = made()
    assert updated(monkeypatch, run, False, trace="3", state="2") == ""
    assert run.changed == {"ruling": "LM-TRJ-6", "why": "w", "trace": "3"}
    assert updated(monkeypatch, run, True, trace="3", state="5") == ""
    assert run.state_changed == {"why": "w", "state": "5"}
    assert complaints(run, RULINGS) == []
    assert run.hashes == {"trace": "1", "state": "2"}
    assert updated(monkeypatch, run, False, trace="1", state="2") == ""
    assert (run.changed, run.state_changed) == ({}, {})


def test_a_state_alone_is_no_reason_for_another_trace(monkeypatch: pytest.MonkeyPatch) -> None:
    run = made()
    assert "name a ruling" in updated(monkeypatch, run, True, trace="3", state="5")
    assert (run.changed, run.state_changed) == ({}, {})


def test_every_file_belongs_to_a_run_and_every_run_has_its_files() -> None:
    wanted = set()
    for run in RECORDED:
        ends = (".vbj", ".snap") if run.at else (".toml", ".txt")
        wanted |= {run.name + end for end in ends}
    assert {path.name for path in RUNS.iterdir()} == wanted
    assert len(wanted) > 200


def test_journals_and_snapshots_belong_together() -> None:
    for run in RECORDED:
        if not run.at:
            continue
        header, entries = read_journal((RUNS / f"{run.name}.vbj").read_bytes())
        kept = snapshot.read((RUNS / f"{run.name}.snap").read_bytes())
        assert kept.text == header.text
        assert header.text
        assert entries[-1].op == "end"
        assert 0 < run.operations <= len(entries) - run.at
        assert entries[run.at - 1].after <= kept.when <= entries[run.at].when


def test_the_page_tells_which_runs_each_ruling_changes() -> None:
    _, _, rest = README.read_text().partition(BEGIN)
    assert rest.partition(END)[0].strip() == table(RECORDED)


def test_hashes_toml_is_as_the_generator_writes_it() -> None:
    assert generate.text_of(RECORDED) == HASHES.read_text()
    assert list(tomllib.loads(HASHES.read_text())) == [run.name for run in RECORDED]
