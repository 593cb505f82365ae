"""A transcript of bus cycles, one line each, with what was broken where it was broken."""

from collections.abc import Callable
from functools import partial
from typing import Final, TextIO

from vbus.core.signals import Observer, Violation

_US: Final = 1_000_000


class Transcript(Observer):
    """Writes ``x w 0 1E``: chip, read or write, address and byte in hexadecimal.

    Equal cycles in a row are one line, ``x r 0 84 x14``. A violation stands behind the cycle it
    was found at, as ``! x lm628.T17 ...``.

    Args:
        file: where it goes.
        times: begin each line with the instant of its first cycle, in microseconds.

    Attributes:
        error: why the file takes no more (a full disk), or "".
    """

    def __init__(self, file: TextIO, times: bool = False) -> None:
        self.error: str = ""
        self._file: TextIO = file
        self._times: bool = times
        self._line: str = ""
        self._count: int = 0
        self._when: int = 0

    def bus_cycle(
        self, when: int, host: str, chip: str, write: bool, address: int, data: int
    ) -> None:
        """Note a cycle."""
        line = f"{chip} {'w' if write else 'r'} {address:X} {data:02X}"
        # Polls are most cycles of a driver: a counted line keeps the file readable.
        if line == self._line:
            self._count += 1
            return
        self.flush()
        self._line, self._count, self._when = line, 1, when

    def violation(self, violation: Violation) -> None:
        """Note what was broken."""
        self.flush()
        self._write(violation.when, f"! {violation.chip} {violation.rule} {violation.detail}")

    def flush(self) -> None:
        """Write what is still held back to be counted."""
        if self._line:
            count = f" x{self._count}" if self._count > 1 else ""
            self._write(self._when, self._line + count)
        self._line = ""

    def end(self) -> None:
        """Write all there is, to the disk."""
        self.flush()
        self._guarded(self._file.flush)

    def _write(self, when: int, line: str) -> None:
        time = f"{when // _US}.{when % _US // 1000:03} " if self._times else ""
        self._guarded(partial(self._file.write, f"{time}{line}\n"))

    def _guarded(self, write: Callable[[], object]) -> None:
        # After the first error nothing more is tried: the board goes on without its transcript.
        if not self.error:
            try:
                write()
            except OSError as error:
                self.error = f"the transcript ends early: {error.strerror}"
