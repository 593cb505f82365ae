"""What the chip is doing as a whole."""

from typing import Final

HELD: Final = 0
"""/RESET is low, or the supply has just come."""
RESETTING: Final = 1
STANDING: Final = 2
"""Idle mode."""
CONTROL: Final = 3

NO_REQUEST: Final = -1
"""The host has written nothing to R05 since the last sample."""
