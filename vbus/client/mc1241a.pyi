# Made from vbus/chips/mc1241a (calls, host) by contrib.generate; change that.
"""The client of the MC1241A and MC1141A."""

from typing import Final

from vbus.chips.mc1241a import datasheet as ds
from vbus.client.access import Packets
from vbus.client.bus import Bus, Chip, ChipCycles

class Mc1241aCalls(Mc1241aPackets):
    """A call for each row of the chip's tables, under the manual's name in lower case.

    Values are plain integers in the chip's own units. Of several words or bytes, the most
    significant one is written first.
    """

    def set_1(self) -> int:
        """Set current axis # to 1 (SET_1, 01H, PMD-CMD-1).

        Returns 16 bits, unsigned.
        """

    def set_2(self) -> int:
        """Set current axis # to 2 (SET_2, 02H, PMD-CMD-2).

        Returns 16 bits, unsigned.
        """

    def set_i(self) -> int:
        """Set current axis # to the interrupting axis (SET_I, 08H, PMD-CMD-3).

        Acts on the interrupting axis.

        Returns 16 bits, unsigned.
        """

    def set_prfl_s_crv(self) -> None:
        """Set profile mode to S-curve (SET_PRFL_S_CRV, 0BH, PMD-CMD-4).

        Acts on the current axis.
        """

    def set_prfl_trap(self) -> None:
        """Set profile mode to trapezoidal point to point (SET_PRFL_TRAP, 09H, PMD-CMD-5).

        Acts on the current axis.
        """

    def set_prfl_vel(self) -> None:
        """Set profile mode to velocity-contouring (SET_PRFL_VEL, 0AH, PMD-CMD-6).

        Acts on the current axis.
        """

    def set_prfl_gear(self) -> None:
        """Set profile mode to electronic gear (SET_PRFL_GEAR, 0CH, PMD-CMD-7).

        Acts on the current axis.
        """

    def set_pos(self, value: int) -> None:
        """Set command position (SET_POS, 10H, PMD-CMD-8).

        Acts on the current axis. Takes effect at an update.

        Args:
            value: 31 bits, two's complement, in ustep,
                -1073741824 to 1073741823.
        """

    def set_vel(self, value: int) -> None:
        """Set command velocity (SET_VEL, 11H, PMD-CMD-9).

        Acts on the current axis. Takes effect at an update.

        Args:
            value: 30 bits, unsigned, in 1/65536 ustep/cycle,
                0 to 1073741823.
        """

    def set_acc(self, value: int) -> None:
        """Set command acceleration (SET_ACC, 12H, PMD-CMD-10).

        Acts on the current axis. Takes effect at an update.

        Args:
            value: 32 bits, two's complement, in 1/65536 ustep/cycle/cycle,
                -2147483648 to 2147483647.
        """

    def set_max_acc(self, value: int) -> None:
        """Set max acceleration (S-curve profile only) (SET_MAX_ACC, 15H, PMD-CMD-11).

        Acts on the current axis. Takes effect at an update.

        Args:
            value: 15 bits, unsigned, in 1/65536 ustep/cycle/cycle,
                0 to 32767.
        """

    def set_jerk(self, value: int) -> None:
        """Set command jerk (SET_JERK, 13H, PMD-CMD-12).

        Acts on the current axis. Takes effect at an update.

        Args:
            value: 31 bits, unsigned, in 1/4294967296 ustep/cycle/cycle/cycle,
                0 to 2147483647.
        """

    def set_ratio(self, value: int) -> None:
        """Set command electronic gear ratio (SET_RATIO, 14H, PMD-CMD-13).

        Acts on the current axis. Takes effect at an update.

        Args:
            value: 32 bits, two's complement, in 1/65536 ustep/cnt,
                -2147483648 to 2147483647.
        """

    def set_start_vel(self, value: int) -> None:
        """Set starting velocity (SET_START_VEL, 6AH, PMD-CMD-14).

        Acts on the current axis.

        Args:
            value: 30 bits, unsigned, in 1/65536 ustep/cycle,
                0 to 1073741823.
        """

    def stop(self) -> None:
        """Abruptly stop current axis motion (STOP, 46H, PMD-CMD-15).

        Acts on the current axis. Takes effect at an update.
        """

    def smooth_stop(self) -> None:
        """Smoothly stop current axis motion (SMOOTH_STOP, 4EH, PMD-CMD-16).

        Acts on the current axis. Takes effect at an update.
        """

    def synch_prfl(self) -> None:
        """Set target position to actual position (SYNCH_PRFL, 47H, PMD-CMD-17).

        Acts on the current axis. Takes effect at an update.
        """

    def get_pos(self) -> int:
        """Get command position (GET_POS, 4AH, PMD-CMD-18).

        Acts on the current axis.

        Returns 32 bits, two's complement, in ustep.
        """

    def get_vel(self) -> int:
        """Get command velocity (GET_VEL, 4BH, PMD-CMD-19).

        Acts on the current axis.

        Returns 32 bits, unsigned, in 1/65536 ustep/cycle.
        """

    def get_acc(self) -> int:
        """Get command acceleration (GET_ACC, 4CH, PMD-CMD-20).

        Acts on the current axis.

        Returns 32 bits, two's complement, in 1/65536 ustep/cycle/cycle.
        """

    def get_max_acc(self) -> int:
        """Get max acceleration (S-curve profile only) (GET_MAX_ACC, 4FH, PMD-CMD-21).

        Acts on the current axis.

        Returns 16 bits, unsigned, in 1/65536 ustep/cycle/cycle.
        """

    def get_jerk(self) -> int:
        """Get command jerk (GET_JERK, 58H, PMD-CMD-22).

        Acts on the current axis.

        Returns 32 bits, unsigned, in 1/4294967296 ustep/cycle/cycle/cycle.
        """

    def get_ratio(self) -> int:
        """Get command electronic gear ratio (GET_RATIO, 59H, PMD-CMD-23).

        Acts on the current axis.

        Returns 32 bits, two's complement, in 1/65536 ustep/cnt.
        """

    def get_start_vel(self) -> int:
        """Get starting velocity (GET_START_VEL, 6BH, PMD-CMD-24).

        Acts on the current axis.

        Returns 32 bits, unsigned, in 1/65536 ustep/cycle.
        """

    def get_trgt_pos(self) -> int:
        """Get current target position (GET_TRGT_POS, 1DH, PMD-CMD-25).

        Acts on the current axis.

        Returns 32 bits, two's complement, in ustep.
        """

    def get_trgt_vel(self) -> int:
        """Get current target velocity (GET_TRGT_VEL, 1EH, PMD-CMD-26).

        Acts on the current axis.

        Returns 32 bits, two's complement, in 1/65536 ustep/cycle.
        """

    def set_time_brk(self) -> None:
        """Set breakpoint mode to time (SET_TIME_BRK, 17H, PMD-CMD-27).

        Acts on the current axis.
        """

    def set_pos_brk(self) -> None:
        """Set breakpoint mode to positive target position (SET_POS_BRK, 18H, PMD-CMD-28).

        Acts on the current axis.
        """

    def set_neg_brk(self) -> None:
        """Set breakpoint mode to negative target position (SET_NEG_BRK, 19H, PMD-CMD-29).

        Acts on the current axis.
        """

    def set_actl_pos_brk(self) -> None:
        """Set breakpoint mode to positive actual position (SET_ACTL_POS_BRK, 1BH, PMD-CMD-30).

        Acts on the current axis.
        """

    def set_actl_neg_brk(self) -> None:
        """Set breakpoint mode to negative actual position (SET_ACTL_NEG_BRK, 1CH, PMD-CMD-31).

        Acts on the current axis.
        """

    def set_mtn_cmplt_brk(self) -> None:
        """Set breakpoint mode to motion complete (SET_MTN_CMPLT_BRK, 35H, PMD-CMD-32).

        Acts on the current axis.
        """

    def set_ext_brk(self) -> None:
        """Set breakpoint mode to external (SET_EXT_BRK, 5EH, PMD-CMD-33).

        Acts on the current axis.
        """

    def set_brk_off(self) -> None:
        """Set breakpoint mode off (SET_BRK_OFF, 6DH, PMD-CMD-34).

        Acts on the current axis.
        """

    def set_brk_pnt(self, value: int) -> None:
        """Set breakpoint comparison value (SET_BRK_PNT, 16H, PMD-CMD-35).

        Acts on the current axis.

        Args:
            value: 32 bits, two's complement,
                -2147483648 to 2147483647.
        """

    def update(self) -> None:
        """Immediate parameter update (UPDATE, 1AH, PMD-CMD-36).

        Acts on the current axis.
        """

    def multi_update(self, value: int) -> None:
        """Multiple axis immediate parameter update (MULTI_UPDATE, 5BH, PMD-CMD-37).

        Acts on the whole chip set.

        Args:
            value: 16 bits, unsigned,
                0 to 65535.
        """

    def set_auto_update_on(self) -> None:
        """Set automatic profile update on (SET_AUTO_UPDATE_ON, 5CH, PMD-CMD-38).

        Acts on the current axis.
        """

    def set_auto_update_off(self) -> None:
        """Set automatic profile update off (SET_AUTO_UPDATE_OFF, 5DH, PMD-CMD-39).

        Acts on the current axis.
        """

    def get_brk_pnt(self) -> int:
        """Get breakpoint comparison value (GET_BRK_PNT, 57H, PMD-CMD-40).

        Acts on the current axis.

        Returns 32 bits, two's complement.
        """

    def set_intrpt_mask(self, value: int) -> None:
        """Set interrupt mask (SET_INTRPT_MASK, 2FH, PMD-CMD-41).

        Acts on the current axis.

        Args:
            value: 8 bits, unsigned,
                0 to 255.
        """

    def get_intrpt(self) -> int:
        """Get status of interrupting axis (GET_INTRPT, 30H, PMD-CMD-42).

        Acts on the interrupting axis.

        Returns 16 bits, unsigned.
        """

    def rst_intrpt(self, value: int) -> None:
        """Reset interrupting events (RST_INTRPT, 32H, PMD-CMD-43).

        Acts on the interrupting axis.

        Args:
            value: 16 bits, unsigned,
                0 to 65535.
        """

    def get_intrpt_mask(self) -> int:
        """Get interrupt mask (GET_INTRPT_MASK, 56H, PMD-CMD-44).

        Acts on the current axis.

        Returns 16 bits, unsigned.
        """

    def clr_status(self) -> None:
        """Reset status of current axis (CLR_STATUS, 33H, PMD-CMD-45).

        Acts on the current axis.
        """

    def rst_status(self, value: int) -> None:
        """Reset events for current axis (RST_STATUS, 34H, PMD-CMD-46).

        Acts on the current axis.

        Args:
            value: 16 bits, unsigned,
                0 to 65535.
        """

    def get_status(self) -> int:
        """Get axis status word (GET_STATUS, 31H, PMD-CMD-47).

        Acts on the current axis.

        Returns 16 bits, unsigned.
        """

    def get_mode(self) -> int:
        """Get axis mode word (GET_MODE, 48H, PMD-CMD-48).

        Acts on the current axis.

        Returns 16 bits, unsigned.
        """

    def get_actl_pos(self) -> int:
        """Get current actual axis location (GET_ACTL_POS, 37H, PMD-CMD-49).

        Acts on the current axis.

        Returns 32 bits, two's complement, in cnt.
        """

    def set_capt_index(self) -> None:
        """Set index signal as position capture trigger (SET_CAPT_INDEX, 64H, PMD-CMD-50).

        Acts on the current axis.
        """

    def set_capt_home(self) -> None:
        """Set home signal as position capture trigger (SET_CAPT_HOME, 65H, PMD-CMD-51).

        Acts on the current axis.
        """

    def get_capt(self) -> int:
        """Get current axis position capture location (GET_CAPT, 36H, PMD-CMD-52).

        Acts on the current axis.

        Returns 32 bits, two's complement, in cnt.
        """

    def set_step_ratio(self, value: int) -> None:
        """Set number of encoder counts per step (SET_STEP_RATIO, 68H, PMD-CMD-53).

        Acts on the current axis.

        Args:
            value: 15 bits, unsigned, in 1/256 cnt/ustep,
                0 to 32767.
        """

    def get_step_ratio(self) -> int:
        """Get number of encoder counts per step (GET_STEP_RATIO, 6FH, PMD-CMD-54).

        Acts on the current axis.

        Returns 16 bits, unsigned, in 1/256 cnt/ustep.
        """

    def set_auto_stop_on(self) -> None:
        """Set auto stop on motion error mode on (SET_AUTO_STOP_ON, 45H, PMD-CMD-55).

        Acts on the current axis.
        """

    def set_auto_stop_off(self) -> None:
        """Set auto stop on motion error mode off (SET_AUTO_STOP_OFF, 44H, PMD-CMD-56).

        Acts on the current axis.
        """

    def set_pos_err(self, value: int) -> None:
        """Set maximum position error limit (SET_POS_ERR, 29H, PMD-CMD-57).

        Acts on the current axis.

        Args:
            value: 15 bits, unsigned, in cnt,
                0 to 32767.
        """

    def get_pos_err(self) -> int:
        """Get maximum position error limit (GET_POS_ERR, 55H, PMD-CMD-58).

        Acts on the current axis.

        Returns 16 bits, unsigned, in cnt.
        """

    def get_actl_pos_err(self) -> int:
        """Get actual position error (GET_ACTL_POS_ERR, 60H, PMD-CMD-59).

        Acts on the current axis.

        Returns 16 bits, two's complement, in cnt.
        """

    def set_output_pwm(self) -> None:
        """Set motor output mode to PWM (SET_OUTPUT_PWM, 3CH, PMD-CMD-60).

        Acts on the whole chip set.
        """

    def set_output_dac16(self) -> None:
        """Set motor output mode to 16-bit DAC (SET_OUTPUT_DAC16, 3BH, PMD-CMD-61).

        Acts on the whole chip set.
        """

    def mtr_on(self) -> None:
        """Enable profile generator (MTR_ON, 43H, PMD-CMD-62).

        Acts on the current axis.
        """

    def mtr_off(self) -> None:
        """Disable profile generator (MTR_OFF, 42H, PMD-CMD-63).

        Acts on the current axis.
        """

    def set_mtr_cmd(self, value: int) -> None:
        """Write direct value to motor output (SET_MTR_CMD, 62H, PMD-CMD-64).

        Acts on the current axis.

        Args:
            value: 16 bits, two's complement,
                -32767 to 32767.
        """

    def get_mtr_cmd(self) -> int:
        """Read motor output command (GET_MTR_CMD, 3AH, PMD-CMD-65).

        Acts on the current axis.

        Returns 16 bits, two's complement.
        """

    def set_buf_mtr_cmd(self, value: int) -> None:
        """Write double buffered motor command output (SET_BUF_MTR_CMD, 77H, PMD-CMD-66).

        Acts on the current axis. Takes effect at an update.

        Args:
            value: 16 bits, two's complement,
                -32767 to 32767.
        """

    def get_buf_mtr_cmd(self) -> int:
        """Get double buffered motor command value (GET_BUF_MTR_CMD, 69H, PMD-CMD-67).

        Acts on the current axis.

        Returns 16 bits, two's complement.
        """

    def get_output_mode(self) -> int:
        """Get current output mode (GET_OUTPUT_MODE, 6EH, PMD-CMD-68).

        Acts on the whole chip set.

        Returns 16 bits, unsigned.
        """

    def set_actl_pos(self, value: int) -> None:
        """Set axis position (SET_ACTL_POS, 4DH, PMD-CMD-69).

        Acts on the current axis.

        Args:
            value: 31 bits, two's complement,
                -1073741824 to 1073741823.
        """

    def set_lmt_sense(self, value: int) -> None:
        """Set limit switch bit sense (SET_LMT_SENSE, 66H, PMD-CMD-70).

        Acts on the whole chip set.

        Args:
            value: 4 bits, unsigned,
                0 to 15.
        """

    def get_lmt_swtch(self) -> int:
        """Get state of limit switches (GET_LMT_SWTCH, 67H, PMD-CMD-71).

        Acts on the whole chip set.

        Returns 16 bits, unsigned.
        """

    def lmts_on(self) -> None:
        """Set limit switch sensing on (LMTS_ON, 70H, PMD-CMD-72).

        Acts on the whole chip set.
        """

    def lmts_off(self) -> None:
        """Set limit switch sensing off (LMTS_OFF, 71H, PMD-CMD-73).

        Acts on the whole chip set.
        """

    def get_home(self) -> int:
        """Get state of home switches (GET_HOME, 05H, PMD-CMD-74).

        Acts on the whole chip set.

        Returns 16 bits, unsigned.
        """

    def reset(self) -> None:
        """Reset chipset (RESET, 39H, PMD-CMD-75).

        Acts on the whole chip set.
        """

    def get_vrsn(self) -> int:
        """Get chipset software version information (GET_VRSN, 6CH, PMD-CMD-76).

        Acts on the whole chip set.

        Returns 16 bits, unsigned.
        """

    def get_time(self) -> int:
        """Get current chip set time (# cycles) (GET_TIME, 3EH, PMD-CMD-77).

        Acts on the whole chip set.

        Returns 32 bits, unsigned, in cycles.
        """

    def set_phase_2(self) -> None:
        """Set waveform to 2-phase (SET_PHASE_2, 74H, PMD-CMD-78).

        Acts on the current axis.
        """

    def set_phase_3(self) -> None:
        """Set waveform to 3-phase (SET_PHASE_3, 73H, PMD-CMD-79).

        Acts on the current axis.
        """

    def get_phase_info(self) -> int:
        """Get commutation flags set by host (GET_PHASE_INFO, 7FH, PMD-CMD-80).

        Acts on the current axis.

        Returns 16 bits, unsigned.
        """

