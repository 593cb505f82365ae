"""The host bus as pins: strobes to bus cycles, and the AC limits of the manual."""

from typing import ClassVar, Final

from mypy_extensions import i64

from vbus.chips.base import AcLimits
from vbus.chips.front_end import BusFrontEnd
from vbus.chips.mc1241a import datasheet as ds
from vbus.chips.mc1241a.chipset import ChipSet
from vbus.chips.mc1241a.host_port import PacketPort
from vbus.core.signals import LOW, Watcher
from vbus.core.state import Names

# Bits of the control lines' levels.
_SELECT: Final = 8
_READ: Final = 2
_WRITE: Final = 1

LONG_AGO: Final = -1_000_000_000_000
"""An instant from which every interval is long enough."""


class AdapterPins(BusFrontEnd):
    """~HostSlct, ~HostWrite, ~HostRead, HostCmd and D0-D7 (PMD-BUS-2 to PMD-BUS-4).

    A write is latched, and a read ends, at the trailing edge of select and strobe together, with
    the levels before that edge.

    Args:
        chip: the chip set.
        port: the host port behind the pins.
    """

    STATE: ClassVar[Names] = (
        "_driving: bool", "_clashed: bool", "_last_was_write: bool", "_select_fell", "_write_fell",
        "_read_fell", "_strobe_ended", "_write_ended", "_read_ended", "_reset_fell", "_data_judged",
        "_command_at", "_data_at", "_data_before",
    )  # fmt: skip

    def __init__(self, chip: ChipSet, port: PacketPort) -> None:
        super().__init__(chip)
        self._owner: ChipSet = chip
        self._port: PacketPort = port
        self._ac: AcLimits = chip.ac
        # The data bus moves by itself only in answer to strobes: being heard there needs no timer.
        chip.data_pin.on_heard = None
        data = Watcher(chip.kernel, self._data_moved)
        self.ears = (self.own, data)
        chip.bus_net.watch(data)
        chip.pins["~Reset"].net.watch(Watcher(chip.kernel, self._reset_moved))
        self.forget_edges()

    def forget_edges(self) -> None:
        """Take the lines as they stand: no edge has been, and no time is judged from one."""
        self._driving: bool = False
        self._clashed: bool = False
        self._last_was_write: bool = False
        self._select_fell: int = LONG_AGO
        self._write_fell: int = LONG_AGO
        self._read_fell: int = LONG_AGO
        self._strobe_ended: int = LONG_AGO
        self._write_ended: int = LONG_AGO
        self._read_ended: int = LONG_AGO
        self._reset_fell: int = LONG_AGO
        self._data_judged: int = LONG_AGO
        self._command_at: int = LONG_AGO
        self._data_at: int = LONG_AGO
        self._data_before: int = LONG_AGO

    # -- edges --------------------------------------------------------------------------------

    def edges(self, before: i64, after: i64) -> None:
        """Note which lines have fallen; carry out what comes of it."""
        now, fell = self.chip.kernel.now, before & ~after
        if fell & _SELECT:
            self._select_fell = now
        if fell & _WRITE:
            self._write_fell = now
        if fell & _READ:
            self._read_fell = now
        super().edges(before, after)

    def act(self, action: str, before: i64, after: i64) -> None:
        """Carry out one action of the table."""
        now = self.chip.kernel.now
        if action == "write":
            self._end_write(now)
        elif action in ("take", "empty"):
            self._end_read(now)
        elif action == "place":
            self._after_strobe("T9", now - self._strobe_ended)
            self._command_at = now
        elif action == "release":
            self._released(now)
        elif action == "clash":
            self._clash()
        elif action == "begin" and not self._driving:
            self._begin_read(now)

    def _end_write(self, now: int) -> None:
        chip = self.chip
        lost = False
        if chip.timing_checked:
            begun = max(self._write_fell, self._select_fell)
            # PMD-TIM-16: ~HostWrite is low long enough.
            lost = self._ac.short("T14", now - self._write_fell)
            # PMD-TIM-9: ~HostSlct is low before the strobe.
            lost |= self._ac.short("T7w", self._write_fell - self._select_fell)
            # PMD-TIM-10: HostCmd stands before the strobe.
            lost |= self._ac.short("T8w", self._write_fell - self._command_at)
            # PMD-TIM-17: the byte stands before the strobe ends.
            lost |= self._ac.short("T15", now - self._data_since(now))
            # PMD-TIM-20: one write, then a pause.
            lost |= self._ac.short("T18", self._write_fell - self._write_ended)
            # PMD-TIM-15: what a host began while HostRdy was still falling it began too early.
            lost |= self._seen_too_early(begun)
        self._strobe_ended = self._write_ended = now
        self._last_was_write = True
        if not lost:
            # PMD-BUS-2: HostCmd as it was before the edge chooses the port.
            address = ds.COMMAND_PORT if self.address_pin.net.before else ds.DATA_PORT
            data = chip.bus_net.before
            # PMD-BUS-13: what the wires keep is taken, and the value is reported.
            if chip.bus_net.floats:
                taken = f"no pin drives D0-D7: {data:02X}H is taken"
                chip.report(ds.FLOATING_WRITE, detail=taken)
            chip.write(address, data)
        if chip.bus_net.before != chip.bus_net.value:
            self._data_judged = now
            self._after_strobe("T16", 0)

    def _begin_read(self, now: int) -> None:
        chip = self.chip
        if chip.timing_checked:
            # PMD-TIM-9: ~HostSlct is low before the strobe.
            lost = self._ac.short("T7r", self._read_fell - self._select_fell)
            # PMD-TIM-10: HostCmd stands before the strobe.
            lost |= self._ac.short("T8r", self._read_fell - self._command_at)
            # PMD-TIM-19: one read, then a pause.
            lost |= self._ac.short("T17", self._read_fell - self._read_ended)
            lost |= self._seen_too_early(self._read_fell)
            if lost:
                return
        self._driving = True
        chip.begin_read(ds.DATA_PORT)
        chip.data_pin.drive(self._port.last_driven)

    def _end_read(self, now: int) -> None:
        chip = self.chip
        self._strobe_ended = self._read_ended = now
        self._last_was_write = False
        clashed, self._clashed = self._clashed, False
        if self._driving:
            self._driving = False
            # PMD-TIM-12: the byte is valid so long after the strobe's fall.
            if chip.timing_checked and self._ac.short("T10", now - self._read_fell):
                self._port.cancel_read()
            chip.end_read()
            chip.data_pin.release()
        elif self.address_pin.net.before and not clashed:
            chip.report(ds.READ_COMMAND)  # PMD-BUS-4

    def _clash(self) -> None:
        """Both strobes are low: the host's byte counts, nothing is read."""
        # PMD-BUS-2: reported once in a cycle.
        if not self._clashed:
            self._clashed = True
            self.chip.report(ds.BOTH_STROBES)
        if self._driving:
            self._driving = False
            self._port.cancel_read()
            self.chip.data_pin.release()

    def _released(self, now: int) -> None:
        """~HostSlct has risen (T6, PMD-TIM-8)."""
        chip = self.chip
        held = now - self._strobe_ended
        self._after_strobe("T6", held)
        limit = ds.AC["T6"].max_ps
        busy = self._port.busy_since == self._strobe_ended
        # PMD-TIM-8, PMD-AMB-19: held longer than 2 us is reported, and has no other effect.
        if chip.timing_checked and busy and held > limit:
            chip.report(ds.AC.rules["T6"], held, limit)

    def _data_moved(self) -> None:
        chip = self.chip
        now = chip.kernel.now
        self._data_before, self._data_at = self._data_at, now
        if not chip.timing_checked or self._driving:
            return
        # PMD-TIM-18: the byte stands on after the strobe has ended.
        if now != self._data_judged:
            self._after_strobe("T16", now - self._write_ended)
        # PMD-TIM-14: until the chip set has let go of the bus no other part drives it.
        if chip.bus_net.driven:
            self._ac.short("T12", now - self._read_ended)

    def _reset_moved(self) -> None:
        """~Reset has moved: it takes hold after T-reset, and is over when it rises
        (PMD-TIM-5).
        """
        chip = self._owner
        now = chip.kernel.now
        chip.advance()
        if chip.pins["~Reset"].value == LOW:
            self._reset_fell = now
            # PMD-RST-1: it takes hold 1 us after it has fallen.
            chip.hold_reset(now + self._ac.least["reset"])
            return
        lost = False
        if chip.timing_checked:
            lost = self._ac.short("reset", now - self._reset_fell)
            # PMD-TIM-4: power is stable before the reset ends.
            if chip.settings["cold_start"]:
                self._ac.short("power", now)
        chip.release_reset(lost)

    # -- limits -------------------------------------------------------------------------------

    def _data_since(self, now: int) -> int:
        """Return since when the byte that is latched has been on the bus."""
        net = self.chip.bus_net
        late = net.before != net.value and self._data_at == now
        return self._data_before if late else self._data_at

    def _seen_too_early(self, begun: int) -> bool:
        """Whether the host took HostRdy for high while it was still falling (T13)."""
        since = self._port.busy_since
        if begun >= since and self._port.busy_until > begun:
            return self._ac.short("T13", begun - since)
        return False

    def _after_strobe(self, symbol: str, held: int) -> None:
        """Judge a hold time; what was latched too soon released is lost again (strict)."""
        chip = self.chip
        if chip.timing_checked and self._ac.short(symbol, held) and self._last_was_write:
            self._port.lose()
            chip.input_changed()
