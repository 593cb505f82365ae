"""An MCP-1200 axis: calls for each register, modes, moves, homing and waiting, for asyncio."""

from typing import TYPE_CHECKING, Final

from vbus.chips.mcp1200 import datasheet as ds
from vbus.client.aio.access import RegisterCycles, calls_of
from vbus.client.aio.bus import Bus, Chip, ChipCycles
from vbus.client.aio.waits import read_until, twice
from vbus.core.errors import ReadBackError

PROFILE: Final = 0
POSITION_INTERPOLATION: Final = 3
VELOCITY_INTERPOLATION: Final = 4
VELOCITY: Final = 5
"""Numbers of the mode flags in the flag register (MCP-FLG-1)."""

_FEATURES: Final = {bit.name.lower(): bit.mask for bit in ds.FEATURE_BITS}


FIRST_EXTENDED: Final = 0x40
"""First address that needs extended addressing (MCP-BUS-9)."""
_STORED: Final = {
    row.addresses
    for row in ds.REGISTERS
    if row.access == "rw" and not (row.on_read or row.on_write or row.moves)
}
"""Registers that read as they were written."""


class Mcp1200Access(RegisterCycles):
    """One MCP-1200: values of one or more bytes.

    Args:
        cycles: the chip on its bus, from :meth:`~vbus.client.aio.bus.Bus.chip`; or a bus
            with one chip.
        checked: read back every register that reads as it was written.
    """

    def __init__(self, cycles: ChipCycles, *, checked: bool = False) -> None:
        super().__init__(cycles)
        self.checked: bool = checked
        self._extended: bool = False

    async def extend(self) -> None:
        """Switch extended addressing on (R02 bit 0), whatever else R02 holds."""
        if self.checked:
            config = await twice(lambda: self.cycles.read(ds.CONFIG), 0)
        else:
            config = await self.cycles.read(ds.CONFIG)
        if not config & ds.EXTENDED:
            await self.cycles.write(ds.CONFIG, config | ds.EXTENDED)
            if (
                self.checked
                and (found := await self.cycles.read(ds.CONFIG)) != config | ds.EXTENDED
            ):
                raise ReadBackError(
                    f"R02H reads {found:02X}h after {config | ds.EXTENDED:02X}h was written"
                )
        self._extended = True

    async def read_bytes(self, addresses: tuple[int, ...], signed: bool = False) -> int:
        """Read the register at ``addresses`` as a number, by extended addressing if need be."""
        await self._reach(addresses)
        return await super().read_bytes(addresses, signed)

    async def write_bytes(self, addresses: tuple[int, ...], value: int) -> None:
        """Write the register at ``addresses``, by extended addressing if need be.

        Raises:
            ReadBackError: the register reads otherwise (``checked``).
            ValueError: the value does not fit.
        """
        await self._reach(addresses)
        await super().write_bytes(addresses, value)
        if self.checked and addresses in _STORED:
            found = await super().read_bytes(addresses)
            written = value & (1 << 8 * len(addresses)) - 1
            if found != written:
                raise ReadBackError(
                    f"R{addresses[0]:02X}H reads {found:X}h after {written:X}h was written"
                )
        if addresses == (ds.CONFIG,):
            self._extended = bool(value & ds.EXTENDED)

    async def _reach(self, addresses: tuple[int, ...]) -> None:
        if addresses[0] >= FIRST_EXTENDED and not self._extended:
            await self.extend()


if TYPE_CHECKING:
    from vbus.chips.mcp1200.calls import Mcp1200Calls
else:
    Mcp1200Calls = calls_of("Mcp1200Calls", Mcp1200Access, ds)


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
        return await self._until(ds.FLAG, bits, level, longest)

    async def reset(self) -> None:
        """Reset by software and wait for idle mode (MCP-RST-4, MCP-RST-5)."""
        await self.write_mode(ds.SOFT_RESET_CODE)
        await self.wait_flags(ds.F1, ds.F1)

    async def control(self) -> None:
        """Close the loop and wait until it is closed (MCP-MOD-6)."""
        await self.write_mode(ds.CONTROL_CODE)
        await self.wait_flags(ds.F1, 0)

    async def idle(self) -> None:
        """Turn the motor off and wait until it is off (MCP-MOD-2)."""
        await self.write_mode(ds.IDLE_CODE)
        await self.wait_flags(ds.F1, ds.F1)

    async def halt(self) -> None:
        """Stop where the axis is, and hold it there until :meth:`control` (MCP-MOD-7)."""
        await self.write_mode(ds.HALT_CODE)

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
        await self.wait_flags(ds.F0 | ds.F2, 0, longest)
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
        await self.write_capture_control(ds.INDEX_CAPTURE | (ds.INDEX_RISING if rising else 0))
        await self.write_velocity(velocity)
        await self.set_flag(VELOCITY)
        await self._until(ds.CAPTURE_CONTROL, ds.INDEX_LATCH, ds.INDEX_LATCH, longest)
        await self.write_velocity(0)
        await self.wait_flags(ds.F2, 0)
        await self.clear_flag(VELOCITY)
        return await self.read_capture()

    async def _until(self, address: int, bits: int, level: int, longest: str) -> int:
        wanted = f"of the bits {bits:02X}h, {level:02X}h must be set"
        lacking = f"R{address:02X}H is {{0:02X}}h after {{1}}; {wanted}"
        return await read_until(
            self.bus, lambda: self.cycles.read(address), lambda value: value & bits == level,
            longest, "500us", lacking,
        )  # fmt: skip
