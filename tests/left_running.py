"""A test stops what it starts: a process that still runs when the test is over fails that test.

Python warns of such a process when it finds the garbage, which may be in any later test. A process
that has ended by then, or ends soon, is waited for here: nobody is blamed for it, however busy the
machine is.
"""

import subprocess
from collections.abc import Generator
from typing import Any

import pytest

ENDING = 30.0
"""Seconds after which a process was not told to end."""

_started: list["subprocess.Popen[Any]"] = []
_failed = pytest.StashKey[bool]()
_init = subprocess.Popen.__init__


def _noted(self: "subprocess.Popen[Any]", *words: Any, **options: Any) -> None:
    _init(self, *words, **options)
    _started.append(self)


subprocess.Popen.__init__ = _noted  # type: ignore[method-assign]


def _ends(process: "subprocess.Popen[Any]") -> bool:
    try:
        process.wait(ENDING)
    except subprocess.TimeoutExpired:
        return False
    return True


@pytest.hookimpl(wrapper=True)
def pytest_runtest_call(item: pytest.Item) -> Generator[None, None, None]:
    _started.clear()  # those of fixtures end with the fixtures
    try:
        yield
    except BaseException:
        item.stash[_failed] = True
        raise


@pytest.hookimpl(wrapper=True, tryfirst=True)
def pytest_runtest_teardown(item: pytest.Item) -> Generator[None, None, None]:
    yield
    left = [process for process in _started if not _ends(process)]
    _started.clear()
    for process in left:
        process.kill()
        process.wait()
    if left and not item.stash.get(_failed, False):
        pytest.fail(f"left running: {[process.args for process in left]}", pytrace=False)
