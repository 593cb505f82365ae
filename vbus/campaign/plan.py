"""Which worlds a campaign has, and in which order they are tried."""

from bisect import bisect_right
from collections import defaultdict
from collections.abc import Callable, Collection, Iterable, Iterator
from hashlib import sha256
from itertools import pairwise, product
from typing import Final

from msgspec import Struct

from vbus.board.board import Board
from vbus.boardfile.sections import BoardFile
from vbus.campaign.account import Account, SeenCycle
from vbus.campaign.world import (
    AHEAD,
    BUSY,
    CYCLE,
    DIMENSIONS,
    DOUBLED,
    EARLY,
    FAULT,
    FLIP,
    FLOATING,
    INTERRUPT,
    LATE,
    LOST,
    NO_TURNS,
    ORDER,
    PHASE,
    SPECIMEN,
    THREADS,
    World,
    extremes,
    longest_cycle,
)
from vbus.core.kernel import MS, US
from vbus.faults.row import AXIS, CHIP, LASTS, LINK, MESSAGES, WIRE, Fault
from vbus.faults.table import faults
from vbus.faults.targets import find_target
from vbus.protocols.quantities import format_instant

PHASES: Final = 16
"""How many phases of the chips' cycle a host is tried at; not measured."""
SPECIMENS: Final = 64
"""How many specimens are tried at most: each extreme alone, and others drawn by the seed."""
_EACH: Final = 64
"""How many cycles of one group are tried in one way at most; the others are listed as not tried.
It bounds the length of a campaign."""
_STEP: Final = 17 * US
"""Specimens differ in where in a sample their host begins, too, by multiples of this (ps)."""
_STEPS: Final = 32
"""How many such beginnings there are: 32 of 17 us go through two samples of an LM629 at 8 MHz."""
_WHILE: Final = 100 * MS
"""For how long an axis is disturbed when it is fastest: a limit of its error of 400 counts, as
drivers set it, is passed from 4 counts/ms on."""
_JAM: Final = "jam"
_MOVES: Final = 16
"""In how many moves an axis is jammed, a world for each."""
_LOOP: Final = 64
"""Among how many cycles before an interrupt the loop is looked for that a host waits in."""
_ORDERS: Final = 8
"""How many orders of a program's threads are tried; how many threads it has is not known.
It bounds the length of a campaign."""
_SEEDS: Final = 10**6
_NO_CLOCK: Final = (
    "after a lost answer a program waits by the wall clock, or for ever, and no two such runs are"
    " alike; try one by --world fault:host0@{}:answer_lost, or give --host a function, whose link"
    " needs no clock"
)


SHARES: Final = {
    FAULT: 4, SPECIMEN: 3, PHASE: 3, INTERRUPT: 2, THREADS: 2, FLOATING: 1, CYCLE: 2,
}  # fmt: skip
"""How many worlds of each dimension are tried in turn.

Of drivers whose planted mistake passes their tests, so many worlds showed what no world of the
right driver does: jams 4 of 8 (no limit of the error), all faults 10 of 54 (a limit that only
reports), specimens 15 of 20, phases and interrupts none of 60 (a reset given 1 ms), bus cycles none
of 201 (three drivers). In an order by groups alone, 67 of the first 82 worlds were bus cycles.
"""


class PlannedWorld(Struct, frozen=True):
    """A world, and what it is one of.

    Attributes:
        world: the world.
        group: what is broken there: for a bus cycle its packet, place and packet before.
        test: which of several tests runs there.
    """

    world: World
    group: str
    test: str = ""

    @property
    def name(self) -> str:
        """What its result is known by: the world as text, and the test."""
        return f"{self.test}: {self.world}" if self.test else str(self.world)


class WorldPlan(Struct):
    """What a campaign tries.

    Attributes:
        worlds: in the order in which they are tried: of each group and way one first.
        left: of each dimension and way, how many worlds it leaves out.
        refused: dimensions that do not apply, with the reason.
    """

    worlds: list[PlannedWorld]
    left: dict[tuple[str, str], int]
    refused: dict[str, str]


