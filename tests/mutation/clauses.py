"""Does a clause's own test notice that the clause is broken?

A clause's code is what names the clause: a function whose docstring does, a statement with a
comment that does, the row of a table, the functions whose names stand in that row, and statements
that use a rule made of it. Each mutant there belongs to the clauses of the smallest such place, and
is tried with the tests that ``proofs.toml`` names for them, and no others.
"""

import ast
import io
import json
import re
import tokenize
from collections import defaultdict
from collections.abc import Iterable, Iterator, Sequence
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any, Final

from tests.mutation.breaks import BREAKS
from tests.mutation.mutants import (
    DOUBTFUL,
    KEPT,
    Mutant,
    digest,
    digest_of_test,
    folder,
    mutants,
    mutated,
    one_per_site,
)
from vbus.chips.clauses import clauses_of, proofs_of

ID: Final = re.compile(
    r"\b(LM|MCP|PMD)-([A-Z]+)-(\d+)"
    r"((?:(?:,| and| to) (?:\1-\2)?-?\d+(?=[\s,.:;)]*(?:$|[,.:;)]| and| to)))*)"
)
"""A clause; "PMD-CMD-72, -73" names two, and "MCP-OUT-1 to 3, 9" four."""

HOMES: Final = ("lm628", "mc1241a", "mcp1200")
SHARED: Final = "vbus/chips/motion"
LOOKS: Final = ("inner_registers.py", "compatible.py")
"""Files of a chip that show or compare what it does."""

RANDOM: Final = (
    "tests/reference/test_lm628.py::test_chip_and_reference_agree",
    "tests/reference/test_mc1241a.py::test_random_hosts_get_the_same_from_chip_and_model",
    "tests/reference/test_mcp1200.py::test_chip_and_model_agree",
)
"""Random hosts against a model: what fails there names fifty clauses, and so proves none."""
APART: Final = ("tests/e2e/", "tests/properties/", "tests/unit/testing/")
"""Tests of whole systems, in processes that do not see a mutant, or of any host whatever."""

WORDS: Final = ("clause", "title", "unit")
"""Fields of a row that name no function."""

EACH: Final = 2
"""Mutants tried for a clause, as far as its code has so many places."""


@dataclass(frozen=True, slots=True)
class Place:
    """Lines that belong to clauses.

    Attributes:
        clauses: what is named there.
        first: line.
        last: line.
        whole: of a class: what none of its functions names belongs to it.
    """

    clauses: frozenset[str]
    first: int
    last: int
    whole: bool = False


@dataclass(frozen=True, slots=True)
class Break:
    """A mutant and the clauses whose tests are asked.

    Attributes:
        mutant: the change.
        clauses: in the order of their names.
    """

    mutant: Mutant
    clauses: tuple[str, ...]

    @property
    def own(self) -> bool:
        """Whether it is made by an operator of :mod:`tests.mutation.breaks`."""
        return self.mutant.operator in BREAKS


@dataclass(frozen=True, slots=True)
class Answer:
    """What the tests of the clauses said of a mutant.

    Attributes:
        id: the mutant.
        digest: of its scope and of the tests that were asked.
        verdict: "killed", "survived" or "timeout".
        noticed: the clauses one of whose tests failed.
        by: what failed first; if no test of the clauses did, a test of another clause.
    """

    id: str
    digest: str
    verdict: str
    noticed: Sequence[str]
    by: str


def block(it: Break) -> str:
    """Return the family and block of the first clause: LM-CMD of LM-CMD-15."""
    return it.clauses[0].rpartition("-")[0]


def named(text: str) -> set[str]:
    """Return the clauses that a text names."""
    found = set()
    for family, block, number, others in ID.findall(text):
        numbers = [int(number)]
        for between, last in re.findall(r"(,| and| to) (?:[A-Z]+-[A-Z]+)?-?(\d+)", others):
            first = numbers[-1] + 1 if between == " to" else int(last)
            numbers += range(first, int(last) + 1)
        found |= {f"{family}-{block}-{it}" for it in numbers}
    return found


# -- tests ----------------------------------------------------------------------------------------


def own_tests() -> dict[str, tuple[str, ...]]:
    """Return the tests of each clause that are asked."""
    found = {}
    for home in HOMES:
        package = f"vbus.chips.{home}"
        proofs = proofs_of(package)
        for name, clause in clauses_of(package).items():
            if clause.tested:
                found[name] = tuple(
                    test for test in proofs.get(name, ())
                    if test not in RANDOM and not test.startswith(APART)
                )  # fmt: skip
    return found


def proves(proof: str, failed: str) -> bool:
    """Tell whether a test that failed is one that ``proofs.toml`` names, or a case of it."""
    function, _, case = proof.partition("[")
    name, _, cases = failed.partition("[")
    return function == name and case.rstrip("]") in cases


