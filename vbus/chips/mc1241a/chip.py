"""The chip set: two axes, one host port, one time."""

from collections.abc import Callable
from typing import ClassVar, Final

from mypy_extensions import i64

from vbus.chips.base import CHANGE, POLL, SAMPLE, AcLimits, check_drive
from vbus.chips.bus_watch import BusTable
from vbus.chips.mc1241a import datasheet as ds
from vbus.chips.mc1241a.axis import NO_AXIS, Interrupts, StepperAxis
from vbus.chips.mc1241a.chipset import ChipSet, SharedParameters
from vbus.chips.mc1241a.commands import Commands
from vbus.chips.mc1241a.cycle import SampleCycles
from vbus.chips.mc1241a.encoder import AxisInputs
from vbus.chips.mc1241a.host_port import PacketPort
from vbus.chips.mc1241a.microstep import Microstepper
from vbus.chips.mc1241a.output import Output
from vbus.chips.mc1241a.pins import AdapterPins
from vbus.chips.tables import CardRow, PinRow, names_of
from vbus.core.kernel import HELD, NEVER, Clock, Kernel
from vbus.core.options import Option, Settings
from vbus.core.signals import Plant, Policy, Rule, ValueTable, Violation
from vbus.core.state import Names


class MC1241A(ChipSet):
    """MC1241A (two axes) and MC1141A (one): microstepping motion processors.

    Addresses of a whole cycle: 0 data, 1 command; reading 1 gives the *adapter's* status byte
    (D7 HostRdy, D6 ~HostIntrpt) and moves no strobe. Writing 2 makes the adapter pulse ~Reset.

    Work is done at whole clock numbers counted from the end of the last reset: every 1696 clocks
    a microstep look-up, every eighth of them a cycle with profiles, breakpoints and events.

    Not modelled: the traffic between the two ICs of the set, supply and clock pins, and the rows
    of the reset table that belong to servo members of the family.
    """

    FAMILY: ClassVar[str] = ds.FAMILY
    ADDRESS_BITS: ClassVar[int] = 1
    AXES: ClassVar[int] = 2
    PARTS: ClassVar[tuple[str, ...]] = ("MC1241A", "MC1141A")
    PINS: ClassVar[tuple[PinRow, ...]] = ds.PINS
    BUS: ClassVar[BusTable | None] = ds.BUS
    RULES: ClassVar[tuple[Rule, ...]] = ds.RULES
    VALUES: ClassVar[ValueTable] = ds.VALUES
    FREE_READS: ClassVar[tuple[int, ...]] = (ds.COMMAND_PORT,)
    TRACELESS: ClassVar[bool] = True
    PERIOD_CLK: ClassVar[int] = ds.SLOT_CLK
    OPTIONS: ClassVar[tuple[Option, ...]] = ds.OPTIONS
    CARD_DECODES: ClassVar[dict[str, tuple[CardRow, ...]]] = ds.CARD_DECODES
    STATE: ClassVar[Names] = (
        "_wake", "_hold_at", "held: bool", "_adapter_read: bool", "busy_stretch", "commands: part",
        "cycles: part", "interrupts: part", "port: part", "output: part", "host_pins: part",
        "axes: parts", "timing_checked: bool",
    )  # fmt: skip
    DERIVED: ClassVar[Names] = ("instant",)

    def __init__(
        self, name: str, part: str, kernel: Kernel, clock: Clock, settings: Settings | None = None,
        policy: Policy | None = None, file: Callable[[Violation], None] | None = None,
    ) -> None:  # fmt: skip
        if part not in self.PARTS:
            raise ValueError(f"part {part!r}: allowed are {', '.join(self.PARTS)}")
        self._wake: i64 = 0
        self._hold_at: i64 = NEVER
        super().__init__(name, part, kernel, clock, settings, policy, file)
        self.ac = AcLimits(self, ds.AC)
        self.axis_count = 2 if part == "MC1241A" else 1
        b_leads = self.settings["phase_b"] == "leads"
        self.shared: Final[SharedParameters] = SharedParameters()
        self.axes: list[StepperAxis] = [
            StepperAxis(number, self.shared, AxisInputs(self, number, self._encoder_source(number)),
                 Microstepper(b_leads), self.find)
            for number in range(self.axis_count)
        ]  # fmt: skip
        self.cycles: Final[SampleCycles] = SampleCycles(self, self.axes, self.shared)
        self.interrupts: Final[Interrupts] = Interrupts(self, self.axes)
        self.commands: Final[Commands] = Commands(self, self.axes, self.cycles, self.interrupts)
        self.port: Final[PacketPort] = PacketPort(self, self.commands, self.cycles)
        self.output: Final[Output] = Output(self, self.cycles, self.axis_count)
        self._adapter_read: bool = False
        self.host_pins: AdapterPins = AdapterPins(self, self.port)
        self.restart(self.kernel.now, 0)
        self._reckon()
        self.advance()

    def _encoder_source(self, number: int) -> int:
        source = int(str(self.settings[f"encoder_{number + 1}"])[-1]) - 1
        if source >= self.axis_count:
            raise ValueError(f"encoder_{number + 1}: the {self.part} has no axis {source + 1}")
        return source

    # -- the bus ------------------------------------------------------------------------------

    def begin_read(self, address: int) -> None:
        """The read strobe falls; address 1 and 2 are the adapter's and have none."""
        self.advance()
        # PMD-BUS-12: the status byte is the adapter's work: it moves no pointer and needs no ready
        # chip.
        if address == ds.DATA_PORT:
            self._adapter_read = False
            self.port.begin_read()
        else:
            self._adapter_read = True

    def end_read(self) -> int:
        """The read strobe rises; return the byte."""
        self.advance()
        if self._adapter_read:
            return self.adapter_status()
        data = self.port.end_read()
        self.input_changed()
        return data

    def write(self, address: int, data: int) -> None:
        """A byte is latched."""
        self.advance()
        if address == ds.DATA_PORT:
            self.port.write_data(data)
        elif address == ds.COMMAND_PORT:
            self.port.write_command(data)
        # PMD-BUS-12: a write there pulses ~Reset, long enough.
        elif address == ds.RESET_PORT:
            self.release_reset(False)
        self.input_changed()

    def adapter_status(self) -> int:
        """Return the status byte of a card: D7 HostRdy, D6 ~HostIntrpt, the others float high."""
        status = 0xFF
        # PMD-BUS-12: D7 is HostRdy.
        if self.kernel.now < self.port.busy_until:
            status &= ~ds.STATUS_READY
        # PMD-BUS-12: D6 is ~HostIntrpt.
        if self.interrupts.axis != NO_AXIS:
            status &= ~ds.STATUS_NO_INTERRUPT
        return status

    def ready_at(self) -> int:
        """Return when HostRdy is high: now or earlier, or the end of the busy time."""
        return self.port.busy_until

    # -- reset --------------------------------------------------------------------------------

    def power_on(self, done: bool) -> None:
        """Start with the reset now, or as if it had just ended; judge the clock (T4, T5)."""
        period = 10**12 // self.clock.hz
        # The longest period stands in whole nanoseconds: 149 for the lowest clock of 6.7 MHz.
        # PMD-TIM-6, PMD-TIM-7: CLK is taken as high for half of its period.
        for symbol, measured in (("T4", period // 2), ("T5", period // 1000 * 1000)):
            self.ac.outside(symbol, measured, measured)
        self.instant = self.kernel.now
        self.restart(self.kernel.now, 0 if done else ds.RESET_CLK)
        self._reckon()
        self.advance()
        self.input_changed()

    def hold_reset(self, when: int) -> None:
        """~Reset is low; if it still is at ``when``, everything stops."""
        self._hold_at = when
        self.input_changed()

    def release_reset(self, lost: bool) -> None:
        """~Reset rises: the reset runs, unless the pulse was too short and is ``lost``."""
        self._hold_at = NEVER
        if not lost:
            self.held = False
            self.restart(self.kernel.now)
        self.input_changed()

    def reset_command(self) -> None:
        """RESET: like ~Reset, counted from when the command was written (PMD-CMD-75)."""
        self.restart(self.port.busy_since)

    def follow_encoders(self) -> None:
        """Bring the position counters up to the present instant."""
        self.cycles.follow_encoders()

    def restart(self, since: int, clocks: int = ds.RESET_CLK) -> None:
        """Take every reset value; the host port is ready ``clocks`` after ``since`` (PMD-RST-1)."""
        self.cycles.stop()
        self.interrupts.reset()
        # PMD-RST-2: axis 1 is the current one.
        self.commands.current = 0
        self.commands.left_switch = False
        for axis in self.axes:
            axis.reset()
        self.output.rest()
        if self.held:
            # PMD-RST-1: the 2 ms count from when ~Reset rises.
            self.port.reset(since, NEVER)
        else:
            # PMD-RST-1: 2 ms, in clocks: a clock that stands does not end it.
            ready = (HELD if self.clock.stopped else since) + self.clock.span(clocks)
            self.port.reset(since, ready)
            self.cycles.begin(ready)
            self.output.reset()

    # -- time ---------------------------------------------------------------------------------

    def advance(self) -> None:
        """Do everything due up to now, in the order of its instants.

        At one instant: first what the host has asked for, then the cycle, then the output pins.
        """
        now: i64 = self.kernel.now
        while self._wake <= now:
            when = self._wake
            self.instant = when
            if self.port.due() == when:
                self._host_effect()
            elif self.interrupts.quiet_until == when:
                self.interrupts.rested()
            elif self._hold_at == when:
                self._hold_at = NEVER
                self.held = True
                self.restart(when)
            elif self.cycles.boundary == when:
                # A command that is being taken in may change what the next cycles do.
                until = self.port.due()
                if now < until:
                    until = now
                if self.cycles.run(until if until < self._hold_at else self._hold_at):
                    self.interrupts.look()
                # Outputs that are observed have edges within the slot: the slots come one at a
                # time.
                if self.cycles.heard:
                    self.output.begin_slot()
                else:
                    # Else all slots up to the next thing that is no slot run in one go.
                    due = self._next_due()
                    self.cycles.run_on(now if now < due else due - 1)
            else:
                self.output.run(when)
            self._reckon()
        self.instant = now

    def _reckon(self) -> None:
        """Work out when the next thing is due."""
        due = self._next_due()
        boundary = self.cycles.boundary
        self._wake = due if due < boundary else boundary

    def _next_due(self) -> i64:
        """Return when the next thing is due that is no slot."""
        due = self.port.due()
        output = self.output.due()
        if output < due:
            due = output
        if self.interrupts.quiet_until < due:
            due = self.interrupts.quiet_until
        return due if due < self._hold_at else self._hold_at

    def _host_effect(self) -> None:
        mode = self.shared.output_mode
        self.port.finish()
        # PMD-USTP-7: all pins of the mode that was left take their resting levels.
        if self.shared.output_mode != mode:
            self.output.change_mode(self.cycles.clk_from(self.kernel.now))
        if self.port.due() == NEVER:
            self.port.show_ready(True)
        self.interrupts.look()

    def overdue(self) -> bool:
        """Tell whether the slot that comes next began long ago."""
        return self.cycles.overdue(self.kernel.now)

    def due(self, kind: int) -> i64:
        """Return when a cycle begins, or a lower bound of what changes."""
        if kind == SAMPLE:
            due = min(self.port.due(), self.interrupts.quiet_until, self._hold_at)
            rests = due == NEVER and self.cycles.resting()
            return NEVER if rests else self.cycles.next_cycle()
        self.advance()
        # Every slot may change something: no byte is promised beyond the next one.
        if kind == CHANGE:
            return self._wake
        due = self._next_due()
        if self.cycles.heard:
            due = min(due, self.cycles.boundary)
        # PMD-INT-1: with an interrupt standing no event can move the line.
        if self.interrupts.axis == NO_AXIS and any(axis.interrupt_mask for axis in self.axes):
            due = min(due, self.cycles.next_event())
        if kind == POLL and self.port.busy_until > self.kernel.now:
            due = min(due, self.port.busy_until)  # PMD-BUS-12
        return due

    def input_changed(self) -> None:
        """Something from outside has changed the chip set: find what is due next."""
        self._reckon()
        super().input_changed()

    # -- neighbours ---------------------------------------------------------------------------

    def heard_changed(self) -> None:
        """An output has its first listener, or none any more."""
        self.advance()
        self.output.listen(self.cycles.clk_from(self.kernel.now))
        self.cycles.choose_slots()
        self._reckon()
        super().heard_changed()

    def exchange_plant(self, axis: int, plant: Plant) -> None:
        """Put another motor behind an axis, and behind every encoder that hears the one there."""
        self.cycles.exchange(axis, plant)

    def clock_changed(self, shift: Callable[[int, int], int] | None) -> None:
        """Move what the chip set waits for; find when the next cycle comes."""
        now = self.kernel.now
        if shift is not None:
            self.port.busy_until = shift(self.port.busy_until, now)
            self.interrupts.quiet_until = shift(self.interrupts.quiet_until, now)
            self.output.move_instants(shift, now)
            self.cycles.pause(self.clock.stopped)
        if not self.held:
            self.cycles.replan(self.port.busy_until)

    def connect(self, axis: int, plant: Plant) -> None:
        """Attach a stepper motor with its encoder and switches to ``axis`` (0-based).

        Raises:
            ValueError: no such axis, or a plant that does not take phase currents.
        """
        check_drive(self, axis, plant, "phases")
        self.cycles.connect(axis, plant)
        self._reckon()

    # -- state --------------------------------------------------------------------------------

    def ready(self) -> int:
        """Return the level of HostRdy."""
        return int(self.kernel.now >= self.port.busy_until)

    def undriven(self, axis: int) -> str:
        """Return that the amplitude of the windings is 0, as after a reset (PMD-CMD-66)."""
        self.advance()
        if axis >= len(self.axes) or self.axes[axis].active.motor_command:
            return ""
        return "its motor command is 0, so its windings get no current: SET_MTR_CMD sets it"

    def left_over(self) -> list[tuple[Rule, str]]:
        """Return what stands, what was loaded in vain, and that no checksum was read."""
        self.advance()
        found = []
        if self.port.unchecked > 0:
            text = f"no checksum of {self.port.unchecked} packets was read"
            found.append((ds.CHECKSUM_UNREAD, text))
        number = self.interrupts.axis
        if number != NO_AXIS and self.pins["~HostIntrpt"].net.heard:
            found.append(
                (ds.INTERRUPT_STANDS, f"~HostIntrpt is low at the end, for axis {number + 1}")
            )
        if self.commands.left_switch:
            text = "LMTS_OFF was given on a limit switch, and no LMTS_ON since"
            found.append((ds.LIMITS_OFF, text))
        for axis in self.axes:
            errors = axis.events & (ds.COMMAND_ERROR | ds.MOTION_ERROR)
            if errors:
                text = f"axis {axis.number + 1} at the end: {names_of(ds.STATUS_BITS, errors)}"
                found.append((ds.ERRORS_STAND, text))
            if axis.unread:
                text = f"{axis.unread_errors()}, and no status word has shown it to the host"
                found.append((ds.ERROR_UNREAD, text))
            loaded = axis.loaded()
            if loaded is not None and self.port.coming not in ds.UPDATES:
                text = f"axis {axis.number + 1}: what is loaded last no update has taken"
                found.append((loaded, text))
        return found
