"""What a run may leave out, and that it says so."""

import shutil
from pathlib import Path

import pytest

pytest_plugins = ["pytester"]

TESTS = """
import pytest
from vbus.compiled import core

def test_here(): pass

@pytest.mark.core(core())
def test_of_this_core(): pass

@pytest.mark.core("another")
def test_of_another_core(): assert False
"""
SKIPPED = """
import pytest

def test_lacks(): pytest.skip("needs a lathe")
"""


@pytest.fixture
def suite(pytester: pytest.Pytester) -> pytest.Pytester:
    shutil.copy(Path(__file__).parents[1] / "left_out.py", pytester.mkpydir("tests"))
    (pytester.path / "conftest.py").write_text('pytest_plugins = ["tests.left_out"]\n')
    pytester.makeini(
        "[pytest]\npythonpath = .\naddopts = -p no:cacheprovider\nmarkers = core: of a core\n"
    )
    return pytester


def test_a_test_of_the_other_core_is_not_chosen(suite: pytest.Pytester) -> None:
    suite.makepyfile(TESTS)
    assert suite.runpytest_subprocess().parseoutcomes() == {"passed": 2, "deselected": 1}


@pytest.mark.parametrize("workers", [(), ("-n", "1")], ids=["alone", "workers"])
@pytest.mark.parametrize("required", ["0", "1"])
def test_a_skip_fails_the_run_where_nothing_may_be_lacking(
    suite: pytest.Pytester,
    monkeypatch: pytest.MonkeyPatch,
    required: str,
    workers: tuple[str, ...],
) -> None:
    monkeypatch.setenv("VBUS_REQUIRE_ALL", required)
    suite.makepyfile(SKIPPED)
    result = suite.runpytest_subprocess(*workers)
    assert result.ret == int(required)
    assert result.parseoutcomes() == {"skipped": 1}
    if required == "1":
        result.stdout.fnmatch_lines(["*::test_lacks: Skipped: needs a lathe"])
