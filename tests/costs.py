"""What a run has cost, by folder: shown at its end, so that a test that grows dear is noticed.

Seconds of processors are those of the tests and fixtures, and of the processes that they have
waited for; only these compare from run to run. Seconds that pass grow with what else
the machine does, and where they are far more than those of processors a test waits. All are added
up over all workers.
"""

import os
from collections import Counter
from collections.abc import Generator
from typing import Any, Final

import pytest

DEEPER: Final = frozenset(("conformance", "unit"))
"""Folders whose own folders are told one by one."""

USED: Final = "processor seconds"
_before = 0.0


def _used() -> float:
    """Return the seconds of processors that this process and its dead children have used."""
    return sum(os.times()[:4])


def folder_of(nodeid: str) -> str:
    """Return the folder a test is counted under."""
    parts = nodeid.partition("::")[0].split("/")
    depth = 3 if len(parts) > 3 and parts[1] in DEEPER else 2
    return "/".join(parts[: min(depth, len(parts) - 1)]) or "."


def pytest_runtest_logstart() -> None:
    global _before
    _before = _used()


@pytest.hookimpl(wrapper=True)
def pytest_runtest_makereport() -> Generator[None, pytest.TestReport, pytest.TestReport]:
    """Add to each phase's report what has been used since the phase before."""
    global _before
    report = yield
    before, _before = _before, _used()
    report.user_properties.append((USED, _before - before))
    return report


def pytest_terminal_summary(terminalreporter: Any) -> None:
    used: Counter[str] = Counter()
    seconds: Counter[str] = Counter()
    tests: Counter[str] = Counter()
    for reports in terminalreporter.stats.values():
        for report in reports:
            if hasattr(report, "duration") and hasattr(report, "nodeid"):
                folder = folder_of(report.nodeid)
                used[folder] += dict(report.user_properties).get(USED, 0.0)
                seconds[folder] += report.duration
                tests[folder] += report.when == "call"
    if len(seconds) < 2:
        return
    terminalreporter.section("seconds by folder")
    terminalreporter.line("  of processors   passed")
    for folder, spent in used.most_common():
        terminalreporter.line(
            f"{spent:15.1f} {seconds[folder]:8.1f} {tests[folder]:6} tests  {folder}"
        )
    terminalreporter.line(
        f"{used.total():15.1f} {seconds.total():8.1f} {tests.total():6} tests  in all"
    )
