"""The sample timer: a pre-scalar, a down counter, and what the core has to do in its period."""

from typing import ClassVar, Final

from mypy_extensions import i64

from vbus.chips.mcp1200 import datasheet as ds
from vbus.chips.mcp1200.registers import RegisterFile
from vbus.core.state import Names

FAR: Final = (1 << 62) - 1
"""A clock cycle that does not come."""


class SampleTimer:
    """Counts clocks: each ``pre`` of them lower the counter by one, at zero it reloads.

    A sample starts at each reload. The registers R0F, R10 and R11 are looked at only then
    (MCP-SMP-1, MCP-REG-49).

    Args:
        registers: the registers.

    Attributes:
        start: cycle of the last reload.
        pre: clocks per count, in force since then.
        counts: counts per period.
        running: False while reset or /SYNC holds the counter at zero.
    """

    STATE: ClassVar[Names] = ("start", "pre", "counts", "running: bool")
    WIRING: ClassVar[Names] = ("_registers",)

    def __init__(self, registers: RegisterFile) -> None:
        self._registers: Final[RegisterFile] = registers
        self.start: i64 = 0
        self.pre: i64 = 1
        self.counts: i64 = 1
        self.running: bool = False

    @property
    def period(self) -> i64:
        """Clocks from one sample start to the next, as loaded."""
        return self.pre * self.counts

    @property
    def coming(self) -> i64:
        """Clocks of the next period, as the registers stand now."""
        return (self._registers.prescaler + 1) * (self._registers.sample_timer + 1)

    def reload(self, cycle: i64) -> i64:
        """Begin a period at ``cycle`` with the values now in the registers; return its end."""
        self.start = cycle
        self.pre = self._registers.prescaler + 1
        self.counts = self._registers.sample_timer + 1
        self.running = True
        return cycle + self.pre * self.counts

    def count(self, cycle: int) -> int:
        """What R0F reads at ``cycle``: the reload value down to 0."""
        if not self.running:
            return 0
        return max(self.counts - 1 - (cycle - self.start) // self.pre, 0)


def work_clocks(registers: RegisterFile, mode: i64) -> i64:
    """Return how long the core is busy in a sample (MCP-SMP-3).

    Args:
        registers: the registers as they are at the sample's start.
        mode: flag of the control mode that runs, 0 for position control.
    """
    work: i64 = ds.WORK_BASE
    if registers.config & ds.STEP_MODE:
        work += ds.WORK_STEP
    elif registers.feature & ds.PID:
        work += ds.WORK_PID
    else:
        work += ds.WORK_LEAD
    if mode == ds.F0:
        work += ds.WORK_PROFILE
    elif mode == ds.F5:
        work += ds.WORK_VELOCITY
    elif mode == ds.F3 or mode == ds.F4:
        work += ds.WORK_INTERPOLATION
    if registers.backlash:
        work += ds.WORK_BACKLASH
    if registers.deadband:
        work += ds.WORK_DEADBAND
    return work
