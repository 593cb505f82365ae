"""Which mutants there are, how each is named, and which of them make the sample.

The operators are those of cosmic-ray. A *site* is a place in the source where operators of one
kind apply. A mutant is named by what stands at its site, not by line numbers, so that an edit
elsewhere neither renames it nor changes whether it is in the sample.
"""

import ast
import hashlib
import warnings
from collections import Counter, defaultdict
from collections.abc import Iterable, Iterator
from dataclasses import dataclass
from functools import cache
from pathlib import Path
from typing import Any, Final

from cosmic_ray.ast import ast_nodes, get_ast
from cosmic_ray.mutating import mutate_code
from cosmic_ray.operators.keyword_replacer import KeywordReplacementOperator
from cosmic_ray.plugins import get_operator, operator_names
from parso.python.tree import Keyword, Number
from parso.python.tree import Operator as Sign
from parso.tree import BaseNode

from tests.mutation.breaks import BREAKS
from tests.mutation.unobservable import same_by_construction, unobservable

# Of 3,000. What is left over where a folder has fewer sites is not made up for. Of vbus/cli the
# rest are programs: tests start them, in processes that do not see a mutant.
QUOTAS: Final = {
    "vbus/chips/lm628": 300,
    "vbus/chips/mcp1200": 420,
    "vbus/chips/mc1241a": 360,
    "vbus/chips/motion": 90,
    "vbus/chips": 30,  # base, registers, strobes, tables
    "vbus/plant": 90,
    "vbus/protocols": 100,
    "vbus/board": 170,
    "vbus/views": 190,
    "vbus/nodes": 90,
    "vbus/faults": 80,
    "vbus/core/signals": 40,
    "vbus/core/kernel": 40,
    "vbus/core": 60,  # values, state, and what else is not signals or kernel
    "vbus/boardfile": 40,
    "vbus/campaign": 60,
    "vbus/circuit": 70,
    "vbus/cli/generate": 40,
    "vbus/cli/look": 50,
    "vbus/client": 60,
    "vbus/cpu": 110,
    "vbus/events": 40,
    "vbus/glue": 75,
    "vbus/network": 20,
    "vbus/record": 85,
    "vbus/serve": 150,
    "vbus/testing": 100,
    "vbus/transports": 40,
}
SAMPLE: Final = sum(QUOTAS.values())

FORGOTTEN: Final = 5
"""One mutant of so many is a statement that is not carried out: more would leave too few of the
other twenty operators in a folder of 40."""

KEPT: Final = 12
"""Digits of a digest in the lists that are checked in."""

DOUBTFUL: Final = (
    *(f"ReplaceBinaryOperator_{name}_" for name in ("Mul", "Pow", "Div")), "ExceptionReplacer",
)  # fmt: skip
"""Signs stand in lists of parameters as well, where no other operator may; an exception may be that
of a module."""

WITH_ARGUMENTS: Final = ("VariableReplacer", "VariableInserter")


@dataclass(frozen=True, slots=True)
class Mutant:
    """One change of one file.

    Attributes:
        id: names it, as long as its line and scope stay as they are.
        file: path from the root of the checkout.
        scope: function, or class and name, or name whose value is changed.
        line: where it is now.
        statement: first and last line of what it is part of; of an ``if``, the condition.
        runs: whether it is in a function, so that only a call gets there.
        operator: name in cosmic-ray.
        occurrence: number of the place among all where this operator applies in the file.
        rank: the lower, the sooner it is in a sample.
        digest: of the code of its scope, without comments and docstrings.
    """

    id: str
    file: str
    scope: str
    line: int
    statement: tuple[int, int]
    runs: bool
    operator: str
    occurrence: int
    rank: str
    digest: str


@dataclass(frozen=True, slots=True)
class Scope:
    """A function, or a statement outside of all functions."""

    name: str
    first: int
    last: int
    runs: bool
    digest: str


def digest(*parts: object) -> str:
    """Hash texts and numbers."""
    return hashlib.sha256("\0".join(map(str, parts)).encode()).hexdigest()


def shape(part: Any) -> Any:
    """Return what a piece of code is, without its layout, comments and docstrings.

    ``ast.dump`` names empty fields in some versions of Python; here none is named.
    """
    if isinstance(part, ast.AST):
        fields = ((name, shape(value)) for name, value in ast.iter_fields(part))
        return (type(part).__name__, *(it for it in fields if it[1] not in (None, [])))
    return [shape(it) for it in part if not _is_text(it)] if isinstance(part, list) else part


def _is_text(part: object) -> bool:
    """Whether a statement is a docstring, of whatever is before it."""
    match part:
        case ast.Expr(ast.Constant(str())):
            return True
    return False


