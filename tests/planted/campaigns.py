"""Campaigns of drivers with a planted mistake that their own tests do not find."""

import tomllib
from functools import cache, cached_property
from pathlib import Path
from typing import Final

import msgspec

from tests.planted.suite import HERE, MISTAKES, SILENT, DriverTest, driver_tests
from vbus.board.build import build
from vbus.campaign import verdict
from vbus.campaign.account import Account
from vbus.campaign.plan import PlannedWorld, plan
from vbus.campaign.verdict import Result, judge
from vbus.campaign.world import PHASE, REFERENCE, SPECIMEN, World
from vbus.cli.hosted.campaign_runs import limits_of

FILE: Final = HERE / "campaigns.toml"
RUNS: Final = 240
"""Worlds of each test, in some minute of a processor: a part of what five minutes give."""
QUIET: Final = "quiet"


class Shown(msgspec.Struct):
    """What a campaign shows of a mistake; a row of :data:`FILE`.

    Attributes:
        what: the mistake.
        test: which test, "" if no world of any test shows it.
        world: the world that shows it.
        verdict: what comes of the driver there.
        says: what the campaign says of that.
    """

    what: str
    test: str = ""
    world: str = ""
    verdict: str = ""
    says: str = ""


class Tried:
    """One test of a driver in worlds.

    Args:
        test: the test.
        folder: where programs are compiled to.
    """

    def __init__(self, test: DriverTest, folder: Path) -> None:
        self.name = test.name
        self._test, self._folder = test, folder
        self._results: dict[World, Result] = {}

    def _run(self, world: World) -> Account:
        limits = () if world == REFERENCE else limits_of(self.reference)
        bench, why = self._test.run(self._folder, world, limits)
        account = bench.account()
        begun = bench.begun
        bench.close()
        assert account is not None
        assert begun is not None
        self._board = begun.file, begun.source
        return msgspec.structs.replace(account, code=int(bool(why)), errors=why)

    @cached_property
    def reference(self) -> Account:
        """Its run with nothing broken."""
        return self._run(REFERENCE)

    @cached_property
    def worlds(self) -> list[PlannedWorld]:
        """Worlds of its campaign."""
        return plan(self.reference, self._board[0], build(*self._board)).worlds[:RUNS]

    def result(self, world: World) -> Result:
        """Return what comes of it in a world."""
        if world not in self._results:
            self._results[world] = judge(self.reference, self._run(world), world)
        return self._results[world]

    def shown(self, what: str, world: World) -> Shown:
        """Return what a world shows of a mistake."""
        result = self.result(world)
        says = f"{world.sentence()}: {result.reason or ', '.join(result.findings)}"
        return Shown(what, self.name, str(world), result.verdict, says)

    def signs(self, world: World) -> set[str]:
        """Return what says in a world that something is wrong with the driver.

        That is a silent outcome, a hang, a rule broken; or, with a chip that is right but another
        specimen or at another phase, a test that fails.
        """
        result = self.result(world)
        signs = {*result.findings}
        if result.verdict in (verdict.SILENT, verdict.FOUND):
            signs.add(QUIET)
        fails = result.verdict == verdict.DETECTED and world.dimension in (PHASE, SPECIMEN)
        if result.verdict == verdict.HANG or fails:
            signs.add(result.verdict)
        return signs


def compared(right: Tried, wrong: Tried) -> World | None:
    """Return the first world that shows more of a wrong driver than its whole kind of the right."""
    kinds: dict[tuple[str, str], set[World]] = {}
    for one in right.worlds:
        kinds.setdefault((one.group, one.world.way), set()).add(one.world)
    for one in wrong.worlds:
        alike = kinds.get((one.group, one.world.way), set())
        signs = wrong.signs(one.world) if alike else set()
        if signs and not signs <= set().union(*(right.signs(w) for w in {*alike, one.world})):
            return one.world
    return None


@cache
def tried(driver: str, number: int, folder: Path) -> list[Tried]:
    """Return the tests of a driver with a mistake, or of the right one, to be run in worlds."""
    return [Tried(test, folder) for test in driver_tests(driver, number)]


def campaign(driver: str, number: int, folder: Path) -> Shown:
    """Put a mistake through campaigns of all tests of its driver."""
    what = MISTAKES[driver][number - 1]["what"]
    for right, wrong in zip(tried(driver, 0, folder), tried(driver, number, folder), strict=True):
        world = compared(right, wrong)
        if world is not None:
            return wrong.shown(what, world)
    return Shown(what)


def not_found() -> list[tuple[str, int]]:
    """Return driver and number of each mistake that the driver's own tests do not find."""
    return [
        (driver, number)
        for driver, rows in MISTAKES.items()
        for number, row in enumerate(rows, 1)
        if row["comes_to"] == SILENT
    ]


def read() -> dict[str, list[Shown]]:
    """Return what is written of all campaigns, by driver."""
    return msgspec.convert(tomllib.loads(FILE.read_text()), dict[str, list[Shown]])
