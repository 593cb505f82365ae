"""The LM628 and LM629: their parts put together, and time."""

from collections.abc import Callable, Mapping
from typing import ClassVar, Final

from mypy_extensions import i64

from vbus.chips.base import EDGE, SAMPLE, AcLimits, Chip, check_drive
from vbus.chips.bus_watch import BusTable
from vbus.chips.lm628 import datasheet as ds
from vbus.chips.lm628.axis import ServoAxis
from vbus.chips.lm628.commands import UNKNOWN, AxisCommands
from vbus.chips.lm628.encoder import EncoderCounts
from vbus.chips.lm628.host_port import PortState
from vbus.chips.lm628.output import ServoOutput, ServoOutputPins
from vbus.chips.lm628.pins import BusPins, EncoderPins, FrontEndHost
from vbus.chips.tables import PinRow, names_of
from vbus.core.kernel import HELD, MS, NEVER, Clock, Kernel
from vbus.core.kernel.clock import PS_PER_SECOND
from vbus.core.options import Option, Settings
from vbus.core.signals import HIGH, LOW, Pin, Plant, Policy, Rule, ValueTable, Violation, Watcher
from vbus.core.state import Names

_RUNNING: Final = 0
_RESET_BY_PIN: Final = 1
_RESET_BY_COMMAND: Final = 2
_UNPOWERED: Final = 3

_INSIDE: Final = (
    "axis: part", "host: part", "commands: part", "output: part", "encoder: part", "_mode",
    "_reset_end", "_fails_left", "_when", "_cycle", "_sample_at",
    "_course: tuple[i64 | bool, ...]", "_still: bool", "_outputs: part",
)  # fmt: skip
"""Everything behind the front-end: what a cycle that is lost has changed."""


def judge_clock(chip: Chip, duty: float) -> None:
    """File a violation for a clock outside the limits of the part's grade.

    Args:
        chip: whose clock it is.
        duty: part of the period during which CLK is high.
    """
    hz = chip.clock.hz
    period = PS_PER_SECOND // hz
    pulse = int(PS_PER_SECOND * min(duty, 1 - duty)) // hz
    shortest_pulse, shortest = ds.CLOCK_LIMITS[chip.part[-1]]
    longest = ds.AC["T5"].max_ps
    t4, t5 = ds.AC.rules["T4"], ds.AC.rules["T5"]
    # LM-TIM-4: CLK is high, and low, for 78 ns (-6) or 57 ns (-8) at least.
    if pulse < shortest_pulse:
        chip.report(t4, pulse, shortest_pulse, f"CLK high or low for {pulse} ps only")
    # LM-TIM-5: the grades end at 6 and 8 MHz, and both begin at 1 MHz.
    if period < shortest:
        chip.report(t5, period, shortest, f"{hz} Hz is above the grade of a {chip.part}")
    elif longest * hz < PS_PER_SECOND:
        chip.report(t5, period, longest, f"{hz} Hz is below 1 MHz")


