"""Which tests execute which lines: the coverage map, measured once and kept in the build folder.

Lines are kept by key (see :class:`tests.mutation.mutants.Layout`), so the map stays right for
everything that is not edited.
"""

import json
import os
import shutil
from collections import defaultdict
from collections.abc import Iterable, Iterator
from dataclasses import dataclass, field
from pathlib import Path

import pytest
from coverage import Coverage, CoverageData

from tests.mutation import trial
from tests.mutation.mutants import Layout

BETWEEN = "between tests"


@dataclass(slots=True)
class Measured:
    """One test.

    Attributes:
        seconds: of processor time it took, with coverage and its processes.
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

    def mask(self, file: str, keys: Iterable[str]) -> int:
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
    """Plug-in: each test is a context of the coverage; notes its time and whether it passed.

    Processes that a test starts measure themselves, and leave what they have in a folder.
    """

    def __init__(self, coverage: Coverage, started: Path) -> None:
        self.coverage = coverage
        self.started = started
        self.elsewhere: dict[str, dict[int, list[str]]] = defaultdict(lambda: defaultdict(list))
        self.seconds: dict[str, float] = {}
        self.draws: set[str] = set()
        self.passed: set[str] = set()

    def pytest_collection_modifyitems(self, items: list[pytest.Item]) -> None:
        trial.draw(items, trial.FEW)

    @pytest.hookimpl(wrapper=True, tryfirst=True)
    def pytest_runtest_protocol(self, item: pytest.Item) -> Iterator[None]:
        self.coverage.switch_context(item.nodeid)
        start = sum(os.times()[:4])
        try:
            return (yield)
        finally:
            self.seconds[item.nodeid] = sum(os.times()[:4]) - start
            self.coverage.switch_context(BETWEEN)
            self._gather(item.nodeid)
            if trial.draws(item):
                self.draws.add(item.nodeid)

    def _gather(self, name: str) -> None:
        """Take what the processes of a test have executed."""
        for path in self.started.glob("data*"):
            data = CoverageData(str(path))
            data.read()
            for file in data.measured_files():
                for line in data.lines(file) or ():
                    self.elsewhere[file][line].append(name)
            path.unlink()

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
    include = f"{root}/{package}/*"
    coverage = Coverage(data_file=None, config_file=False, include=[include], messages=False)
    started = path.parent / "started"
    shutil.rmtree(started, ignore_errors=True)
    started.mkdir(parents=True)
    settings = started / "settings"
    settings.write_text(
        f"[run]\nparallel = true\nsigterm = true\ndata_file = {started}/data\ninclude = {include}\n"
    )
    os.environ["COVERAGE_PROCESS_START"] = str(settings)
    contexts = _Contexts(coverage, started)
    coverage.start()
    pytest.main(options, plugins=[contexts])
    coverage.stop()
    found = Map.load(path)
    found.tests = {
        name: it
        for name, it in found.tests.items()
        if not name.startswith((f"{tests}/", f"{tests}::"))
    }
    passed = {name: Measured(contexts.seconds[name], name in contexts.draws, {})
             for name in contexts.passed}  # fmt: skip
    data = coverage.get_data()
    for measured in data.measured_files():
        _enter(found, passed, root, measured, data.contexts_by_lineno(measured))
    for measured, lines in contexts.elsewhere.items():
        _enter(found, passed, root, measured, lines)
    found.tests.update(passed)
    found.save(path)
    return sorted(contexts.seconds.keys() - contexts.passed)


def _enter(
    found: Map, tests: dict[str, Measured], root: Path, path: str, contexts: dict[int, list[str]]
) -> None:
    file = Path(path).relative_to(root).as_posix()
    keys = Layout(Path(path).read_text()).keys
    bits = found.bits.setdefault(file, {})
    for line, names in contexts.items():
        bit = 1 << bits.setdefault(keys[line], len(bits))
        for name in names:
            if name in tests:
                lines = tests[name].lines
                lines[file] = lines.get(file, 0) | bit