def plan(
    reference: Account,
    file: BoardFile,
    board: Board,
    seed: int = 0,
    only: Collection[str] = DIMENSIONS,
    phases: int = PHASES,
) -> WorldPlan:
    """Return the worlds for a host whose reference run is known.

    Args:
        reference: of a run with bus cycles and edges.
        file: the board file.
        board: a board of it, at instant 0, on which faults can be tried.
        seed: decides which of a group come first, and the seeds of specimens.
        only: dimensions.
        phases: how many phases of the chips' cycle.
    """
    made = WorldPlan([], defaultdict(int), {})
    makers = {
        CYCLE: lambda: _cycles(made, reference, board, seed),
        INTERRUPT: lambda: _interrupts(made, reference),
        PHASE: lambda: _phases(made, board, phases),
        SPECIMEN: lambda: _specimens(made, file, seed),
        FLOATING: lambda: _floating(board),
        FAULT: lambda: _faults(made, reference, board),
        THREADS: lambda: _threads(made, reference, seed),
    }
    for dimension in DIMENSIONS:
        if dimension in only:
            made.worlds += makers[dimension]()
    # A budget cuts the list behind, so something of every dimension stands in front.
    made.worlds = in_order(made.worlds, seed)
    return made


def in_order(worlds: Iterable[PlannedWorld], seed: int) -> list[PlannedWorld]:
    """Return worlds so that of each group and way one comes first, then a second one, and so on.

    The first of all are one of each way of each dimension: a short campaign has seen them all.
    Then dimensions take turns, by :data:`SHARES`.
    """
    groups = defaultdict(list)
    for one in worlds:
        groups[one.world.dimension, one.group, one.world.way].append((drawn(seed, one.world), one))
    rounds = [
        (number, draw, one)
        for members in groups.values()
        for number, (draw, one) in enumerate(sorted(members, key=lambda row: row[0]))
    ]
    ordered = [one for _, _, one in sorted(rounds, key=lambda row: row[:2])]
    first = {(one.world.dimension, one.world.way): one for one in reversed(ordered)}
    ahead = {one.name for one in first.values()}
    turns: dict[str, int] = defaultdict(int)
    keys = {}
    for one in ordered:
        dimension = one.world.dimension
        turns[dimension] += one.name not in ahead
        keys[one.name] = (one.name not in ahead, turns[dimension] / SHARES[dimension])
    return sorted(ordered, key=lambda one: keys[one.name])


def drawn(seed: int, what: object) -> int:
    """Return a number that the seed draws for something."""
    # A hash, and no generator: what is drawn for a world does not depend on the worlds before it.
    return int.from_bytes(sha256(f"{seed} {what}".encode()).digest()[:8], "big")


def _cycles(made: WorldPlan, reference: Account, board: Board, seed: int) -> Iterator[PlannedWorld]:
    """Give a world for each way to break each cycle of the reference run, at most 64 of a group.

    ``made`` takes what is not tried: the reason (``refused``), or how many worlds (``left``).
    """
    if not reference.seen:
        made.refused[CYCLE] = "the reference run has no bus cycle at a chip whose bus is known"
    known = faults()
    busy = {chip.name for chip in board.chips if known["busy_longest"].exists_for(chip.FAMILY)}
    slow = sorted({row.chip for row in reference.seen} - busy)
    if slow:
        made.refused[BUSY] = f"{', '.join(slow)}: this family has no busy that the manual bounds"
    groups = defaultdict(list)
    for row in reference.seen:
        groups[row.chip, row.group].append(row)
    for (chip, group), rows in groups.items():
        ways = [*(f"{FLIP}{bit}" for bit in range(8)), LOST, DOUBLED]
        # Only a write makes a chip busy; only a read has an answer that can be late.
        ways += [BUSY] if chip in busy and rows[0].write else []
        ways += [] if rows[0].write else [LATE]
        if len(rows) > _EACH:
            for way in ways:
                # All eight bits are one way: flip.
                made.left[CYCLE, way.rstrip("01234567")] += len(rows) - _EACH
            # Drawn over the whole run: the first 64 polls of a wait are all alike.
            rows = sorted(rows, key=lambda row: drawn(seed, row.number))[:_EACH]
        for row, way in product(rows, ways):
            yield PlannedWorld(World(CYCLE, f"{chip}.{row.number}", way), f"{chip} {group}")


