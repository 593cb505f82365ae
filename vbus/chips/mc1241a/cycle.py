"""The cycle and its eight slots: profiles, look-ups and motors in step, and rest passed over."""

from typing import ClassVar, Final

from mypy_extensions import i64

from vbus.chips.mc1241a import datasheet as ds
from vbus.chips.mc1241a.axis import FOR_EVER, StepperAxis
from vbus.chips.mc1241a.chipset import ChipSet, ProfileRegisters, SharedParameters
from vbus.chips.mc1241a.encoder import AxisInputs
from vbus.chips.mc1241a.microstep import Microstepper
from vbus.core.kernel import NEVER
from vbus.core.signals import Plant
from vbus.core.state import Names

_SCALE: Final = 32_767.0
"""FULL_SCALE as a float."""


class Windings:
    """What the outputs of an axis drive: the windings of a motor, if there is one.

    Args:
        axis: whose outputs they are.
    """

    DERIVED: ClassVar[Names] = ("*",)

    def __init__(self, axis: StepperAxis) -> None:
        self._stepper: Final[Microstepper] = axis.stepper
        self._active: Final[ProfileRegisters] = axis.active
        self.motor: Plant | None = None
        self.a: i64 = 0
        """Current in phase A that the motor runs with (-32767 to 32767)."""
        self.b: i64 = 0
        self.c: i64 = 0
        # The same, of full scale.
        self._share_a: float = 0.0
        self._share_b: float = 0.0
        self._share_c: float = 0.0

    def take(self, a: i64, b: i64, c: i64) -> None:
        """Run the motor with these currents from now on."""
        self.a, self.b, self.c = a, b, c
        self._share_a = float(a) / _SCALE
        self._share_b = float(b) / _SCALE
        self._share_c = float(c) / _SCALE

    def drive(self, slot: i64) -> None:
        """Run the motor through the slot that begins, with the currents just looked up."""
        if self.motor is not None:
            a, b = self._stepper.outputs(slot, self._active.motor_command)
            self.take(a, b, self._third(a, b))
            self.motor.phases(self._share_a, self._share_b, self._share_c)

    def steady(self, slot: i64) -> bool:
        """Tell whether the axis puts out in a slot what the motor runs with."""
        a, b = self._stepper.outputs(slot, self._active.motor_command)
        return a == self.a and b == self.b and self._third(a, b) == self.c

    def _third(self, a: i64, b: i64) -> i64:
        """Return the third phase current, which the amplifier makes (PMD-USTP-3)."""
        # PMD-USTP-3: the third phase is minus the sum of the others.
        if self._stepper.two_phase:
            return 0
        return -(a + b)


