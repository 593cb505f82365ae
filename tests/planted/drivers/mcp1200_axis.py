"""A driver for one MCP-1200, register by register, and its own test."""

FLAG, FEATURE, CONFIG, MODE, STATUS = 0x00, 0x01, 0x02, 0x05, 0x07
COMMAND, SAMPLE_TIMER, ACTUAL, PRESET = 0x0C, 0x0F, 0x12, 0x15
ACCELERATION, VELOCITY, FINAL = 0x26, 0x28, 0x29
KP, KI, KD, VELOCITY_COMMAND = 0x61, 0x62, 0x63, 0x3C
F0, F1, F2, F5 = 0x01, 0x02, 0x04, 0x20


class Axis:
    """One axis."""

    def __init__(self, bus):
        self.bus = bus

    def write(self, register, value):
        self.bus.write(register, value & 0xFF)

    def read(self, register):
        return self.bus.read(register)

    def write_down(self, register, value, size):
        """Write a number, most significant byte first, at rising addresses."""
        for n in range(size):
            self.write(register + n, value >> 8 * (size - 1 - n))

    def write_up(self, register, value, size):
        """Write a number, least significant byte first, at rising addresses."""
        for n in range(size):
            self.write(register + n, value >> 8 * n)

    def flags(self, bits, level, longest=4000):
        """Wait for flags, so many milliseconds at most."""
        for _ in range(longest):
            if self.read(FLAG) & bits == level:
                return
            self.bus.delay("1ms")
        raise TimeoutError("the flags do not come")

    def begin(self, kp, ki, kd):
        """Reset, load the filter, close the loop where the axis stands."""
        self.write(MODE, 0)
        self.bus.delay("1ms")
        self.flags(F1, F1)
        self.write(CONFIG, 0x01)
        self.write(FEATURE, 0x08)
        self.write(KP, kp)
        self.write(KI, ki)
        self.write(KD, kd)
        self.write(SAMPLE_TIMER, 0x40)
        self.write_down(PRESET, 0, 3)
        self.write_down(COMMAND, 0, 3)
        self.write(MODE, 3)
        self.flags(F1, 0)
        self.bus.delay("5ms")

    def end(self):
        self.write(MODE, 1)
        self.flags(F1, F1)

    def position(self):
        low = self.read(ACTUAL + 2)
        value = self.read(ACTUAL) << 16 | self.read(ACTUAL + 1) << 8 | low
        return value - (1 << 24) if value & 0x800000 else value

    def move(self, acceleration, velocity, final):
        self.write_up(ACCELERATION, acceleration, 2)
        self.write(VELOCITY, velocity)
        self.write_up(FINAL, final, 3)
        self.write(FLAG, 8)
        self.flags(F2, 0)
        self.bus.delay("60ms")

    def run(self, acceleration, velocity):
        """Go on at a velocity, counts per sample."""
        self.write_up(ACCELERATION, acceleration, 2)
        self.write(VELOCITY_COMMAND, velocity)
        self.write(FLAG, 8 + 5)

    def stop(self):
        self.write(VELOCITY_COMMAND, 0)
        self.flags(F2, 0)
        self.write(FLAG, 5)
        self.bus.delay("60ms")

    def errors(self):
        """Return the error bits, 1 where one is set, and clear them."""
        found = ~self.read(STATUS) & 0xF8
        self.write(STATUS, 0)
        return found


def test_moves_arrive(mcp1200):
    axis = Axis(mcp1200.bus)
    axis.begin(kp=72, ki=0, kd=80)
    axis.move(0x18, 10, 12000)
    assert abs(axis.position() - 12000) <= 3
    assert abs(mcp1200.plant.count - 12000) <= 3
    axis.move(0x80, 30, -40000)
    assert abs(axis.position() + 40000) <= 3
    assert abs(mcp1200.plant.count + 40000) <= 3
    assert not axis.errors()
    axis.end()


def test_the_axis_runs_at_a_velocity_and_stops(mcp1200):
    axis = Axis(mcp1200.bus)
    axis.begin(kp=72, ki=0, kd=80)
    axis.run(0x40, 4)
    mcp1200.clock.advance("300 ms")
    assert axis.position() > 1000
    axis.stop()
    here = axis.position()
    mcp1200.clock.advance("50 ms")
    assert abs(axis.position() - here) <= 1
    assert not axis.errors()
    axis.end()
