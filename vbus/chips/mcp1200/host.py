"""An MCP-1200 axis: modes, moves, homing and waiting, for asyncio."""

from typing import Final

from vbus.chips.mcp1200.calls import Mcp1200Calls
from vbus.chips.mcp1200.datasheet import (
    CAPTURE_CONTROL,
    CONTROL_CODE,
    F0,
    F1,
    F2,
    FEATURE_BITS,
    FLAG,
    HALT_CODE,
    IDLE_CODE,
    INDEX_CAPTURE,
    INDEX_LATCH,
    INDEX_RISING,
    SOFT_RESET_CODE,
)
from vbus.client.aio.bus import Bus, Chip
from vbus.client.aio.twice import twice
from vbus.core.errors import NotReadyError, ReadBackError
from vbus.protocols.quantities import parse_duration

PROFILE: Final = 0
POSITION_INTERPOLATION: Final = 3
VELOCITY_INTERPOLATION: Final = 4
VELOCITY: Final = 5
"""Numbers of the mode flags in the flag register (MCP-FLG-1)."""

_FEATURES: Final = {bit.name.lower(): bit.mask for bit in FEATURE_BITS}


class Mcp1200(Mcp1200Calls):
    """One axis on an MCP-1200.

    Positions are counts, velocities and accelerations 1/256 count per sample (per sample).

    Args:
        bus: the session.
        chip: the chip's name on the board; None if there is only one.
        checked: read back every register that reads as it was written, and flags after they are
            set or cleared.
    """

    def __init__(self, bus: Bus, chip: str | None = None, *, checked: bool = False) -> None:
        self.bus: Bus = bus
        self.chip: Chip = bus.chip(chip if chip is not None else bus.info.chips[0].name)
        super().__init__(self.chip, checked=checked)

    async def wait_flags(self, bits: int, level: int, longest: str = "10s") -> int:
        """Read the flag register until ``bits`` of it are ``level``; return it.

        Raises:
            NotReadyError: they are not, after ``longest`` of chip time.
        """
        return await self._until(FLAG, bits, level, longest)

    async def reset(self) -> None:
        """Reset by software and wait for idle mode (MCP-RST-4, MCP-RST-5)."""
        await self.write_mode(SOFT_RESET_CODE)
        await self.wait_flags(F1, F1)

    async def control(self) -> None:
        """Close the loop and wait until it is closed (MCP-MOD-6)."""
        await self.write_mode(CONTROL_CODE)
        await self.wait_flags(F1, 0)

    async def idle(self) -> None:
        """Turn the motor off and wait until it is off (MCP-MOD-2)."""
        await self.write_mode(IDLE_CODE)
        await self.wait_flags(F1, F1)

    async def halt(self) -> None:
        """Stop where the axis is, and hold it there until :meth:`control` (MCP-MOD-7)."""
        await self.write_mode(HALT_CODE)

    async def set_flag(self, number: int) -> None:
        """Set a mode flag by number: :data:`PROFILE`, :data:`VELOCITY` and so on."""
        await self.write_flag(8 | number)
        if self.checked and number != PROFILE:  # a profile that has ended has cleared its own
            await self._check_flag(number, 1)

    async def _check_flag(self, number: int, level: int) -> None:
        flags = await self.read_flag()
        if flags >> number & 1 != level:
            raise ReadBackError(f"flag F{number} is not {level} in R00H, {flags:02X}h")

    async def clear_flag(self, number: int) -> None:
        """Clear a mode flag by number."""
        await self.write_flag(number)
        if self.checked:
            await self._check_flag(number, 0)

    async def feature(self, **switches: bool) -> None:
        """Switch features on or off, others stay: ``pid``, ``s_curve``, ``unipolar`` …

        Raises:
            ValueError: no such feature; says which there are.
        """
        value = await (twice(self.read_feature, 0) if self.checked else self.read_feature())
        for name, on in switches.items():
            if name not in _FEATURES:
                raise ValueError(f"no feature {name!r}; there are {', '.join(_FEATURES)}")
            value = value | _FEATURES[name] if on else value & ~_FEATURES[name]
        await self.write_feature(value)

    async def move(
        self, final: int, *, velocity: int, acceleration: int, jerk: int | None = None,
        longest: str = "60s",
    ) -> int:  # fmt: skip
        """Move to ``final`` and wait for the end of the profile; return the actual position.

        Args:
            final: final position, counts.
            velocity: top velocity, 1/256 count per sample.
            acceleration: 1/256 count per sample per sample.
            jerk: 1/65536 count per sample cubed for an S-curve; None makes a trapezoid.
            longest: chip time after which the move is given up.

        Raises:
            NotReadyError: the profile has not ended after ``longest`` of chip time.
            ReadBackError: the command position has ended elsewhere (``checked``).
        """
        await self.feature(s_curve=jerk is not None, high_resolution=True)
        if jerk is not None:
            await self.write_jerk(jerk)
        await self.write_velocity(velocity)
        await self.write_acceleration(acceleration)
        await self.write_final_position(final)
        await self.set_flag(PROFILE)
        await self.wait_flags(F0 | F2, 0, longest)
        if self.checked and (ended := await self.read_command_position()) != final:
            raise ReadBackError(f"the profile has ended at {ended}; {final} was asked for")
        read = self.read_actual_position
        return await (twice(read) if self.checked else read())

    async def home(
        self, *, velocity: int, acceleration: int, rising: bool = False, longest: str = "60s"
    ) -> int:
        """Run at ``velocity`` until the index is captured, stop, and return its position.

        Args:
            velocity: 1/256 count per sample; its sign is the direction.
            acceleration: 1/256 count per sample per sample.
            rising: the edge of INDEX that is wanted.
            longest: chip time after which the search is given up.

        Raises:
            NotReadyError: no index has come after ``longest`` of chip time.
        """
        await self.feature(high_resolution=True)
        await self.write_acceleration(acceleration)
        await self.write_capture_control(INDEX_CAPTURE | (INDEX_RISING if rising else 0))
        await self.write_velocity(velocity)
        await self.set_flag(VELOCITY)
        await self._until(CAPTURE_CONTROL, INDEX_LATCH, INDEX_LATCH, longest)
        await self.write_velocity(0)
        await self.wait_flags(F2, 0)
        await self.clear_flag(VELOCITY)
        return await self.read_capture()

    async def _until(self, address: int, bits: int, level: int, longest: str) -> int:
        end = await self.bus.now() + parse_duration(longest)
        while True:
            value = await self.cycles.read(address)
            if value & bits == level:
                return value
            if await self.bus.now() >= end:
                raise NotReadyError(
                    f"R{address:02X}H is {value:02X}h after {longest};"
                    f" of the bits {bits:02X}h, {level:02X}h must be set"
                )
            await self.bus.delay("500us")
