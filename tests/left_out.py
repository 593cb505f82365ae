"""What a run leaves out: tests of the other core, and tests that lack something on this machine.

A test marked ``core("compiled")`` or ``core("interpreted")`` is not chosen on the other one; both
together run all. A test that is skipped says what it lacks; with ``VBUS_REQUIRE_ALL=1`` nothing may
be lacking, and a skip fails the run.
"""

import os
import shutil
from typing import Any

import pytest

from vbus.compiled import core


def require(program: str) -> str:
    """Return the path of a program; skip the test without it."""
    found = shutil.which(program)
    if found is None:
        pytest.skip(f"needs {program}")
    return found


def pytest_collection_modifyitems(config: pytest.Config, items: list[pytest.Item]) -> None:
    here, elsewhere = [], []
    for item in items:
        mark = item.get_closest_marker("core")
        (here if mark is None or mark.args[0] == core() else elsewhere).append(item)
    if elsewhere:
        config.hook.pytest_deselected(items=elsewhere)
        items[:] = here


def _lacking(config: pytest.Config) -> list[pytest.TestReport]:
    """Return what was skipped where nothing may be."""
    reporter: Any = config.pluginmanager.getplugin("terminalreporter")
    if os.environ.get("VBUS_REQUIRE_ALL") != "1" or reporter is None:
        return []
    return list(reporter.stats.get("skipped", ()))


def pytest_sessionfinish(session: pytest.Session) -> None:
    if session.exitstatus == pytest.ExitCode.OK and _lacking(session.config):
        session.exitstatus = pytest.ExitCode.TESTS_FAILED


def pytest_terminal_summary(terminalreporter: Any, config: pytest.Config) -> None:
    lacking = _lacking(config)
    if lacking:
        terminalreporter.section("skipped, though VBUS_REQUIRE_ALL is 1")
    for report in lacking:
        why = report.longrepr[2] if isinstance(report.longrepr, tuple) else report.longreprtext
        terminalreporter.line(f"{report.nodeid}: {why}")
