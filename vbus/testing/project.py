"""``[tool.vbus]`` of pyproject.toml: what a project says of violations."""

import tomllib
from dataclasses import dataclass, field
from pathlib import Path
from typing import Final

from vbus.errors import ConfigError
from vbus.server.recording import suppressions_of
from vbus.testing.judge import CHOICES, accepted, choice
from vbus.trace.findings.suppress import Suppression

_KEYS: Final = ("violations", "after_fault", "accept", "suppress")


@dataclass(slots=True)
class Project:
    """What holds for all tests that say nothing else.

    Attributes:
        violations: ``"fail"`` or ``"report"``.
        after_fault: the same of violations that follow a fault.
        accepted: what is accepted, from the table and from the suppression file.
    """

    violations: str = CHOICES["violations"][0]
    after_fault: str = CHOICES["after_fault"][0]
    accepted: list[Suppression] = field(default_factory=list)


def read_project(folder: Path) -> Project:
    """Read what the project in ``folder`` says; nothing if it has no pyproject.toml.

    Raises:
        VbusError: the file is no TOML, or something in it makes no sense.
    """
    path = folder / "pyproject.toml"
    try:
        table = tomllib.loads(path.read_text(encoding="utf-8")).get("tool", {}).get("vbus", {})
    except FileNotFoundError:
        return Project()
    except (OSError, ValueError) as error:
        raise ConfigError(f"{path}: {error}") from None
    where = f"{path}: [tool.vbus]"
    for key in table:
        if key not in _KEYS:
            raise ConfigError(f"{where}: unknown key {key!r}; allowed are {', '.join(_KEYS)}")
    project = Project()
    if "violations" in table:
        project.violations = choice(where, "violations", table["violations"])
    if "after_fault" in table:
        project.after_fault = choice(where, "after_fault", table["after_fault"])
    project.accepted = accepted(where, table.get("accept", {}))
    if "suppress" in table:
        project.accepted += suppressions_of(str(folder / str(table["suppress"])))
    return project
