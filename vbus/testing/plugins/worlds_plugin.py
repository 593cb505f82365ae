"""The part of the pytest plug-in that runs one test in many worlds: parts, specimens, campaigns."""

import os
import shlex
import sys
from collections import Counter
from collections.abc import Collection, Iterator
from contextlib import ExitStack, closing, suppress
from functools import cache, partial
from hashlib import sha256
from itertools import islice, product
from math import ceil, inf
from pathlib import Path
from typing import TYPE_CHECKING, Any, Final, cast

import pytest
from _pytest.runner import runtestprotocol

from vbus.testing.plugins.acceptance_plugin import fail_run
from vbus.testing.plugins.workers import handed_over, is_worker

if TYPE_CHECKING:
    from vbus.boardfile.sections import BoardFile
    from vbus.boardfile.source import Source
    from vbus.campaign.account import Account
    from vbus.campaign.plan import PlannedWorld, WorldPlan
    from vbus.campaign.report import Saved
    from vbus.campaign.verdict import Campaign, Result
    from vbus.campaign.world import World
    from vbus.serve.output_file import OutputFile
    from vbus.testing.bench import Bench

WORLD: pytest.StashKey["World"] = pytest.StashKey()
"""The world in which the test runs now."""
SEARCHING: pytest.StashKey[bool] = pytest.StashKey()
"""Whether it runs to find out what comes of it there; its last run is what counts."""
END: pytest.StashKey[float] = pytest.StashKey()
"""Instant of the wall clock at which the time of all campaigns is over."""
SKIPPED: pytest.StashKey[bool] = pytest.StashKey()
"""Whether the test was skipped in its last run."""
RUN: pytest.StashKey["tuple[BoardFile, Source, Account | None, list[Path]]"] = pytest.StashKey()
"""The board that the test ran on, what became of it, and the files that the test named."""
LIMITS: pytest.StashKey["tuple[int, int]"] = pytest.StashKey()
"""Chip time (ps) and bus cycles that it may take in a world of a campaign."""
TALLY: pytest.StashKey["Tally"] = handed_over("worlds")
FILES: pytest.StashKey["dict[str, OutputFile]"] = pytest.StashKey()
"""Files of a campaign, by what they are."""
BEFORE: pytest.StashKey["Saved"] = pytest.StashKey()
"""What the file of results has of an earlier campaign."""
KNOWN: pytest.StashKey["Collection[tuple[str, str, str]]"] = pytest.StashKey()
"""Silent outcomes of the baseline, if there is one."""
PROJECT: pytest.StashKey[str] = pytest.StashKey()
"""Digest of the project's files in Python that are loaded when all tests are known."""
_KINDS: Final = {"json": "JSON, and go on from what FILE has", "junit": "JUnit",
                 "page": "a page for a browser"}  # fmt: skip
_OPTIONS: Final[dict[str, dict[str, Any]]] = {
    **{kind: {"metavar": "FILE", "help": f"write what came of the campaign: {what}"}
       for kind, what in _KINDS.items()},
    "baseline": {"metavar": "FILE",
        "help": "a file of --vbus-campaign-json: fail for a silent outcome that it has not"},
    "only": {"metavar": "DIMENSION,...", "help": "try these dimensions alone"},
    "phases": {"type": int, "metavar": "N", "help": "how many places in a sample (16)"},
    "seed": {"type": int, "metavar": "N", "help": "which of a group come first (0)"},
    "all": {"action": "store_true", "help": "tell every outcome, not 20"},
}  # fmt: skip
"""What ``vbus campaign`` takes, too, behind ``--vbus-campaign-``."""
_USUAL: Final = 100
"""Worlds of each test, where nothing is said; not measured."""
_MOST: Final = 20
"""Silent outcomes that the summary tells."""
_LISTS: Final = ("part", "clock", "time", "seed")
_TIMES: Final = ("lockstep", "slaved")


