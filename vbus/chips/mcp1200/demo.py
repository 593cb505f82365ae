"""MCP-1200: homing on the index, a trapezoid with breakpoint pulses, an S-curve back."""

from typing import Final

from vbus.chips.mcp1200 import datasheet as ds
from vbus.client import Bus
from vbus.client.demo import Demo, Step
from vbus.client.mcp1200 import PROFILE, Mcp1200

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


def _host(bus: Bus) -> None:
    chip = Mcp1200(bus)

    step = Step(bus, "wait for the reset to end, look at status and flags")
    chip.wait_flags(ds.F1, ds.F1)
    step.found("status", 0xF8, chip.read_status() & 0xF8, digits=2)

    step = Step(bus, "PID filter, extended addressing, control mode")
    chip.write_config(ds.EXTENDED)
    chip.write_feature(ds.PID | ds.HIGH_RESOLUTION)
    chip.write_kp(64)
    chip.write_kd(64)
    chip.control()
    step.found("mode", ds.CONTROL_CODE, chip.read_mode())

    step = Step(bus, "home: run slowly until the index is captured")
    step.found("captured position", _INDEX, chip.home(velocity=0x0200, acceleration=0x0010))

    step = Step(bus, "trapezoid with a pulse on TRIG every 2500 counts")
    chip.write_feature(ds.PID)
    # Where it stands now hangs on how soon this program saw the index.
    _move(chip, 0, velocity=10, acceleration=0x0018)
    chip.write_breakpoint(_BREAKPOINTS)
    chip.write_config(ds.EXTENDED | ds.BREAK_ENABLE)
    bus.delay("2ms")
    chip.write_config(ds.EXTENDED | ds.BREAK_ENABLE | ds.BREAK_REPEAT)
    bus.events("TRIG")
    _move(chip, _FAR, velocity=10, acceleration=0x0018)
    step.found("actual position", _FAR, chip.read_actual_position(), tolerance=2)
    step.found("pulses", _FAR // _BREAKPOINTS, len(bus.take_events()) // 2)
    bus.events()

    step = Step(bus, "back to zero in an S-curve")
    chip.write_config(ds.EXTENDED)
    chip.write_feature(ds.PID | ds.S_CURVE)
    chip.write_jerk(0x0060)
    _move(chip, 0, velocity=10, acceleration=0x0018)
    step.found("command position", 0, chip.read_command_position())
    step.found("actual position", 0, chip.read_actual_position(), tolerance=2)


def _move(chip: Mcp1200, final: int, velocity: int, acceleration: int) -> None:
    chip.write_profile_velocity(velocity)
    chip.write_acceleration(acceleration)
    chip.write_final_position(final)
    chip.set_flag(PROFILE)
    chip.bus.delay("2ms")
    chip.wait_flags(ds.F0, 0)
    chip.bus.delay("50ms")


DEMO: Final = Demo(
    title="MCP-1200 and a brushed DC motor",
    board=_BOARD,
    chip="x",
    shown={
        "mode": 0, "command": 15_000, "actual": 15_000, "error": 20, "velocity": 12, "drive": 1,
        "flags": 0, "status": 0,
    },
    host=_host,
    rest=(0,),
)  # fmt: skip
