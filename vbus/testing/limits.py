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


NEAR: Final = Tolerance(counts=4, time=0.05, cycles=0.05, limit=True)
"""How far a run may be from its golden where nothing else is said."""
_SHARE: Final = re.compile(r"(\d+(?:\.\d+)?) ?%")
_COUNTS: Final = "a number of counts"
_PERCENT: Final = 'a share, such as "5 %"'
_MOST: Final = "a number more than 0"
_SPAN: Final = 'a time with its unit, such as "2 s"'
_TABLES: Final = {
    "budget": (
        '{"cycles": 20_000, "chip_time": "2 s"}',
        {"cycles": _MOST, "chip_time": _SPAN, "polls": _MOST, "polling": _SPAN},
    ),
    "golden": (
        '{"counts": 4, "time": "5 %"}',
        {"counts": _COUNTS, "time": _PERCENT, "cycles": _PERCENT},
    ),
}
"""By name of a table: an example, and its keys with what each may be."""


def budget_of(where: str, given: Any, otherwise: Limits) -> Limits:
    """Return the limits that a table says, for what it leaves out those of ``otherwise``.

    Raises:
        ConfigError: it is no table, a key is unknown, or a value makes no sense.
    """
    values = _read(where, "budget", given)
    if "polling" in values:
        values["polling"] /= SECOND
    return replace(otherwise, **values)


def tolerance_of(where: str, given: Any, otherwise: Tolerance = NEAR) -> Tolerance:
    """Return how far from its golden a run may be, as a table says.

    Raises:
        ConfigError: it is no table, a key is unknown, or a value makes no sense.
    """
    return replace(otherwise, **_read(where, "golden", given))


def _read(where: str, table: str, given: Any) -> dict[str, Any]:
    example, allowed = _TABLES[table]
    if not isinstance(given, dict):
        raise ConfigError(f"{where}: {table} = {given!r}: write a table, {example}")
    values = {}
    for key, value in given.items():
        if key not in allowed:
            known = among(str(key), tuple(allowed), "allowed are")
            raise ConfigError(f"{where}: {table}: unknown key {key!r}; {known}")
        try:
            values[key] = _value(allowed[key], value)
        except (TypeError, ValueError):
            raise ConfigError(
                f"{where}: {table}: {key} = {value!r}: write {allowed[key]}"
            ) from None
    return values


def _value(kind: str, value: Any) -> float:
    """Return a value of a kind as a number: shares of 1, times in ps.

    Raises:
        TypeError, ValueError: it is none of that kind.
    """
    if kind == _PERCENT and (share := _SHARE.fullmatch(value)):
        return float(share[1]) / 100
    if kind == _COUNTS and isinstance(value, int) and not isinstance(value, bool) and value >= 0:
        return value
    if kind in (_MOST, _SPAN) and isinstance(value, str) == (kind == _SPAN):
        number = picoseconds(value)
        if number > 0:
            return number
    raise ValueError(value)
