"""Gives a mutated module its changed source, under its own name and path."""

import importlib.abc
import importlib.machinery
import importlib.util
import os
import sys
import warnings
from collections.abc import Sequence
from pathlib import Path
from types import CodeType, ModuleType
from typing import Any, Final, SupportsIndex

SITE: Final = str(Path(__file__).with_name("site"))
"""Has a module that each Python imports when it starts, and that calls :func:`install`."""
MUTATED: Final = "MUTATED_MODULE"
"""Environment variable: path of the module, the same from the checkout, path of its source."""


class CosmicRayTestingException(Exception):
    """Is never raised; a mutated ``except`` waits for it."""


class _Mutated(importlib.machinery.SourceFileLoader):
    def __init__(self, name: str, path: str, source: str) -> None:
        super().__init__(name, path)
        self._source = source

    def get_code(self, fullname: str) -> CodeType:
        with warnings.catch_warnings():
            warnings.simplefilter("ignore")
            return compile(self._source, self.path, "exec", dont_inherit=True)

    def exec_module(self, module: ModuleType) -> None:
        vars(module)[CosmicRayTestingException.__name__] = CosmicRayTestingException
        super().exec_module(module)


class _Finder(importlib.abc.MetaPathFinder):
    """Finds the mutated module, and nothing else."""

    def __init__(self, path: str, file: str, source: str) -> None:
        self._path = path
        self._name = file.removesuffix(".py").removesuffix("/__init__").replace("/", ".")
        self._source = source

    def find_spec(
        self, fullname: str, path: Sequence[str] | None, target: ModuleType | None = None
    ) -> importlib.machinery.ModuleSpec | None:
        if fullname != self._name:
            return None
        loader = _Mutated(fullname, self._path, self._source)
        return importlib.util.spec_from_file_location(fullname, self._path, loader=loader)


class _Finders(list[Any]):
    """Keeps the first finder first: pytest puts the one that rewrites plugins before all others."""

    def insert(self, index: SupportsIndex, finder: Any) -> None:
        super().insert(max(index.__index__(), 1), finder)


def install() -> None:
    """Mutate the module that the environment names, if it names one, in this process."""
    if named := os.environ.get(MUTATED):
        path, file, source = named.split(os.pathsep)
        first = _Finder(path, file, Path(source).read_text())
        sys.meta_path = _Finders([first, *sys.meta_path])
