"""What reading and writing a register does, beyond storing a byte."""

from typing import ClassVar, Final

from vbus.bits import sign_extend
from vbus.chips.mcp1200 import datasheet as ds
from vbus.chips.mcp1200.blocks import Blocks
from vbus.chips.mcp1200.inputs import EncoderPins, SidePins
from vbus.state import Names

_PLAIN: Final = 0
_READ_ONLY: Final = 1
_UNLISTED: Final = 2
_HOOKED: Final = 3

_STORED_CAPTURE_BITS: Final = (
    ds.BUSY_ON_PROF | ds.INDEX_RISING | ds.INDEX_CAPTURE | ds.TRIG_INPUT | ds.TRIG_CAPTURE
)
_CAPTURE_LATCHES: Final = ds.INDEX_LATCH | ds.TRIG_LATCH


def _kinds() -> bytes:
    kinds = bytearray([_UNLISTED] * ds.REGISTERS.size)
    for row in ds.REGISTERS:
        for address in row.addresses:
            kinds[address] = _READ_ONLY if row.access == "r" else _PLAIN
    for address in (
        ds.FLAG, ds.CONFIG, ds.CAPTURE_CONTROL, ds.MODE, ds.STATUS, ds.MOTOR_COMMAND,
        ds.PWM_COMMAND, ds.COMMAND_INCREMENT, ds.COMMAND_MSB, ds.COMMAND_CSB, ds.COMMAND_LSB,
        ds.ACTUAL_CSB, ds.PRESET_LSB, ds.ENCODER_PWM, ds.VELOCITY_LSB, ds.FINAL_LSB,
        ds.MOTOR_COMMAND_LOW, ds.PWM_FRACTION,
    ):  # fmt: skip
        kinds[address] = _HOOKED
    return bytes(kinds)


_KINDS: Final = _kinds()


