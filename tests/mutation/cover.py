"""Which tests execute which lines: the coverage map, measured once and kept in the build folder.

Lines are kept by key (see :class:`tests.mutation.mutants.Layout`), so the map stays right for
everything that is not edited.
"""

import json
import time
from collections.abc import Iterator
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import pytest
from coverage import Coverage

from tests.mutation import trial
from tests.mutation.mutants import Layout

BETWEEN = "between tests"


@dataclass(slots=True)
class Measured:
    """One test.

    Attributes:
        seconds: of processor time it took, with coverage.
        draws: whether Hypothesis draws its examples.
        lines: by file, the bits of the lines it executed.
    """

    seconds: float
    draws: bool
    lines: dict[str, int]


@dataclass(slots=True)
class Map:
    """Tests and the lines they execute.

    Attributes:
        tests: by node id.
        bits: by file, the bit of each line's key.
    """

    tests: dict[str, Measured] = field(default_factory=dict)
    bits: dict[str, dict[str, int]] = field(default_factory=dict)

    def mask(self, file: str, keys: Iterator[str]) -> int:
        """Return the bits of lines."""
        bits = self.bits.get(file, {})
        return sum(1 << bits[key] for key in set(keys) if key in bits)

    def save(self, path: Path) -> None:
        """Write the map."""
        path.parent.mkdir(parents=True, exist_ok=True)
        tests = {
            name: [round(it.seconds, 4), it.draws, {f: hex(m) for f, m in it.lines.items()}]
            for name, it in self.tests.items()
        }
        path.write_text(json.dumps({"tests": tests, "bits": self.bits}))

    @classmethod
    def load(cls, path: Path) -> "Map":
        """Read the map; an empty one if there is none."""
        if not path.exists():
            return cls()
        raw = json.loads(path.read_text())
        return cls(
            {
                name: Measured(seconds, draws, {f: int(m, 16) for f, m in lines.items()})
                for name, (seconds, draws, lines) in raw["tests"].items()
            },
            raw["bits"],
        )


class _Contexts:
    """Plug-in: each test is a context of the coverage; notes its time and whether it passed."""

    def __init__(self, coverage: Coverage) -> None:
        self.coverage = coverage
        self.seconds: dict[str, float] = {}
        self.draws: set[str] = set()
        self.passed: set[str] = set()

    def pytest_collection_modifyitems(self, items: list[pytest.Item]) -> None:
        trial.draw(items, trial.FEW)

    @pytest.hookimpl(wrapper=True, tryfirst=True)
    def pytest_runtest_protocol(self, item: pytest.Item) -> Iterator[None]:
        self.coverage.switch_context(item.nodeid)
        start = time.process_time()
        try:
            return (yield)
        finally:
            self.seconds[item.nodeid] = time.process_time() - start
            self.coverage.switch_context(BETWEEN)
            if trial.draws(item):
                self.draws.add(item.nodeid)

    def pytest_runtest_logreport(self, report: pytest.TestReport) -> None:
        if report.when == "call" and report.passed:
            self.passed.add(report.nodeid)
        elif report.failed:
            self.passed.discard(report.nodeid)


def measure(root: Path, package: str, tests: str, options: list[str], path: Path) -> list[str]:
    """Run a folder or file of tests with coverage, and put them into the map.

    Args:
        root: the checkout.
        package: what is covered.
        tests: the folder or file.
        options: of pytest.
        path: the map.

    Returns:
        those that do not pass.
    """
    coverage = Coverage(
        data_file=None, config_file=False, include=[f"{root}/{package}/*"], messages=False
    )
    contexts = _Contexts(coverage)
    coverage.start()
    pytest.main(options, plugins=[contexts])
    coverage.stop()
    found = Map.load(path)
    found.tests = {name: it for name, it in found.tests.items() if not name.startswith(tests)}
    passed = {name: Measured(contexts.seconds[name], name in contexts.draws, {})
             for name in contexts.passed}  # fmt: skip
    data = coverage.get_data()
    for measured in data.measured_files():
        _enter(found, passed, measured, Path(measured).relative_to(root).as_posix(), data)
    found.tests.update(passed)
    found.save(path)
    return sorted(contexts.seconds.keys() - contexts.passed)


def _enter(found: Map, tests: dict[str, Measured], path: str, file: str, data: Any) -> None:
    keys = Layout(Path(path).read_text()).keys
    bits = found.bits.setdefault(file, {})
    for line, names in data.contexts_by_lineno(path).items():
        bit = 1 << bits.setdefault(keys[line], len(bits))
        for name in names:
            if name in tests:
                lines = tests[name].lines
                lines[file] = lines.get(file, 0) | bit
