"""How far from its golden the run of a test may be."""

import re
from dataclasses import replace
from typing import Any, Final

from vbus.core.errors import ConfigError
from vbus.core.values.settings import among
from vbus.views.runs.difference import Tolerance

NEAR: Final = Tolerance(counts=4, time=0.05, cycles=0.05, limit=True)
"""What holds where nothing else is said."""
_KEYS: Final = ("counts", "time", "cycles")
_SHARE: Final = re.compile(r"(\d+(?:\.\d+)?) ?%")


def tolerance_of(where: str, given: Any, otherwise: Tolerance = NEAR) -> Tolerance:
    """Return how far from its golden a run may be, as a table says.

    Raises:
        ConfigError: it is no table, a key is unknown, or a value makes no sense.
    """
    if not isinstance(given, dict):
        raise ConfigError(
            f'{where}: golden = {given!r}: write a table, {{"counts": 4, "time": "5 %"}}'
        )
    values: dict[str, Any] = {}
    for key, value in given.items():
        if key not in _KEYS:
            known = among(str(key), _KEYS, "allowed are")
            raise ConfigError(f"{where}: golden: unknown key {key!r}; {known}")
        share = _SHARE.fullmatch(value) if isinstance(value, str) else None
        whole = isinstance(value, int) and not isinstance(value, bool) and value >= 0
        if key == "counts" and whole:
            values[key] = value
        elif key != "counts" and share:
            values[key] = float(share[1]) / 100
        else:
            allowed = "a number of counts" if key == "counts" else 'a share, such as "5 %"'
            raise ConfigError(f"{where}: golden: {key} = {value!r}: write {allowed}")
    return replace(otherwise, **values)
