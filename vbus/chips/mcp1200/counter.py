"""The actual position counter, and the hardware that watches every count of it: breakpoint compare,
index and trigger capture."""

from typing import ClassVar, Final

from mypy_extensions import i64

from vbus.chips.mcp1200 import datasheet as ds
from vbus.chips.mcp1200.encoder import EncoderCourse
from vbus.chips.mcp1200.faults import ExceptionSources
from vbus.chips.mcp1200.registers import RegisterFile
from vbus.chips.mcp1200.stepper import Stepper
from vbus.chips.mcp1200.timer import FAR
from vbus.core.bits import wrap
from vbus.core.state import Names


class Breakpoint:
    """The 24-bit register compared with the position at every count (MCP-BRK).

    Args:
        registers: the registers.

    Attributes:
        compare: the position it waits for.
    """

    STATE: ClassVar[Names] = ("compare", "_reached: bool", "_found: bool", "_loaded")
    WIRING: ClassVar[Names] = ("_registers",)

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
        if not self._found:
            self.compare = self._loaded
            return False
        self.compare = wrap(self.compare + self._loaded, 24)
        self._found = False
        self._reached = False
        return True


def index_edge(registers: RegisterFile, rising: bool, position: i64) -> None:
    """INDEX has changed: set its latch, and store the position if asked (MCP-CAP-2, 3)."""
    control = registers.capture_control
    if rising == bool(control & ds.INDEX_RISING) and not control & ds.INDEX_LATCH:
        registers.capture_control = control | ds.INDEX_LATCH
        if control & ds.INDEX_CAPTURE:
            registers.capture = position


def trigger_edge(registers: RegisterFile, position: i64) -> None:
    """TRIG has fallen: the same for its latch, while the pin is an input (MCP-CAP-2, 3)."""
    control = registers.capture_control
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
        at_pins: cycle at which a level at CHA, CHB or INDEX will have passed its filter.
    """

    STATE: ClassVar[Names] = ("at_match",)
    DERIVED: ClassVar[Names] = ("at_pins",)
    WIRING: ClassVar[Names] = (
        "_breakpoint", "_encoder", "_faults", "_index_high", "_registers", "_stepper",
    )  # fmt: skip

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
        self._breakpoint: Final[Breakpoint] = breakpoint
        self._faults: Final[ExceptionSources] = faults
        self._index_high: bool = index_high
        self.at_match: i64 = FAR
        self.at_pins: i64 = FAR

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
        return self._breakpoint.armed and self.position(cycle) == self._breakpoint.compare

    def look_equal(self, before: bool, cycle: int) -> None:
        """Something has changed: entering equality is a match, staying is not (MCP-BRK-4)."""
        if not before and self.equal(cycle):
            self.match()
        self.replan(cycle)

    def match(self) -> None:
        """The counter has reached the breakpoint (MCP-BRK-1)."""
        self._registers.fault(ds.BREAKPOINT_OK)
        self._faults.breakpoint = True
        self._breakpoint.reached()

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
            if self._breakpoint.armed and position == self._breakpoint.compare:
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
        if self._registers.step_mode and self._breakpoint.armed:
            if steps_from < 0:
                steps_from = cycle
            ahead = wrap(self._breakpoint.compare - self._stepper.position(steps_from), 24)
            self.at_match = self._stepper.when(ahead, steps_from)
        self.plan()

    def plan(self) -> None:
        """Look for what the encoder will reach in its present period."""
        armed = self._registers.config & (ds.BREAK_ENABLE | ds.STEP_MODE) == ds.BREAK_ENABLE
        self._encoder.plan(armed, self._breakpoint.compare)
