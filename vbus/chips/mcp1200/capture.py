"""Hardware that watches the position counter: breakpoint compare, index and trigger capture."""

from typing import ClassVar

from mypy_extensions import i64

from vbus.bits import wrap
from vbus.chips.mcp1200 import datasheet as ds
from vbus.chips.mcp1200.registers import RegisterFile
from vbus.state import Names


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
        self._registers: RegisterFile = registers
        self.compare: i64 = -0x800000
        self._reached: bool = False
        """Repeat mode: reached since the last look at a sample's start."""
        self._found: bool = False
        """Reached before the present sample's start: the routine moves on."""
        self._loaded: i64 = 0

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
