"""The inputs beside the host bus: encoder, limits, trigger, reset and sync."""

from typing import ClassVar, Final

from mypy_extensions import i64

from vbus.chips.mcp1200 import datasheet as ds
from vbus.chips.mcp1200.blocks import STANDING, Blocks
from vbus.chips.mcp1200.counter import index_edge, trigger_edge
from vbus.chips.mcp1200.pins import HostInterface
from vbus.chips.mcp1200.timer import FAR
from vbus.chips.motion.quadrature import COUNTED, INDEX_FELL, INDEX_ROSE, SKIPPED, Quadrature
from vbus.core.kernel import NEVER
from vbus.core.signals import Pin, Watcher
from vbus.core.state import Names

LONG_AGO: Final = 1 - (1 << 62)

INDEX: Final = 2
"""Place of INDEX after CHA and CHB."""

PULSES: Final = (("/RESET", "tIRST"), ("/SYNC", "tIRST"), ("/LIMIT", "tIP"), ("/STOP", "tIP"))
"""Inputs whose low pulses have a shortest length (MCP-TIM-4, 5)."""


class ChannelPins:
    """CHA, CHB and INDEX while something drives them: three-stage filter and 4x decoder.

    Times are clock cycles. A plant does without: it hands over counts.

    Args:
        chip: whose pins.
        blocks: where counts go.
    """

    STATE: ClassVar[Names] = ("_levels: list[i64]", "_since: list[i64]", "decoder: part")
    WIRING: ClassVar[Names] = ("_blocks", "_chip", "_pins")

    def __init__(self, chip: HostInterface, blocks: Blocks) -> None:
        self._chip: HostInterface = chip
        self._blocks: Blocks = blocks
        self._pins: list[Pin] = [chip.pins[name] for name in ("CHA", "CHB", "INDEX")]
        self.decoder: Quadrature = Quadrature(ds.FILTER_STAGES, ds.FILTER_STAGES)
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

    def configure(self, cycle: int) -> None:
        """R1A has changed: the filter clock."""
        dwell = ds.FILTER_STAGES * self._divider()
        self.decoder.set_dwell(cycle, dwell, dwell)
        self.after_load()

    def _divider(self) -> int:
        return ds.FILTER_DIVIDER[self._blocks.registers.encoder_pwm >> 4 & 7]

    def after_load(self) -> None:
        """Find out when the next edge is believed."""
        due = self.decoder.due()
        self._blocks.counter.at_pins = FAR if due == NEVER else due

    def settle(self, cycle: int) -> None:
        """Take what has passed the filter by ``cycle``."""
        blocks = self._blocks
        decoder = self.decoder
        while (found := decoder.settle(cycle)) != 0:
            if found & COUNTED:
                blocks.counter.count_external(decoder.direction, decoder.at)
            if found & SKIPPED:
                blocks.report(ds.DOUBLE_EDGE, decoder.at)
            if found & (INDEX_FELL | INDEX_ROSE):
                blocks.counter.index_external(bool(found & INDEX_ROSE), decoder.at)
        self.after_load()

    def _moved(self) -> None:
        chip = self._chip
        chip.advance()
        a, b, index = levels = [pin.value for pin in self._pins]
        moved = [place for place in range(3) if levels[place] != self._levels[place]]
        now = chip.kernel.now
        if chip.judged:
            self._judge(moved, now)
        self._levels = levels
        for place in moved:
            self._since[place] = now
        self.decoder.edge(chip.cycle_now(), a, b, index)
        self.after_load()
        chip.touched()

    def _judge(self, moved: list[int], now: int) -> None:
        clocks = self._divider()
        for place in reversed(moved):
            symbol = "tIX" if place == INDEX else "tIAB"
            self._chip.judge_filtered(symbol, now - self._since[place], clocks)
        channels = [place for place in moved if place != INDEX]
        if channels:
            # The other channel moved before, or in this instant too.
            since = now if len(channels) == 2 else self._since[1 - channels[0]]
            self._chip.judge_filtered("tAB", now - since, clocks)


