"""A plant that is wrong, or a motor that nobody builds, is no endless search for a chip."""

import pytest

from vbus.board.build import load_board_text
from vbus.core.kernel import MS
from vbus.core.signals import Switch
from vbus.plant.dc_motor import DcMotor
from vbus.plant.ideal import IdealPlant
from vbus.plant.response import Motor

MOST = 10_000


class Stuck(IdealPlant):
    """Finds an index where it starts, time and again, as a plug-in's plant may."""

    asked = 0

    def index_between(self, start: int, end: int) -> tuple[bool, int]:
        self.asked += 1
        assert self.asked < MOST, "asked without end"
        return start != end, start


class StuckSwitch(Switch):
    """Changes where the way begins."""

    def change_between(self, start: int, end: int) -> tuple[bool, int]:
        return start != end, start


BOARDS = {
    "LM629N-8": (
        (0, 0x1E), (1, 0, 0x08, 0, 60), (0, 0x04), (0, 0x03), (0, 0x1F),
        (1, 0x18, 0x28, 0, 0, 7, 0xD0, 0, 4, 0, 0), (0, 0x01),
    ),
    "MCP-1200": ((1, 8), (0x26, 0x10), (0x3C, 2), (5, 3), (0, 0x0D)),
}  # fmt: skip


@pytest.mark.core("interpreted")  # a compiled plant takes no interpreted subclass
@pytest.mark.parametrize("part", BOARDS)
def test_an_edge_that_is_found_where_the_way_begins_is_passed_over(part: str) -> None:
    board = load_board_text(
        f'[board]\nname = "b"\ntime = "lockstep"\npower_on = "done"\n[chips.x]\npart = "{part}"\n'
        'clock = "8 MHz"\nplant = "m"\n[plants.m]\nmodel = "ideal"\n'
    )
    chip, plant = board.chips[0], Stuck()
    plant.switches["home"] = StuckSwitch(5, 9)
    chip.connect(0, plant)
    board.power_on(True)
    port = board.open_port("h")
    for address, *data in BOARDS[part]:
        for number, byte in enumerate(data):
            if number % 2 == 0:
                port.wait(5 * MS)
            port.write(address, byte)
    board.run_for(50 * MS)
    board.catch_up()
    assert plant.count != 0
    assert plant.asked > 0


def test_a_motor_that_swings_faster_than_any_is_followed_in_so_many_spans() -> None:
    motor = Motor(5.0, 5e-4, 6e11, 0.1, 5e-6, 3e-4, 1000.0)
    assert motor.response(256e-6).coarsest == 12
    made = DcMotor({"torque_constant": 6e11, "back_emf": 0.1, "stop_low": -5, "stop_high": 5})
    made.prepare(256e-6)
    assert -5 <= made.drive(1.0, 0) <= 5
