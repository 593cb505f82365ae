"""What a run in another world came to, beside the reference run; and all of them together."""

import re
from collections import Counter, defaultdict
from collections.abc import Callable, Collection, Iterator, Mapping
from itertools import zip_longest
from typing import Final

from msgspec import Struct
from msgspec.structs import replace

from vbus.campaign.account import FLAGS, Account, Axis
from vbus.campaign.plan import PlannedWorld, WorldPlan, weakest
from vbus.campaign.world import DIMENSIONS, REFERENCE, SPECIMEN, WAYS, World, read_world

DETECTED: Final = "detected"
NO_EFFECT: Final = "no effect"
HANG: Final = "hang"
FOUND: Final = "silent, with a finding"
SILENT: Final = "silent"
SLOW: Final = "the machine was too slow"
VERDICTS: Final = (DETECTED, NO_EFFECT, HANG, FOUND, SILENT)

_NEAR: Final = 4
"""Counts by which the end of a move, and a number that a program says, may differ: an encoder line.
Not measured."""
_DRIVEN: Final = 0.5
"""Share of full command: a motor at rest has less, unless something keeps it from its place. Not
measured."""
_SHARE: Final = 0.05
"""Part of a move by which its extremes and its speed may differ; not measured."""


class Result(Struct, frozen=True):
    """What a run in one world came to.

    Attributes:
        verdict: one of :data:`VERDICTS`, or :data:`SLOW`.
        reason: in a sentence.
        findings: rules broken that the reference run does not break; of a host that gives up or
            hangs also what it leaves under power.
        group: of its world.
        least: the world with the least in it that comes to the same verdict, if it is another one.
    """

    verdict: str
    reason: str = ""
    findings: list[str] = []
    group: str = ""
    least: str = ""


def judge(reference: Account, run: Account, world: World = REFERENCE) -> Result:
    """Say what a run in a world came to.

    *Detected*: the host says so, by its exit code, a failed assertion, or a line more on standard
    error. *No effect*: it ends as the reference run does, in motion, values and output.
    *Hang*: it was ended. Else it is *silent*; a rule that it breaks, and the reference run does
    not, is listed apart.
    """
    new = sorted({*run.findings} - {*reference.findings})
    # Wall time ended it, not the world: such a run has no verdict, or it would depend on the load.
    if run.slow:
        return Result(SLOW, run.stuck)
    # A host that gives up has to leave the machine safe: what it leaves stands beside what it says.
    left = [*new, *_left_under_power(reference, run)]
    if run.stuck:
        return Result(HANG, run.stuck, left)
    if run.code != reference.code:
        said = _last_line(run.errors) or _last_line(run.output)
        return Result(DETECTED, f"exit code {run.code}" + (f": {said}" if said else ""), left)
    more, less = _more(run.errors, reference.errors), _more(reference.errors, run.errors)
    if more:
        return Result(DETECTED, f"it says: {more[-1]}", left)
    difference = next(_differences(reference, run, world.dimension != SPECIMEN), "")
    if not difference and less:
        difference = f"it does not complain: {less[0]}"
    if not difference:
        return Result(NO_EFFECT, _unbroken(run, world), new)
    return Result(FOUND if new else SILENT, difference, new)


def _left_under_power(reference: Account, run: Account) -> Iterator[str]:
    """Say which axes the host leaves running or driven, and does not in the reference run."""
    for name, axis in run.axes.items():
        was = reference.axes.get(name, axis)
        if axis.runs and not was.runs:
            yield f"{name} is left running"
        elif axis.drive >= _DRIVEN > was.drive:
            yield f"{name} is left with its motor at more than half of full command"


def _unbroken(run: Account, world: World) -> str:
    """Say that what makes a world has not come about, if so."""
    arming = world.arming()
    made = arming[:2] if arming is not None else ()
    for name, target, when in run.unfired:
        if (name, target) == made:
            return f"nothing was broken: the run ended before {when}"
    return ""


def _last_line(text: str) -> str:
    lines = text.strip().splitlines()
    return lines[-1].strip() if lines else ""


def _more(text: str, other: str) -> list[str]:
    """Return the lines that a text has more than another one, whatever numbers are in them.

    A driver that logs positions to standard error says other numbers in each phase.
    """
    left = Counter(_NUMBER.sub("#", line.strip()) for line in other.splitlines())
    more = []
    for line in filter(None, map(str.strip, text.splitlines())):
        like = _NUMBER.sub("#", line)
        left[like] -= 1
        if left[like] < 0:
            more.append(line)
    return more


