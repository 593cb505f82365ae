"""A driver for one LM629 that polls, and its own test, as docs/testing.md has them."""

RESET, PORT8, DFH, SIP = 0x00, 0x05, 0x02, 0x03
STT, UDF, RDRP, RDDP = 0x01, 0x04, 0x0A, 0x08
LFIL, LTRJ, RSTI, MSKI, LPES, SBPA = 0x1E, 0x1F, 0x1D, 0x1C, 0x1B, 0x20
BUSY, COMPLETE, ERROR, BREAKPOINT = 0x01, 0x04, 0x20, 0x40


class Axis:
    """One axis."""

    def __init__(self, bus):
        self.bus = bus

    def ready(self):
        """Wait until the chip is not busy."""
        for _ in range(100):
            if not self.bus.read(0) & BUSY:
                return
        raise TimeoutError("the chip stays busy")

    def command(self, code):
        self.ready()
        self.bus.write(0, code)

    def put(self, word):
        self.ready()
        self.bus.write(1, word >> 8 & 0xFF)
        self.bus.write(1, word & 0xFF)

    def put_long(self, value):
        self.put(value >> 16 & 0xFFFF)
        self.put(value & 0xFFFF)

    def get(self):
        self.ready()
        high = self.bus.read(1)
        return high << 8 | self.bus.read(1)

    def get_long(self):
        high = self.get()
        value = high << 16 | self.get()
        return value - (1 << 32) if value & 0x80000000 else value

    def begin(self):
        """Check that the chip has come out of its reset."""
        if self.bus.read(0) not in (0x84, 0xC4):
            raise RuntimeError("no reset")
        self.clear(0x7E)
        self.ready()
        if self.bus.read(0) not in (0x80, 0xC0):
            raise RuntimeError("RSTI has no effect")

    def clear(self, flags):
        self.command(RSTI)
        self.put(~flags & 0xFFFF)

    def filter(self, kp, ki, kd, il, ds=0):
        self.command(LFIL)
        self.put(ds << 8 | 0x0F)
        self.put(kp)
        self.put(ki)
        self.put(kd)
        self.put(il)
        self.command(UDF)

    def start(self, acc, vel, pos):
        self.command(LTRJ)
        self.put(0x002A)
        self.put_long(acc)
        self.put_long(vel)
        self.put_long(pos)
        self.command(STT)

    def wait(self, flag, longest=6000):
        """Wait for a flag, so many milliseconds at most."""
        for _ in range(longest):
            status = self.bus.read(0)
            if status & ERROR:
                raise RuntimeError("the axis does not follow")
            if status & flag:
                return
            self.bus.delay("1ms")
        raise TimeoutError("the move takes too long")

    def move(self, acc, vel, pos):
        self.clear(COMPLETE)
        self.start(acc, vel, pos)
        self.wait(COMPLETE)
        self.bus.delay("100ms")

    def limit(self, counts):
        self.command(LPES)
        self.put(counts)

    def breakpoint(self, pos):
        self.command(SBPA)
        self.put_long(pos)

    def run(self, acc, vel):
        """Go forward for ever."""
        self.command(LTRJ)
        self.put(0x1828)
        self.put_long(acc)
        self.put_long(vel)
        self.command(STT)

    def stop(self):
        self.clear(COMPLETE)
        self.command(LTRJ)
        self.put(0x0400)
        self.command(STT)
        self.wait(COMPLETE)

    def home(self):
        self.command(DFH)

    def position(self):
        self.command(RDRP)
        return self.get_long()


def test_moves_arrive(lm629):
    axis = Axis(lm629.bus)
    axis.begin()
    axis.filter(kp=300, ki=10, kd=2000, il=100)
    axis.limit(2000)
    axis.move(400, 4 << 16, 5000)
    assert abs(axis.position() - 5000) <= 6
    assert abs(lm629.plant.count - 5000) <= 6
    axis.move(1600, 12 << 16, -40000)
    assert abs(axis.position() + 40000) <= 6
    assert abs(lm629.plant.count + 40000) <= 6


def test_a_breakpoint_is_reached_and_the_axis_stops(lm629):
    axis = Axis(lm629.bus)
    axis.begin()
    axis.filter(kp=300, ki=10, kd=2000, il=100)
    axis.limit(2000)
    axis.breakpoint(3000)
    axis.run(400, 4 << 16)
    axis.wait(BREAKPOINT)
    assert abs(axis.position() - 3000) <= 30
    axis.clear(BREAKPOINT)
    axis.stop()
    lm629.clock.advance("200 ms")
    here = lm629.plant.count
    lm629.clock.advance("200 ms")
    assert abs(lm629.plant.count - here) <= 2
    axis.home()
    assert abs(axis.position()) <= 2
    axis.move(400, 2 << 16, 100)
    assert abs(lm629.plant.count - here - 100) <= 6
