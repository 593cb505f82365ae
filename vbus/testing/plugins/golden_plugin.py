"""The part of the pytest plug-in that keeps goldens: the fixture, its option, files of no test."""

import re
from collections.abc import Generator
from pathlib import Path
from typing import TYPE_CHECKING, Final

import pytest

from vbus.testing.plugins.acceptance_plugin import fail_run
from vbus.testing.plugins.workers import handed_over, is_worker
from vbus.testing.plugins.worlds_plugin import SEARCHING

if TYPE_CHECKING:
    from vbus.testing.bench import Bench

ASKED: pytest.StashKey["Golden"] = pytest.StashKey()
LEFT_OVER: pytest.StashKey[set[str]] = handed_over("goldens left over")
WRITTEN: pytest.StashKey[set[str]] = handed_over("goldens written")
SUFFIX: Final = ".golden"
_LONGEST: Final = 100
"""Characters of a test's name that are used."""


class Golden:
    """What a test is compared with when it has passed.

    Args:
        item: the test.
        bench: its boards.
    """

    def __init__(self, item: pytest.Item, bench: "Bench") -> None:
        self.path: Path = golden_of(item)
        """The file."""
        self._item = item
        self._bench = bench

    def compare(self) -> str:
        """Compare the run of the test with it, or write it; return why the test fails, or ""."""
        from vbus.testing.plugins.golden import judge

        tested = self._bench.begun
        if tested is None:
            return "vbus_golden: the test has no board; take a chip's fixture, or vbus_board"
        config = self._item.config
        update = config.getoption("--vbus-golden") == "update"
        complaint = judge(tested, self._item.nodeid, self.path, self._bench.judge.tolerance, update)
        if update:
            config.stash.setdefault(WRITTEN, set()).add(str(self.path))
        return complaint


def golden_of(item: pytest.Item) -> Path:
    """Return the file of a test's golden: beside its module, in a folder of the same name."""
    test = item.nodeid.partition("::")[2]
    name = test.replace("::", ".")
    plain = re.sub(r"[^\w\[\].=+-]", "_", name)[:_LONGEST]
    if plain != name:
        from hashlib import sha256

        plain += f"-{sha256(test.encode()).hexdigest()[:8]}"
    return item.path.with_suffix("") / f"{plain}{SUFFIX}"


def pytest_addoption(parser: pytest.Parser) -> None:
    """Add what can be said on the command line."""
    parser.getgroup("vbus").addoption(
        "--vbus-golden",
        choices=("check", "update"),
        default="check",
        help="compare tests that use vbus_golden with their goldens, or write those anew",
    )


@pytest.fixture
def vbus_golden(request: pytest.FixtureRequest, vbus_bench: "Bench") -> Golden:
    """Compare what happens on the test's board with its golden, when the test has passed."""
    asked = request.node.stash[ASKED] = Golden(request.node, vbus_bench)
    return asked


@pytest.hookimpl(wrapper=True, tryfirst=True)
def pytest_runtest_call(item: pytest.Item) -> Generator[None, object, object]:
    """Fail a test that has passed with another run than its golden has.

    A run in a broken world of a campaign is not compared: it is to differ.
    """
    result = yield
    asked = item.stash.get(ASKED, None)
    if asked is None and any("golden" in mark.kwargs for mark in item.own_markers):
        pytest.fail(
            "its mark says golden=..., and the test takes no vbus_golden: nothing is compared",
            pytrace=False,
        )
    if asked is not None and not item.stash.get(SEARCHING, False):
        from vbus.core.errors import VbusError

        try:
            complaint = asked.compare()
        except VbusError as error:
            complaint = str(error)
        if complaint:
            pytest.fail(complaint, pytrace=False)
    return result


# -- goldens of no test -------------------------------------------------------------------------


@pytest.hookimpl(tryfirst=True)
def pytest_collection_modifyitems(config: pytest.Config, items: list[pytest.Item]) -> None:
    """Look for goldens that no test uses any more, before any test is left out."""
    if any("::" in argument for argument in config.args) or config.getoption("lf", False):
        return
    folders = {item.path.parent for item in items}
    found = {file for folder in folders for file in folder.glob(f"*/*{SUFFIX}")}
    if not found:
        return
    modules = {item.path for item in items}
    used = {golden_of(item) for item in items if "vbus_golden" in getattr(item, "fixturenames", ())}
    config.stash[LEFT_OVER] = {
        str(file)
        for file in found - used
        if (module := file.parent.with_suffix(".py")) in modules or not module.exists()
    }


def pytest_sessionfinish(session: pytest.Session) -> None:
    """Fail a run that leaves goldens of no test, or take them away."""
    config = session.config
    left_over = config.stash.setdefault(LEFT_OVER, set())
    if is_worker(config):
        return
    if config.getoption("--vbus-golden") == "update":
        for file in left_over:
            Path(file).unlink(missing_ok=True)
    elif left_over:
        fail_run(session)


def pytest_terminal_summary(
    terminalreporter: pytest.TerminalReporter, config: pytest.Config
) -> None:
    """Name the goldens that were written, and those of no test."""
    written = config.stash.get(WRITTEN, None)
    if written:
        terminalreporter.section("vbus: goldens written")
        for file in sorted(written):
            terminalreporter.line(file)
    left_over = config.stash.setdefault(LEFT_OVER, set())
    if not left_over:
        return
    update = config.getoption("--vbus-golden") == "update"
    terminalreporter.section("vbus: goldens that no test uses", red=not update)
    done = "removed" if update else "--vbus-golden=update removes it"
    for file in sorted(left_over):
        terminalreporter.line(f"{file}: {done}")
