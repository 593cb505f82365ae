"""A driver for an MC1241A by its client: an S-curve, then a velocity until a breakpoint."""

from vbus.client.mc1241a import Mc1241a

SPEED, ACC = 12 << 16, 0x1000


def begin(host):
    host.select(1)
    host.set_buf_mtr_cmd(24000)
    host.set_step_ratio(40)
    host.set_pos_err(200)
    host.update()


def curve(host, position):
    host.set_prfl_s_crv()
    host.set_pos(position)
    host.set_vel(SPEED)
    host.set_max_acc(ACC)
    host.set_jerk(1 << 22)
    host.update()
    assert not host.wait_event(0x91, "2s") & 0x90
    host.rst_status(0xFF00)


def run(host, until):
    """Go on at a velocity up to a position, and stop there by ramp."""
    host.set_prfl_vel()
    host.set_vel(SPEED)
    host.set_acc(ACC)
    host.set_start_vel(1 << 15)
    host.update()
    host.bus.delay("1ms")
    host.set_brk_pnt(until)
    host.set_pos_brk()
    host.smooth_stop()
    assert not host.wait_event(0x91, "2s") & 0x90
    host.rst_status(0xFF00)


def test_a_curve_and_a_run(mc1241a):
    host = Mc1241a(mc1241a.bus, checked=True)
    begin(host)
    curve(host, 4000)
    assert host.get_trgt_pos() == 4000
    run(host, 9000)
    assert host.get_trgt_pos() > 9000
    assert abs(host.get_actl_pos() - host.get_trgt_pos() * 40 // 256) <= 4
