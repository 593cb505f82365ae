"""An LM628 or LM629 axis: packets, a call for each command, filter, moves, waiting, for asyncio."""

from typing import TYPE_CHECKING, Final

from vbus.chips.lm628 import datasheet as lm
from vbus.client.aio.access import READY_POLLS, Packets, calls_of, words_of
from vbus.client.aio.bus import Bus, Chip
from vbus.client.aio.waits import read_until, twice
from vbus.core.errors import NotReadyError, ReadBackError

_STOPS: Final = {
    "smoothly": lm.STOP_SMOOTHLY,
    "abruptly": lm.STOP_ABRUPTLY,
    "off": lm.TURN_OFF,
}


_UNCHECKED: Final = (lm.COMMANDS["RESET"].code, lm.COMMANDS["RSTI"].code)
"""After these the flag is that of an earlier command, or says nothing yet."""


class Lm628Packets(Packets):
    """One LM628 or LM629: status, and packets of a command and its words (LM-BUS-6, LM-BUS-7).

    The status byte can be read at any time (LM-BUS-5); busy is its bit 0 (LM-BUS-14).

    Args:
        cycles: the chip on its bus, from :meth:`~vbus.client.aio.bus.Bus.chip`; or a bus
            with one chip.
        ready: how busy is waited for, ``"poll"`` or ``"wait"``.
        polls: status reads after which a busy chip is given up.
        checked: look after every packet whether the chip has taken it for an error (LM-AMB-12).
    """

    COMMAND_PORT = lm.COMMAND_PORT
    DATA_PORT = lm.DATA_PORT
    READY_MASK = lm.BUSY
    READY_LEVEL = 0

    async def packet(self, code: int, words: tuple[int, ...], count: int) -> list[int]:
        """Write a command byte and words, then read ``count`` words; return these.

        Raises:
            NotReadyError: the chip stays busy; the rest of the packet is not sent.
            ReadBackError: the chip has found a command error.
            ValueError: a word that does not fit.
        """
        answers = await super().packet(code, words, count)
        if self.checked and code not in _UNCHECKED:
            await self.wait_ready()
            if (status := await self.status()) & lm.COMMAND_ERROR:
                raise ReadBackError(
                    f"packet {code:02X}h: status {status:02X}h has a command error; RSTI clears it"
                )
        return answers


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
        checked: look after every packet for a command error (LM-AMB-12), after a load of the
            trajectory at the signals register, and after a move at the desired position: all that
            the chip tells of what it has taken. It does not tell coefficients and rates.
    """

    def __init__(
        self, bus: Bus, chip: str | None = None, *, ready: str = "poll",
        polls: int = READY_POLLS, checked: bool = False,
    ) -> None:  # fmt: skip
        self.bus: Bus = bus
        self.chip: Chip = bus.chip(chip if chip is not None else bus.info.chips[0].name)
        super().__init__(self.chip, ready=ready, polls=polls, checked=checked)

    async def check_reset(self, longest: str = "10ms") -> int:
        """Make the check of a fresh reset that most drivers make; return the last status byte.

        Status must become 84h or C4h, and RSTI 0000h must turn it into 80h or C0h
        (LM-RST-5, LM-RST-6).

        Raises:
            NotReadyError: the chip has not been reset, or does not come out of it.
        """
        lacking = (
            "status {0:02X}h for {1}; after a reset it is 84h or C4h: a chip that was in use needs"
            " reset() first"
        )
        await read_until(
            self.bus, self.status, lambda status: status in (0x84, 0xC4), longest, "100us", lacking
        )
        await self.rsti(0x0000)
        await self.wait_ready()
        if (status := await self.status()) not in (0x80, 0xC0):
            raise NotReadyError(f"status {status:02X}h after RSTI; 80h or C0h is required")
        return status

    async def load_filter(
        self, *, kp: int | None = None, ki: int | None = None, kd: int | None = None,
        il: int | None = None, ds: int = 0, update: bool = True,
    ) -> None:  # fmt: skip
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
        self, *, acc: int | None = None, vel: int | None = None, pos: int | None = None,
        relative: bool = False, velocity_mode: bool = False, forward: bool = True,
        start: bool = False,
    ) -> None:  # fmt: skip
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
        if self.checked:
            await self._check_signals(lm.ACCELERATION_LOADED if acc is not None else 0, 0)
        if start:
            await self.stt()
        if start and self.checked:
            modes = lm.VELOCITY_MODE | lm.FORWARD
            # They are those in use, and STT takes effect at the next sample: 2048 clocks at most.
            await self._check_signals(control & modes, modes, "3ms")

    async def _check_signals(self, wanted: int, mask: int, longest: str = "0ms") -> None:
        bits = mask | wanted
        lacking = (
            "signals register {0:04X}h {1} after a load of the trajectory: of the bits"
            f" {bits:04X}h, {wanted:04X}h must be set"
        )
        try:
            await read_until(
                self.bus, self.rdsigs, lambda signals: signals & bits == wanted, longest, "100us",
                lacking,
            )  # fmt: skip
        except NotReadyError as error:
            raise ReadBackError(str(error)) from None

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
            ReadBackError: it has ended elsewhere (``checked``).
        """
        begun = await self.rddp() if self.checked and relative else 0
        await self.rsti(0xFFFF & ~lm.TRAJECTORY_COMPLETE)
        if acc is not None or vel is not None:
            await self.load_trajectory(acc=acc, vel=vel)
        await self.load_trajectory(pos=pos, relative=relative, start=True)
        await self.wait_status(lm.TRAJECTORY_COMPLETE, longest)
        if self.checked and (desired := await self.rddp()) != begun + pos:
            raise ReadBackError(f"the move has ended at {desired}; {begun + pos} was asked for")
        return await twice(self.rdrp) if self.checked else await self.rdrp()
