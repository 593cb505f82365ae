"""Step mode: step pulses, direction, and the stall check against an encoder."""

from typing import ClassVar, Final

from mypy_extensions import i64

from vbus.chips.mcp1200 import datasheet as ds
from vbus.chips.mcp1200.registers import FAR, RegisterFile, SampledRegisters
from vbus.core.bits import wrap_word
from vbus.core.state import Names

LEAST_SAMPLES: Final = 4
"""Samples in a window of the stall check, at least (MCP-STP-4)."""


class Stepper:
    """Step pulses of one sample, spread evenly; they count the position (MCP-STP-1).

    A batch of n steps begins when the sample's results appear and lasts one sample: step j
    starts at j/n of it. Steps that the next batch cuts off are carried over into it.

    Args:
        registers: the registers.

    Attributes:
        base: steps sent before the batch, backward ones negative.
        offset: position minus steps sent.
        sign: level of the direction output (1 = negative).
    """

    STATE: ClassVar[Names] = (
        "base", "offset", "sign", "_begin", "_span", "_spacing", "_limit", "_tail",
    )  # fmt: skip

    def __init__(self, registers: RegisterFile) -> None:
        self._registers: Final[RegisterFile] = registers
        self.base: i64 = 0
        self.offset: i64 = 0
        self.sign: i64 = 0
        self._begin: i64 = 0
        self._span: i64 = 1
        self._spacing: i64 = 1
        self._limit: i64 = 0
        self._tail: i64 = 0
        """End of the last pulse of the batch before."""

    def clear(self, cycle: int) -> None:
        """No more pulses from ``cycle`` on, and the direction as after reset."""
        self.base = self.sent(cycle)
        self._limit = 0
        self._tail = 0
        self.sign = 0

    def emitted(self, cycle: i64) -> i64:
        """How many steps of the batch have started by ``cycle``."""
        if self._limit == 0 or cycle < self._begin:
            return 0
        past = cycle - self._begin
        # One division is all that a look costs: no step is an event of its own.
        if past >= self._span:
            return self._limit
        # Step j starts at begin + j * span // spacing.
        return min(((past + 1) * self._spacing - 1) // self._span + 1, self._limit)

    def sent(self, cycle: i64) -> i64:
        """Steps sent by ``cycle``, backward ones negative."""
        done = self.emitted(cycle)
        return self.base - done if self.sign else self.base + done

    def position(self, cycle: i64) -> i64:
        """The 24-bit position counter at ``cycle``."""
        return wrap_word(self.offset + self.sent(cycle), 0x800000)

    def preset(self, position: i64, cycle: i64) -> None:
        """Load the counter."""
        self.offset = position - self.sent(cycle)

    def batch(self, cycle: i64, steps: i64, period: i64) -> None:
        """Begin a batch of ``steps`` (signed) at ``cycle``, to last ``period`` clocks."""
        done = self.emitted(cycle)
        if done > 0:
            self._tail = self.instant(done - 1) + self.width
        left = self._limit - done
        self.base = self.sent(cycle)
        # MCP-STP-2: steps that were cut off are added to these.
        steps += -left if self.sign else left
        sign: i64 = 0
        if steps < 0:
            sign = 1
            steps = -steps
        self._limit = steps
        if steps == 0:
            return
        setup: i64 = 0
        # MCP-STP-2: 1080 clocks between a change of direction and its first step.
        if sign != self.sign:
            self.sign = sign
            setup = ds.DIRECTION_SETUP_CLK
        self._begin = cycle + setup
        self._spacing = self._limit
        self._span = max(period - setup, 1)

    def stop(self, cycle: i64) -> None:
        """Take back the steps that have not started."""
        self._limit = self.emitted(cycle)

    def instant(self, step: i64) -> i64:
        """Cycle at which step ``step`` (0-based) of the batch starts."""
        return self._begin + step * self._span // self._spacing

    def when(self, ahead: i64, cycle: i64) -> i64:
        """Cycle at which the position has moved by ``ahead`` (signed) from that at ``cycle``."""
        if self.sign:
            ahead = -ahead
        if ahead <= 0:
            return FAR
        step = self.emitted(cycle) + ahead - 1
        if step < self._limit:
            return self.instant(step)
        return FAR

    @property
    def width(self) -> i64:
        """Clocks of a step pulse (MCP-STP-2)."""
        # MCP-STP-2, MCP-AMB-19: the formula counts, not the examples.
        return self._registers.step_width + 1

    def overrun(self, period: i64) -> bool:
        """Whether the pulses of the batch do not fit into ``period`` clocks (MCP-STP-3)."""
        # MCP-STP-3: all pulses together, without the pauses.
        return self._limit * self.width > period

    def level(self, cycle: int) -> int:
        """Level of Pulse at ``cycle``."""
        done = self.emitted(cycle)
        # MCP-STP-2: a pulse that the next batch overtakes has its full width.
        high = cycle < self._tail or (done > 0 and cycle < self.instant(done - 1) + self.width)
        return int(high) ^ int(bool(self._registers.config & ds.STEP_LOW))

    def next_edge(self, cycle: int) -> int:
        """Cycle of the next edge of Pulse after ``cycle``."""
        done = self.emitted(cycle)
        edge = self._tail if self._tail > cycle else FAR
        if done > 0:
            end = self.instant(done - 1) + self.width
            if end > cycle:
                edge = min(edge, end)
        if done < self._limit:
            edge = min(edge, self.instant(done))
        return edge


class StallCheck:
    """Compares encoder counts with steps over windows of some samples (MCP-STP-4).

    A window closes when it holds at least four samples and at least one whole expected count.
    """

    STATE: ClassVar[Names] = (
        "_samples", "_expected", "_counts", "_steps_seen", "_counts_seen", "_steps", "_way",
    )  # fmt: skip

    def __init__(self) -> None:
        self._samples: i64 = 0
        self._expected: i64 = 0
        self._counts: i64 = 0
        self._steps_seen: i64 = 0
        self._counts_seen: i64 = 0
        # Since the sample before: steps sent, and counts moved.
        self._steps: i64 = 0
        self._way: i64 = 0

    def clear(self) -> None:
        """Begin a window."""
        self._samples = 0
        self._expected = 0
        self._counts = 0

    def look(self, steps: i64, counts: i64) -> None:
        """A sample starts: take what steps and encoder have come to."""
        self._steps = steps - self._steps_seen
        self._steps_seen = steps
        self._way = counts - self._counts_seen
        self._counts_seen = counts

    def stalled(self, sampled: SampledRegisters) -> bool:
        """Take the sample into the window; tell whether it closes with a stalled motor."""
        ratio = sampled.encoder_ratio
        # MCP-STP-4: R1C:R1D = 0 turns the check off.
        if ratio == 0:
            self.clear()
            return False
        self._samples = min(self._samples + 1, LEAST_SAMPLES)
        self._expected += (self._steps if self._steps > 0 else -self._steps) * ratio
        self._counts += self._way if self._way > 0 else -self._way
        # MCP-STP-4: a window closes with four samples and a whole expected count.
        if self._samples < LEAST_SAMPLES or self._expected < 256:
            return False
        stalled = self._counts * 256 < self._expected
        self.clear()
        return stalled