def _interrupts(made: WorldPlan, reference: Account) -> Iterator[PlannedWorld]:
    if not reference.edges:
        made.refused[INTERRUPT] = "no output that a host looks at has moved in the reference run"
    rows = sorted(reference.seen, key=lambda row: row.when)
    instants = [row.when for row in rows]
    steps = [b - a for a, b in pairwise(instants) if b > a]
    # A host cannot look between two of its cycles: the shortest step is one cycle of it.
    one = min(steps, default=US)
    count: dict[tuple[str, int], int] = defaultdict(int)
    # The first edge of an output is the one that interrupts.
    begins = {output: level for output, _, level in reversed(reference.edges)}
    inside: dict[str, World] = {}
    for output, when, level in reference.edges:
        count[output, level] += 1
        if count[output, level] > _EACH:
            made.left[INTERRUPT, EARLY] += 1
            made.left[INTERRUPT, LATE] += 1
            continue
        group = f"{output} {'rises' if level else 'falls'}"
        # Before the first cycle no output can be early.
        if when > one:
            world = World(INTERRUPT, f"{output}@{when - one}", f"early{one}-{level}")
            yield PlannedWorld(world, group)
        world = World(INTERRUPT, f"{output}@{when}", f"late{one}-{1 - level}")
        yield PlannedWorld(world, group)
        if level != begins[output]:
            continue
        end = bisect_right(instants, when)
        for place, span in _loop(rows[max(0, end - _LOOP) : end], when):
            world = World(INTERRUPT, f"{output}@{when}", f"late{span}-{1 - level}")
            inside.setdefault(f"{group} in {place}", world)
    yield from (PlannedWorld(world, group) for group, world in inside.items())


def _loop(rows: list[SeenCycle], when: int) -> Iterator[tuple[str, int]]:
    """Give each place of the loop that a host is in at an instant: how far ahead it is (ps).

    ``rows`` are its cycles before.
    """
    places = defaultdict(list)
    for row in rows:
        places[f"{row.chip} {row.group}"].append(row.when)
    for place, (*_, before, last) in ((p, at) for p, at in places.items() if len(at) > 1):
        if period := last - before:
            yield place, period - (when - last) % period


