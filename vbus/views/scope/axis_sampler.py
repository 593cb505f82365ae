"""The samples of one chip as rows of its lanes, taken down where they are made.

Compiled with the core: while the board has a scope, this runs in every sample of every axis;
without one, it is not there and costs nothing.
"""

from collections.abc import Callable
from heapq import heappop, heappush
from typing import Final

from mypy_extensions import i64

from vbus.board.board import Board
from vbus.chips.base import SAMPLE, Chip
from vbus.core.kernel import END, MS, NEVER, SECOND, Kernel
from vbus.core.kernel.kernel import Timer
from vbus.core.signals.axis import Plant
from vbus.core.signals.net import Net
from vbus.views.scope.lane import Lane
from vbus.views.scope.lanes import Lanes
from vbus.views.scope.registers import ChipRegisters

# Four samples of an LM629: a chip that stops for one is seen again at once.
FIRST_REST: Final = MS
# What moves a chip that rests from outside, an encoder by hand, shows within this.
LONGEST_REST: Final = SECOND
"""How soon a chip that rests is looked at again: each time it still rests, twice as late. So it
costs ten looks, and then one a second."""


_NEVER: Final[i64] = int(NEVER)
_END: Final[i64] = int(END)
"""As machine words: a compiled core keeps literals this large as objects."""


class SampleSchedule:
    """When each chip is looked at next: one timer for all, one entry for those due together.

    Args:
        kernel: the board's time.
    """

    def __init__(self, kernel: Kernel) -> None:
        self._kernel: Kernel = kernel
        self._timer: Timer = kernel.onlooker(self._look)
        self._dues: list[int] = []
        """Instants in a heap, each once."""
        self._looks: dict[int, list[AxisSampler]] = {}

    def at(self, look: "AxisSampler", when: i64) -> None:
        """Look at ``when`` (ps); an earlier setting is forgotten."""
        if when == look.due:
            return
        look.due = when
        # A chip that is never due again costs no entry in the heap.
        if when > _END:
            return
        due: int = when
        together = self._looks.get(due)
        if together is not None:
            together.append(look)
            return
        self._looks[due] = [look]
        heappush(self._dues, due)
        if self._dues[0] == due:
            self._timer.at(due)

    def _look(self) -> None:
        due = heappop(self._dues)
        when: i64 = due
        for look in self._looks.pop(due):
            # An entry that was put off stays in its list, and is passed over here.
            if look.due == when:
                look.due = _NEVER
                look.look()
        if self._dues:
            self._timer.at(max(self._dues[0], int(self._kernel.now)))


def take_down(lanes: list[Lane], when: object, steps: list[int | float]) -> None:
    """Give lanes the values that hold from ``when`` (int, ps) on: one that is whole is in steps."""
    for place, lane in enumerate(lanes):
        step = steps[place]
        if isinstance(step, int):
            lane.take(when, step)
        else:
            lane.note(when, step)  # type: ignore[arg-type]


class PlantLanes:
    """The mechanics behind an axis, and the lanes of what they tell.

    Args:
        plant: the mechanics.
        lanes: the lanes of their ``VALUES``.
    """

    def __init__(self, plant: Plant, lanes: list[Lane]) -> None:
        self.plant: Plant = plant
        self.lanes: list[Lane] = lanes
        self._steps: Callable[[Plant], list[int | float]] = plant.VALUES.steps(1)
        self._latest: int = 0

    def note(self, now: int, ahead: int) -> None:
        """Take what holds from ``ahead`` (ps) on; the row that comes first, from now on."""
        if ahead < self._latest:
            for lane in self.lanes:
                lane.early = True
        self._latest = ahead
        take_down(self.lanes, now if self.lanes[0].untold else ahead, self._steps(self.plant))


