"""Where the axis stands: the encoder's course through the plant's present period; the position
counter, and what watches it: breakpoint, captures."""

from typing import ClassVar, Final

from mypy_extensions import i64

from vbus.chips.mcp1200 import datasheet as ds
from vbus.chips.mcp1200.control_loop import ExceptionSources
from vbus.chips.mcp1200.registers import FAR, RegisterFile
from vbus.chips.mcp1200.stepper import Stepper
from vbus.core.bits import wrap, wrap_word
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
    WIRING: ClassVar[Names] = (
        "_home", "_pulses", "_servo", "_switched", "_switches", "clk_hz", "limits",
    )  # fmt: skip
    DERIVED: ClassVar[Names] = ("_prepared",)

    def __init__(self, clk_hz: int) -> None:
        self.clk_hz: float = float(clk_hz)
        self.plant: Plant | None = None
        self.limits: list[Switch] = []
        self._home: Switch | None = None
        self._switches: list[Switch] = []
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
        self._switches = self.limits[:]
        if home and "home" in plant.switches:
            self._home = plant.switches["home"]
            self._switches.append(self._home)
        self._switched = len(self._switches) > 0

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
        # MCP-ENC-1: R1A bit 7 turns the direction; the position goes on from where it is.
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
        # Samples of one length, as nearly always, prepare the plant once.
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
        # In most periods nothing is waited for: no edge is looked for.
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
        # Ahead alone: one that is not, which a wrong plant may give, would be looked for for ever.
        if armed:
            away = wrap_word(compare - self.offset - self.direction * here, 0x800000)
            away *= self.direction
            if 0 < away * towards < nearest:
                nearest = away * towards
        if found and 0 < (index - here) * towards < nearest:
            nearest = (index - here) * towards
        if self.inside:
            nearest = 1
        for switch in self._switches:
            changes, place = switch.change_between(here, self._last)
            if changes and 0 < (place - here) * towards < nearest:
                nearest = (place - here) * towards
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
        # Rounded up: an edge is taken in by the next clock.
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


class Breakpoint:
    """The 24-bit register compared with the position at every count (MCP-BRK).

    Args:
        registers: the registers.

    Attributes:
        compare: the position it waits for.
    """

    STATE: ClassVar[Names] = ("compare", "_reached: bool", "_found: bool", "_loaded")

    def __init__(self, registers: RegisterFile) -> None:
        self._registers: Final[RegisterFile] = registers
        self._loaded: i64 = 0
        self.compare: i64 = -0x800000
        self._reached: bool = False
        """Repeat mode: reached since the last look at a sample's start."""
        self._found: bool = False
        """Reached before the present sample's start: the routine moves on."""

    @property
    def armed(self) -> bool:
        """Whether the feature is on."""
        return self._registers.config & ds.BREAK_ENABLE != 0

    @property
    def waiting(self) -> bool:
        """Whether the next sample's start finds something new for the routine."""
        registers = self._registers
        if registers.config & ds.BREAK_REPEAT:
            return self._reached
        return registers.breakpoint != self.compare

    def clear(self) -> None:
        """Back to the state after reset."""
        self.compare = -0x800000
        self._reached = False
        self._found = False

    def reached(self) -> None:
        """The position has become equal to :attr:`compare`."""
        self._reached = self._registers.config & ds.BREAK_REPEAT != 0

    def sample(self) -> bool:
        """Look at the registers at a sample's start; tell whether the routine has work to do."""
        self._loaded = self._registers.breakpoint
        # MCP-BRK-3: a match counts for the routine of the sample that starts after it.
        if self._registers.config & ds.BREAK_REPEAT:
            self._found = self._reached
            return self._found
        self._reached = False
        self._found = False
        return self._loaded != self.compare

    def routine(self) -> bool:
        """Load or move the compare register; tell whether flag and pin are to be released.

        A repeat pulse noticed at the sample's start ends here, so none is shorter than the 67
        clocks this comes later (MCP-BRK-3).
        """
        # MCP-BRK-2: in single mode the routine copies R3D to R3F.
        if not self._found:
            self.compare = self._loaded
            return False
        # MCP-BRK-3: added, signed; the release ends the pulse.
        self.compare = wrap(self.compare + self._loaded, 24)
        self._found = False
        self._reached = False
        return True


def index_edge(registers: RegisterFile, rising: bool, position: i64) -> None:
    """INDEX has changed: set its latch, and store the position if asked (MCP-CAP-2, 3)."""
    control = registers.capture_control
    # MCP-CAP-2, MCP-CAP-3: the chosen edge sets the latch; while it is set nothing is captured.
    if rising == bool(control & ds.INDEX_RISING) and not control & ds.INDEX_LATCH:
        registers.capture_control = control | ds.INDEX_LATCH
        if control & ds.INDEX_CAPTURE:
            registers.capture = position


