"""The pins: the host bus (/ALE, /CS, /OE, R/W, the multiplexed address/data bus), and the inputs
beside it (encoder, limits, trigger, reset, sync)."""

from typing import ClassVar, Final

from mypy_extensions import i64

from vbus.chips.base import AcLimits, Chip
from vbus.chips.front_end import BusFrontEnd
from vbus.chips.mcp1200 import datasheet as ds
from vbus.chips.mcp1200.encoder import EncoderCourse, PositionCounter
from vbus.chips.mcp1200.registers import FAR, RegisterFile
from vbus.chips.motion.quadrature import COUNTED, INDEX_FELL, INDEX_ROSE, SKIPPED, Quadrature
from vbus.core.kernel import NEVER
from vbus.core.signals import LOW, Net, Pin, Rule, Watcher, Z
from vbus.core.state import Names

LONG_AGO: Final = 1 - (1 << 62)
"""An instant (ps) or cycle from which every interval is long enough."""

LIMIT: Final = 1
STOP: Final = 2
SYNC: Final = 4
TRIGGER: Final = 8
HOME: Final = 16
"""Inputs that have moved; the home switch counts where it is wired to INDEX."""

INDEX: Final = 2
"""Place of INDEX after CHA and CHB."""

PULSES: Final = (("/RESET", "tIRST"), ("/SYNC", "tIRST"), ("/LIMIT", "tIP"), ("/STOP", "tIP"))
"""Inputs whose low pulses have a shortest length (MCP-TIM-4, 5)."""
_OE: Final = 2
"""Place of /OE among the levels of the control lines."""
AD6: Final = 0x40
"""The one bus line with a pull-up of its own (MCP-BUS-1)."""


class HostInterface(Chip):
    """Clock cycles, AC limits, and what a pin that moves does inside."""

    ac: AcLimits

    # -- what is behind the pins --------------------------------------------------------------

    def drop_read(self) -> None:
        """A read that was begun does not take place; the latch keeps what it had."""
        raise NotImplementedError

    def drop_write(self) -> None:
        """The byte just written does not count after all (strict policy)."""
        raise NotImplementedError

    def output(self) -> int:
        """What /OE puts on the bus now."""
        raise NotImplementedError

    def reset_pin(self, level: int) -> None:
        """/RESET has moved."""
        raise NotImplementedError

    def look(self) -> None:
        """An input beside the host bus has moved, or a switch of the axis."""
        raise NotImplementedError

    def find(
        self, rule: Rule, cycle: int, measured: int = 0, detail: str = "", limit: int = 0
    ) -> bool:
        """File a violation of clock cycle ``cycle``; tell whether the cycle is to be lost."""
        return self.report(rule, measured, limit, detail, self.clock.ps(cycle))

    # -- clock cycles -------------------------------------------------------------------------

    def cycle_now(self) -> int:
        """Clock cycle that is under way."""
        return self.clock.cycle_at(self.kernel.now)

    def next_cycle(self) -> int:
        """First clock cycle that starts now or later: when an edge now is taken in."""
        cycle = self.cycle_now()
        return cycle if self.clock.ps(cycle) == self.kernel.now else cycle + 1


