"""The conformance suite of plants: what every plant owes the chip before it."""

from collections.abc import Callable
from random import Random
from typing import Final

from vbus.core.signals import Plant
from vbus.core.signals.axis import DRIVES
from vbus.core.state import load, save
from vbus.testing.checks import Nonconformance, demand, hand_over, packed

PERIOD: Final = 256e-6

Drive = tuple[float, ...]


def check_plant(factory: Callable[[], Plant], seed: int = 0, periods: int = 400) -> None:
    """Check that a plant keeps the contract of :class:`~vbus.core.signals.Plant`.

    Args:
        factory: makes the same plant again and again.
        seed: of the drives it is given.
        periods: for how many periods it is driven, in each way it takes.

    Raises:
        Nonconformance: it does not; says what differs, and where.
    """
    taken = factory().TAKES
    name = type(factory()).__name__
    strange = [kind for kind in taken if kind not in DRIVES]
    demand(
        bool(taken) and not strange,
        f"{name}: TAKES is {taken}; it holds some of {', '.join(DRIVES)}",
    )
    for kind in DRIVES:
        drives = _drives(kind, Random(seed), periods)
        if kind in taken:
            _Check(factory, name, kind, drives).run()
        else:
            plant = factory()
            plant.prepare(PERIOD)
            try:
                _give(plant, kind, drives[0])
            except TypeError:
                continue
            raise Nonconformance(f"{name}: TAKES leaves out {kind}, and {kind}() works")


def _drives(kind: str, random: Random, periods: int) -> list[Drive]:
    """Return drives that change now and then, with rest between."""
    drives: list[Drive] = []
    while len(drives) < periods:
        if kind == "drive":
            now: Drive = (random.uniform(-1, 1), random.randint(-50, 50))
        elif kind == "pulses":
            now = (random.randint(-20, 20),)
        else:
            now = (random.uniform(-1, 1), random.uniform(-1, 1), 0.0)
        rest = tuple(type(value)(0) for value in now)
        drives += [now] * random.randint(1, 30) + [rest] * random.randint(0, 30)
    return drives[:periods]


def _give(plant: Plant, kind: str, drive: Drive) -> int:
    if kind == "drive":
        return plant.drive(drive[0], int(drive[1]))
    return plant.pulses(int(drive[0])) if kind == "pulses" else plant.phases(*drive)


class _Check:
    def __init__(
        self, factory: Callable[[], Plant], name: str, kind: str, drives: list[Drive]
    ) -> None:
        self._factory = factory
        self._name = f"{name}.{kind}()"
        self._kind = kind
        self._drives = drives

    def run(self) -> None:
        plain = self._fresh()
        counts = [self._step(plain, drive, number) for number, drive in enumerate(self._drives)]
        self._snapshots(counts)
        again = self._fresh()
        looked = self._fresh()
        for number, drive in enumerate(self._drives):
            self._equal(counts, number, self._step(again, drive, number), "a second run")
            before = looked.count
            value = self._step(looked, drive, number)
            self._equal(counts, number, value, "a run in which it is observed")
            self._look(looked, before, number)
            self._rest(looked, drive, number)

    def _fresh(self) -> Plant:
        plant = self._factory()
        plant.prepare(PERIOD)
        return plant

    def _step(self, plant: Plant, drive: Drive, number: int) -> int:
        try:
            count = _give(plant, self._kind, drive)
        except Exception as error:
            raise Nonconformance(
                f"{self._name}: period {number} with {drive} raised {type(error).__name__}: {error}"
            ) from error
        demand(
            isinstance(count, int) and count == plant.count,
            f"{self._name}: period {number} returned {count!r}, and .count is {plant.count!r}:"
            " both are the whole count at the period's end",
        )
        return count

    def _equal(self, counts: list[int], number: int, count: int, what: str) -> None:
        demand(
            counts[number] == count,
            f"{self._name}: {what} differs: count {count} after period {number}, not"
            f" {counts[number]}",
        )

    def _look(self, plant: Plant, before: int, number: int) -> None:
        after = plant.count
        for fraction, expected in ((0.0, before), (1.0, after)):
            found = plant.count_at(fraction)
            demand(
                found == expected,
                f"{self._name}: period {number} went from {before} to {after}, and"
                f" count_at({fraction}) is {found}",
            )
        if after != before:
            place = plant.fraction_at(after)
            demand(
                0.0 <= place <= 1.0,
                f"{self._name}: fraction_at({after}) is {place} in period {number}; it lies from 0"
                " to 1",
            )
        plant.index_between(before, after)
        plant.resting()
        save(plant)

    def _rest(self, plant: Plant, drive: Drive, number: int) -> None:
        """A plant that rests stays as it is when the same drive goes on."""
        if not plant.resting():
            return
        twin = self._fresh()
        load(twin, save(plant))
        state = packed(self._name, save(twin))
        _give(twin, self._kind, drive)
        demand(
            packed(self._name, save(twin)) == state,
            f"{self._name}: resting() after period {number}, and another period with the same"
            " drive changes it",
        )

    def _snapshots(self, counts: list[int]) -> None:
        for place in (0, len(counts) // 3, len(counts) - 2):
            before = self._fresh()
            for drive in self._drives[:place]:
                _give(before, self._kind, drive)
            after = self._fresh()
            for drive in reversed(self._drives[:20]):
                _give(after, self._kind, drive)
            hand_over(self._name, before, after, f" after period {place}")
            demand(
                after.count == before.count,
                f"{self._name}: loading a state leaves .count at {after.count}, not {before.count}",
            )
            for number in range(place, len(counts)):
                count = self._step(after, self._drives[number], number)
                self._equal(counts, number, count, f"a run loaded after period {place}")
