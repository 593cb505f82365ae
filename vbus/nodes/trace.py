"""What happened on each node, and the one hash over what happened on all."""

import hashlib
from collections.abc import Iterable, Iterator
from heapq import merge
from typing import ClassVar

from vbus.signals import TraceHash
from vbus.state import Names

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

    def settled(self, now: int) -> None:
        """Put in order what is older than ``now``."""
        pending = self._pending
        pending.sort(key=_when_and_rank)
        done = 0
        for when, _, text in pending:
            if when >= now:
                break
            self._lines.append((when, text))
            done += 1
        self.records += done
        del pending[:done]

    def lines(self) -> list[Line]:
        """Return everything so far, in order."""
        rest = sorted(self._pending, key=_when_and_rank)
        return [*self._lines, *((when, text) for when, _, text in rest)]

    def digest(self) -> str:
        """Return the hash of this node alone (hex)."""
        return merged_hash([self.lines()])

    def after_load(self) -> None:
        """Count what has been loaded."""
        self.records = len(self._lines)


def merged(traces: Iterable[Iterable[Line]]) -> Iterator[tuple[int, int, str]]:
    """Merge the traces of nodes, given by rank, in order of (instant, node, sequence)."""
    return merge(*(_ranked(rank, lines) for rank, lines in enumerate(traces)), key=_instant_rank)


def _ranked(rank: int, lines: Iterable[Line]) -> Iterator[tuple[int, int, str]]:
    for when, text in lines:
        yield when, rank, text


def _instant_rank(line: tuple[int, int, str]) -> tuple[int, int]:
    return line[0], line[1]


def merged_hash(traces: Iterable[Iterable[Line]]) -> str:
    """Return the SHA-256 (hex) over the merged traces of all nodes, given by rank."""
    total = hashlib.sha256()
    for when, rank, text in merged(traces):
        total.update(f"{when} {rank} {text}\n".encode())
    return total.hexdigest()


def _when_and_rank(record: tuple[int, int, str]) -> tuple[int, int]:
    return record[0], record[1]
