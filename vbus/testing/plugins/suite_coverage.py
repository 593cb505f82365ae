"""What a whole suite has exercised of its chips, over tests, programs and workers."""

from collections.abc import Iterable
from pathlib import Path
from typing import Any, Final

import pytest

from vbus.board.board import Board
from vbus.core.errors import VbusError, content, value_errors, write_errors
from vbus.serve.output_file import write_file
from vbus.views.coverage.coverage import Coverage, CoverageObserver, from_json
from vbus.views.coverage.formats import as_text, coverage_format, difference


def coverage_observer(board: Board) -> CoverageObserver:
    """Return what counts what the hosts of a test's board exercise, from now on."""
    families = {chip.name: chip.FAMILY for chip in board.chips}
    observer = CoverageObserver(families, board.name)
    board.observe(observer)
    return observer


class SuiteCoverage:
    """The coverage of a run of pytest.

    Args:
        files: where it is written; a name's end says how.
        least: percent that must be exercised, or the run fails.
        base: a coverage file to compare with; "" is none.

    Raises:
        VbusError: a file's name says no format, the least is no share, or the base cannot be
            read.
    """

    def __init__(self, files: Iterable[str], least: float, base: str) -> None:
        self.whole: Coverage = Coverage()
        self._files: Final = [file for file in files if file]
        self._least: Final = least
        with value_errors(VbusError, "--vbus-coverage="):
            for file in self._files:
                coverage_format(file)
        if not 0 <= least <= 100:
            raise VbusError(f"--vbus-coverage-fail-under={least:g}: percent go from 0 to 100")
        self._base: Coverage | None = None
        if base:
            self._base = from_json(content(base), base)

    def add(self, test: str, observers: Iterable[CoverageObserver]) -> None:
        """Take what a test has exercised."""
        for observer in observers:
            found = observer.coverage
            of_test = {family: set(keys) for family, keys in found.counts.items()}
            self.whole.merge(Coverage([], found.counts, {test: of_test}))

    def update(self, other: "SuiteCoverage") -> None:
        """Add what a worker of pytest-xdist has seen."""
        self.whole.merge(other.whole)

    def finish(self) -> str:
        """Write the files; return why the run fails, or "".

        Raises:
            VbusError: one cannot be written.
        """
        whole = self.whole
        whole.runs = [f"{len(whole.tests)} tests"]
        for file in self._files:
            with write_errors(file):
                Path(file).parent.mkdir(parents=True, exist_ok=True)
            write_file(file, coverage_format(file)(whole).encode())
        percent, shown = (whole.percent(), whole.shown()) if whole.counts else (0.0, "0.0%")
        return f"{shown} exercised, {self._least:g}% wanted" if percent < self._least else ""

    def lines(self, short: bool = False) -> list[str]:
        """Return what the terminal shows: all of it, unless a file has it, or shares if short."""
        text = as_text(self.whole, each=not (self._files or short))
        if self._base is not None:
            text += difference(self._base, self.whole)
        return [*text.splitlines(), *(f"written: {file}" for file in self._files)]


def asked_for(config: pytest.Config) -> SuiteCoverage:
    """Return what collects the coverage of a run, as its options want it.

    Raises:
        UsageError: it cannot be had as asked for.
    """
    option: Any = config.getoption
    files: list[str] | None = option("--vbus-coverage")
    least: float = option("--vbus-coverage-fail-under")
    base: str = option("--vbus-coverage-base")
    try:
        return SuiteCoverage(files or [], least, base)
    except VbusError as error:
        raise pytest.UsageError(str(error)) from None
