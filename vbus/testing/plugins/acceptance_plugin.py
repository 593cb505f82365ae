"""The part of the pytest plug-in that tells what is accepted in vain."""

from collections.abc import Sequence
from contextlib import suppress
from typing import TYPE_CHECKING

import pytest

from vbus.testing.plugins.workers import handed_over, is_worker

if TYPE_CHECKING:
    from vbus.testing.plugins.acceptance import Acceptances

ACCEPTED: pytest.StashKey["Acceptances"] = handed_over("accepted")
DESELECTED: pytest.StashKey[list[pytest.Item]] = pytest.StashKey()
PASSED: pytest.StashKey[set[str]] = handed_over("passed")
"""Node ids of the tests that have passed, with a board or without."""
NEEDLESS: pytest.StashKey[list[str]] = pytest.StashKey()


def acceptances(session: pytest.Session) -> "Acceptances":
    """Return what is accepted in this run, read when a board is first asked for."""
    from vbus.core.errors import VbusError
    from vbus.testing.plugins.acceptance import Acceptances

    found = session.config.stash.get(ACCEPTED, None)
    if found is None:
        try:
            found = Acceptances(session.config)
            found.collect(session.items)
        except VbusError as error:
            raise pytest.fail.Exception(str(error), pytrace=False) from None
        left_out = session.config.stash.setdefault(DESELECTED, [])
        found.deselect(left_out)
        session.config.stash[ACCEPTED] = found
    return found


def fail_run(session: pytest.Session) -> None:
    """Let a run whose tests have passed fail all the same."""
    if session.exitstatus == pytest.ExitCode.OK:
        session.exitstatus = pytest.ExitCode.TESTS_FAILED


def pytest_deselected(items: Sequence[pytest.Item]) -> None:
    """Take note of tests that do not run."""
    if items:
        items[0].config.stash.setdefault(DESELECTED, []).extend(items)


def finished(item: pytest.Item, counts: bool) -> list[str]:
    """Return what a test accepts in vain, when it and its fixtures are done; note that it passed.

    Args:
        item: the test.
        counts: whether it has passed, and not only as a trial.
    """
    accepted = item.config.stash.get(ACCEPTED, None)
    passed = item.config.stash.setdefault(PASSED, set())
    needless = accepted.needless_in(item.nodeid, passed) if accepted is not None and counts else []
    if counts and not needless:
        passed.add(item.nodeid)
    return needless


def _accepts(session: pytest.Session) -> bool:
    """Tell whether something is accepted in a run in which no test has had a board."""
    project = session.config.rootpath / "pyproject.toml"
    return any(
        "accept" in mark.kwargs for item in session.items for mark in item.iter_markers("vbus")
    ) or (bool(session.items) and project.is_file() and "[tool.vbus" in project.read_text("utf-8"))


def pytest_sessionfinish(session: pytest.Session) -> None:
    """Fail a run in which a module or the project accepts what never happened."""
    config = session.config
    if ACCEPTED not in config.stash and _accepts(session):
        with suppress(pytest.fail.Exception):  # an error of its own is reported at a board
            acceptances(session)
    accepted = config.stash.get(ACCEPTED, None)
    passed = config.stash.setdefault(PASSED, set())
    if is_worker(config):
        return
    needless = accepted.needless(config, passed) if accepted is not None else []
    if needless:
        fail_run(session)
    config.stash[NEEDLESS] = needless


def pytest_terminal_summary(
    terminalreporter: pytest.TerminalReporter, config: pytest.Config
) -> None:
    """Say what was accepted in vain."""
    needless = config.stash.get(NEEDLESS, [])
    if needless:
        terminalreporter.section("vbus: accepted violations that never happened", red=True)
        for sentence in needless:
            terminalreporter.line(sentence)
