"""What a run has cost, by folder: told at its end, so that a test that grows dear is noticed.

Seconds are those of the tests themselves, their fixtures included, added up over all workers; on a
busy machine they are longer.
"""

from collections import Counter
from typing import Any, Final

DEEPER: Final = frozenset(("conformance", "unit"))
"""Folders whose own folders are told one by one."""


def folder_of(nodeid: str) -> str:
    """Return the folder a test is counted under."""
    parts = nodeid.partition("::")[0].split("/")
    depth = 3 if len(parts) > 3 and parts[1] in DEEPER else 2
    return "/".join(parts[: min(depth, len(parts) - 1)]) or "."


def pytest_terminal_summary(terminalreporter: Any) -> None:
    seconds: Counter[str] = Counter()
    tests: Counter[str] = Counter()
    for reports in terminalreporter.stats.values():
        for report in reports:
            if hasattr(report, "duration") and hasattr(report, "nodeid"):
                folder = folder_of(report.nodeid)
                seconds[folder] += report.duration
                tests[folder] += report.when == "call"
    if len(seconds) < 2:
        return
    terminalreporter.section("seconds by folder")
    for folder, spent in seconds.most_common():
        terminalreporter.line(f"{spent:8.1f} {tests[folder]:6} tests  {folder}")
    terminalreporter.line(f"{seconds.total():8.1f} {tests.total():6} tests  in all")
