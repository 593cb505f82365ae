"""The reference models know nothing of what they are compared with."""

import ast
import sys
from collections.abc import Iterator
from pathlib import Path

import pytest

FOLDER = Path(__file__).parent
MODELS = [
    path for path in sorted(FOLDER.glob("*.py")) if path.stem in {"lm628", "mcp1200", "mc1241a"}
]
LOADERS = {"builtins", "importlib", "pkgutil", "runpy", "sys"}
"""Modules by which others could be reached without an import that can be read."""


def imports(text: str) -> Iterator[str]:
    """Give the first part of every module that a text imports, "." if relative."""
    for node in ast.walk(ast.parse(text)):
        if isinstance(node, ast.Import):
            yield from (alias.name.partition(".")[0] for alias in node.names)
        elif isinstance(node, ast.ImportFrom):
            yield "." if node.level else str(node.module).partition(".")[0]
        elif isinstance(node, ast.Name) and node.id in {"__import__", "eval", "exec"}:
            yield node.id


def foreign(text: str) -> set[str]:
    """Return what a text imports that is not a plain part of Python's own library."""
    return {name for name in imports(text) if name not in sys.stdlib_module_names - LOADERS}


def test_there_is_a_model() -> None:
    assert MODELS


@pytest.mark.parametrize("path", MODELS, ids=lambda path: path.name)
def test_a_model_imports_nothing_of_the_project(path: Path) -> None:
    assert foreign(path.read_text()) == set()


@pytest.mark.parametrize(
    ("text", "found"),
    [
        ("import vbus", {"vbus"}),
        ("def f():\n    from vbus.core.bits import signed", {"vbus"}),
        ("import math, tests.reference.lm628", {"tests"}),
        ("from . import lm628", {"."}),
        ("import importlib.util", {"importlib"}),
        ("x = __import__('vbus')", {"__import__"}),
        ("from math import isqrt", set()),
    ],
)
def test_the_look_at_imports_finds_them(text: str, found: set[str]) -> None:
    assert foreign(text) == found
