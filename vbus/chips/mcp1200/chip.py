"""The MCP-1200 as a board sees it."""

from collections.abc import Callable
from typing import ClassVar, Final

from mypy_extensions import i64

from vbus.chips.base import CHANGE, EDGE, POLL, SAMPLE, AcLimits, check_drive
from vbus.chips.bus_watch import BusTable
from vbus.chips.mcp1200 import datasheet as ds
from vbus.chips.mcp1200.axis import ClockedAxis
from vbus.chips.mcp1200.control_loop import STANDING
from vbus.chips.mcp1200.output import OutputPins
from vbus.chips.mcp1200.pins import LONG_AGO, HostInterface, StrobePins
from vbus.chips.mcp1200.registers import FAR
from vbus.chips.tables import PinRow, names_of
from vbus.core.kernel import MS, NEVER, Clock, Kernel
from vbus.core.options import Option, Settings
from vbus.core.signals import HIGH, LOW, Plant, Policy, Rule, ValueTable, Violation, Watcher
from vbus.core.state import Names

NO_READ: Final = -1
"""In place of an address: no read is under way."""

MODES: Final = {
    0: "position", ds.F0: "profile", ds.F3: "position interpolation",
    ds.F4: "velocity interpolation", ds.F5: "velocity",
}  # fmt: skip


