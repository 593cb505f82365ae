"""The latest lines of what happens on a bus; equal neighbours are counted, not repeated."""

from collections import deque
from dataclasses import dataclass


@dataclass(slots=True)
class CountedLine:
    """A line, and how often it came in a row.

    Attributes:
        when: instant at which it came first (ps).
        text: the line.
        times: how often.
    """

    when: int
    text: str
    times: int = 1

    def counted(self, gap: str = " ") -> str:
        """Return the line with its count behind a gap, if it came more than once."""
        return f"{self.text}{gap}x{self.times}" if self.times > 1 else self.text


class LatestLines(deque[CountedLine]):
    """The latest lines, oldest first; ``maxlen`` says how many."""

    def add(self, when: int, text: str) -> bool:
        """Take a line; tell whether it is the one before again."""
        again = bool(self) and self[-1].text == text
        if again:
            self[-1].times += 1
        else:
            self.append(CountedLine(when, text))
        return again