class LM628(FrontEndHost):
    """Motion controller with a trapezoidal profile, a PID filter and one quadrature encoder.

    One class for the LM628 (converter output) and the LM629 (sign and magnitude PWM), in both
    speed grades. Address 0 is the command and status port, 1 the data port.

    The chip waits unpowered until :meth:`power_on`. From then on it samples every 2048 clock
    periods, also through later resets (NOTES 2). Mechanics are driven with the output of a sample
    until the next one. A clock outside the grade's limits is a violation (T4, T5), filed then.

    Not modelled: analog levels and delays; metastability of the host port; A, B and /IN nets while
    a plant is connected (the plant has the encoder).

    Raises:
        ValueError: unknown part number, a setting out of range, or a clock that no such part
            could be meant to have.
    """

    FAMILY: ClassVar[str] = ds.FAMILY
    ADDRESS_BITS: ClassVar[int] = ds.ADDRESS_BITS
    PARTS: ClassVar[tuple[str, ...]] = ds.PARTS
    PINS: ClassVar[tuple[PinRow, ...]] = ds.PINS
    PINS_OF: ClassVar[Mapping[str, tuple[PinRow, ...]]] = ds.PINS_OF
    BUS: ClassVar[BusTable | None] = ds.BUS
    RULES: ClassVar[tuple[Rule, ...]] = ds.RULES
    VALUES: ClassVar[ValueTable] = ds.VALUES
    FREE_READS: ClassVar[tuple[int, ...]] = (ds.COMMAND_PORT,)
    TRACELESS: ClassVar[bool] = True
    PERIOD_CLK: ClassVar[int] = ds.SAMPLE_CLK
    OPTIONS: ClassVar[tuple[Option, ...]] = ds.OPTIONS
    CHECKPOINT: ClassVar[Names] = _INSIDE
    STATE: ClassVar[Names] = (
        *_INSIDE, "_front: part", "_encoder_pins: part", "_reset_fell",
        "timing_checked: bool",
    )  # fmt: skip
    DERIVED: ClassVar[Names] = ("_due_at",)

    def __init__(
        self, name: str, part: str, kernel: Kernel, clock: Clock, settings: Settings | None = None,
        policy: Policy | None = None, file: Callable[[Violation], None] | None = None,
    ) -> None:  # fmt: skip
        if part not in ds.PARTS:
            raise ValueError(f"part {part!r}: allowed are {', '.join(ds.PARTS)}")
        slowest, fastest = ds.CLOCK_ABSURD
        if not slowest <= clock.hz <= fastest:
            raise ValueError(f"a clock of {clock.hz} Hz: a {part} runs at 1 MHz to {part[-1]} MHz")
        pwm = part.startswith("LM629")
        # Machine words first: see CONTRIBUTING, "The compiled core".
        self._reset_end: i64 = NEVER
        self._fails_left: i64 = 0
        self._when: i64 = 0  # instant of what is being processed (ps)
        self._cycle: i64 = 0  # clock cycle of the last sample
        self._sample_at: i64 = NEVER  # instant of the next one
        self._due_at: i64 = NEVER  # nothing is due before: advance() compares and is done
        self._reset_fell: i64 = 0
        super().__init__(name, part, kernel, clock, settings, policy, file)
        self.ac = AcLimits(self, ds.AC)
        self.axis: ServoAxis = ServoAxis(self.settings)
        self.output: ServoOutput = ServoOutput(pwm, int(self.settings["pwm_frame_clk"]))
        self.encoder: EncoderCounts = EncoderCounts(clock)
        broke = self._host_broke  # one object for both
        self.host: PortState = PortState(clock, self.settings, broke)
        self.commands: AxisCommands = AxisCommands(self.host, self.axis, pwm, self._reset, broke)
        self._mode: int = _UNPOWERED
        self._fails_left = int(self.settings["reset_fail"])
        self._course: tuple[int, ...] = ()  # the last sample's, if untouched; see _run_samples
        self._still: bool = False
        drivers = ("MAG", "SIGN") if pwm else tuple(f"DAC{n}" for n in range(8))
        driven = tuple(self.pins[name] for name in drivers)
        self._outputs: ServoOutputPins = ServoOutputPins(self.output, clock, driven)
        self._front: BusPins = BusPins(self, self.host)
        self._encoder_pins: EncoderPins = EncoderPins(self, self.encoder)
        self.pins["/RST"].net.watch(Watcher(kernel, self._reset_moved))
        self._hi: Pin = self.pins["HI"]
        self._hi.drive(LOW)
        self._outputs.show(kernel.now)

    # -- power and reset ----------------------------------------------------------------------

    def connect(self, axis: int, plant: Plant) -> None:
        """Attach the mechanics; the chip has one axis, number 0."""
        check_drive(self, axis, plant, "drive")
        self.encoder.connect(plant, ds.SAMPLE_CLK / self.clock.hz)

    def exchange_plant(self, axis: int, plant: Plant) -> None:
        """Put other mechanics behind the encoder."""
        self.encoder.plant = plant

    def fail_resets(self, times: int) -> bool:
        """Let so many resets fail; tell whether one that runs is the first of them."""
        runs = self._reset_end != NEVER
        if runs:
            # LM-RST-9: the status byte stays 00h, whatever began the reset.
            self._mode, self._reset_end = _RESET_BY_PIN, NEVER
            self.input_changed()
        self._fails_left += times - runs
        return runs

    def clock_changed(self, shift: Callable[[int, int], int] | None) -> None:
        """Move what the chip waits for; find when the next sample and the index come."""
        host, encoder, now = self.host, self.encoder, self.kernel.now
        if shift is not None:
            host.busy_end = shift(host.busy_end, now)
            self._reset_end = shift(self._reset_end, now)
            encoder.index_at = shift(encoder.index_at, now)
        # The instant of the next edge of the outputs was that of the clock before.
        self._outputs.due = 0
        if self.powered:
            self._place_sample()
        if not self.clock.stopped:
            if encoder.index_at != NEVER:
                encoder.index_at = min(encoder.index_at, self._sample_at)
            self._encoder_pins.look()

    def power_on(self, done: bool) -> None:
        """Supply is up: once /RST is let go the reset runs, or has just ended if ``done``."""
        now = self._when = self.kernel.now
        judge_clock(self, float(self.settings["clk_duty"]))
        self._encoder_pins.preset()
        # The phase of the samples is that of power-on: no reset moves it (NOTES 2).
        self._cycle = self._cycle_from(now)
        self._outputs.begin(self._cycle)
        self.axis.reset()
        self.output.zero()
        self.encoder.run(self.output.command, self.axis.following)
        self._place_sample()
        self._reset_end = NEVER
        if self.pins["/RST"].value == LOW:
            # LM-RST-1: with /RST low nothing begins before it rises.
            self._mode = _RESET_BY_PIN
        elif done:
            self._mode = _RUNNING
            self.output.put(0, True)
            self.axis.finish_reset(self.encoder.count_at(now))
        else:
            self._reset(_RESET_BY_PIN)
        self.input_changed()

    def _cycle_from(self, when: int) -> int:
        """Return the first clock cycle that starts at ``when`` or later."""
        return self.clock.cycle_at(when - 1) + 1 if when else 0

    def _reset(self, mode: int = _RESET_BY_COMMAND) -> None:
        """A reset begins (LM-RST-2)."""
        self._mode = mode
        # LM-RST-9, LM-RST-4: a reset that fails never ends.
        if self._fails_left:
            self._fails_left -= 1
            self._mode, self._reset_end = _RESET_BY_PIN, NEVER
        else:
            # Without a clock a reset does not end: its time counts from when the clock comes back.
            since = HELD if self.clock.stopped else self._when
            self._reset_end = since + int(self.settings["reset_time"])
        self.host.reset()
        self.axis.reset()
        # A reset disarms SIP: no index of the sample under way is waited for.
        self.encoder.index_at = NEVER
        self.output.zero()
        self._outputs.begin(self._cycle_from(self._when))  # LM-RST-3

    def _reset_moved(self) -> None:
        """/RST has moved; it acts when it rises (LM-RST-1)."""
        now = self.kernel.now
        self.advance()
        if self.pins["/RST"].value == LOW:
            self._reset_fell = now
            return
        # Without supply an edge resets nothing: power_on() looks at the level.
        if self._mode == _UNPOWERED:
            return
        # LM-TIM-6: the pulse is low for 8 clock periods; under the strict policy a shorter one
        # resets nothing.
        low = now - self._reset_fell
        if self.timing_checked and self.ac.short("T6", low):
            return
        self._when = now
        self._reset(_RESET_BY_PIN)
        self.input_changed()

    # -- bus cycles ---------------------------------------------------------------------------

    def begin_read(self, address: int) -> None:
        """/RD falls: data is latched (LM-BUS-3)."""
        self.advance()
        self.host.begin_read(address, self._mode != _RUNNING, self.kernel.now)

    def end_read(self) -> int:
        """/RD rises: status is as it is now, the data pointer moves."""
        self.advance()
        host = self.host
        if host.reading_status():
            self.axis.unseen = False
            return self.status()
        # LM-BUS-12: the flag rises with the strobe, not when busy falls: no busy follows.
        if host.unasked():
            self.axis.flags |= ds.COMMAND_ERROR
        data = host.end_data(self.kernel.now)
        self.input_changed()
        return data

    def read_byte(self) -> int:
        """Return what D0-D7 show in the read under way."""
        return self.status() if self.host.reading_status() else self.host.data_byte()

    def write(self, address: int, data: int) -> None:
        """A byte is latched."""
        self.advance()
        now = self._when = self.kernel.now
        # LM-RST-4: every write is ignored, and reported, until the reset is over.
        if self._mode != _RUNNING:
            self.report(ds.RESET_WRITE)
            return
        if address:
            # LM-BUS-12: data that no command wants is a command error at once.
            if not self.host.write_data(data, now):
                self.axis.flags |= ds.COMMAND_ERROR
        else:
            self.host.write_command(data, now)
        self.input_changed()

    def status(self) -> int:
        """Return the status byte (LM-STA-1, LM-RST-4)."""
        if self._mode == _RUNNING:
            return self.axis.status() | self.host.busy
        # LM-AMB-4: busy for longer than 100 us in a reset by command alone, where hosts poll it.
        return ds.BUSY if self._mode == _RESET_BY_COMMAND else 0

    def ready_at(self) -> int:
        """Return when busy falls or the reset ends; now, if the chip is ready."""
        if self._mode != _RUNNING:
            return self._reset_end
        return self.host.busy_end if self.host.busy else self.kernel.now

    def foresee(self, address: int, when: int) -> tuple[int, int] | None:
        """Return the status byte once busy falls at ``when``, up to the next sample (LM-BUS-9)."""
        flags = self.commands.foresee_flags() if self._mode == _RUNNING else UNKNOWN
        if flags == UNKNOWN or self.host.busy_end != when:
            return None
        # A sample or an index may raise a flag; strict T10 hides the byte; an output edge wakes the
        # chip.
        until = min(self._sample_at, self.encoder.due())
        until = min(until, self._front.show_at)
        until = min(until, self._outputs.edge())
        return flags | (ds.MOTOR_OFF if self.axis.motor_off else 0), until

    def _host_broke(self, rule: Rule, detail: str, when: int | None = None) -> None:
        self.report(rule, detail=detail, when=self._when if when is None else when)

    @property
    def powered(self) -> bool:
        """Whether supply is up."""
        return self._mode != _UNPOWERED

    def index_seen(self, count: int) -> None:
        """The index has come at encoder ``count``; if armed, store its position (LM-POS-3)."""
        if self.axis.sip:
            self.axis.capture(self.axis.real + count - self.axis.count)

    # -- time ---------------------------------------------------------------------------------

    def advance(self) -> None:
        """Bring the state up to now: busy ends, index pulses, samples, output edges."""
        if self.kernel.now >= self._due_at:
            self._catch_up()

    def _catch_up(self) -> None:
        now = self.kernel.now
        while True:
            when = self._next_inside()
            # At one instant the sample comes last: what ends at it is seen by it.
            if self._sample_at <= now and self._sample_at < when:
                self._run_samples(now if now < when else when - 1)
                continue
            if when > now:
                break
            self._when = when
            self._course, self._still = (), False
            if self.host.busy_end == when:
                self.host.finish()
                # LM-POS-3: an index counts from the end of SIP's busy time on, within the sample
                # under way too.
                if self.axis.sip and self.encoder.index_at == NEVER:
                    self.encoder.seek(when)
            elif self._reset_end == when:
                self._mode, self._reset_end = _RUNNING, NEVER
                self.axis.finish_reset(self.encoder.count_at(when))
            elif self.encoder.index_at == when:
                self.encoder.index_at = NEVER
                self.index_seen(self.encoder.index_count)
            else:
                self._encoder_pins.settle(when)
        self._front.settle()
        self._refresh()

    def _next_inside(self) -> i64:
        """Return the instant of the next thing that is not a sample."""
        when = self.host.busy_end
        if self._reset_end < when:
            when = self._reset_end
        due = self.encoder.due()
        return due if due < when else when

    def _run_samples(self, stop: i64) -> None:
        """Run all samples up to instant ``stop``, or until one finds an index to capture.

        A sample that leaves everything as the sample before it did, with a derivative and a plant
        at rest, will be followed by samples that do the same: they are skipped.
        """
        axis, encoder, output, cycle = self.axis, self.encoder, self.output, self._cycle
        left = (self.clock.cycle_at(stop) - cycle) // ds.SAMPLE_CLK
        running, still, rested = self._mode == _RUNNING, self._still, self._course != ()
        count = encoder.count()  # each block hands on what it has found out
        while left > 0:
            # An axis at rest is one addition for all its samples: a second of rest has 3,906 of
            # them.
            if still:
                self._cycle = cycle + left * ds.SAMPLE_CLK
                if running:
                    axis.skip(left)
                break
            left -= 1
            cycle += ds.SAMPLE_CLK
            self._cycle = cycle
            level = output.put(axis.sample(count), axis.port8) if running else output.command
            count = encoder.run(level, axis.following)
            # Whether the sample has an index is known now that the plant has run through all of it.
            if axis.sip:
                self._place_sample()
                encoder.seek(self.clock.ps(self._cycle) - 1)
                if encoder.index_at != NEVER:
                    break
            # Only an axis that stands can repeat its sample: none that moves is compared.
            if axis.profile.velocity == 0 and encoder.resting():
                course = axis.course()
                still = course == self._course and axis.steady()
                self._course, rested = course, True
            elif rested:
                self._course, rested = (), False
        self._still = still
        if running:
            self._outputs.begin(self._cycle)
        self._place_sample()

    def _place_sample(self) -> None:
        """Say from when to when the present sample lasts."""
        # From the number of the cycle: no rounding adds up.
        self._sample_at = self.clock.ps(self._cycle + ds.SAMPLE_CLK)
        self.encoder.lasts(self.clock.ps(self._cycle), self._sample_at)

    def input_changed(self) -> None:
        """Something from outside has changed the chip: pins and timers follow."""
        self._course, self._still = (), False
        self._refresh()
        super().input_changed()

    def schedule(self, when: int) -> None:
        """The front-end has something to do at instant ``when``."""
        self._due_at = min(self._due_at, when)

    def _refresh(self) -> None:
        """Bring the output pins up to now, and find when anything is due next."""
        hi = HIGH if self.axis.interrupt() else LOW
        if hi != self._hi.level:
            self.axis.unseen = hi == HIGH
            self._hi.drive(hi)
        self._outputs.show(self.kernel.now)
        if self._front.driving:
            self._front.show()
        due = min(min(self._next_inside(), self._sample_at), self._outputs.due)
        self._due_at = min(due, self._front.show_at)

    def due(self, kind: int) -> i64:
        """Return an instant after now: samples change what can be read, unless they repeat."""
        inside = self._next_inside()
        if kind == SAMPLE:
            return NEVER if self._still and inside == NEVER else self._sample_at
        due = min(inside, self._front.show_at)
        heard = self._outputs.heard()
        if heard:
            due = min(due, self._outputs.due)
        # A sample is seen at once on outputs that are observed, in a read under way, and on HI.
        shows = heard or self._front.driving or self.axis.may_interrupt()
        if (shows and not self._still) or (heard and self.output.emits()):
            due = min(due, self._sample_at)
        return due if kind == EDGE or self._still else min(due, self._sample_at)

    def undriven(self, axis: int) -> str:
        """Return that no filter was in use at the last :meth:`advance`."""
        return self.axis.pid.lacking()

    def hint(self, rule: str, when: int) -> str:
        """Return that a write came into the reset at power-on, in which busy reads 0."""
        if rule != ds.RESET_WRITE.name or when > int(self.settings["reset_time"]):
            return ""
        return (
            f"hint: {self.name} is in the reset that follows power-on, and its busy bit is 0"
            " meanwhile (LM-RST-4): wait until the status byte is 84H or C4H, or write power_on ="
            ' "done" in [board], and the board starts after that reset'
        )

    def left_over(self) -> list[tuple[Rule, str]]:
        """Return that HI stands, what was loaded in vain, and that no real position was read."""
        self.advance()
        axis, host = self.axis, self.host
        # What ends when busy falls counts: UDF and STT take what is loaded, a word is loaded.
        code, step, word = host.next_step() if host.busy else (-1, 0, 0)
        flags = axis.kept_flags(word) if code == ds.RSTI and step else int(axis.flags)
        found = []
        if flags & axis.mask and (self._hi.net.heard or axis.interrupts_wanted):
            unseen = ", and no status byte was read since it rose" if axis.unseen else ""
            names = names_of(ds.STATUS, int(flags & axis.mask))
            text = f"HI is high at the end{unseen}: {names}; RSTI lets it fall"
            found.append((ds.HI_STANDS, text))
        errors = names_of(ds.STATUS, flags & (ds.COMMAND_ERROR | ds.POSITION_ERROR))
        if errors:
            found.append((ds.ERRORS_STAND, f"at the end: {errors}"))
        # The command that would take it may be in its busy time: then it is not left.
        if code != ds.UDF and (axis.pid.waits() or (code == ds.LFIL and step > 1)):
            over = axis.passed_over and axis.profile.done and not axis.breakpoint_armed
            rule = ds.UPDATE_WAITS if over and axis.pid.waits() else ds.LEFT_LOADED
            found.append((rule, "LFIL has loaded a filter that no UDF has taken"))
        begun = code == ds.LTRJ and step == 1
        control = word if begun else int(axis.profile.control)
        stops = control & ds.STOPS
        if code != ds.STT and (
            (stops if begun else axis.profile.waits()) or (code == ds.LTRJ and step > 1)
        ):
            what = "stop" if stops else "trajectory"
            off = axis.releases(control) if begun else axis.off_loaded and stops
            rule = ds.OFF_WAITS if off else ds.LEFT_LOADED
            found.append((rule, f"LTRJ has loaded a {what} that no STT has taken"))
        if axis.vain_moves > 1:
            text = f"{axis.vain_moves} moves with ki above 0, and il 0 in all of them"
            found.append((ds.VAIN_INTEGRAL, text))
        if axis.sip:
            found.append((ds.LEFT_ARMED, "SIP waits for an index pulse, and none has come"))
        if axis.breakpoint_armed:
            text = f"a breakpoint waits at {axis.breakpoint}, and the axis is at {axis.real}"
            found.append((ds.LEFT_ARMED, text))
        runs = axis.profile.velocity_mode and not axis.profile.stopping and axis.moving()
        if runs and axis.profile.velocity and not axis.start and code != ds.STT:
            text = f"velocity mode runs on at {axis.profile.speed()}"
            found.append((ds.LEFT_RUNNING, text))
        if axis.reads & (1 << ds.RDDP) and not axis.reads & (1 << ds.RDRP):
            text = "RDDP was read, which the motor does not change, and RDRP never"
            found.append((ds.DESIRED_ALONE, text))
        return found

    def after_load(self) -> None:
        """Work out what is due."""
        self._refresh()

    def overdue(self) -> bool:
        """Tell whether a sample began long ago, or something else was due then."""
        now = self.kernel.now
        # Two samples: one is under way, and one may be due at this very instant.
        late = self._cycle < self.clock.cycle_at(now) - 2 * ds.SAMPLE_CLK
        return self._next_inside() < now - MS or (late and self._sample_at != NEVER)
