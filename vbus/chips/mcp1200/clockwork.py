"""What happens inside at which clock cycle: writes, resets, samples, counts, plant periods."""

from __future__ import annotations

from collections.abc import Callable
from typing import TYPE_CHECKING, Any, Final

from mypy_extensions import i64

from vbus.chips.mcp1200 import datasheet as ds
from vbus.chips.mcp1200.capture import Breakpoint
from vbus.chips.mcp1200.core import IDLE, Core
from vbus.chips.mcp1200.counter import PositionCounter
from vbus.chips.mcp1200.drive import PlantDrive
from vbus.chips.mcp1200.encoder import Encoder
from vbus.chips.mcp1200.output import Pwm
from vbus.chips.mcp1200.registers import HostRegisters
from vbus.chips.mcp1200.rest import Rest
from vbus.chips.mcp1200.stepper import Stepper
from vbus.chips.mcp1200.timer import FAR, SampleTimer
from vbus.chips.registers import RegisterFile
from vbus.kernel import Clock
from vbus.options import Value
from vbus.signals import Rule

if TYPE_CHECKING:
    from vbus.chips.mcp1200.inputs import EncoderPins, SidePins

HELD: Final = 0
"""/RESET is low, or the supply has just come."""
RESETTING: Final = 1
STANDING: Final = 2
"""Idle mode."""
CONTROL: Final = 3

NO_REQUEST: Final = -1

Report = Callable[[Rule, int, int, str, int], bool]


