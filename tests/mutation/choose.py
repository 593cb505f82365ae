"""Which tests a mutant is tried with, in which order."""

import ast
import math
import re
from collections import Counter
from functools import cache
from pathlib import Path
from typing import Final

from tests.mutation.cover import Map, Measured
from tests.mutation.mutants import Layout, Mutant

OVERHEAD: Final = 0.02
"""Seconds of a test beside what is measured."""
WORD: Final = re.compile(r"[A-Za-z_]\w+|0x[0-9A-Fa-f]{2,}")


def choose(root: Path, found: Map, mutant: Mutant, seconds: float) -> list[str]:
    """Return the tests of one mutant, the cheapest and most specific first, up to a time."""
    layout = Layout((root / mutant.file).read_text())
    first, last = mutant.statement
    covering = _covering(found, mutant.file, layout, range(first, last + 1))
    weights: dict[str, float]
    names = _made_at_import(layout, mutant)
    if not names:
        if not covering:
            # A fixture of a whole module is seen with the first test only.
            scope = layout.scope(mutant.line)
            covering = _covering(found, mutant.file, layout, range(scope.first, scope.last + 1))
        weights = {name: _share(found.tests[name], mutant.file) for name in covering}
    else:
        weights = _by_words(root, found, mutant, layout, names) | dict.fromkeys(covering, 1.0)
    return _in_order(found, weights, seconds)


def _covering(found: Map, file: str, layout: Layout, lines: range) -> list[str]:
    mask = found.mask(file, (layout.keys[line] for line in lines))
    return [name for name, test in found.tests.items() if test.lines.get(file, 0) & mask]


def _share(test: Measured, file: str) -> float:
    return test.lines[file].bit_count() / sum(mask.bit_count() for mask in test.lines.values())


def _in_order(found: Map, weights: dict[str, float], seconds: float) -> list[str]:
    def cost(name: str) -> float:
        return (OVERHEAD + found.tests[name].seconds) / weights[name]

    # The more cases of a test have been chosen, the later come its others.
    place: Counter[str] = Counter()
    costs = {}
    for name in sorted(weights, key=cost):
        function = name.partition("[")[0]
        place[function] += 1
        costs[name] = cost(name) * place[function]
    chosen = []
    for name in sorted(weights, key=costs.__getitem__):
        if found.tests[name].seconds <= seconds:
            seconds -= found.tests[name].seconds
            chosen.append(name)
    return chosen


# -- values outside of functions ------------------------------------------------------------------


def _made_at_import(layout: Layout, mutant: Mutant) -> set[str]:
    """Return the names of what a mutant changes before any test; none if a test has to call it.

    What a private name stands for is seen through what is made of it.
    """
    if mutant.runs:
        found = _made_with(layout, rf"(?<!def )\b{re.escape(mutant.scope)}\(")
    else:
        found = {mutant.scope.rpartition(".")[2]}
    todo = [*found]
    for name in todo:
        if name.startswith("_"):
            made = _made_with(layout, rf"\b{re.escape(name)}\b") - found
            found |= made
            todo += made
    return found


def _made_with(layout: Layout, pattern: str) -> set[str]:
    """Return the names of what is made before any test of what a pattern finds."""
    found = [layout.scope(n) for n, line in enumerate(layout.lines) if re.search(pattern, line)]
    return {scope.name.rpartition(".")[2] for scope in found if not scope.runs}


def _row(layout: Layout, line: int) -> str:
    """Return the row of a table that a line is part of, or the line."""
    first = last = line
    for node in ast.walk(ast.parse("\n".join(layout.lines[1:]))):
        if isinstance(node, ast.Assign | ast.AnnAssign) and node.value is not None:
            for part in ast.iter_child_nodes(node.value):
                if isinstance(part, ast.expr) and part.lineno <= line <= (part.end_lineno or 0):
                    first, last = min(first, part.lineno), max(last, part.end_lineno or 0)
    return "\n".join(layout.lines[first : last + 1])


def _by_words(
    root: Path, found: Map, mutant: Mutant, layout: Layout, names: set[str]
) -> dict[str, float]:
    """Weigh tests for a table or constant that is there before any test.

    Those that name it, execute a line where its name stands, or anything in its folder, are tried;
    the more they name of what stands in the mutated row, the sooner.
    """
    words = {*WORD.findall(_row(layout, mutant.line)), *names}
    rarity = _rarity(root, tuple(sorted({test.partition("::")[0] for test in found.tests})))
    masks = [
        (file, found.mask(file, (using.keys[line] for line in lines)))
        for name in names
        for file, (using, lines) in _users(root, mutant.file.partition("/")[0], name).items()
    ]
    folder = mutant.file.rpartition("/")[0]
    package = folder.replace("/", ".")
    weights = {}
    for test, measured in found.tests.items():
        case = words & frozenset(WORD.findall(test.partition("[")[2]))
        named = words & _words(root, test) | case
        weight = 0.0
        if any(measured.lines.get(file, 0) & mask for file, mask in masks):
            weight = 0.5
        elif names & named and package in _text(root / test.partition("::")[0]):
            weight = 0.2
        elif mutant.file in measured.lines:
            weight = 0.1
        elif any(file.startswith(folder) for file in measured.lines):
            weight = 0.05
        if weight:
            # The list of a function's cases stands in each: what this one is for counts twice.
            weights[test] = weight + sum(rarity[word] for word in (*named, *case))
    return weights


@cache
def _users(root: Path, package: str, name: str) -> dict[str, tuple[Layout, list[int]]]:
    """Return the lines of each file where a name stands."""
    pattern = re.compile(rf"\b{re.escape(name)}\b")
    users = {}
    for path in (root / package).rglob("*.py") if name else ():
        text = path.read_text()
        if pattern.search(text):
            layout = Layout(text)
            lines = [n for n, line in enumerate(layout.lines) if pattern.search(line)]
            users[path.relative_to(root).as_posix()] = layout, lines
    return users


@cache
def _text(path: Path) -> str:
    return path.read_text()


@cache
def _functions(path: Path) -> dict[str, frozenset[str]]:
    """Return the words of each function of a test file."""
    text = _text(path)
    lines = text.splitlines()
    return {
        node.name: frozenset(WORD.findall("\n".join(lines[_first(node) - 1 : node.end_lineno])))
        for node in ast.walk(ast.parse(text))
        if isinstance(node, ast.FunctionDef | ast.AsyncFunctionDef)
    }


def _first(node: ast.FunctionDef | ast.AsyncFunctionDef) -> int:
    return min([node.lineno, *(d.lineno for d in node.decorator_list)])


def _words(root: Path, test: str) -> frozenset[str]:
    file, *_, function = test.partition("[")[0].split("::")
    return _functions(root / file).get(function, frozenset())


@cache
def _rarity(root: Path, test_files: tuple[str, ...]) -> dict[str, float]:
    """Return how much a word tells: little, if many test functions have it."""
    functions = [words for file in test_files for words in _functions(root / file).values()]
    counts = Counter(word for words in functions for word in words)
    weights = {word: math.log((1 + len(functions)) / count) / 5 for word, count in counts.items()}
    return Counter(weights)  # type: ignore[return-value, arg-type]
