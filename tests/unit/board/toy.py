"""A chip small enough to read: what HostBus needs, and nothing else."""

from vbus.chips.ac_table import AcLimit, AcTable
from vbus.chips.base import POLL, Chip
from vbus.chips.bus_watch import strobed_bus
from vbus.chips.tables import PinRow
from vbus.core.kernel import NEVER, US
from vbus.core.signals import LOW, Watcher, Z

AC = AcTable("toy", AcLimit("T1", "TOY-1", "/WR low for at least 100 ns", min_ps=100_000))


class Toy(Chip):
    """Port 0: write n = IRQ rises n us later; read bit 0 = busy (10 us after a write).

    Port 1: write stores a byte; read gives it and then adds one to it.
    """

    FAMILY = "toy"
    ADDRESS_BITS = 1
    PARTS = ("TOY",)
    PINS = (
        PinRow("/CS", "in", strobe=True, select=True),
        PinRow("A0", "in", rest=LOW, strobe=True),
        PinRow("/RD", "in", strobe=True),
        PinRow("/WR", "in", strobe=True),
        PinRow("D0-D7", "io", rest=Z, width=8),
        PinRow("TRIG", "in", rest=LOW),
        PinRow("IRQ", "out", rest=LOW),
    )
    BUS = strobed_bus(
        ("/CS", "A0", "/RD", "/WR"), setup=50_000, read_low=200_000, write_low=200_000, hold=50_000,
        data_setup=200_000, data_hold=50_000, cycle_ps=300_000,
    )  # fmt: skip
    RULES = tuple(AC.rules.values())
    FREE_READS = (0,)
    TRACELESS = True
    STATE = (
        "busy_until", "irq_at", "irq", "stored", "latched", "reading: bool", "_wr_fell",
        "_levels: (i64, i64, i64)",
    )  # fmt: skip

    def __init__(self, *args, **kwargs) -> None:  # type: ignore[no-untyped-def]
        super().__init__(*args, **kwargs)
        self.busy_until = 0
        self.irq_at = NEVER
        self.irq = 0
        self.stored = 0
        self.latched = 0
        self.reading = False
        self.triggers: list[int] = []
        self._wr_fell = 0
        self._levels = (1, 1, 1)
        watcher = Watcher(self.kernel, self.strobe)
        for name in ("/CS", "/RD", "/WR", "A0"):
            self.pins[name].net.watch(watcher)
        self.pins["TRIG"].net.watch(Watcher(self.kernel, self.trigger))
        self.pins["IRQ"].drive(0)

    def trigger(self) -> None:
        if self.pins["TRIG"].value:
            self.triggers.append(self.kernel.now)

    def strobe(self) -> None:
        levels = (self.pins["/CS"].value, self.pins["/RD"].value, self.pins["/WR"].value)
        before, self._levels = self._levels, levels
        writing, wrote = before[0] | before[2] == 0, levels[0] | levels[2] == 0
        was_reading, reading = before[0] | before[1] == 0, levels[0] | levels[1] == 0
        if wrote and not writing:
            self._wr_fell = self.kernel.now
        if writing and not wrote:
            low = self.kernel.now - self._wr_fell
            limit = AC.minimum("T1", self.clock)
            lost = self.timing_checked and low < limit and self.report(AC.rules["T1"], low, limit)
            if not lost:
                self.write(self.pins["A0"].net.before, self.data_pin.net.before)
        if reading and not was_reading:
            self.begin_read(self.pins["A0"].value)
            self.data_pin.drive(self.latched)
        if was_reading and not reading:
            self.end_read()
            self.data_pin.release()

    def advance(self) -> None:
        if self.irq_at <= self.kernel.now:
            self.irq_at = NEVER
            self.irq = 1
            self.pins["IRQ"].drive(1)

    def due(self, kind: int) -> int:
        if kind == POLL:
            return self.busy_until if self.kernel.now < self.busy_until else NEVER
        return self.irq_at

    def ready_at(self) -> int:
        return self.busy_until

    def power_on(self, done: bool) -> None:
        pass

    def begin_read(self, address: int) -> None:
        self.advance()
        if address:
            self.latched = self.stored
        else:
            self.latched = int(self.kernel.now < self.busy_until)
        self.reading = bool(address)

    def end_read(self) -> int:
        self.advance()
        if self.reading:
            self.stored = (self.stored + 1) & 0xFF
        return self.latched

    def write(self, address: int, data: int) -> None:
        self.advance()
        if address:
            self.stored = data
        else:
            self.irq = 0
            self.pins["IRQ"].drive(0)
            self.busy_until = self.kernel.now + 10 * US
            self.irq_at = self.kernel.now + data * US
        self.input_changed()
