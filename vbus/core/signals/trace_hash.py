"""The trace hash: one number for everything a run did on its buses and wires."""

from vbus.core.signals.observer import Observer
from vbus.core.signals.violation import Violation


class TraceHash(Observer):
    """SHA-256 over bus cycles, edges and violations in order of (instant, chip, sequence).

    A lazy chip may report late what happened in one of its samples, so records wait until the
    board says that all is reported up to some instant.

    Args:
        order: names of the chips in the order of the board file.
    """

    def __init__(self, order: list[str]) -> None:
        self._order: dict[str, int] = {name: rank for rank, name in enumerate(order)}
        self._pending: list[tuple[int, int, str]] = []
        import hashlib  # which loads OpenSSL: 3 ms that a client, which hashes nothing, would pay

        self._hash = hashlib.sha256()

    def _add(self, when: int, name: str, text: str) -> None:
        # A joined net has no chip: it comes after all of them, by name.
        rank = self._order.get(name.partition(".")[0], len(self._order))
        self._pending.append((when, rank, text))

    def bus_cycle(
        self, when: int, host: str, chip: str, write: bool, address: int, data: int
    ) -> None:
        """Record a bus cycle; the host's label and its wire do not count."""
        self._add(when, chip, f"{'w' if write else 'r'} {chip} {address:x} {data:x}")

    def edge(self, when: int, net: str, level: int) -> None:
        """Record an edge of a joined net."""
        self._add(when, net, f"e {net} {level:x}")

    def violation(self, violation: Violation) -> None:
        """Record a violation."""
        self._add(
            violation.when,
            violation.chip,
            f"v {violation.chip} {violation.rule} {violation.measured} {violation.limit}",
        )

    def fault(self, when: int, name: str, target: str, what: str, text: str) -> None:
        """Record the evidence of a fault."""
        self._add(when, target, f"f {target} {name} {what} {text}")

    def record(self, when: int, text: str) -> None:
        """Take what is in its final place."""
        self._hash.update(f"{when} {text}\n".encode())

    def waiting(self) -> list[tuple[int, str]]:
        """Return, in order, what has no final place yet."""
        return [(when, text) for when, _, text in sorted(self._pending, key=_when_and_rank)]

    def settled(self, now: int) -> None:
        """Record what is older than ``now``; what lies at ``now`` may still get company."""
        pending = self._pending
        pending.sort(key=_when_and_rank)
        done = 0
        for when, _, text in pending:
            if when >= now:
                break
            self.record(when, text)
            done += 1
        del pending[:done]

    def digest(self) -> str:
        """Return the hash (hex) over everything recorded so far."""
        total = self._hash.copy()
        for when, text in self.waiting():
            total.update(f"{when} {text}\n".encode())
        return total.hexdigest()


def _when_and_rank(record: tuple[int, int, str]) -> tuple[int, int]:
    return record[0], record[1]
