"""What each command does: one method per row of Table 2."""

from collections.abc import Callable
from typing import ClassVar, Final

from vbus.bits import sign_extend
from vbus.chips.lm628 import datasheet as ds
from vbus.chips.lm628.axis import Axis
from vbus.chips.lm628.host_port import Host
from vbus.signals import Rule
from vbus.state import Names

UNKNOWN: Final = -1

BUFFERED: Final = frozenset(
    row.code for row in ds.COMMANDS if row.read or row.write or row.name == "UDF"
)
"""Commands that, up to the next sample, change no more than buffers, replies, mask and flags."""


class Commands:
    """The command set, working on an axis.

    Every method is called once per step of its packet, when busy falls: with step 0 for the
    command byte, and with step n and the word for the n-th data word.

    Args:
        host: the port the packets come through.
        axis: the registers.
        pwm: the part is a LM629.
        restart: runs the reset of the RESET command.
        report: files violations at the instant busy fell.
    """

    STATE: ClassVar[Names] = ("_control", "_high")
    WIRING: ClassVar[Names] = (
        "_axis", "_host", "_methods", "_pwm", "_report", "_restart", "_words",
    )  # fmt: skip

    def __init__(
        self,
        host: Host,
        axis: Axis,
        pwm: bool,
        restart: Callable[[], None],
        report: Callable[[Rule, str], None],
    ) -> None:
        self._host: Host = host
        self._axis: Axis = axis
        self._pwm: bool = pwm
        self._restart: Callable[[], None] = restart
        self._report: Callable[[Rule, str], None] = report
        self._control: int = 0
        self._high: int = 0
        self._methods: dict[int, Callable[[int, int], None]] = {
            row.code: getattr(self, row.handler) for row in ds.COMMANDS
        }
        self._words: dict[int, int] = {row.code: row.write for row in ds.COMMANDS}
        host.serve(self.execute)

    def execute(self, code: int, step: int, word: int) -> bool:
        """Carry out a step of command ``code``; False if the code is undefined (LM-BUS-13)."""
        method = self._methods.get(code)
        if method is None:
            self._axis.flags |= ds.COMMAND_ERROR
            return False
        if step == 0:
            self._host.words_due = self._words[code]
        method(step, word)
        return True

    def foresee_flags(self) -> int:
        """Return the flags once busy falls; UNKNOWN if more may change than buffers and replies.

        Only where HI stays as it is, and no index pulse is looked for.
        """
        axis = self._axis
        code, step, word = self._host.next_step()
        if axis.sip or (code >= 0 and code not in BUFFERED):
            return UNKNOWN
        flags, mask = axis.flags, axis.mask
        if step and code == ds.RSTI:
            flags = axis.kept_flags(word)
        elif step and code == ds.MSKI:
            mask = word & ds.INTERRUPTS
        return flags if (flags & mask != 0) == axis.interrupt() else UNKNOWN

    # -- Initialization commands --------------------------------------------------------------

    def cmd_reset(self, step: int, word: int) -> None:
        """Reset LM628: as by the pin, but the status byte shows busy meanwhile (LM-RST-8)."""
        self._restart()

    def cmd_port8(self, step: int, word: int) -> None:
        """Select the 8-bit output."""
        self._check_port("PORT8")
        self._axis.port8 = True

    def cmd_port12(self, step: int, word: int) -> None:
        """Select the 12-bit output (LM-CMD-7)."""
        if self._pwm:
            self._report(ds.PORT12_ON_LM629, ds.PORT12_ON_LM629.title)
        self._check_port("PORT12")
        self._axis.port8 = False

    def _check_port(self, name: str) -> None:
        if self._axis.moving():
            self._report(ds.PORT_IN_MOTION, f"{name} in motion: it is executed")

    def cmd_dfh(self, step: int, word: int) -> None:
        """Define home."""
        self._axis.define_home()

    # -- Interrupt control commands -----------------------------------------------------------

    def cmd_sip(self, step: int, word: int) -> None:
        """Set index position: the next index pulse is captured."""
        self._axis.sip = True

    def cmd_lpei(self, step: int, word: int) -> None:
        """Load position error for interrupt."""
        if step:
            self._load_threshold("LPEI", word, False)

    def cmd_lpes(self, step: int, word: int) -> None:
        """Load position error for stopping."""
        if step:
            self._load_threshold("LPES", word, True)

    def _load_threshold(self, name: str, word: int, stop: bool) -> None:
        if word > ds.THRESHOLD_MAX:
            self._report(ds.RANGE, f"{name} {word:04X}H: at most 7FFFH, bit 15 is ignored")
        self._axis.threshold = word & ds.THRESHOLD_MAX
        self._axis.stop_on_error = stop

    def cmd_sbpa(self, step: int, word: int) -> None:
        """Set breakpoint, absolute."""
        if step == 1:
            self._high = word
        elif step == 2:
            self._axis.set_breakpoint(self._long(word))

    def cmd_sbpr(self, step: int, word: int) -> None:
        """Set breakpoint, relative to the active target (LM-AMB-5)."""
        if step == 1:
            self._high = word
        elif step == 2:
            self._axis.set_breakpoint(self._axis.profile.target + self._long(word))

    def _long(self, low: int) -> int:
        return sign_extend(self._high << 16 | low, 32)

    def cmd_mski(self, step: int, word: int) -> None:
        """Mask interrupts: ones enable."""
        if step:
            self._axis.mask = word & ds.INTERRUPTS

    def cmd_rsti(self, step: int, word: int) -> None:
        """Reset interrupts: zeros clear."""
        if step:
            self._axis.reset_interrupts(word)

    # -- Filter control commands --------------------------------------------------------------

    def cmd_lfil(self, step: int, word: int) -> None:
        """Load filter parameters (LM-PID-1)."""
        pid = self._axis.pid
        if step == 1:
            self._control = word & 0x0F
            self._host.words_due = (word & 0x0F).bit_count()
            pid.store(0, word >> 8)
        elif step:
            # The highest load bit still set names the word.
            bit = self._control.bit_length() - 1
            self._control &= ~(1 << bit)
            if word > ds.COEFFICIENT_MAX:
                self._report(ds.RANGE, f"LFIL {word:04X}H: at most 7FFFH, bit 15 is ignored")
            pid.store(4 - bit, word)

    def cmd_udf(self, step: int, word: int) -> None:
        """Update filter with the next sample."""
        self._axis.request_update()

    # -- Trajectory control commands ----------------------------------------------------------

    def cmd_ltrj(self, step: int, word: int) -> None:
        """Load trajectory parameters (LM-TRJ-1)."""
        profile = self._axis.profile
        if step == 1:
            self._control = word
            profile.control = word & (ds.FORWARD | ds.VELOCITY_MODE | ds.STOPS)
            self._host.words_due = 2 * sum(word & load != 0 for load in ds.LOADS)
        elif step:
            number = next(n for n, load in enumerate(ds.LOADS) if self._control & load)
            load = ds.LOADS[number]
            low = step % 2 == 1
            profile.load_word(number, low, word, self._control & load >> 1 != 0)
            if low:
                self._control &= ~load
                if not profile.in_range(number):
                    what = ("acceleration", "velocity", "position")[number]
                    raw = profile.raw[number]
                    self._report(ds.RANGE, f"{what} {raw:08X}H: it is cut to the range")

    def cmd_stt(self, step: int, word: int) -> None:
        """Start motion control with the next sample."""
        control = int(self._axis.profile.control)
        if not self._axis.request_start():
            self._report(ds.STT_REFUSED, ds.STT_REFUSED.title)
        elif (control & ds.STOPS).bit_count() > 1:
            self._report(ds.STOP_BITS, f"trajectory control word with stop bits {control:04X}H")

    # -- Data reporting commands --------------------------------------------------------------

    def cmd_rdsigs(self, step: int, word: int) -> None:
        """Read signals register."""
        self._host.reply(self._axis.signals(), 1)

    def cmd_rdip(self, step: int, word: int) -> None:
        """Read index position."""
        self._host.reply(self._axis.index, 2)

    def cmd_rddp(self, step: int, word: int) -> None:
        """Read desired position, its whole counts."""
        self._host.reply(self._axis.profile.position >> 16, 2)

    def cmd_rdrp(self, step: int, word: int) -> None:
        """Read real position."""
        self._host.reply(self._axis.real, 2)

    def cmd_rddv(self, step: int, word: int) -> None:
        """Read desired velocity, 16.16."""
        self._host.reply(self._axis.profile.velocity, 2)

    def cmd_rdrv(self, step: int, word: int) -> None:
        """Read real velocity, whole counts per sample."""
        self._host.reply(self._axis.real_velocity(), 1)

    def cmd_rdsum(self, step: int, word: int) -> None:
        """Read integration-term summation value: what il has limited (LM-AMB-9)."""
        self._host.reply(self._axis.pid.term, 1)
