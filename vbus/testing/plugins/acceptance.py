"""Which tests accept which violations; an acceptance of what never happens fails."""

import tomllib
from collections.abc import Iterable
from dataclasses import dataclass, field
from pathlib import Path
from typing import Final

import pytest

from vbus.core.errors import ConfigError
from vbus.testing.judge import CHOICES, Judge, accepted
from vbus.views.findings.suppress import Suppression, suppressions_of

_KEYS: Final = (*CHOICES, "accept", "budget", "golden", "suppress")


def read_project(folder: Path) -> Judge:
    """Return what holds for all tests of the project in ``folder`` that say nothing else.

    Raises:
        VbusError: its pyproject.toml is no TOML, or something in it makes no sense.
    """
    path = folder / "pyproject.toml"
    try:
        table = tomllib.loads(path.read_text(encoding="utf-8")).get("tool", {}).get("vbus", {})
    except FileNotFoundError:
        return Judge()
    except (OSError, ValueError) as error:
        raise ConfigError(f"{path}: {error}") from None
    where = f"{path}: [tool.vbus]"
    for key in table:
        if key not in _KEYS:
            raise ConfigError(f"{where}: unknown key {key!r}; allowed are {', '.join(_KEYS)}")
    allowed = accepted(where, table.get("accept", {}))
    if "suppress" in table:
        allowed += suppressions_of(str(folder / str(table["suppress"])))
    return Judge(accepted=allowed).configured(where, table)


@dataclass(slots=True)
class Acceptance:
    """Accepted violations of one rule.

    Attributes:
        scope: node id of the test function, class or module that says so; "" for the project.
        suppression: the rule, the reason, and how often it was needed.
        tests: node ids of the tests it holds for.
    """

    scope: str
    suppression: Suppression
    tests: set[str] = field(default_factory=set)

    def needless(self, passed: set[str]) -> bool:
        """Tell whether all its tests are among those that have passed, and none needed it."""
        return not self.suppression.used and self.tests <= passed

    @property
    def of_function(self) -> bool:
        """Whether a test function says so."""
        return any(test.partition("[")[0] == self.scope for test in self.tests)

    def __str__(self) -> str:
        one = self.suppression
        where = f" of chip {one.chip}" if one.chip else ""
        return (
            f"{self.scope or 'the project'} accepts {one.rule}{where} ({one.reason}), which"
            " never happened; take it out"
        )


class Acceptances:
    """All that is accepted in a run of pytest.

    Args:
        config: of the run.

    Raises:
        VbusError: what the project says makes no sense.
    """

    def __init__(self, config: pytest.Config) -> None:
        self.project: Judge = read_project(config.rootpath)
        self._all: dict[tuple[str, str, str], Acceptance] = {}
        self._deselected: set[str] = set()
        for one in self.project.accepted:
            self._add("", one)

    def _add(self, scope: str, one: Suppression) -> Acceptance:
        return self._all.setdefault((scope, one.rule, one.chip), Acceptance(scope, one))

    def collect(self, items: Iterable[pytest.Item]) -> None:
        """Take what the markers of tests accept.

        Raises:
            VbusError: a marker makes no sense.
        """
        for item in items:
            for node, mark in item.iter_markers_with_node("vbus"):
                if "accept" in mark.kwargs:
                    scope = node.nodeid.partition("[")[0]
                    where = f"{scope}: @pytest.mark.vbus"
                    for one in accepted(where, mark.kwargs["accept"]):
                        self._add(scope, one).tests.add(item.nodeid)
            for acceptance in self._all.values():
                if not acceptance.scope:  # it is the project's
                    acceptance.tests.add(item.nodeid)

    def deselect(self, items: Iterable[pytest.Item]) -> None:
        """Take note of tests that are left out: what holds for them cannot be judged."""
        self._deselected |= {item.nodeid for item in items}

    def of(self, test: str) -> list[Suppression]:
        """Return what is accepted in a test."""
        return [one.suppression for one in self._all.values() if test in one.tests]

    def needless_in(self, test: str, passed: set[str]) -> list[str]:
        """Return what a test function accepts in vain, when the last of its variants passes.

        Args:
            test: that variant.
            passed: all tests that have passed before, with a board or without.
        """
        return [
            str(one)
            for one in self._all.values()
            if test in one.tests and one.of_function and one.needless(passed | {test})
        ]

    # -- at the end of the run ----------------------------------------------------------------

    def update(self, other: "Acceptances") -> None:
        """Add what a worker of pytest-xdist has seen."""
        self._deselected |= other._deselected
        for key, one in other._all.items():
            mine = self._all.setdefault(key, one)
            if mine is not one:
                mine.suppression.used += one.suppression.used
                mine.tests |= one.tests

    def needless(self, config: pytest.Config, passed: set[str]) -> list[str]:
        """Return what was accepted in vain; of places of which all tests have run, and passed."""
        asked = {_node_id(config, argument) for argument in config.args}
        return [
            str(one)
            for one in self._all.values()
            if one.tests and one.needless(passed) and self._complete(one.scope, asked, config)
        ]

    def _complete(self, scope: str, asked: set[str], config: pytest.Config) -> bool:
        if not scope:
            whole = {_node_id(config, path) for path in config.getini("testpaths")} or {"."}
            return not self._deselected and ("." in asked or whole <= asked)
        inner = (f"{scope}::", f"{scope}[")
        return not any(test.startswith(inner) for test in asked | self._deselected)


def _node_id(config: pytest.Config, argument: str) -> str:
    """Return the node id of what pytest was asked to run."""
    path, colons, rest = argument.partition("::")
    place = (config.invocation_params.dir / path).resolve()
    if place.is_relative_to(config.rootpath.resolve()):
        path = place.relative_to(config.rootpath.resolve()).as_posix()
    return f"{path}{colons}{rest}"
