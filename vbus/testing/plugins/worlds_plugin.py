"""The part of the pytest plug-in that runs one test in many worlds: parts, specimens, campaigns."""

import pickle
import re
import shlex
import sys
from collections import Counter
from collections.abc import Collection, Iterator
from contextlib import ExitStack, closing
from functools import partial
from hashlib import sha256
from itertools import islice, product
from pathlib import Path
from typing import TYPE_CHECKING, Any, Final, cast

import pytest
from _pytest.runner import runtestprotocol

from vbus.testing.plugins.acceptance_plugin import fail_run

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
RUN: pytest.StashKey["tuple[BoardFile, Source, Account | None, list[Path]]"] = pytest.StashKey()
"""The board that the test ran on, what became of it, and the files that the test named."""
LIMITS: pytest.StashKey["tuple[int, int]"] = pytest.StashKey()
"""Chip time (ps) and bus cycles that it may take in a world of a campaign."""
TALLY: pytest.StashKey["Tally"] = pytest.StashKey()
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
"""Worlds of each test, where nothing is said."""
_MOST: Final = 20
"""Silent outcomes that the summary tells."""
_LISTS: Final = ("part", "clock", "time", "seed")
_TIMES: Final = ("lockstep", "slaved")


class Tally:
    """The worlds that a run of pytest has seen.

    Attributes:
        tests: runs of each test that has a board.
        worlds: of campaigns, those that have results.
        digests: of each test that has a campaign.
        results: what came of its worlds, by name.
        left: of each dimension and way, how many worlds were not tried.
        refused: dimensions that do not apply to the board of a test, with the reason.
        passed: tests of which no campaign can be made, with the reason.
    """

    def __init__(self) -> None:
        self.tests: Counter[str] = Counter()
        self.worlds: list[PlannedWorld] = []
        self.digests: dict[str, str] = {}
        self.results: dict[str, Result] = {}
        self.left: Counter[tuple[str, str]] = Counter()
        self.refused: dict[str, str] = {}
        self.passed: dict[str, str] = {}

    def add(self, other: "Tally") -> None:
        """Take over what a worker of pytest-xdist has seen."""
        for name, value in vars(self).items():
            more = getattr(other, name)
            value.extend(more) if isinstance(value, list) else value.update(more)

    def add_campaign(self, test: str, plan: "WorldPlan", saved: "Saved") -> None:
        """Take the campaign of one test: its groups have the name of the test before them."""
        from msgspec.structs import replace

        from vbus.campaign.verdict import Campaign

        made = Campaign(plan, saved.results)
        for one in made.tried:
            group = f"{test}: {one.planned.group}"
            self.worlds.append(replace(one.planned, group=group))
            self.results[one.planned.name] = one.result
        for total in made.totals():
            self.left[total.dimension, total.way] += total.left
        self.refused |= plan.refused
        self.digests[test] = saved.digests[test]

    def campaign(self) -> "Campaign":
        """Return the campaigns of all tests as one."""
        from vbus.campaign.plan import WorldPlan
        from vbus.campaign.verdict import Campaign

        worlds = sorted(self.worlds, key=lambda one: one.test)
        return Campaign(WorldPlan(worlds, self.left, self.refused | self.passed), self.results)

    def lines(self, config: pytest.Config) -> Iterator[str]:
        """Say in one line how many worlds there were; of a campaign, what was silent, too."""
        runs, tests = sum(self.tests.values()), len(self.tests)
        seen = f"vbus: {tests} test{'s' * (tests != 1)} in {runs} world{'s' * (runs != 1)}"
        if not self.digests and not self.passed:
            yield seen
            return
        from vbus.campaign.report import outcomes
        from vbus.campaign.verdict import DETECTED, NO_EFFECT, VERDICTS

        verdicts = Counter(result.verdict for result in self.results.values())
        effects = sum(verdicts.values()) - verdicts[NO_EFFECT]
        share = f"{100 * verdicts[DETECTED] / effects:.0f} %" if effects else "-"
        counts = ", ".join(f"{verdicts[one]} {one}" for one in VERDICTS)
        yield f"{seen}: {counts}; diagnostic coverage {share}; {self.left.total()} not tried"
        for test, why in self.passed.items():
            yield f"  {test}: no campaign: {why}"
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
    return f"pytest '{one.test}' --vbus-world='{one.world}'"


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


_TIME: Final = re.compile(r"(\d+(?:\.\d+)?) ?(s|m|min|h)")
_UNITS: Final = {"s": 1, "m": 60, "min": 60, "h": 3600}