class Tally:
    """The worlds that a run of pytest has seen.

    Attributes:
        tests: of each test that has a board, the worlds in which it has run.
        worlds: of campaigns, those that have results.
        digests: of each test that has a campaign.
        results: what came of its worlds, by name.
        left: of each dimension and way, how many worlds were not tried.
        refused: by test, dimensions that do not apply to its board, with the reason.
        passed: tests of which no campaign can be made, with the reason.
        replays: what came of tests in the world of ``--vbus-world``.
    """

    def __init__(self) -> None:
        self.tests: dict[str, set[str]] = {}
        self.worlds: list[PlannedWorld] = []
        self.digests: dict[str, str] = {}
        self.results: dict[str, Result] = {}
        self.left: Counter[tuple[str, str]] = Counter()
        self.refused: dict[str, dict[str, str]] = {}
        self.passed: dict[str, str] = {}
        self.replays: list[str] = []

    def update(self, other: "Tally") -> None:
        """Take over what a worker of pytest-xdist has seen."""
        for name, value in vars(self).items():
            more = getattr(other, name)
            value.extend(more) if isinstance(value, list) else value.update(more)

    def add_campaign(self, test: str, plan: "WorldPlan", saved: "Saved") -> None:
        """Take the campaign of one test: its groups have the name of the test before them."""
        from msgspec.structs import replace

        from vbus.campaign.verdict import Campaign

        made = Campaign(plan, saved.results)
        if not made.tried:
            late = "its time was over after the reference runs"
            self.passed[test] = late if plan.worlds else "nothing that it is to try applies"
        for one in made.tried:
            self.tests.setdefault(test, set()).add(str(one.planned.world))
            group = f"{test}: {one.planned.group}"
            self.worlds.append(replace(one.planned, group=group))
            self.results[one.planned.name] = one.result
        for total in made.totals():
            self.left[total.dimension, total.way] += total.left
        self.refused[test] = plan.refused
        self.digests[test] = saved.digests[test]

    def campaign(self) -> "Campaign":
        """Return the campaigns of all tests as one."""
        from vbus.campaign.plan import WorldPlan
        from vbus.campaign.verdict import Campaign

        worlds = sorted(self.worlds, key=lambda one: one.test)
        refused = {}
        for test, reasons in sorted(self.refused.items()):
            for what, why in reasons.items():
                of_all = all(what in others for others in self.refused.values())
                refused[what if of_all else f"{test}: {what}"] = why
        return Campaign(WorldPlan(worlds, self.left, refused | self.passed), self.results)

    @property
    def in_vain(self) -> bool:
        """Whether there were campaigns, and not one has tried a world."""
        return bool(self.digests) and not self.results

    def lines(self, config: pytest.Config) -> Iterator[str]:
        """Say in one line how many worlds there were; of a campaign, what was silent, too."""
        runs, tests = sum(map(len, self.tests.values())), len(self.tests)
        seen = f"vbus: {tests} test{'s' * (tests != 1)} in {runs} world{'s' * (runs != 1)}"
        yield from self.replays
        if not self.digests and not self.passed:
            yield seen if self.tests else "vbus: no campaign: no test here has a board"
            return
        from vbus.campaign.report import outcomes, shown
        from vbus.campaign.verdict import VERDICTS, WayTotal

        verdicts = Counter(result.verdict for result in self.results.values())
        share = shown(WayTotal("", "", verdicts, 0).coverage)
        counts = ", ".join(f"{verdicts[one]} {one.replace(',', '')}" for one in VERDICTS)
        yield f"{seen}: {counts}; diagnostic coverage {share}; {self.left.total()} not tried"
        for test, why in self.passed.items():
            yield f"  {test}: no campaign: {why}"
        if self.in_vain:
            yield "  no world was tried at all, which fails the run"
        everything = "--vbus-campaign-all tells them"
        known, most = config.stash.get(KNOWN, None), None if _option(config, "all") else _MOST
        for line in outcomes(self.campaign(), known, _line, most, everything):
            yield f"  {line}"

    def saved(self, config: pytest.Config) -> "Saved":
        """Return all results: those of this run, and those that the file has of other tests."""
        saved = config.stash[BEFORE]
        for test, digest in self.digests.items():
            saved.of(digest, test)
        saved.results |= self.results
        return saved

    def write(self, config: pytest.Config) -> None:
        """Write what came of all campaigns, as ``vbus campaign`` does."""
        from vbus.campaign import report

        made = self.campaign()
        new = made.new(config.stash.get(KNOWN, ()))
        subject = shlex.join(["pytest", *config.invocation_params.args])
        into = {kind: file.write for kind, file in config.stash[FILES].items()}
        report.write(made, self.saved(config), new, subject, _line, into)


def _line(one: "PlannedWorld") -> str:
    return f"pytest {shlex.quote(one.test)} --vbus-world={shlex.quote(str(one.world))}"


