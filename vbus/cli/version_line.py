"""The line of ``vbus --version``."""

from vbus.compiled import core
from vbus.version import __version__


def version_line() -> str:
    """Return version and core in a line for people."""
    return f"vbus {__version__} ({core()} core)"