class StrobePins(BusFrontEnd):
    """Sees strobes on the nets, makes bus cycles of them, and judges their times.

    The three bus orders differ in when /ALE is low: before /CS, across its fall, or inside it.
    In all of them the address latch closes once per /ALE pulse, and the access is made when /CS
    rises, with what the bus carried before that edge.

    AC limits are judged while :attr:`~vbus.chips.base.Chip.timing_checked` is set. What breaks a
    limit under a strict policy is lost.

    Args:
        chip: whose pins.
    """

    STATE: ClassVar[Names] = (
        "_ale", "_cs", "_oe", "_rw", "_data", "_address", "_open: bool", "_fresh: bool",
        "_overlapped: bool", "_inside: bool", "_lost: bool", "_was_read: bool", "_was_write: bool",
        "_ale_fell", "_ale_rose", "_cs_fell", "_cs_rose", "_oe_fell", "_rw_at", "_data_at",
        "_closed_at", "_previous_closed_at",
    )  # fmt: skip

    def __init__(self, chip: HostInterface) -> None:
        super().__init__(chip)
        self._owner: HostInterface = chip
        self._ac: AcLimits = chip.ac
        self._release = chip.kernel.timer(self._let_go)
        chip.bus_net.watch(self.own)
        self.forget_edges()

    def forget_edges(self) -> None:
        """Take the lines as they stand: no edge has been, and no time is judged from one."""
        self._ale: int = 1
        self._cs: int = 1
        self._oe: int = 1
        self._rw: int = 1
        self._data: int = 0
        self._address: int = 0
        self._open: bool = False
        """The address latch follows the bus."""
        self._fresh: bool = False
        """An address has been latched since the last access."""
        self._overlapped: bool = False
        self._inside: bool = False
        self._lost: bool = False
        self._was_read: bool = False
        self._was_write: bool = False
        self._ale_fell: int = LONG_AGO
        self._ale_rose: int = LONG_AGO
        self._cs_fell: int = LONG_AGO
        self._cs_rose: int = LONG_AGO
        self._oe_fell: int = LONG_AGO
        self._rw_at: int = LONG_AGO
        self._data_at: int = LONG_AGO
        self._closed_at: int = LONG_AGO
        self._previous_closed_at: int = LONG_AGO
        self._release.cancel()

    def conclude(self) -> None:
        """Let go of the bus at once, where the hold time after a read has not passed."""
        if self._release.due != NEVER:
            self._release.cancel()
            self._let_go()

    @property
    def _net(self) -> Net:
        return self._owner.bus_net

    # -- edges --------------------------------------------------------------------------------

    def moved(self) -> None:
        """Control lines, or the data bus, have moved at this instant."""
        chip = self._owner
        chip.advance()
        now = chip.kernel.now
        data = self._net.value
        before: i64 = self._ale << 3 | self._cs << 2 | self._oe << 1 | self._rw
        after = self.levels()
        self.edges(before, after)
        if before & ~after & _OE:
            self._oe_falls(now)
        if data != self._data:
            self._data_moves(data, now)
        self.refresh()
        chip.input_changed()

    def act(self, action: str, before: i64, after: i64) -> None:
        """Carry out one action of the table."""
        now = self._owner.kernel.now
        if action == "place":
            self._read_write(after & 1, now)
        elif action == "open":
            self._ale_falls(now)
        elif action == "latch":
            self._ale_rises(now)
        elif action == "enter":
            self._cs_falls(now)
        elif action in ("access", "write"):
            self._cs_rises(now)
        elif action == "take":
            self._oe_rises(now)

    def _judge(self, symbol: str, measured: int) -> None:
        """Judge a limit of the access under way."""
        if self._owner.timing_checked and self._ac.short(symbol, measured):
            self._lost = True

    def _read_write(self, rw: int, now: int) -> None:
        chip = self._owner
        # MCP-TIM-18: R/W stands on after /CS has risen.
        if chip.timing_checked and self._ac.short("tWH", now - self._cs_rose):
            chip.drop_write()
        self._rw = rw
        self._rw_at = now
        if self._cs == LOW and not self._open:
            if rw:
                chip.begin_read(self._address)
            else:
                chip.drop_read()
                self._check_contention()

    def _ale_falls(self, now: int) -> None:
        self._ale = 0
        self._lost = False
        if self._was_write:
            # MCP-TIM-19: four clocks from a write to the next address.
            self._judge("tCSAL", now - self._cs_rose)
            # MCP-TIM-21: four clocks from one address to the next.
            self._judge("tWC", now - self._ale_fell)
        # MCP-TIM-29, MCP-TIM-33: of the two orders in which /ALE is low within /CS.
        if self._overlapped or self._inside:
            self._judge("tALH", now - self._cs_rose)
        # MCP-TIM-30: between two pulses.
        self._judge("tALPWH", now - self._ale_rose)
        # MCP-BUS-3: /CS first makes the third order.
        self._inside = self._cs == LOW
        self._overlapped = False
        if self._inside:
            # MCP-TIM-31, MCP-TIM-33: of that order alone.
            self._judge("tCA", now - self._cs_fell)
            self._owner.drop_read()
        self._was_write = False
        self._open = True
        self._ale_fell = now

    def _ale_rises(self, now: int) -> None:
        self._ale = 1
        # MCP-TIM-10: width of /ALE.
        self._judge("tIPW", now - self._ale_fell)
        # MCP-BUS-2: in one pulse the latch closes once.
        if self._open:
            self._close("tASR1", now)
            if self._cs == LOW:
                self._access_begins()
        self._ale_rose = now

    def _close(self, setup: str, now: int) -> None:
        """The address latch closes: with what the bus carried before this edge (MCP-BUS-2)."""
        net = self._net
        self._address = net.before if net.driven else net.before | AD6
        self._address &= 0x7F
        self._judge(setup, 0 if net.driven else -1)
        # MCP-TIM-20: from the access before.
        self._judge("tCSCS", now - self._cs_rose)
        self._open = False
        self._fresh = True
        self._previous_closed_at = self._closed_at
        self._closed_at = now

    def _cs_falls(self, now: int) -> None:
        self._cs = 0
        self._cs_fell = now
        if self._open:
            # MCP-BUS-2, MCP-BUS-3: the fall of /CS within /ALE closes the latch.
            self._overlapped = True
            self._judge("tAC", now - self._ale_fell)
            self._close("tASR", now)
        elif self._fresh:
            # MCP-TIM-32, MCP-TIM-33: of the separate order.
            self._judge("tACL", now - self._ale_rose)
        self._access_begins()

    def _access_begins(self) -> None:
        if self._rw:
            self._owner.begin_read(self._address)
        else:
            self._check_contention()

    def _cs_rises(self, now: int) -> None:
        chip = self._owner
        self._cs = 1
        # R/W may have risen in this batch, as /CS does: what it was before counts.
        # MCP-BUS-4: the direction is R/W's level at this edge.
        write = chip.pins["R/W"].net.before == 0
        # MCP-TIM-10: width of /CS.
        self._judge("tIPW", now - self._cs_fell)
        # MCP-TIM-12, MCP-TIM-33: /ALE has risen before /CS does.
        if self._overlapped or self._inside:
            self._judge("tACH", now - self._ale_rose if self._ale else 0)
        # MCP-TIM-17: R/W stands before /CS rises.
        self._judge("tWCS", now - self._rw_at)
        if self._open:
            # The address was never latched: there is nothing to access.
            chip.drop_read()
        elif write:
            # Our own driver has let go: this is the host's byte (MCP-BUS-8).
            data = self._net.before
            changed = now if self._net.value != self._data else self._data_at
            # MCP-TIM-15: so does the byte.
            self._judge("tSDR", now - changed)
            chip.drop_read()
            if not self._lost:
                # MCP-BUS-13: what the wires keep is taken, and the value is reported.
                if self._net.floats:
                    taken = f"no pin drives DB0-DB7: {data:02X}H is taken"
                    chip.report(ds.FLOATING_WRITE, detail=taken)
                chip.write(self._address, data)
        else:
            # MCP-TIM-26: two clocks from read to read.
            if self._was_read and self._fresh:
                self._judge("tALAL", self._closed_at - self._previous_closed_at)
            if self._lost:
                chip.drop_read()
            else:
                chip.begin_read(self._address)
                chip.end_read()
        self._was_write = write
        self._was_read = not write
        self._fresh = False
        self._lost = False
        self._cs_rose = now

    def _oe_falls(self, now: int) -> None:
        self._oe = 0
        self._oe_fell = now
        self._release.cancel()
        self._check_contention()

    def _oe_rises(self, now: int) -> None:
        chip = self._owner
        self._oe = 1
        if chip.timing_checked:
            low = now - self._oe_fell
            # MCP-TIM-24: width of /OE.
            self._ac.short("tIPWOE", low)
            # MCP-TIM-22: a host that ends it sooner has taken anything.
            self._ac.short("tOEDB", low)
            # MCP-TIM-23: the same, counted from the address.
            self._ac.short("tALDB", now - self._closed_at)
            if chip.data_pin.level != Z:
                self._release.at(now + self._ac.least["tDOEH"])

    def _check_contention(self) -> None:
        # MCP-BUS-8: two drive the bus; the write takes the host's byte.
        if self._oe == LOW and self._cs == LOW and self._rw == 0:
            self._owner.report(ds.CONTENTION)

    def _data_moves(self, data: int, now: int) -> None:
        chip = self._owner
        self._data = data
        self._data_at = now
        if not chip.timing_checked:
            return
        # After a read nothing of the host's needs holding.
        # MCP-TIM-16: hold time of a written byte.
        if self._was_write and self._cs:
            if self._ac.short("tH", now - self._cs_rose):
                chip.drop_write()
        # MCP-TIM-16: hold time of an address.
        elif not self._open and self._fresh:
            self._judge("tH", now - self._closed_at)

    # -- driving ------------------------------------------------------------------------------

    def reading(self) -> int:
        """Return 1: the output latch always shows what it has."""
        return 1

    def resume(self, reading: int) -> None:
        """Drive the bus as the lines that are given back want it."""
        self.refresh()

    def refresh(self) -> None:
        """Drive the bus with the output latch, or let go of it (MCP-BUS-7)."""
        chip = self._owner
        if self._oe == LOW and not (self._cs == LOW and self._rw == 0):
            chip.data_pin.drive(chip.output())
        elif chip.data_pin.level != Z and self._release.due == NEVER:
            chip.data_pin.release()
        else:
            return
        self._data = self._net.value

    def _let_go(self) -> None:
        """The data hold time after /OE has passed (MCP-TIM-25)."""
        self._owner.data_pin.release()
        self._data = self._net.value

    def clear(self) -> None:
        """The I/O control logic is cleared: a hard reset."""
        self._address = 0
        self._open = False
        self._fresh = False