class Clockwork:
    """Everything inside that has its instant, as a clock cycle, worked off in order.

    At one cycle the order is: position counter (encoder, breakpoint, index), written bytes
    becoming visible, end of a reset, results of a sample, start of a sample, breakpoint routine,
    next period of the plant.

    The plant runs in periods that end where its drive can change: at each sample start and at
    each end of BUSY. In idle mode a motor command the host writes reaches the pins at once and
    the plant with its next period (NOTES 5).

    Args:
        clock: the CLK input.
        settings: the chip's board file keys.
        report: files a violation.

    Attributes:
        state: :data:`HELD`, :data:`RESETTING`, :data:`STANDING` or :data:`CONTROL`.
        released: cycle in which Pulse is high after a hard reset, else -1.
    """

    __slots__ = (
        "_aiming", "_at_reset", "_at_results", "_at_routine", "_at_sample", "_clock", "_report",
        "_request", "_stall_clk", "_target", "_writes", "breakpoint", "core", "counter", "drive",
        "encoder", "encoder_pins", "file", "host", "pwm", "released", "rest", "side", "state",
        "stepper", "timer",
    )  # fmt: skip

    def __init__(self, clock: Clock, settings: dict[str, Value], report: Report) -> None:
        self._clock: Clock = clock
        self._report: Report = report
        self.file: RegisterFile = RegisterFile(ds.REGISTERS)
        data = self.file.bytes
        self.core: Core = Core(self.file)
        self.timer: SampleTimer = SampleTimer(data)
        self.encoder: Encoder = Encoder(clock.hz)
        self.stepper: Stepper = Stepper(data)
        self.breakpoint: Breakpoint = Breakpoint(data)
        self.counter: PositionCounter = PositionCounter(
            self.core, self.encoder, self.stepper, self.breakpoint, settings["index"] == "high"
        )
        self.pwm: Pwm = Pwm(data)
        self.drive: PlantDrive = PlantDrive(
            data, self.encoder, self.stepper, self.pwm, settings["drive"] == "dac"
        )
        self.rest: Rest = Rest(self.core, self.drive, self.encoder)
        self.host: HostRegisters = HostRegisters(self)
        self.side: SidePins
        self.encoder_pins: EncoderPins
        self.state: int = HELD
        self.released: i64 = -1
        self._stall_clk: int = int(settings["io_stall_clk"])
        self._request: int = NO_REQUEST
        self._writes: list[tuple[int, int, int]] = []
        self._aiming: bool = False
        """The loop has closed: followers may follow its aim."""
        self._target: i64 = 0
        self._at_reset: i64 = FAR
        self._at_sample: i64 = FAR
        self._at_results: i64 = FAR
        self._at_routine: i64 = FAR

    # -- order --------------------------------------------------------------------------------

    def next(self) -> int:
        """Cycle of the next thing due inside, written bytes included."""
        due = self._next_own()
        return min(due, self._writes[0][0]) if self._writes else due

    def _next_own(self) -> i64:
        # Two at a time: a compiled core makes comparisons of these.
        first = min(self._at_reset, min(self._at_results, self._at_sample))
        return min(min(first, self._at_routine), min(self.encoder.end, self._next_count()))

    def _next_count(self) -> i64:
        """When the position counter has something to do."""
        return min(self.encoder.at, min(self.encoder_pins.at, self.counter.at_match))

    def next_output(self) -> int:
        """A cycle not later than the next change of an output other than Pulse and Sign."""
        due = min(self._next_count(), self._at_reset, self._at_results, self._at_routine)
        if self._writes:
            due = min(due, self._writes[0][0])
        awake = self.state == CONTROL or self._request != NO_REQUEST or self.breakpoint.armed
        if awake:
            due = min(due, self._at_sample)
        if self.encoder.plant is not None and (awake or not self.drive.at_rest()):
            due = min(due, self.encoder.end)
        return due

    def run(self, target: int) -> None:
        """Work off everything due by the cycle ``target``."""
        self._target = target
        writes = self._writes
        while True:
            cycle = self._next_own()
            if writes:
                first = writes[0][0]
                counting = self._next_count() <= cycle
                if first <= target and (first < cycle or (first == cycle and not counting)):
                    self._take_write(*writes.pop(0))
                    continue
            if cycle > target:
                return
            if self._next_count() <= cycle:
                self._count(cycle)
            elif self._at_reset == cycle:
                self._end_reset(cycle)
            elif self._at_results == cycle:
                self._results(cycle)
            elif self._at_sample == cycle:
                self._sample(cycle)
            elif self._at_routine == cycle:
                self._routine(cycle)
            else:
                self._next_period(cycle)

    def _count(self, cycle: int) -> None:
        """The position counter comes to something worth a look."""
        self.rest.disturb()
        if self.encoder.at == cycle:
            self.counter.edge(cycle)
            self.side.look(cycle)
        elif self.encoder_pins.at <= cycle:
            self.encoder_pins.settle(cycle)
        else:
            self.counter.match()
            self.counter.replan(cycle)

    # -- what the bus does --------------------------------------------------------------------

    def write(self, cycle: int, address: int, data: int) -> None:
        """A byte has been written in ``cycle``; it is visible some clocks later (MCP-BUS-5)."""
        if self.state != HELD:
            self._writes.append((cycle + ds.WRITE_CLK, address, data))

    def lose_write(self) -> None:
        """Forget the byte written last, if it is not yet visible."""
        if self._writes:
            self._writes.pop()

    def stall(self) -> bool:
        """An access costs the core a clock or more, if the board says so (MCP-BUS-11).

        Returns:
            Whether what is due inside has moved.
        """
        if self._stall_clk and self._at_results != FAR:
            self._at_results += self._stall_clk
            return True
        return False

    def _take_write(self, cycle: int, address: int, data: int) -> None:
        self.rest.disturb()
        before = self.counter.equal(cycle)
        self.pwm.roll(cycle - 1)
        self.host.write(self.host.map(address), data, cycle)
        self.counter.look_equal(before, cycle)

    def request(self, mode: int, cycle: int) -> None:
        """R05 has been written (MCP-MOD-1)."""
        self._request = mode
        if self.state == STANDING and mode != ds.CONTROL_CODE:
            self._request = NO_REQUEST
            if mode == ds.SOFT_RESET_CODE:
                self._begin_reset(cycle)
            elif mode == ds.IDLE_CODE:
                self.core.enter_idle()
        elif self.state < STANDING:
            self._request = NO_REQUEST

    def report(self, rule: Rule, cycle: int = -1, measured: int = 0, detail: str = "") -> None:
        """File a violation of clock cycle ``cycle``, or of just now."""
        self._report(rule, measured, 0, detail, -1 if cycle < 0 else self._clock.ps(cycle))

    # -- what the inputs do -------------------------------------------------------------------

    def controlling(self) -> bool:
        """Whether mode flags take effect: control mode, not halted."""
        return self.state == CONTROL and not self.core.halted

    def guard(self) -> None:
        """Idle with /LIMIT low: the motor outputs stay off (MCP-MOD-4)."""
        if self.state == STANDING and self.side.limit == 0 and self.file.bytes[ds.EXCEPTION] & 3:
            self.core.outputs_off()

    def sync_pin(self, level: int, cycle: int) -> None:
        """/SYNC has moved: in idle mode it holds the sample timer (MCP-SMP-2)."""
        if self.state == STANDING:
            if level == 0:
                self._hold_timer()
            else:
                self._start_timer(cycle)

    def _hold_timer(self) -> None:
        self.timer.hold()
        self._at_sample = FAR
        self._at_routine = FAR

    def _start_timer(self, cycle: int) -> None:
        self.timer.reload(cycle)
        self._at_sample = self.timer.next_zero()

    # -- reset --------------------------------------------------------------------------------

    def hold(self, cycle: int) -> None:
        """Hard reset: everything as after power-on, until it is released (MCP-RST-1 to 3)."""
        self.state = HELD
        self.file.reset()
        self.stepper.clear(cycle)
        self.core.soft_reset()
        self.file.bytes[ds.FLAG] = 0
        self.file.bytes[ds.MODE] = 0
        self.core.point = 0
        self.core.velocity_point = 0
        self.encoder.swap(False, cycle)
        self.counter.preset(0, cycle)
        self.breakpoint.clear()
        self.host.clear()
        self.encoder_pins.configure(cycle)
        self._writes.clear()
        self._stop()
        self._at_reset = FAR
        self.released = -1
        self.counter.replan(cycle)

    def _stop(self) -> None:
        self._request = NO_REQUEST
        self._hold_timer()
        self._at_results = FAR
        self._aiming = False

    def release(self, cycle: int) -> None:
        """/RESET has risen: Pulse is high for one clock, a soft reset follows (MCP-RST-1)."""
        if self.state == HELD:
            self.released = cycle
            self.pwm.restart(cycle)
            self._begin_reset(cycle)

    def finish_reset(self, cycle: int) -> None:
        """The reset is over at once: a board that starts after it."""
        self.released = -1
        self._end_reset(cycle)

    def _begin_reset(self, cycle: int) -> None:
        self.state = RESETTING
        self._stop()
        data = self.file.bytes
        data[ds.FLAG] = 0
        data[ds.MODE] = 0
        data[ds.STATUS] &= ~ds.BUSY
        self.stepper.stop(cycle)
        self._at_reset = cycle + ds.RESET_CLK

    def _end_reset(self, cycle: int) -> None:
        self._at_reset = FAR
        self.pwm.roll(cycle - 1)
        self.core.soft_reset()
        self.counter.preset(0, cycle)
        self.state = STANDING
        self.host.clear_errors()
        if self.side.sync:
            self._start_timer(cycle)
        self.counter.replan(cycle)

    # -- samples ------------------------------------------------------------------------------

    def _sample(self, cycle: int) -> None:
        """The sample timer is at zero: a sample starts."""
        if self._at_results != FAR:
            # The one before is not finished (MCP-SMP-4).
            self.core.fault(ds.TIMER_OK)
            self._enter_idle(cycle)
        self._start_timer(cycle)
        cycle = self._skip(cycle)
        position = self.counter.position(cycle)
        request, self._request = self._request, NO_REQUEST
        if self.state == CONTROL:
            if request == ds.SOFT_RESET_CODE:
                self._begin_reset(cycle)
                return
            if request == ds.IDLE_CODE:
                self._enter_idle(cycle)
            elif request == ds.CONTROL_CODE:
                self.core.halted = False
        elif request == ds.CONTROL_CODE:
            self._enter_control(cycle, position)
        if self.state == CONTROL:
            self._begin_control_sample(cycle, position, request == ds.HALT_CODE)
        else:
            self.core.last_position = position
        self._at_routine = cycle + ds.BREAK_ROUTINE_CLK if self.breakpoint.sample() else FAR
        if self.state == STANDING and self.side.sync == 0:
            self._hold_timer()

    def _enter_control(self, cycle: int, position: int) -> None:
        self.state = CONTROL
        self.core.enter_control(position)
        self.file.bytes[ds.MODE] = ds.CONTROL_CODE
        self._aiming = False
        self.rest.disturb()
        self._look_for_stall(cycle)

    def _begin_control_sample(self, cycle: int, position: int, halt: bool) -> None:
        work = self.core.begin(position, self.side.limit == 0, self.side.stop == 0, halt)
        if work == IDLE:
            self._enter_idle(cycle)
            return
        self._at_results = cycle + work
        self._look_for_stall(cycle)
        if self.core.abrupt:
            self.stepper.stop(cycle)

    def _look_for_stall(self, cycle: int) -> None:
        counts = self.encoder.count(cycle) + self.encoder.external
        self.core.stall.look(self.stepper.sent(cycle), counts)

    def _enter_idle(self, cycle: int) -> None:
        self._at_results = FAR
        self._aiming = False
        self.state = STANDING
        self.pwm.roll(cycle - 1)
        self.stepper.stop(cycle)
        self.core.enter_idle()
        self.file.bytes[ds.MODE] = ds.IDLE_CODE
        self.counter.replan(cycle)

    def _results(self, cycle: int) -> None:
        """BUSY ends: the sample's results appear (MCP-SMP-5)."""
        self._at_results = FAR
        core = self.core
        self.pwm.roll(cycle - 1)
        core.finish()
        self._aiming = True
        data = self.file.bytes
        data[ds.MODE] = ds.HALT_CODE if core.halted else ds.CONTROL_CODE
        if core.goal_step:
            self._report(ds.GOAL_STEP, core.goal_step, 127, "", self._clock.ps(cycle))
        if data[ds.CONFIG] & ds.STEP_MODE:
            period = self.timer.period
            self.stepper.batch(cycle, core.steps, period)
            if self.stepper.overrun(period):
                most = period // self.stepper.width
                self._report(ds.STEP_OVERRUN, abs(core.steps), most, "", self._clock.ps(cycle))
            self.counter.replan(cycle)
        self.rest.note()

    def _routine(self, cycle: int) -> None:
        """The breakpoint routine of the sample (MCP-BRK-2, 3)."""
        self._at_routine = FAR
        self.rest.disturb()
        before = self.counter.equal(cycle)
        if self.breakpoint.routine():
            self.file.bytes[ds.STATUS] |= ds.BREAKPOINT_OK
        self.counter.look_equal(before, cycle)

    def _skip(self, cycle: int) -> int:
        """Pass over samples that would change nothing; return the one to compute."""
        control = self.state == CONTROL
        if self._request != NO_REQUEST or self.breakpoint.sample():
            return cycle
        last = min(self._target, self._next_count() - 1)
        if self._writes:
            last = min(last, self._writes[0][0] - 1)
        periods = self.rest.periods(cycle, last, self.timer.period, control)
        if periods > 0:
            passed = periods * self.timer.period
            cycle += passed
            self._start_timer(cycle)
            if self.encoder.plant is not None:
                self.encoder.skip(passed)
        return cycle

    def _next_period(self, cycle: int) -> None:
        """The plant's period is over: run it to the next instant its drive may change."""
        end = self._at_sample if self._at_sample > cycle else FAR
        if cycle < self._at_results < end:
            end = self._at_results
        if end == FAR:
            end = cycle + self.timer.period
        self.drive.period(cycle, end, self._aiming, self.core.following.aim())
        self.counter.plan()

    # -- state --------------------------------------------------------------------------------

    def _parts(self) -> tuple[Any, ...]:
        return (
            self.file, self.core, self.timer, self.encoder, self.drive, self.stepper, self.pwm,
            self.breakpoint, self.host,
        )  # fmt: skip

    def save(self) -> tuple[object, ...]:
        """Return the state."""
        return (
            self.state, self.released, self._request, tuple(self._writes), self._aiming,
            self._at_reset, self._at_sample, self._at_results, self._at_routine,
            self.counter.at_match, tuple(part.save() for part in self._parts()),
        )  # fmt: skip

    def load(self, state: tuple[object, ...]) -> None:
        """Take back what :meth:`save` gave."""
        (
            self.state, self.released, self._request, writes, self._aiming, self._at_reset,
            self._at_sample, self._at_results, self._at_routine, self.counter.at_match, parts,
        ) = state  # type: ignore[assignment]  # fmt: skip
        self._writes[:] = [tuple(write) for write in writes]  # type: ignore[attr-defined]
        self.rest.disturb()
        for part, saved in zip(self._parts(), parts, strict=True):  # type: ignore[call-overload]
            part.load(saved)
