"""LM629: reset check, filter, and moves of each kind the chip has."""

from typing import Final

from vbus.client import Bus, Units
from vbus.client.demo import Demo, Step
from vbus.client.lm628 import Lm628

_BOARD: Final = """\
[chips.x]
part = "LM629N-8"
clock = "8 MHz"
plant = "motor"

[plants.motor]
model = "dc_motor"
encoder_lines = 500
"""


def _host(bus: Bus) -> None:
    units = Units.of_clock(counts=2000, hz=8_000_000)
    axis = Lm628(bus)

    step = Step(bus, "check the reset as drivers do: 84h, then RSTI, then 80h")
    step.found("status", 0x80, axis.check_reset(), digits=2)

    step = Step(bus, "load the filter: kp 300, kd 2000")
    axis.load_filter(kp=300, kd=2000)
    step.found("command error", 0, axis.status() & 0x02)

    step = Step(bus, "move 5 turns forward, 6 turns/s at most")
    axis.move(10_000, acc=units.acceleration(30), vel=units.velocity(6))
    bus.delay("50ms")
    step.found("real position", 10_000, axis.rdrp(), tolerance=2)

    step = Step(bus, "move back with a breakpoint at 2500 counts on the way")
    axis.rsti(0x0000)
    axis.sbpa(2500)
    axis.load_trajectory(pos=-4000, start=True)
    axis.wait_status(0x40)
    at_breakpoint = axis.rdrp()
    axis.wait_status(0x04)
    bus.delay("50ms")
    # How far the motor is by now is the computer's business, not the chip's.
    step.found("counts short of the reported breakpoint", 0, max(0, at_breakpoint - 2500))
    step.found("real position", -4000, axis.rdrp(), tolerance=2)

    step = Step(bus, "velocity mode: 2 turns/s, doubled on the fly, then a smooth stop")
    axis.rsti(0x0000)
    axis.load_trajectory(vel=units.velocity(2), velocity_mode=True, start=True)
    bus.delay("400ms")
    axis.load_trajectory(vel=units.velocity(4), velocity_mode=True, start=True)
    bus.delay("400ms")
    step.found("desired velocity", units.velocity(4), axis.rddv())
    axis.stop("smoothly")
    axis.wait_status(0x04)
    bus.delay("50ms")
    step.found("real minus desired position", 0, axis.rdrp() - axis.rddp(), tolerance=2)

    step = Step(bus, "move home")
    axis.move(0, vel=units.velocity(6))
    bus.delay("50ms")
    step.found("real position", 0, axis.rdrp(), tolerance=2)


DEMO: Final = Demo(
    title="LM629 and a brushed DC motor",
    board=_BOARD,
    chip="x",
    shown={"desired": 15_000, "real": 15_000, "error": 20, "velocity": 8, "output": 1, "status": 0},
    host=_host,
    rest=(0,),
)
