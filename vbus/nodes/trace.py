"""What happened on each node, and the one hash over what happened on all."""

import hashlib
from collections.abc import Iterable, Iterator
from heapq import merge
from operator import itemgetter
from typing import ClassVar

from vbus.core.signals import TraceHash
from vbus.core.state import Names

Line = tuple[int, str]
"""Instant (ps), and what happened at it."""


class NodeTrace(TraceHash):
    """Keeps what a :class:`TraceHash` would hash: bus cycles, edges and violations of one node."""

    STATE: ClassVar[Names] = (
        "_lines: list[(i64, str), ...]", "_pending: list[(i64, i64, str), ...]",
    )  # fmt: skip
    WIRING: ClassVar[Names] = ("_hash", "_order")
    DERIVED: ClassVar[Names] = ("records",)

    def __init__(self, order: list[str]) -> None:
        super().__init__(order)
        self._lines: list[Line] = []

    def record(self, when: int, text: str) -> None:
        """Keep it."""
        self._lines.append((when, text))

    def lines(self) -> list[Line]:
        """Return everything so far, in order."""
        return [*self._lines, *self.waiting()]

    def digest(self) -> str:
        """Return the hash of this node alone (hex)."""
        return hash_of(merged([self.lines()]))

    def after_load(self) -> None:
        """Count what has been loaded."""
        self.records = len(self._lines)


def merged(traces: Iterable[Iterable[Line]]) -> Iterator[str]:
    """Merge the traces of nodes, given by rank, in order of (instant, node, sequence)."""
    ranked = ([(when, rank, text) for when, text in lines] for rank, lines in enumerate(traces))
    # Of equal instants, merge() takes the one of the earlier list.
    for when, rank, text in merge(*ranked, key=itemgetter(0)):
        yield f"{when} {rank} {text}\n"


def hash_of(lines: Iterable[str]) -> str:
    """Return the SHA-256 (hex) over the lines of a merged trace."""
    total = hashlib.sha256()
    for line in lines:
        total.update(line.encode())
    return total.hexdigest()
