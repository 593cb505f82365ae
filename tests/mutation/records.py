"""What is written down: results, the list of survivors, the gate."""

import json
import tomllib
from collections.abc import Iterable, Sequence
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Final

from tests.mutation.mutants import Mutant

KEPT: Final = 12
"""Digits of a digest in the list that is checked in."""


@dataclass(frozen=True, slots=True)
class Result:
    """What became of a mutant.

    Attributes:
        id: the mutant.
        digest: of the source of its scope when it was tried, or how it begins.
        verdict: "killed", "survived" or "timeout".
        by: the test that failed.
        tests: how many tests were chosen.
        cpu: seconds of processor time, all its processes together.
    """

    id: str
    digest: str
    verdict: str
    by: str
    tests: int
    cpu: float

    def holds(self, mutant: Mutant) -> bool:
        """Tell whether the mutant's scope is as it was when it was tried."""
        return mutant.digest.startswith(self.digest)


def read_kept(path: Path) -> dict[str, Result]:
    """Return the verdicts of a list that is checked in; of how they came about it says nothing."""
    if not path.exists():
        return {}
    rows = (line.split() for line in path.read_text().splitlines() if not line.startswith("#"))
    return {name: Result(name, digest, verdict, "", 0, 0.0) for name, digest, verdict in rows}


def keep(path: Path, results: Iterable[Result]) -> None:
    """Write the list that is checked in."""
    lines = sorted(f"{row.id} {row.digest[:KEPT]} {row.verdict}" for row in results)
    path.write_text("\n".join(["# Made by `run.py keep`: mutant, digest, verdict.", *lines, ""]))


def read_results(path: Path) -> dict[str, Result]:
    """Return the last result of each mutant."""
    if not path.exists():
        return {}
    rows = (Result(**json.loads(line)) for line in path.read_text().splitlines())
    return {row.id: row for row in rows}


def append(path: Path, result: Result) -> None:
    """Add a result; several processes may do so."""
    path.parent.mkdir(parents=True, exist_ok=True)
    with path.open("a") as file:
        file.write(json.dumps(asdict(result)) + "\n")


@dataclass(frozen=True, slots=True)
class Entry:
    """One mutant of a checked-in list.

    Attributes:
        id: the mutant.
        file: where it is.
        function: its scope.
        before: the line.
        after: the changed line.
        reason: of a survivor: why nobody can observe it.
        tests: of the gate: what kills it.
    """

    id: str
    file: str
    function: str
    before: str
    after: str
    reason: str = ""
    tests: Sequence[str] = ()


def read_entries(path: Path) -> list[Entry]:
    """Read ``survivors.toml`` or ``gate.toml``."""
    if not path.exists():
        return []
    return [Entry(**row) for row in tomllib.loads(path.read_text()).get("mutant", ())]


def entry_text(entry: Entry) -> str:
    """Return one table of a list."""
    rows = [f"{name} = {_string(getattr(entry, name))}"
            for name in ("id", "file", "function", "before", "after")]  # fmt: skip
    if entry.tests:
        rows += ["tests = [", *(f"    {_string(name)}," for name in entry.tests), "]"]
    else:
        rows.append(f"reason = {_string(entry.reason)}")
    return "\n".join(["[[mutant]]", *rows, ""])


def _string(text: str) -> str:
    return json.dumps(text, ensure_ascii=False)


def share(results: Iterable[Result]) -> float:
    """Return which part of the mutants was killed."""
    killed = [result.verdict != "survived" for result in results]
    return sum(killed) / len(killed) if killed else 1.0


def judge(
    chosen: Sequence[Mutant], results: dict[str, Result], listed: Iterable[Entry]
) -> tuple[dict[str, Result], list[str], list[Mutant]]:
    """Compare a sample, its results and the list of survivors.

    Returns:
        the results that count, what is wrong, and the survivors nobody has listed.
    """
    entries = {entry.id: entry for entry in listed}
    valid: dict[str, Result] = {}
    problems, new = [], []
    for mutant in chosen:
        result = results.get(mutant.id)
        if result is None or not result.holds(mutant):
            continue
        valid[mutant.id] = result
        entry = entries.get(mutant.id)
        if result.verdict == "survived" and entry is None:
            new.append(mutant)
        elif result.verdict != "survived" and entry is not None:
            problems.append(
                f"{mutant.file}:{mutant.line}: {mutant.id} is listed, but {result.verdict}"
            )
    if new:
        problems.append(f"{len(new)} mutants survive and are not listed")
    if missing := len(chosen) - len(valid):
        problems.append(f"{missing} of {len(chosen)} mutants have not been tried as they are now")
    known = {mutant.id for mutant in chosen}
    for entry in entries.values():
        if entry.id not in known:
            problems.append(f"{entry.file}: {entry.id} is listed, but is not in the sample")
        elif not entry.reason:
            problems.append(f"{entry.file}: {entry.id} is listed without a reason")
    return valid, problems, new
