"""``tests/left_running.py``: a process that outlives its test."""

from pathlib import Path

import pytest

from tests import left_running

pytest_plugins = ["pytester"]

TESTS = """
import subprocess
import pytest

def start(seconds):
    return subprocess.Popen(["sleep", str(seconds)])

@pytest.fixture
def board():
    process = start(600)
    yield
    process.kill()
    process.wait()

def test_left(board):
    start(600)

def test_ended_and_not_waited_for():
    start(0)
    subprocess.run(["sleep", "0.2"])

def test_ends_when_the_test_is_over():
    start(0.5)

def test_stopped_by_its_fixture(board):
    pass

def test_wrong():
    start(600)
    assert False
"""


def test_a_process_that_outlives_its_test_fails_that_test(pytester: pytest.Pytester) -> None:
    pytester.makeini("[pytest]\npythonpath = .\naddopts = -p no:cacheprovider\n")
    pytester.makeconftest('pytest_plugins = ["left_running"]\n')
    text = Path(left_running.__file__).read_text()
    (pytester.path / "left_running.py").write_text(text.replace("ENDING = 30.0", "ENDING = 3.0"))
    pytester.makepyfile(TESTS)
    result = pytester.runpytest_subprocess("-v", "-W", "error::ResourceWarning")
    assert result.parseoutcomes() == {"passed": 4, "failed": 1, "errors": 1}
    assert "left running: [['sleep', '600']]" in result.outlines
