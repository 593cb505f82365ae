"""The demonstrations: one file each, imported when it is wanted."""

from importlib import import_module
from typing import TYPE_CHECKING, Final

if TYPE_CHECKING:
    from vbus.tools.demos.row import Demo

NAMES: Final = ("lm629", "mcp1200", "mc1241a")
"""Demonstrations by name; the first is the default."""


def demo_of(name: str) -> "Demo":
    """Return the demonstration called ``name``."""
    row: Demo = import_module(f"vbus.tools.demos.{name}").DEMO
    return row
