"""Roles in docstrings, such as ``:class:`~vbus.board.board.Board```, lead to what they name."""

import ast
import contextlib
import importlib
import inspect
import re
from collections.abc import Iterator
from functools import cache
from pathlib import Path
from types import ModuleType

import pytest

import vbus

# Compiled classes do not tell which attributes their methods set; the texts are the same.
pytestmark = pytest.mark.core("interpreted")

ROOT = Path(next(iter(vbus.__path__)))
ROLE = re.compile(r":(?:attr|class|data|exc|func|meth|mod):`(?:[^`<]+<)?[~!]?([\w.]+)>?`")


def modules() -> Iterator[str]:
    for path in sorted(ROOT.rglob("*.py")):
        place = path.relative_to(ROOT.parent).with_suffix("")
        if path.name != "__main__.py" and ":`" in path.read_text():
            yield ".".join(place.parts).removesuffix(".__init__")


@cache
def set_on_self(klass: type) -> set[str]:
    """Return the attributes that methods of a class set, and those of its bases."""
    found = set(getattr(klass, "__annotations__", ())) | set(getattr(klass, "__slots__", ()))
    try:
        source = inspect.getsource(klass)
    except (OSError, TypeError):
        return found
    found |= set(re.findall(r"\bself\.(\w+)\b", source))
    for base in klass.__bases__:
        found |= set_on_self(base)
    return found


def has(thing: object, name: str) -> bool:
    return hasattr(thing, name) or (isinstance(thing, type) and name in set_on_self(thing))


def leads(target: str, start: object) -> bool:
    """Whether a dotted name leads somewhere from ``start``."""
    for part in target.split("."):
        if not has(start, part):
            return False
        start = getattr(start, part, None)
    return True


def known(target: str, module: ModuleType, classes: list[str]) -> bool:
    """Whether a role in this place of a module leads somewhere."""
    places: list[object] = [module]
    for name in classes:
        places.append(getattr(places[-1], name, None))
    if any(leads(target, place) for place in places):
        return True
    with contextlib.suppress(ImportError):
        importlib.import_module(target)
        return True
    home, _, name = target.rpartition(".")
    while home:
        try:
            return leads(target[len(home) + 1 :], importlib.import_module(home))
        except ImportError:
            home, _, name = home.rpartition(".")
    return False


def texts(node: ast.AST, classes: list[str]) -> Iterator[tuple[str, list[str]]]:
    """Give every free-standing string below a node, with the classes around it."""
    for child in ast.iter_child_nodes(node):
        if isinstance(child, ast.Expr) and isinstance(child.value, ast.Constant):
            if isinstance(child.value.value, str):
                yield child.value.value, classes
        elif isinstance(child, ast.ClassDef):
            yield from texts(child, [*classes, child.name])
        else:
            yield from texts(child, classes)


@pytest.mark.parametrize("name", [*modules()])
def test_every_role_leads_to_what_it_names(name: str) -> None:
    module = importlib.import_module(name)
    source = Path(str(module.__file__)).read_text()

    lost = [
        target
        for text, classes in texts(ast.parse(source), [])
        for target in ROLE.findall(text)
        if not known(target, module, classes)
    ]

    assert lost == []
