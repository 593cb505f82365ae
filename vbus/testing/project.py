"""``[tool.vbus]`` of pyproject.toml: what a project says of violations, budgets and goldens."""

import tomllib
from dataclasses import dataclass
from pathlib import Path
from typing import Final

from vbus.errors import ConfigError
from vbus.testing.judge import CHOICES, Judge, accepted
from vbus.testing.limits import BUDGET, Limits, budget_of
from vbus.testing.tolerance import NEAR, tolerance_of
from vbus.trace.findings.suppress import suppressions_of
from vbus.trace.runs.difference import Tolerance

_KEYS: Final = (*CHOICES, "accept", "budget", "golden", "suppress")


@dataclass(frozen=True, slots=True)
class Project:
    """What holds for tests that say nothing else.

    Attributes:
        judge: which violations fail them.
        budget: what they may take.
        tolerance: how far from their goldens they may be.
    """

    judge: Judge
    budget: Limits
    tolerance: Tolerance


def read_project(folder: Path) -> Project:
    """Return what holds for all tests of the project in ``folder`` that say nothing else.

    Raises:
        VbusError: its pyproject.toml is no TOML, or something in it makes no sense.
    """
    path = folder / "pyproject.toml"
    try:
        table = tomllib.loads(path.read_text(encoding="utf-8")).get("tool", {}).get("vbus", {})
    except FileNotFoundError:
        return Project(Judge(), BUDGET, NEAR)
    except (OSError, ValueError) as error:
        raise ConfigError(f"{path}: {error}") from None
    where = f"{path}: [tool.vbus]"
    for key in table:
        if key not in _KEYS:
            raise ConfigError(f"{where}: unknown key {key!r}; allowed are {', '.join(_KEYS)}")
    allowed = accepted(where, table.get("accept", {}))
    if "suppress" in table:
        allowed += suppressions_of(str(folder / str(table["suppress"])))
    judge = Judge(accepted=allowed).told(where, table)
    budget = budget_of(where, table.get("budget", {}), BUDGET)
    return Project(judge, budget, tolerance_of(where, table.get("golden", {})))