def _differences(reference: Account, run: Account, flags: bool) -> Iterator[str]:
    """Give what differs; in flags, specimens do so by themselves."""
    moving = {name for one in (reference, run) for name, axis in one.axes.items() if axis.runs}
    for name, was in reference.axes.items():
        axis = run.axes.get(name)
        sentence = _other_motion(was, axis) if axis is not None else "is not there"
        if sentence:
            yield f"{name} {sentence}"
    for key, (value, near) in reference.values.items():
        other, now = run.values.get(key, (value, near))
        if near < 0 and isinstance(value, int) and isinstance(other, int):
            steady = ~(int(FLAGS - near) | int(FLAGS - now))
            value, other = value & steady, other & steady
        if other == value or (near > 0 and moving) or (near < 0 and not flags):
            continue
        if isinstance(value, str) or isinstance(other, str) or abs(other - value) > max(near, 0):
            yield f"{key} is {_number(other)}, not {_number(value)}"
    yield from _other_words(reference.output, run.output)


def _number(value: float | str) -> str:
    return value if isinstance(value, str) else f"{value:.9g}"


def _other_motion(was: Axis, now: Axis) -> str:
    if was.runs != now.runs:
        return "runs on at the end" if now.runs else "stands at the end, and should run"
    if not was.runs and abs(was.last - now.last) > _NEAR:
        return f"is at {now.last} in the end, not at {was.last}"
    # How a motor creeps to its target, in one step or in two, depends on the place in the sample.
    old, new = ([move for move in one.moves if move[3] - move[2] > _NEAR] for one in (was, now))
    for number, (a, b) in enumerate(zip_longest(old, new), 1):
        if a is None or b is None:
            few = abs(len(old) - len(new))
            return f"makes {few} move{'s' * (few > 1)} {'less' if b is None else 'more'}"
        near = max(_NEAR, int(_SHARE * (a[3] - a[2])))
        # Where an axis that runs on stands depends on when it was looked at.
        ends = _NEAR if not (was.runs and number == len(old)) else None
        if ends is not None and abs(a[1] - b[1]) > ends:
            return f"ends move {number} at {b[1]}, not at {a[1]}"
        if ends is not None and (abs(a[2] - b[2]) > near or abs(a[3] - b[3]) > near):
            return f"goes from {b[2]} to {b[3]} in move {number}, not from {a[2]} to {a[3]}"
    if abs(was.speed - now.speed) > max(_NEAR, _SHARE * was.speed):
        return f"is as fast as {now.speed} counts/ms, not {was.speed}"
    return ""


def _other_words(was: str, now: str) -> Iterator[str]:
    if was == now:
        return
    for number, (a, b) in enumerate(zip_longest(was.splitlines(), now.splitlines()), 1):
        if a is None or b is None or not _alike(a, b):
            yield f"line {number} it says is {_quoted(b)}, not {_quoted(a)}"


def _quoted(line: str | None) -> str:
    return "missing" if line is None else f'"{line.strip()}"'


_NUMBER: Final = re.compile("[0-9]+")
_DECIMAL: Final = re.compile(r"(?<![\w.])\d+(?![\w.])")


def _alike(a: str, b: str) -> bool:
    """Tell whether two lines say the same, decimal numbers of 100 and more but for some counts."""
    if _DECIMAL.sub("#", a) != _DECIMAL.sub("#", b):
        return False
    # Small numbers are codes, counts of tries or exit codes: one more is another one.
    pairs = zip(map(int, _DECIMAL.findall(a)), map(int, _DECIMAL.findall(b)), strict=True)
    return all(x == y or (min(x, y) >= 100 and abs(x - y) <= _NEAR) for x, y in pairs)


# -- all of them ----------------------------------------------------------------------------------


class Tried(Struct, frozen=True):
    """A world that was tried, and what came of it."""

    planned: PlannedWorld
    result: Result

    @property
    def dimension(self) -> str:
        """The dimension of its world."""
        return self.planned.world.dimension

    @property
    def key(self) -> tuple[str, str, str]:
        """What a baseline knows it by: dimension, group and way."""
        return (self.dimension, self.planned.group, self.planned.world.way)

    @property
    def replay(self) -> PlannedWorld:
        """The world to run again: of a specimen the one with the least in it."""
        if not self.result.least:
            return self.planned
        return replace(self.planned, world=read_world(self.result.least))

    @property
    def fails(self) -> bool:
        """Whether the host fails in a world in which nothing is broken."""
        return self.result.verdict == DETECTED and self.planned.world.allowed

    @property
    def quiet(self) -> bool:
        """Whether no output said that something was wrong."""
        return self.result.verdict in (SILENT, FOUND)


