"""What differs between two runs: first what the host did, then what the motors did of it."""

from collections.abc import Iterator
from dataclasses import dataclass
from itertools import zip_longest
from typing import Final

from vbus.chips.packets import cited
from vbus.core.kernel import MS, NEVER
from vbus.protocols.quantities import format_instant
from vbus.views.runs.motion import STEP, AxisCourse, Move
from vbus.views.runs.run import Run, Said

HOST: Final = "host"
ANSWER: Final = "answer"
INSTANT: Final = "instant"
MOTOR: Final = "motor"
COST: Final = "cost"
VIOLATIONS: Final = "violations"

COUNTS: Final = "counts"
PS: Final = "ps"


@dataclass(frozen=True, slots=True)
class Tolerance:
    """How far apart two runs may be that are said to be equal.

    Attributes:
        counts: of positions.
        time: of times, as a share of the first run's.
        cycles: of the number of bus cycles, as a share of the first run's.
        limit: the first run's times and cycles are limits: the other may be better by any amount.
    """

    counts: int = 0
    time: float = 0.0
    cycles: float = 0.0
    limit: bool = False

    def near(self, was: int, now: int, share: float) -> bool:
        """Tell whether a time or a number of cycles is near enough to what it was."""
        return now - was <= share * was and (self.limit or was - now <= share * was)


EXACT: Final = Tolerance()


@dataclass(frozen=True, slots=True)
class Difference:
    """One thing that differs.

    Attributes:
        part: :data:`HOST`, :data:`ANSWER`, :data:`INSTANT`, :data:`MOTOR`, :data:`COST` or
            :data:`VIOLATIONS`.
        what: what of it, as ``"packet 7"`` or ``"x.1, move 1: overshoot"``.
        was: of the first run; None if that has no such thing.
        now: of the second.
        unit: of both, if they are numbers: :data:`COUNTS`, :data:`PS` or "".
        was_ps: instant in the first run, if it has one (ps).
        now_ps: instant in the second.
    """

    part: str
    what: str
    was: int | str | None
    now: int | str | None
    unit: str = ""
    was_ps: int | None = None
    now_ps: int | None = None

    def lines(self, was: str = "first", now: str = "second") -> list[str]:
        """Return it as people read it; ``was`` and ``now`` are what the two runs are called."""
        width = max(len(was), len(now)) + 1
        return [
            f"{self.part}: {self.what}",
            f"  {was + ':':{width}} {_side(self.was, self.unit, self.was_ps)}",
            f"  {now + ':':{width}} {_side(self.now, self.unit, self.now_ps)}",
        ]


def _side(value: int | str | None, unit: str, when: int | None) -> str:
    if value is None:
        return "nothing"
    if unit == PS:
        return f"{int(value) / MS:.6g} ms"
    shown = f"{value} {unit}".rstrip()
    return shown if when is None else f"{format_instant(when)} {shown}"


def differences(was: Run, now: Run, tolerance: Tolerance = EXACT) -> Iterator[Difference]:
    """Give what differs between two runs of the same board."""
    yield from host_differences(was.host, now.host, tolerance)
    yield from motor_differences(was.axes, now.axes, tolerance)
    yield from cost_differences(was, now, tolerance)
    for chip, rule in sorted(was.violations | now.violations):
        counts = was.violations[chip, rule], now.violations[chip, rule]
        # How often, not when: a violation more is a difference whatever the tolerance.
        if counts[0] != counts[1]:
            yield Difference(VIOLATIONS, f"{chip} {rule}", *counts)


