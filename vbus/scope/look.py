"""The samples of one chip as rows of its lanes, taken down where they are made.

Compiled with the core: while somebody watches, this runs in every sample of every axis; while
nobody does, none of it is there, and nothing asks for it.
"""

from collections.abc import Callable
from typing import Any, Final

from vbus.board.board import Board
from vbus.chips.base import Chip
from vbus.kernel import END, MS, NEVER, SECOND
from vbus.kernel.kernel import Timer
from vbus.scope.lane import Lane
from vbus.scope.lanes import Lanes
from vbus.scope.registers import ChipRegisters
from vbus.signals.axis import Plant
from vbus.signals.net import Net

FIRST_REST: Final = MS
LONGEST_REST: Final = SECOND
"""How soon a chip that rests is looked at again: each time it still rests, twice as late."""


class Behind:
    """The mechanics behind an axis, and the lanes of what they tell.

    Args:
        plant: the mechanics.
        lanes: a lane for each of their ``LANES``.
    """

    def __init__(self, plant: Plant, lanes: list[Lane]) -> None:
        self.plant: Plant = plant
        self.lanes: list[Lane] = lanes

    def note(self, now: int, ahead: int) -> None:
        """Take what holds from ``ahead`` (ps) on; what is told first, from now on."""
        values = self.plant.lane_values()
        for place, lane in enumerate(self.lanes):
            lane.note(now if lane.last is None else ahead, values[place])


class Look:
    """Looks at one chip, its plants and its pins.

    Args:
        board: the board.
        chip: the chip.
        lanes: all lanes.
        levels: the pins looked at, where their edges are not told.

    Attributes:
        registers: what is in the chip.
        on_interrupt: takes what is said of an interrupt as it comes.
    """

    def __init__(
        self, board: Board, chip: Chip, lanes: Lanes, levels: list[tuple[Net, Lane]]
    ) -> None:
        self._board: Board = board
        self._chip: Chip = chip
        self.registers: ChipRegisters = ChipRegisters(chip, lanes)
        self._inside: bool = False
        self._polled: tuple[int, int] | None = None
        """What was read last, and where, if such a read does nothing to the chip."""
        told: list[tuple[str, Lane]] = lanes.telemetry[chip.name]
        self._told: list[tuple[str, Lane]] = told
        self._lanes: list[Lane] = [lane for _, lane in told]
        self._direct: bool = len(chip.lane_values()) == len(told) + 1
        """Whether the chip gives its values without their names."""
        self._plants: list[Behind] = []
        for plant, _, lane in lanes.plants[chip.name]:
            if not self._plants or self._plants[-1].plant is not plant:
                self._plants.append(Behind(plant, []))
            self._plants[-1].lanes.append(lane)
        self._levels: list[tuple[Net, Lane]] = levels
        self._rest: int = 0
        self._raised: bool = False
        self.on_interrupt: Callable[[str], None] | None = None
        self.timer: Timer = board.kernel.onlooker(self.look)
        self.ready: Timer = board.kernel.onlooker(self._look_inside)

    def look(self) -> None:
        """Take down what is new, and look again at the next sample."""
        chip = self._chip
        now: int = self._board.kernel.now
        if self._direct and not self._inside:
            values = chip.lane_values()
            for place, lane in enumerate(self._lanes):
                lane.note(now, values[place])
            raised = values[-1] != 0
        else:
            raised = self._ask(now)
        due: int = chip.next_sample()
        # The mechanics run one period ahead: what they tell holds when it is over.
        ahead = now if due == NEVER else due
        for behind in self._plants:
            behind.note(now, ahead)
        for net, lane in self._levels:
            lane.note(now, net.value)
        if raised and not self._raised and self.on_interrupt is not None:
            self.on_interrupt(f"{chip.name}: interrupt")
        self._raised = raised
        if due == NEVER:
            self._rest = min(max(2 * self._rest, FIRST_REST), LONGEST_REST)
            due = now + self._rest
        else:
            self._rest = 0
        self.timer.at(due if due <= END else NEVER)

    def _ask(self, now: int) -> bool:
        """Take down what the chip tells by name; return whether it interrupts."""
        values: dict[str, Any] = self._chip.telemetry()
        for key, lane in self._told:
            value = values.get(key)
            if isinstance(value, int | float):
                lane.note(now, value)
        if self._inside:
            self.registers.note(now, values)
        return bool(values.get("interrupt", 0) != 0)

    def look_inside(self, on: bool) -> None:
        """Look at its registers from now on, or no longer."""
        if on == self._inside:
            return
        self._inside = on
        if on:
            self._look_inside()
        else:
            self.ready.cancel()
            self.registers.forget(self._board.kernel.now)

    def _look_inside(self) -> None:
        self.registers.look(self._board.kernel.now)

    def meet(self, write: bool, address: int, data: int) -> None:
        """A bus cycle has been: look at what it did, and again when the chip is ready."""
        free = not write and address in self._chip.FREE_READS
        polled = self._polled
        self._polled = (address, data) if free else None
        again = polled is not None and polled == self._polled
        if not again:  # a poll that reads the same does nothing
            self.wake()
        if self._inside and not free:
            self._look_inside()
            ready: int = self._chip.ready_at()
            if self._board.kernel.now < ready <= END:
                self.ready.at(ready)

    def wake(self) -> None:
        """Something has touched the chip: one that rested may rest no more."""
        if self._rest:
            self._rest = 0
            self.timer.at(self._board.kernel.now)
