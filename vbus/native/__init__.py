"""The C client: one header and one C99 file, as data of the package."""

from pathlib import Path


def include_dir() -> str:
    """Return the folder that holds ``vbus.h`` and ``vbus.c``."""
    return str(Path(__file__).parent)
