"""The pytest plug-in: boards, chips, time and host programs as fixtures.

Importing it costs next to nothing: vbus itself is loaded by the first fixture that is used.
"""

import re
from collections.abc import Callable, Generator, Iterator, Sequence
from dataclasses import replace
from importlib.metadata import entry_points
from pathlib import Path
from traceback import walk_tb
from types import TracebackType
from typing import TYPE_CHECKING, Any

import pytest

if TYPE_CHECKING:
    from vbus.board.board import Board
    from vbus.testing.acceptance import Acceptances
    from vbus.testing.bench import Bench
    from vbus.testing.chips import ChipBench
    from vbus.testing.clock import BoardClock
    from vbus.testing.execute import Execute

PACKAGE = Path(__file__).parents[1]
BENCH: pytest.StashKey["Bench"] = pytest.StashKey()
FOLDER: pytest.StashKey[Path] = pytest.StashKey()
ACCEPTED: pytest.StashKey["Acceptances"] = pytest.StashKey()
DESELECTED: pytest.StashKey[list[pytest.Item]] = pytest.StashKey()
NEEDLESS: pytest.StashKey[list[str]] = pytest.StashKey()


def pytest_addoption(parser: pytest.Parser) -> None:
    """Add what can be said on the command line."""
    group = parser.getgroup("vbus", "virtual chips (vbus)")
    group.addoption(
        "--vbus-strict",
        action="store_true",
        help="bus cycles that break a datasheet are lost, and fail the test",
    )
    group.addoption(
        "--vbus-violations",
        choices=("fail", "report"),
        help="what a breach of a datasheet does to a test: fail it (the default), or be reported"
        " if it fails anyway",
    )
    group.addoption(
        "--vbus-seed", type=int, metavar="N", help="seed of boards that are given no other"
    )
    group.addoption(
        "--vbus-wave",
        choices=("never", "on-failure", "always"),
        default="never",
        help="of which tests to keep a waveform (VCD)",
    )
    group.addoption(
        "--vbus-dir",
        type=Path,
        metavar="DIR",
        help="where journals and waveforms are kept (pytest's temporary folder)",
    )


def pytest_configure(config: pytest.Config) -> None:
    """Declare the marker; refuse an option that cannot be met before the first test."""
    if config.getoption("--vbus-wave") != "never":
        try:
            import vcd  # noqa: F401
        except ImportError:
            raise pytest.UsageError(
                "--vbus-wave needs pyvcd; install it with: pip install pyvcd"
            ) from None
    config.addinivalue_line(
        "markers",
        "vbus(board, plant, clock, seed, rate, strict, accept, violations, after_fault): the board"
        " of a test: a board file's path, its text, or a part number; its seed; chip seconds per"
        " second, for real time; whether cycles that break a datasheet are lost; rules that may be"
        ' broken, each with the reason; whether violations "fail" the test or are a "report", and'
        " those after a fault",
    )


def _folder(item: pytest.Item, factory: pytest.TempPathFactory) -> Path:
    found = item.stash.get(FOLDER, None)
    if found is None:
        asked: Path | None = item.config.getoption("--vbus-dir")
        if asked is None:
            found = factory.mktemp("vbus")
        else:
            found = asked
            found.mkdir(parents=True, exist_ok=True)
        item.stash[FOLDER] = found
    return found


def _acceptances(session: pytest.Session) -> "Acceptances":
    """Return what is accepted in this run, read when a board is first asked for."""
    from vbus.errors import VbusError
    from vbus.testing.acceptance import Acceptances

    found = session.config.stash.get(ACCEPTED, None)
    if found is None:
        try:
            found = Acceptances(session.config)
            found.collect(session.items)
        except VbusError as error:
            raise pytest.UsageError(str(error)) from None
        left_out = session.config.stash.setdefault(DESELECTED, [])
        found.deselect(left_out)
        session.config.stash[ACCEPTED] = found
    return found


@pytest.fixture
def vbus_bench(
    request: pytest.FixtureRequest, tmp_path_factory: pytest.TempPathFactory
) -> "Iterator[Bench]":
    """Everything the plug-in keeps for this test; the other fixtures are made from it."""
    from vbus.errors import VbusError
    from vbus.testing.bench import Bench

    item = request.node
    keywords: dict[str, Any] = {}
    for mark in reversed(list(item.iter_markers("vbus"))):
        if len(mark.args) > 1:
            raise pytest.UsageError(f"{item.nodeid}: @pytest.mark.vbus takes one board")
        keywords |= {"board": mark.args[0]} if mark.args else {}
        keywords |= mark.kwargs
    keywords.pop("accept", None)
    option = item.config.getoption
    known = _acceptances(request.session)
    judge = replace(known.project, accepted=known.of(item.nodeid))
    if option("--vbus-violations"):
        judge = replace(judge, violations=option("--vbus-violations"))
    try:
        bench = Bench(
            item.nodeid,
            keywords,
            [item.path.parent, item.config.rootpath, Path.cwd()],
            lambda: _folder(item, tmp_path_factory),
            option("--vbus-seed"),
            option("--vbus-strict"),
            option("--vbus-wave"),
            judge,
        )
    except VbusError as error:
        raise pytest.UsageError(f"{item.nodeid}: @pytest.mark.vbus: {error}") from None
    item.stash[BENCH] = bench
    try:
        yield bench
    finally:
        bench.close()


