"""The pytest plug-in: boards, chips, time and host programs as fixtures.

Importing it costs next to nothing: vbus itself is loaded by the first fixture that is used.
"""

import re
from collections.abc import Callable, Generator, Iterator
from contextlib import contextmanager
from dataclasses import replace
from pathlib import Path
from traceback import walk_tb
from types import TracebackType
from typing import TYPE_CHECKING, Any, Final

import pytest

from vbus.core.entry_points import installed
from vbus.testing.plugins.acceptance_plugin import acceptances, fail_run, finished
from vbus.testing.plugins.workers import handed_over, is_worker
from vbus.testing.plugins.worlds_plugin import LIMITS, SEARCHING, WORLD, world_run

if TYPE_CHECKING:
    from vbus.board.board import Board
    from vbus.testing.bench import Bench
    from vbus.testing.checks.around_chip import ChipBench
    from vbus.testing.clock import BoardClock
    from vbus.testing.execute import Execute
    from vbus.testing.machine import TestedMachine
    from vbus.testing.plugins.suite_coverage import SuiteCoverage
    from vbus.testing.triggers import Triggers

pytest_plugins = (
    "vbus.testing.plugins.acceptance_plugin",
    "vbus.testing.plugins.golden_plugin",
    "vbus.testing.plugins.workers",
    "vbus.testing.plugins.worlds_plugin",
)
BENCH: pytest.StashKey["Bench"] = pytest.StashKey()
FOLDER: pytest.StashKey[Path] = pytest.StashKey()
CALLED: pytest.StashKey[bool] = pytest.StashKey()
"""Whether a test has passed, as far as its call."""
COVERAGE: pytest.StashKey["SuiteCoverage"] = handed_over("coverage")
SHORT: pytest.StashKey[str] = pytest.StashKey()
NOTES: pytest.StashKey[list[tuple[str, str]]] = pytest.StashKey()
"""What is noted of a test that has passed."""
_PACKAGE: Final = Path(__file__).parents[2]
_RUNNERS: Final = ("_pytest", "pluggy", "pytest_asyncio")
"""Packages whose lines say nothing of a user's mistake."""


_OPTIONS: Final[dict[str, dict[str, Any]]] = {
    "strict": {"action": "store_true",
        "help": "bus cycles that break a datasheet are lost, and fail the test"},
    "violations": {"choices": ("fail", "report"),
        "help": "what a breach of a datasheet does to a test: fail it (the default), or be reported"
        " if it fails anyway"},
    "seed": {"type": int, "metavar": "N", "help": "seed of boards that are given no other"},
    "wave": {"choices": ("never", "on-failure", "always"), "default": "never",
        "help": "of which tests to keep a waveform (VCD)"},
    "scope": {"choices": ("never", "on-failure"), "default": "on-failure",
        "help": "of which tests to keep a page for a browser (HTML)"},
    "dir": {"type": Path, "metavar": "DIR",
        "help": "where journals, pages and waveforms are written (pytest's temporary folder)"},
    "github": {"action": "store_true",
        "help": "annotate failing tests for GitHub, and add to the summary of the job"},
    "coverage": {"action": "append", "nargs": "?", "const": "", "metavar": "FILE",
        "help": "tell what the tests exercise of the chips; the file ends in .txt, .json, .html or"
        " .xml (Cobertura); several may be given"},
    "coverage-fail-under": {"type": float, "default": 0.0, "metavar": "PERCENT",
        "help": "fail if less than this is exercised"},
    "coverage-base": {"default": "", "metavar": "FILE",
        "help": "tell what is exercised more or less than in this coverage file (.json)"},
}  # fmt: skip
"""What can be said on the command line, behind ``--vbus-``."""


def pytest_addoption(parser: pytest.Parser) -> None:
    """Add what can be said on the command line."""
    group = parser.getgroup("vbus", "virtual chips (vbus)")
    for name, given in _OPTIONS.items():
        group.addoption(f"--vbus-{name}", **given)


