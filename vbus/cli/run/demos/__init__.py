"""The demonstrations of the chip families, imported when they are wanted."""

from typing import TYPE_CHECKING, Final

from vbus import plugins

if TYPE_CHECKING:
    from vbus.client.demo import Demo

_FAMILIES: Final = {one.demo_name: one for one in plugins.families() if one.demo}
NAMES: Final = tuple(_FAMILIES)
"""Demonstrations by name; the first is the default."""


def demo_of(name: str) -> "Demo":
    """Return the demonstration called ``name``."""
    row: Demo = _FAMILIES[name].object("demo")
    return row
