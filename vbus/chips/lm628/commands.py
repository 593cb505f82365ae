"""What each command does: its row of Table 2 names the hook, or what is read or set."""

from collections.abc import Callable
from typing import ClassVar, Final

from vbus.chips.lm628 import datasheet as ds
from vbus.chips.lm628.axis import ServoAxis
from vbus.chips.lm628.host_port import NO_COMMAND, PortState
from vbus.chips.lm628.profile import ACCELERATION, POSITION, VELOCITY
from vbus.chips.tables import Command, names_of
from vbus.core.bits import sign_extend
from vbus.core.signals import Rule
from vbus.core.state import Names

UNKNOWN: Final = -1

_ROWS: Final[dict[int, Command]] = {row.code: row for row in ds.COMMANDS}

BUFFERED: Final = frozenset(
    row.code for row in ds.COMMANDS if row.read or row.write or row.name == "UDF"
)
"""Commands that, up to the next sample, change no more than buffers, replies, mask and flags."""

_UNUSED: Final = 0xE0C0
"""Bits of LTRJ's control word that Table 6 calls not used."""


def _swapped(word: int) -> bool:
    """Whether flags stand in the first byte of MSKI or RSTI, where FFH is a complement's."""
    return not word & 0xFF and word >> 8 != 0xFF and bool(word >> 8 & ds.INTERRUPTS)