class Layout:
    """Lines of a file: which scope and statement each belongs to, and its key.

    Attributes:
        keys: of each line, from index 1: names the line as long as it stays in its scope as it is.
    """

    def __init__(self, source: str) -> None:
        self.lines = ["", *source.splitlines()]
        tree = ast.parse(source)
        whole = digest(shape(tree))
        self.scopes: list[Scope] = [Scope("", 1, len(self.lines) - 1, False, whole)]
        self.statements: list[tuple[int, int]] = []
        self._read(tree.body, "", False)
        seen: Counter[tuple[str, str]] = Counter()
        self.keys: list[str] = []
        for number, text in enumerate(self.lines):
            where = (self.scope(number).name, text.strip())
            self.keys.append(digest(*where, seen[where])[:12])
            seen[where] += 1

    def scope(self, line: int) -> Scope:
        """Return the innermost scope of a line."""
        found = [scope for scope in self.scopes if scope.first <= line <= scope.last]
        return min(found or self.scopes[:1], key=lambda it: (it.last - it.first, not it.runs))

    def statement(self, line: int) -> tuple[int, int]:
        """Return the first and last line of the innermost statement, without its body."""
        found = [span for span in self.statements if span[0] <= line <= span[1]]
        return min(found, key=lambda span: span[1] - span[0], default=(line, line))

    def _read(self, body: Iterable[ast.stmt], outer: str, runs: bool) -> None:
        for node in body:
            first = min([node.lineno, *(d.lineno for d in getattr(node, "decorator_list", ()))])
            last = node.end_lineno or node.lineno
            inner = [part for field in ("body", "handlers", "orelse", "finalbody", "cases")
                     for part in getattr(node, field, ())]  # fmt: skip
            begin = _line(inner[0]) if inner else last + 1
            self.statements.append((first, max(begin - 1, node.lineno)))
            name = _name(node)
            function = isinstance(node, ast.FunctionDef | ast.AsyncFunctionDef)
            if name and not runs:
                name = f"{outer}.{name}" if outer else name
                code = digest(shape(node))
                self.scopes.append(Scope(name, first, last, False, code))
                if function:  # its decorators and defaults are evaluated before any call
                    self.scopes.append(Scope(name, begin, last, True, code))
            where = name if name and not runs and hasattr(node, "decorator_list") else outer
            self._read((part for part in inner if isinstance(part, ast.stmt)), where,
                       runs or function)  # fmt: skip
            for part in inner:
                if not isinstance(part, ast.stmt):
                    self._read(part.body, outer, runs)


@cache
def layout_of(path: Path) -> Layout:
    """Return the layout of a file, read once."""
    return Layout(path.read_text())


def _line(part: ast.AST) -> int:
    return part.pattern.lineno if isinstance(part, ast.match_case) else part.lineno  # type: ignore[attr-defined]


def _name(node: ast.stmt) -> str:
    match node:
        case ast.FunctionDef() | ast.AsyncFunctionDef() | ast.ClassDef():
            return node.name
        case ast.AnnAssign(target=ast.Name(name)) | ast.Assign(targets=[ast.Name(name), *_]):
            return name
    return ""


@cache
def _operators(breaks: bool = False) -> dict[str, list[tuple[str, Any]]]:
    """Return the operators by the kind of node they may apply to; with ``breaks`` ours as well."""
    kinds = defaultdict(list)
    if breaks:
        for name, own in BREAKS.items():
            kinds["node"].append((name, own()))
        kinds["number"].append(("Narrow", BREAKS["Narrow"]()))
    for full in operator_names():
        name = full.partition("/")[2]
        if name in WITH_ARGUMENTS or same_by_construction(name):
            continue
        operator = get_operator(full)
        if name.startswith("ReplaceBinaryOperator"):
            kind = operator.examples()[0].pre_mutation_code.split()[1]
        elif name == "NumberReplacer":
            kind = "number"
        elif issubclass(operator, KeywordReplacementOperator):
            kind = operator.from_keyword
        else:
            kind = "node"
        kinds[kind].append((name, operator()))
    return kinds


def _kind(node: Any) -> str:
    if isinstance(node, Sign | Keyword):
        return node.value
    if isinstance(node, Number):
        return "number"
    return "node" if isinstance(node, BaseNode) else ""


def digest_of_test(root: Path, test: str) -> str:
    """Hash the function of a test; "" if it is there no more."""
    file, _, name = test.partition("[")[0].partition("::")
    if not (root / file).is_file():
        return ""
    scopes = layout_of(root / file).scopes
    return "".join(it.digest for it in scopes if it.name == name.replace("::", "."))[:KEPT]


