"""What happens inside at which clock cycle: writes, resets, samples, counts, plant periods."""

from typing import ClassVar, Final

from mypy_extensions import i64

from vbus.chips.mcp1200 import datasheet as ds
from vbus.chips.mcp1200.control_loop import (
    CONTROL,
    HELD,
    IDLE,
    NO_REQUEST,
    RESETTING,
    STANDING,
    ControlLoop,
    SampleTimer,
)
from vbus.chips.mcp1200.encoder import (
    Breakpoint,
    EncoderCourse,
    PositionCounter,
    index_edge,
    trigger_edge,
)
from vbus.chips.mcp1200.host_port import HostRegisters, WriteQueue, driven
from vbus.chips.mcp1200.output import NOT_RELEASED, PlantDrive, Pwm
from vbus.chips.mcp1200.pins import (
    HOME,
    LIMIT,
    STOP,
    SYNC,
    TRIGGER,
    EncoderChannels,
    HostInterface,
    InputLevels,
)
from vbus.chips.mcp1200.profile import widest
from vbus.chips.mcp1200.registers import FAR, RegisterFile
from vbus.chips.mcp1200.stepper import Stepper
from vbus.core.state import Names, save


class SteadyState:
    """Knows whether the next samples will be like the last one.

    In control mode a sample is a function of registers, control loop, plant and inputs. If two
    samples in a row have left all of that the same, so will every further one, until something
    from outside disturbs it. Nothing is estimated: skipping and stepping give the same state.

    Args:
        loop: what a control sample computes.
        drive: what the plant is driven with.
        encoder: the plant's periods.
    """

    DERIVED: ClassVar[Names] = ("_repeats", "_state")

    def __init__(self, loop: ControlLoop, drive: PlantDrive, encoder: EncoderCourse) -> None:
        self._loop: Final[ControlLoop] = loop
        self._drive: Final[PlantDrive] = drive
        self._encoder: Final[EncoderCourse] = encoder
        self._state: tuple[object, ...] = ()
        self._repeats: bool = False

    def invalidate(self) -> None:
        """Something has happened that the last sample did not know of."""
        self._state = ()
        self._repeats = False

    def note(self) -> None:
        """A control sample with no change of command has shown its results: compare it."""
        # A plant that moves cannot repeat: comparing the registers is left out.
        if not self._drive.at_rest():
            self.invalidate()
            return
        now = (self._loop.registers.image, save(self._loop))
        self._repeats = now == self._state
        self._state = now

    def possible(self, cycle: i64, control: bool) -> bool:
        """Tell whether the sample that starts at ``cycle`` would repeat the one before.

        Args:
            cycle: start of the sample that is due.
            control: the loop is closed; in idle mode only the plant must rest.
        """
        if control and not self._repeats:
            return False
        # A period of the plant that goes on beyond the sample is not like the last one.
        return self._encoder.plant is None or (self._encoder.end == cycle and self._drive.at_rest())

    def lasts(self, control: bool, sampling: bool) -> bool:
        """Tell whether all further samples repeat the last one, and none need be computed.

        Args:
            control: the loop is closed.
            sampling: the sample timer runs and goes on. The plant's periods are only passed over
                from sample to sample.
        """
        if control:
            return self._repeats and self._drive.at_rest()
        return self._encoder.plant is None or (sampling and self._drive.at_rest())