class AxisCommands:
    """The command set, working on an axis.

    A hook is a method of the axis or of this class. It is called when busy falls, with the data
    word or long once the host has written all of it, and with what its row says beside; that of a
    command with a control word, for each word, with the number of the word in its packet.

    Args:
        host: the port the packets come through.
        axis: the registers.
        pwm: the part is a LM629.
        restart: runs the reset of the RESET command.
        report: files violations at the instant busy fell.
    """

    STATE: ClassVar[Names] = ("_control", "_high")

    def __init__(
        self,
        host: PortState,
        axis: ServoAxis,
        pwm: bool,
        restart: Callable[[], None],
        report: Callable[[Rule, str], None],
    ) -> None:
        self._host: PortState = host
        self._axis: ServoAxis = axis
        self._pwm: bool = pwm
        self._restart: Callable[[], None] = restart
        self._report: Callable[[Rule, str], None] = report
        self._control: int = 0
        self._high: int = 0
        host.serve(self.execute)

    def execute(self, code: int, step: int, word: int) -> bool:
        """Carry out a step of command ``code``; False if the code is undefined (LM-BUS-13)."""
        row = _ROWS.get(code)
        if row is None:
            self._axis.flags |= ds.COMMAND_ERROR
            return False
        words: int = row.write
        if step == 0:
            self._host.words_due = words
        if step < words:
            if step:
                # LM-BUS-6: of a long the high word comes first; the low one calls the hook.
                self._high = word
            return True
        part, _, name = row.parameter.rpartition(".")
        holder = getattr(self._axis, part) if part else self._axis
        if row.hook:
            owner = self if HOOKS[row.hook] is AxisCommands else self._axis
            getattr(owner, row.hook)(*self._given(row, step, word))
        elif row.read:
            # LM-CMD-24: all words that the host reads later are of this instant.
            self._host.reply(getattr(holder, name), row.read)
            self._axis.reads |= 1 << code
            self._axis.reads_off = self._axis.reads_off | 1 << code if self._axis.motor_off else 0
            if code == ds.RDIP and self._axis.sip:
                self._report(ds.EARLY_INDEX, "RDIP while SIP waits: it is the index before")
        else:
            setattr(holder, name, row.value)
        return True

    def _given(self, row: Command, step: int, word: int) -> tuple[int, ...]:
        """Return what a hook is called with."""
        if row.up_to:
            return step, word
        data: tuple[int, ...] = (word,) if row.write else ()
        if row.write == 2:
            data = (sign_extend(self._high << 16 | word, 32),)
        return data if row.value is None else (*data, row.value)

    def foresee_flags(self) -> int:
        """Return the flags once busy falls; UNKNOWN if more may change than buffers and replies.

        Only where HI stays as it is, and no index pulse is looked for.
        """
        axis = self._axis
        code, step, word = self._host.next_step()
        # With SIP armed an index may store its position before the next sample.
        if axis.sip or (code != NO_COMMAND and code not in BUFFERED):
            return UNKNOWN
        flags, mask = axis.flags, axis.mask
        if step and code == ds.RSTI:
            flags = axis.kept_flags(word)
        elif step and code == ds.MSKI:
            mask = word & ds.INTERRUPTS
        return flags if bool(flags & mask) == axis.interrupt() else UNKNOWN

    # -- hooks --------------------------------------------------------------------------------

    def reset(self) -> None:
        """Reset LM628: as by the pin, but the status byte shows busy meanwhile (LM-RST-8)."""
        self._judge_off("RESET")
        axis, pid = self._axis, self._axis.pid
        lost = any(pid.loaded) or axis.threshold != ds.THRESHOLD_MAX or axis.mask != ds.RESET_MASK
        if (lost or not axis.port8) and not axis.profile.loaded():
            self._report(ds.RESET_FORGETS, "RESET sets back what was loaded, and no move has used")
        self._restart()

    def select_port(self, bits: int) -> None:
        """Select the 8-bit or the 12-bit output (LM-CMD-7)."""
        # LM-CMD-7, LM-AMB-16: reported, and carried out: the PWM keeps its upper 8 bits.
        if self._pwm and bits == 12:
            self._report(ds.PORT12_ON_LM629, ds.PORT12_ON_LM629.title)
        # LM-AMB-11: not applicable in motion, says the manual; it is executed.
        if self._axis.moving():
            self._report(ds.PORT_IN_MOTION, f"PORT{bits} in motion: it is executed")
        # LM-CMD-6: signals bit 8 is up for 8 bits.
        self._axis.port8 = bits == 8
        self._axis.port12_wanted = bits == 12 and not self._pwm

    def load_threshold(self, word: int, stop: int) -> None:
        """Load position error for interrupt, or for stopping."""
        # LM-CMD-25: bit 15 is left out, and reported.
        if word > ds.THRESHOLD_MAX:
            name = "LPES" if stop else "LPEI"
            self._report(ds.RANGE, f"{name} {word:04X}H: at most 7FFFH, bit 15 is ignored")
        if self._axis.stop_on_error and not stop:
            self._report(ds.STOP_LOST, f"LPEI {word:04X}H after LPES: no error stops the motor")
        # LM-CMD-25, LM-CMD-15, LM-CMD-16: 0 to 7FFFh.
        self._axis.threshold = word & ds.THRESHOLD_MAX
        # LM-CMD-15, LM-CMD-16: signals bit 9 is 1 after LPES, 0 after LPEI.
        self._axis.stop_on_error = bool(stop)

    def set_home(self) -> None:
        """Define home (LM-POS-4)."""
        profile = self._axis.profile
        if profile.velocity:
            self._report(ds.HOME_IN_MOTION, f"DFH at {profile.speed()}")
        self._axis.define_home()

    def enable_interrupts(self, word: int) -> None:
        """MSKI: bits 6..1 enable."""
        if word and not word & ds.INTERRUPTS:
            rule = ds.MISPLACED if _swapped(word) else ds.IDLE_BITS
            self._report(rule, f"MSKI {word:04X}H: only bits 6 to 1 enable anything")
        self._axis.mask_interrupts(word)

    def set_absolute_breakpoint(self, position: int) -> None:
        """SBPA: a place within the range of positions."""
        if not ds.POSITION_MIN <= position <= ds.POSITION_MAX:
            text = f"a breakpoint at {position}: positions have 31 bits, the rest is cut"
            self._report(ds.RANGE, text)
        self._axis.set_breakpoint(position)

    def set_relative_breakpoint(self, offset: int) -> None:
        """SBPR: counted from the active target (LM-AMB-5)."""
        axis = self._axis
        if axis.start and not axis.profile.velocity_mode:
            text = f"SBPR {offset:+d} counts from {axis.profile.target}"
            self._report(ds.EARLY_BREAKPOINT, f"{text}: the next sample takes the STT before it")
        self.set_absolute_breakpoint(axis.profile.target + offset)

    def load_filter(self, step: int, word: int) -> None:
        """Load filter parameters (LM-PID-1)."""
        pid = self._axis.pid
        if step == 1:
            if word & 0xF0:
                # All of them are set by a host that means "whatever there is".
                rule = ds.IDLE_BITS if word & 0xF0 == 0xF0 else ds.MISPLACED
                self._report(rule, f"LFIL {word:04X}H: bits 7 to 4 are not used")
            interval = pid.loaded[0]
            if word >> 8 == 0 != interval:
                text = f"LFIL {word:04X}H loads an interval of 1 sample; before it was"
                self._report(ds.INTERVAL_LOST, f"{text} {interval + 1}")
            # LM-PID-1: bits 7 to 4 mean nothing; a word follows for each of bits 3 to 0.
            self._control = word & 0x0F
            self._host.words_due = (word & 0x0F).bit_count()
            # LM-PID-1: every LFIL loads the interval, with or without coefficients.
            pid.store(0, word >> 8)
        else:
            # The highest load bit still set names the word.
            bit = self._control.bit_length() - 1
            self._control &= ~(1 << bit)
            # LM-PID-1: bit 15 of a coefficient is left out, and reported.
            if word > ds.COEFFICIENT_MAX:
                self._report(ds.RANGE, f"LFIL {word:04X}H: at most 7FFFH, bit 15 is ignored")
            pid.store(4 - bit, word)

    def load_trajectory(self, step: int, word: int) -> None:
        """Load trajectory parameters (LM-TRJ-1)."""
        profile = self._axis.profile
        if step == 1:
            self._control = word
            idle = word & _UNUSED | sum(word & load >> 1 for load in ds.LOADS if not word & load)
            why = f"bits {idle:04X}H do nothing" if idle else ""
            if word & ds.LOADS[POSITION] and word & (ds.VELOCITY_MODE | ds.STOPS):
                why = "it loads a position, which neither velocity mode nor a stop goes to"
            elif word & ds.FORWARD and not word & (ds.VELOCITY_MODE | ds.STOPS):
                why = "bit 12 gives a direction to velocity mode alone"
            if why:
                self._report(ds.IDLE_BITS, f"LTRJ {word:04X}H: {why}")
            # LM-TRJ-1: bits 15 to 13, 7 and 6 of the control word mean nothing.
            profile.control = word & (ds.FORWARD | ds.VELOCITY_MODE | ds.STOPS)
            self._axis.off_loaded = self._axis.releases(word)
            self._host.words_due = 2 * sum(word & load != 0 for load in ds.LOADS)
        else:
            # LM-TRJ-1: acceleration first, then velocity, then position.
            number = next(n for n, load in enumerate(ds.LOADS) if self._control & load)
            load = ds.LOADS[number]
            low = step % 2 == 1
            # LM-TRJ-1: a relative bit is looked at where its load bit is set, and nowhere else.
            profile.load_word(number, low, word, self._control & load >> 1 != 0)
            if low:
                self._control &= ~load
                what = ("acceleration", "velocity", "position")[number]
                # LM-TRJ-4: an STT that was refused leaves the acceleration, and what is beside it.
                if profile.overwritten(number) and not profile.accel_loaded:
                    self._report(ds.LOAD_LOST, f"another {what}, and no STT has taken the last one")
                # LM-TRJ-2: a value beyond its range is cut, and reported.
                if not profile.in_range(number):
                    raw = profile.raw[number]
                    self._report(ds.RANGE, f"{what} {raw:08X}H: it is cut to the range")
                if number == VELOCITY and profile.raw[VELOCITY] > ds.FOLLOWED_MAX:
                    if profile.in_range(VELOCITY) and not profile.relative[VELOCITY]:
                        self._report(ds.TOO_FAST, f"velocity {profile.raw[VELOCITY]:08X}H")
                if number == VELOCITY and profile.wraps():
                    raw = profile.raw[number]
                    self._report(
                        ds.VELOCITY_WRAPS,
                        f"velocity {raw:08X}H follows slower ones, all with a high word of 0: from"
                        " 65536 on it needs that word",
                    )

    def start(self) -> None:
        """Start motion control with the next sample."""
        axis = self._axis
        control = int(axis.profile.control)
        loaded, hasty = axis.profile.loaded(), axis.profile.hasty()
        change = self._change(control)
        # LM-TRJ-4: refused for a changed acceleration.
        if not axis.request_start():
            self._report(ds.STT_REFUSED, ds.STT_REFUSED.title)
            return
        # LM-TRJ-5: more than one stop bit is carried out, and reported.
        if (control & ds.STOPS).bit_count() > 1:
            self._report(ds.STOP_BITS, f"trajectory control word with stop bits {control:04X}H")
        if change is not None:
            self._report(*change)
        if control & ds.TURN_OFF:
            self._judge_off("STT with bit 8")
        else:
            self._judge_start(control, loaded)
            if hasty and not control & ds.STOPS:
                acceleration, velocity, _ = axis.profile.raw
                text = f"acceleration {acceleration:08X}H, velocity {velocity:08X}H"
                self._report(ds.HASTY, f"STT with {text}")

    def _change(self, control: int) -> tuple[Rule, str] | None:
        """Return what is odd about an STT to a target that nobody means, or from one under way."""
        axis, profile = self._axis, self._axis.profile
        if control & ds.STOPS:
            return None
        mode, aims = control & ds.VELOCITY_MODE != 0, profile.newer(POSITION)
        if axis.moving() and not profile.stopping and not axis.start:
            if profile.velocity_mode and not mode and not aims:
                return ds.MODE_LOST, "STT in velocity mode, and LTRJ without bit 11 or a position"
            if mode and not profile.velocity_mode:
                return ds.TARGET_LOST, f"velocity mode begins on the way to {profile.target}"
        desired, raw = int(profile.position >> 16), sign_extend(profile.raw[POSITION], 32)
        alone = axis.reads_off & (1 << ds.RDDP | 1 << ds.RDRP) == 1 << ds.RDDP
        on_the_way = profile.target != desired != axis.real
        aims = aims and not profile.relative[POSITION] and raw == desired
        if axis.motor_off and alone and on_the_way and aims:
            return ds.DESIRED_OFF, f"STT to {desired}, as RDDP says: the axis is at {axis.real}"
        return None

    def _judge_off(self, what: str) -> None:
        """Say so if the motor goes off at speed."""
        profile = self._axis.profile
        if self._axis.moving() and profile.velocity:
            self._report(ds.OFF_AT_SPEED, f"{what} at {profile.speed()}")

    def _judge_start(self, control: int, loaded: bool) -> None:
        """Say so if nothing can come of an STT that turns the motor on, or moves."""
        axis = self._axis
        lacking = axis.pid.lacking()
        if lacking and axis.pid.waits() and not axis.udf:
            self._report(ds.FILTER_WAITS, f"STT: {lacking}")
        if axis.pid.unlimited():
            self._report(ds.NO_INTEGRAL, f"STT with {axis.pid.unlimited()}")
        if axis.port8 and axis.port12_wanted:
            self._report(ds.PORT_LOST, "STT with 8 bits: a reset has come after PORT12")
        if control & ds.STOPS:
            return
        axis.passed_over = axis.pid.waits() and not lacking
        _, _, ki, _, il = axis.pid.sent
        if ki and not il and axis.vain_moves >= 0:
            axis.vain_moves += 1
        here = axis.real if axis.motor_off else axis.profile.position >> 16
        if not loaded:
            self._report(ds.NO_TRAJECTORY, "STT before LTRJ has loaded anything: the axis is held")
            return
        stuck = axis.profile.stuck(here)
        if stuck == ACCELERATION:
            self._report(ds.NO_ACCELERATION, "STT of a move with acceleration 0: it never begins")
        elif stuck == VELOCITY:
            self._report(ds.NO_VELOCITY, "STT of a move with velocity 0: it waits for one")

    def reset_interrupts(self, keep: int) -> None:
        """RSTI: zeros in bits 6..1 of ``keep`` clear the flags (LM-CMD-18, LM-RST-6)."""
        axis = self._axis
        before = axis.flags
        axis.flags = axis.kept_flags(keep)
        # LM-STA-7: HI falls with this RSTI: the host has seen why it was up.
        if before & axis.mask and not axis.flags & axis.mask:
            axis.interrupts_wanted = False
        if _swapped(keep):
            self._report(ds.MISPLACED, f"RSTI {keep:04X}H clears all flags: its first byte is idle")
        elif keep & ds.INTERRUPTS == ds.INTERRUPTS:
            self._report(ds.RESETS_NOTHING, f"RSTI {keep:04X}H: a 0 clears a flag, and none is 0")
        elif lost := axis.awaited() & ~keep & ~before:
            text = (
                f"RSTI {keep:04X}H clears what is still to come: {names_of(ds.STATUS, int(lost))}"
            )
            self._report(ds.CLEARS_AWAITED, text)
        elif before == axis.flags != axis.kept_flags(0):
            names = names_of(ds.STATUS, int(before))
            text = f"RSTI {keep:04X}H leaves all flags that are set: {names}"
            self._report(ds.LEAVES_FLAGS, text)


HOOKS: Final = ds.COMMANDS.find_hooks(AxisCommands, ServoAxis)
