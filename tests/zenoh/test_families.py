"""Every family's own client works over the network."""

import pytest

from tests.e2e.serving import served
from vbus.board.build import build
from vbus.board.config import read_board_text
from vbus.client import connect
from vbus.client.mc1241a import Mc1241a
from vbus.client.mcp1200 import Mcp1200
from vbus.server.server import LinkSpec

BOARD = """
[board]
name = "bench"
time = "lockstep"
power_on = "done"
[chips.x]
part = "{}"
clock = "{}"
{}
"""


@pytest.mark.parametrize(
    ("part", "clock", "plants"),
    [
        ("MC1241A", "25 MHz", 'plants = ["none", "none"]'),
        ("MCP-1200", "2 MHz", 'plant = "none"'),
    ],
)
def test_the_clients_of_the_other_families_work_over_the_network(
    part: str, clock: str, plants: str
) -> None:
    made = build(*read_board_text(BOARD.format(part, clock, plants)))
    with served(made, LinkSpec("zenoh:")), connect("zenoh:bench/x") as bus:
        if part == "MC1241A":
            pmd = Mc1241a(bus, "x")
            pmd.set_pos(123456)
            assert pmd.get_pos() == 123456
        else:
            mcp = Mcp1200(bus, "x")
            mcp.idle()
            mcp.write_command_position(0x1234)
            assert mcp.read_command_position() == 0x1234
