"""Turns of sessions: none spins while another wants to be served."""

import os
from collections.abc import Callable
from typing import Final

LOOKS: Final = 24 if len(os.sched_getaffinity(0)) > 1 else 0
"""How often to look for a next message before sleeping: some 30 us. Not on a single processor:
a process that gives way on a busy one comes back later than one that is woken. With it a trip over
a terminal takes 0.75 to 0.85 of that to a C echo that sleeps (docs/performance.md)."""


class SpinTurn:
    """Session served last. Only a sole session may spin.

    Attributes:
        last: the session served last.
        looks: how often a session looks for a next message before it sleeps.
        give_way: lets the host run between two looks.
    """

    def __init__(self) -> None:
        self.last: object = None
        self.looks: int = LOOKS
        self.give_way: Callable[[], object] = os.sched_yield
