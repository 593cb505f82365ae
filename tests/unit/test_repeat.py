"""Which tests get a second run, how it is told, and how many may need one."""

import shutil
import subprocess
from itertools import count
from pathlib import Path

import pytest

from tests import namespaces, waiting

pytest_plugins = ["pytester"]

TESTS = """
import subprocess
import sys
from pathlib import Path

import pytest

from tests.waiting import Starved, until

def first(name):
    flag = Path(__file__).with_name(name + ".flag")
    was = not flag.exists()
    flag.touch()
    return was

def test_waits_in_vain():
    until(lambda: not first("wait"), "a second run", patience=0)

def test_process_is_late():
    if first("process"):
        subprocess.run([sys.executable, "-c", "import time; time.sleep(60)"], timeout=0.01)

@pytest.fixture
def board():
    if first("fixture"):
        raise Starved("the board is not ready")

def test_board_is_late(board):
    pass

def test_never_comes():
    raise Starved("it never comes")

def test_wrong_once():
    assert not first("wrong"), "another hash"

def test_raises_once():
    if first("raise"):
        raise TimeoutError("said by the program under test")

def test_wrong_after_a_wait():
    if first("late"):
        raise Starved("late")
    assert False, "another hash"
"""
STARVED = """
import pytest
from pathlib import Path
from tests.waiting import Starved

@pytest.mark.parametrize("number", range({count}))
def test_starved(number, request):
    flag = Path(__file__).with_name(f"{{number}}.flag")
    if not flag.exists():
        flag.touch()
        raise Starved("late")
"""
LEFT = """
import gc
import os
import subprocess
from pathlib import Path

import pytest

from tests.waiting import Starved

NOTE = Path(__file__).with_name("pid")

class Held:
    pass

@pytest.mark.parametrize("error", [Starved, ValueError])
def test_leaves_a_process(error):
    if error is Starved and NOTE.exists():
        return
    held = Held()
    held.itself = held  # only the collector of garbage finds it
    held.process = subprocess.Popen(["sleep", "600"], stdout=subprocess.PIPE)
    NOTE.write_text(str(held.process.pid))
    raise error("late")

def test_is_another():
    gc.collect()
    assert not Path("/proc", NOTE.read_text()).exists()
"""


def make_suite(pytester: pytest.Pytester, text: str) -> pytest.Pytester:
    """Make a suite with these tests, once as tests of a system and once as tests of the core."""
    here = pytester.mkpydir("tests")
    for name in ("repeat.py", "waiting.py"):
        shutil.copy(Path(__file__).parents[1] / name, here)
    (here / "conftest.py").write_text('pytest_plugins = ["tests.repeat"]\n')
    for folder in ("e2e", "unit"):
        (here / folder).mkdir()
        (here / folder / f"test_{folder}.py").write_text(text)
    pytester.makeini("[pytest]\npythonpath = .\naddopts = -p no:cacheprovider\n")
    return pytester


def test_only_a_named_lack_of_time_is_repeated(pytester: pytest.Pytester) -> None:
    result = make_suite(pytester, TESTS).runpytest_subprocess("tests/e2e", "-v")

    assert result.ret == 1
    assert result.parseoutcomes() == {"failed": 4, "repeated": 3}
    for name in ("waits_in_vain", "process_is_late", "board_is_late"):
        result.stdout.fnmatch_lines([f"REPEATED tests/e2e/test_e2e.py::test_{name} - first: *"])
    for name in ("never_comes", "wrong_once", "raises_once", "wrong_after_a_wait"):
        result.stdout.fnmatch_lines([f"*test_{name} FAILED*"])
    result.stdout.fnmatch_lines(["* - first: in vain for 0 s: a second run"])
    result.stdout.no_fnmatch_line("*may be: the machine*")


@pytest.mark.parametrize(("seconds", "looks"), [(30.0, 60), (0.5, 120)])
def test_a_machine_that_stood_still_is_no_wait_in_vain(
    monkeypatch: pytest.MonkeyPatch, seconds: float, looks: int
) -> None:
    monkeypatch.setattr(waiting.time, "monotonic", count(0.0, seconds).__next__)
    seen = count()
    with pytest.raises(waiting.Starved):
        waiting.until(lambda: next(seen) < 0, "nothing", 60.0, every=0.0)
    assert next(seen) == looks


def test_computers_that_are_late_are_not_skipped(monkeypatch: pytest.MonkeyPatch) -> None:
    def late(self: namespaces.Computers) -> None:
        raise subprocess.TimeoutExpired("ip", 60)

    monkeypatch.setattr(namespaces, "require", lambda program: program)
    monkeypatch.setattr(namespaces.Computers, "make", late)
    raised = (subprocess.TimeoutExpired, pytest.skip.Exception)
    with pytest.raises(raised) as found, namespaces.computers(1):
        pass
    assert found.type is subprocess.TimeoutExpired


def test_the_core_has_no_second_run(pytester: pytest.Pytester) -> None:
    suite = make_suite(pytester, TESTS)
    assert suite.runpytest_subprocess("tests/unit").parseoutcomes() == {"failed": 6, "errors": 1}


@pytest.mark.parametrize(("count", "code"), [(3, 0), (4, 1)])
@pytest.mark.parametrize("workers", [(), ("-n", "2")], ids=["alone", "workers"])
def test_more_than_three_repeats_fail_the_run(
    pytester: pytest.Pytester, count: int, code: int, workers: tuple[str, ...]
) -> None:
    suite = make_suite(pytester, STARVED.format(count=count))
    result = suite.runpytest_subprocess("tests/e2e", *workers)

    assert result.parseoutcomes() == {"repeated": count}
    assert result.ret == code
    told = f"{count} tests were repeated, 3 may be: *"
    if code:
        result.stdout.fnmatch_lines([told])
    else:
        result.stdout.no_fnmatch_line(told)


def test_no_later_test_is_blamed_for_what_a_failed_one_left(pytester: pytest.Pytester) -> None:
    suite = make_suite(pytester, LEFT)
    suite.makeini(
        "[pytest]\npythonpath = .\naddopts = -p no:cacheprovider\nfilterwarnings =\n"
        "    error::ResourceWarning\n    error::pytest.PytestUnraisableExceptionWarning\n"
    )
    first = suite.runpytest_subprocess("tests/e2e", "-k", "Starved or another")
    assert first.parseoutcomes() == {"repeated": 1, "passed": 1, "deselected": 1}
    second = suite.runpytest_subprocess("tests/e2e", "-k", "ValueError or another")
    assert second.parseoutcomes() == {"failed": 1, "passed": 1, "deselected": 1}
