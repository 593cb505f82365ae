"""A driver for one MCP-1200 with its lead filter and a limit switch, and its own test."""

FLAG, FEATURE, EXCEPTION, MODE, STATUS = 0x00, 0x01, 0x04, 0x05, 0x07
COMMAND, SAMPLE_TIMER, LEAD, RATES, FINAL = 0x0C, 0x0F, 0x20, 0x26, 0x29
LIMIT_OK, ABRUPT, REPORT = 0x80, 0x0B, 0x08


class Axis:
    """One axis."""

    def __init__(self, bus):
        self.bus = bus

    def write(self, register, *values):
        for n, value in enumerate(values):
            self.bus.write(register + n, value)

    def until(self, register, bits, level):
        """Wait for bits, a second at most."""
        for _ in range(1000):
            if self.bus.read(register) & bits == level:
                return
            self.bus.delay("1ms")
        raise TimeoutError("the bits do not come")

    def begin(self):
        self.until(FLAG, 2, 2)
        self.write(MODE, 0)
        self.bus.delay("1ms")
        self.until(FLAG, 2, 2)
        self.write(SAMPLE_TIMER, 0x3B)
        self.write(EXCEPTION, ABRUPT)
        self.write(FEATURE, 0x00)
        self.write(LEAD, 0xE5, 0x40, 60)
        self.write(COMMAND, 0, 0, 0)
        self.write(MODE, 3)
        self.until(FLAG, 2, 0)

    def move(self, final):
        """Return whether no switch has ended it."""
        self.write(RATES, 0x60, 0, 20)
        for n in (2, 1, 0):
            self.write(FINAL + n, final >> 8 * n & 0xFF)
        self.write(FLAG, 0x08)
        self.until(FLAG, 4, 0)
        self.bus.delay("60ms")
        return bool(self.bus.read(STATUS) & LIMIT_OK)

    def leave(self, final):
        """Go away from the switch, as the manual has it."""
        self.write(EXCEPTION, REPORT)
        self.move(final)
        self.write(STATUS, 0)
        self.until(STATUS, LIMIT_OK, LIMIT_OK)
        self.write(EXCEPTION, ABRUPT)

    def end(self):
        self.write(MODE, 1)
        self.until(FLAG, 2, 2)


def test_the_axis_comes_back_from_its_switch(mcp1200):
    axis = Axis(mcp1200.bus)
    axis.begin()
    assert axis.move(1000)
    assert not axis.move(4000)
    assert 2000 <= mcp1200.plant.count < 3000
    axis.leave(500)
    assert axis.move(0)
    assert abs(mcp1200.plant.count) <= 3
    axis.end()


BOARD = """
[chips.x]
part = "MCP-1200"
clock = "8 MHz"
plant = "slide"

[plants.slide]
model = "dc_motor"

[plants.slide.switches."limit+"]
first = 2000
last = 9000
"""
