"""The architecture as a test: who imports whom, and what stays pure."""

import ast
import re
import subprocess
import sys
from collections.abc import Iterator
from functools import cache
from graphlib import TopologicalSorter
from pathlib import Path

import pytest

import vbus
from tests.clauses import family, read_clauses
from vbus import plugins
from vbus.chips.base import Chip

ROOT = Path(next(iter(vbus.__path__)))
FILES = sorted(ROOT.rglob("*.py"))


def texts(*folders: Path) -> list[Path]:
    """Return every text in these folders, those below them included."""
    suffixes = {".py", ".md", ".toml", ".c", ".h", ".txt"}
    return sorted(
        path for folder in folders for path in folder.rglob("*") if path.suffix in suffixes
    )


TEXTS = texts(ROOT, ROOT.parent / "docs", ROOT.parent / "firmware_host_examples")
ORDER = (
    "version", "core", "native", "compiled", "protocols", "chips", "plant", "glue", "plugins",
    "network", "client", "circuit", "events", "faults", "boardfile", "cpu", "board", "record",
    "views", "nodes", "campaign", "transports", "serve", "cli", "testing", "__init__", "__main__",
)  # fmt: skip
"""Rooms, the lowest first: a room imports those before it, for type checkers and in functions too.
A folder is a room, a file beside the folders too; see :data:`ROLES` for the folder of a chip."""
PURE = {
    "core", "protocols", "chips", "plant", "glue", "circuit", "events", "faults", "boardfile",
    "board", "record", "views", "nodes", "campaign",
}  # fmt: skip
ASKS_THE_MACHINE = {"runtime", "wall_clock"}
"""Files of the ground floor that are not pure: where sockets are, and the clock on the wall."""
IMPURE = {"asyncio", "time", "random", "socket", "threading", "select", "os", "subprocess"}
ROLES = {
    "coverage": "views",
    "compatible": "views",
    "upsets": "faults",
    "host": "client",
    "calls": "client",
    "demo": "client",
    "generated": "client",
}
"""The room of a file in a chip's folder, by its name; all other files are of the chip itself."""
NUMBERS = (["generated", "bits"], ["generated", "registers"])
"""What is made for the chip itself, not for its clients."""
SHARED_BY_CHIPS = {
    "ac_table",
    "base",
    "bus_watch",
    "family",
    "front_end",
    "motion",
    "packets",
    "tables",
}
DATA = {"tables", "datasheet", "bits"}
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


def room(places: list[str]) -> str:
    """Return the room of a module, by the parts of its name below ``vbus``."""
    in_folder = places[0] == "chips" and len(places) > 2 and places[2:4] not in NUMBERS
    return ROLES.get(places[2], "chips") if in_folder else places[0]


def objections(path: Path) -> Iterator[str]:
    """Say which imports of a file its room does not allow."""
    places = [part.removesuffix(".py") for part in path.relative_to(ROOT).parts]
    mine = room(places)
    pure = mine in PURE and not (mine == "core" and places[1] in ASKS_THE_MACHINE)
    for module in imports(path):
        package, *rest = module.split(".")
        if pure and package in IMPURE:
            yield f"{path}: {mine} is pure: no {module}"
        if package != "vbus" or not rest:
            continue
        theirs = room(rest)
        if ORDER.index(theirs) > ORDER.index(mine):
            yield f"{path}: {mine} stands below {theirs}: no {module}"
        if places[0] == rest[0] == "chips" and rest[1] not in SHARED_BY_CHIPS | {places[1]}:
            yield f"{path}: one chip must not know {module}"
        if mine == "client" and theirs == "chips" and not DATA & set(rest):
            yield f"{path}: a client knows a chip's tables, not {module}"


def test_every_import_points_down() -> None:
    assert [found for path in FILES for found in objections(path)] == []
    rooms = {room([p.removesuffix(".py") for p in path.relative_to(ROOT).parts]) for path in FILES}
    assert rooms == {*ORDER}, "each room has its place, and each place a room"


def looks_inside(node: ast.AST, insides: set[str]) -> bool:
    """Whether a piece of code reaches into what a test calls ``chip``, or has out of ``chips``."""
    if not isinstance(node, ast.Attribute):
        return False
    element = isinstance(node.value, ast.Subscript)
    of = node.value.value if isinstance(node.value, ast.Subscript) else node.value
    private = node.attr.startswith("_") and not node.attr.endswith("__")
    named = getattr(of, "attr", getattr(of, "id", "")) == ("chips" if element else "chip")
    return named and (private or node.attr in insides)