class ClockedAxis:
    """The blocks of the manual's block diagram, and what happens in them at which clock cycle.

    At one cycle the order is: position counter (encoder, breakpoint, index), written bytes
    becoming visible, end of a reset, results of a sample, start of a sample, breakpoint routine,
    next period of the plant.

    The plant runs in periods that end where its drive can change: at each sample start and at
    each end of BUSY. In idle mode a motor command the host writes reaches the pins at once and
    the plant with its next period (NOTES 5).

    Args:
        chip: whose axis.

    Attributes:
        writes: what the host has written, before it is visible.
        inputs: the levels of the inputs beside the host bus; saved by the chip.
        channels: CHA, CHB and INDEX; saved by the chip.
    """

    STATE: ClassVar[Names] = (
        "state = loop.state", "released = pwm.released", "_request = loop.request", "writes: part",
        "_aiming: bool", "_at_reset", "_at_sample", "_at_results", "_at_routine", "counter: part",
        "registers: part", "loop: part", "timer: part", "encoder: part", "drive: part",
        "stepper: part", "pwm: part", "breakpoint: part", "host: part",
    )  # fmt: skip
    WIRING: ClassVar[Names] = ("rest",)
    DERIVED: ClassVar[Names] = ("_target",)

    def __init__(self, chip: HostInterface) -> None:
        settings = chip.settings
        self._chip: Final[HostInterface] = chip
        self._stall_clk: int = int(settings["io_stall_clk"])
        self._target: i64 = 0
        registers = RegisterFile()
        self.registers: Final[RegisterFile] = registers
        self.loop: Final[ControlLoop] = ControlLoop(registers, settings["unipolar"] == "clip")
        self.timer: Final[SampleTimer] = SampleTimer(registers)
        self.encoder: Final[EncoderCourse] = EncoderCourse(chip.clock.hz)
        self.stepper: Final[Stepper] = Stepper(registers)
        self.breakpoint: Final[Breakpoint] = Breakpoint(registers)
        self.counter: Final[PositionCounter] = PositionCounter(
            registers,
            self.encoder,
            self.stepper,
            self.breakpoint,
            self.loop.faults,
            settings["index"] == "high",
        )
        self.inputs: Final[InputLevels] = InputLevels(chip, self.encoder)
        self.pwm: Final[Pwm] = Pwm(registers)
        self.drive: Final[PlantDrive] = PlantDrive(
            registers, self.encoder, self.stepper, self.loop.following, settings
        )
        self.rest: Final[SteadyState] = SteadyState(self.loop, self.drive, self.encoder)
        self.writes: Final[WriteQueue] = WriteQueue()
        self._aiming: bool = False
        """The loop has closed: followers may follow its aim."""
        self._at_reset: i64 = FAR
        self._at_sample: i64 = FAR
        self._at_results: i64 = FAR
        self._at_routine: i64 = FAR
        self.channels: Final[EncoderChannels] = EncoderChannels(
            chip, registers, self.encoder, self.counter
        )
        self.host: Final[HostRegisters] = HostRegisters(
            registers, self.timer, self.counter, self.channels, self.loop, self.inputs, chip.find,
            self.request,
        )  # fmt: skip

    # -- order --------------------------------------------------------------------------------

    def next(self) -> i64:
        """Cycle of the next thing due inside, written bytes included."""
        return self._next(self._next_count())

    def _next(self, count: i64) -> i64:
        """Cycle of the next thing due; ``count``: of the position counter."""
        # Two at a time: a compiled core makes comparisons of these.
        first = min(min(count, self.encoder.end), min(self._at_results, self._at_sample))
        return min(min(first, self.writes.due), min(self._at_routine, self._at_reset))

    def _next_count(self) -> i64:
        """When the position counter has something to do."""
        return min(self.encoder.at, min(self.channels.due, self.counter.at_match))

    def next_output(self) -> i64:
        """A cycle not later than the next change of an output other than Pulse and Sign."""
        due = min(min(self._next_count(), self._at_reset), min(self._at_results, self._at_routine))
        due = min(due, self.writes.due)
        loop = self.loop
        awake = loop.state == CONTROL or loop.request != NO_REQUEST or self.breakpoint.armed
        # In idle mode a sample alone shows nothing but In-position, which no pin has.
        if awake:
            due = min(due, self._at_sample)
        if self.encoder.plant is not None and (awake or not self.drive.at_rest()):
            due = min(due, self.encoder.end)
        return due

    def next_order(self) -> i64:
        """Cycle of what comes next of the bus or a reset, whatever the samples do."""
        return min(self.writes.due, self._at_reset)

    def next_sample(self) -> int:
        """Cycle at which a sample starts or its results show, whichever comes first."""
        return min(self._at_sample, self._at_results)

    def resting(self) -> bool:
        """Whether samples repeat themselves and nothing else is due."""
        due = min(min(self._next_count(), self.writes.due), min(self._at_reset, self._at_routine))
        if due != FAR or self.loop.request != NO_REQUEST or self.breakpoint.waiting:
            return False
        sampling = self.timer.running and self.inputs.sync == 1
        return self.rest.lasts(self.loop.state == CONTROL, sampling)

    def shortest_period(self) -> int:
        """Return the period of this sample, or of the next if that may be shorter (clocks)."""
        # What R0F, R10 and R11 will be is not known yet: the shortest period is one clock.
        if self.writes.waits_for(ds.SAMPLE_PERIOD):
            return 1
        period, coming = self.timer.period, self.timer.coming
        return period if period < coming else coming

    def run(self, target: i64) -> None:
        """Work off everything due by then."""
        self._target = target
        while True:
            count = self._next_count()
            cycle = self._next(count)
            if cycle > target:
                return
            if count == cycle:
                self._count(cycle)
                continue
            if self.writes.due == cycle:
                self._take_write(cycle)
                continue
            if self._at_reset == cycle:
                self._end_reset(cycle)
            elif self._at_results == cycle:
                self._results(cycle)
            elif self._at_sample == cycle:
                self._sample(cycle)
            elif self._at_routine == cycle:
                self._routine(cycle)
            # The plant's next period comes when nothing else is due at this cycle any more.
            left = min(min(self._at_sample, self._at_routine), self.counter.at_match)
            if self.encoder.end == cycle < left:
                self._next_period(cycle)

    def _count(self, cycle: i64) -> None:
        """The position counter comes to something worth a look."""
        self.rest.invalidate()
        if self.encoder.at == cycle:
            self.counter.edge(cycle)
            self.look(cycle, cycle)
        elif self.channels.due <= cycle:
            self.channels.settle(cycle)
        else:
            self.counter.match()
            self.counter.replan(cycle)

    # -- what the bus does --------------------------------------------------------------------

    def write(self, cycle: int, address: int, data: int) -> None:
        """A byte has been written in ``cycle``; it is visible some clocks later (MCP-BUS-5)."""
        # MCP-RST-5: during a reset it is stored; while /RESET is low nothing is.
        if self.loop.state != HELD:
            self.writes.add(cycle, address, data)

    def stall(self) -> bool:
        """An access costs the core a clock or more, if the board says so (MCP-BUS-11).

        Returns:
            Whether what is due inside has moved.
        """
        # MCP-BUS-11, MCP-AMB-16: by default an access costs the core nothing.
        if self._stall_clk and self._at_results != FAR:
            self._at_results += self._stall_clk
            return True
        return False

    def _take_write(self, cycle: i64) -> None:
        address, data = self.writes.take()
        self.rest.invalidate()
        before = self.counter.equal(cycle)
        self.pwm.roll(cycle - 1)
        self.host.write(address, data, cycle)
        self.counter.look_equal(before, cycle)

    # -- inputs beside the host bus ------------------------------------------------------------

    def look(self, cycle: i64, coming: i64) -> None:
        """Act on what has moved by ``cycle``: a net, or a switch of the axis.

        Args:
            cycle: the clock cycle.
            coming: the first cycle that starts now or later.
        """
        inputs, registers = self.inputs, self.registers
        moved = inputs.look()
        if moved & LIMIT:
            self._fault(inputs.limit, ds.LIMIT_OK, cycle)
        if moved & STOP:
            self._fault(inputs.stop, ds.STOP_OK, cycle)
        # MCP-SMP-2: in other modes /SYNC does nothing.
        if moved & SYNC and self.loop.state == STANDING:
            # In idle mode /SYNC holds the sample timer (MCP-SMP-2).
            if inputs.sync == 0:
                self.hold_timer()
            else:
                self.start_timer(coming)
        # MCP-CAP-2: the falling edge alone.
        if moved & TRIGGER and inputs.trigger == 0:
            trigger_edge(registers, self.counter.position(cycle))
        if moved & HOME:
            index_edge(registers, inputs.home == 1, self.counter.position(cycle))

    def _fault(self, level: i64, flag: i64, cycle: i64) -> None:
        """/LIMIT or /STOP has moved: low sets its flag at once (MCP-EXC-7)."""
        self.rest.invalidate()
        # MCP-EXC-7: the flag at once, the action with the next control sample.
        if level == 0 and self.loop.state >= STANDING:
            self.registers.fault(flag)  # MCP-EXC-4
            if flag == ds.LIMIT_OK:
                self.loop.faults.limit = True
                self.pwm.roll(cycle - 1)
                # MCP-MOD-4: in idle mode the outputs go off at once.
                self.host.guard()
            else:
                self.loop.faults.stop = True

    # -- modes and the sample timer -----------------------------------------------------------

    def request(self, mode: int, cycle: int) -> None:
        """R05 has been written (MCP-MOD-1)."""
        loop = self.loop
        waiting = loop.request
        if waiting != NO_REQUEST and (
            waiting < ds.HALT_CODE <= mode or (loop.state == STANDING and mode == ds.HALT_CODE)
        ):
            text = f"R05 = {mode:02X} comes before the sample that obeys R05 = {waiting:02X}"
            self._chip.find(ds.MODE_LOST, cycle, mode, text)
        # MCP-MOD-1, MCP-MOD-6: control mode obeys at the next sample's start.
        loop.request = mode
        if loop.state == STANDING and mode != ds.CONTROL_CODE:
            loop.request = NO_REQUEST
            if mode == ds.SOFT_RESET_CODE:
                # MCP-RST-5: from idle mode at once; in control it waits for the end of the sample.
                self._begin_reset(cycle)
            elif mode == ds.IDLE_CODE:
                loop.enter_idle()
        # MCP-RST-5: R05 is loaded at the end of the reset: what is written before is lost.
        elif loop.state < STANDING:
            loop.request = NO_REQUEST

    def _begin_reset(self, cycle: int) -> None:
        self.loop.state = RESETTING
        self._stop()
        # MCP-RST-2: PROF, IDLE and BUSY are low while it lasts.
        self.registers.flag = 0
        self.registers.mode = 0
        self.registers.status &= ~ds.BUSY
        self.stepper.stop(cycle)
        # MCP-RST-5: 320 clocks, 16 us at 20 MHz.
        self._at_reset = cycle + ds.RESET_CLK

    def _stop(self) -> None:
        self.loop.request = NO_REQUEST
        self.hold_timer()
        self._at_results = FAR
        self._aiming = False

    def hold_timer(self) -> None:
        """The sample timer stands."""
        self.timer.running = False
        self._at_sample = FAR
        self._at_routine = FAR

    def start_timer(self, cycle: i64) -> None:
        """The sample timer begins a period."""
        self._at_sample = self.timer.reload(cycle)

    # -- reset --------------------------------------------------------------------------------

    def hold(self, cycle: int) -> None:
        """Hard reset: everything as after power-on, until it is released (MCP-RST-1, 3)."""
        self.loop.state = HELD
        # MCP-RST-3: every register takes the default of its row.
        self.registers.reset()
        self.stepper.clear(cycle)
        self.loop.hard_reset()
        self.channels.configure(cycle)
        self.counter.preset(0, cycle)
        self.breakpoint.clear()
        self.host.clear()
        self.writes.clear()
        self._stop()
        self._at_reset = FAR
        self.pwm.released = NOT_RELEASED
        self.counter.replan(cycle)

    def release(self, cycle: int) -> None:
        """/RESET has risen: Pulse is high for one clock, a soft reset follows (MCP-RST-1)."""
        if self.loop.state == HELD:
            # MCP-RST-1: Pulse is high for this one clock.
            self.pwm.released = cycle
            self.pwm.restart(cycle)
            self._begin_reset(cycle)

    def finish_reset(self, cycle: int) -> None:
        """The reset is over at once: a board that starts after it."""
        self.pwm.released = NOT_RELEASED
        self._end_reset(cycle)

    def _end_reset(self, cycle: int) -> None:
        self._at_reset = FAR
        self.pwm.roll(cycle - 1)
        self.loop.soft_reset()
        self.counter.preset(0, cycle)
        self.loop.state = STANDING
        self.host.clear_errors()
        self.host.undo()
        # MCP-SMP-2: with /SYNC low the timer waits.
        if self.inputs.sync:
            self.start_timer(cycle)
        self.counter.replan(cycle)

    # -- samples ------------------------------------------------------------------------------

    def _sample(self, cycle: i64) -> None:
        """The sample timer is at zero: a sample starts."""
        loop = self.loop
        # MCP-SMP-4, MCP-SMP-3: the work of the sample before is not done.
        if self._at_results != FAR:
            # The one before is not finished (MCP-SMP-4).
            self.registers.fault(ds.TIMER_OK)
            self._enter_idle(cycle)
        self.start_timer(cycle)
        # Samples that repeat the last one are passed over; one that must be computed is left.
        if loop.request == NO_REQUEST and self.rest.possible(cycle, loop.state == CONTROL):
            cycle = self._skip(cycle)
        position = self.counter.position(cycle)
        request, loop.request = loop.request, NO_REQUEST
        if loop.state == CONTROL:
            # MCP-RST-5: at the end of the sample.
            if request == ds.SOFT_RESET_CODE:
                self._begin_reset(cycle)
                return
            if request == ds.IDLE_CODE:
                # MCP-MOD-2: R05 = 01 takes effect with the sample's start.
                self._enter_idle(cycle)
            # MCP-MOD-6, MCP-AMB-29: out of idle mode, and out of a halt.
            elif request == ds.CONTROL_CODE:
                loop.halted = False
        elif request == ds.CONTROL_CODE:
            self._enter_control(cycle, position)
        if loop.state == CONTROL:
            halt = request == ds.HALT_CODE
            work = loop.begin(position, self.inputs.limit == 0, self.inputs.stop == 0, halt)
            if work == IDLE:
                self._enter_idle(cycle)
            else:
                # MCP-SMP-3, MCP-SMP-5: results appear together when BUSY falls.
                self._at_results = cycle + work
                self._look_for_stall(cycle)
                # MCP-EXC-2: the position is the axis's own: steps not yet sent are taken back.
                if loop.abrupt:
                    self.stepper.stop(cycle)
        if loop.state == STANDING:
            loop.idle_sample(position)
        self._at_routine = FAR
        if self.breakpoint.sample():
            # MCP-BRK-3: 67 clocks after the start.
            self._at_routine = cycle + ds.BREAK_ROUTINE_CLK
        if loop.state == STANDING and self.inputs.sync == 0:
            self.hold_timer()

    def _enter_control(self, cycle: int, position: int) -> None:
        self._judge_control(cycle, position)
        self.loop.state = CONTROL
        # MCP-MOD-6: at the command position as it is: no copy of the actual one.
        self.loop.enter_control(position)
        self._aiming = False
        self.rest.invalidate()
        self._look_for_stall(cycle)

    def _judge_control(self, cycle: int, position: int) -> None:
        """Say so if an axis is about to jump, or has no filter."""
        registers, loop = self.registers, self.loop
        way = int(registers.command_position) - position
        if abs(way) > ds.JUMP_COUNTS and not loop.command_written:
            text = f"control begins at {position} counts, and R0C to R0E have {position + way}"
            self._chip.find(ds.JUMP, cycle, way, text)
        if driven(registers):
            self._chip.find(ds.OUTPUT_LEFT, cycle, 0, f"control begins while {driven(registers)}")
        lacking = "" if registers.step_mode else loop.lacking()
        if lacking:
            self._chip.find(ds.NO_GAIN, cycle, 0, f"control begins with {lacking}")
        gains = (int(registers.kp), int(registers.ki), int(registers.kd))
        if not registers.feature & ds.PID and gains != ds.RESET_GAINS:
            text = "control begins with the lead filter, and gains of the PID filter are loaded"
            self._chip.find(ds.PID_UNUSED, cycle, 0, text)
        lost = self.host.serve()
        if lost:
            text = f"control begins with {lost} as a soft reset has left them: they were written"
            self._chip.find(ds.LOST_IN_RESET, cycle, 0, f"{text} before it, and not since")

    def _look_for_stall(self, cycle: i64) -> None:
        """The stall check compares steps and counts at a sample's start (MCP-STP-4)."""
        counts = self.encoder.count(cycle) + self.encoder.external
        self.loop.stall.look(self.stepper.sent(cycle), counts)

    def _enter_idle(self, cycle: int) -> None:
        self._at_results = FAR
        self._aiming = False
        self.loop.state = STANDING
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
        # MCP-VEL-2: reported; the ramp copes with it.
        if loop.goal_step:
            most = int(widest(self.registers.sampled))
            self._chip.find(ds.GOAL_STEP, cycle, loop.goal_step, "", most)
        if self.registers.step_mode:
            period = self.timer.period
            self.stepper.batch(cycle, loop.steps, period)
            # MCP-STP-3: counted all the same.
            if self.stepper.overrun(period):
                most = period // self.stepper.width
                self._chip.find(ds.STEP_OVERRUN, cycle, abs(int(loop.steps)), "", most)
            self.counter.replan(cycle, cycle - 1)
        if loop.steps:
            self.rest.invalidate()
        else:
            self.rest.note()

    def _routine(self, cycle: int) -> None:
        """The breakpoint routine of the sample (MCP-BRK-2, 3)."""
        self._at_routine = FAR
        self.rest.invalidate()
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
        # Fast way: whole periods up to the next count or write, without computing one.
        passed = (last - cycle) // period * period
        if passed > 0:
            cycle += passed
            self.start_timer(cycle)
            self.encoder.skip(passed)
        return cycle

    def _next_period(self, cycle: i64) -> None:
        """The plant's period is over: run it to the next instant its drive may change."""
        end: i64 = self._at_reset
        if cycle < self._at_sample < end:
            end = self._at_sample
        if self._at_results < end:
            end = self._at_results
        # In idle mode without a timer any length will do: the drive does not change.
        if end == FAR:
            end = cycle + self.timer.period
        self.drive.period(end, self._aiming)
        self.counter.plan()

    # -- state --------------------------------------------------------------------------------

    def after_load(self) -> None:
        """A sample may differ from the one before."""
        self.rest.invalidate()
