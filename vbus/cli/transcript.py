"""What a program's run shows: its bus cycles, one line each, and the rules it broke."""

from collections.abc import Callable
from functools import partial
from typing import TextIO

from vbus.chips.packets import Cycle
from vbus.circuit.stream import CountedLine, LatestLines
from vbus.core.signals import Observer, Violation


class Transcript(Observer):
    """Writes ``x w 0 1E``: chip, read or write, address and byte in hexadecimal.

    Equal cycles in a row are one line, ``x r 0 84 x14``. A violation stands behind the cycle it
    was found at, as ``! x lm628.T17 ...``.

    Args:
        file: where it goes.

    Attributes:
        error: why the file takes no more (a full disk), or "".
    """

    def __init__(self, file: TextIO) -> None:
        self.error: str = ""
        self._file: TextIO = file
        self._held: LatestLines = LatestLines()
        """The line of the latest cycle: polls are most cycles of a driver, and are counted."""

    def bus_cycle(
        self, when: int, host: str, chip: str, write: bool, address: int, data: int
    ) -> None:
        """Note a cycle."""
        self._held.add(when, f"{chip} {Cycle(when, write, address, data)}")
        if len(self._held) > 1:
            self._write(self._held.popleft())

    def violation(self, violation: Violation) -> None:
        """Note what was broken."""
        v = violation
        self.flush()
        self._write(CountedLine(v.when, f"! {v.chip} {v.rule} {v.detail}"))

    def flush(self) -> None:
        """Write what is still held back to be counted."""
        while self._held:
            self._write(self._held.popleft())

    def end(self) -> None:
        """Write all there is, to the disk."""
        self.flush()
        self._guarded(self._file.flush)

    def _write(self, line: CountedLine) -> None:
        self._guarded(partial(self._file.write, f"{line.counted()}\n"))

    def _guarded(self, write: Callable[[], object]) -> None:
        # After the first error nothing more is tried: the board goes on without its transcript.
        if not self.error:
            try:
                write()
            except OSError as error:
                self.error = f"the transcript ends early: {error.strerror}"


class FirstViolations(Observer):
    """Remembers the first violation of each rule by each chip, and counts the others."""

    def __init__(self) -> None:
        self.first: dict[tuple[str, str], Violation] = {}
        self.count: dict[tuple[str, str], int] = {}
        self.hints: list[str] = []
        """What is to be said of them at the end."""

    def violation(self, violation: Violation) -> None:
        """Note one."""
        key = (violation.chip, violation.rule)
        self.first.setdefault(key, violation)
        self.count[key] = self.count.get(key, 0) + 1

    def lines(self) -> list[str]:
        """Return a sentence for each rule that was broken, in the order of the first breach."""
        lines = []
        for key, violation in self.first.items():
            others = self.count[key] - 1
            more = f" (and {others} more)" if others else ""
            when = f"{violation.when // 1_000_000}.{violation.when % 1_000_000 // 1000:03} us"
            lines.append(
                f"{violation.severity}: {violation.chip}: {violation.rule} ({violation.clause})"
                f" at {when}: {violation.detail}{more}"
            )
        return [*lines, *self.hints]