def test_a_new_family_must_know_at_most_15_methods_of_a_chip() -> None:
    """What the page on adding a chip names is enough, and what has no default is among it."""
    text = (ROOT.parent / "docs" / "add-a-chip.md").read_text()
    (body,) = [
        node.body for node in ast.parse((ROOT / "chips" / "base.py").read_text()).body
        if isinstance(node, ast.ClassDef) and node.name == "Chip"
    ]  # fmt: skip
    methods = {
        node.name: ast.unparse(node) for node in body
        if isinstance(node, ast.FunctionDef) and not node.name.startswith("_")
    }  # fmt: skip
    named = {name for name in methods if re.search(rf"\b{name}\(", text)}
    demanded = {name for name, source in methods.items() if "NotImplementedError" in source}
    assert demanded <= named
    assert len(named) <= 15, sorted(named)
    assert len(methods) <= 26, "of those, and of what few families answer otherwise"


def test_only_the_probe_knows_the_inside_of_a_chip() -> None:
    chips = [family.load("chip", Chip) for family in plugins.families()]
    insides = {"shared", "outputs"} | {
        field.partition(":")[0]
        for chip in chips
        if chip is not None
        for field in chip.STATE
        if ": part" in field and field != "bus: part"  # clients have a bus too
    }
    assert {"axis", "axes", "host", "commands"} <= insides
    tests = ROOT.parent / "tests"
    assert [
        f"{path}:{node.lineno}: {ast.unparse(node)}: ask tests/probe.py"
        for path in sorted({*tests.rglob("*.py")} - {tests / "probe.py"})
        for node in ast.walk(ast.parse(path.read_text()))
        if looks_inside(node, insides)
    ] == []


def module_of(path: Path) -> str:
    """Return the name a file is imported by."""
    name = ".".join(path.relative_to(ROOT.parent).with_suffix("").parts)
    return name.removesuffix(".__init__")


def test_no_imports_run_in_circles() -> None:
    modules = {module_of(path): path for path in FILES}
    graph = {
        name: {
            known
            for found in imports(path)
            for known in [found if found in modules else found.rpartition(".")[0]]
            if known in modules and known != name
        }
        for name, path in modules.items()
    }
    TopologicalSorter(graph).prepare()  # raises CycleError, which names a circle


PRIVATE = re.compile("_[^_]")
OF_OTHERS = {
    "_asdict", "_replace",  # of every NamedTuple, which has no other names for them
    "_current_frames", "_selector", "_uch",  # of Python, and of unicorn past its slow Python
    "_WAITS", "_connect",  # of a client's bus: its public names are the calls that users have
}  # fmt: skip


@cache
def private_names(kind: ast.ClassDef) -> set[str]:
    """Return the private names of a class: its methods, its own attributes and its objects'."""
    names = {node.name for node in kind.body if isinstance(node, ast.FunctionDef)}
    names |= {node.name for node in kind.body if isinstance(node, ast.AsyncFunctionDef)}
    for node in ast.walk(kind):
        if isinstance(node, ast.Attribute) and isinstance(node.ctx, ast.Store):
            names |= {node.attr} if ast.unparse(node.value) in ("self", "cls") else set()
    for node in kind.body:
        targets = getattr(node, "targets", [getattr(node, "target", node)])
        names |= {target.id for target in targets if isinstance(target, ast.Name)}
    return {name for name in names if PRIVATE.match(name)}


def test_a_private_name_stays_in_its_file() -> None:
    """Subclasses elsewhere are given names without underscore, and so is everybody else."""
    trees = {path: ast.parse(path.read_text()) for path in FILES}
    kinds: dict[str, list[tuple[Path, ast.ClassDef]]] = {}
    for path, tree in trees.items():
        for node in ast.walk(tree):
            if isinstance(node, ast.ClassDef):
                kinds.setdefault(node.name, []).append((path, node))

    def bases(kind: ast.ClassDef) -> Iterator[tuple[Path, ast.ClassDef]]:
        for base in kind.bases:
            for found in kinds.get(ast.unparse(base).partition("[")[0].rpartition(".")[2], ()):
                yield found
                yield from bases(found[1])

    wrong = []
    for path, tree in trees.items():
        mine: set[str] = set(OF_OTHERS)
        for node in ast.walk(tree):
            if isinstance(node, ast.ClassDef):
                own = private_names(node)
                mine |= own
                used = {one.attr for one in ast.walk(node) if isinstance(one, ast.Attribute)}
                theirs = {name for there, base in bases(node) if there != path
                          for name in private_names(base)} - OF_OTHERS  # fmt: skip
                wrong += [f"{path}: {node.name}: {name}" for name in (used | own) & theirs]
        for node in ast.walk(tree):
            if isinstance(node, ast.Attribute) and PRIVATE.match(node.attr):
                if node.attr not in mine:
                    wrong.append(f"{path}:{node.lineno}: {ast.unparse(node)}")
            elif isinstance(node, ast.ImportFrom):
                wrong += [f"{path}: {one.name}" for one in node.names if PRIVATE.match(one.name)]
    assert wrong == []