class WayTotal(Struct, frozen=True):
    """What came of one way.

    Attributes:
        dimension: of its worlds.
        way: the way.
        counts: worlds by verdict.
        left: worlds that were not tried.
    """

    dimension: str
    way: str
    counts: Mapping[str, int]
    left: int

    @property
    def name(self) -> str:
        """What its line of a table begins with."""
        return self.way if self.way == self.dimension else f"{self.dimension} {self.way}"

    @property
    def tried(self) -> int:
        """Worlds that have a verdict."""
        return sum(self.counts.values())

    @property
    def coverage(self) -> float | None:
        """Diagnostic coverage: the detected part of what had an effect; None if nothing had."""
        effects = self.tried - self.counts.get(NO_EFFECT, 0)
        return self.counts.get(DETECTED, 0) / effects if effects else None


class Campaign:
    """What a campaign has found.

    Args:
        plan: what was to be tried.
        results: what came of it, by :attr:`PlannedWorld.name`; others have not been tried.
    """

    def __init__(self, plan: WorldPlan, results: Mapping[str, Result]) -> None:
        self.plan: Final = plan
        self.tried: Final = [
            Tried(one, results[one.name])
            for one in plan.worlds
            if one.name in results and results[one.name].verdict != SLOW
        ]

    def totals(self) -> list[WayTotal]:
        """Return what came of each way, in the order of the dimensions."""
        counts: dict[tuple[str, str], Counter[str]] = defaultdict(Counter)
        left: Counter[tuple[str, str]] = Counter(self.plan.left)
        for one in self.plan.worlds:
            left[one.world.dimension, one.world.way] += 1
        for tried in self.tried:
            way = tried.planned.world.way
            counts[tried.dimension, way][tried.result.verdict] += 1
            left[tried.dimension, way] -= 1
        return [WayTotal(*key, counts[key], left[key]) for key in sorted(left, key=_place)]

    def listed(self) -> list[Tried]:
        """Return of each group, way and verdict to look at the earliest world."""
        first: dict[tuple[str, ...], Tried] = {}
        for one in sorted(self.tried, key=lambda one: early(one.planned)):
            if one.quiet or one.result.verdict == HANG or one.fails:
                first.setdefault((*one.key, one.result.verdict), one)
        return list(first.values())

    def unsafe(self) -> dict[tuple[str, str], list[Tried]]:
        """Return by test and finding the worlds in which a host says so, and that is found yet."""
        found: dict[tuple[str, str], list[Tried]] = {}
        for one in sorted(self.tried, key=lambda one: early(one.planned)):
            if one.result.verdict == DETECTED and not one.fails:
                for finding in one.result.findings:
                    found.setdefault((one.planned.test, finding), []).append(one)
        return found

    def with_least(self, run: Callable[[World], Result], goes_on: Callable[[], bool]) -> "Campaign":
        """Return the same with the least world of each specimen that is listed.

        Args:
            run: runs what the campaign is of in a world.
            goes_on: whether there is time to look for less than the least until now.
        """
        found = {one.planned.name: one.result for one in self.tried}
        for one in self.listed():
            verdict, known = one.result.verdict, {one.planned.world}

            def alike(world: World, verdict: str = verdict, known: set[World] = known) -> bool:
                return world in known or (goes_on() and run(world).verdict == verdict)

            if one.dimension == SPECIMEN and not one.result.least:
                least = str(weakest(known, alike))
                found[one.planned.name] = replace(one.result, least=least)
        return Campaign(self.plan, found)

    def new(self, baseline: Collection[tuple[str, str, str]]) -> list[Tried]:
        """Return the quiet outcomes that a baseline does not have."""
        return [one for one in self.listed() if one.quiet and one.key not in baseline]


def _place(key: tuple[str, str]) -> tuple[int, int, str]:
    dimension, way = key
    return (DIMENSIONS.index(dimension), WAYS.index(way) if way in WAYS else 0, way)


def early(one: PlannedWorld) -> tuple[int, str, int, str]:
    """Return what planned worlds are sorted by for a reader: dimension, place, number of cycle."""
    world = one.world
    place, _, number = world.where.partition("@")[0].rpartition(".")
    dimension = _place((world.dimension, world.way))[0]
    return dimension, place, int(number) if number.isdecimal() else 0, one.name
