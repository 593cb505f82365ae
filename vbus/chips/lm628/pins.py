"""The bus front-end: edges on /CS, /PS, /RD, /WR become bus cycles, and AC limits are judged."""

from typing import ClassVar, Final

from mypy_extensions import i64

from vbus.chips.lm628 import datasheet as ds
from vbus.chips.lm628.interface import HostInterface
from vbus.kernel import NEVER
from vbus.signals import HIGH, LOW, STRICT, Watcher, Z
from vbus.state import Names, Saved, keep, take_back

_LONG_AGO: Final = -(1 << 60)
_FLOATING: Final = 0xFF


def edges_of(write: bool, address: int, data: int) -> list[tuple[int, str, int]]:
    """Return the edges of a whole cycle at the shortest times the manual allows."""
    setup, hold = ds.AC["T8"].min_ps, ds.AC["T9"].min_ps
    low = ds.WRITE_LOW if write else ds.READ_LOW
    strobe = "/WR" if write else "/RD"
    edges = [(-low - setup, "/PS", address), (-low - setup, "/CS", LOW), (-low, strobe, LOW)]
    if write:
        edges.append((-low, "D0-D7", data))
    edges += [(0, strobe, HIGH), (hold, "/CS", HIGH)]
    if write:
        edges.append((ds.AC["T16"].min_ps, "D0-D7", Z))
    return edges


