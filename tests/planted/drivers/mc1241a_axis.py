"""A driver for the first axis of an MC1241A, packet by packet, and its own test."""

SET_1, SET_2, SET_TRAP, SET_VEL_MODE = 0x01, 0x02, 0x09, 0x0A
SET_POS, SET_VEL, SET_ACC, UPDATE = 0x10, 0x11, 0x12, 0x1A
GET_STATUS, CLR_STATUS, RST_STATUS, GET_ACTL_POS, GET_TRGT_POS = 0x31, 0x33, 0x34, 0x37, 0x1D
SET_MTR_CMD, SET_BUF_MTR_CMD, MTR_ON, MTR_OFF = 0x62, 0x77, 0x43, 0x42
SMOOTH_STOP, STOP, SET_STEP_RATIO, SET_POS_ERR, GET_VRSN = 0x4E, 0x46, 0x68, 0x29, 0x6C
SYNCH_PRFL, ZERO = 0x47, 0x00
COMPLETE, MOTION_ERROR, COMMAND_ERROR = 0x01, 0x10, 0x80


class Axis:
    """One axis."""

    def __init__(self, bus):
        self.bus = bus

    def ready(self):
        for _ in range(1000):
            if self.bus.read(1) & 0x80:
                return
            self.bus.delay("20us")
        raise TimeoutError("HostRdy does not come")

    def command(self, code, *words):
        self.ready()
        self.bus.write(1, code)
        sum_ = code
        for word in words:
            self.put(word)
            sum_ += word
        return sum_

    def put(self, word):
        self.ready()
        self.bus.write(0, word >> 8 & 0xFF)
        self.bus.write(0, word & 0xFF)

    def get(self):
        self.ready()
        high = self.bus.read(0)
        return high << 8 | self.bus.read(0)

    def check(self, sum_):
        """Compare the chip's checksum with that of the packet."""
        if self.get() != sum_ & 0xFFFF:
            raise RuntimeError("the checksum is wrong")

    def set(self, code, *words):
        self.check(self.command(code, *words))

    def set_long(self, code, value):
        self.set(code, value >> 16 & 0xFFFF, value & 0xFFFF)

    def get_word(self, code):
        sum_ = self.command(code)
        word = self.get()
        self.check(sum_ + word)
        return word

    def get_long(self, code):
        sum_ = self.command(code)
        high = self.get()
        low = self.get()
        self.check(sum_ + high + low)
        value = high << 16 | low
        return value - (1 << 32) if value & 0x80000000 else value

    def select(self):
        self.get_word(SET_1)

    def begin(self, power, ratio):
        self.ready()
        self.select()
        self.set(SET_TRAP)
        self.set(SET_BUF_MTR_CMD, power)
        self.set(UPDATE)
        self.set(SET_STEP_RATIO, ratio)
        self.set(SET_POS_ERR, 200)
        self.set(RST_STATUS, 0)

    def status(self):
        return self.get_word(GET_STATUS)

    def wait(self, longest=400):
        for _ in range(longest):
            status = self.status()
            if status & (MOTION_ERROR | COMMAND_ERROR):
                raise RuntimeError(f"status {status:04X}")
            if status & COMPLETE:
                return
            self.bus.delay("10ms")
        raise TimeoutError("the move takes too long")

    def move(self, position, velocity, acceleration):
        self.set(RST_STATUS, 0xFFFF & ~COMPLETE)
        self.set_long(SET_POS, position)
        self.set_long(SET_VEL, velocity)
        self.set_long(SET_ACC, acceleration)
        self.set(UPDATE)
        self.wait()

    def run(self, velocity, acceleration):
        self.set(SET_VEL_MODE)
        self.set_long(SET_VEL, velocity)
        self.set_long(SET_ACC, acceleration)
        self.set(UPDATE)

    def stop(self):
        self.set(RST_STATUS, 0xFFFF & ~COMPLETE)
        self.set(SMOOTH_STOP)
        self.set(UPDATE)
        self.wait()

    def off(self):
        self.set(MTR_OFF)

    def position(self):
        return self.get_long(GET_ACTL_POS)

    def target(self):
        return self.get_long(GET_TRGT_POS)


def test_moves_arrive(mc1241a):
    axis = Axis(mc1241a.bus)
    axis.begin(power=24000, ratio=RATIO)
    axis.move(6000, 15 << 16, 0x1000)
    assert axis.target() == 6000
    assert abs(axis.position() - 6000 * RATIO // 256) <= 4
    assert abs(mc1241a.plant.count - 6000 * RATIO // 256) <= 4
    axis.move(-4000, 15 << 16, 0x1000)
    assert axis.target() == -4000
    assert abs(axis.position() + 4000 * RATIO // 256) <= 4
    axis.off()


def test_the_axis_runs_and_stops(mc1241a):
    axis = Axis(mc1241a.bus)
    axis.begin(power=24000, ratio=RATIO)
    axis.run(12 << 16, 0x1000)
    mc1241a.clock.advance("200 ms")
    assert axis.target() > 3000
    assert not axis.status() & 0x90
    axis.stop()
    here = axis.target()
    mc1241a.clock.advance("50 ms")
    assert axis.target() == here
    axis.off()


RATIO = 40
