"""Waits for what other processes, terminals and networks do, and what it means when one is in vain.

A wait that ends without what it waited for may be the fault of a machine that was too busy; a wrong
answer never is. So these raise :class:`Starved`, which alone, beside the time limits of
:mod:`subprocess`, earns a test of a whole system its second run (see ``tests/repeat.py``).
"""

import time
from collections.abc import Callable
from typing import Final

PATIENCE: Final = 60.0
"""Seconds after which a wait is in vain, unless it says otherwise."""
LOOK: Final = 1.0
"""Seconds that a look at a condition counts for at most: those in which the machine itself stood
still, or had no time for the test, are not held against what is waited for."""


class Starved(Exception):
    """What was waited for has not come: the machine had no time for it, or it never comes."""


def until(
    condition: Callable[[], object],
    what: str | Callable[[], object],
    patience: float = PATIENCE,
    every: float = 0.01,
) -> None:
    """Wait until a condition holds.

    Args:
        condition: looked at again and again; what it raises ends the wait.
        what: says in the error what was waited for; a callable is asked only then.
        patience: seconds to wait.
        every: seconds between two looks.

    Raises:
        Starved: it did not hold in time.
    """
    waited, before = 0.0, time.monotonic()
    while not condition():
        now = time.monotonic()
        waited, before = waited + min(now - before, LOOK), now
        if waited >= patience:
            said = what() if callable(what) else what
            raise Starved(f"in vain for {patience:g} s: {said}")
        time.sleep(every)
