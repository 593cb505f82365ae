"""The DC-8 itself."""

from dc8 import datasheet as ds
from vbus.chips.base import OUTPUT, Chip
from vbus.chips.front_end import BusFrontEnd
from vbus.core.kernel import NEVER
from vbus.core.signals import HIGH, LOW


class DC8(Chip):
    """Counts down from what is written, one count every 16 cycles of CLK (DC-CNT-1)."""

    FAMILY = "dc8"
    ADDRESS_BITS = 1
    AXES = 0
    PARTS = ("DC-8",)
    PINS = ds.PINS
    BUS = ds.BUS
    RULES = ds.RULES
    VALUES = ds.VALUES
    STATE = ("load", "start", "taken")
    WIRING = ("front",)

    def __init__(self, *args, **kwargs):
        super().__init__(*args, **kwargs)
        self.load = self.start = self.taken = 0
        self.front = BusFrontEnd(self)

    def power_on(self, done):
        self.load = 0
        self.advance()
        self.input_changed()

    # -- time -----------------------------------------------------------------------------

    @property
    def count(self):
        """What is left now: it follows from when it was started."""
        gone = (self.clock.cycle_at(self.kernel.now) - self.start) // ds.COUNT_CLK
        return max(0, self.load - gone)

    def advance(self):
        self.pins["DONE"].drive(LOW if self.count else HIGH)

    def due(self, kind):
        if not self.count:
            return NEVER
        counts = self.load - (0 if kind == OUTPUT else self.count - 1)
        return self.clock.ps(self.start + ds.COUNT_CLK * counts)

    # -- bus cycles: whole ones, and those of edges at the pins ------------------------------

    def begin_read(self, address):
        self.advance()
        self.taken = self.count if address else self.load

    def end_read(self):
        return self.taken

    def write(self, address, data):
        self.advance()
        if address or (self.count and self.report(ds.RUNNING)):
            return
        self.load, self.start = data, self.clock.cycle_at(self.kernel.now)
        self.advance()
        self.input_changed()