class EncoderChannels:
    """CHA, CHB and INDEX while something drives them: filter and 4x decoder (MCP-ENC-1).

    Times of the decoder are clock cycles. A plant does without: it hands over counts.

    Args:
        chip: whose pins.
        registers: R1A sets the filter clock, and swaps the channels.
        encoder: whose channels are swapped.
        counter: takes the counts.

    Attributes:
        decoder: three-stage filter and decoder.
        due: cycle at which a level at CHA, CHB or INDEX will have passed its filter.
    """

    STATE: ClassVar[Names] = ("_levels: list[i64]", "_since: list[i64]", "decoder: part")
    WIRING: ClassVar[Names] = ("_pins",)
    DERIVED: ClassVar[Names] = ("due",)

    def __init__(
        self, chip: HostInterface, registers: RegisterFile, encoder: EncoderCourse,
        counter: PositionCounter,
    ) -> None:  # fmt: skip
        self._chip: Final[HostInterface] = chip
        self._registers: Final[RegisterFile] = registers
        self._encoder: Final[EncoderCourse] = encoder
        self._counter: Final[PositionCounter] = counter
        self.decoder: Final[Quadrature] = Quadrature(ds.FILTER_STAGES, ds.FILTER_STAGES)
        self.due: i64 = FAR
        self._pins: list[Pin] = [chip.pins[name] for name in ("CHA", "CHB", "INDEX")]
        self._since: list[int] = [LONG_AGO] * 3
        self.settle_levels()
        watcher = Watcher(chip.kernel, self._moved)
        for pin in self._pins:
            pin.net.watch(watcher)

    def settle_levels(self) -> None:
        """Take the levels as they stand as what has been there for ever: power-on."""
        self._levels: list[int] = [pin.value for pin in self._pins]
        a, b, index = self._levels
        self.decoder.preset(a, b, index)
        self.after_load()

    def after_load(self) -> None:
        """Find out when the next edge is believed."""
        due = self.decoder.due()
        self.due = FAR if due == NEVER else due

    def _divider(self) -> int:
        """Return the clocks of a filter clock."""
        return ds.FILTER_DIVIDER[self._registers.encoder_pwm >> 4 & 7]

    def configure(self, cycle: int) -> None:
        """R1A has changed: the filter clock, or which channel is A."""
        # MCP-ENC-1: three filter clocks.
        dwell = ds.FILTER_STAGES * self._divider()
        self.decoder.set_dwell(cycle, dwell, dwell)
        self._encoder.swap(self._registers.encoder_pwm & ds.SWAP_AB != 0, cycle)
        self.after_load()

    def settle(self, cycle: int) -> None:
        """Take what has passed the filter by ``cycle``."""
        decoder = self.decoder
        while (found := decoder.settle(cycle)) != 0:
            if found & COUNTED:
                self._counter.count_external(decoder.direction, decoder.at)
            if found & SKIPPED:
                # MCP-ENC-1: both channels at once count nothing.
                self._chip.find(ds.DOUBLE_EDGE, decoder.at)
            if found & (INDEX_FELL | INDEX_ROSE):
                self._counter.index_external(bool(found & INDEX_ROSE), decoder.at)
        self.after_load()

    def _moved(self) -> None:
        chip = self._chip
        chip.advance()
        a, b, index = levels = [pin.value for pin in self._pins]
        moved = [place for place in range(3) if levels[place] != self._levels[place]]
        now = chip.kernel.now
        if chip.timing_checked:
            self._judge(moved, now)
        self._levels = levels
        for place in moved:
            self._since[place] = now
        self.decoder.edge(chip.cycle_now(), a, b, index)
        self.after_load()
        chip.input_changed()

    def _judge(self, moved: list[int], now: int) -> None:
        for place in reversed(moved):
            # MCP-TIM-6, MCP-TIM-7: three filter clocks.
            self._judge_filtered("tIX" if place == INDEX else "tIAB", now - self._since[place])
        channels = [place for place in moved if place != INDEX]
        if channels:
            # The other channel moved before, or in this instant too.
            since = now if len(channels) == 2 else self._since[1 - channels[0]]
            # MCP-TIM-8: one filter clock from channel to channel.
            self._judge_filtered("tAB", now - since)

    def _judge_filtered(self, symbol: str, measured: int) -> None:
        """File an interval below its minimum, which counts filter clocks."""
        chip = self._chip
        row = chip.ac.table[symbol]
        least: int = row.min_ps + chip.clock.span_up(int(row.min_clk) * self._divider())
        if measured < least:
            chip.report(chip.ac.table.rules[symbol], measured, least)