@pytest.fixture
def vbus_board(vbus_bench: "Bench") -> "Board":
    """The board of ``@pytest.mark.vbus``; without a marker, an LM629 with a motor."""
    return vbus_bench.main().board


@pytest.fixture
def vbus_make_board(vbus_bench: "Bench") -> "Callable[..., Board]":
    """Further boards: ``vbus_make_board("MCP-1200", plant="ideal", seed=3)``."""
    return lambda board="", **keywords: vbus_bench.make(board, **keywords).board


@pytest.fixture
def vbus_clock(vbus_bench: "Bench") -> "BoardClock":
    """Time of the test's board: ``advance``, ``run_until``, ``freeze``, ``now``."""
    return vbus_bench.main().clock


@pytest.fixture
def vbus_exec(vbus_bench: "Bench") -> "Execute":
    """Run a host program on the test's board: ``vbus_exec("driver.c", "--home").code``."""
    from vbus.testing.execute import Execute

    return Execute(vbus_bench)


@pytest.fixture
def vbus_pty(vbus_bench: "Bench") -> str:
    """Path of a terminal on which the test's board is served, by a thread of its own."""
    return vbus_bench.terminal()


def _chip_fixture(name: str, start: str) -> object:
    """Return the fixture ``name`` of the family whose part numbers begin with ``start``."""

    def chip(vbus_bench: "Bench") -> "Iterator[ChipBench]":
        from vbus.testing.chips import chip_bench

        made = chip_bench(vbus_bench, start)
        try:
            yield made
        finally:
            made.bus.close()

    chip.__doc__ = f"The first {start} of the test's board, its host client and its clock."
    return pytest.fixture(name=name)(chip)


for _entry in sorted(entry_points(group="vbus.chips"), reverse=True):
    _name = f"vbus_{re.sub('[^a-z0-9]', '', _entry.name.lower())}"
    globals()[_name] = _chip_fixture(_name, _entry.name)


def pytest_deselected(items: Sequence[pytest.Item]) -> None:
    """Take note of tests that do not run."""
    if items:
        items[0].config.stash.setdefault(DESELECTED, []).extend(items)


@pytest.hookimpl(wrapper=True)
def pytest_runtest_call(item: pytest.Item) -> Generator[None, object, object]:
    """Fail a test whose host broke a datasheet, or whose fault or acceptance was not needed."""
    result = yield
    bench = item.stash.get(BENCH, None)
    accepted = item.config.stash.get(ACCEPTED, None)
    complaints = bench.complaints() if bench else []
    if accepted is not None and not complaints:
        complaints = accepted.needless_in(item.nodeid)
    if complaints:
        pytest.fail("\n".join(complaints), pytrace=False)
    return result


@pytest.hookimpl(wrapper=True)
def pytest_runtest_makereport(
    item: pytest.Item, call: pytest.CallInfo[None]
) -> Generator[None, pytest.TestReport, pytest.TestReport]:
    """Let the report of a failing test carry what its boards saw."""
    whole = item.config.getoption("fulltrace") or item.stash.get(BENCH, None) is None
    if call.excinfo is not None and not whole:
        call.excinfo = _cut_short(call.excinfo)
    report = yield
    accepted = item.config.stash.get(ACCEPTED, None)
    if accepted is not None and call.when == "call" and report.passed:
        accepted.passed(item.nodeid)
    bench = item.stash.get(BENCH, None)
    if bench is not None and report.failed and bench.boards and call.when != "teardown":
        failure = bench.failure_report()
        report.sections.append(("vbus", "\n".join(failure.lines)))
        report.user_properties += failure.properties
        item.user_properties += failure.properties
    return report


def _cut_short(found: pytest.ExceptionInfo[BaseException]) -> pytest.ExceptionInfo[BaseException]:
    """Leave only the test's own lines of a mistake that vbus has put in a sentence."""
    from vbus.errors import VbusError

    own = None
    for frame, line in reversed(list(walk_tb(found.tb))):
        if not Path(frame.f_code.co_filename).is_relative_to(PACKAGE):
            own = TracebackType(own, frame, frame.f_lasti, line)
    if own is None or not isinstance(found.value, VbusError | ValueError):
        return found
    return pytest.ExceptionInfo.from_exception(found.value.with_traceback(own))


# -- what was accepted in vain ------------------------------------------------------------------


@pytest.hookimpl(optionalhook=True)
def pytest_testnodedown(node: Any, error: object) -> None:
    """Take over what a worker of pytest-xdist has seen."""
    exported = getattr(node, "workeroutput", {}).get("vbus")
    if exported is not None:
        from vbus.testing.acceptance import Acceptances

        stash = node.config.stash
        if ACCEPTED not in stash:
            stash[ACCEPTED] = Acceptances(node.config)
        stash[ACCEPTED].merge(exported)


def pytest_sessionfinish(session: pytest.Session) -> None:
    """Fail a run in which a module or the project accepts what never happened."""
    config = session.config
    accepted = config.stash.get(ACCEPTED, None)
    if accepted is None:
        return
    if hasattr(config, "workeroutput"):
        config.workeroutput["vbus"] = accepted.export()
        return
    needless = accepted.needless(config)
    if needless and session.exitstatus == pytest.ExitCode.OK:
        session.exitstatus = pytest.ExitCode.TESTS_FAILED
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
