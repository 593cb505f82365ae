"""Where fixtures of this suite are made."""

import ast
from collections import defaultdict
from collections.abc import Iterator
from pathlib import Path

ROOT = Path(__file__).parents[1]


def made_in(path: Path) -> Iterator[str]:
    """Give the names of the fixtures that a file defines."""
    for node in ast.parse(path.read_text()).body:
        if isinstance(node, ast.FunctionDef | ast.AsyncFunctionDef) and any(
            "fixture" in ast.unparse(decorator) for decorator in node.decorator_list
        ):
            yield node.name


def test_pytest_can_list_the_fixtures() -> None:
    """``pytest --fixtures`` sorts them by the length of where they are, file and name.

    One that two files of paths of equal length import it cannot sort, and ends with an internal
    error: whoever shares a fixture has it from a ``conftest.py`` above.
    """
    files = {
        ".".join(p.relative_to(ROOT).with_suffix("").parts): p for p in ROOT.glob("tests/**/*.py")
    }
    fixtures = {name: set(made_in(path)) for name, path in files.items()}
    places = defaultdict(list)
    for name, path in files.items():
        base = (path.parent if path.name == "conftest.py" else path).relative_to(ROOT).as_posix()
        for fixture in fixtures[name]:
            places[len(base), name, fixture].append(base)
        for node in ast.parse(path.read_text()).body:
            if isinstance(node, ast.ImportFrom) and node.module in fixtures:
                for one in {alias.name for alias in node.names} & fixtures[node.module]:
                    places[len(base), node.module, one].append(base)
    assert {key: bases for key, bases in places.items() if len(bases) > 1} == {}
