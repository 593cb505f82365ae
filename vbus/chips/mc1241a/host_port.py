"""The host port: HostRdy, words, packets, checksums."""

from typing import ClassVar, Final

from mypy_extensions import i64

from vbus.chips.mc1241a import datasheet as ds
from vbus.chips.mc1241a.chipset import ChipSet
from vbus.chips.mc1241a.commands import Commands
from vbus.chips.mc1241a.cycle import SampleCycles
from vbus.chips.tables import Command
from vbus.core.kernel import HELD, NEVER
from vbus.core.signals import HIGH, LOW, Pin
from vbus.core.state import Names

_NEVER: Final[i64] = int(NEVER)
"""As a machine word: a compiled core keeps a literal this large as an object."""

NOTHING: Final = 0
READY: Final = 1
COMMAND: Final = 2
WORD: Final = 3
TAKEN: Final = 4


class PacketPort:
    """Bytes in, bytes out; what they mean is decided at the end of the busy time (PMD-BUS-9).

    Args:
        chip: the chip set behind the port.
        commands: carries out whole packets.
        cycles: the slots of its cycles.
    """

    STATE: ClassVar[Names] = (
        "busy_until", "busy_since", "last_driven", "_pending", "_pending_value", "_code",
        "known: bool", "_illegal: bool", "_writes", "_reads", "_given", "_taken", "_value",
        "_result", "_checksum", "_high", "_low_write_next: bool", "_low_read_next: bool", "_word",
        "_word_is_data: bool", "_reading: bool", "unchecked",
    )  # fmt: skip
    DERIVED: ClassVar[Names] = ("_row",)

    def __init__(self, chip: ChipSet, commands: Commands, cycles: SampleCycles) -> None:
        self._chip: ChipSet = chip
        self._commands: Commands = commands
        self._cycles: SampleCycles = cycles
        self._ready_pin: Pin = chip.pins["HostRdy"]
        self._slot_busy: bool = chip.settings["host_busy"] == "slot"
        self._noop_codes: bool = chip.settings["family_codes"] == "noop"
        self._pending_value: int = 0
        self._high: int = 0
        self._word: int = 0
        self._word_is_data: bool = False
        self.unchecked: int = 0
        """Packets begun before a checksum was read at all, -1 from then on."""
        self.reset(0, 0)

    def reset(self, since: int, ready: int) -> None:
        """Forget every packet and be busy from ``since`` to ``ready`` (ps)."""
        self.busy_since: int = since
        self.busy_until: i64 = ready
        """HostRdy rises at this instant (ps), NEVER if no end is in sight."""
        self._pending: int = READY
        self._open(None, 0, 0)
        self._code: int = 0
        self._checksum: int = 0
        self._reading: bool = False
        self.last_driven: int = 0
        self.show_ready(False)

    def _open(self, row: Command | None, writes: int, reads: int) -> None:
        self._row: Command | None = row
        self._writes: int = writes
        self._reads: int = reads
        self._illegal: bool = False
        self._given: int = 0
        self._taken: int = 0
        self._value: int = 0
        self._result: int = 0
        self._low_write_next: bool = False
        self._low_read_next: bool = False

    def show_ready(self, ready: bool) -> None:
        """Put HostRdy to its level at the instant of what the chip set is doing."""
        self._chip.put(self._ready_pin, HIGH if ready else LOW)

    # -- from the bus -------------------------------------------------------------------------

    def _ready(self) -> bool:
        """Whether HostRdy is high; an access while it is low is lost (PMD-BUS-8)."""
        now = self._chip.kernel.now
        # PMD-BUS-8: with HostRdy low a write is ignored, a read repeats the byte.
        if now >= self.busy_until:
            return True
        self._chip.report(ds.NOT_READY, now - self.busy_since, 0)
        return False

    def _go_busy(self, pending: int, value: int) -> None:
        """Be busy from now on: up to the next slot, or for the usual time (PMD-BUS-7)."""
        chip, clock = self._chip, self._chip.clock
        self._pending = pending
        self._pending_value = value
        self.busy_since = chip.kernel.now
        # PMD-BUS-7: at the next slot with "slot", else after exactly 67.5 us.
        if self._slot_busy and not clock.stopped:
            slot = self._cycles.slot_at(self.busy_since)
            end: int = self._cycles.ps_of((slot + 1) * ds.SLOT_CLK)
        else:
            end = HELD if clock.stopped else self.busy_since
            end += clock.span(ds.BUSY_HALF_CLK) // 2
        self.busy_until = end + chip.busy_stretch
        self.show_ready(False)

    def write_command(self, data: int) -> None:
        """A byte was written with HostCmd high (PMD-BUS-2, PMD-BUS-6)."""
        if not self._ready():
            return
        # PMD-BUS-10: a command whose data did not all arrive has no effect.
        if self._given < self._writes:
            self._chip.report(ds.ABORTED, self._given, self._writes)  # PMD-BUS-10
        # PMD-BUS-6: any command byte.
        self._go_busy(COMMAND, data)

    def write_data(self, data: int) -> None:
        """A byte was written with HostCmd low: high byte first (PMD-BUS-5)."""
        if not self._ready():
            return
        # PMD-BUS-5, PMD-BUS-6: the high byte first, which leaves HostRdy high.
        if not self._low_write_next:
            self._high = data
            self._low_write_next = True
            return
        self._low_write_next = False
        # PMD-BUS-11, PMD-PKT-4: behind an illegal code nothing is worth a word.
        if self._given >= self._writes and not self._illegal:
            self._chip.report(ds.UNEXPECTED_WRITE)  # PMD-BUS-11
        self._go_busy(WORD, self._high << 8 | data)

    def begin_read(self) -> int:
        """A read of the data port begins; return the byte that is driven (PMD-BUS-3)."""
        self._reading = self._ready()
        if self._reading:
            # PMD-PKT-7: both bytes of a word are taken at the first one.
            if not self._low_read_next:
                self._latch()
            self.last_driven = self._word & 0xFF if self._low_read_next else self._word >> 8
        return self.last_driven

    def end_read(self) -> int:
        """The read ends: the byte pointer moves. Return the byte that was driven."""
        if self._reading:
            self._reading = False
            # PMD-BUS-3: the place in the word moves when the read ends.
            self._low_read_next = not self._low_read_next
            # PMD-BUS-6: the second byte that is read.
            if not self._low_read_next:
                self._go_busy(TAKEN, 0)
        return self.last_driven

    def cancel_read(self) -> None:
        """The read under way does not count: the byte pointer stays (strict policy)."""
        self._reading = False

    def lose(self) -> None:
        """The byte just written does not count after all; the busy time goes on (strict policy)."""
        if self._pending in (COMMAND, WORD):
            self._pending = READY
        elif self._pending == NOTHING:
            self._low_write_next = False

    def _latch(self) -> None:
        """Take the word whose bytes the host reads next."""
        self._word_is_data = False
        if self._given < self._writes:
            # PMD-BUS-11: 0000h, and the packet stays open.
            self._chip.report(ds.UNEXPECTED_READ)  # PMD-BUS-11
            self._word = 0
        elif self._taken < self._reads:
            # PMD-BUS-5, PMD-PKT-7: the high word first, of the value as it was when the command
            # acted.
            self._word = self._result >> 16 * (self._reads - 1 - self._taken) & 0xFFFF
            self._word_is_data = True
            if self._code in ds.STATUS_READERS:
                self._commands.shown(self._word)
        else:
            # PMD-PKT-3: read once or often, or never.
            self._word = self._checksum
            self.unchecked = -1

    # -- at the end of the busy time ----------------------------------------------------------

    def finish(self) -> None:
        """The busy time is over: carry out what started it (PMD-BUS-9)."""
        pending, value = self._pending, self._pending_value
        self._pending = NOTHING
        if pending == COMMAND:
            self._begin_packet(value)
        elif pending == WORD:
            self._take_word(value)
        elif pending == TAKEN and self._word_is_data:  # PMD-PKT-2
            # PMD-PKT-2: words that are read count when they have been read.
            self._checksum = (self._checksum + self._word) & 0xFFFF
            self._taken += 1

    def _begin_packet(self, code: int) -> None:
        self._code = code
        # PMD-PKT-2: the sum begins with the code.
        self._checksum = code
        if self.unchecked >= 0:
            self.unchecked += 1
        row = ds.COMMANDS.at(code)
        if row is not None:
            # PMD-PKT-1: words one way, then the checksum, if the host reads it.
            self._open(row, row.write, row.read)
            # PMD-BUS-9: without data the command acts now, else with its last word.
            if not row.write:
                self._result = self._commands.execute(row, self._value)
            return
        # PMD-PKT-5, PMD-AMB-1: 49h alone is reserved; 4Eh is SMOOTH_STOP.
        if code == ds.RESERVED_CODE:
            self._open(None, 0, 0)  # PMD-PKT-5
            self._chip.report(ds.RESERVED, code, when=self._chip.instant)
            return
        family = ds.FAMILY_CODES.get(code)
        if family is not None and self._noop_codes:
            self._open(None, family[1], family[2])  # PMD-PKT-6
            return
        self._open(None, 0, 0)
        self._illegal = True  # PMD-PKT-4
        self._checksum = 0
        detail = f"{code:02X}H is not a command of this chip set"
        self._chip.report(ds.ILLEGAL, code, detail=detail, when=self._chip.instant)

    def _take_word(self, word: int) -> None:
        # PMD-BUS-11: a word too many is in no checksum.
        if self._given >= self._writes:
            return
        self._given += 1
        self._value = self._value << 16 | word
        # PMD-PKT-2: modulo 65536.
        self._checksum = (self._checksum + word) & 0xFFFF
        if self._given == self._writes and self._row is not None:
            self._result = self._commands.execute(self._row, self._value)

    # -- state --------------------------------------------------------------------------------

    def due(self) -> i64:
        """Return the instant at which :meth:`finish` is due, NEVER if nothing is pending."""
        return self.busy_until if self._pending != NOTHING else _NEVER

    @property
    def coming(self) -> int:
        """Code of the command that is carried out when the busy time ends; -1: of none."""
        if self._pending == COMMAND:
            return int(self._pending_value)
        return int(self._code) if self._pending == WORD else -1

    @property
    def known(self) -> bool:
        """Whether the packet under way is a command's."""
        return self._row is not None

    @known.setter
    def known(self, known: bool) -> None:
        self._row = ds.COMMANDS.at(self._code) if known else None
