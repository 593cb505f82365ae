"""Attributes of a part that may change, and that none of its declarations names.

What ``__init__`` alone sets stays as it was made, which the source says itself. All else is named:
what another method or another object sets, and what holds things that come and go.
"""

import ast
import sys
from collections import deque
from collections.abc import Iterator
from functools import cache
from pathlib import Path
from typing import Any, Final

ROOT: Final = Path(__file__).parents[1]
HOLDS: Final = (bytearray, deque, dict, list, set)


def undeclared(part: Any) -> set[str]:
    """Return the attributes that may change and that its class declares nowhere."""
    cls = type(part)
    declared: set[str] = set()
    for base in cls.__mro__:
        inside = vars(base)
        for declaration in ("STATE", "WIRING", "DERIVED"):
            for field in inside.get(declaration, ()):
                # Of "limit = inputs.limit" the attribute is "inputs".
                declared.add(field.partition(":")[0].rpartition(" = ")[2].partition(".")[0])
    if "*" in declared and not hasattr(cls, "STATE"):
        return set()
    made = frozenset().union(*(set_by(base, init=True) for base in cls.__mro__))
    stays = made.difference(set_by_others(), *(set_by(base, init=False) for base in cls.__mro__))
    left = attributes(part) - declared
    return {name for name in left if name not in stays or isinstance(getattr(part, name), HOLDS)}


def attributes(part: Any) -> set[str]:
    """Return the names of a part's attributes, compiled or not."""
    there: set[str] = set(getattr(part, "__dict__", ()))
    for base in type(part).__mro__:
        for names in (vars(base).get("__mypyc_attrs__", ()), vars(base).get("__slots__", ())):
            there.update((names,) if isinstance(names, str) else names)
    return there - {"__dict__", "__weakref__"}


@cache
def set_by(cls: type, init: bool) -> frozenset[str]:
    """Return what ``__init__`` of a class sets, or its other methods."""
    return frozenset(
        name
        for node in ast.walk(_tree(_file(cls.__module__)))
        if isinstance(node, ast.ClassDef) and node.name == cls.__name__
        for method in node.body
        if (getattr(method, "name", "") == "__init__") == init
        for owner, name in _stores(method)
        if owner == "self"
    )


@cache
def set_by_others() -> frozenset[str]:
    """Return the names of what any code sets of another object, whatever class that is of."""
    trees = [_tree(file) for file in (ROOT / "vbus").rglob("*.py")]
    found = [pair for tree in trees for pair in (*_stores(tree), *_by_name(tree))]
    return frozenset(name for owner, name in found if owner != "self")


def _stores(tree: ast.AST) -> list[tuple[str, str]]:
    """Return each attribute that is set or deleted, after the expression whose it is."""
    return [
        (ast.unparse(node.value), node.attr)
        for node in ast.walk(tree)
        if isinstance(node, ast.Attribute) and not isinstance(node.ctx, ast.Load)
    ]


def _by_name(tree: ast.AST) -> Iterator[tuple[str, str]]:
    """Yield what ``setattr`` may set: parameters of commands, and public names beside it."""
    nodes = list(ast.walk(tree))
    near = any(isinstance(node, ast.Name) and node.id == "setattr" for node in nodes)
    for node in nodes:
        if isinstance(node, ast.keyword) and node.arg == "parameter":
            node = node.value
        elif not near:
            continue
        if isinstance(node, ast.Constant) and isinstance(node.value, str):
            name = node.value.rpartition(".")[2]
            if not name.startswith("_"):
                yield "", name


def _file(module: str) -> Path | None:
    """Return the source of a module of ours, also where it runs compiled."""
    path = ROOT / f"{module.replace('.', '/')}.py"
    if path.is_file():
        return path
    found = getattr(sys.modules.get(module), "__file__", None)
    return Path(found) if found and found.endswith(".py") else None


@cache
def _tree(file: Path | None) -> ast.AST:
    return ast.parse(file.read_text(encoding="utf-8") if file is not None else "")
