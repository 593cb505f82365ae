"""MCP-1200: homing on the index, a trapezoid with breakpoint pulses, an S-curve back."""

from typing import Final

from vbus.chips.mcp1200 import datasheet as ds
from vbus.client import Bus
from vbus.client.demo import Demo, Gauge, Step
from vbus.errors import NotReadyError

_BOARD: Final = """\
[chips.x]
part = "MCP-1200"
clock = "8 MHz"
plant = "motor"

[plants.motor]
model = "dc_motor"
encoder_lines = 500
index_offset = 1200
"""

_INDEX: Final = 1200
_BREAKPOINTS: Final = 2500
_FAR: Final = 12_000
_PROFILE: Final = 0x08
_VELOCITY: Final = 0x0D
_NO_VELOCITY: Final = 0x05
"""Flag register codes: set F0, set F5, clear F5."""


def _explain(write: bool, address: int, data: int) -> str:
    row = ds.REGISTERS.at(address)
    name = "reserved" if row is None else row.name
    return f"R{address:02X} {name:<18} {'<-' if write else '->'} {data:02X}h"


class _Registers:
    """The registers by name; several bytes in the order the manual asks for."""

    def __init__(self, bus: Bus) -> None:
        self.bus: Bus = bus

    def write(self, name: str, value: int) -> None:
        """Write a whole register, the byte that makes it count last (MCP-REG-13, 29)."""
        row = ds.REGISTERS[name]
        shifts = range(8 * len(row.addresses) - 8, -8, -8)
        with self.bus.batch() as batch:
            for address, shift in zip(row.addresses, shifts, strict=True):
                batch.write(address, value >> shift & 0xFF)

    def read(self, name: str) -> int:
        """Read a whole register, least significant byte first (MCP-REG-16)."""
        row = ds.REGISTERS[name]
        with self.bus.batch() as batch:
            later = [batch.read(address) for address in reversed(row.addresses)]
        data = bytes(byte.value for byte in later)
        return int.from_bytes(data, "little", signed=row.signed)

    def wait(self, name: str, mask: int, level: int) -> None:
        """Read a register until the bits in ``mask`` are ``level``, for 10 s at most."""
        end = self.bus.now() + 10 * 10**12
        while self.read(name) & mask != level:
            if self.bus.now() > end:
                raise NotReadyError(f"{name} is {self.read(name):02X}h after 10 s")
            self.bus.delay("1ms")


def _host(bus: Bus) -> None:
    chip = _Registers(bus)

    step = Step(bus, "wait for the reset to end, look at status and flags")
    chip.wait("FLAG", ds.F1, ds.F1)
    step.found("status", 0xF8, chip.read("STATUS") & 0xF8, digits=2)

    step = Step(bus, "PID filter, extended addressing, control mode")
    chip.write("CONFIG", ds.EXTENDED)
    chip.write("FEATURE", ds.PID | ds.HIGH_RESOLUTION)
    chip.write("KP", 64)
    chip.write("KD", 64)
    chip.write("MODE", ds.CONTROL_CODE)
    chip.wait("FLAG", ds.F1, 0)
    step.found("mode", ds.CONTROL_CODE, chip.read("MODE"))

    step = Step(bus, "home: run slowly until the index is captured")
    chip.write("CAPTURE_CONTROL", ds.INDEX_CAPTURE)
    chip.write("ACCELERATION", 0x0010)
    chip.write("VELOCITY", 0x0200)
    chip.write("FLAG", _VELOCITY)
    chip.wait("CAPTURE_CONTROL", ds.INDEX_LATCH, ds.INDEX_LATCH)
    step.found("captured position", _INDEX, chip.read("CAPTURE"))
    chip.write("VELOCITY", 0)
    chip.wait("FLAG", ds.F2, 0)
    chip.write("FLAG", _NO_VELOCITY)

    step = Step(bus, "trapezoid with a pulse on TRIG every 2500 counts")
    chip.write("FEATURE", ds.PID)
    chip.write("BREAKPOINT", _BREAKPOINTS)
    chip.write("CONFIG", ds.EXTENDED | ds.BREAK_ENABLE)
    bus.delay("2ms")
    chip.write("CONFIG", ds.EXTENDED | ds.BREAK_ENABLE | ds.BREAK_REPEAT)
    bus.events("TRIG")
    _move(chip, _FAR, velocity=10, acceleration=0x0018)
    step.found("actual position", _FAR, chip.read("ACTUAL_POSITION"), tolerance=2)
    step.found("pulses", _FAR // _BREAKPOINTS, len(bus.take_events()) // 2)
    bus.events()

    step = Step(bus, "back to zero in an S-curve")
    chip.write("CONFIG", ds.EXTENDED)
    chip.write("FEATURE", ds.PID | ds.S_CURVE)
    chip.write("JERK", 0x0060)
    _move(chip, 0, velocity=10, acceleration=0x0018)
    step.found("command position", 0, chip.read("COMMAND_POSITION"))
    step.found("actual position", 0, chip.read("ACTUAL_POSITION"), tolerance=2)


def _move(chip: _Registers, final: int, velocity: int, acceleration: int) -> None:
    chip.write("PROFILE_VELOCITY", velocity)
    chip.write("ACCELERATION", acceleration)
    chip.write("FINAL_POSITION", final)
    chip.write("FLAG", _PROFILE)
    chip.bus.delay("2ms")
    chip.wait("FLAG", ds.F0, 0)
    chip.bus.delay("50ms")


DEMO: Final = Demo(
    title="MCP-1200 and a brushed DC motor",
    board=_BOARD,
    chip="x",
    gauges=(
        Gauge("mode", "mode"),
        Gauge("command position (counts)", "command", 15_000),
        Gauge("actual position (counts)", "actual", 15_000),
        Gauge("position error (counts)", "error", 20),
        Gauge("velocity (counts/sample)", "velocity", 12),
        Gauge("PWM (of full scale)", "drive", 1.0, 3),
    ),
    flags={"flags": ds.FLAG_BITS, "status": ds.STATUS_BITS},
    explain=_explain,
    host=_host,
    rest=(0,),
)