class InputLevels:
    """/LIMIT, /STOP, /RESET, /SYNC, TRIG as an input, and the home switch.

    The axis' own switches are wired in parallel with the nets: an input is low if its net or a
    closed switch makes it low.

    Args:
        chip: whose pins.
        encoder: says where the axis stands on its switches.

    Attributes:
        nets: levels of the nets of /RESET, /SYNC, /LIMIT and /STOP.
        fell: when each of them fell last (ps).
        limit: level of /LIMIT.
        stop: level of /STOP.
        sync: level of /SYNC.
        trigger: level of TRIG as an input.
        home: level of the home switch.
    """

    STATE: ClassVar[Names] = (
        "nets: list[i64]", "fell: list[i64]", "limit", "stop", "sync",
        "trigger", "home",
    )  # fmt: skip
    WIRING: ClassVar[Names] = ("own",)

    def __init__(self, chip: HostInterface, encoder: EncoderCourse) -> None:
        self._chip: Final[HostInterface] = chip
        self._encoder: Final[EncoderCourse] = encoder
        self._trigger: Pin = chip.pins["TRIG"]
        self._home: str = str(chip.settings["home_switch"])
        self.nets: list[int] = [1, 1, 1, 1]
        self.fell: list[int] = [LONG_AGO] * 4
        self.limit: i64 = 1
        self.stop: i64 = 1
        self.sync: i64 = 1
        self.trigger: int = 1
        self.home: int = 1
        self.own: Watcher = Watcher(chip.kernel, self._moved)
        for name in ("/RESET", "/SYNC", "/LIMIT", "/STOP", "TRIG"):
            chip.pins[name].net.watch(self.own)

    def _moved(self) -> None:
        chip = self._chip
        chip.advance()
        # No machine word: the end of time less an edge long ago does not fit one.
        now: int = chip.kernel.now
        for place, (name, limit) in enumerate(PULSES):
            level = chip.pins[name].value
            if level == self.nets[place]:
                continue
            self.nets[place] = level
            if level == 0:
                self.fell[place] = now
            # MCP-TIM-4, MCP-TIM-5: shortest pulses of /RESET, /SYNC, /LIMIT and /STOP.
            elif chip.timing_checked:
                chip.ac.short(limit, now - self.fell[place])
            if name == "/RESET":
                chip.reset_pin(level)
        chip.look()

    def settle_levels(self) -> None:
        """Take the levels as they stand: power-on."""
        for place, (name, _) in enumerate(PULSES):
            self.nets[place] = self._chip.pins[name].value
        self.look()

    def look(self) -> int:
        """Take the levels as they are now; return which of them have moved."""
        home = self._encoder.home_level()
        limit = self.nets[2] & self._encoder.limit_level()
        stop = self.nets[3] & (home if self._home == "/STOP" else 1)
        trigger = self._trigger.value & (home if self._home == "TRIG" else 1)
        moved = 0
        if limit != self.limit:
            moved |= LIMIT
        if stop != self.stop:
            moved |= STOP
        if self.nets[1] != self.sync:
            moved |= SYNC
        if trigger != self.trigger:
            moved |= TRIGGER
        if home != self.home and self._home == "INDEX":
            moved |= HOME
        self.limit, self.stop, self.sync = limit, stop, self.nets[1]
        self.trigger, self.home = trigger, home
        return moved
