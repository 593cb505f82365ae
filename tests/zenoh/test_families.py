"""Every family's own client works over the network."""

from pathlib import Path

import pytest

from tests.e2e.serving import served
from vbus.board.build import build
from vbus.board.config import read_board_text
from vbus.client import connect
from vbus.client.mc1241a import Mc1241a
from vbus.client.mcp1200 import Mcp1200
from vbus.serve.server import LinkSpec

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
def test_the_clients_of_the_other_families_hear_what_they_hear_on_a_terminal(
    part: str, clock: str, plants: str, runtime: Path
) -> None:
    heard = []
    for entry, link in (("zenoh:", "zenoh:bench/x"), (f"pty:{runtime}/p", f"pty:{runtime}/p")):
        made = build(*read_board_text(BOARD.format(part, clock, plants)))
        with served(made, LinkSpec(entry)), connect(link) as bus:
            if part == "MC1241A":
                pmd = Mc1241a(bus, "x")
                pmd.set_pos(123456)
                assert pmd.get_pos() == 123456
                heard.append((pmd.get_pos(), bus.now()))
            else:
                mcp = Mcp1200(bus, "x")
                mcp.idle()
                mcp.write_command_position(0x1234)
                heard.append((mcp.read_command_position(), mcp.read_flag(), bus.now()))
    assert heard[0] == heard[1]
