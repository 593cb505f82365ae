"""A driver for an LM629 by its client: softer gains from a breakpoint before the target on."""

ONE = 1 << 16


def begin(axis):
    axis.check_reset()
    axis.load_filter(kp=300, ki=20, kd=2000, il=500, ds=1)
    axis.lpei(2000)


def move(axis, way):
    """Go a way, with softer gains on the last 500 counts; return where they began."""
    axis.rsti(0xFF83)
    axis.ltrj(0x2B, 0, 400, 4, 0, way >> 16 & 0xFFFF, way & 0xFFFF)
    axis.stt()
    axis.bus.delay("1ms")
    axis.sbpr(-500)
    assert not axis.wait_status(0x64) & 0x24
    begun = axis.rdrp()
    axis.lfil(0x010A, 150, 1500)
    axis.udf()
    assert not axis.wait_status(0x24) & 0x20
    axis.bus.delay("100ms")
    return begun


def release(axis):
    """Turn the motor off, at rest."""
    axis.ltrj(0x0100)
    axis.stt()


def test_the_last_counts_are_soft(lm629):
    axis = lm629.host
    begin(axis)
    assert abs(move(axis, 3000) - 2500) <= 40
    assert abs(axis.rdrp() - 3000) <= 8
    assert abs(move(axis, 2000) - 4500) <= 40
    assert abs(lm629.plant.count - 5000) <= 8
    release(axis)