def _asked(config: pytest.Config) -> tuple[int | None, float | None] | None:
    """Return the number of worlds of each test, or the seconds for all; None: no campaign."""
    text = config.getoption("--vbus-campaign")
    if text is None:
        return None
    found = _TIME.fullmatch(text)
    if found:
        return None, float(found[1]) * _UNITS[found[2]]
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
    from vbus.campaign.report import Saved, read_baseline, read_saved
    from vbus.campaign.world import NO_TURNS, THREADS, read_dimensions, read_world
    from vbus.serve.output_file import OutputFile

    if config.getoption("--vbus-world"):
        try:
            read_world(config.getoption("--vbus-world"))
        except ValueError as error:
            raise ValueError(f"--vbus-world: {error}") from None
    given = [name for name in _OPTIONS if _option(config, name) not in (None, False)]
    if given and _asked(config) is None:
        raise ValueError(f"--vbus-campaign-{given[0]} goes with --vbus-campaign")
    only, phases, seed = (_option(config, name) for name in ("only", "phases", "seed"))
    if THREADS in read_dimensions(only) and only is not None:
        raise ValueError(f"--vbus-campaign-only={only}: {NO_TURNS}")
    if (phases is not None and not 2 <= phases <= 4096) or (seed is not None and seed < 0):
        raise ValueError("--vbus-campaign-phases is 2 to 4096, --vbus-campaign-seed 0 or more")
    if _option(config, "baseline"):
        config.stash[KNOWN] = read_baseline(_option(config, "baseline"))
    json = _option(config, "json")
    config.stash[BEFORE] = read_saved(json) if json else Saved()
    if hasattr(config, "workerinput"):
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
    begun = bench.begun
    if begun is not None:
        item.config.stash[TALLY].tests[item.nodeid] += 1
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
    elif hostile:
        item.stash[WORLD] = _weak_on(item, hostile)
    if campaign and not named:
        _campaign(item, *campaign)
    runtestprotocol(item, nextitem=nextitem)
    item.ihook.pytest_runtest_logfinish(nodeid=item.nodeid, location=item.location)
    return True


def _in_world(item: pytest.Item, world: "World") -> list[pytest.TestReport]:
    """Run a test in a world without reporting it; return the reports."""
    before = item.stash.get(WORLD, None)
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


def _weak_on(item: pytest.Item, examples: int) -> "World":
    """Return the specimen with the fewest extremes under which a test fails, or nothing otherwise.

    What failed in the last run is tried first, and what is found is kept for the next one.
    """
    from vbus.campaign.plan import specimens, weakest
    from vbus.campaign.world import REFERENCE, possible, read_world

    results: dict[World, bool] = {}

    def fails(world: "World") -> bool:
        if world not in results:
            results[world] = any(report.failed for report in _in_world(item, world))
        return results[world]

    if fails(REFERENCE) or RUN not in item.stash:  # or it was skipped, or has no board after all
        return REFERENCE
    file = item.stash[RUN][0]
    cache = getattr(item.config, "cache", None)
    key = f"vbus/hostile/{sha256(item.nodeid.encode()).hexdigest()[:16]}"
    kept = cache.get(key, None) if cache is not None else None
    worlds = specimens(file, 0, examples)
    if kept is not None and possible(file, read_world(kept)):
        worlds = iter([read_world(kept), *worlds])
    found = weakest(worlds, fails)
    if cache is not None and (found is not None or kept is not None):
        cache.set(key, None if found is None else str(found))
    return found or REFERENCE


def _campaign(item: pytest.Item, most: int | None, seconds: float | None) -> None:
    """Run a test in many worlds, and tally what comes of it."""
    from msgspec.json import encode
    from msgspec.structs import replace

    from vbus.board.build import build
    from vbus.campaign.plan import PHASES, plan
    from vbus.campaign.report import Saved, as_json
    from vbus.campaign.verdict import judge
    from vbus.campaign.world import REFERENCE, read_dimensions
    from vbus.cli.hosted.campaign_runs import limits_of
    from vbus.core.wall_clock import monotonic

    tally = item.config.stash[TALLY]
    until = monotonic() + (seconds or 0) / max(len(item.session.items), 1)
    reference = _account(item, REFERENCE)
    why = "its board has nodes, or there is none" if reference is None else ""
    if reference is not None:
        again = _account(item, REFERENCE)
        if reference.code:
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
    state = sha256(f"{_project(item.config)}{source.text}".encode() + encode(reference))
    for path in sorted(named):
        state.update(path.read_bytes() if path.is_file() else b"")
    before = item.config.stash[BEFORE].of(state.hexdigest(), item.nodeid)
    saved = Saved({item.nodeid: state.hexdigest()}, {})
    try:
        for one in islice(planned.worlds, most):
            if one.name in before:
                saved.results[one.name] = before[one.name]
                continue
            if seconds is not None and monotonic() >= until:
                break
            run = _account(item, one.world)
            if run is not None:
                saved.take(one.name, judge(reference, run, one.world), None)
    finally:  # what is found until a campaign is stopped is told and stored, too
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
    run = item.stash.get(RUN, None)
    if run is None or run[2] is None:
        return None
    account = run[2]
    for report in reports:
        if report.failed:
            account.code = 1
            account.errors = report.longreprtext.strip().rpartition("\n")[2]
    return account


# -- the summary ----------------------------------------------------------------------------------


@pytest.hookimpl(optionalhook=True)
def pytest_testnodedown(node: Any, error: object) -> None:
    """Take over what a worker of pytest-xdist has seen."""
    output = getattr(node, "workeroutput", {})
    if "vbus_worlds" in output:
        node.config.stash[TALLY].add(pickle.loads(output["vbus_worlds"]))


def pytest_sessionfinish(session: pytest.Session) -> None:
    """Hand over what this worker of pytest-xdist has seen; fail for what a baseline has not."""
    config = session.config
    if hasattr(config, "workeroutput"):
        config.workeroutput["vbus_worlds"] = pickle.dumps(config.stash[TALLY])
    elif KNOWN in config.stash and config.stash[TALLY].campaign().new(config.stash[KNOWN]):
        fail_run(session)


def pytest_terminal_summary(
    terminalreporter: pytest.TerminalReporter, config: pytest.Config
) -> None:
    """Say how many worlds the tests have seen."""
    tally = config.stash[TALLY]
    for line in tally.lines(config) if tally.tests else ():
        terminalreporter.line(line)
    if config.stash[FILES]:
        tally.write(config)
