"""Whose turn it is on a server: nobody is waited for while others want to be served."""

import os
from collections.abc import Callable
from typing import Final

LOOKS: Final = 24 if len(os.sched_getaffinity(0)) > 1 else 0
"""How often to look for a next message before sleeping: some 30 us. Not on a single processor:
where others keep it busy, who gives way comes back later than who is woken."""


class SpinTurn:
    """Whom a server served last: only a host alone is looked for, which takes time from others.

    Attributes:
        last: the session served last.
        looks: how often a session looks for a next message before it sleeps.
        give_way: lets the host run between two looks.
    """

    def __init__(self) -> None:
        self.last: object = None
        self.looks: int = LOOKS
        self.give_way: Callable[[], object] = os.sched_yield