class SidePins:
    """/LIMIT, /STOP, /RESET, /SYNC and TRIG as an input.

    The axis' own switches are wired in parallel with the nets: an input is low if its net or a
    closed switch makes it low.

    Args:
        chip: whose pins.
        blocks: what they act on.

    Attributes:
        limit: level of /LIMIT.
        stop: level of /STOP.
        sync: level of /SYNC.
    """

    STATE: ClassVar[Names] = (
        "_levels: list[i64]", "_fell: list[i64]", "limit", "stop", "sync", "_trigger",
        "_home_index",
    )  # fmt: skip
    WIRING: ClassVar[Names] = ("_chip", "_home", "_blocks", "own")

    def __init__(self, chip: HostInterface, blocks: Blocks) -> None:
        self._chip: HostInterface = chip
        self._blocks: Blocks = blocks
        self._levels: list[int] = [1, 1, 1, 1]
        self._fell: list[int] = [LONG_AGO] * 4
        self.limit: i64 = 1
        self.stop: i64 = 1
        self.sync: i64 = 1
        self._trigger: int = 1
        self._home_index: int = 1
        self._home: str = str(chip.settings["home_switch"])
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
            if level == self._levels[place]:
                continue
            self._levels[place] = level
            if level == 0:
                self._fell[place] = now
            elif chip.judged:
                chip.judge(limit, now - self._fell[place])
            if name == "/RESET":
                chip.reset_pin(level)
        self.look(chip.cycle_now())
        chip.touched()

    def look(self, cycle: int) -> None:
        """Find out what has moved by ``cycle``: a net, or a switch of the axis."""
        blocks = self._blocks
        limit, stop, sync, trigger, home = self._inputs()
        if limit != self.limit:
            self.limit = limit
            self._fault(limit, ds.LIMIT_OK, cycle)
        if stop != self.stop:
            self.stop = stop
            self._fault(stop, ds.STOP_OK, cycle)
        if sync != self.sync:
            self.sync = sync
            self._sync_moved()
        if trigger != self._trigger:
            self._trigger = trigger
            if trigger == 0:
                trigger_edge(blocks.registers, blocks.counter.position(cycle))
        if home != self._home_index:
            self._home_index = home
            if self._home == "INDEX":
                index_edge(blocks.registers, home == 1, blocks.counter.position(cycle))

    def _sync_moved(self) -> None:
        """/SYNC has moved: in idle mode it holds the sample timer (MCP-SMP-2)."""
        blocks = self._blocks
        if blocks.state == STANDING:
            if self.sync == 0:
                blocks.hold_timer()
            else:
                blocks.start_timer(self._chip.next_cycle())

    def guard(self) -> None:
        """Idle with /LIMIT low: the motor outputs stay off, whatever R04 says (MCP-MOD-4)."""
        blocks = self._blocks
        if blocks.state == STANDING and self.limit == 0:
            blocks.registers.outputs_off()

    def _fault(self, level: int, flag: int, cycle: int) -> None:
        """/LIMIT or /STOP has moved: low sets its flag at once (MCP-EXC-7)."""
        blocks = self._blocks
        blocks.rest.disturb()
        if level == 0 and blocks.state >= STANDING:
            blocks.registers.fault(flag)  # MCP-EXC-4
            if flag == ds.LIMIT_OK:
                blocks.loop.faults.limit = True
                blocks.pwm.roll(cycle - 1)
                self.guard()
            else:
                blocks.loop.faults.stop = True

    def settle_levels(self) -> None:
        """Take the levels as they stand: power-on."""
        for place, (name, _) in enumerate(PULSES):
            self._levels[place] = self._chip.pins[name].value
        self.limit, self.stop, self.sync, self._trigger, self._home_index = self._inputs()

    def _inputs(self) -> tuple[int, int, int, int, int]:
        """Levels of /LIMIT, /STOP, /SYNC and TRIG with the axis' switches; that of the home one."""
        encoder = self._blocks.encoder
        home = encoder.home_level()
        limit = self._levels[2] & encoder.limit_level()
        stop = self._levels[3] & (home if self._home == "/STOP" else 1)
        trigger = self._chip.pins["TRIG"].value & (home if self._home == "TRIG" else 1)
        return limit, stop, self._levels[1], trigger, home