def _phases(made: WorldPlan, board: Board, phases: int) -> Iterator[PlannedWorld]:
    cycle = longest_cycle(board)
    if not cycle:
        made.refused[PHASE] = "no family says how long a cycle of these chips is"
    # Phase 0 is the reference run.
    for number in range(1, phases if cycle else 0):
        ahead = format_instant(number * cycle // phases)
        yield PlannedWorld(World(PHASE, f"+{ahead}", AHEAD), "place in the sample")


def specimens(file: BoardFile, seed: int, most: int = SPECIMENS) -> Iterator[World]:
    """Give specimens that the manual allows: each extreme alone, then some drawn by the seed."""
    settings = extremes(file)
    for chip, key, values in reversed(settings):
        for value in values:
            if most > 0:
                most -= 1
                yield World(SPECIMEN, "+0us", f"{chip}.{key}={_text(value)}")
    for number in range(most):
        draw = drawn(seed, f"specimen {number}")
        parts = []
        for chip, key, values in settings:
            draw, place = divmod(draw, len(values) + 1)
            if place:
                parts.append(f"{chip}.{key}={_text(values[place - 1])}")
        draw = drawn(seed, f"seed {number}")
        ahead = format_instant(draw // 10 % _STEPS * _STEP)
        yield World(SPECIMEN, f"+{ahead}", ",".join(parts), draw % 10)


def _text(value: object) -> str:
    return str(value).lower() if isinstance(value, bool) else str(value)


def _specimens(made: WorldPlan, file: BoardFile, seed: int) -> Iterator[PlannedWorld]:
    if not extremes(file):
        made.refused[SPECIMEN] = "the board file fixes all in which silicon may differ"
        return
    # Two draws may be the same specimen.
    for world in dict.fromkeys(specimens(file, seed)):
        yield PlannedWorld(world, world.how.partition("=")[0] or "seeds")


def _floating(board: Board) -> Iterator[PlannedWorld]:
    for chip in board.chips:
        if chip.BUS is not None:
            for level in ("0", "1"):
                yield PlannedWorld(World(FLOATING, chip.name, level), f"{chip.name} data lines")


def _faults(made: WorldPlan, reference: Account, board: Board) -> Iterator[PlannedWorld]:
    """Each fault of the table once, on each target, in the middle of the host's cycles.

    What is of an axis comes another time for a while, when the axis is fastest. A jam comes in each
    move, too: a host's watch on errors may be gone from some move on.
    """
    # At the beginning most faults meet a reset, and at the end a host that has left.
    middle = reference.seen[len(reference.seen) // 2].when if reference.seen else 0
    for row in faults().values():
        targets = list(_targets(row, board))
        if row.family == MESSAGES:
            made.refused[row.name] = "the host's link is a stream of bytes, without messages"
        elif row.target == LINK:
            made.refused |= {} if reference.links else {row.name: _NO_CLOCK.format(middle)}
            targets = ["host0"] if reference.links else []
        elif not targets:
            made.refused[row.name] = "nothing on this board can have it"
        for target in targets:
            group = f"{row.name} {target}"
            yield PlannedWorld(World(FAULT, f"{target}@{middle}", row.name), group)
            axis = reference.axes.get(target) if row.target == AXIS and row.acts == LASTS else None
            if axis is not None and axis.peaks:
                at = max(axis.peaks, key=lambda peak: peak[0])[1]
                world = World(FAULT, f"{target}@{at}+{_WHILE}", row.name)
                yield PlannedWorld(world, f"{group} for a while")
                moves = list(enumerate(axis.peaks, 1)) if row.name == _JAM else []
                for number, (_, at) in moves[:_MOVES]:
                    world = World(FAULT, f"{target}@{at}", row.name)
                    yield PlannedWorld(world, f"{group} in move {number}")


def _targets(row: Fault, board: Board) -> Iterator[str]:
    names: list[str] = [chip.name for chip in board.chips]
    if row.target not in (CHIP, WIRE):
        names = list(board.axes) if row.of_chip else [*board.nets]
        names = [part.name for part in board.glue.parts] if row.target == "part" else names
    for name in names:
        try:
            yield find_target(board, row, name, None)
        except ValueError:
            continue


def _threads(made: WorldPlan, reference: Account, seed: int) -> Iterator[PlannedWorld]:
    if not reference.turns:
        made.refused[THREADS] = NO_TURNS
    for number in range(_ORDERS if reference.turns else 0):
        order = f"{ORDER}{1 + drawn(seed, f'order {number}') % _SEEDS}"
        yield PlannedWorld(World(THREADS, "program", order), "turns of threads")


def weakest(worlds: Iterable[World], weak: Callable[[World], bool]) -> World | None:
    """Return the first world in which something is weak, with as little in it as will do.

    Args:
        worlds: in the order in which they are tried.
        weak: tells whether it is; the same whenever it is asked.
    """
    found = next(filter(weak, worlds), None)
    while found is not None:
        less = next(filter(weak, shortened(found)), None)
        if less is None:
            break
        found = less
    return found


def shortened(world: World) -> Iterator[World]:
    """Give worlds with less in them, but something: of a specimen, without one part of it."""
    if world.dimension != SPECIMEN:
        return
    parts = world.how.split(",") if world.how else []
    fewer = [",".join((*parts[:place], *parts[place + 1 :])) for place in range(len(parts))]
    less = [World(SPECIMEN, world.where, world.how), World(SPECIMEN, "+0us", world.how, world.seed)]
    less += [World(SPECIMEN, world.where, how, world.seed) for how in fewer]
    yield from (one for one in less if one != world and (one.how or one.seed or one.ahead))