class HostRegisters:
    """The register map as the bus sees it: one byte at a time, with the manual's latches.

    Values the core computes lie in the register bytes themselves; only what is live (R0F, R14)
    or latched needs a word here.

    Args:
        works: whose registers.
        side: the inputs that registers guard and show.
        encoder_pins: the filter that R1A sets.
    """

    __slots__ = (
        "_bytes", "_encoder_pins", "_held_csb", "_held_msb", "_noted", "_side", "_works",
    )  # fmt: skip
    STATE: ClassVar[Names] = ("_held_msb", "_held_csb", "_noted: set[i64]")
    WIRING: ClassVar[Names] = ("_bytes", "_encoder_pins", "_side", "_works")

    def __init__(self, works: Blocks, side: SidePins, encoder_pins: EncoderPins) -> None:
        self._works: Blocks = works
        self._side: SidePins = side
        self._encoder_pins: EncoderPins = encoder_pins
        self._bytes: bytearray = works.file.bytes
        self._held_msb: int = 0
        self._held_csb: int = 0
        self._noted: set[int] = set()

    def map(self, address: int) -> int:
        """Register a bus address selects: 6 bits of it, or 7 (MCP-BUS-9)."""
        return address & (0x7F if self._bytes[ds.CONFIG] & ds.EXTENDED else 0x3F)

    def clear(self) -> None:
        """Forget held bytes: a hard reset."""
        self._held_msb = 0
        self._held_csb = 0

    # -- reading ------------------------------------------------------------------------------

    def read(self, address: int, cycle: int) -> int:
        """Return the byte at ``address``; nothing changes."""
        if address == ds.SAMPLE_TIMER:
            return self._works.timer.count(cycle)
        if address == ds.ACTUAL_LSB:
            return self._works.counter.position(cycle) & 0xFF
        return self._bytes[address]

    def taken(self, address: int, cycle: int) -> None:
        """The byte has been latched for the host: reading R14 latches R13 and R12."""
        if address == ds.ACTUAL_LSB:
            position = self._works.counter.position(cycle)
            self._bytes[ds.ACTUAL_LSB] = position & 0xFF
            self._bytes[ds.ACTUAL_CSB] = position >> 8 & 0xFF
            self._bytes[ds.ACTUAL_MSB] = position >> 16 & 0xFF
        elif _KINDS[address] == _UNLISTED:
            self._note(address, -1)

    def _note(self, address: int, cycle: int) -> None:
        if address not in self._noted:
            self._noted.add(address)
            self._works.report(
                ds.RESERVED, cycle, address, f"address {address:02X}H is not in the register table"
            )

    # -- writing ------------------------------------------------------------------------------

    def write(self, address: int, data: int, cycle: int) -> None:
        """Take the byte ``data``; it is visible from ``cycle`` on."""
        kind = _KINDS[address]
        if kind == _PLAIN:
            self._bytes[address] = data
        elif kind == _HOOKED:
            self._hook(address, data, cycle)
        elif kind == _UNLISTED:
            self._note(address, cycle)

    def _hook(self, address: int, data: int, cycle: int) -> None:
        stored = self._bytes
        works = self._works
        if address == ds.COMMAND_MSB:
            self._held_msb = data
        elif address == ds.COMMAND_CSB:
            self._held_csb = data
        elif address == ds.COMMAND_LSB:
            stored[ds.COMMAND_MSB] = self._held_msb
            stored[ds.COMMAND_CSB] = self._held_csb
            stored[ds.COMMAND_LSB] = data
            works.core.command_written = True
        elif address == ds.COMMAND_INCREMENT:
            stored[address] = data
            works.core.increment_written = True
        elif address == ds.FLAG:
            self._write_flag(data)
        elif address == ds.STATUS:
            self.clear_errors()
        elif address == ds.MODE:
            works.request(min(data, 3), cycle)
        elif address == ds.CAPTURE_CONTROL:
            kept = stored[address] & (ds.INTERPOLATOR_BUSY | data & _CAPTURE_LATCHES)
            stored[address] = data & _STORED_CAPTURE_BITS | kept
        elif address == ds.CONFIG:
            self._write_config(data, cycle)
        elif address == ds.ACTUAL_CSB:
            works.counter.preset(0, cycle)
        elif address == ds.PRESET_LSB:
            stored[address] = data
            value = stored[ds.PRESET_MSB] << 16 | stored[ds.PRESET_CSB] << 8 | data
            works.counter.preset(sign_extend(value, 24), cycle)
        elif address == ds.ENCODER_PWM:
            if (stored[address] ^ data) & ds.SWAP_AB:
                works.encoder.swap(bool(data & ds.SWAP_AB), cycle)
            stored[address] = data
            self._encoder_pins.configure(cycle)
        elif address == ds.FINAL_LSB:
            stored[address] = data
            value = stored[ds.FINAL_MSB] << 16 | stored[ds.FINAL_CSB] << 8 | data
            works.core.point = sign_extend(value, 24)
            if not stored[ds.FLAG] & ds.F4:
                stored[ds.CAPTURE_CONTROL] |= ds.INTERPOLATOR_BUSY
        elif address == ds.VELOCITY_LSB:
            stored[address] = data
            value = stored[ds.VELOCITY_MSB] << 16 | stored[ds.VELOCITY_CSB] << 8 | data
            works.core.velocity_point = sign_extend(value, 24)
            if not stored[ds.FLAG] & ds.F3:
                stored[ds.CAPTURE_CONTROL] |= ds.INTERPOLATOR_BUSY
        elif address in (ds.MOTOR_COMMAND, ds.PWM_COMMAND):
            stored[address] = data
            self._side.guard()
        else:
            stored[address] = data & 0xF0
            self._side.guard()

    def _write_flag(self, data: int) -> None:
        """One flag by number, set or cleared (MCP-FLG-1, 2)."""
        stored = self._bytes
        flag = 1 << (data & 7)
        if not flag & ds.MODE_FLAGS:
            return
        if data & 8:
            stored[ds.FLAG] |= flag
            # F2 acknowledges a profile at once, so that a host may wait for it to fall (NOTES 3).
            if flag == ds.F0 and not stored[ds.FLAG] & ds.F1 and self._works.controlling():
                stored[ds.FLAG] |= ds.F2
        else:
            stored[ds.FLAG] &= ~flag
            self._works.core.drop(flag)

    def clear_errors(self) -> None:
        """Any write to R07: flags off, except of a pin that is still low (MCP-STA-2)."""
        flags = ds.ERROR_FLAGS
        if self._side.limit == 0:
            flags &= ~ds.LIMIT_OK
        if self._side.stop == 0:
            flags &= ~ds.STOP_OK
        self._bytes[ds.STATUS] = self._bytes[ds.STATUS] & ~ds.ERROR_FLAGS | flags

    def _write_config(self, data: int, cycle: int) -> None:
        stored = self._bytes
        if (stored[ds.CONFIG] ^ data) & ds.STEP_MODE:
            here = self._works.counter.position(cycle)
            stored[ds.CONFIG] = data
            self._works.live.look()
            self._works.counter.preset(here, cycle)
        stored[ds.CONFIG] = data
