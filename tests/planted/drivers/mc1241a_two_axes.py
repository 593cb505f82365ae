"""A driver for both axes of an MC1241A by interrupts, with this project's client, and its test."""

from vbus.chips.mc1241a.host import Mc1241a
from vbus.client.blocking import blocking

COMPLETE, MOTION_ERROR = 0x01, 0x10


class Card:
    """Two axes whose ends of motion interrupt."""

    def __init__(self, bus):
        self.bus = bus
        self.chip = blocking(Mc1241a)(bus, checked=True)
        self.done = [False, False]

    def begin(self):
        for axis in (1, 2):
            self.chip.select(axis)
            self.chip.set_step_ratio(40)
            self.chip.set_buf_mtr_cmd(24000)
            self.chip.update()
            self.chip.set_intrpt_mask(COMPLETE | MOTION_ERROR)

    def load(self, axis, position):
        self.chip.select(axis)
        self.chip.set_pos(position)
        self.chip.set_vel(15 << 16)
        self.chip.set_acc(0x1000)

    def start(self):
        self.done = [False, False]
        self.chip.multi_update(3)

    def interrupt(self):
        """What the computer does when ~HostIntrpt has fallen."""
        status = self.chip.get_intrpt()
        if status & MOTION_ERROR:
            raise RuntimeError("an axis does not follow")
        if status & COMPLETE:
            self.done[status >> 12 & 1] = True
        self.chip.rst_intrpt(0xFFFF & ~COMPLETE)

    def wait(self, longest=300):
        for _ in range(longest):
            if not self.bus.read(1) & 0x40:
                self.interrupt()
            if all(self.done):
                return
            self.bus.delay("5ms")
        raise TimeoutError("an axis does not arrive")

    def position(self, axis):
        self.chip.select(axis)
        return self.chip.get_actl_pos()


def test_both_axes_arrive(mc1241a):
    card = Card(mc1241a.bus)
    card.begin()
    card.load(1, 4000)
    card.load(2, -2000)
    card.start()
    card.wait()
    assert abs(card.position(1) - 625) <= 3
    assert abs(card.position(2) + 312) <= 3
    card.load(1, 0)
    card.load(2, 1000)
    card.start()
    card.wait()
    assert abs(card.position(1)) <= 3
    assert abs(card.position(2) - 156) <= 3
