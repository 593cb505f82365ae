"""How much a test may take (chip time, cycles, polls), and how far it may be from its golden."""

import re
from dataclasses import replace
from typing import Any, Final

from vbus.core.errors import ConfigError
from vbus.core.kernel import SECOND
from vbus.core.values.settings import among
from vbus.protocols.quantities import picoseconds
from vbus.serve.host_limits import IN_VAIN, PATIENCE
from vbus.serve.host_limits import POLLING as POLLING
from vbus.serve.host_limits import UNBOUNDED as UNBOUNDED
from vbus.serve.host_limits import HostStuck as HostStuck
from vbus.serve.host_limits import HostWatch as HostWatch
from vbus.serve.host_limits import Limits as Limits
from vbus.views.runs.difference import Tolerance

BUDGET: Final = Limits(300_000, 60 * SECOND, IN_VAIN, PATIENCE)
"""What a test may take that says nothing else, on a board whose time is virtual."""
BUDGET_KEYS: Final = ("cycles", "chip_time", "polls", "polling")


def budget_of(where: str, given: Any, otherwise: Limits) -> Limits:
    """Return the limits that a table says, for what it leaves out those of ``otherwise``.

    Raises:
        ConfigError: it is no table, a key is unknown, or a value makes no sense.
    """
    if not isinstance(given, dict):
        raise ConfigError(
            f'{where}: budget = {given!r}: write a table, {{"cycles": 20_000, "chip_time": "2 s"}}'
        )
    values: dict[str, Any] = {key: getattr(otherwise, key) for key in BUDGET_KEYS}
    for key, value in given.items():
        if key not in BUDGET_KEYS:
            known = among(str(key), BUDGET_KEYS, "allowed are")
            raise ConfigError(f"{where}: budget: unknown key {key!r}; {known}")
        in_time = key in ("chip_time", "polling")
        try:
            number = picoseconds(value)
            if number <= 0 or isinstance(value, str) != in_time:
                raise ValueError
        except (TypeError, ValueError):
            allowed = 'a time with its unit, such as "2 s"' if in_time else "a number more than 0"
            raise ConfigError(f"{where}: budget: {key} = {value!r}: write {allowed}") from None
        values[key] = number / SECOND if key == "polling" else number
    return Limits(**values)


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