class SampleCycles:
    """Cycles and slots at whole clock numbers, counted from the end of the last reset (NOTES 2).

    Args:
        chip: the chip set.
        axes: its axes.
        shared: what they have in common.
    """

    STATE: ClassVar[Names] = (
        "shared: part", "_driven: list[(i64, i64, i64)]", "motors: parts", "_origin", "_slot",
        "boundary", "_reset_since", "_slot_start", "_slot_end",
    )  # fmt: skip
    WIRING: ClassVar[Names] = ("_axes", "_encoders")
    DERIVED: ClassVar[Names] = ("_slotted", "_windings", "heard", "run_count")

    def __init__(self, chip: ChipSet, axes: list[StepperAxis], shared: SharedParameters) -> None:
        self._chip: Final[ChipSet] = chip
        self._axes: Final[list[StepperAxis]] = axes
        self.shared: Final[SharedParameters] = shared
        self._encoders: Final[list[AxisInputs]] = [axis.encoder for axis in axes]
        self._windings: Final[list[Windings]] = [Windings(axis) for axis in axes]
        self.boundary: i64 = NEVER
        """Instant at which the next slot or cycle begins (ps); NEVER while ~Reset is held."""
        self.heard: bool = False
        """The output pins are observed: every slot counts."""
        self.skipping: bool = True
        """Whether cycles in which nothing happens are passed over; the results are the same."""
        self.run_count: int = 0
        """Cycles run, not passed over, since the chip set was made."""
        self._slotted: bool = False
        self._origin: i64 = 0
        self._slot: i64 = 0
        self._reset_since: i64 = 0
        self._slot_start: i64 = 0
        self._slot_end: i64 = 0

    # -- reset --------------------------------------------------------------------------------

    def stop(self) -> None:
        """A reset begins at the present instant: no cycles, no currents."""
        self.shared.reset()
        # Motors run without currents from here on; a second reset within the first does not begin
        # that time anew.
        if (self.boundary != NEVER or self._chip.clock.stopped) and self._slot:
            self._reset_since = self._chip.instant
        self.boundary = NEVER

    def begin(self, ready: int) -> None:
        """Count from the first clock at which the host port is ready (ps)."""
        # PMD-CYC-2: cycles have whole clocks, 13568 each, and are counted from here: no rounding
        # adds up.
        self._origin = self._chip.clock.cycle_at(ready - 1) + 1
        self._slot = 0
        self.boundary = self.ps_of(0)

    def _end_reset(self) -> None:
        """The axes are at 0, wherever the motors have gone without currents."""
        chip = self._chip
        periods = (chip.instant - self._reset_since) // chip.clock.span(ds.SLOT_CLK)
        for motor in self.motors:
            for _ in range(periods if motor is not None else 0):
                assert motor is not None
                motor.phases(0.0, 0.0, 0.0)
                # A motor at rest stays there: a long reset takes no time of its own.
                if motor.resting():
                    break
        for axis in self._axes:
            axis.encoder.follow(chip.instant, 1.0)
            axis.encoder.reset()

    # -- time ---------------------------------------------------------------------------------

    def ps_of(self, clk: i64) -> i64:
        """Return the instant of clock ``clk``, counted from the end of the last reset."""
        return self._chip.clock.ps(self._origin + clk)

    def clk_from(self, instant: i64) -> i64:
        """Return the first clock at or after ``instant``, counted in the same way."""
        return self._chip.clock.cycle_at(instant - 1) + 1 - self._origin

    def slot_at(self, instant: i64) -> i64:
        """Return the number of the slot under way at ``instant``."""
        slot = (self._chip.clock.cycle_at(instant) - self._origin) // ds.SLOT_CLK
        return slot if slot > 0 else 0

    def overdue(self, instant: int) -> bool:
        """Tell whether the slot that comes next began more than some cycles before an instant."""
        # No machine words: what was saved may lie anywhere.
        there: int = self._chip.clock.cycle_at(instant)
        origin: int = self._origin
        coming: int = self._slot
        begun = origin + coming * ds.SLOT_CLK
        # Two cycles: one is under way, and one may be due at this very instant.
        return self.boundary != NEVER and there - begun > 2 * ds.SLOTS * ds.SLOT_CLK

    @property
    def slot_clk(self) -> i64:
        """Clock at which the last slot began, counted in the same way."""
        return (self._slot - 1) * ds.SLOT_CLK

    # -- slots and cycles ---------------------------------------------------------------------

    def run(self, now: int) -> bool:
        """Run the slot that begins at :attr:`boundary`; tell whether a cycle began with it.

        Args:
            now: the instant up to which whole cycles may be passed over.
        """
        slot = self._slot
        cycle = slot % ds.SLOTS == 0 and slot != 0
        # Rest is passed over in whole cycles: an idle axis costs one comparison in each advance.
        if cycle and self._skip_rest(now):
            return False
        instant = self._chip.instant
        for encoder in self._encoders:
            encoder.follow(instant, 1.0)
        if slot == 0:
            self._end_reset()
        elif cycle:
            self._cycle()
        if self._slotted:
            self._run_slot(instant)
        else:
            self._slot = slot + 1
            self._plan()
        return cycle

    def run_on(self, until: i64) -> None:
        """Run the other slots of the cycle under way, as far as they begin by an instant."""
        while self._slot & ds.SLOTS - 1 and self.boundary <= until:
            instant = self._chip.instant = self.boundary
            for encoder in self._encoders:
                encoder.follow(instant, 1.0)
            self._run_slot(instant)

    def _run_slot(self, instant: i64) -> None:
        """Drive the motors through the slot that begins at an instant."""
        slot = self._slot
        end = self.ps_of((slot + 1) * ds.SLOT_CLK)
        self._slot = slot + 1
        self._slot_start = instant
        self._slot_end = self.boundary = end
        for windings in self._windings:
            windings.drive(slot)

    def _plan(self) -> None:
        """Find the next boundary; slots between cycles count only if something takes them."""
        # Without a motor or an observer the seven slots within a cycle are work that no part sees.
        if not self._slotted:
            self._slot = -(-self._slot // ds.SLOTS) * ds.SLOTS
        self.boundary = self.ps_of(self._slot * ds.SLOT_CLK)

    def pause(self, stopped: bool) -> None:
        """The clock stands from now on, or runs again: how far the slot has come stays."""
        now = self._chip.kernel.now
        shift = -now if stopped else now
        self._slot_start += shift
        self._slot_end += shift

    def replan(self, ready: int) -> None:
        """The clock has another course.

        Args:
            ready: when the host port is ready (ps), for a reset that runs.
        """
        # Of a reset that still runs the cycles count from its new end.
        if not self._slot and not self._chip.clock.stopped:
            self.begin(ready)
            return
        self._plan()
        if self._slotted and not self._chip.clock.stopped:
            self._slot_end = self.boundary

    def _cycle(self) -> None:
        shared = self.shared
        # PMD-CYC-1, PMD-AMB-25: the time counts on first, from any reset, in 32 bits.
        shared.time = shared.time + 1 & 0xFFFFFFFF
        self.run_count += 1
        for axis in self._axes:
            axis.cycle()

    # -- motors -------------------------------------------------------------------------------

    def connect(self, axis: int, motor: Plant) -> None:
        """Attach the motor of an axis, with its encoder and switches."""
        motor.prepare(ds.SLOT_CLK / self._chip.clock.hz)
        self._windings[axis].motor = motor
        for other in self._axes:
            other.encoder.attach(axis, motor)
        self.choose_slots()

    def exchange(self, axis: int, motor: Plant) -> None:
        """Put another motor behind an axis, and behind every encoder that hears the one there."""
        old, self._windings[axis].motor = self._windings[axis].motor, motor
        for each in self._axes:
            each.encoder.exchange(old, motor)

    def choose_slots(self) -> None:
        """Run every slot if a motor or an observer of the outputs takes it, else cycles only."""
        # PMD-USTP-2: the look-ups are computed whenever an output is asked for; they need no slot
        # to run.
        slotted = self.heard or any(motor is not None for motor in self.motors)
        if slotted != self._slotted:
            self._slotted = slotted
            if self.boundary != NEVER:
                if self._slot:
                    self._slot = self.slot_at(self._chip.instant) + 1
                self._plan()

    @property
    def motors(self) -> list[Plant | None]:
        """The motor of each axis."""
        return [windings.motor for windings in self._windings]

    @property
    def _driven(self) -> list[tuple[int, int, int]]:
        """The phase currents that each motor runs with, as they are kept."""
        return [(windings.a, windings.b, windings.c) for windings in self._windings]

    @_driven.setter
    def _driven(self, driven: list[tuple[int, int, int]]) -> None:
        for windings, currents in zip(self._windings, driven, strict=True):
            windings.take(*currents)

    def phase_outputs(self, number: int) -> tuple[i64, i64]:
        """Return phases A and B of an axis as they are now (-32767 to 32767)."""
        slot = self.slot_at(self._chip.instant)
        axis = self._axes[number]
        return axis.stepper.outputs(slot, axis.active.motor_command)

    def hold_outputs(self, number: int) -> None:
        """Keep an axis's outputs until the next look-up: its amplitude or waveform changes.

        What the host asks for at an instant comes before a look-up at that instant.
        """
        # PMD-USTP-2: a new amplitude or waveform is used from the next look-up on.
        slot = self.slot_at(self._chip.instant - 1)
        axis = self._axes[number]
        axis.stepper.hold(slot, axis.active.motor_command)

    def follow_encoders(self) -> None:
        """Bring the position counters up to the present instant inside a slot."""
        instant = self._chip.instant
        if self._chip.clock.stopped:
            return
        fraction = 1.0
        if instant < self._slot_end:
            into = float(instant - self._slot_start)
            fraction = into / float(self._slot_end - self._slot_start)
        for encoder in self._encoders:
            encoder.follow(instant, fraction)

    # -- rest ---------------------------------------------------------------------------------

    def _idle(self) -> int:
        """Return how many coming cycles would change nothing but the time."""
        idle = FOR_EVER
        slot = self.slot_at(self._chip.instant)
        for number, axis in enumerate(self._axes):
            quiet = axis.idle_cycles()
            if quiet == 0:
                return 0
            windings = self._windings[number]
            motor = windings.motor
            # A rotor that still swings moves the encoder: each of its cycles is run.
            if motor is not None and not (windings.steady(slot) and motor.resting()):
                return 0
            idle = min(idle, quiet)
        return idle

    def _skip_rest(self, now: int) -> bool:
        """Pass over whole cycles in which nothing would happen; tell whether there were any."""
        # The cycle under way is run: a command may still change what its slots put out.
        clk = self._chip.clock.cycle_at(now) - self._origin
        over = (clk - self._slot * ds.SLOT_CLK) // ds.CYCLE_CLK
        if not over or not self.skipping or self.heard:
            return False
        cycles = min(self._idle(), over)
        if cycles == 0:
            return False
        self.shared.time = self.shared.time + cycles & 0xFFFFFFFF
        self._slot += cycles * ds.SLOTS
        self.boundary = self.ps_of(self._slot * ds.SLOT_CLK)
        return True

    def next_event(self) -> int:
        """Return the beginning of the first coming cycle that may raise an event (ps)."""
        if self.boundary == NEVER:
            return NEVER
        slot = -(-self._slot // ds.SLOTS) * ds.SLOTS
        idle = self._idle() if slot else 0
        if idle >= FOR_EVER:
            return NEVER
        return self.ps_of((slot + idle * ds.SLOTS) * ds.SLOT_CLK)

    def next_cycle(self) -> int:
        """When the next cycle begins (ps); NEVER while none will."""
        if self.boundary == NEVER:
            return NEVER
        return self.ps_of(-(-self._slot // ds.SLOTS) * ds.SLOTS * ds.SLOT_CLK)

    def resting(self) -> bool:
        """Whether all coming cycles would change nothing but the time."""
        if self.boundary == NEVER:
            return True
        if not self._slot or self.heard or not self.skipping:
            return False
        # A command may have changed what the next look-up gives.
        # A new motor command moves the rotor with the next look-up.
        for windings in self._windings:
            if windings.motor is not None and not windings.steady(self._slot):
                return False
        return self._idle() >= FOR_EVER
