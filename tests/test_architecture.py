"""The architecture as a test: who imports whom, what stays pure, how long a file may be."""

import ast
import importlib
import re
from collections.abc import Iterator
from pathlib import Path

import pytest

import vbus
from tests.clauses import family, read_clauses

ROOT = Path(next(iter(vbus.__path__)))
FILES = sorted(ROOT.rglob("*.py"))


def texts(*folders: Path) -> list[Path]:
    """Return every text in these folders, those below them included."""
    suffixes = {".py", ".md", ".toml", ".c", ".h", ".txt"}
    return sorted(
        path for folder in folders for path in folder.rglob("*") if path.suffix in suffixes
    )


TEXTS = texts(ROOT, ROOT.parent / "docs", ROOT.parent / "firmware_host_examples")
LEAVES = {"bits", "errors", "options", "state"}
SIGNALS = LEAVES | {"kernel", "signals"}
BOARD = SIGNALS | {"board", "chips", "faults", "plant", "protocols", "trace"}
NODES = BOARD | {"nodes"}
NETWORK = LEAVES | {"network", "runtime"}
EDGE = NODES | {"network", "runtime", "server", "transports"}
MAY_IMPORT = {
    "bits": set(),
    "errors": set(),
    "options": set(),
    "state": {"errors", "state"},
    "kernel": LEAVES | {"kernel"},
    "signals": SIGNALS,
    "chips": SIGNALS | {"chips"},
    "plant": SIGNALS | {"plant"},
    "protocols": SIGNALS | {"protocols"},
    "board": BOARD,
    "trace": BOARD,
    "faults": BOARD,
    "nodes": NODES,
    "native": set(),
    "network": NETWORK,
    "runtime": LEAVES,
    "transports": EDGE,
    "server": EDGE | {"compiled"},
    "client": NETWORK | {"chips", "client", "kernel", "protocols"},
    "testing": EDGE | {"client", "native", "testing", "tools"},
    "tools": EDGE | {"client", "compiled", "native", "tools"},
    "__main__": {"tools"},
    "compiled": set(),
    "__init__": EDGE | {"client", "compiled"},  # all but the last for type checkers only
}
PURE = NODES
IMPURE = {"asyncio", "time", "random", "socket", "threading", "select", "os", "subprocess"}
SHARED_BY_CHIPS = {"base", "motion", "registers", "strobes", "tables"}
DATA = {"tables", "datasheet"}
LONGEST = 450
CLAUSES = read_clauses(ROOT / "chips")
CLAUSE = re.compile(
    rf"\b((?:{'|'.join(sorted({family(name) for name in CLAUSES}))})-[A-Z]+)-(\d+)"
    r"((?:(?:,| to| and|, and) -?\d+\b)*)"
)
"""A clause, and the numbers of others in its group that follow: "LM-TRJ-3, -6", "LM-BUS-1 to 3"."""
BANNED = re.compile(
    r"(?<![\w.~])/(work|root|home)/|(?i:\b(sub-?agents?|LLM|work sessions?)\b)|TODO|FIXME"
)


def imports(path: Path) -> Iterator[str]:
    """Give every module a file imports, wherever in the file it does so."""
    for node in ast.walk(ast.parse(path.read_text())):
        if isinstance(node, ast.Import):
            yield from (alias.name for alias in node.names)
        elif isinstance(node, ast.ImportFrom):
            assert node.level == 0, f"{path}: imports are absolute"
            yield from (f"{node.module}.{alias.name}" for alias in node.names)


@pytest.mark.parametrize("path", FILES, ids=lambda path: str(path.relative_to(ROOT)))
def test_a_file_keeps_to_its_layer(path: Path) -> None:
    places = [part.removesuffix(".py") for part in path.relative_to(ROOT).parts]
    mine = places[0]
    for module in imports(path):
        package, *rest = module.split(".")
        assert mine not in PURE or package not in IMPURE, f"{mine} is pure: no {module}"
        if package != "vbus" or not rest:
            continue
        assert rest[0] in MAY_IMPORT[mine], f"{mine} must not import {module}"
        if mine == rest[0] == "chips":
            assert rest[1] in SHARED_BY_CHIPS | {places[1]}, f"one chip must not know {module}"
        if mine == "client" and rest[0] == "chips":
            assert DATA & set(rest), f"a client knows a chip's tables, not {module}"


@pytest.mark.parametrize("path", FILES, ids=lambda path: str(path.relative_to(ROOT)))
def test_one_file_is_one_idea(path: Path) -> None:
    if path.stem not in DATA and "Generated from" not in path.read_text()[:500]:
        assert len(path.read_text().splitlines()) <= LONGEST


@pytest.mark.parametrize("path", TEXTS, ids=lambda path: str(path.relative_to(ROOT.parent)))
def test_the_text_speaks_of_the_product_only(path: Path) -> None:
    assert not BANNED.search(path.read_text())


def test_every_clause_that_is_named_can_be_read() -> None:
    named = {
        (f"{group}-{number}", str(path.relative_to(ROOT.parent)))
        for path in [*TEXTS, *texts(ROOT.parent / "tests")]
        for group, first, others in CLAUSE.findall(path.read_text())
        for number in (first, *re.findall(r"\d+", others))
    }
    assert len(named) > len(CLAUSES)
    assert sorted((name, path) for name, path in named if name not in CLAUSES) == []


@pytest.mark.parametrize("chip", ["lm628", "mc1241a"])
def test_every_command_has_one_method_and_every_method_a_command(chip: str) -> None:
    table = importlib.import_module(f"vbus.chips.{chip}.datasheet").COMMANDS
    methods = [
        node.name
        for path in (ROOT / "chips" / chip).glob("*.py")
        for node in ast.walk(ast.parse(path.read_text()))
        if isinstance(node, ast.FunctionDef) and node.name.startswith("cmd_")
    ]
    assert sorted(methods) == sorted(row.handler for row in table if not row.parameter)
