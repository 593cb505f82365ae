"""The host's side of ``vbus demo``: a separate process that knows nothing but its link.

``python -m vbus.tools.demo_host NAME LINK`` tells what it does on standard output, one JSON object
on each line: ``{"step": ...}`` when it begins something, ``{"done": ...}`` with what it expected
and what it found. The exit code is 0 if all went through, whether or not the results are right:
judging is the demonstration's business.
"""

import json
import os
import sys
from collections.abc import Callable
from typing import Final

from vbus.client import Bus, Units, connect
from vbus.client.lm628 import Lm628
from vbus.errors import VbusError


def tell(**what: object) -> None:
    """Print one line for the demonstration."""
    print(json.dumps(what), flush=True)


class Step:
    """One thing the host does, from its announcement to its result.

    Args:
        bus: gives chip time.
        title: what it is, for people.
    """

    def __init__(self, bus: Bus, title: str) -> None:
        self._bus: Bus = bus
        self._title: str = title
        self._began: int = bus.now()
        tell(step=title)

    def found(
        self, what: str, expected: int, found: int, tolerance: int = 0, byte: bool = False
    ) -> None:
        """Tell the result: a number the manual or the move prescribes, and the one read."""
        seconds = (self._bus.now() - self._began) * 1e-12
        tell(
            done=self._title, what=what, expected=expected, found=found, tolerance=tolerance,
            byte=byte, seconds=round(seconds, 6),
        )  # fmt: skip


def lm629(bus: Bus) -> None:
    """Check the reset, load a filter, and make moves of each kind the chip has."""
    units = Units.of_clock(counts=2000, hz=8_000_000)
    axis = Lm628(bus)

    step = Step(bus, "check the reset as drivers do: 84h, then RSTI, then 80h")
    step.found("status", 0x80, axis.check_reset(), byte=True)

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
    step.found("position when the breakpoint was seen", 2500, at_breakpoint, tolerance=100)
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


HOSTS: Final[dict[str, Callable[[Bus], None]]] = {"lm629": lm629}
"""What each demonstration's host does, by the demonstration's name."""


def main(name: str, link: str) -> int:
    """Do it; return the exit code."""
    try:
        with connect(link) as bus:
            chips = [f"{chip.name} ({chip.part})" for chip in bus.info.chips]
            tell(hello=link, pid=os.getpid(), chips=chips)
            HOSTS[name](bus)
    except VbusError as error:
        tell(failed=str(error))
        return 1
    tell(end=True)
    return 0


if __name__ == "__main__":
    sys.exit(main(*sys.argv[1:3]))
