"""A driver for two LM629 whose HI pins interrupt, with this project's client, and its test."""

from vbus.chips.lm628.host import Lm628
from vbus.client.blocking import blocking

COMPLETE, ERROR = 0x04, 0x20


class Machine:
    """Two axes that move together."""

    def __init__(self, bus):
        self.bus = bus
        self.axes = [blocking(Lm628)(bus, name) for name in ("x", "y")]

    def begin(self):
        for axis in self.axes:
            axis.check_reset()
            axis.load_filter(kp=300, kd=2000)
            axis.lpes(2000)
            axis.mski(COMPLETE | ERROR)

    def move(self, x, y):
        """Load both axes, then start both."""
        for axis, target in zip(self.axes, (x, y), strict=True):
            axis.load_trajectory(acc=400, vel=4 << 16, pos=target)
        for axis in self.axes:
            axis.rsti(~COMPLETE & 0xFFFF)
            axis.stt()
        self.wait()

    def wait(self, longest=2000):
        waiting = {"x", "y"}
        for _ in range(longest):
            for name, axis in zip("xy", self.axes, strict=True):
                if name in waiting and self.bus.getpin(f"{name}.HI"):
                    self.interrupt(axis)
                    waiting.discard(name)
            if not waiting:
                self.bus.delay("100ms")
                return
            self.bus.delay("1ms")
        raise TimeoutError(f"no interrupt of {' and '.join(sorted(waiting))}")

    def interrupt(self, axis):
        """What the computer does when HI is high."""
        axis.wait_ready()
        if axis.status() & ERROR:
            raise RuntimeError("an axis does not follow")
        axis.rsti(~COMPLETE & 0xFFFF)

    def positions(self):
        return [axis.rdrp() for axis in self.axes]


def test_both_axes_arrive(board):
    machine = Machine(board.bus)
    machine.begin()
    machine.move(3000, -1500)
    assert machine.positions() == [within(3000), within(-1500)]
    machine.move(0, 2000)
    assert machine.positions() == [within(0), within(2000)]
    assert board.board.axes["x.1"].count == within(0)
    assert board.board.axes["y.1"].count == within(2000)


def within(number):
    import pytest

    return pytest.approx(number, abs=6)


BOARD = """
[board]
time = "lockstep"
[chips.x]
part = "LM629N-8"
clock = "8 MHz"
plant = "x"
[chips.y]
part = "LM629N-8"
clock = "8 MHz"
plant = "y"
[plants.x]
model = "dc_motor"
[plants.y]
model = "dc_motor"
"""