def trigger_edge(registers: RegisterFile, position: i64) -> None:
    """TRIG has fallen: the same for its latch, while the pin is an input (MCP-CAP-2, 3)."""
    control = registers.capture_control
    # MCP-CAP-2, MCP-CAP-4: only as an input; the breakpoint does not drive it then.
    if control & ds.TRIG_INPUT and not control & ds.TRIG_LATCH:
        registers.capture_control = control | ds.TRIG_LATCH
        if control & ds.TRIG_CAPTURE:
            registers.capture = position


class PositionCounter:
    """One 24-bit counter with two sources: the encoder, or in step mode the step pulses.

    Args:
        registers: the registers.
        encoder: source of counts, and of index edges in either mode.
        stepper: source of steps.
        breakpoint: the compare register.
        faults: takes note of a breakpoint.
        index_high: the plant's index pulse is high.

    Attributes:
        at_match: step mode: cycle at which the breakpoint will be reached.
    """

    STATE: ClassVar[Names] = ("at_match",)
    WIRING: ClassVar[Names] = ("breakpoint",)

    def __init__(
        self,
        registers: RegisterFile,
        encoder: EncoderCourse,
        stepper: Stepper,
        breakpoint: Breakpoint,
        faults: ExceptionSources,
        index_high: bool,
    ) -> None:
        self._registers: Final[RegisterFile] = registers
        self._encoder: Final[EncoderCourse] = encoder
        self._stepper: Final[Stepper] = stepper
        self.breakpoint: Final[Breakpoint] = breakpoint
        self._faults: Final[ExceptionSources] = faults
        self._index_high: bool = index_high
        self.at_match: i64 = FAR

    def position(self, cycle: i64) -> i64:
        """The counter at ``cycle``, signed."""
        if self._registers.step_mode:
            return self._stepper.position(cycle)
        return self._encoder.position(cycle)

    def preset(self, position: int, cycle: int) -> None:
        """Load the counter."""
        if self._registers.step_mode:
            self._stepper.preset(position, cycle)
        else:
            self._encoder.preset(position, cycle)

    def equal(self, cycle: int) -> bool:
        """Whether the breakpoint feature is on and the counter stands at the breakpoint."""
        return self.breakpoint.armed and self.position(cycle) == self.breakpoint.compare

    def look_equal(self, before: bool, cycle: int) -> None:
        """Something has changed: entering equality is a match, staying is not (MCP-BRK-4)."""
        if not before and self.equal(cycle):
            self.match()
        self.replan(cycle)

    def match(self) -> None:
        """The counter has reached the breakpoint (MCP-BRK-1)."""
        # MCP-BRK-1: status bit 5 becomes 0, and TRIG goes low with it.
        self._registers.fault(ds.BREAKPOINT_OK)
        self._faults.breakpoint = True
        self.breakpoint.reached()

    def edge(self, cycle: int) -> None:
        """The encoder reaches a count that is waited for."""
        encoder = self._encoder
        count = encoder.at_count
        entered = encoder.enters_index()
        left = encoder.inside
        encoder.seen = count
        if self._registers.step_mode:
            position = self._stepper.position(cycle)
        else:
            position = wrap(encoder.offset + encoder.direction * count, 24)
            # MCP-BRK-1: compared at every count.
            if self.breakpoint.armed and position == self.breakpoint.compare:
                self.match()
        encoder.inside = entered
        if left:
            index_edge(self._registers, not self._index_high, position)
        if entered:
            index_edge(self._registers, self._index_high, position)
        self.plan()

    def count_external(self, direction: int, cycle: int) -> None:
        """An encoder on the CHA and CHB nets has moved by one count."""
        before = self.equal(cycle)
        self._encoder.add(direction)
        self.look_equal(before, cycle)

    def index_external(self, rising: bool, cycle: int) -> None:
        """The INDEX net has moved and passed its filter."""
        index_edge(self._registers, rising, self.position(cycle))

    def replan(self, cycle: int, steps_from: int = -1) -> None:
        """Look anew for what will be reached: a setting has changed, or steps begin.

        Args:
            cycle: when.
            steps_from: cycle after which steps count, if that is another.
        """
        self._encoder.look_from(cycle)
        self.at_match = FAR
        if self._registers.step_mode and self.breakpoint.armed:
            if steps_from < 0:
                steps_from = cycle
            ahead = wrap(self.breakpoint.compare - self._stepper.position(steps_from), 24)
            self.at_match = self._stepper.when(ahead, steps_from)
        self.plan()

    def plan(self) -> None:
        """Look for what the encoder will reach in its present period."""
        armed = self._registers.config & (ds.BREAK_ENABLE | ds.STEP_MODE) == ds.BREAK_ENABLE
        self._encoder.plan(armed, self.breakpoint.compare)
