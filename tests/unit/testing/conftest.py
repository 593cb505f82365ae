"""A suite of its own, which uses the plug-in."""

import pytest

BOARD = """
[board]
name = "bench"

[chips.x]
part = "LM629N-8"
clock = "8 MHz"
plant = "motor"

[plants.motor]
model = "dc_motor"
"""


@pytest.fixture
def suite(pytester: pytest.Pytester, monkeypatch: pytest.MonkeyPatch) -> pytest.Pytester:
    monkeypatch.setenv("PYTEST_ADDOPTS", "-p no:hypothesispytest")  # it takes long to import
    pytester.makeini(
        "[pytest]\nfilterwarnings =\n    error\n"
        # Under coverage and in mutants, which run without rewritten assertions.
        "    ignore:Module already imported:pytest.PytestAssertRewriteWarning\n"
        "asyncio_mode = strict\n"
        "asyncio_default_fixture_loop_scope = function\n"
    )
    pytester.makefile(".toml", board=BOARD)
    return pytester
