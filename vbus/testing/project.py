"""``[tool.vbus]`` of pyproject.toml: what a project says of violations."""

import tomllib
from pathlib import Path
from typing import Final

from vbus.errors import ConfigError
from vbus.server.recording import suppressions_of
from vbus.testing.judge import CHOICES, Judge, accepted

_KEYS: Final = (*CHOICES, "accept", "suppress")


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
    return Judge(accepted=allowed).told(where, table)
