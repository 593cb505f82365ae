"""What happens inside at which clock cycle: writes, resets, samples, counts, plant periods."""

from typing import ClassVar

from mypy_extensions import i64

from vbus.chips.mcp1200 import datasheet as ds
from vbus.chips.mcp1200.blocks import (
    CONTROL,
    HELD,
    NO_REQUEST,
    NOT_RELEASED,
    STANDING,
    Blocks,
    Report,
)
from vbus.chips.mcp1200.command import widest
from vbus.chips.mcp1200.control_loop import IDLE
from vbus.chips.mcp1200.host_registers import HostRegisters
from vbus.chips.mcp1200.inputs import ChannelPins, SidePins
from vbus.chips.mcp1200.timer import FAR
from vbus.core.kernel import Clock
from vbus.core.options import Value
from vbus.core.state import Names


class ClockedAxis(Blocks):
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
    """

    STATE: ClassVar[Names] = (
        "state", "released", "_request", "writes: part", "_aiming: bool", "_at_reset", "_at_sample",
        "_at_results", "_at_routine", "counter: part", "registers: part", "loop: part",
        "timer: part", "encoder: part", "drive: part", "stepper: part", "pwm: part",
        "breakpoint: part", "host: part",
    )  # fmt: skip
    WIRING: ClassVar[Names] = (
        "_clock", "_report", "_stall_clk", "encoder_pins", "rest", "side",
    )  # fmt: skip
    DERIVED: ClassVar[Names] = ("_target",)

    def __init__(self, clock: Clock, settings: dict[str, Value], report: Report) -> None:
        super().__init__(clock, settings, report)
        self.host: HostRegisters
        self.side: SidePins
        self.encoder_pins: ChannelPins
        self._stall_clk: int = int(settings["io_stall_clk"])
        self._target: i64 = 0

    def attach(self, side: SidePins, encoder_pins: ChannelPins) -> None:
        """Take the inputs beside the host bus."""
        self.side = side
        self.encoder_pins = encoder_pins
        self.host = HostRegisters(self, side, encoder_pins)

    # -- order --------------------------------------------------------------------------------

    def next(self) -> i64:
        """Cycle of the next thing due inside, written bytes included."""
        return min(self._next_own(self._next_count()), self.writes.due)

    def _next_own(self, count: i64) -> i64:
        """Cycle of the next thing due but what is written; ``count``: of the position counter."""
        # Two at a time: a compiled core makes comparisons of these.
        first = min(min(count, self.encoder.end), min(self._at_results, self._at_sample))
        return min(first, min(self._at_routine, self._at_reset))

    def _next_count(self) -> i64:
        """When the position counter has something to do."""
        return min(self.encoder.at, min(self.counter.at_pins, self.counter.at_match))

    def next_output(self) -> i64:
        """A cycle not later than the next change of an output other than Pulse and Sign."""
        due = min(min(self._next_count(), self._at_reset), min(self._at_results, self._at_routine))
        due = min(due, self.writes.due)
        awake = self.state == CONTROL or self._request != NO_REQUEST or self.breakpoint.armed
        if awake:
            due = min(due, self._at_sample)
        if self.encoder.plant is not None and (awake or not self.drive.at_rest()):
            due = min(due, self.encoder.end)
        return due

    def next_order(self) -> i64:
        """Cycle of what comes next of the bus or a reset, whatever the samples do."""
        return min(self.writes.due, self._at_reset)

    def asked(self) -> bool:
        """Whether the next sample obeys a command for another mode of operation."""
        return self._request != NO_REQUEST

    def next_sample(self) -> int:
        """Cycle at which a sample starts or its results show, whichever comes first."""
        return min(self._at_sample, self._at_results)

    def resting(self) -> bool:
        """Whether samples repeat themselves and nothing else is due."""
        due = min(min(self._next_count(), self.writes.due), min(self._at_reset, self._at_routine))
        if due != FAR or self._request != NO_REQUEST or self.breakpoint.waiting:
            return False
        return self.rest.lasts(self.state == CONTROL, self.timer.running and self.side.sync == 1)

    def shortest_period(self) -> int:
        """Return the period of this sample, or of the next if that may be shorter (clocks)."""
        if self.writes.waits_for(ds.SAMPLE_PERIOD):
            return 1
        period, coming = self.timer.period, self.timer.coming
        return period if period < coming else coming

    def run(self, target: i64) -> None:
        """Work off everything due by then."""
        self._target = target
        writes = self.writes
        while True:
            count = self._next_count()
            cycle = self._next_own(count)
            first = writes.due
            if first <= target and first <= cycle and first < count:
                self._take_write(first)
                continue
            if cycle > target:
                return
            if count <= cycle:
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

    def _count(self, cycle: i64) -> None:
        """The position counter comes to something worth a look."""
        self.rest.disturb()
        if self.encoder.at == cycle:
            self.counter.edge(cycle)
            self.side.look(cycle)
        elif self.counter.at_pins <= cycle:
            self.encoder_pins.settle(cycle)
        else:
            self.counter.match()
            self.counter.replan(cycle)

    # -- what the bus does --------------------------------------------------------------------

    def write(self, cycle: int, address: int, data: int) -> None:
        """A byte has been written in ``cycle``; it is visible some clocks later (MCP-BUS-5)."""
        if self.state != HELD:
            self.writes.add(cycle, address, data)

    def stall(self) -> bool:
        """An access costs the core a clock or more, if the board says so (MCP-BUS-11).

        Returns:
            Whether what is due inside has moved.
        """
        if self._stall_clk and self._at_results != FAR:
            self._at_results += self._stall_clk
            return True
        return False

    def _take_write(self, cycle: i64) -> None:
        address, data = self.writes.take()
        self.rest.disturb()
        before = self.counter.equal(cycle)
        self.pwm.roll(cycle - 1)
        self.host.write(address, data, cycle)
        self.counter.look_equal(before, cycle)

    # -- reset --------------------------------------------------------------------------------

    def hold(self, cycle: int) -> None:
        """Hard reset: everything as after power-on, until it is released (MCP-RST-1, 3)."""
        self.state = HELD
        self.registers.reset()
        self.stepper.clear(cycle)
        self.loop.hard_reset()
        self.encoder.swap(False, cycle)
        self.counter.preset(0, cycle)
        self.breakpoint.clear()
        self.host.clear()
        self.encoder_pins.configure(cycle)
        self.writes.clear()
        self._stop()
        self._at_reset = FAR
        self.released = NOT_RELEASED
        self.counter.replan(cycle)

    def release(self, cycle: int) -> None:
        """/RESET has risen: Pulse is high for one clock, a soft reset follows (MCP-RST-1)."""
        if self.state == HELD:
            self.released = cycle
            self.pwm.restart(cycle)
            self._begin_reset(cycle)

    def finish_reset(self, cycle: int) -> None:
        """The reset is over at once: a board that starts after it."""
        self.released = NOT_RELEASED
        self._end_reset(cycle)

    def _end_reset(self, cycle: int) -> None:
        self._at_reset = FAR
        self.pwm.roll(cycle - 1)
        self.loop.soft_reset()
        self.counter.preset(0, cycle)
        self.state = STANDING
        self.host.clear_errors()
        if self.side.sync:
            self.start_timer(cycle)
        self.counter.replan(cycle)

    # -- samples ------------------------------------------------------------------------------

    def _sample(self, cycle: i64) -> None:
        """The sample timer is at zero: a sample starts."""
        if self._at_results != FAR:
            # The one before is not finished (MCP-SMP-4).
            self.registers.fault(ds.TIMER_OK)
            self._enter_idle(cycle)
        self.start_timer(cycle)
        if self._request == NO_REQUEST and self.rest.possible(cycle, self.state == CONTROL):
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
                self.loop.halted = False
        elif request == ds.CONTROL_CODE:
            self._enter_control(cycle, position)
        if self.state == CONTROL:
            halt = request == ds.HALT_CODE
            work = self.loop.begin(position, self.side.limit == 0, self.side.stop == 0, halt)
            if work == IDLE:
                self._enter_idle(cycle)
            else:
                self._at_results = cycle + work
                self._look_for_stall(cycle)
                if self.loop.abrupt:
                    self.stepper.stop(cycle)
        if self.state == STANDING:
            self.loop.idle_sample(position)
        self._at_routine = FAR
        if self.breakpoint.sample():
            self._at_routine = cycle + ds.BREAK_ROUTINE_CLK
        if self.state == CONTROL:
            self._go_on(cycle)
        elif self.state == STANDING and self.side.sync == 0:
            self.hold_timer()

    def _enter_control(self, cycle: int, position: int) -> None:
        self._judge_control(cycle, position)
        self.state = CONTROL
        self.loop.enter_control(position)
        self._aiming = False
        self.rest.disturb()
        self._look_for_stall(cycle)

    def _judge_control(self, cycle: int, position: int) -> None:
        """Say so if an axis is about to jump, or has no filter."""
        registers, loop = self.registers, self.loop
        way = int(registers.command_position) - position
        if abs(way) > ds.JUMP_COUNTS and not loop.command_written:
            text = f"control begins at {position} counts, and R0C to R0E have {position + way}"
            self.report(ds.JUMP, cycle, way, text)
        lacking = "" if registers.step_mode else loop.lacking()
        if lacking:
            self.report(ds.NO_GAIN, cycle, 0, f"control begins with {lacking}")
        if registers.feature & ds.PID and registers.ki and not registers.integral_limit & 0x7FFF:
            self.report(
                ds.NO_INTEGRAL, cycle, 0, "control begins with a Ki above 0 and R66:R65 at 0"
            )

    def _look_for_stall(self, cycle: i64) -> None:
        """The stall check compares steps and counts at a sample's start (MCP-STP-4)."""
        counts = self.encoder.count(cycle) + self.encoder.external
        self.loop.stall.look(self.stepper.sent(cycle), counts)

    def _enter_idle(self, cycle: int) -> None:
        self._at_results = FAR
        self._aiming = False
        self.state = STANDING
        self.pwm.roll(cycle - 1)
        self.stepper.stop(cycle)
        self.loop.enter_idle()
        self.counter.replan(cycle)

    def _results(self, cycle: i64) -> None:
        """BUSY ends: the sample's results appear (MCP-SMP-5)."""
        self._at_results = FAR
        loop = self.loop
        self.pwm.roll(cycle - 1)
        loop.finish()
        self._aiming = True
        if loop.goal_step:
            self._report(
                ds.GOAL_STEP,
                loop.goal_step,
                widest(self.registers.sampled),
                "",
                self._clock.ps(cycle),
            )
        stepping = self.registers.step_mode
        if stepping:
            period = self.timer.period
            self.stepper.batch(cycle, loop.steps, period)
            if self.stepper.overrun(period):
                most = period // self.stepper.width
                self._report(ds.STEP_OVERRUN, abs(int(loop.steps)), most, "", self._clock.ps(cycle))
            self.counter.replan(cycle, cycle - 1)
        if loop.steps:
            self.rest.disturb()
        else:
            self.rest.note()
        if not stepping and cycle < self._at_sample and cycle < self._at_routine:
            self._go_on(cycle)

    def _routine(self, cycle: int) -> None:
        """The breakpoint routine of the sample (MCP-BRK-2, 3)."""
        self._at_routine = FAR
        self.rest.disturb()
        before = self.counter.equal(cycle)
        if self.breakpoint.routine():
            self.registers.status |= ds.BREAKPOINT_OK
        self.counter.look_equal(before, cycle)

    def _skip(self, cycle: i64) -> i64:
        """Pass over samples that would change nothing; return the one to compute."""
        if self.breakpoint.sample():
            return cycle
        last = min(self._target, min(self._next_count(), self.writes.due) - 1)
        period = self.timer.period
        passed = (last - cycle) // period * period
        if passed > 0:
            cycle += passed
            self.start_timer(cycle)
            self.encoder.skip(passed)
        return cycle

    def _go_on(self, cycle: i64) -> None:
        """Nothing else is due at ``cycle``: if the plant's period is over, run the next one."""
        if self.encoder.end == cycle:
            self._next_period(cycle)

    def _next_period(self, cycle: i64) -> None:
        """The plant's period is over: run it to the next instant its drive may change."""
        end: i64 = self._at_reset
        if cycle < self._at_sample < end:
            end = self._at_sample
        if self._at_results < end:
            end = self._at_results
        if end == FAR:
            end = cycle + self.timer.period
        self.drive.period(end, self._aiming)
        self.counter.plan()

    # -- state --------------------------------------------------------------------------------

    def after_load(self) -> None:
        """A sample may differ from the one before."""
        self.rest.disturb()