def pytest_addoption(parser: pytest.Parser) -> None:
    """Add what can be said on the command line."""
    group = parser.getgroup("vbus")
    group.addoption(
        "--vbus-campaign",
        nargs="?",
        const=str(_USUAL),
        metavar="N|TIME",
        help=f"run each test in N worlds, in each of which one thing is broken ({_USUAL}), or all"
        " of them for so long, such as 5m",
    )
    for name, given in _OPTIONS.items():
        group.addoption(f"--vbus-campaign-{name}", **given)
    group.addoption(
        "--vbus-world", metavar="WORLD", help="run the tests in one world, as a campaign names it"
    )


def _asked(config: pytest.Config) -> tuple[int | None, float | None] | None:
    """Return the number of worlds of each test, or the seconds for all; None: no campaign."""
    text = config.getoption("--vbus-campaign")
    if text is None:
        return None
    from vbus.core.kernel import SECOND
    from vbus.protocols.quantities import WALL_UNITS, parse_duration

    with suppress(ValueError):
        return None, parse_duration(text, WALL_UNITS) / SECOND
    if not text.isdecimal() or not int(text):
        raise pytest.UsageError(
            f"--vbus-campaign={text}: write a number of worlds, such as 100, or a time, such as 5m"
        )
    return int(text), None


def _option(config: pytest.Config, name: str) -> Any:
    return config.getoption(f"--vbus-campaign-{name}")


def _prepare(config: pytest.Config) -> None:
    """Read what a campaign goes on from; open its files before its first run.

    Workers of pytest-xdist write none.

    Raises:
        ValueError: an option cannot be honoured.
        VbusError: a file cannot be read or written, or is of another kind.
    """
    from vbus.campaign.report import FILES as KINDS
    from vbus.campaign.report import Saved, check_files, read_baseline, read_saved
    from vbus.campaign.world import NO_TURNS, PHASE, THREADS, read_dimensions, read_world
    from vbus.core.errors import value_errors
    from vbus.serve.output_file import OutputFile

    if config.getoption("--vbus-world"):
        if _asked(config) is not None:
            raise ValueError("--vbus-world is one world, and --vbus-campaign is many")
        with value_errors(ValueError, "--vbus-world: "):
            read_world(config.getoption("--vbus-world"))
    given = [name for name in _OPTIONS if _option(config, name) not in (None, False)]
    if given and _asked(config) is None:
        raise ValueError(f"--vbus-campaign-{given[0]} goes with --vbus-campaign")
    only, phases, seed = (_option(config, name) for name in ("only", "phases", "seed"))
    if THREADS in read_dimensions(only) and only is not None:
        raise ValueError(f"--vbus-campaign-only={only}: {NO_TURNS}")
    if (phases is not None and not 2 <= phases <= 4096) or (seed is not None and seed < 0):
        raise ValueError("--vbus-campaign-phases is 2 to 4096, --vbus-campaign-seed 0 or more")
    json, baseline = (_option(config, name) for name in ("json", "baseline"))
    tests = [name.partition("::")[0] for name in config.args]
    check_files([_option(config, kind) for kind in KINDS], [baseline, *tests])
    if phases is not None and PHASE not in read_dimensions(only):
        raise ValueError("--vbus-campaign-phases goes with the dimension phase")
    if baseline:
        config.stash[KNOWN] = read_baseline(baseline)
    config.stash[BEFORE] = read_saved(json) if json else Saved()
    if is_worker(config):
        return
    with ExitStack() as stack:
        for kind in KINDS:
            if _option(config, kind):
                file = stack.enter_context(closing(OutputFile(_option(config, kind))))
                config.stash[FILES][kind] = file
        config.add_cleanup(stack.pop_all().close)


def pytest_configure(config: pytest.Config) -> None:
    """Declare the marker; refuse options that cannot be honoured."""
    config.stash[TALLY] = Tally()
    config.stash[FILES] = {}
    used = [*(f"--vbus-campaign-{name}" for name in _OPTIONS), "--vbus-campaign", "--vbus-world"]
    if any(config.getoption(option) not in (None, False) for option in used):
        from vbus.core.errors import VbusError

        try:
            _prepare(config)
        except (ValueError, VbusError) as error:
            raise pytest.UsageError(str(error)) from None
    config.addinivalue_line(
        "markers",
        "vbus_matrix(part, clock, time, seed, hostile): run a test once for each of these parts"
        ' ("PART", or "PART @ 6 MHz"), clocks, time policies and seeds; and on so many'
        " specimens that the manual allows",
    )


