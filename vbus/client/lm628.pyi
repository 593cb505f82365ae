# Made from vbus/chips/lm628 (calls, host) by contrib.generate; change that.
"""The client of the LM628 and LM629."""

from vbus.chips.lm628 import datasheet as lm
from vbus.client.access import READY_POLLS, Packets
from vbus.client.bus import Bus, Chip

class Lm628Calls(Lm628Packets):
    """A call for each row of the chip's tables, under the manual's name in lower case.

    Values are plain integers in the chip's own units. Of several words or bytes, the most
    significant one is written first.
    """

    def reset(self) -> None:
        """Reset LM628 (RESET, 00H, LM-CMD-1).

        Commands may be executed on the fly during motion.
        """

    def port8(self) -> None:
        """Select 8-Bit Output (PORT8, 05H, LM-CMD-6).

        Commands not applicable to execution during motion.
        """

    def port12(self) -> None:
        """Select 12-Bit Output (PORT12, 06H, LM-CMD-7).

        Commands not applicable to execution during motion.
        """

    def dfh(self) -> None:
        """Define Home (DFH, 02H, LM-CMD-3).

        Commands may be executed on the fly during motion.
        """

    def sip(self) -> None:
        """Set Index Position (SIP, 03H, LM-CMD-4).

        Commands may be executed on the fly during motion.
        """

    def lpei(self, value: int) -> None:
        """Interrupt on Error (LPEI, 1BH, LM-CMD-16).

        Commands may be executed on the fly during motion.

        Args:
            value: 16 bits, unsigned, in cnt,
                0 to 65535.
        """

    def lpes(self, value: int) -> None:
        """Stop on Error (LPES, 1AH, LM-CMD-15).

        Commands may be executed on the fly during motion.

        Args:
            value: 16 bits, unsigned, in cnt,
                0 to 65535.
        """

    def sbpa(self, value: int) -> None:
        """Set Breakpoint, Absolute (SBPA, 20H, LM-CMD-21).

        Commands may be executed on the fly during motion.

        Args:
            value: 32 bits, two's complement, in cnt,
                -2147483648 to 2147483647.
        """

    def sbpr(self, value: int) -> None:
        """Set Breakpoint, Relative (SBPR, 21H, LM-CMD-22).

        Commands may be executed on the fly during motion.

        Args:
            value: 32 bits, two's complement, in cnt,
                -2147483648 to 2147483647.
        """

    def mski(self, value: int) -> None:
        """Mask Interrupts (MSKI, 1CH, LM-CMD-17).

        Commands may be executed on the fly during motion.

        Args:
            value: 16 bits, unsigned,
                0 to 65535.
        """

    def rsti(self, value: int) -> None:
        """Reset Interrupts (RSTI, 1DH, LM-CMD-18).

        Commands may be executed on the fly during motion.

        Args:
            value: 16 bits, unsigned,
                0 to 65535.
        """

    def lfil(self, control: int, *words: int) -> None:
        """Load Filter Parameters (LFIL, 1EH, LM-CMD-19).

        Commands may be executed on the fly during motion.

        Args:
            control: the control word, which says what follows.
            words: 0 to 4 data words.
        """

    def udf(self) -> None:
        """Update Filter (UDF, 04H, LM-CMD-5).

        Commands may be executed on the fly during motion.
        """

    def ltrj(self, control: int, *words: int) -> None:
        """Load Trajectory (LTRJ, 1FH, LM-CMD-20).

        Commands may be executed on the fly during motion.

        Args:
            control: the control word, which says what follows.
            words: 0 to 6 data words.
        """

    def stt(self) -> None:
        """Start Motion (STT, 01H, LM-CMD-2).

        Command may be executed during motion if acceleration parameter was not changed.
        """

    def rdsigs(self) -> int:
        """Read Signals Register (RDSIGS, 0CH, LM-CMD-13).

        Commands may be executed on the fly during motion.

        Returns 16 bits, unsigned.
        """

    def rdip(self) -> int:
        """Read Index Position (RDIP, 09H, LM-CMD-10).

        Commands may be executed on the fly during motion.

        Returns 32 bits, two's complement, in cnt.
        """

    def rddp(self) -> int:
        """Read Desired Position (RDDP, 08H, LM-CMD-9).

        Commands may be executed on the fly during motion.

        Returns 32 bits, two's complement, in cnt.
        """

    def rdrp(self) -> int:
        """Read Real Position (RDRP, 0AH, LM-CMD-11).

        Commands may be executed on the fly during motion.

        Returns 32 bits, two's complement, in cnt.
        """

    def rddv(self) -> int:
        """Read Desired Velocity (RDDV, 07H, LM-CMD-8).

        Commands may be executed on the fly during motion.

        Returns 32 bits, two's complement, in 1/65536 cnt/sample.
        """

    def rdrv(self) -> int:
        """Read Real Velocity (RDRV, 0BH, LM-CMD-12).

        Commands may be executed on the fly during motion.

        Returns 16 bits, two's complement, in cnt/sample.
        """

    def rdsum(self) -> int:
        """Read Integration Sum (RDSUM, 0DH, LM-CMD-14).

        Commands may be executed on the fly during motion.

        Returns 16 bits, two's complement.
        """