# -- code -----------------------------------------------------------------------------------------


def breaks(root: Path, each: int = EACH) -> list[Break]:
    """Return the mutants to be tried: for each clause some, those of our own operators first."""
    candidates: dict[str, list[tuple[tuple[Any, ...], Mutant]]] = defaultdict(list)
    owners: dict[str, frozenset[str]] = {}
    for home in HOMES:
        for file, places in _places(root, home).items():
            for mutant in one_per_site(mutants(root, file, breaks=True)):
                place = _smallest(places, mutant.line)
                if place is None or mutant.id in owners:
                    continue
                owners[mutant.id] = place.clauses
                order = (place.whole, not mutant.runs, mutant.rank)
                for clause in place.clauses:
                    candidates[clause].append((order, mutant))
    chosen: dict[str, Mutant] = {}
    tests = own_tests()
    for clause in sorted(candidates.keys() & tests.keys()):
        for mutant in _some(root, [it for _, it in sorted(candidates[clause], key=_first)], each):
            chosen[mutant.id] = mutant
    return [
        Break(mutant, tuple(sorted(owners[mutant.id] & tests.keys())))
        for mutant in sorted(chosen.values(), key=lambda it: it.rank)
    ]


def _first(pair: tuple[tuple[Any, ...], Mutant]) -> tuple[Any, ...]:
    return pair[0]


def _some(root: Path, found: Sequence[Mutant], each: int) -> list[Mutant]:
    """Take our own operators and those of the library in turn."""
    own = [it for it in found if it.operator in BREAKS]
    other = [it for it in found if it.operator not in BREAKS]
    mixed = [it for pair in zip(own, other, strict=False) for it in pair]
    mixed += [*own[len(other) :], *other[len(own) :]]
    chosen: list[Mutant] = []
    for mutant in mixed:
        if len(chosen) == each:
            break
        if not mutant.operator.startswith(DOUBTFUL) or mutated(root, mutant):
            chosen.append(mutant)
    return chosen


def _smallest(places: Sequence[Place], line: int) -> Place | None:
    """Return the smallest place a line is in; of several that are alike, all clauses."""
    there = [it for it in places if it.first <= line <= it.last]
    if not there:
        return None
    size = min((it.whole, it.last - it.first) for it in there)
    same = [it for it in there if (it.whole, it.last - it.first) == size]
    return Place(frozenset().union(*(it.clauses for it in same)), line, line, size[0])


def _files(root: Path, home: str) -> list[str]:
    paths = sorted((root / "vbus/chips" / home).glob("*.py")) + sorted((root / SHARED).glob("*.py"))
    names = [path.relative_to(root).as_posix() for path in paths]
    return [it for it in names if folder(it).startswith("vbus/chips") and not it.endswith(LOOKS)]


def _places(root: Path, home: str) -> dict[str, list[Place]]:
    """Return the places of each file of a family."""
    known = clauses_of(f"vbus.chips.{home}").keys()
    sources = {file: (root / file).read_text() for file in _files(root, home)}
    trees = {file: ast.parse(source) for file, source in sources.items()}
    found: dict[str, list[Place]] = {}
    called: dict[str, set[str]] = defaultdict(set)  # names in rows, and the rows' clauses
    rules: dict[str, set[str]] = defaultdict(set)  # what is made of rows
    for file, tree in trees.items():
        found[file] = [
            *_of_docstrings(tree, known), *_of_comments(sources[file], tree, known),
            *_of_rows(tree, known, called, rules),
        ]  # fmt: skip
    for file, tree in trees.items():
        found[file] += _of_names(tree, called, rules)
    return {file: places for file, places in found.items() if places}


def _of_docstrings(tree: ast.Module, known: Iterable[str]) -> Iterator[Place]:
    for node in ast.walk(tree):
        if isinstance(node, ast.FunctionDef | ast.ClassDef):
            if names := named(ast.get_docstring(node) or "") & set(known):
                whole = isinstance(node, ast.ClassDef)
                yield Place(frozenset(names), node.lineno, node.end_lineno or 0, whole)


def _of_comments(source: str, tree: ast.Module, known: Iterable[str]) -> Iterator[Place]:
    statements = [node for node in ast.walk(tree) if isinstance(node, ast.stmt)]
    lines = source.splitlines()
    for token in tokenize.generate_tokens(io.StringIO(source).readline):
        if token.type != tokenize.COMMENT or not (names := named(token.string) & set(known)):
            continue
        line = token.start[0]
        if lines[line - 1].lstrip().startswith("#"):
            later = [node for node in statements if node.lineno > line]
            node = min(later, key=lambda it: it.lineno, default=None)
        else:
            inside = [it for it in statements if it.lineno <= line <= (it.end_lineno or 0)]
            node = min(inside, key=lambda it: (it.end_lineno or 0) - it.lineno, default=None)
            # A line of a table, or of a condition of several lines.
            if node is not None and (isinstance(node, ast.Assign | ast.AnnAssign)
                                     and (node.end_lineno or 0) - node.lineno > 3):  # fmt: skip
                yield Place(frozenset(names), line, line)
                continue
        if node is not None:
            yield Place(frozenset(names), node.lineno, node.end_lineno or 0)