PROFILES: Final = ("trap", "vel", "s_crv", "gear")
READY_POLLS: Final = 10000

class Mc1241aPackets(Packets):
    """One chip set: the adapter's status byte, and packets with their checksums (PMD-PKT-1).

    Args:
        cycles: the chip set on its bus, from :meth:`~vbus.client.bus.Bus.chip`; or a bus
            with one chip.
        ready: how HostRdy is waited for: ``"poll"`` or ``"wait"``.
        polls: status reads after which a busy chip set is given up.
        checked: read and compare the checksum of every packet (PMD-PKT-2).
    """

    def __init__(
        self,
        cycles: ChipCycles,
        *,
        ready: str = "poll",
        polls: int = READY_POLLS,
        checked: bool = False,
    ) -> None: ...
    def packet(self, code: int, words: tuple[int, ...], count: int) -> list[int]:
        """Write a command byte and words, then read ``count`` words; return these.

        Raises:
            NotReadyError: the chip set stays busy; the rest of the packet is not sent.
            ChecksumError: the checksum is another one.
            ValueError: a word that does not fit.
        """

class Mc1241a(Mc1241aCalls):
    """A chip set with its axes.

    Positions are microsteps, velocities 1/65536 microsteps per cycle, accelerations 1/65536
    microsteps per cycle per cycle, jerk 2^-32 of its unit; a cycle is 542.72 us.

    Args:
        bus: the session.
        chip: the chip set's name on the board; None if there is only one.
        ready: how HostRdy is waited for, ``"poll"`` or ``"wait"``.
        polls: status reads after which a busy chip set is given up.
        checked: read and compare the checksum of every packet, and the events that end a move.
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
    def select(self, axis: int) -> int:
        """Make ``axis`` (1 or 2) the current one; return its status word (PMD-CMD-1).

        Raises:
            ValueError: there is no such axis.
        """

    def profile(self, mode: str) -> None:
        """Choose the profile mode of the current axis, one of :data:`PROFILES` (PMD-TRJ-13).

        Raises:
            ValueError: ``mode`` is none of these.
        """

    def load(
        self,
        *,
        pos: int | None = None,
        vel: int | None = None,
        acc: int | None = None,
        max_acc: int | None = None,
        jerk: int | None = None,
        ratio: int | None = None,
        mtr_cmd: int | None = None,
    ) -> None:
        """Load the buffered registers given of the current axis; an update makes them act.

        Args:
            pos: destination.
            vel: largest velocity.
            acc: acceleration; its sign is the direction in velocity contouring.
            max_acc: acceleration of the S-curve.
            jerk: jerk of the S-curve.
            ratio: microsteps per encoder count, in 1/65536, of the gear.
            mtr_cmd: amplitude of the microstep waveforms, -32767 to 32767.
        """

    def wait_event(
        self, bits: int = ds.MOTION_COMPLETE, longest: str = "60s", every: str = "1ms"
    ) -> int:
        """Read the current axis's status until one of the event ``bits`` is set; return it.

        Between the reads ``every`` of chip time passes, so this works in real time and in
        lockstep.

        Raises:
            NotReadyError: none is set after ``longest`` of chip time.
        """

    def move(
        self, pos: int, *, vel: int | None = None, acc: int | None = None, longest: str = "60s"
    ) -> int:
        """Move the current axis in its profile mode and wait; return the actual position.

        Raises:
            NotReadyError: motion is not complete after ``longest`` of chip time.
            ReadBackError: a limit switch or a motion error has ended it (``checked``).
        """
