"""The MC1241A's calls against a served chip set with stepper motors, in lockstep."""

from collections.abc import Iterator
from pathlib import Path

import pytest

from tests.e2e.serving import served
from vbus.board.build import load_board_text
from vbus.client import connect
from vbus.client.mc1241a import Mc1241a
from vbus.serve.server import LinkSpec

BOARD = """\
[board]
name = "two-axes"
time = "lockstep"

[chips.m]
part = "MC1241A"
clock = "25 MHz"
plants = ["x", "y"]

[plants.x]
model = "stepper"
encoder_lines = 500

[plants.y]
model = "stepper"
encoder_lines = 500
"""
QUARTER = 3200
"""Microsteps in a quarter of a turn."""


@pytest.fixture(params=["poll", "wait"])
def chip(request: pytest.FixtureRequest, runtime: Path) -> Iterator[Mc1241a]:
    link = LinkSpec("unix:$VBUS_RUNTIME/m.sock", "byte")
    with (
        served(load_board_text(BOARD), link) as server,
        connect(server.statistics()["links"][0]["url"]) as bus,
    ):
        yield Mc1241a(bus, "m", ready=request.param, checked=True)


def test_two_axes_move_and_every_checksum_is_right(chip: Mc1241a) -> None:
    assert chip.get_vrsn() == 0x4A10
    for axis in (1, 2):
        chip.select(axis)
        chip.set_phase_2()
        chip.set_step_ratio(40)
        chip.load(vel=20 << 16, acc=1 << 15, pos=QUARTER * axis, mtr_cmd=24_000)
    chip.multi_update(3)
    for axis in (1, 2):
        assert chip.select(axis) & 0x3000 == 0x1000 * (axis - 1)
        chip.wait_event()
        chip.bus.delay("50ms")
        assert abs(chip.get_actl_pos() - 500 * axis) <= 3
        assert chip.get_trgt_pos() == QUARTER * axis
    assert abs(chip.move(0)) <= 20  # the rotor is still swinging in
    assert chip.get_status() & 0x0010 == 0
