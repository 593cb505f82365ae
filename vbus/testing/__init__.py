"""What test suites of firmware, drivers, and new chips use.

Nothing here is imported by the server; some of it wants ``vbus[test]`` (pytest).
Importing this package costs nothing: its names are loaded when first used.
"""

from importlib import import_module
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from vbus.serve.in_process import connect_in_process as connect_in_process
    from vbus.testing.checks import Nonconformance as Nonconformance
    from vbus.testing.checks.chip_checks import check_chip as check_chip
    from vbus.testing.checks.plant_checks import check_plant as check_plant
    from vbus.testing.checks.wire_checks import check_protocol as check_protocol
    from vbus.testing.checks.wire_checks import check_transport as check_transport

_HOMES = {
    "Nonconformance": "vbus.testing.checks",
    "check_chip": "vbus.testing.checks.chip_checks",
    "check_plant": "vbus.testing.checks.plant_checks",
    "check_protocol": "vbus.testing.checks.wire_checks",
    "check_transport": "vbus.testing.checks.wire_checks",
    "connect_in_process": "vbus.serve.in_process",
}

__all__ = [*_HOMES]


def __getattr__(name: str) -> object:
    home = _HOMES.get(name)
    if home is None:
        raise AttributeError(f"module 'vbus.testing' has no attribute {name!r}")
    return getattr(import_module(home), name)
