"""How much a test may take: its budget of chip time, bus cycles and polls in vain."""

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
