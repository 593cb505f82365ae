"""The pins: edges on /CS, /PS, /RD, /WR become bus cycles, and those on A, B and /IN counts, where
something drives these nets; AC limits are judged."""

from typing import ClassVar, Final

from mypy_extensions import i64

from vbus.chips.base import OUTPUT, AcLimits, Chip
from vbus.chips.front_end import BusFrontEnd
from vbus.chips.lm628 import datasheet as ds
from vbus.chips.lm628.encoder import EncoderCounts
from vbus.chips.lm628.host_port import PortState
from vbus.chips.motion import quadrature as q
from vbus.core.kernel import NEVER
from vbus.core.signals import LOW, STRICT, Watcher
from vbus.core.state import Names, Saved, checkpoint, rollback

_LONG_AGO: Final = -(1 << 60)
# Bits of the control lines' levels.
_CS: Final = 8
_PS: Final = 4
_RD: Final = 2
_WR: Final = 1
_IDLE: Final = _CS | _PS | _RD | _WR
_FLOATING: Final = 0xFF


class FrontEndHost(Chip):
    """What the front-ends ask of their chip, beyond what every chip answers."""

    ac: AcLimits

    @property
    def powered(self) -> bool:
        """Whether supply is up."""
        raise NotImplementedError

    def index_seen(self, count: int) -> None:
        """The index has come at encoder ``count``; if armed, store its position (LM-POS-3)."""
        raise NotImplementedError

    def schedule(self, when: int) -> None:
        """The front-end has something to do at instant ``when``."""
        raise NotImplementedError