@pytest.fixture
def vbus_variant(request: pytest.FixtureRequest) -> dict[str, Any]:
    """What is otherwise in this variant of the test; see ``@pytest.mark.vbus_matrix``."""
    found: dict[str, Any] = getattr(request, "param", {})
    return found


def pytest_generate_tests(metafunc: pytest.Metafunc) -> None:
    """Make the variants of a test."""
    said: dict[str, Any] = {}
    for mark in reversed(list(metafunc.definition.iter_markers("vbus_matrix"))):
        if mark.args:
            _refuse(metafunc, "write lists by name, such as seed=[1, 2]")
        said |= mark.kwargs
    if not said:
        return
    if "vbus_variant" not in metafunc.fixturenames:
        _refuse(metafunc, "the test takes no fixture of vbus that has a board")
    hostile = said.pop("hostile", 0)
    if isinstance(hostile, bool) or not isinstance(hostile, int) or hostile < 0:
        _refuse(metafunc, f"hostile = {hostile!r}: write a number of specimens, such as 30")
    for key, values in said.items():
        _check(metafunc, key, values)
    if "clock" in said and any("@" in part for part in said.get("part", ())):
        _refuse(metafunc, 'a part has its clock ("PART @ 6 MHz") or the list of clocks, not both')
    keys = [key for key in _LISTS if key in said]
    variants = [dict(zip(keys, row, strict=True)) for row in product(*(said[k] for k in keys))]
    ids = ["-".join([_short(key, row[key]) for key in keys] or ["hostile"]) for row in variants]
    for row in variants:
        part, at, clock = str(row.get("part", "")).partition("@")
        row |= {"part": part.strip()} if part else {}
        row |= {"clock": clock.strip()} if at else {}
        row |= {"hostile": hostile} if hostile else {}
    metafunc.parametrize("vbus_variant", variants, ids=ids, indirect=True)


def _check(metafunc: pytest.Metafunc, key: str, values: Any) -> None:
    if key not in _LISTS:
        _refuse(metafunc, f"unknown keyword {key!r}; allowed are {', '.join(_LISTS)}, hostile")
    kind = int if key == "seed" else str
    some = isinstance(values, list | tuple | range) and values
    if not some or not all(isinstance(value, kind) for value in values):
        what = "numbers" if key == "seed" else "texts"
        _refuse(metafunc, f"{key} = {values!r}: write a list of {what}")
    for value in values:
        if key == "time" and value not in _TIMES:
            _refuse(metafunc, f"time = {value!r}: allowed are {' and '.join(_TIMES)}")


def _refuse(metafunc: pytest.Metafunc, sentence: str) -> None:
    where = metafunc.definition.nodeid
    pytest.fail(f"{where}: @pytest.mark.vbus_matrix: {sentence}", pytrace=False)


def _short(key: str, value: object) -> str:
    return f"seed{value}" if key == "seed" else str(value).replace(" ", "")


# -- worlds ---------------------------------------------------------------------------------------


def world_run(item: pytest.Item, bench: "Bench") -> None:
    """A test is over: note its board, and what became of it."""
    from vbus.campaign.world import REFERENCE

    begun = bench.begun
    if begun is not None:
        world = item.stash.get(WORLD, None) or REFERENCE
        item.config.stash[TALLY].tests.setdefault(item.nodeid, set()).add(str(world))
        item.stash[RUN] = (begun.file, begun.source, bench.account(), bench.named)


@pytest.hookimpl(tryfirst=True)
def pytest_runtest_protocol(item: pytest.Item, nextitem: pytest.Item | None) -> bool | None:
    """Run a test in other worlds first; what is reported is its last run.

    That is the one in the world in which it is weak, if a matrix looks for one; in the world that
    the command line names; or with nothing broken.
    """
    variant = getattr(item, "callspec", None)
    hostile = variant.params.get("vbus_variant", {}).get("hostile", 0) if variant else 0
    named, campaign = item.config.getoption("--vbus-world"), _asked(item.config)
    if "vbus_bench" not in getattr(item, "fixturenames", ()) or not (hostile or named or campaign):
        return None
    item.ihook.pytest_runtest_logstart(nodeid=item.nodeid, location=item.location)
    if named:
        from vbus.campaign.world import read_world

        item.stash[WORLD] = read_world(named)
        item.config.stash[TALLY].replays += _replayed(item)
    elif hostile:
        item.stash[WORLD] = _weak_on(item, hostile)
    if campaign:
        _campaign(item, *campaign)
    runtestprotocol(item, nextitem=nextitem)
    item.ihook.pytest_runtest_logfinish(nodeid=item.nodeid, location=item.location)
    return True