def _wants_coverage(config: pytest.Config) -> bool:
    return any(config.getoption(f"--vbus-{name}") for name in _OPTIONS if "coverage" in name)


def pytest_configure(config: pytest.Config) -> None:
    """Declare the marker; refuse an option that cannot be met before the first test."""
    if config.getoption("--vbus-wave") != "never":
        from vbus.core.errors import import_errors

        with import_errors("--vbus-wave needs pyvcd", "pyvcd", pytest.UsageError):
            import vcd  # noqa: F401
    if _wants_coverage(config):
        from vbus.testing.plugins.suite_coverage import asked_for

        config.stash[COVERAGE] = asked_for(config)
    config.addinivalue_line(
        "markers",
        "vbus(board, plant, clock, seed, rate, strict, accept, violations, after_fault, budget,"
        " golden):"
        " the board of a test: a board file's path, its text, or a part number; its seed; chip"
        " seconds per second, for real time; whether cycles that break a datasheet are lost; rules"
        ' that may be broken, each with the reason; whether violations "fail" the test or are a'
        ' "report", and those after a fault; the bus cycles, chip time and polls in vain that end'
        " it",
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


@pytest.fixture
def vbus_bench(
    request: pytest.FixtureRequest,
    tmp_path_factory: pytest.TempPathFactory,
    vbus_variant: "dict[str, Any]",
) -> "Iterator[Bench]":
    """Everything the plug-in keeps for this test; the other fixtures are made from it."""
    from vbus.campaign.world import REFERENCE
    from vbus.core.errors import VbusError
    from vbus.testing.bench import Bench
    from vbus.testing.boards import Variant

    item = request.node
    keywords: dict[str, Any] = {}
    for mark in reversed(list(item.iter_markers("vbus"))):
        if len(mark.args) > 1:
            raise pytest.UsageError(f"{item.nodeid}: @pytest.mark.vbus takes one board")
        keywords |= {"board": mark.args[0]} if mark.args else {}
        keywords |= mark.kwargs
    keywords.pop("accept", None)
    option = item.config.getoption
    known = acceptances(request.session)
    judge = replace(known.project, accepted=known.of(item.nodeid))
    if option("--vbus-violations"):
        judge = replace(judge, violations=option("--vbus-violations"))
    try:
        bench = Bench(
            item.nodeid,
            keywords,
            dict.fromkeys([item.path.parent, item.config.rootpath, Path.cwd()]),
            lambda: _folder(item, tmp_path_factory),
            option("--vbus-seed"),
            option("--vbus-strict"),
            option("--vbus-wave"),
            judge,
            COVERAGE in item.config.stash,
            Variant(**vbus_variant, world=item.stash.get(WORLD, REFERENCE)),
            scope=option("--vbus-scope") != "never",
            chips=[CHIPS[name] for name in item.fixturenames if name in CHIPS],
            witnessed=item.stash.get(SEARCHING, False),
        )
    except VbusError as error:
        message = f"{item.nodeid}: @pytest.mark.vbus: {error}"
        raise pytest.fail.Exception(message, pytrace=False) from None
    if LIMITS in item.stash:
        bench.limit(*item.stash[LIMITS])
    item.stash[BENCH] = bench
    try:
        yield bench
    finally:
        bench.close()
        world_run(item, bench)
        if COVERAGE in item.config.stash:
            item.config.stash[COVERAGE].add(item.nodeid, bench.coverages())


@pytest.fixture
def vbus_board(vbus_bench: "Bench") -> "Board":
    """The board of ``@pytest.mark.vbus``; without a marker, an LM629 with a motor."""
    return vbus_bench.main().board


@pytest.fixture
def vbus_machine(vbus_bench: "Bench") -> "TestedMachine":
    """The machine of ``@pytest.mark.vbus``: a board with nodes, all of them in this process."""
    return vbus_bench.machine()


@pytest.fixture
def vbus_make_board(vbus_bench: "Bench") -> "Callable[..., Board]":
    """Further boards: ``vbus_make_board("MCP-1200", plant="ideal", seed=3)``."""
    return lambda board="", **keywords: vbus_bench.make(board, **keywords).board


@pytest.fixture
def vbus_clock(vbus_bench: "Bench") -> "BoardClock":
    """Time of the test's board: ``advance``, ``run_until``, ``freeze``, ``now``."""
    return vbus_bench.main().clock


@pytest.fixture
def vbus_async(vbus_bench: "Bench") -> "Triggers":
    """What a coroutine can wait for on the test's board: ``edge``, ``packet`` and ``at``."""
    from vbus.testing.triggers import Triggers

    return Triggers(vbus_bench.main())


@pytest.fixture
def vbus_exec(vbus_bench: "Bench") -> "Execute":
    """Run a host program on the test's board: ``vbus_exec("driver.c", "--home").code``."""
    from vbus.testing.execute import Execute

    return Execute(vbus_bench)


@pytest.fixture
def vbus_pty(vbus_bench: "Bench") -> str:
    """Path of a terminal on which the test's board is served, by a thread of its own."""
    return vbus_bench.terminal()


CHIPS: dict[str, str] = {}
"""How the part numbers of each chip's fixture begin."""


def _chip_fixture(name: str, start: str) -> object:
    """Return the fixture ``name`` of the family whose part numbers begin with ``start``."""

    def chip(vbus_bench: "Bench") -> "Iterator[ChipBench]":
        made = vbus_bench.chip(start)
        try:
            yield made
        finally:
            made.bus.close()

    chip.__doc__ = f"The first {start} of the test's board, its host client and its clock."
    return pytest.fixture(name=name)(chip)


# As installers write them: who does not use vbus pays for no package's metadata.
for _start in sorted((one.name for one in installed() if one.group == "vbus.chips"), reverse=True):
    _name = f"vbus_{re.sub('[^a-z0-9]', '', _start.lower())}"
    CHIPS[_name] = _start
    globals()[_name] = _chip_fixture(_name, _start)


@contextmanager
def _running(item: pytest.Item) -> Iterator[None]:
    """Let hosts that hang be interrupted for the length of the block, and not afterwards."""
    bench = item.stash.get(BENCH, None)
    try:
        if bench is not None:
            bench.let_interrupt(True)
        yield
    finally:
        bench = item.stash.get(BENCH, None)
        if bench is not None:
            bench.let_interrupt(False)


@pytest.hookimpl(wrapper=True)
def pytest_runtest_setup(item: pytest.Item) -> Generator[None, object, object]:
    """Interrupt hosts of fixtures that hang."""
    with _running(item):
        return (yield)


@pytest.hookimpl(wrapper=True)
def pytest_runtest_teardown(item: pytest.Item) -> Generator[None, object, object]:
    """Let hosts that hung end in order, if they do so soon; judge what drivers do at their end.

    A test has passed, and has or has not needed what it accepts, when this is over.
    """
    bench = item.stash.get(BENCH, None)
    if bench is not None:
        bench.relent()
    with _running(item):
        result = yield
    complaints = bench.late_complaints(NOTES in item.stash) if bench else []
    counts = item.stash.get(CALLED, False) and not item.stash.get(SEARCHING, False)
    complaints = complaints or finished(item, counts)
    if complaints:
        pytest.fail("\n".join(complaints), pytrace=False)
    return result


@pytest.hookimpl(wrapper=True)
def pytest_runtest_call(item: pytest.Item) -> Generator[None, object, object]:
    """Fail a test whose host broke a datasheet, or whose fault was not needed."""
    with _running(item):
        result = yield
    bench = item.stash.get(BENCH, None)
    complaints = bench.complaints() if bench else []
    if complaints:
        pytest.fail("\n".join(complaints), pytrace=False)
    if bench is not None:
        item.stash[NOTES] = bench.notes()
    return result


def _cut_short(found: pytest.ExceptionInfo[BaseException]) -> pytest.ExceptionInfo[BaseException]:
    """Leave only the test's own lines of a mistake that vbus has put in a sentence.

    In a fixture of vbus no line is the test's: then the sentence stands alone.
    """
    from vbus.core.errors import VbusError
    from vbus.testing.limits import HostStuck

    own = None
    for frame, line in reversed(list(walk_tb(found.tb))):
        of_pytest = frame.f_globals.get("__name__", "").partition(".")[0] in _RUNNERS
        if not of_pytest and not Path(frame.f_code.co_filename).is_relative_to(_PACKAGE):
            own = TracebackType(own, frame, frame.f_lasti, line)
    if not isinstance(found.value, VbusError | ValueError | HostStuck):
        return found
    if own is None:
        failure = pytest.fail.Exception(f"{type(found.value).__name__}: {found.value}", False)
        return pytest.ExceptionInfo.from_exception(failure.with_traceback(found.tb))
    return pytest.ExceptionInfo.from_exception(found.value.with_traceback(own))


@pytest.hookimpl(wrapper=True)
def pytest_runtest_makereport(
    item: pytest.Item, call: pytest.CallInfo[None]
) -> Generator[None, pytest.TestReport, pytest.TestReport]:
    """Let the report of a failing test carry what its boards saw."""
    whole = item.config.getoption("fulltrace") or item.stash.get(BENCH, None) is None
    if call.excinfo is not None and not whole:
        call.excinfo = _cut_short(call.excinfo)
    report = yield
    if call.when == "call" and report.passed:
        report.__dict__["vbus_notes"] = item.stash.get(NOTES, [])
    if call.when != "teardown":
        item.stash[CALLED] = call.when == "call" and report.passed
    bench = item.stash.get(BENCH, None)
    shown = report.failed and not item.stash.get(SEARCHING, False)
    if bench is not None and bench.boards and shown and not bench.reported:
        failure = bench.failure_report()
        report.sections.append(("vbus", "\n".join(failure.lines)))
        report.user_properties += failure.properties
        item.user_properties += failure.properties
    return report


def pytest_sessionfinish(session: pytest.Session) -> None:
    """Write what was exercised; fail a run that exercises too little."""
    config = session.config
    coverage = config.stash.get(COVERAGE, None)
    if coverage is None or is_worker(config):
        return
    from vbus.core.errors import VbusError

    try:
        config.stash[SHORT] = coverage.finish()
    except VbusError as error:
        config.stash[SHORT] = str(error)
    if config.stash[SHORT]:
        fail_run(session)


def pytest_terminal_summary(
    terminalreporter: pytest.TerminalReporter, config: pytest.Config
) -> None:
    """Say what was noted of tests that passed, and what was exercised."""
    coverage = config.stash.get(COVERAGE, None)
    short = config.stash.get(SHORT, "")
    noted: dict[str, list[str]] = {}
    for report in terminalreporter.stats.get("passed", []):
        for rule, text in dict(getattr(report, "vbus_notes", [])).items():
            noted.setdefault(rule, []).append(f"{report.nodeid}: {text}")
    if noted:
        terminalreporter.section("vbus notes of tests that passed")
        for rule, texts in sorted(noted.items()):
            tests = "1 test" if len(texts) == 1 else f"{len(texts)} tests, first"
            terminalreporter.line(f"{rule} in {tests} {texts[0]}")
    if coverage is not None:
        terminalreporter.section("vbus coverage")
        for line in coverage.lines():
            terminalreporter.line(line)
        if short:
            terminalreporter.line(short, red=True)
    if config.getoption("--vbus-github"):
        from vbus.testing.plugins import github

        more = [] if coverage is None else [*coverage.lines(short=True), short]
        github.write(terminalreporter, config.rootpath, more)