class BusPins(BusFrontEnd):
    """Figures 5 to 8 (LM-BUS-1 to LM-BUS-4).

    A cycle begins with the later falling edge of /CS and strobe and ends with the earlier rising
    edge. What the nets were before the batch of that last edge is what the chip takes.

    Outputs change at once. That a host ends a read before the access time, or drives D0-D7 while
    it is not its own, is found all the same (T10 to T12). Strict T10 shows FFh until the access
    time is over. Hold times are known only after the cycle: a strict one undoes it.

    Args:
        chip: the chip whose front-end this is.
        host: its host port.
    """

    STATE: ClassVar[Names] = (
        "_old: tuple[i64]", "_ps_moved", "_rd_fell", "_wr_fell", "_began", "_lost: bool",
        "_fought: bool", "show_at", "driving: bool", "_ended", "_wrote", "_read", "_data_wrote",
        "_data_read", "_byte", "_left", "_undo: checkpoint[chip]",
    )  # fmt: skip
    DERIVED: ClassVar[Names] = ("_levels",)

    def __init__(self, chip: FrontEndHost, host: PortState) -> None:
        self._levels: i64 = _IDLE
        self.show_at: i64 = NEVER
        """Instant at which strict T10 lets the byte appear (ps)."""
        super().__init__(chip)
        self._owner: FrontEndHost = chip
        self._host: PortState = host
        self._kernel = chip.kernel
        self._data = chip.data_pin
        self._timer = chip.kernel.timer(self._hold_over)
        # The byte shown changes at its instant, observed or not: the net stores that instant.
        self._live = chip.kernel.timer(self._changes, saved=False)
        self._ac: AcLimits = chip.ac
        self._late: bool = self._strict("T10")
        self._write_undone: bool = self._strict("T9") or self._strict("T16")
        self._read_undone: bool = self._strict("T9") or self._strict("T12")
        self.forget_edges()
        chip.on_levels = self.forget_edges

    def forget_edges(self) -> None:
        """Take the control lines as they are; no edge has been, and no time is judged from one."""
        self._levels = self.levels()
        self._ps_moved: int = _LONG_AGO
        self._rd_fell: int = _LONG_AGO
        self._wr_fell: int = _LONG_AGO
        # The cycle under way.
        self._began: int = 0
        self._lost: bool = False
        self._fought: bool = False
        self.driving: bool = False
        """A read is under way: the chip drives D0-D7."""
        # Ends of the last judged cycles.
        self._ended: int = _LONG_AGO
        self._wrote: int = _LONG_AGO
        self._read: int = _LONG_AGO
        self._data_wrote: int = _LONG_AGO
        self._data_read: int = _LONG_AGO
        # What was written, and what a read left on the floating bus.
        self._byte: int = 0
        self._left: int = 0
        self._undo: Saved = {}
        self.show_at = NEVER
        self._timer.cancel()
        self._live.cancel()

    @property
    def _old(self) -> tuple[int, ...]:
        """Levels at the last look, in the order of the table."""
        return self.apart(self._levels)

    @_old.setter
    def _old(self, levels: tuple[int, ...]) -> None:
        self._levels = 0
        for level in levels:
            self._levels = self._levels << 1 | level

    # -- edges --------------------------------------------------------------------------------

    def moved(self) -> None:
        """One or more control lines have moved at this instant."""
        chip = self.chip
        chip.advance()
        before, self._levels = self._levels, self.levels()
        fell = before & ~self._levels
        if fell & _RD:
            self._rd_fell = self._kernel.now
        if fell & _WR:
            self._wr_fell = self._kernel.now
        self.edges(before, self._levels)
        if self.driving:
            self.show()
        chip.rearm()

    def act(self, action: str, before: i64, after: i64) -> None:
        """Carry out one action of the table."""
        # No machine word: the end of time less an edge long ago does not fit one.
        now: int = self._kernel.now
        if action == "begin":
            port: i64 = after >> 2 & 1
            self._begin(now, self._rd_fell)
            if port and self.chip.timing_checked:
                # LM-TIM-17: /RD of the data port stays high between two reads.
                self._judge("T17", now - self._data_read)
            self._begin_read(now, port, not after & _WR)
        elif action == "take":
            self._end_read(now, before >> 2 & 1, not after & _RD)
        elif action == "write":
            self._end_write(now, before >> 2 & 1, not after & _WR)
        elif action == "place":
            ever = before | after
            self._port_moved(now, not ever & _CS and ever & (_RD | _WR) != _RD | _WR)
        elif action == "enter":
            self._begin(now, self._wr_fell)
            if after & _PS and self.chip.timing_checked:
                # LM-TIM-18: /WR of the data port stays high between two writes.
                self._judge("T18", now - self._data_wrote)
        # LM-BUS-4: reported once in a cycle; the read gives FFh, the write is carried out.
        elif action == "clash" and not self._fought:
            self._fought = True
            self._lost |= self.chip.report(ds.CONTENTION)
            self._host.lose_read()

    def _begin(self, now: int, strobe_fell: int) -> None:
        """A cycle begins: everything about the strobe's leading edge."""
        self.settle()
        self._began = now
        self._lost = False
        self._fought = False
        if self.chip.timing_checked:
            # LM-TIM-7: /CS is low before the strobe falls.
            self._judge("T7", strobe_fell - now, "/CS fell after the strobe")
            # LM-TIM-8: /PS stands before the strobe falls.
            self._judge("T8", now - self._ps_moved)

    def _begin_read(self, now: int, port: i64, writing: bool) -> None:
        chip = self.chip
        self.driving = True
        # From here on D0-D7 are the chip's own again.
        self._read = _LONG_AGO
        if self._lost or writing:
            self._host.lose_read()
            return
        chip.begin_read(port)
        # LM-TIM-10: a strict limit shows FFh until the byte is sure to be there.
        if self._late and chip.timing_checked:
            self.show_at = now + self._ac.least["T10"]
            self._owner.schedule(self.show_at)

    def _judge(self, symbol: str, measured: int, detail: str = "") -> None:
        """Find an interval too short; a strict one loses the cycle under way."""
        if self._ac.short(symbol, measured, detail):
            self._lost = True

    def _judge_hold(self, symbol: str, hold: int, when: int = -1) -> None:
        """Find a hold time too short; if it is strict, the last cycle has not been."""
        if self._ac.short(symbol, hold, when=when):
            undo, self._undo = self._undo, {}
            if undo:
                rollback(self.chip, undo)

    def _port_moved(self, now: int, busy: bool) -> None:
        """/PS has moved: too late for the cycle under way, or too early after the last one."""
        self._ps_moved = now
        if not self.chip.timing_checked:
            return
        if busy:
            # LM-TIM-8: moved within the strobe, the set-up time is negative.
            self._judge("T8", self._began - now, "/PS moved during the strobe")
        else:
            # LM-TIM-9: /PS stands on after the strobe has risen.
            self._judge_hold("T9", now - self._ended)

    # -- ends of cycles -----------------------------------------------------------------------

    def _end_write(self, now: int, port: i64, early: bool) -> None:
        """End a write: the chip takes the byte, unless a strict limit has lost the cycle.

        Args:
            now: instant (ps) at which /WR or /CS has risen.
            port: 0 for the command port, 1 for the data port.
            early: whether /CS rose first, so that /WR is still low.
        """
        chip = self.chip
        net = self._data.net
        # LM-BUS-2: data that moves together with the edge comes too late.
        byte = net.before
        floats = net.floats
        if chip.timing_checked:
            # LM-TIM-7: /CS stays low until the strobe has risen.
            if early:
                self._judge("T7", -1, "/CS rose before /WR")
            # LM-TIM-14: /WR is low long enough.
            self._judge("T14", now - self._began)
            # LM-TIM-15: the byte stands before /WR rises.
            if byte == net.value and not floats:
                self._judge("T15", now - net.changed_at)
            self._ended = now
            self._wrote = _LONG_AGO if floats else now
            self._byte = byte
            self._undo = checkpoint(chip) if self._write_undone else {}
            if port:
                self._data_wrote = now
            self._timer.at(now + self._ac.least["T16"])
        if not self._lost:
            # LM-BUS-15: what the wires keep is taken, and the value is reported.
            if floats:
                chip.report(ds.FLOATING_WRITE, detail=f"no pin drives D0-D7: {byte:02X}H is taken")
            chip.write(port, byte)
        # The data has left together with the edge: its hold time is 0 and is judged at once.
        if byte != net.value:
            self.settle()

    def _end_read(self, now: int, port: i64, early: bool) -> None:
        chip = self.chip
        if chip.timing_checked:
            # LM-TIM-7: /CS stays low until the strobe has risen.
            if early:
                self._judge("T7", -1, "/CS rose before /RD")
            # LM-TIM-10: a byte is valid some time after /RD falls; a host that ends the read
            # before has taken anything.
            self._judge("T10", now - self._began)
            # LM-TIM-11: until /RD rises D0-D7 are the chip's.
            if not self._fought and self._others_drive():
                self._judge("T11", -1)
            self._ended = self._read = now
            self._undo = checkpoint(chip) if self._read_undone else {}
            if port:
                self._data_read = now
            self._timer.at(now + self._ac.least["T12"])
        if self._lost:
            self._host.lose_read()
        self.driving = False  # the byte stays as it was until D0-D7 are let go of
        chip.end_read()
        self._live.cancel()
        self.show_at = NEVER
        self._data.release()
        self._left = self._data.value

    def _others_drive(self) -> bool:
        return any(pin.level >= 0 and pin is not self._data for pin in self._data.net.pins)

    def _strict(self, symbol: str) -> bool:
        return self.chip.policy.of(ds.AC.rules[symbol].name) == STRICT

    # -- hold times ---------------------------------------------------------------------------

    def _hold_over(self) -> None:
        self.chip.advance()
        self.settle()
        self.chip.rearm()

    def settle(self) -> None:
        """Find what has happened to D0-D7 since the last cycle ended."""
        if self._wrote <= _LONG_AGO and self._read <= _LONG_AGO:
            return  # as ever while a board of many chips runs: the net need not be fetched
        now, net = self._kernel.now, self._data.net
        if self._wrote > _LONG_AGO:
            # A change at the very instant came before the edge, if the byte was that value.
            moved = max(net.changed_at, net.let_go_at)
            late = moved > self._wrote or (
                moved == self._wrote and (net.value != self._byte or not net.driven)
            )
            hold = moved - self._wrote
            if late or now - self._wrote >= self._ac.least["T16"]:
                self._wrote = _LONG_AGO
            # LM-TIM-16: the byte stands on after /WR has risen.
            if late:
                self._judge_hold("T16", hold, moved)
        if self._read > _LONG_AGO:
            hold = net.changed_at - self._read
            others = hold > 0 or (hold == 0 and net.value != self._left)
            if others or now - self._read >= self._ac.least["T12"]:
                self._read = _LONG_AGO
            # LM-TIM-12: until the chip has let go of D0-D7 no other part drives it.
            if others:
                self._judge_hold("T12", hold, net.changed_at)

    def conclude(self) -> None:
        """Judge the hold times that have passed; of others nothing more is found."""
        self.settle()
        self._wrote = self._read = _LONG_AGO
        self._undo = {}

    # -- D0-D7 --------------------------------------------------------------------------------

    def reading(self) -> int:
        """Return the kind of the read under way, counted from 1; 0: none."""
        return self._host.reading + 1 if self.driving else 0

    def resume(self, reading: int) -> None:
        """Show in the read under way what the port has now."""
        self._host.resume_read(reading - 1)
        # The wires have what whole cycles have left there; the pin drives what it drove.
        self._data.level = self._shown()
        self._data.net.resolve()
        self._live.at(self.chip.due(OUTPUT))

    def show(self) -> None:
        """Drive what the read under way shows now; status is live (LM-BUS-3)."""
        self._data.drive(self._shown())
        self._live.at(self.chip.due(OUTPUT))

    def _shown(self) -> int:
        if self._kernel.now >= self.show_at:
            self.show_at = NEVER
        return _FLOATING if self.show_at != NEVER else self.chip.read_byte()

    def _changes(self) -> None:
        self.chip.advance()
        if self.driving:  # or another state has been loaded since
            self.show()


