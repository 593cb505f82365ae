"""A driver for one MCP-1200 that interpolates points and makes S-curves, and its own test."""

FLAG, FEATURE, CONFIG, CAPTURE, MODE = 0x00, 0x01, 0x02, 0x03, 0x05
PWM, COMMAND, ACTUAL, PRESET, SPAN = 0x09, 0x0C, 0x12, 0x15, 0x18
ACCELERATION, FINAL, MAX_ERROR, JERK, KP = 0x26, 0x29, 0x49, 0x54, 0x61


class Axis:
    """One axis."""

    def __init__(self, bus):
        self.bus = bus

    def write(self, register, *values):
        for n, value in enumerate(values):
            self.bus.write(register + n, value)

    def word(self, register, value):
        self.write(register + 1, value >> 8)
        self.write(register, value & 0xFF)

    def final(self, value):
        for n in (2, 1, 0):
            self.write(FINAL + n, value >> 8 * n & 0xFF)

    def until(self, register, bits, level):
        """Wait for bits, a second at most."""
        for _ in range(1000):
            if self.bus.read(register) & bits == level:
                return
            self.bus.delay("1ms")
        raise TimeoutError("the bits do not come")

    def begin(self):
        self.until(FLAG, 2, 2)
        self.write(CONFIG, 0x01)
        self.write(FEATURE, 0x18)
        self.write(KP, 72, 0, 80)
        self.word(MAX_ERROR, 500)
        self.write(PRESET, 0, 0, 0)
        self.write(COMMAND, 0, 0, 0)
        self.write(MODE, 3)
        self.until(FLAG, 2, 0)
        self.bus.delay("2ms")

    def curve(self, final):
        self.word(ACCELERATION, 0x60)
        self.word(JERK, 0x400)
        self.write(0x28, 20)
        self.final(final)
        self.write(FLAG, 0x08)
        self.until(FLAG, 4, 0)
        self.bus.delay("60ms")

    def follow(self, points):
        """Go through points, four samples each."""
        self.write(SPAN, 1)
        self.final(points[0])
        self.write(FLAG, 0x0B)
        for point in points[1:]:
            self.until(CAPTURE, 0x80, 0)
            self.final(point)
        self.until(CAPTURE, 0x80, 0)
        self.bus.delay("60ms")
        self.write(FLAG, 0x03)

    def position(self):
        low = self.bus.read(ACTUAL + 2)
        value = self.bus.read(ACTUAL) << 16 | self.bus.read(ACTUAL + 1) << 8 | low
        return value - (1 << 24) if value & 0x800000 else value

    def end(self):
        self.write(MODE, 1)
        self.until(FLAG, 2, 2)


def test_points_and_a_curve(mcp1200):
    axis = Axis(mcp1200.bus)
    axis.begin()
    axis.follow([20, 60, 100, 60, 20, 0])
    assert abs(axis.position()) <= 3
    axis.curve(2000)
    assert abs(axis.position() - 2000) <= 3
    axis.follow([1980, 2000])
    assert abs(axis.position() - 2000) <= 3
    axis.end()