def mutants(root: Path, file: str, breaks: bool = False) -> list[Mutant]:
    """Return every mutant of a file; with ``breaks`` those of our own operators as well."""
    source = (root / file).read_text()
    layout = Layout(source)
    hidden = unobservable(source)
    found: list[Mutant] = []
    counts: Counter[str] = Counter()
    texts: dict[int, str] = {}
    for node in ast_nodes(get_ast(source)):
        for name, operator in _operators(breaks).get(_kind(node), ()):
            for index, (begin, end) in enumerate(operator.mutation_positions(node)):
                occurrence = counts[name]
                counts[name] += 1
                if name == "RemoveDecorator":  # begins with its @, ends with the line
                    begin, end = (begin[0], begin[1] + 1), (begin[0], begin[1] + 2)
                if any(a <= begin and end <= b for a, b in hidden):
                    continue
                line = begin[0]
                scope = layout.scope(line)
                texts.setdefault(line, layout.lines[line].strip())
                column = begin[1] - layout.lines[line].index(texts[line])
                site = digest(file, layout.keys[line], column, name.partition("_")[0])
                own = digest(site, name, index)
                found.append(
                    Mutant(own[:10], file, scope.name, line, layout.statement(line), scope.runs,
                           name, occurrence, f"{site}/{own}", scope.digest)
                )  # fmt: skip
    return found


def one_per_site(found: Iterable[Mutant]) -> list[Mutant]:
    """Keep the mutants of the lowest rank of each site, in order of rank."""
    best: dict[str, Mutant] = {}
    for mutant in sorted(found, key=lambda mutant: mutant.rank):
        best.setdefault(mutant.rank.partition("/")[0], mutant)
    return list(best.values())


def mutated(root: Path, mutant: Mutant) -> str:
    """Return the source of the mutant's file with the change made; empty if it cannot be made."""
    source = (root / mutant.file).read_text()
    try:
        operator = BREAKS.get(mutant.operator) or get_operator(f"core/{mutant.operator}")
        changed = mutate_code(source, operator(), mutant.occurrence)
    except AttributeError:  # the exception of a module, which the operator takes for a plain name
        return ""
    assert changed is not None, mutant
    return changed if _compiles(changed) else ""


def _compiles(source: str) -> bool:
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        try:
            compile(source, "mutant", "exec")
        except SyntaxError:
            return False
    return True


def difference(root: Path, mutant: Mutant) -> tuple[str, str]:
    """Return the changed line before and after."""
    old = (root / mutant.file).read_text().splitlines()
    new = mutated(root, mutant).splitlines()
    at = next(i for i, (a, b) in enumerate(zip(old, new, strict=False)) if a != b)
    return old[at].strip(), new[at].strip()


ROLES: Final = {
    "packets": "vbus/views", "coverage": "vbus/views", "upsets": "vbus/faults",
    "calls": "", "host": "", "demo": "", "generated": "",
}  # fmt: skip
"""What files of a chip's folder count for that are not its behaviour; clients are not mutated."""


def folder(file: str) -> str:
    """Return the quota a file counts for; "" if it is not mutated."""
    parts = file.removesuffix(".py").split("/")
    if parts[:2] == ["vbus", "chips"] and len(parts) > 3 and parts[3] in ROLES:
        return ROLES[parts[3]]
    return max((name for name in QUOTAS if file.startswith(f"{name}/")), key=len, default="")


def files(root: Path, package: str = "vbus") -> Iterator[str]:
    """Give the files that are mutated."""
    for path in sorted((root / package).rglob("*.py")):
        file = path.relative_to(root).as_posix()
        if package != "vbus" or folder(file):
            yield file


def sample(root: Path, size: int, seed: str, only: tuple[str, ...] = ("",)) -> list[Mutant]:
    """Return mutants in the shares of ``QUOTAS``, of all folders in which a file is wanted."""
    by_folder: dict[str, list[str]] = {}
    for file in files(root):
        by_folder.setdefault(folder(file), []).append(file)
    return [
        mutant
        for name, inside in by_folder.items()
        if any(file.startswith(only) for file in inside)
        for mutant in first(root, inside, size * QUOTAS[name] // SAMPLE, seed)
    ]


def first(root: Path, inside: Iterable[str], size: int, seed: str) -> list[Mutant]:
    """Return the first mutants of some files; one of ``FORGOTTEN`` is a statement left out."""
    sites = one_per_site(
        mutant for file in inside for mutant in mutants(root, file, breaks=True)
        if mutant.operator == "Forget" or mutant.operator not in BREAKS
    )  # fmt: skip
    if seed:
        sites.sort(key=lambda mutant: digest(seed, mutant.rank))
    forgotten = [it for it in sites if it.operator == "Forget"][: size // FORGOTTEN]
    chosen = []
    for mutant in sites:
        if len(chosen) + len(forgotten) == size:
            break
        if mutant.operator != "Forget" and (
            not mutant.operator.startswith(DOUBTFUL) or mutated(root, mutant)
        ):
            chosen.append(mutant)
    return forgotten + chosen
