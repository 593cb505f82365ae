"""The MC1241A's calls: packets word by word, checksums, and the calls made from the table."""

from collections.abc import Callable, Iterator
from pathlib import Path

import pytest

from tests.unit.client.served import Served
from tests.unit.fake_port import FakePort
from vbus.chips.mc1241a.datasheet import COMMANDS
from vbus.client import Bus, connect
from vbus.client.mc1241a import Mc1241a, Mc1241aCalls
from vbus.core.errors import ChecksumError, NotReadyError


@pytest.fixture
def board(tmp_path: Path) -> Iterator[Served]:
    with Served("unix", tmp_path) as board:
        board.port.answers = {1: [0xFF]}
        yield board


@pytest.fixture
def bus(board: Served) -> Iterator[Bus]:
    with connect(board.where) as bus:
        yield bus


@pytest.fixture(params=["poll", "wait"])
def chip(request: pytest.FixtureRequest, bus: Bus) -> Mc1241a:
    return Mc1241a(bus, "x", ready=request.param)


def packet(port: FakePort) -> list[tuple[object, ...]]:
    """Return the writes and data reads so far."""
    return [call for call in port.calls if call[0] == "write" or call == ("read", 0)]


def command(code: int, *words: int) -> list[tuple[object, ...]]:
    calls: list[tuple[object, ...]] = [("write", 1, code)]
    for word in words:
        calls += [("write", 0, word >> 8), ("write", 0, word & 0xFF)]
    return calls


def test_every_command_has_a_call_and_every_call_a_command() -> None:
    calls = {name for name in vars(Mc1241aCalls) if not name.startswith("_")}
    assert calls == {row.name.lower() for row in COMMANDS}


@pytest.mark.parametrize(
    ("call", "written"),
    [
        (lambda chip: chip.update(), command(0x1A)),
        (lambda chip: chip.set_pos(1234567), command(0x10, 0x0012, 0xD687)),
        (lambda chip: chip.set_ratio(-746455), command(0x14, 0xFFF4, 0x9C29)),
        (lambda chip: chip.set_mtr_cmd(-2), command(0x62, 0xFFFE)),
        (lambda chip: chip.rst_intrpt(0x00EF), command(0x32, 0x00EF)),
        (lambda chip: chip.profile("trap"), command(0x09)),
        (lambda chip: chip.profile("vel"), command(0x0A)),
        (lambda chip: chip.profile("s_crv"), command(0x0B)),
        (lambda chip: chip.profile("gear"), command(0x0C)),
        (
            lambda chip: chip.load(pos=1, vel=2, acc=3, max_acc=4, jerk=5, ratio=6, mtr_cmd=7),
            command(0x10, 0, 1) + command(0x11, 0, 2) + command(0x12, 0, 3) + command(0x15, 4)
            + command(0x13, 0, 5) + command(0x14, 0, 6) + command(0x77, 7),
        ),
    ],
)  # fmt: skip
def test_a_call_writes_its_packet_high_byte_first(
    chip: Mc1241a, board: Served, call: Callable[[Mc1241a], None], written: list[object]
) -> None:
    call(chip)
    chip.bus.echo()
    assert packet(board.port) == written


def test_values_are_read_signed_or_unsigned_as_the_table_says(chip: Mc1241a, board: Served) -> None:
    board.port.answers[0] = [0xFF, 0xFE, 0x00, 0x00]
    assert chip.get_trgt_vel() == -(2 << 16)
    board.port.answers[0] = [0x9A, 0x0B]
    assert chip.get_vrsn() == 0x9A0B


def test_selecting_an_axis_returns_its_status(chip: Mc1241a, board: Served) -> None:
    board.port.answers[0] = [0x13, 0x00]
    assert chip.select(2) == 0x1300
    assert packet(board.port)[0] == ("write", 1, 0x02)


def test_host_rdy_is_polled_in_d7_before_every_access(bus: Bus, board: Served) -> None:
    board.port.answers[1] = [0x7F, 0xFF, 0x40, 0x80]
    Mc1241a(bus).set_pos_err(0x0102)
    bus.echo()
    assert board.port.calls == [
        ("read", 1), ("read", 1), ("write", 1, 0x29), ("read", 1), ("read", 1),
        ("write", 0, 1), ("write", 0, 2),
    ]  # fmt: skip


@pytest.mark.parametrize("ready", ["poll", "wait"])
def test_checksums_are_read_and_compared(bus: Bus, board: Served, ready: str) -> None:
    chip = Mc1241a(bus, "x", ready=ready, checked=True)
    board.port.answers[0] = [0xB9, 0x85]
    chip.set_vel(0xFEDCBA98)
    board.port.answers[0] = [0x4A, 0x0B, 0x4A, 0x77]
    assert chip.get_vrsn() == 0x4A0B
    board.port.answers[0] = [0x00, 0x00]
    with pytest.raises(ChecksumError, match=r"^packet 1Ah: checksum 0000h, expected 001Ah$"):
        chip.update()
    chip.reset()  # has none


def test_waiting_for_an_event_lets_chip_time_pass(bus: Bus, board: Served) -> None:
    board.port.answers[0] = [0x07, 0x00, 0x07, 0x00, 0x03, 0x01]
    assert Mc1241a(bus).wait_event(0x01, every="2ms") == 0x0301
    assert [call for call in board.port.calls if call[0] == "delay"] == [("delay", 2 * 10**9)] * 2
    board.port.answers[0] = [0x00]
    with pytest.raises(
        NotReadyError, match=r"^status 0000h after 5ms; none of the bits 01h is set$"
    ):
        Mc1241a(bus).wait_event(0x01, longest="5ms")


def test_a_move_clears_the_event_loads_updates_and_waits(chip: Mc1241a, board: Served) -> None:
    board.port.answers[0] = [0x03, 0x01, 0x00, 0x00, 0x00, 0x64]
    assert chip.move(100, vel=2, acc=1) == 100
    writes = [call for call in packet(board.port) if call[0] == "write"]
    assert writes == (
        command(0x34, 0x00FE) + command(0x10, 0, 100) + command(0x11, 0, 2)
        + command(0x12, 0, 1) + command(0x1A) + command(0x31) + command(0x37)
    )  # fmt: skip


@pytest.mark.parametrize(
    ("call", "message"),
    [
        (lambda chip: chip.select(3), "axis 3: allowed are 1 and 2"),
        (lambda chip: chip.profile("fast"), "profile 'fast': allowed are trap, vel, s_crv, gear"),
        (lambda chip: chip.set_pos(1 << 32), "4294967296 does not fit into 32 bits"),
        (lambda chip: chip.set_mtr_cmd(1 << 16), "65536 does not fit into 16 bits"),
    ],
)
def test_a_value_out_of_range_is_refused_before_anything_is_written(
    chip: Mc1241a, board: Served, call: Callable[[Mc1241a], None], message: str
) -> None:
    with pytest.raises(ValueError, match=r".") as caught:
        call(chip)
    assert str(caught.value) == message
    chip.bus.echo()
    assert packet(board.port) == []