class AxisSampler:
    """Looks at one chip, its plants and its pins.

    Args:
        board: the board.
        times: when chips are looked at.
        chip: the chip.
        lanes: all lanes.
        levels: the pins looked at, where their edges are not observed.

    Attributes:
        registers: what is in the chip.
        due: when it is looked at next (ps); for :class:`SampleSchedule`.
        on_interrupt: takes what is said of an interrupt as it comes.
    """

    def __init__(
        self,
        board: Board,
        times: SampleSchedule,
        chip: Chip,
        lanes: Lanes,
        levels: list[tuple[Net, Lane]],
    ) -> None:
        self._kernel: Kernel = board.kernel
        self._times: SampleSchedule = times
        self.due: i64 = _NEVER
        self._chip: Chip = chip
        self.registers: ChipRegisters = ChipRegisters(chip, lanes)
        self._inside: bool = False
        self._polled: tuple[int, int] | None = None
        """What was read last, and where, if such a read does nothing to the chip."""
        self._lanes: list[Lane] = lanes.values[chip.name]
        self._steps: Callable[[Chip], list[int | float]] = chip.VALUES.steps(chip.axis_count)
        self._plants: list[PlantLanes] = [
            PlantLanes(plant, behind) for plant, behind in lanes.plants[chip.name] if behind
        ]
        self._levels: list[tuple[Net, Lane]] = levels
        self._rest: int = 0
        self._at_samples: bool = True
        self._raised: bool = False
        self.on_interrupt: Callable[[str], None] | None = None
        self._ready: Timer = board.kernel.onlooker(self._look_inside)

    def look(self) -> None:
        """Take down what is new, and look again at the next sample."""
        chip = self._chip
        now: int = self._kernel.now
        when: object = now
        chip.advance()
        steps = self._steps(chip)
        take_down(self._lanes, when, steps)
        # The last step is no lane: whether the chip interrupts.
        raised = steps[-1] != 0
        if self._inside:
            self.registers.note(now)
        due: i64 = chip.due(SAMPLE)
        # The mechanics run one period ahead: what they tell holds when it is over.
        ahead: int = now if due == _NEVER else due
        for behind in self._plants:
            behind.note(now, ahead)
        for net, lane in self._levels:
            lane.take(when, net.value)
        if raised and not self._raised and self.on_interrupt is not None:
            self.on_interrupt(f"{chip.name}: interrupt")
        self._raised = raised
        if not self._at_samples:
            return
        if due == _NEVER:
            self._rest = min(max(2 * self._rest, FIRST_REST), LONGEST_REST)
            due = self._kernel.now + self._rest
        else:
            self._rest = 0
        self._times.at(self, due)

    def look_at_samples(self, on: bool) -> None:
        """Look at each sample from now on, or only when :meth:`look` is called."""
        if on != self._at_samples:
            self._at_samples = on
            self._rest = 0
            self._times.at(self, self._kernel.now if on else _NEVER)

    def stop(self) -> None:
        """Look no more."""
        self.due = _NEVER
        self._ready.cancel()

    def look_inside(self, on: bool) -> None:
        """Look at its registers from now on, or no longer."""
        if on == self._inside:
            return
        self._inside = on
        if on:
            self._look_inside()
        else:
            self._ready.cancel()
            self.registers.forget(self._kernel.now)

    def _look_inside(self) -> None:
        self.registers.look(self._kernel.now)

    def meet(self, write: bool, address: int, data: int) -> None:
        """A bus cycle has been: look at what it did, and again when the chip is ready."""
        # Reads that do nothing to the chip, such as a status: looking after them would show nothing
        # new.
        free = not write and address in self._chip.FREE_READS
        polled = self._polled
        self._polled = (address, data) if free else None
        again = polled is not None and polled == self._polled
        if not again:  # a poll that reads the same does nothing
            self.wake()
        if self._inside and not free:
            self._look_inside()
            ready: int = self._chip.ready_at()
            if self._kernel.now < ready <= END:
                self._ready.at(ready)

    def wake(self) -> None:
        """Something has touched the chip: one that rested may rest no more."""
        if self._rest:
            self._rest = 0
            self._times.at(self, self._kernel.now)
