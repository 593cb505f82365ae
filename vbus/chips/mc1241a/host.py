"""An MC1241A or MC1141A: packets with checksums, a call for each command, axes, moves, updates and
waiting, for asyncio."""

from typing import TYPE_CHECKING, Final

from vbus.chips.mc1241a import datasheet as ds
from vbus.chips.tables import names_of
from vbus.client.aio.access import Packets, calls_of
from vbus.client.aio.bus import Bus, Chip, ChipCycles
from vbus.client.aio.waits import read_until
from vbus.core.errors import ChecksumError, ReadBackError

PROFILES: Final = ("trap", "vel", "s_crv", "gear")
"""Profile modes as their ``SET_PRFL_`` commands call them."""


READY_POLLS: Final = 10_000
"""Status reads after which a chip set is given up: a reset takes 2 ms."""
_RESET: Final = ds.COMMANDS["RESET"].code
"""After a reset there is no checksum (PMD-RST-1)."""
_ENDS: Final = ds.MOTION_ERROR | ds.POSITIVE_LIMIT | ds.NEGATIVE_LIMIT
"""Events that end a move elsewhere."""


class Mc1241aPackets(Packets):
    """One chip set: the adapter's status byte, and packets with their checksums (PMD-PKT-1).

    Args:
        cycles: the chip set on its bus, from :meth:`~vbus.client.aio.bus.Bus.chip`; or a bus
            with one chip.
        ready: how HostRdy is waited for: ``"poll"`` or ``"wait"``.
        polls: status reads after which a busy chip set is given up.
        checked: read and compare the checksum of every packet (PMD-PKT-2).
    """

    COMMAND_PORT = ds.COMMAND_PORT
    DATA_PORT = ds.DATA_PORT
    READY_MASK = ds.STATUS_READY
    READY_LEVEL = ds.STATUS_READY

    def __init__(
        self, cycles: ChipCycles, *, ready: str = "poll", polls: int = READY_POLLS,
        checked: bool = False,
    ) -> None:  # fmt: skip
        super().__init__(cycles, ready=ready, polls=polls, checked=checked)

    async def packet(self, code: int, words: tuple[int, ...], count: int) -> list[int]:
        """Write a command byte and words, then read ``count`` words; return these.

        Raises:
            NotReadyError: the chip set stays busy; the rest of the packet is not sent.
            ChecksumError: the checksum is another one.
            ValueError: a word that does not fit.
        """
        if not self.checked or code == _RESET:
            return await super().packet(code, words, count)
        *answers, checksum = await super().packet(code, words, count + 1)
        expected = (code + sum(words) + sum(answers)) & 0xFFFF
        if checksum != expected:
            raise ChecksumError(
                f"packet {code:02X}h: checksum {checksum:04X}h, expected {expected:04X}h"
            )
        return answers


if TYPE_CHECKING:
    from vbus.chips.mc1241a.calls import Mc1241aCalls
else:
    Mc1241aCalls = calls_of("Mc1241aCalls", Mc1241aPackets, ds)


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

    def __init__(
        self, bus: Bus, chip: str | None = None, *, ready: str = "poll",
        polls: int = READY_POLLS, checked: bool = False,
    ) -> None:  # fmt: skip
        self.bus: Bus = bus
        self.chip: Chip = bus.chip(chip if chip is not None else bus.info.chips[0].name)
        super().__init__(self.chip, ready=ready, polls=polls, checked=checked)

    async def select(self, axis: int) -> int:
        """Make ``axis`` (1 or 2) the current one; return its status word (PMD-CMD-1).

        Raises:
            ValueError: there is no such axis.
        """
        if axis not in (1, 2):
            raise ValueError(f"axis {axis}: allowed are 1 and 2")
        return await self.set_1() if axis == 1 else await self.set_2()

    async def profile(self, mode: str) -> None:
        """Choose the profile mode of the current axis, one of :data:`PROFILES` (PMD-TRJ-13).

        Raises:
            ValueError: ``mode`` is none of these.
        """
        if mode not in PROFILES:
            raise ValueError(f"profile {mode!r}: allowed are {', '.join(PROFILES)}")
        await getattr(self, f"set_prfl_{mode}")()

    async def load(
        self, *, pos: int | None = None, vel: int | None = None, acc: int | None = None,
        max_acc: int | None = None, jerk: int | None = None, ratio: int | None = None,
        mtr_cmd: int | None = None,
    ) -> None:  # fmt: skip
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
        for value, load in (
            (pos, self.set_pos),
            (vel, self.set_vel),
            (acc, self.set_acc),
            (max_acc, self.set_max_acc),
            (jerk, self.set_jerk),
            (ratio, self.set_ratio),
            (mtr_cmd, self.set_buf_mtr_cmd),
        ):
            if value is not None:
                await load(value)

    async def wait_event(
        self, bits: int = ds.MOTION_COMPLETE, longest: str = "60s", every: str = "1ms"
    ) -> int:
        """Read the current axis's status until one of the event ``bits`` is set; return it.

        Between the reads ``every`` of chip time passes, so this works in real time and in
        lockstep.

        Raises:
            NotReadyError: none is set after ``longest`` of chip time.
        """
        lacking = f"status {{0:04X}}h after {{1}}; none of the bits {bits:02X}h is set"
        return await read_until(
            self.bus, self.get_status, lambda status: status & bits != 0, longest, every, lacking
        )

    async def move(
        self, pos: int, *, vel: int | None = None, acc: int | None = None, longest: str = "60s"
    ) -> int:
        """Move the current axis in its profile mode and wait; return the actual position.

        Raises:
            NotReadyError: motion is not complete after ``longest`` of chip time.
            ReadBackError: a limit switch or a motion error has ended it (``checked``).
        """
        await self.rst_status(ds.EVENTS & ~ds.MOTION_COMPLETE)
        await self.load(pos=pos, vel=vel, acc=acc)
        await self.update()
        status = await self.wait_event(ds.MOTION_COMPLETE, longest)
        if self.checked and status & _ENDS:
            names = names_of(ds.STATUS_BITS, status & _ENDS)
            raise ReadBackError(f"the move has ended with status {status:04X}h: {names}")
        return await self.get_actl_pos()
