"""Which tests get a second run, and how it is told."""

import shutil
from pathlib import Path

import pytest

pytest_plugins = ["pytester"]

STARVED = """
from pathlib import Path

FLAG = Path(__file__).with_suffix(".flag")

def test_starved():
    first = not FLAG.exists()
    FLAG.touch()
    assert not first, "too late"

def test_broken():
    assert False
"""


@pytest.fixture
def suite(pytester: pytest.Pytester) -> pytest.Pytester:
    """A suite with a test that fails once and one that always fails, as system and as core."""
    shutil.copy(Path(__file__).parents[1] / "repeat.py", pytester.mkpydir("tests"))
    (pytester.path / "tests" / "conftest.py").write_text('pytest_plugins = ["tests.repeat"]\n')
    for folder in ("e2e", "unit"):
        (pytester.path / "tests" / folder).mkdir()
        (pytester.path / "tests" / folder / f"test_{folder}.py").write_text(STARVED)
    pytester.makeini("[pytest]\npythonpath = .\naddopts = -p no:cacheprovider\n")
    return pytester


def test_a_whole_system_that_was_starved_passes_the_second_time_and_is_named(
    suite: pytest.Pytester,
) -> None:
    result = suite.runpytest_subprocess("tests/e2e")

    assert result.ret == 1
    assert result.parseoutcomes() == {"failed": 1, "repeated": 1}
    result.stdout.fnmatch_lines(["REPEATED tests/e2e/test_e2e.py::test_starved - first: *"])


def test_the_core_has_no_second_run(suite: pytest.Pytester) -> None:
    assert suite.runpytest_subprocess("tests/unit").parseoutcomes() == {"failed": 2}
