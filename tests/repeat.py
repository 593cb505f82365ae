"""Whole-system tests get a second run: a busy machine can starve real processes for seconds.

Tests of the core never do. Which test needed its second run, and why, is told in the summary.
"""

import gc
import sys
import warnings
from pathlib import Path
from typing import Any, Final

import pytest
from _pytest.runner import runtestprotocol

WHOLE_SYSTEM: Final = frozenset(
    ("avr", "e2e", "examples", "exec", "nodes", "shims", "sigrok", "zenoh")
)
REPEATED: Final = "repeated"


@pytest.hookimpl(tryfirst=True)
def pytest_runtest_protocol(item: pytest.Item, nextitem: pytest.Item | None) -> bool | None:
    here = Path(__file__).parent
    if not item.path.is_relative_to(here) or item.path.parts[len(here.parts)] not in WHOLE_SYSTEM:
        return None
    hook = item.ihook
    hook.pytest_runtest_logstart(nodeid=item.nodeid, location=item.location)
    reports = runtestprotocol(item, log=False, nextitem=nextitem)
    failed = [report for report in reports if report.failed]
    if failed:
        why = str(failed[0].longrepr).strip().rpartition("\n")[2]
        _forget()
        item._initrequest()  # type: ignore[attr-defined]
        reports = runtestprotocol(item, log=False, nextitem=nextitem)
        for report in reports:
            report.user_properties.append((REPEATED, why))
    for report in reports:
        hook.pytest_runtest_logreport(report=report)
    hook.pytest_runtest_logfinish(nodeid=item.nodeid, location=item.location)
    return True


def _forget() -> None:
    """Drop what the failed run left open, so that no later test is blamed for it."""
    sys.last_type = sys.last_value = sys.last_traceback = None
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", ResourceWarning)
        gc.collect()


def pytest_report_teststatus(report: pytest.TestReport) -> tuple[str, str, str] | None:
    if report.when == "call" and report.passed and dict(report.user_properties).get(REPEATED):
        return REPEATED, "R", "REPEATED"
    return None


def pytest_terminal_summary(terminalreporter: Any) -> None:
    for report in terminalreporter.stats.get(REPEATED, ()):
        why = dict(report.user_properties)[REPEATED]
        terminalreporter.write_line(f"REPEATED {report.nodeid} - first: {why}")
