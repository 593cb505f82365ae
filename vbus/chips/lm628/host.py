"""An LM628 or LM629 axis: packets, a call for each command, filter, moves, waiting, for asyncio."""

from typing import TYPE_CHECKING, Final

from vbus.chips.lm628 import datasheet as lm
from vbus.client.aio.access import READY_POLLS, Packets, calls_of, words_of
from vbus.client.aio.bus import Bus, Chip
from vbus.client.aio.waits import read_until
from vbus.core.errors import NotReadyError

_STOPS: Final = {
    "smoothly": lm.STOP_SMOOTHLY,
    "abruptly": lm.STOP_ABRUPTLY,
    "off": lm.TURN_OFF,
}


class Lm628Packets(Packets):
    """One LM628 or LM629: status, and packets of a command and its words (LM-BUS-6, LM-BUS-7).

    The status byte can be read at any time (LM-BUS-5); busy is its bit 0 (LM-BUS-14).
    """

    COMMAND_PORT = lm.COMMAND_PORT
    DATA_PORT = lm.DATA_PORT
    READY_MASK = lm.BUSY
    READY_LEVEL = 0


if TYPE_CHECKING:
    from vbus.chips.lm628.calls import Lm628Calls
else:
    Lm628Calls = calls_of("Lm628Calls", Lm628Packets, lm)


class Lm628(Lm628Calls):
    """One axis on an LM628 or LM629.

    Positions are counts, velocities 1/65536 counts per sample, accelerations 1/65536 counts per
    sample per sample; :class:`~vbus.client.units.Units` makes them from turns and seconds.

    Args:
        bus: the session.
        chip: the chip's name on the board; None if there is only one.
        ready: how busy is waited for, ``"poll"`` or ``"wait"``.
        polls: status reads after which a busy chip is given up.
    """

    def __init__(
        self, bus: Bus, chip: str | None = None, *, ready: str = "poll", polls: int = READY_POLLS
    ) -> None:
        self.bus: Bus = bus
        self.chip: Chip = bus.chip(chip if chip is not None else bus.info.chips[0].name)
        super().__init__(self.chip, ready=ready, polls=polls)

    async def check_reset(self, longest: str = "10ms") -> int:
        """Make the check of a fresh reset that most drivers make; return the last status byte.

        Status must become 84h or C4h, and RSTI 0000h must turn it into 80h or C0h
        (LM-RST-5, LM-RST-6).

        Raises:
            NotReadyError: the chip has not been reset, or does not come out of it.
        """
        lacking = "status {0:02X}h {1} after reset; 84h or C4h is required"
        await read_until(
            self.bus, self.status, lambda status: status in (0x84, 0xC4), longest, "100us", lacking
        )
        await self.rsti(0x0000)
        await self.wait_ready()
        if (status := await self.status()) not in (0x80, 0xC0):
            raise NotReadyError(f"status {status:02X}h after RSTI; 80h or C0h is required")
        return status

    async def load_filter(
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
        if not 0 <= ds <= 0xFF:
            raise ValueError(f"ds = {ds}: allowed are 0 to 255")
        control = ds << 8
        words: list[int] = []
        gains = (("kp", kp, 8), ("ki", ki, 4), ("kd", kd, 2), ("il", il, 1))
        for name, value, bit in gains:
            if value is None:
                continue
            if not 0 <= value <= lm.COEFFICIENT_MAX:
                raise ValueError(f"{name} = {value}: allowed are 0 to {lm.COEFFICIENT_MAX}")
            control |= bit
            words.append(value)
        await self.lfil(control, *words)
        if update:
            await self.udf()

    async def load_trajectory(
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
        control = (lm.VELOCITY_MODE | (lm.FORWARD if forward else 0)) if velocity_mode else 0
        words: list[int] = []
        least = -lm.RATE_MAX if relative else 0
        values = (
            ("acc", acc, lm.LOADS[0], least, lm.RATE_MAX),
            ("vel", vel, lm.LOADS[1], least, lm.RATE_MAX),
            ("pos", pos, lm.LOADS[2], lm.POSITION_MIN, lm.POSITION_MAX),
        )
        for name, value, bit, low, high in values:
            if value is None:
                continue
            if not low <= value <= high:
                raise ValueError(f"{name} = {value}: allowed are {low} to {high}")
            control |= bit | (bit >> 1 if relative else 0)
            words.extend(words_of(value))
        await self.ltrj(control, *words)
        if start:
            await self.stt()

    async def stop(self, how: str = "smoothly") -> None:
        """Stop ``"smoothly"``, ``"abruptly"``, or by turning the motor ``"off"`` (LM-TRJ-5).

        Raises:
            ValueError: ``how`` is none of these.
        """
        if how not in _STOPS:
            raise ValueError(f"stop {how!r}: allowed are {', '.join(_STOPS)}")
        await self.ltrj(_STOPS[how])
        await self.stt()

    async def wait_status(
        self, bits: int = lm.TRAJECTORY_COMPLETE, longest: str = "60s", every: str = "1ms"
    ) -> int:
        """Read the status until one of ``bits`` is set; return it.

        Between the reads ``every`` of chip time passes, so this works in real time and in
        lockstep.

        Raises:
            NotReadyError: none is set after ``longest`` of chip time.
        """
        lacking = f"status {{0:02X}}h after {{1}}; none of the bits {bits:02X}h is set"
        return await read_until(
            self.bus, self.status, lambda status: status & bits != 0, longest, every, lacking
        )

    async def move(
        self, pos: int, *, acc: int | None = None, vel: int | None = None, relative: bool = False,
        longest: str = "60s",
    ) -> int:  # fmt: skip
        """Move to a position and wait for the end of the trajectory; return the real position.

        Raises:
            NotReadyError: the trajectory has not ended after ``longest`` of chip time.
        """
        await self.rsti(0xFFFF & ~lm.TRAJECTORY_COMPLETE)
        if acc is not None or vel is not None:
            await self.load_trajectory(acc=acc, vel=vel)
        await self.load_trajectory(pos=pos, relative=relative, start=True)
        await self.wait_status(lm.TRAJECTORY_COMPLETE, longest)
        return await self.rdrp()
