"""A test of a whole system that a busy machine gave no time gets a second run; nothing else does.

What earns it is named: a wait that ended without what it waited for, :class:`Starved`, and a
process that did not end in time, :class:`subprocess.TimeoutExpired`. A wrong answer, hash or
transcript fails at once, and tests of the core are never repeated. Which test needed its second
run, and why, is told in the summary; more than :data:`ALLOWED` of them fail the run, since that is
no longer the machine.
"""

import gc
import subprocess
import sys
import warnings
from collections.abc import Generator
from pathlib import Path
from typing import Any, Final

import pytest
from _pytest.runner import runtestprotocol

from tests.waiting import Starved

WHOLE_SYSTEM: Final = frozenset(
    ("avr", "e2e", "examples", "exec", "nodes", "shims", "sigrok", "zenoh")
)
REPEATED: Final = "repeated"
STARVED: Final = "starved"
ALLOWED: Final = 3
"""Repeats in one run that may be the machine's fault."""


@pytest.hookimpl(wrapper=True)
def pytest_runtest_makereport(
    call: pytest.CallInfo[None],
) -> Generator[None, pytest.TestReport, pytest.TestReport]:
    report = yield
    if call.excinfo is not None and isinstance(
        call.excinfo.value, (Starved, subprocess.TimeoutExpired)
    ):
        report.user_properties.append((STARVED, str(call.excinfo.value)))
    return report


@pytest.hookimpl(tryfirst=True)
def pytest_runtest_protocol(item: pytest.Item, nextitem: pytest.Item | None) -> bool | None:
    here = Path(__file__).parent
    if not item.path.is_relative_to(here) or item.path.parts[len(here.parts)] not in WHOLE_SYSTEM:
        return None
    hook = item.ihook
    hook.pytest_runtest_logstart(nodeid=item.nodeid, location=item.location)
    reports = runtestprotocol(item, log=False, nextitem=nextitem)
    failed = [dict(report.user_properties).get(STARVED) for report in reports if report.failed]
    if failed:
        _forget()
    if failed and None not in failed:
        item._initrequest()  # type: ignore[attr-defined]
        reports = runtestprotocol(item, log=False, nextitem=nextitem)
        for report in reports:
            report.user_properties.append((REPEATED, failed[0]))
    for report in reports:
        hook.pytest_runtest_logreport(report=report)
    hook.pytest_runtest_logfinish(nodeid=item.nodeid, location=item.location)
    return True


def _forget() -> None:
    """End and drop what the failed run left, so that no later test is slowed or blamed.

    A test that fails has let go of its processes in the middle; Python ends none of them, and warns
    of them wherever it next looks for garbage.
    """
    sys.last_type = sys.last_value = sys.last_traceback = None
    sys.last_exc = None  # type: ignore[attr-defined]  # where an exception stands from Python 3.12 on
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", ResourceWarning)
        gc.collect()
        dropped: list[subprocess.Popen[Any]] = getattr(subprocess, "_active", [])
        for process in tuple(dropped):
            process.kill()
            process.wait()
        dropped.clear()


def pytest_report_teststatus(report: pytest.TestReport) -> tuple[str, str, str] | None:
    if report.when == "call" and report.passed and dict(report.user_properties).get(REPEATED):
        return REPEATED, "R", "REPEATED"
    return None


def _repeated(config: pytest.Config) -> list[pytest.TestReport]:
    reporter: Any = config.pluginmanager.getplugin("terminalreporter")
    return [] if reporter is None else list(reporter.stats.get(REPEATED, ()))


def pytest_sessionfinish(session: pytest.Session) -> None:
    if session.exitstatus == pytest.ExitCode.OK and len(_repeated(session.config)) > ALLOWED:
        session.exitstatus = pytest.ExitCode.TESTS_FAILED


def pytest_terminal_summary(terminalreporter: Any, config: pytest.Config) -> None:
    repeated = _repeated(config)
    for report in repeated:
        why = dict(report.user_properties)[REPEATED]
        terminalreporter.write_line(f"REPEATED {report.nodeid} - first: {why}")
    if len(repeated) > ALLOWED:
        terminalreporter.write_line(
            f"{len(repeated)} tests were repeated, {ALLOWED} may be: the machine is too small for "
            "this suite, or something hangs now and then"
        )