def _in_world(item: pytest.Item, world: "World") -> list[pytest.TestReport]:
    """Run a test in a world without reporting it; return the reports."""
    before = item.stash.get(WORLD, None)
    # With no next item pytest would tear down fixtures of module and session after each world.
    parent = cast(pytest.Item, item.parent)  # whose fixtures stay from one run to the next
    item.stash[SEARCHING] = True
    item.stash[WORLD] = world
    try:
        return runtestprotocol(item, log=False, nextitem=parent)
    finally:
        item.stash[SEARCHING] = False
        if before is None:
            del item.stash[WORLD]
        else:
            item.stash[WORLD] = before


def _replayed(item: pytest.Item) -> Iterator[str]:
    """Say what comes of a test in its world, as a campaign does, where it can."""
    from vbus.campaign.verdict import judge
    from vbus.campaign.world import REFERENCE
    from vbus.cli.hosted.campaign_runs import limits_of

    reference = _account(item, REFERENCE)
    if reference is None or reference.code or item.stash[RUN][0].board.time == "realtime":
        return
    item.stash[LIMITS] = limits_of(reference)
    run = _account(item, item.stash[WORLD])
    if run is not None:
        world = item.stash[WORLD]
        result = judge(reference, run, world)
        said = f"{result.verdict}: {result.reason}" if result.reason else result.verdict
        yield f"vbus: {item.nodeid}: {world.sentence()}: {said}"
        yield from (f"    finding: {finding}" for finding in result.findings)


def _weak_on(item: pytest.Item, examples: int) -> "World":
    """Return the specimen with the fewest extremes under which a test fails, or nothing otherwise.

    What failed in the last run is tried first, and what is found is remembered for the next one.
    """
    from vbus.campaign.plan import specimens, weakest
    from vbus.campaign.world import REFERENCE, possible, read_world

    @cache
    def fails(world: "World") -> bool:
        return any(report.failed for report in _in_world(item, world))

    # What fails with nothing otherwise is no weakness.
    if fails(REFERENCE) or RUN not in item.stash:  # or it was skipped, or has no board after all
        return REFERENCE
    file = item.stash[RUN][0]
    store = getattr(item.config, "cache", None)
    key = f"vbus/hostile/{sha256(item.nodeid.encode()).hexdigest()[:16]}"
    last = store.get(key, None) if store is not None else None
    worlds = specimens(file, 0, examples)
    if last is not None and possible(file, read_world(last)):
        worlds = iter([read_world(last), *worlds])
    found = weakest(worlds, fails)
    if store is not None and (found is not None or last is not None):
        store.set(key, None if found is None else str(found))
    return found or REFERENCE


def _until(item: pytest.Item, seconds: float | None) -> float:
    """Return when the campaign of a test ends: tests share evenly what is left of the time."""
    from vbus.core.wall_clock import monotonic

    if seconds is None:
        return inf
    now, items = monotonic(), item.session.items
    end = item.config.stash.setdefault(END, now + seconds)
    left = sum(
        "vbus_bench" in getattr(one, "fixturenames", ()) for one in items[items.index(item) :]
    )
    workers = int(os.environ.get("PYTEST_XDIST_WORKER_COUNT", "1"))
    return now + (end - now) / ceil(left / workers)


