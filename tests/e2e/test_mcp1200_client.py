"""The MCP-1200's calls against a served board, blocking and for asyncio, in lockstep."""

import asyncio
from pathlib import Path

import pytest

from tests.e2e.serving import served
from vbus.board.build import load_board_text
from vbus.client import aio, connect
from vbus.client.aio.mcp1200 import Mcp1200 as AioMcp1200
from vbus.client.mcp1200 import Mcp1200
from vbus.core.errors import NotReadyError
from vbus.serve.server import LinkSpec

BOARD = """\
[board]
name = "bench"
time = "lockstep"

[chips.x]
part = "MCP-1200"
clock = "8 MHz"
plant = "motor"

[plants.motor]
model = "ideal"
encoder_lines = 500
index_offset = 400
"""
LINK = "unix:$VBUS_RUNTIME/x.sock"


def test_reset_homing_a_trapezoid_and_an_s_curve(runtime: Path) -> None:
    with served(load_board_text(BOARD), LinkSpec(LINK, "byte")), connect(LINK) as bus:
        axis = Mcp1200(bus)
        axis.reset()
        assert axis.read_status() == 0xF8
        axis.feature(pid=True)
        axis.write_kp(64)
        axis.control()
        assert axis.home(velocity=0x0200, acceleration=0x20) == 400
        assert abs(axis.move(5000, velocity=0x0A00, acceleration=0x40) - 5000) <= 1
        assert abs(axis.move(-100, velocity=0x0A00, acceleration=0x40, jerk=0x0800) + 100) <= 1
        assert axis.read_command_position() == -100
        assert axis.read_decel_position() == -100 + axis.read_accel_delta() - 20
        axis.idle()
        with pytest.raises(NotReadyError, match="R00H is 03h after 5ms"):
            axis.move(50, velocity=0x100, acceleration=0x10, longest="5ms")


def test_the_same_for_asyncio(runtime: Path) -> None:
    async def session() -> tuple[int, int]:
        async with await aio.connect(LINK) as bus:
            axis = AioMcp1200(bus)
            await axis.reset()
            await axis.control()
            home = await axis.home(velocity=0x0200, acceleration=0x20)
            await axis.move(777, velocity=0x0A00, acceleration=0x40)
            await bus.delay("2ms")
            return home, await axis.read_actual_position()

    with served(load_board_text(BOARD), LinkSpec(LINK, "byte")):
        assert asyncio.run(session()) == (400, 777)
