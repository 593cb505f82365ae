"""The MCP-1200's calls: bytes in the manual's order, made from the register table."""

from collections.abc import Callable, Iterator
from pathlib import Path
from types import ModuleType

import pytest

from tests.unit.client.served import Served
from vbus.chips.mcp1200.datasheet import REGISTERS
from vbus.chips.tables import Register
from vbus.client import Bus, connect
from vbus.client.aio import access
from vbus.client.aio.access import calls_of
from vbus.client.blocking import blocking
from vbus.client.mcp1200 import POSITION_INTERPOLATION, PROFILE, Mcp1200, Mcp1200Calls
from vbus.core.errors import NotReadyError


@pytest.fixture
def board(tmp_path: Path) -> Iterator[Served]:
    with Served("unix", tmp_path) as board:
        yield board


@pytest.fixture
def bus(board: Served) -> Iterator[Bus]:
    with connect(board.where) as bus:
        yield bus


@pytest.fixture
def axis(bus: Bus) -> Mcp1200:
    return Mcp1200(bus, "x")


def writes(board: Served) -> list[tuple[int, int]]:
    """Return address and data of the writes so far."""
    return [(call[1], call[2]) for call in board.port.calls if call[0] == "write"]  # type: ignore[misc]


def reads(board: Served) -> list[object]:
    return [call[1] for call in board.port.calls if call[0] == "read"]


def test_every_register_has_its_calls_and_every_call_a_register() -> None:
    calls = {name for name in vars(Mcp1200Calls) if not name.startswith("_")}
    expected = {f"read_{row.name.lower()}" for row in REGISTERS}
    expected |= {f"write_{row.name.lower()}" for row in REGISTERS if row.access != "r"}
    assert calls == expected


@pytest.mark.parametrize(
    ("call", "written"),
    [
        (
            lambda axis: axis.write_command_position(0x123456),
            [(0x0C, 0x12), (0x0D, 0x34), (0x0E, 0x56)],
        ),
        (lambda axis: axis.write_final_position(-2), [(0x2B, 0xFF), (0x2A, 0xFF), (0x29, 0xFE)]),
        (lambda axis: axis.write_acceleration(0x0180), [(0x27, 0x01), (0x26, 0x80)]),
        (lambda axis: axis.set_flag(PROFILE), [(0x00, 0x08)]),
        (lambda axis: axis.clear_flag(POSITION_INTERPOLATION), [(0x00, 0x03)]),
        (lambda axis: axis.halt(), [(0x05, 0x02)]),
    ],
)  # fmt: skip
def test_a_value_is_written_most_significant_byte_first(
    axis: Mcp1200, board: Served, call: Callable[[Mcp1200], None], written: list[tuple[int, int]]
) -> None:
    call(axis)
    axis.bus.echo()
    assert writes(board) == written


def test_a_value_is_read_least_significant_byte_first_in_one_message(
    axis: Mcp1200, board: Served
) -> None:
    board.port.answers = {0x12: [0xFF], 0x13: [0xFF], 0x14: [0xFE]}
    board.messages.clear()
    assert axis.read_actual_position() == -2
    assert reads(board) == [0x14, 0x13, 0x12]
    assert len(board.messages) == 1


def test_extended_addressing_is_switched_on_once_where_it_is_needed(
    axis: Mcp1200, board: Served
) -> None:
    board.port.answers = {0x02: [0x40]}
    axis.write_lead_gain(1)
    axis.write_kp(7)
    axis.write_kd(8)
    axis.bus.echo()
    assert writes(board) == [(0x22, 1), (0x02, 0x41), (0x61, 7), (0x63, 8)]
    axis.write_config(0x00)
    axis.read_kv()
    assert writes(board)[-2:] == [(0x02, 0x00), (0x02, 0x41)]


def test_features_are_switched_by_name(axis: Mcp1200, board: Served) -> None:
    board.port.answers = {0x01: [0x14]}
    axis.feature(pid=True, unipolar=False)
    axis.bus.echo()
    assert writes(board) == [(0x01, 0x18)]
    with pytest.raises(ValueError, match=r"no feature 'pdi'; there are unipolar, pid, s_curve"):
        axis.feature(pdi=True)


@pytest.mark.parametrize("value", [0x1000000, -0x800001])
def test_a_value_that_does_not_fit_is_refused(axis: Mcp1200, value: int) -> None:
    with pytest.raises(ValueError, match=f"{value} does not fit into 24 bits"):
        axis.write_final_position(value)


def test_waiting_gives_up_after_the_time_given(axis: Mcp1200, board: Served) -> None:
    board.port.answers = {0x00: [0x01]}
    with pytest.raises(NotReadyError, match=r"R00H is 01h after 2ms; of the bits 02h, 02h must"):
        axis.wait_flags(2, 2, "2ms")


def test_the_calls_follow_the_rows(bus: Bus, board: Served) -> None:
    sheet = ModuleType("made.datasheet")
    sheet.__dict__["REGISTERS"] = (
        Register("SPEED", (0x41, 0x40), signed=True, fraction=8, clause="X-1", title="Speed"),
        Register("COUNT", (0x10,), access="r", clause="X-2", title="Count"),
    )
    calls = blocking(calls_of("Made", access.RegisterCycles, sheet))
    board.port.answers = {0x40: [0xFE], 0x41: [0xFF]}
    assert calls(bus).read_speed() == -2
    calls(bus).write_speed(-3)
    bus.echo()
    assert writes(board) == [(0x41, 0xFF), (0x40, 0xFD)]
    assert calls.read_speed.__doc__.endswith("Returns 16 bits, two's complement, in 1/256.")
    assert calls.read_count.__doc__.startswith("Read Count (R10H, X-2).")
    assert not hasattr(calls, "write_count")