class BusPins:
    """Figures 5 to 8 (LM-BUS-1 to LM-BUS-4).

    A cycle begins with the later falling edge of /CS and strobe and ends with the earlier rising
    edge. What the nets were before the batch of that last edge is what the chip takes.

    Outputs change at once. That a host ends a read before the access time, or drives D0-D7 while
    it is not its own, is found all the same (T10 to T12). Strict T10 shows FFh until the access
    time is over. Hold times are known only after the cycle: a strict one undoes it.

    Args:
        chip: the chip whose front-end this is.
    """

    STATE: ClassVar[Names] = (
        "_old: tuple[i64]", "_ps_moved", "_rd_fell", "_wr_fell", "_began", "_lost: bool",
        "_fought: bool", "show_at", "driving: bool", "_ended", "_wrote", "_read", "_data_wrote",
        "_data_read", "_byte", "_left", "_undo: kept[_chip]",
    )  # fmt: skip
    WIRING: ClassVar[Names] = (
        "_chip", "_cs", "_data", "_kernel", "_late", "_ps", "_rd", "_read_undone", "_t10", "_t12",
        "_t14", "_t15", "_t16", "_t17", "_t18", "_t8", "_t9", "_timer", "_wr", "_write_undone",
    )  # fmt: skip

    def __init__(self, chip: HostInterface) -> None:
        self._chip: HostInterface = chip
        self._kernel = chip.kernel
        self._cs = chip.pins["/CS"]
        self._ps = chip.pins["/PS"]
        self._rd = chip.pins["/RD"]
        self._wr = chip.pins["/WR"]
        self._data = chip.data_pin
        self._timer = chip.kernel.timer(self._hold_over)
        self._t8: int = ds.AC.minimum("T8", chip.clock)
        self._t9: int = ds.AC.minimum("T9", chip.clock)
        self._t10: int = ds.AC["T10"].max_ps
        self._t12: int = ds.AC["T12"].max_ps
        self._t14: int = ds.AC.minimum("T14", chip.clock)
        self._t15: int = ds.AC.minimum("T15", chip.clock)
        self._t16: int = ds.AC.minimum("T16", chip.clock)
        self._t17: int = ds.AC["T17"].min_ps
        self._t18: int = ds.AC["T18"].min_ps
        self._late: bool = self._strict("T10")
        self._write_undone: bool = self._strict("T9") or self._strict("T16")
        self._read_undone: bool = self._strict("T9") or self._strict("T12")
        # Levels at the last look.
        self._old: tuple[int, int, int, int] = (HIGH, HIGH, HIGH, HIGH)
        self._ps_moved: int = _LONG_AGO
        self._rd_fell: int = _LONG_AGO
        self._wr_fell: int = _LONG_AGO
        # The cycle under way.
        self._began: int = 0
        self._lost: bool = False
        self._fought: bool = False
        self.show_at: i64 = NEVER
        """Instant at which strict T10 lets the byte appear (ps)."""
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
        watcher = Watcher(chip.kernel, self._moved)
        for pin in (self._cs, self._ps, self._rd, self._wr):
            pin.net.watch(watcher)

    # -- edges --------------------------------------------------------------------------------

    def _moved(self) -> None:
        chip = self._chip
        chip.advance()
        now = self._kernel.now
        old_cs, old_ps, old_rd, old_wr = self._old
        cs, ps, rd, wr = self._cs.value, self._ps.value, self._rd.value, self._wr.value
        self._old = (cs, ps, rd, wr)
        was_reading, reading = old_cs | old_rd == LOW, cs | rd == LOW
        was_writing, writing = old_cs | old_wr == LOW, cs | wr == LOW
        if rd < old_rd:
            self._rd_fell = now
        if wr < old_wr:
            self._wr_fell = now

        if was_writing and not writing:
            self._end_write(now, old_ps, wr)
        if was_reading and not reading:
            self._end_read(now, old_ps, rd)
        if ps != old_ps:
            self._port_moved(now, reading or writing)
        if writing and not was_writing:
            self._begin(now, self._wr_fell)
            self._judge_recovery("T18", self._t18, now, ps, self._data_wrote)
        if reading and not was_reading:
            self._begin(now, self._rd_fell)
            self._judge_recovery("T17", self._t17, now, ps, self._data_read)
            self._begin_read(now, ps, writing)
        if reading and writing and not self._fought:
            self._fought = True
            self._lost |= chip.report(ds.CONTENTION)
            chip.lose_read()
        if self.driving:
            self.show()
        chip.rearm()

    def _begin(self, now: int, strobe_fell: int) -> None:
        """A cycle begins: everything about the strobe's leading edge."""
        self._settle_holds(now)
        self._began = now
        self._lost = False
        self._fought = False
        if self._chip.judged:
            if strobe_fell < now:
                self._break("T7", strobe_fell - now, 0, "/CS fell after the strobe")
            if now - self._ps_moved < self._t8:
                self._break("T8", now - self._ps_moved, self._t8)

    def _begin_read(self, now: int, ps: int, writing: bool) -> None:
        chip = self._chip
        self.driving = True
        # From here on D0-D7 are the chip's own again.
        self._read = _LONG_AGO
        if self._lost or writing:
            chip.lose_read()
            return
        chip.begin_read(ps)
        if self._late and chip.judged:
            self.show_at = now + self._t10
            chip.expect(self.show_at)

    def _judge_recovery(self, symbol: str, limit: int, now: int, ps: int, last: int) -> None:
        if self._chip.judged and ps == ds.DATA_PORT and now - last < limit:
            self._break(symbol, now - last, limit)

    def _break(self, symbol: str, measured: int, limit: int, detail: str = "") -> None:
        self._lost |= self._chip.report(ds.AC.rules[symbol], measured, limit, detail)

    def _port_moved(self, now: int, busy: bool) -> None:
        """/PS has moved: too late for the cycle under way, or too early after the last one."""
        self._ps_moved = now
        if not self._chip.judged:
            return
        if busy:
            self._break("T8", self._began - now, self._t8, "/PS moved during the strobe")
        elif now - self._ended < self._t9:
            hold = now - self._ended
            if self._chip.report(ds.AC.rules["T9"], hold, self._t9):
                self._take_back()

    # -- ends of cycles -----------------------------------------------------------------------

    def _end_write(self, now: int, ps: int, wr: int) -> None:
        chip = self._chip
        net = self._data.net
        byte = net.before
        if chip.judged:
            if wr == LOW:
                self._break("T7", -1, 0, "/CS rose before /WR")
            if now - self._began < self._t14:
                self._break("T14", now - self._began, self._t14)
            if not net.driven and net.let_go_at < now:
                self._break("T15", 0, self._t15, "nobody drives D0-D7")
            elif now - net.changed_at < self._t15 and byte == net.value:
                self._break("T15", now - net.changed_at, self._t15)
            self._ended = now
            self._wrote = now
            self._byte = byte
            self._undo = keep(chip) if self._write_undone else {}
            if ps == ds.DATA_PORT:
                self._data_wrote = now
            self._timer.at(now + self._t16)
        if not self._lost:
            chip.write(ps, byte)
        if byte != net.value:
            self._settle_holds(now)

    def _end_read(self, now: int, ps: int, rd: int) -> None:
        chip = self._chip
        if chip.judged:
            if rd == LOW:
                self._break("T7", -1, 0, "/CS rose before /RD")
            if now - self._began < self._t10:
                self._break("T10", now - self._began, self._t10)
            if not self._fought and self._others_drive():
                self._break("T11", -1, 0)
            self._ended = self._read = now
            self._undo = keep(chip) if self._read_undone else {}
            if ps == ds.DATA_PORT:
                self._data_read = now
            self._timer.at(now + self._t12)
        if self._lost:
            chip.lose_read()
        chip.end_read()
        self.driving = False
        self.show_at = NEVER
        self._data.release()
        self._left = self._data.value

    def _others_drive(self) -> bool:
        return any(pin.level >= 0 and pin is not self._data for pin in self._data.net.pins)

    def _strict(self, symbol: str) -> bool:
        return self._chip.policy.of(ds.AC.rules[symbol].name) == STRICT

    # -- hold times ---------------------------------------------------------------------------

    def _hold_over(self) -> None:
        self._chip.advance()
        self._settle_holds(self._kernel.now)
        self._chip.rearm()

    def settle(self) -> None:
        """Find what has happened to D0-D7 since the last cycle ended."""
        if self._wrote > _LONG_AGO or self._read > _LONG_AGO:
            self._settle_holds(self._kernel.now)

    def _settle_holds(self, now: int) -> None:
        net = self._data.net
        if self._wrote > _LONG_AGO:
            # A change at the very instant came before the edge, if the byte was that value.
            moved = max(net.changed_at, net.let_go_at)
            late = moved > self._wrote or (
                moved == self._wrote and (net.value != self._byte or not net.driven)
            )
            hold = moved - self._wrote
            if late and hold < self._t16:
                lost = self._chip.report(ds.AC.rules["T16"], hold, self._t16, when=moved)
                self._wrote = _LONG_AGO
                if lost:
                    self._take_back()
            elif now - self._wrote >= self._t16:
                self._wrote = _LONG_AGO
        if self._read > _LONG_AGO:
            hold = net.changed_at - self._read
            others = hold > 0 or (hold == 0 and net.value != self._left)
            if others and hold < self._t12:
                lost = self._chip.report(ds.AC.rules["T12"], hold, self._t12, when=net.changed_at)
                self._read = _LONG_AGO
                if lost:
                    self._take_back()
            elif now - self._read >= self._t12:
                self._read = _LONG_AGO

    def _take_back(self) -> None:
        """A strict hold time was broken: the cycle has not been."""
        if self._undo:
            undo, self._undo = self._undo, {}
            take_back(self._chip, undo)

    # -- D0-D7 --------------------------------------------------------------------------------

    def show(self) -> None:
        """Drive what the read under way shows now; status is live (LM-BUS-3)."""
        if self._kernel.now >= self.show_at:
            self.show_at = NEVER
        self._data.drive(_FLOATING if self.show_at != NEVER else self._chip.shown())
