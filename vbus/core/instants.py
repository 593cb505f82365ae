"""Instants and lengths of virtual time, in picoseconds."""

from typing import Final

NS: Final = 1_000
US: Final = 1_000_000
MS: Final = 1_000_000_000
SECOND: Final = 1_000_000_000_000

NEVER: Final = (1 << 63) - 1
"""An instant that does not come: what a timer that is not set is due at."""

# Not at the last number: a period, a delay or a busy time may be added to any instant before it.
END: Final = (1 << 63) - (1 << 56)
"""Time ends at this instant (ps), 106 days after power-on. Between it and :data:`NEVER` lie 20
hours: no chip adds more to an instant, so no sum of its leaves a machine word."""

FAR: Final = 1 << 61
"""An instant (ps) long before that, which the compiled core compares with and makes no object."""