def _campaign(item: pytest.Item, most: int | None, seconds: float | None) -> None:
    """Run a test in many worlds, and tally what comes of it."""
    from msgspec.json import encode
    from msgspec.structs import replace

    from vbus.board.build import build
    from vbus.campaign.plan import PHASES, plan
    from vbus.campaign.report import Saved, as_json
    from vbus.campaign.verdict import Campaign, judge
    from vbus.campaign.world import NO_LINK, REFERENCE, read_dimensions
    from vbus.cli.hosted.campaign_runs import limits_of
    from vbus.core.wall_clock import monotonic
    from vbus.faults.row import LINK
    from vbus.faults.table import faults

    tally, until = item.config.stash[TALLY], _until(item, seconds)
    reference = _account(item, REFERENCE)
    why = "its board has nodes, or there is none" if reference is None else ""
    if item.stash[SKIPPED]:
        why = "it is skipped"
    elif reference is not None:
        # A test that does not repeat would give other verdicts each time.
        again = _account(item, REFERENCE)
        if reference.slow:
            why = f"the machine was too slow: {reference.stuck}"
        elif reference.code:
            why = "it fails with nothing broken"
        elif item.stash[RUN][0].board.time == "realtime":
            why = "in real time no two runs are alike"
        elif again is not None and judge(reference, again).reason:
            why = f"two runs with nothing broken differ: {judge(reference, again).reason}"
    if reference is None or why:
        tally.passed[item.nodeid] = why
        return
    file, source, _, named = item.stash[RUN]
    item.stash[LIMITS] = limits_of(reference)
    option = partial(_option, item.config)
    planned = plan(
        reference, file, build(file, source), option("seed") or 0, read_dimensions(option("only")),
        option("phases") or PHASES,
    )  # fmt: skip
    planned.worlds = [replace(one, test=item.nodeid) for one in planned.worlds]
    links = [name for name, row in faults().items() if row.target == LINK]
    planned.refused |= {name: NO_LINK for name in links if name in planned.refused}
    state = sha256(f"{_project(item.config)}{source.text}".encode() + encode(reference))
    for path in sorted(named):
        state.update(path.read_bytes() if path.is_file() else b"")
    before = item.config.stash[BEFORE].of(state.hexdigest(), item.nodeid)
    saved = Saved({item.nodeid: state.hexdigest()}, {})

    def result_of(world: "World") -> "Result":
        return judge(reference, _account(item, world) or reference, world)

    try:
        for one in islice(planned.worlds, most):
            if one.name in before:
                saved.results[one.name] = before[one.name]
                continue
            if monotonic() >= until:
                break
            run = _account(item, one.world)
            if run is not None:
                saved.take(one, judge(reference, run, one.world), None)
        if monotonic() < until:
            campaign = Campaign(planned, saved.results)
            for tried in campaign.with_least(result_of, lambda: monotonic() < until).tried:
                saved.results[tried.planned.name] = tried.result
    finally:  # what is found until a campaign is stopped is listed and stored, too
        tally.add_campaign(item.nodeid, planned, saved)
        del item.stash[LIMITS]
        if "json" in item.config.stash[FILES]:
            item.config.stash[FILES]["json"].write(as_json(tally.saved(item.config)))


def _project(config: pytest.Config) -> str:
    """Return a digest of the files in Python that pytest has loaded below its root."""
    if PROJECT not in config.stash:
        modules = [*sys.modules.values(), *config.pluginmanager.get_plugins()]
        names = {str(getattr(module, "__file__", None) or "") for module in modules}
        whole = sha256()
        for path in sorted(map(Path, names)):
            # A virtual environment below the root is of the machine, and no part of the driver.
            mine = path.is_relative_to(config.rootpath) and "site-packages" not in path.parts
            if mine and path.suffix == ".py":
                whole.update(path.read_bytes())
        config.stash[PROJECT] = whole.hexdigest()
    return config.stash[PROJECT]


def pytest_collection_finish(session: pytest.Session) -> None:
    """Note what is loaded before a test loads more: it is the same in each run."""
    if session.config.getoption("--vbus-campaign"):
        _project(session.config)


def _account(item: pytest.Item, world: "World") -> "Account | None":
    """Run a test in a world; return what became of it, None if it has no board there."""
    item.stash.setdefault(RUN, cast(Any, None))
    del item.stash[RUN]
    reports = _in_world(item, world)
    item.stash[SKIPPED] = any(report.skipped for report in reports)
    run = item.stash.get(RUN, None)
    if run is None or run[2] is None:
        return None
    account = run[2]
    for report in reports:
        if report.failed:
            account.code = 1
            # Its last line says what failed; the others have paths and addresses in them.
            account.errors = report.longreprtext.strip().rpartition("\n")[2]
    return account


# -- the summary ----------------------------------------------------------------------------------


def pytest_sessionfinish(session: pytest.Session) -> None:
    """Fail a run in which something is silent that the baseline has not, or nothing was tried."""
    stash = session.config.stash
    if is_worker(session.config):
        return
    new = KNOWN in stash and stash[TALLY].campaign().new(stash[KNOWN])
    if new or stash[TALLY].in_vain:
        fail_run(session)


def pytest_terminal_summary(
    terminalreporter: pytest.TerminalReporter, config: pytest.Config
) -> None:
    """Say how many worlds the tests have seen."""
    tally = config.stash[TALLY]
    # A session that only lists tests makes no campaign.
    asked = _asked(config) is not None and not config.option.collectonly
    for line in tally.lines(config) if tally.tests or asked else ():
        terminalreporter.line(line)
    if config.stash[FILES]:
        tally.write(config)
