"""The DC-8 itself."""

from dc8 import datasheet as ds
from vbus.chips.base import Chip
from vbus.kernel import NEVER
from vbus.signals import HIGH, LOW, Watcher, Z


class DC8(Chip):
    """Counts down from what is written, one count every 16 cycles of CLK (DC-CNT-1)."""

    FAMILY = "dc8"
    ADDRESS_BITS = 1
    AXES = 0
    PARTS = ("DC-8",)
    PINS = ds.PINS
    RULES = ds.RULES
    VALUES = ds.VALUES
    STATE = ("load", "start", "taken", "reading: bool", "writing: bool")

    def __init__(self, *args, **kwargs):
        super().__init__(*args, **kwargs)
        self.cycle_ps, self.read_low_ps = 200_000, 100_000
        self.load = self.start = self.taken = 0
        self.reading = self.writing = False
        watcher = Watcher(self.kernel, self.strobe_moved)
        for name in ("/CS", "/RD", "/WR"):
            self.pins[name].net.watch(watcher)

    def power_on(self, done):
        self.load = 0
        self.advance()
        self.touched()

    def ready_at(self):
        return self.kernel.now

    # -- time -----------------------------------------------------------------------------

    @property
    def count(self):
        """What is left now: it follows from when it was started."""
        gone = (self.clock.cycle_at(self.kernel.now) - self.start) // ds.COUNT_CLK
        return max(0, self.load - gone)

    def advance(self):
        self.pins["DONE"].drive(LOW if self.count else HIGH)

    def next_event(self):
        if not self.count:
            return NEVER
        return self.clock.ps(self.start + ds.COUNT_CLK * self.load)

    # -- bus cycles: whole ones come here, and so does what the pins see ---------------------

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
        self.touched()

    def strobe_moved(self):
        """A bus cycle begins with the later falling edge and ends with the first rising one."""
        selected = self.pins["/CS"].value == LOW
        reading = selected and self.pins["/RD"].value == LOW
        writing = selected and self.pins["/WR"].value == LOW
        if reading and not self.reading:
            self.begin_read(self.pins["A0"].value)
            self.data_pin.drive(self.end_read())
        elif self.reading and not reading:
            self.data_pin.release()
        if self.writing and not writing:
            # What moves together with the edge that ends a write comes too late for it.
            self.write(self.pins["A0"].net.before, self.bus_net.before)
        self.reading, self.writing = reading, writing

    def strobes(self, write, address, data):
        """A whole cycle as edges, counted from the one that ends it."""
        strobe = "/WR" if write else "/RD"
        edges = [(-120_000, "A0", address), (-120_000, "/CS", LOW), (-100_000, strobe, LOW)]
        edges += [(-80_000, "D0-D7", data)] if write else []
        edges += [(0, strobe, HIGH), (20_000, "/CS", HIGH)]
        return edges + ([(20_000, "D0-D7", Z)] if write else [])
