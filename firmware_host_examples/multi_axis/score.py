"""What a host does, written down with its instants, as the timer interrupt of a real one would.

Instants are in picoseconds from the beginning of the score. The same score is played in virtual
time, where bus cycles happen at these instants, and in real time, where it is ordered for an
instant that is to come: the chips see the same either way.
"""

from itertools import pairwise
from typing import NamedTuple

US = 1_000_000
MS = 1_000_000_000

WRITE, READ, PIN = "w", "r", "pin"


class Event(NamedTuple):
    """One bus cycle, by its latching edge, or one edge of a pin that the host drives."""

    at: int
    chip: str
    verb: str
    address: int = 0
    data: int = 0
    pin: str = ""

    def line(self) -> str:
        """Return it as a line of a scenario (docs/time.md)."""
        if self.verb == PIN:
            return f"{self.at}ps {self.chip} pin {self.pin} {self.data}"
        data = f" {self.data:x}" if self.verb == WRITE else ""
        return f"{self.at}ps {self.chip} {self.verb} {self.address:x}{data}"


class Score:
    """Bus cycles of several chips, collected in any order."""

    def __init__(self) -> None:
        self._events: list[Event] = []

    def write(self, at: int, chip: str, address: int, *data: int) -> None:
        """Write bytes at one address, a microsecond apart."""
        for n, byte in enumerate(data):
            self._events.append(Event(at + n * US, chip, WRITE, address, byte & 0xFF))

    def read(self, at: int, chip: str, address: int, count: int = 1) -> None:
        """Read at one address, a microsecond apart."""
        for n in range(count):
            self._events.append(Event(at + n * US, chip, READ, address))

    def pin(self, at: int, chip: str, pin: str, level: int) -> None:
        """Drive a pin of a chip."""
        self._events.append(Event(at, chip, PIN, data=level, pin=pin))

    @property
    def end(self) -> int:
        """Instant of the last event."""
        return max(event.at for event in self._events)

    def of(self, chips: set[str]) -> list[Event]:
        """Return what concerns some chips, in order.

        Raises:
            ValueError: two cycles of one bus overlap: the score is wrong.
        """
        events = sorted((e for e in self._events if e.chip in chips), key=lambda e: e.at)
        for chip in chips:
            own = [e for e in events if e.chip == chip and e.verb != PIN]
            for first, second in pairwise(own):
                if second.at - first.at < US:
                    raise ValueError(f"two bus cycles of {chip} overlap: {first}, {second}")
        return events

    def lines(self) -> str:
        """Return all of it as a scenario."""
        return "\n".join(e.line() for e in sorted(self._events, key=lambda e: e.at)) + "\n"