def host_differences(
    was: list[Said], now: list[Said], tolerance: Tolerance = EXACT
) -> Iterator[Difference]:
    """Give the first other answer and instant, and the first packet that is another one.

    They come in the order of their packets. What comes of that packet is not compared: answers and
    instants are compared up to where it begins.
    """
    same = next(
        (number for number, pair in enumerate(zip_longest(was, now)) if not _asked_alike(*pair)),
        len(was),
    )
    # One run may simply go on for longer: the other then has nothing there.
    other = [run[same] if same < len(run) else None for run in (was, now)]
    begins = [said.begun if said else NEVER for said in other]
    given: set[str] = set()
    for number, pair in enumerate(zip(was[:same], now[:same], strict=True), 1):
        a, b = pair[0].when, pair[1].when
        over = a < begins[0] and b < begins[1]
        if not over:  # a poll that goes on beside that packet: its beginning may still be before it
            a, b = pair[0].begun, pair[1].begun
            if a >= begins[0] or b >= begins[1]:
                continue
        differs = {
            ANSWER: over and pair[0].text != pair[1].text,
            INSTANT: not tolerance.near(a, b, tolerance.time),
        }
        for part in differs:
            if differs[part] and part not in given:
                given.add(part)
                yield _packets(part, number, *pair)
    if same < max(len(was), len(now)):
        yield _packets(HOST, same + 1, *other)


def _asked_alike(a: Said | None, b: Said | None) -> bool:
    return a is not None and b is not None and a.asked == b.asked


def _packets(part: str, number: int, a: Said | None, b: Said | None) -> Difference:
    return Difference(
        part,
        f"packet {number}",
        _told(a) if a else None,
        _told(b) if b else None,
        was_ps=a.when if a else None,
        now_ps=b.when if b else None,
    )


def _told(said: Said) -> str:
    return said.text + cited(said.clause)


def motor_differences(
    was: dict[str, AxisCourse], now: dict[str, AxisCourse], tolerance: Tolerance = EXACT
) -> Iterator[Difference]:
    """Give what the axes did otherwise: move by move, then as a whole."""
    for axis, course in was.items():
        other = now[axis]
        if len(course.moves) != len(other.moves):
            yield Difference(MOTOR, f"{axis}: moves", len(course.moves), len(other.moves))
        for number, pair in enumerate(zip(course.moves, other.moves, strict=False), 1):
            yield from move_differences(f"{axis}, move {number}", *pair, tolerance)
        numbers = {
            "final position": (course.final, other.final),
            "peak error": (course.peak_error, other.peak_error),
        }
        yield from _apart(axis, numbers, tolerance)


def move_differences(what: str, was: Move, now: Move, tolerance: Tolerance) -> Iterator[Difference]:
    """Give what a move did otherwise."""
    if not tolerance.near(was.duration, now.duration, tolerance.time):
        yield Difference(MOTOR, f"{what}: takes", was.duration, now.duration, PS)
    numbers = {
        "begins at": (was.path[0], now.path[0]),
        "ends at": (was.path[-1], now.path[-1]),
        "overshoot": (was.overshoot, now.overshoot),
    }
    yield from _apart(what, numbers, tolerance)
    # Look by look only to the first difference: all later ones follow from it.
    for look in range(max(len(was.path), len(now.path))):
        place = min(look, len(now.path) - 1)
        # A look may fall a little earlier or later into the same motion.
        near = [was.path[min(max(n, 0), len(was.path) - 1)] for n in (look - 1, look, look + 1)]
        slack = tolerance.counts
        if slack:
            low, high = min(near) - slack, max(near) + slack
        else:
            low = high = near[1]
        if not low <= now.path[place] <= high:
            where = f"{what}: {look * STEP / MS:g} ms after its beginning at"
            yield Difference(MOTOR, where, near[1], now.path[place], COUNTS)
            return


def _apart(
    what: str, numbers: dict[str, tuple[int, int]], tolerance: Tolerance
) -> Iterator[Difference]:
    for name, (was, now) in numbers.items():
        if abs(was - now) > tolerance.counts:
            yield Difference(MOTOR, f"{what}: {name}", was, now, COUNTS)


def cost_differences(was: Run, now: Run, tolerance: Tolerance = EXACT) -> Iterator[Difference]:
    """Give bus cycles and chip time, if they are not alike."""
    if not tolerance.near(was.cycles, now.cycles, tolerance.cycles):
        yield Difference(COST, "bus cycles", was.cycles, now.cycles)
    if not tolerance.near(was.duration, now.duration, tolerance.time):
        yield Difference(COST, "chip time", was.duration, now.duration, PS)