class MCP1200(HostInterface):
    """MCP-1200, a motion controller with the register map of the HCTL-1100, extended.

    All of its own time is counted in clock cycles, by :class:`ClockedAxis`; this class is the
    way in: bus cycles, nets, the kernel's picoseconds.

    Not modelled: supply current, temperature, input thresholds, metastability of the
    synchronisers. The HCTL-1100's commutator and proportional velocity mode do not exist here,
    as in the real chip.
    """

    FAMILY: ClassVar[str] = ds.FAMILY
    ADDRESS_BITS: ClassVar[int] = ds.ADDRESS_BITS
    PARTS: ClassVar[tuple[str, ...]] = ds.PARTS
    PINS: ClassVar[tuple[PinRow, ...]] = ds.PINS
    BUS: ClassVar[BusTable | None] = ds.BUS
    RULES: ClassVar[tuple[Rule, ...]] = ds.RULES
    VALUES: ClassVar[ValueTable] = ds.VALUES
    FREE_READS: ClassVar[tuple[int, ...]] = (ds.STATUS,)
    OPTIONS: ClassVar[tuple[Option, ...]] = ds.OPTIONS

    STATE: ClassVar[Names] = (
        "_reading", "_latch", "_last_rise", "timing_checked: bool", "axis: part",
        "side = axis.inputs: part", "encoder_pins = axis.channels: part", "bus: part",
    )  # fmt: skip
    WIRING: ClassVar[Names] = ("outputs", "_own")
    DERIVED: ClassVar[Names] = ("_due_ps", "_quiet_ps", "_pulse_heard")

    def __init__(
        self, name: str, part: str, kernel: Kernel, clock: Clock, settings: Settings | None = None,
        policy: Policy | None = None, file: Callable[[Violation], None] | None = None,
    ) -> None:  # fmt: skip
        self._due_ps: i64 = NEVER
        self._quiet_ps: i64 = 0  # Pulse and Sign stay before this instant
        super().__init__(name, part, kernel, clock, settings, policy, file)
        self.ac = AcLimits(self, ds.AC[str(self.settings["supply"])])
        self.read_low_ps = self.ac.least["tALDB"]
        self.cycle_ps += self.ac.least["tCSAL"]
        self._reading: int = NO_READ
        self._latch: int = 0
        self._last_rise: int = LONG_AGO
        self._pulse_heard: bool = False
        self._own: dict[str, Watcher] = {}
        axis = ClockedAxis(self)
        self.axis: Final[ClockedAxis] = axis
        self.outputs: OutputPins = OutputPins(
            self, axis.registers, axis.loop, axis.stepper, axis.pwm
        )
        self.bus: StrobePins = StrobePins(self)
        self._own = {"TRIG": axis.inputs.own, ds.DATA: self.bus.own}
        self._judge_clock()
        self.axis.hold(self.cycle_now())
        self.input_changed()

    # -- bus cycles ---------------------------------------------------------------------------

    def begin_read(self, address: int) -> None:
        """The output latch follows the register at ``address`` from now on (MCP-BUS-6)."""
        self.advance()
        self._reading = address & 0x7F

    def end_read(self) -> int:
        """/CS rises on a read: the output latch is frozen, and reading has its effects."""
        self.advance()
        if self._reading != NO_READ:
            host = self.axis.host
            address = host.map(self._reading)
            self._reading = NO_READ
            # MCP-BUS-12: under the strict policy the later access is lost: the latch keeps what it
            # had.
            if not self._too_soon(ds.RECOVERY_READ_CLK):
                cycle = self.cycle_now()
                self._latch = host.read(address, cycle)
                # MCP-BUS-6: what a read does besides it does here, when /CS rises.
                host.taken(address, cycle)
                self._stall()  # MCP-BUS-11
        return self._latch

    def drop_read(self) -> None:
        """A read that was begun does not take place; the latch keeps what it had."""
        self._reading = NO_READ

    def drop_write(self) -> None:
        """The byte just written does not count after all (strict policy)."""
        self.axis.writes.lose()

    def output(self) -> int:
        """What /OE puts on the bus now."""
        # MCP-BUS-7: the latch keeps its byte until the next read.
        if self._reading == NO_READ:
            return self._latch
        host = self.axis.host
        return host.read(host.map(self._reading), self.cycle_now())

    def write(self, address: int, data: int) -> None:
        """/CS rises on a write: the byte is visible inside four clocks later (MCP-BUS-5)."""
        self.advance()
        self._reading = NO_READ  # of a host that held the strobes of one by hand
        # MCP-BUS-12: four clocks apart, or the later one is lost under the strict policy.
        if not self._too_soon(ds.RECOVERY_WRITE_CLK):
            self.axis.write(self.cycle_now(), address & 0x7F, data & 0xFF)
            self._stall()  # MCP-BUS-11
        self.input_changed()

    def _too_soon(self, clocks: int) -> bool:
        """Note a /CS rise; judge the time since the last one (MCP-BUS-12)."""
        # No machine words: the end of time less a rise long ago does not fit one.
        now: int = self.kernel.now
        passed = now - self._last_rise
        self._last_rise = now
        least: int = self.clock.span_up(clocks)
        return passed < least and self.report(ds.RECOVERY, passed, least)

    def _stall(self) -> None:
        if self.axis.stall():
            self._refresh_due()

    def step_ps(self) -> i64:
        """Return the shortest sample period to come, which may be a single clock (MCP-SMP-1)."""
        self.advance()
        if self.resting():
            return NEVER
        return self.clock.span(self.axis.shortest_period())

    def ready_at(self) -> int:
        """Return when the recovery time of the last access is over (MCP-BUS-12)."""
        return self._last_rise + self.clock.span_up(ds.RECOVERY_WRITE_CLK)

    # -- time ---------------------------------------------------------------------------------

    def advance(self) -> None:
        """Bring the chip up to now."""
        if self.kernel.now >= self._due_ps:
            cycle = self.cycle_now()
            self.axis.run(cycle)
            self._refresh_due()
            self.outputs.show(cycle)
            # What is due inside may have begun another frame, or steps.
            self._quiet_ps = 0
        elif self.kernel.now >= self._quiet_ps:
            # Pulse and Sign move between the things due inside; the next edge is known, though.
            cycle = self.cycle_now()
            self.outputs.show_pulse(cycle)
            edge = self.outputs.pulse_edge(cycle)
            self._quiet_ps = self._instant(edge)
        if self._reading != NO_READ:
            self.bus.refresh()

    def input_changed(self) -> None:
        """Something from outside has changed the chip: show it, and set the timer anew."""
        self._refresh_due()
        self._quiet_ps = 0
        self.outputs.show(self.cycle_now())
        self.bus.refresh()
        super().input_changed()

    def _refresh_due(self) -> None:
        self._due_ps = self._instant(self.axis.next())

    def _instant(self, cycle: i64) -> i64:
        """Return when a cycle is that may not come (ps)."""
        if cycle == FAR:
            return NEVER
        return self.clock.ps(cycle)

    def due(self, kind: int) -> i64:
        """Return when a sample starts or shows (MCP-SMP-5), or a lower bound of what changes."""
        if kind == SAMPLE:
            rests = self._reading == NO_READ and self.axis.resting()
            return NEVER if rests else self._instant(self.axis.next_sample())
        self.advance()
        if kind in (CHANGE, POLL):
            return self._due_ps
        # No sample can move an output that is observed: none need be run at its instant.
        if kind == EDGE and self._reading == NO_READ and not self.outputs.may_move():
            return self._instant(self.axis.next_order())
        # The data bus follows a register that is read, in idle mode too (MCP-BUS-6).
        due: i64 = self.axis.next_output() if self._reading == NO_READ else self.axis.next()
        if self._pulse_heard:
            due = min(due, self.outputs.pulse_edge(self.cycle_now()))
        return self._instant(due)

    def heard_changed(self) -> None:
        """An output has its first listener, or none; the chip's own watchers do not count."""
        if not self._own:
            return
        heard = False
        for name, pin in self.pins.items():
            if pin.on_heard is not None:
                own = self._own.get(name)
                # TRIG and the data bus are inputs of the chip, too: it watches them itself.
                others = any(watcher is not own for watcher in pin.net.watchers)
                heard = heard or others or bool(pin.net.observers) or pin.net.contested
        self._pulse_heard = self.pins["PULSE"].net.heard or self.pins["SIGN"].net.heard
        self.heard = heard
        if heard:
            self.advance()
            self.rearm()
        else:
            self.timer.cancel()

    # -- board --------------------------------------------------------------------------------

    def power_on(self, done: bool) -> None:
        """Supply is up; /RESET is released now unless something holds it low."""
        cycle = self.next_cycle()
        self.axis.hold(cycle)
        self.clear_bus()
        self.axis.inputs.settle_levels()
        self.axis.channels.settle_levels()
        # MCP-RST-1: the reset ends with the release of the pin, or now if none holds it.
        if self.pins["/RESET"].value == HIGH:
            self.axis.release(cycle)
            if done:
                self.axis.finish_reset(cycle)
        self.input_changed()

    def reset_pin(self, level: int) -> None:
        """/RESET has moved."""
        if level == LOW:
            self.axis.hold(self.cycle_now())
            self.clear_bus()
        else:
            self.axis.release(self.next_cycle())

    def clear_bus(self) -> None:
        """The I/O control logic is cleared."""
        self._reading = NO_READ
        self._latch = 0
        self.bus.clear()

    def exchange_plant(self, axis: int, plant: Plant) -> None:
        """Put other mechanics behind the encoder."""
        self.axis.encoder.plant = plant

    def invalidate(self) -> None:
        """Something behind the chip is different now: rest is over, switches may have moved."""
        # MCP-EXC-7: a switch that moves sets its flag at once, as a pin does.
        self.axis.rest.invalidate()
        self.look()

    def look(self) -> None:
        """An input beside the host bus has moved, or a switch of the axis."""
        self.axis.look(self.cycle_now(), self.next_cycle())
        self.input_changed()

    def connect(self, axis: int, plant: Plant) -> None:
        """Attach a motor (``drive``), or a stepper with its driver (``pulses``)."""
        check_drive(self, axis, plant, "drive", "pulses")
        home = self.settings["home_switch"] != "none"
        encoder = self.axis.encoder
        encoder.connect(plant, bool(self.settings["limit_switches"]), home)
        # The plant's first period is run from here on.
        encoder.end = self.cycle_now()
        self.axis.inputs.settle_levels()
        self.input_changed()

    # -- AC limits ----------------------------------------------------------------------------

    def _judge_clock(self) -> None:
        """Judge what the board file says about the clock and the edges of inputs."""
        period: int = self.clock.span(1)
        # MCP-TIM-1: with a longest period, too.
        self.ac.outside("tCPER", period, self.clock.span_up(1))
        high = int(period * float(self.settings["clock_high"]))
        # MCP-TIM-2: high and low for 0.3 of the period each.
        self.ac.short("tCPWH", high)
        self.ac.short("tCPWL", period - high)
        for symbol, key in (
            ("tCR", "clock_edge"), ("tIABR", "input_edge"), ("tIR", "input_edge"),
        ):  # fmt: skip
            edge = int(self.settings[key])
            self.ac.outside(symbol, edge, edge)

    # -- looking in, and state ----------------------------------------------------------------

    def mode(self) -> str:
        """Return what the chip does: reset, idle, halted, or the mode of its control loop."""
        axis = self.axis
        if axis.loop.state < STANDING:
            return "reset"
        if axis.loop.state == STANDING:
            return "idle"
        return "halted" if axis.loop.halted else MODES[axis.loop.mode]

    def drive(self) -> float:
        """Return the motor output as a fraction of full scale."""
        return round(self.axis.drive.level(), 4)

    def hint(self, rule: str, when: int) -> str:
        """Return that a write came into the reset at power-on."""
        if rule != ds.RESET_WRITE.name or when > self.clock.span_up(ds.RESET_CLK):
            return ""
        return (
            f"hint: {self.name} is in the reset that follows power-on (MCP-RST-5): wait until F1 is"
            ' 1, or write power_on = "done" in [board], and the board starts after that reset'
        )

    def left_over(self) -> list[tuple[Rule, str]]:
        """Return that errors of the status register stand, and what was written in vain."""
        self.advance()
        found = self.axis.host.left_over()
        # An error flag is 0 when it has happened.
        standing = ds.ERROR_FLAGS & ~int(self.axis.registers.status)
        if standing:
            names = names_of(ds.STATUS_BITS, standing)
            text = f"in R07 these are 0 at the end, and mean errors: {names}"
            found.append((ds.ERRORS_STAND, text))
        return found

    def before_save(self) -> None:
        """However seldom anybody has looked at Pulse, its frame is the one under way now."""
        self.advance()
        self.axis.pwm.roll(self.cycle_now())
        self.outputs.show_pulse(self.cycle_now())

    def overdue(self) -> bool:
        """Tell whether a count, a sample or a period of the plant was due long ago."""
        # No machine words: what was saved may lie anywhere.
        now: int = self.cycle_now()
        longest: int = self.clock.cycle_at(MS)
        due: int = self.axis.next()
        return now - due > longest

    def after_load(self) -> None:
        """What the pins show is not known any more."""
        self._quiet_ps = 0
        self._refresh_due()