def _of_rows(
    tree: ast.Module, known: Iterable[str], called: dict[str, set[str]], rules: dict[str, set[str]]
) -> Iterator[Place]:
    """Give rows that name clauses; note the names in them, and the names they get."""
    docstrings = {id(node.body[0].value) for node in ast.walk(tree)
                  if isinstance(node, ast.Module | ast.ClassDef | ast.FunctionDef)
                  and node.body and isinstance(node.body[0], ast.Expr)}  # fmt: skip
    for statement in tree.body:
        rows = [node for node in ast.walk(statement) if isinstance(node, ast.Call | ast.Tuple)]
        for text in ast.walk(statement):
            if not isinstance(text, ast.Constant) or not isinstance(text.value, str):
                continue
            names = named(text.value) & set(known)
            if not names or id(text) in docstrings:
                continue
            around = [it for it in rows if _within(text, it)]
            row = min(around, key=lambda it: _size(it), default=text)
            yield Place(frozenset(names), row.lineno, row.end_lineno or 0)
            for name in _calls(row):
                called[name] |= names
            if isinstance(statement, ast.Assign | ast.AnnAssign) and statement.value is row:
                target = statement.targets[0] if isinstance(statement, ast.Assign) else (
                    statement.target)  # fmt: skip
                if isinstance(target, ast.Name):
                    rules[target.id] |= names


def _calls(row: ast.expr) -> Iterator[str]:
    """Return what may be a function's name: a unit or an option's kind is another word."""
    for part in ast.walk(row):
        if isinstance(part, ast.keyword) and part.arg not in WORDS:
            for text in ast.walk(part.value):
                if isinstance(text, ast.Constant) and isinstance(text.value, str):
                    yield text.value.rpartition(".")[2]


def _within(inner: ast.expr, outer: ast.expr) -> bool:
    begin, end = (inner.lineno, inner.col_offset), (inner.end_lineno, inner.end_col_offset)
    return (outer.lineno, outer.col_offset) <= begin and end <= (  # type: ignore[operator]
        outer.end_lineno, outer.end_col_offset)  # fmt: skip


def _size(node: ast.expr) -> tuple[int, int]:
    return (node.end_lineno or 0) - node.lineno, (node.end_col_offset or 0) - node.col_offset


def _of_names(
    tree: ast.Module, called: dict[str, set[str]], rules: dict[str, set[str]]
) -> Iterator[Place]:
    """Give the functions whose names stand in rows, and the statements that use a rule."""
    for node in ast.walk(tree):
        if isinstance(node, ast.FunctionDef):
            if names := called.get(node.name):
                yield Place(frozenset(names), node.lineno, node.end_lineno or 0)
            for inner in ast.walk(node):
                if isinstance(inner, ast.Expr | ast.Assign | ast.AugAssign | ast.Return):
                    used = {it.attr for it in ast.walk(inner) if isinstance(it, ast.Attribute)}
                    if names := set().union(*(rules[it] for it in used & rules.keys())):
                        yield Place(frozenset(names), inner.lineno, inner.end_lineno or 0)


# -- answers --------------------------------------------------------------------------------------


def digest_of(root: Path, it: Break, tests: dict[str, tuple[str, ...]]) -> str:
    """Hash what an answer depends on: the mutant's scope, and the functions that are asked."""
    asked = sorted({test for clause in it.clauses for test in tests[clause]})
    return digest(it.mutant.digest, *(digest_of_test(root, test) for test in asked))[:KEPT]


def read_answers(path: Path) -> dict[str, Answer]:
    """Return the last answer for each mutant."""
    if not path.exists():
        return {}
    rows = (Answer(**json.loads(line)) for line in path.read_text().splitlines())
    return {row.id: row for row in rows}


def append(path: Path, answer: Answer) -> None:
    """Add an answer; several processes may do so."""
    path.parent.mkdir(parents=True, exist_ok=True)
    with path.open("a") as file:
        file.write(json.dumps(asdict(answer)) + "\n")


def silent(found: Iterable[Break], answers: dict[str, Answer]) -> dict[str, list[Break]]:
    """Return the clauses that notice none of their mutants, with those mutants."""
    tried: dict[str, list[Break]] = defaultdict(list)
    heard: set[str] = set()
    for it in found:
        heard.update(answers[it.mutant.id].noticed)
        for clause in it.clauses:
            tried[clause].append(it)
    return {name: those for name, those in sorted(tried.items()) if name not in heard}
