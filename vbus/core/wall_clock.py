"""Wall time that stays what it is when a test freezes or sets the clock.

Libraries that do so put functions of their own in the place of those of :mod:`time`, there and in
each module that has imported one. They leave ``clock_gettime`` of clocks that only count alone, and
they do not know the functions made of it here when this module is imported.
"""

from collections.abc import Callable
from functools import partial
from time import CLOCK_MONOTONIC, CLOCK_PROCESS_CPUTIME_ID, clock_gettime, clock_gettime_ns
from typing import Final

monotonic: Final[Callable[[], float]] = partial(clock_gettime, CLOCK_MONOTONIC)
"""Seconds since some instant of the past."""
monotonic_ns: Final[Callable[[], int]] = partial(clock_gettime_ns, CLOCK_MONOTONIC)
"""The same in nanoseconds."""
process_time: Final[Callable[[], float]] = partial(clock_gettime, CLOCK_PROCESS_CPUTIME_ID)
"""Seconds that processors have worked for this process."""
