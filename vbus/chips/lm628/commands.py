"""What each command does: its row of Table 2 names the hook, or what is read or set."""

from collections.abc import Callable
from typing import ClassVar, Final

from vbus.chips.lm628 import datasheet as ds
from vbus.chips.lm628.axis import ServoAxis
from vbus.chips.lm628.host_port import NO_COMMAND, PortState
from vbus.chips.lm628.profile import ACCELERATION, VELOCITY
from vbus.chips.tables import Command
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


def flag_names(flags: int) -> str:
    """Return the names of status bits."""
    return ", ".join([bit.name for bit in ds.STATUS if flags & bit.mask])


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
    WIRING: ClassVar[Names] = ("_axis", "_host", "_pwm", "_report", "_restart")

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

    def load_threshold(self, word: int, stop: int) -> None:
        """Load position error for interrupt, or for stopping."""
        # LM-CMD-25: bit 15 is left out, and reported.
        if word > ds.THRESHOLD_MAX:
            name = "LPES" if stop else "LPEI"
            self._report(ds.RANGE, f"{name} {word:04X}H: at most 7FFFH, bit 15 is ignored")
        # LM-CMD-25, LM-CMD-15, LM-CMD-16: 0 to 7FFFh.
        self._axis.threshold = word & ds.THRESHOLD_MAX
        # LM-CMD-15, LM-CMD-16: signals bit 9 is 1 after LPES, 0 after LPEI.
        self._axis.stop_on_error = bool(stop)

    def set_relative_breakpoint(self, offset: int) -> None:
        """SBPR: counted from the active target (LM-AMB-5)."""
        axis = self._axis
        if axis.start and not axis.profile.velocity_mode:
            text = f"SBPR {offset:+d} counts from {axis.profile.target}"
            self._report(ds.EARLY_BREAKPOINT, f"{text}: the next sample takes the STT before it")
        axis.set_breakpoint(axis.profile.target + offset)

    def load_filter(self, step: int, word: int) -> None:
        """Load filter parameters (LM-PID-1)."""
        pid = self._axis.pid
        if step == 1:
            if word & 0xF0:
                self._report(ds.IDLE_BITS, f"LFIL {word:04X}H: bits 7 to 4 are not used")
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
            if idle:
                text = f"LTRJ {word:04X}H: bits {idle:04X}H do nothing"
                self._report(ds.IDLE_BITS, text)
            # LM-TRJ-1: bits 15 to 13, 7 and 6 of the control word mean nothing.
            profile.control = word & (ds.FORWARD | ds.VELOCITY_MODE | ds.STOPS)
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
                # LM-TRJ-2: a value beyond its range is cut, and reported.
                if not profile.in_range(number):
                    what = ("acceleration", "velocity", "position")[number]
                    raw = profile.raw[number]
                    self._report(ds.RANGE, f"{what} {raw:08X}H: it is cut to the range")
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
        loaded = axis.profile.loaded()
        # LM-TRJ-4: refused for a changed acceleration.
        if not axis.request_start():
            self._report(ds.STT_REFUSED, ds.STT_REFUSED.title)
            return
        # LM-TRJ-5: more than one stop bit is carried out, and reported.
        if (control & ds.STOPS).bit_count() > 1:
            self._report(ds.STOP_BITS, f"trajectory control word with stop bits {control:04X}H")
        if control & ds.TURN_OFF:
            if axis.moving() and axis.profile.velocity:
                self._report(ds.OFF_AT_SPEED, f"STT with bit 8 at {axis.profile.speed()}")
        else:
            self._judge_start(control, loaded)

    def _judge_start(self, control: int, loaded: bool) -> None:
        """Say so if nothing can come of an STT that turns the motor on, or moves."""
        axis = self._axis
        lacking = axis.pid.lacking()
        if lacking and axis.pid.waits() and not axis.udf:
            self._report(ds.FILTER_WAITS, f"STT: {lacking}")
        if axis.pid.unlimited():
            self._report(ds.NO_INTEGRAL, "STT with ki above 0 and il 0")
        if control & ds.STOPS:
            return
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
        if keep & ds.INTERRUPTS == ds.INTERRUPTS:
            self._report(ds.RESETS_NOTHING, f"RSTI {keep:04X}H: a 0 clears a flag, and none is 0")
        elif before == axis.flags != axis.kept_flags(0):
            self._report(
                ds.LEAVES_FLAGS,
                f"RSTI {keep:04X}H leaves all flags that are set: {flag_names(int(before))}",
            )


HOOKS: Final = ds.COMMANDS.find_hooks(AxisCommands, ServoAxis)