class EncoderPins:
    """Pins 1 to 3 (LM-POS-1, LM-POS-3); silent while a plant has the encoder.

    Args:
        chip: the chip whose pins these are.
        encoder: takes the counts.
    """

    STATE: ClassVar[Names] = ("_low_from", "_low: bool")

    def __init__(self, chip: FrontEndHost, encoder: EncoderCounts) -> None:
        self._chip: FrontEndHost = chip
        self._encoder: EncoderCounts = encoder
        self._inputs: q.Quadrature = encoder.inputs
        self._pins = (chip.pins["A"], chip.pins["B"], chip.pins["/IN"])
        self._turn: int = int(chip.settings["counts_per_turn"])
        # Where the index input went low, until it goes high or is declared grounded.
        self._low_from: int = 0
        self._low: bool = False
        watcher = Watcher(chip.kernel, self.look)
        for pin in self._pins:
            pin.net.watch(watcher)

    def preset(self) -> None:
        """Power is up: the levels there are now have been there for ever."""
        a, b, index = self._pins
        self._inputs.preset(a.value, b.value, index.value)
        # LM-POS-3: an index input that is low from power-on counts its turn from here.
        self._low = index.value == LOW
        self._low_from = self._inputs.count

    def look(self) -> None:
        """Take in the levels as they are, unless no clock does it."""
        chip = self._chip
        if not chip.powered or self._encoder.plant is not None or chip.clock.stopped:
            return
        chip.advance()
        now = chip.kernel.now
        a, b, index = self._pins
        found = self._inputs.edge(now, a.value, b.value, index.value)
        late = bool(found) and chip.timing_checked and q.judge_inputs(chip.ac, self._inputs, found)
        self.settle(now, late)
        chip.input_changed()

    def settle(self, now: int, late: bool = False) -> None:
        """Take what has come of earlier edges by ``now``; ``late``: strict T3 loses the index."""
        chip = self._chip
        inputs = self._inputs
        while found := inputs.settle(now):
            if found & q.SKIPPED:
                # LM-POS-1: nothing is counted, as either direction may be meant.
                chip.report(ds.DOUBLE_EDGE, when=inputs.at)
            if found & (q.INDEX_FELL | q.INDEX_ROSE):
                self._low = bool(found & q.INDEX_FELL)
                self._low_from = inputs.count
            way = abs(inputs.count - self._low_from)
            # LM-POS-3: a grounded input makes the real part malfunction: it is reported once.
            if self._low and way > self._turn:
                self._low = False
                chip.report(ds.INDEX_GROUNDED, way, self._turn, when=inputs.at)
            if found & q.ALL_LOW and not late:
                chip.index_seen(inputs.count)
