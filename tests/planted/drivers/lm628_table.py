"""A driver for an LM628 with a 12-bit converter, by its client: jogs, slows down, recovers."""


def begin(axis):
    axis.reset()
    axis.bus.delay("2ms")
    axis.check_reset()
    axis.port12()
    axis.load_filter(kp=300, kd=2000)
    axis.lpes(200)


def slower(axis, mode, velocity):
    """Go on with another velocity, in 1/256 counts per sample."""
    axis.ltrj(mode | 0x08, velocity >> 8, velocity << 8 & 0xFF00)
    axis.stt()
    axis.bus.delay("20ms")


def stop(axis):
    axis.ltrj(0x0400)
    axis.stt()
    axis.wait_status(0x24)
    axis.bus.delay("100ms")
    return axis.rdrp()


def jog(axis, place):
    """Run forward until past a place, slow down there and stop; return where."""
    axis.rsti(0)
    axis.sbpa(place)
    axis.ltrj(0x1828, 0, 400, 4, 0)
    axis.stt()
    assert not axis.wait_status(0x60) & 0x20
    slower(axis, 0x1800, 0x200)
    return stop(axis)


def start(axis, place):
    axis.rsti(0)
    axis.ltrj(0x2A, 0, 400, 4, 0, place >> 16 & 0xFFFF, place & 0xFFFF)
    axis.stt()


def arrive(axis):
    status = axis.wait_status(0x24)
    axis.bus.delay("100ms")
    return not status & 0x20


def test_jog_and_home(lm628):
    axis = lm628.host
    begin(axis)
    assert 2000 < jog(axis, 2000) < 4000
    start(axis, 0)
    assert arrive(axis)
    assert abs(lm628.plant.count) <= 6


def test_a_move_is_slowed_down_and_held(lm628):
    axis = lm628.host
    begin(axis)
    start(axis, 5000)
    axis.bus.delay("100ms")
    slower(axis, 0, 0x200)
    slower(axis, 0, 0x100)
    assert 300 < stop(axis) < 4000


def test_a_stall_is_recovered_from(lm628):
    axis = lm628.host
    begin(axis)
    lm628.board.faults.arm("jam", when="position 1000", until="for 500 ms")
    start(axis, 5000)
    assert not arrive(axis)
    axis.bus.delay("600ms")
    start(axis, axis.rdrp())
    assert arrive(axis)
    start(axis, 0)
    assert arrive(axis)
    assert abs(lm628.plant.count) <= 6