class Lm628Packets(Packets):
    """One LM628 or LM629: status, and packets of a command and its words (LM-BUS-6, LM-BUS-7).

    The status byte can be read at any time (LM-BUS-5); busy is its bit 0 (LM-BUS-14).

    Args:
        cycles: the chip on its bus, from :meth:`~vbus.client.bus.Bus.chip`; or a bus
            with one chip.
        ready: how busy is waited for, ``"poll"`` or ``"wait"``.
        polls: status reads after which a busy chip is given up.
        checked: look after every packet whether the chip has taken it for an error (LM-AMB-12).
    """

    def packet(self, code: int, words: tuple[int, ...], count: int) -> list[int]:
        """Write a command byte and words, then read ``count`` words; return these.

        Raises:
            NotReadyError: the chip stays busy; the rest of the packet is not sent.
            ReadBackError: the chip has found a command error.
            ValueError: a word that does not fit.
        """

class Lm628(Lm628Calls):
    """One axis on an LM628 or LM629.

    Positions are counts, velocities 1/65536 counts per sample, accelerations 1/65536 counts per
    sample per sample; :class:`~vbus.client.units.Units` makes them from turns and seconds.

    Args:
        bus: the session.
        chip: the chip's name on the board; None if there is only one.
        ready: how busy is waited for, ``"poll"`` or ``"wait"``.
        polls: status reads after which a busy chip is given up.
        checked: look after every packet for a command error (LM-AMB-12), after a load of the
            trajectory at the signals register, and after a move at the desired position: all that
            the chip tells of what it has taken. It does not tell coefficients and rates.
    """

    bus: Bus
    chip: Chip

    def __init__(
        self,
        bus: Bus,
        chip: str | None = None,
        *,
        ready: str = "poll",
        polls: int = READY_POLLS,
        checked: bool = False,
    ) -> None: ...
    def check_reset(self, longest: str = "10ms") -> int:
        """Make the check of a fresh reset that most drivers make; return the last status byte.

        Status must become 84h or C4h, and RSTI 0000h must turn it into 80h or C0h
        (LM-RST-5, LM-RST-6).

        Raises:
            NotReadyError: the chip has not been reset, or does not come out of it.
        """

    def load_filter(
        self,
        *,
        kp: int | None = None,
        ki: int | None = None,
        kd: int | None = None,
        il: int | None = None,
        ds: int = 0,
        update: bool = True,
    ) -> None:
        """Load the coefficients given, 0 to 7FFFh each, and let them take effect (LM-PID-1).

        Args:
            kp: proportional.
            ki: integral.
            kd: derivative.
            il: integration limit.
            ds: derivative sampling interval code: ds + 1 samples, 0 to 255.
            update: send UDF behind LFIL.

        Raises:
            ValueError: a coefficient out of range.
        """

    def load_trajectory(
        self,
        *,
        acc: int | None = None,
        vel: int | None = None,
        pos: int | None = None,
        relative: bool = False,
        velocity_mode: bool = False,
        forward: bool = True,
        start: bool = False,
    ) -> None:
        """Load the values given into the trajectory buffers (LM-TRJ-1).

        Args:
            acc: acceleration, 0 to 3FFFFFFFh.
            vel: velocity, 0 to 3FFFFFFFh.
            pos: position, -40000000h to 3FFFFFFFh.
            relative: the values are added to those in force (and may be negative).
            velocity_mode: run at the velocity for ever instead of to the position.
            forward: direction in velocity mode.
            start: send STT behind LTRJ.

        Raises:
            ValueError: a value out of range.
        """

    def stop(self, how: str = "smoothly") -> None:
        """Stop ``"smoothly"``, ``"abruptly"``, or by turning the motor ``"off"`` (LM-TRJ-5).

        Raises:
            ValueError: ``how`` is none of these.
        """

    def wait_status(
        self, bits: int = lm.TRAJECTORY_COMPLETE, longest: str = "60s", every: str = "1ms"
    ) -> int:
        """Read the status until one of ``bits`` is set; return it.

        Between the reads ``every`` of chip time passes, so this works in real time and in
        lockstep.

        Raises:
            NotReadyError: none is set after ``longest`` of chip time.
        """

    def move(
        self,
        pos: int,
        *,
        acc: int | None = None,
        vel: int | None = None,
        relative: bool = False,
        longest: str = "60s",
    ) -> int:
        """Move to a position and wait for the end of the trajectory; return the real position.

        Raises:
            NotReadyError: the trajectory has not ended after ``longest`` of chip time.
            ReadBackError: it has ended elsewhere (``checked``).
        """
