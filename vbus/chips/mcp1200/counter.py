"""The actual position counter, and the hardware that watches every count of it."""

from typing import ClassVar

from mypy_extensions import i64

from vbus.bits import wrap
from vbus.chips.mcp1200 import datasheet as ds
from vbus.chips.mcp1200.capture import Breakpoint, index_edge
from vbus.chips.mcp1200.encoder import Encoder
from vbus.chips.mcp1200.faults import Faults
from vbus.chips.mcp1200.registers import RegisterFile
from vbus.chips.mcp1200.stepper import Stepper
from vbus.chips.mcp1200.timer import FAR
from vbus.state import Names


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
    WIRING: ClassVar[Names] = (
        "_breakpoint", "_encoder", "_faults", "_index_high", "_registers", "_stepper",
    )  # fmt: skip

    def __init__(
        self,
        registers: RegisterFile,
        encoder: Encoder,
        stepper: Stepper,
        breakpoint: Breakpoint,
        faults: Faults,
        index_high: bool,
    ) -> None:
        self._registers: RegisterFile = registers
        self._encoder: Encoder = encoder
        self._stepper: Stepper = stepper
        self._breakpoint: Breakpoint = breakpoint
        self._faults: Faults = faults
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
        """The encoder reaches a count that somebody waits for."""
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

    def replan(self, cycle: int) -> None:
        """Look anew for what will be reached: a setting has changed."""
        self._encoder.look_from(cycle)
        self._watch_steps(cycle)
        self.plan()

    def begin_steps(self, cycle: int) -> None:
        """Look for what the steps that begin now will reach, the first of them in this cycle."""
        self._encoder.look_from(cycle)
        self._watch_steps(cycle - 1)
        self.plan()

    def _watch_steps(self, cycle: int) -> None:
        """Find the step after ``cycle`` that reaches the breakpoint."""
        self.at_match = FAR
        if self._registers.step_mode and self._breakpoint.armed:
            ahead = wrap(self._breakpoint.compare - self._stepper.position(cycle), 24)
            self.at_match = self._stepper.when(ahead, cycle)

    def plan(self) -> None:
        """Look for what the encoder will reach in its present period."""
        armed = self._breakpoint.armed and not self._registers.step_mode
        self._encoder.plan(armed, self._breakpoint.compare)
