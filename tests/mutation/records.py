"""What is written down: results, the list of survivors, the gate, how many verdicts are stale."""

import json
import tomllib
from collections import Counter, defaultdict
from collections.abc import Iterable, Sequence
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Final

from tests.mutation.mutants import (
    KEPT,
    QUOTAS,
    Mutant,
    digest_of_test,
    folder,
    layout_of,
)

UNKNOWN: Final = "?"
"""What killed a mutant before verdicts had the name of a test; a time-out has none either."""
UNREACHED: Final = "unreached"
"""The verdict of a mutant to which no test of the map gets: nothing has been tried."""
ALIVE: Final = ("survived", UNREACHED)
SLACK: Final = 10
"""A room may have a part of so many of its quota stale beyond what is listed."""


@dataclass(frozen=True, slots=True)
class Result:
    """What became of a mutant.

    Attributes:
        id: the mutant.
        digest: of the code of its scope when it was tried, or how it begins.
        verdict: "killed", "survived" or "timeout"; "unreached" if there is no test for it.
        by: the test that failed.
        tests: how many tests were chosen.
        cpu: seconds of processor time, all its processes together.
        proof: digest of the function of the test that failed.
        file: of the mutant; "" of a result that was not read from the list that is checked in.
        scope: of the mutant, likewise.
    """

    id: str
    digest: str
    verdict: str
    by: str
    tests: int
    cpu: float
    proof: str = ""
    file: str = ""
    scope: str = ""

    def holds(self, mutant: Mutant, root: Path) -> bool:
        """Tell whether the mutant's scope, and the test that killed it, are as they were."""
        return mutant.digest.startswith(self.digest) and self.proved(root)

    def proved(self, root: Path) -> bool:
        """Tell whether the test that killed the mutant is as it was, as far as it is known."""
        return not self.proof or digest_of_test(root, self.by) == self.proof


def read_kept(path: Path) -> dict[str, Result]:
    """Return the verdicts of the list that is checked in."""
    found: dict[str, Result] = {}
    file = scope = digest = ""
    for line in path.read_text().splitlines() if path.exists() else ():
        if line.startswith(" "):
            name, verdict, proof, by = (*line.split(maxsplit=3), "", "")[:4]
            by = "" if by == UNKNOWN else by
            proof = "" if proof == UNKNOWN else proof
            found[name] = Result(name, digest, verdict, by, 0, 0.0, proof, file, scope)
        elif not line.startswith("#"):
            file, digest, scope = (*line.split(), "")[:3]
    return found


def keep(path: Path, results: Iterable[tuple[Mutant, Result]]) -> None:
    """Write the list that is checked in."""
    groups: dict[str, list[str]] = defaultdict(list)
    for mutant, row in results:
        ended = f" {row.proof or UNKNOWN} {row.by or UNKNOWN}" if row.verdict == "killed" else ""
        scope = f"{mutant.file} {row.digest[:KEPT]} {mutant.scope}".rstrip()
        groups[scope].append(f"  {row.id} {row.verdict}{ended}")
    lines = ["# Made by `run.py keep`. Of each scope: file, digest, name. Of each mutant: verdict,",
             "# digest of the test that killed it, and which that is."]  # fmt: skip
    for scope, rows in sorted(groups.items()):
        lines += [scope, *sorted(rows)]
    path.write_text("\n".join([*lines, ""]))


def stale(root: Path, kept: Iterable[Result]) -> dict[str, str]:
    """Return which verdicts of the list are no longer of the code or of the test as it is, and why.

    It reads no more than where functions begin and end: seconds, for all files.
    """
    found = {}
    for row in kept:
        path = root / row.file
        scopes = layout_of(path).scopes if path.is_file() else []
        if not any(it.name == row.scope and it.digest.startswith(row.digest) for it in scopes):
            found[row.id] = f"{row.file}: {row.scope} has changed"
        elif not row.proved(root):
            found[row.id] = f"{row.file}: {row.scope}: the test has changed: {row.by}"
    return found


def read_budget(path: Path) -> dict[str, int]:
    """Return how many mutants of each room may be without a verdict."""
    return tomllib.loads(path.read_text())["stale"] if path.exists() else {}


def write_budget(path: Path, now: dict[str, int]) -> None:
    """Write how many mutants of each room are without a verdict; never more than there were."""
    old = read_budget(path)
    rows = [f'"{name}" = {least}' for name, count in now.items()
            if (least := min(count, old.get(name, 0 if old else count)))]  # fmt: skip
    path.write_text("\n".join(["# Made by `run.py keep`: mutants of each room without a verdict of "
                               "the code as it is.", "[stale]", *rows, ""]))  # fmt: skip


def without_verdict(kept: Iterable[Result], gone: Iterable[str]) -> dict[str, int]:
    """Return how many mutants of each room have no verdict of the code and tests as they are."""
    missing = set(gone)
    there = Counter(folder(row.file) for row in kept if row.id not in missing)
    return {name: max(0, quota - there[name]) for name, quota in QUOTAS.items()}


def over_budget(now: dict[str, int], budget: dict[str, int]) -> list[str]:
    """Return the rooms that have more mutants without a verdict than they may."""
    return [
        f"{name}: {count} of {QUOTAS[name]} mutants have no verdict of the code as it is,"
        f" {most} may be"
        for name, count in now.items()
        if count > (most := budget.get(name, 0) + QUOTAS[name] // SLACK)
    ]


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
    killed = [result.verdict not in ALIVE for result in results]
    return sum(killed) / len(killed) if killed else 1.0


def judge(
    root: Path, chosen: Sequence[Mutant], results: dict[str, Result], listed: Iterable[Entry]
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
        if result is None or not result.holds(mutant, root):
            continue
        valid[mutant.id] = result
        entry = entries.get(mutant.id)
        if result.verdict in ALIVE and entry is None:
            new.append(mutant)
        elif result.verdict not in ALIVE and entry is not None:
            problems.append(
                f"{mutant.file}:{mutant.line}: {mutant.id} is listed, but {result.verdict}"
            )
    if new:
        unreached = sum(valid[it.id].verdict == UNREACHED for it in new)
        if unreached:
            problems.append(f"no test of the map gets to {unreached} mutants")
        if len(new) > unreached:
            problems.append(f"{len(new) - unreached} mutants survive and are not listed")
    if missing := len(chosen) - len(valid):
        problems.append(f"{missing} of {len(chosen)} mutants have not been tried as they are now")
    known = {mutant.id for mutant in chosen}
    for entry in entries.values():
        if entry.id not in known:
            problems.append(f"{entry.file}: {entry.id} is listed, but is not in the sample")
        elif not entry.reason:
            problems.append(f"{entry.file}: {entry.id} is listed without a reason")
    return valid, problems, new
