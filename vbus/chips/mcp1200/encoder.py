"""The position counter, and the encoder's course through the plant's present period."""

from typing import ClassVar

from mypy_extensions import i64

from vbus.chips.mcp1200.timer import FAR
from vbus.core.bits import wrap_word
from vbus.core.signals import Plant, Switch
from vbus.core.state import Names


class EncoderCourse:
    """What the encoder does between two changes of the motor's drive.

    A plant's course through a period is known from the period's start, so every edge in it has
    its clock cycle: counts are placed by :meth:`Plant.fraction_at`, rounded up to the next clock.

    Args:
        clk_hz: clock frequency, to tell the plant its period.

    Attributes:
        direction: 1, or -1 while R1A bit 7 swaps the channels.
        offset: position minus ``direction`` times the plant's count.
        seen: plant count up to which edges have been handled.
        at: cycle of the next edge worth a look, :data:`FAR` if the period has none.
        at_count: plant count reached at it.
        end: cycle at which the period ends.
        inside: whether the encoder stands in its index position.
        external: counts from driven CHA and CHB nets, for the stall check.
    """

    STATE: ClassVar[Names] = (
        "direction", "offset", "seen", "at", "at_count", "end", "inside: bool", "external",
        "_start", "_length", "_first", "_last", "prepared", "plant: part | None",
    )  # fmt: skip
    WIRING: ClassVar[Names] = ("_home", "_pulses", "_servo", "_switched", "clk_hz", "limits")
    DERIVED: ClassVar[Names] = ("_prepared",)

    def __init__(self, clk_hz: int) -> None:
        self.clk_hz: float = float(clk_hz)
        self.plant: Plant | None = None
        self.limits: list[Switch] = []
        self._home: Switch | None = None
        self._switched: bool = False
        self.direction: i64 = 1
        self.offset: i64 = 0
        self.seen: i64 = 0
        self.at: i64 = FAR
        self.at_count: i64 = 0
        self.end: i64 = FAR
        self.inside: bool = False
        self.external: i64 = 0
        self._start: i64 = 0
        self._length: i64 = 1
        self._first: i64 = 0
        self._last: i64 = 0
        self._prepared: i64 = 0
        self._pulses: bool = False
        self._servo: bool = False

    def set_clock(self, hz: float) -> None:
        """Cycles are as long as at ``hz`` from the next period on."""
        self.clk_hz = hz
        self._prepared = 0

    def connect(self, plant: Plant, limits: bool, home: bool) -> None:
        """Attach the mechanics; ``limits`` and ``home`` say which of its switches are wired."""
        self.plant = plant
        self._pulses = "pulses" in plant.TAKES
        self._servo = "drive" in plant.TAKES
        self._first = self._last = self.seen = plant.count
        self.offset = -plant.count
        if limits:
            for name in ("limit+", "limit-"):
                if name in plant.switches:
                    self.limits.append(plant.switches[name])
        if home:
            self._home = plant.switches.get("home")
        self._switched = len(self.limits) > 0 or self._home is not None

    # -- where it stands ----------------------------------------------------------------------

    def count(self, cycle: i64) -> i64:
        """Plant count at ``cycle`` of the present period."""
        past = cycle - self._start
        if past >= self._length or self._first == self._last or self.plant is None:
            return self._last
        return self._count_within(past)

    def _count_within(self, past: i64) -> i64:
        """Plant count so many clocks after the beginning of the present period."""
        if past <= 0 or self.plant is None:
            return self._first
        return self.plant.count_at(float(past) / float(self._length))

    def position(self, cycle: i64) -> i64:
        """The 24-bit position counter at ``cycle``."""
        count = self.count(cycle)
        return wrap_word(self.offset + self.direction * count, 0x800000)

    def preset(self, position: int, cycle: int) -> None:
        """Load the counter."""
        self.offset = position - self.direction * self.count(cycle)

    def swap(self, swapped: bool, cycle: int) -> None:
        """Exchange the channels, or put them back; the counter keeps its value."""
        here = self.offset + self.direction * self.count(cycle)
        self.direction = -1 if swapped else 1
        self.offset = here - self.direction * self.count(cycle)

    def add(self, counts: int) -> None:
        """Counts of an encoder on the CHA and CHB nets."""
        self.external += counts
        self.offset += self.direction * counts

    # -- periods ------------------------------------------------------------------------------

    @property
    def prepared(self) -> int:
        """For what length of a period the plant is prepared (clock cycles); 0: for none."""
        return self._prepared

    @prepared.setter
    def prepared(self, length: int) -> None:
        self._prepared = length
        if length and self.plant is not None:
            self.plant.prepare(float(length) / self.clk_hz)

    def error(self, aim: i64) -> i64:
        """How far the plant's period has ended from position ``aim``, in the plant's counts."""
        position = self.offset + self.direction * self._last
        return self.direction * wrap_word(aim - position, 0x800000)

    def run(self, end: i64, command: float, error: i64, stepping: bool, steps: i64) -> None:
        """Run the plant from where its last period has ended to ``end``.

        Args:
            end: cycle at which the period ends.
            command: fraction of full scale; 0.0 in step mode.
            error: counts to go for a plant that follows exactly.
            stepping: step mode: a plant that takes both is given steps.
            steps: steps in the period; 0 in any other mode.
        """
        if self.plant is None:
            return
        plant: Plant = self.plant
        start = self.end
        length = end - start
        self._start = start
        self._length = length
        self.end = end
        if length != self._prepared:
            self._prepared = length
            plant.prepare(float(length) / self.clk_hz)
        count = plant.count
        self._first = count
        self.seen = count
        if (stepping and self._pulses) or not self._servo:
            self._last = plant.pulses(steps)
        else:
            self._last = plant.drive(command, error)

    def skip(self, cycles: int) -> None:
        """Time has passed in which nothing moved."""
        if self.plant is not None:
            self._start += cycles
            self.end += cycles

    def resting(self) -> bool:
        """Whether nothing will move until the drive changes."""
        plant = self.plant
        return plant is None or (self._first == self._last and plant.resting())

    # -- edges --------------------------------------------------------------------------------

    def limit_level(self) -> int:
        """Level the wired limit switches pull /LIMIT to, with the axis at :attr:`seen`."""
        level = 1
        for switch in self.limits:
            level &= switch.level(self.seen)
        return level

    def home_level(self) -> int:
        """Level of the wired home switch, with the axis at :attr:`seen`."""
        return 1 if self._home is None else self._home.level(self.seen)

    def plan(self, armed: bool, compare: i64) -> None:
        """Find the next edge after :attr:`seen`: breakpoint, index, or a switch.

        Args:
            armed: whether position ``compare`` is worth an edge.
            compare: breakpoint position.
        """
        self.at = FAR
        if self.seen == self._last or self.plant is None:
            return
        found, count = self.plant.index_between(self.seen, self._last)
        if found or armed or self.inside or self._switched:
            self._look_for_edge(found, count, armed, compare)

    def _look_for_edge(self, found: bool, index: i64, armed: bool, compare: i64) -> None:
        """Find it where there may be one; ``index``: the count of an index that was ``found``."""
        here = self.seen
        towards: i64 = 1
        if self._last < here:
            towards = -1
        far = (self._last - here) * towards
        nearest = far + 1
        if armed:
            away = wrap_word(compare - self.offset - self.direction * here, 0x800000)
            away *= self.direction
            if 0 < away * towards < nearest:
                nearest = away * towards
        if found:
            nearest = min(nearest, (index - here) * towards)
        if self.inside:
            nearest = 1
        if self._switched:
            for switch in self.limits:
                nearest = min(nearest, _boundary(switch, here, towards, nearest))
            if self._home is not None:
                nearest = min(nearest, _boundary(self._home, here, towards, nearest))
        if nearest > far:
            return
        self.at_count = here + towards * nearest
        self.at = self._cycle_of(self.at_count)

    def _cycle_of(self, count: int) -> int:
        plant = self.plant
        if plant is None:
            return FAR
        place = plant.fraction_at(count) * float(self._length)
        cycles: i64 = int(place)
        if float(cycles) < place:
            cycles += 1
        return self._start + min(max(cycles, 0), self._length)

    def enters_index(self) -> bool:
        """Whether going from :attr:`seen` to :attr:`at_count` enters an index position."""
        plant = self.plant
        return plant is not None and plant.index_between(self.seen, self.at_count)[0]

    def look_from(self, cycle: int) -> None:
        """Edges before ``cycle`` are past: a setting has changed."""
        here = self.count(cycle)
        if self.at != FAR:
            towards = 1 if self.at_count > self.seen else -1
            if (here - self.at_count) * towards >= 0:
                here = self.at_count - towards
        self.seen = here


def _boundary(switch: Switch, here: int, towards: int, nearest: int) -> int:
    """Counts from ``here`` to the next place where the switch changes, or ``nearest``."""
    for edge in (switch.low, switch.high):
        # Going up it changes on reaching the bound, going down on leaving it.
        target = edge if towards > 0 else edge - 1
        away = (target - here) * towards
        if 0 < away < nearest:
            nearest = away
    return nearest