def late_words(kind: ast.ClassDef) -> Iterator[str]:
    """Give the i64 attributes that a class sets after its __init__ has handed the object out."""
    functions = {node.name: node for node in kind.body if isinstance(node, ast.FunctionDef)}
    out = False
    for statement in functions["__init__"].body if "__init__" in functions else ():
        if out and isinstance(statement, ast.AnnAssign) and "i64" in ast.dump(statement.annotation):
            yield f"{kind.name}: {ast.unparse(statement.target)}"
        for node in ast.walk(statement):
            given = node.args if isinstance(node, ast.Call) else [node]
            out |= any(
                (isinstance(one, ast.Attribute) and one.attr in functions
                and ast.unparse(one.value) == "self")
                or (isinstance(node, ast.Call) and ast.unparse(one) == "self")
                for one in given
            )  # fmt: skip


def test_machine_words_are_there_before_an_object_hands_itself_out() -> None:
    """A compiled core would look on each access whether a later one is there."""
    assert [
        f"{path}: {late}"
        for path in FILES
        for kind in ast.parse(path.read_text()).body
        if isinstance(kind, ast.ClassDef)
        for late in late_words(kind)
    ] == []


def test_the_texts_speak_of_the_product_only() -> None:
    found = {str(path): BANNED.findall(path.read_text()) for path in TEXTS}
    assert {path: words for path, words in found.items() if words} == {}


def test_every_clause_that_is_named_can_be_read() -> None:
    named = {
        (f"{group}-{number}", str(path.relative_to(ROOT.parent)))
        for path in [*TEXTS, *texts(ROOT.parent / "tests")]
        for group, first, others in CLAUSE.findall(path.read_text())
        for number in (first, *re.findall(r"\d+", others))
    }
    assert len(named) > len(CLAUSES)
    assert sorted((name, path) for name, path in named if name not in CLAUSES) == []


@pytest.mark.parametrize("module", ["lm628", "mcp1200", "mc1241a", "aio.mcp1200"])
def test_a_client_brings_no_behaviour_of_a_chip(module: str) -> None:
    code = f"import sys, vbus.client.{module}; print(*sys.modules)"
    told = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    names = [name.split(".")[1:] for name in told.stdout.split() if name.startswith("vbus.chips.")]
    files = [parts for parts in names if len(parts) > 2 and room(parts) == "chips"]
    assert {"datasheet"} <= {parts[-1] for parts in files} <= DATA
    assert ["chips", "base"] not in names


@pytest.mark.parametrize("module", ["", ".lm628", ".mcp1200", ".mc1241a"])
def test_importing_a_client_loads_little(module: str) -> None:
    name = f"vbus.client{module}"
    code = f"import sys; old = {{*sys.modules}}; import {name}; print(*{{*sys.modules}} - old)"
    told = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    modules = set(told.stdout.split())
    # msgspec alone, with what it imports, took as much time as all of a chip's client.
    slow = {"msgspec", "typing_extensions", "inspect", "dataclasses", "asyncio", "hashlib", "ssl"}
    assert modules & slow == set()
    if module:  # the tables of the chip come along
        return
    rooms = {name.split(".")[1] for name in modules if name.startswith("vbus.")}
    assert rooms == {"client", "compiled", "core", "protocols", "version"}
    assert not any(name.startswith("vbus.core.") and name.count(".") > 2 for name in modules)
    assert len(modules) <= 90


NAMED = re.compile(r"lm62[89]|mcp_?-?1200|mc1[12]41a", re.IGNORECASE)


def asks_for_a_family(node: ast.AST) -> bool:
    """Whether a piece of code compares ``FAMILY``, or looks something up by it."""
    if isinstance(node, ast.Compare):
        asked = [node.left, *node.comparators]
    elif isinstance(node, ast.Subscript):
        asked = [node.slice]
    else:
        return False
    return any(isinstance(part, ast.Attribute) and part.attr == "FAMILY" for part in asked)


def words(node: ast.AST) -> Iterator[str]:
    """Give the names and texts of a piece of code."""
    for field in ("id", "attr", "name", "module", "value"):
        if isinstance(word := getattr(node, field, None), str):
            yield word


def test_nobody_else_knows_a_family_of_chips() -> None:
    found = []
    for path in FILES:
        text = path.read_text()
        if path.is_relative_to(ROOT / "chips") or re.match("# (Made|Generated) ", text):
            continue
        if not NAMED.search(text) and "FAMILY" not in text:
            continue
        tree = ast.parse(text)
        told = {node.value for node in ast.walk(tree) if isinstance(node, ast.Expr)}
        for node in ast.walk(tree):
            named = node not in told and any(NAMED.search(word) for word in words(node))
            if named or asks_for_a_family(node):
                found.append(f"{path.relative_to(ROOT)}: {ast.unparse(node)}")
    assert found == []
