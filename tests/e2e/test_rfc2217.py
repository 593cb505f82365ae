"""A board as a serial port of the network: pyserial's own RFC 2217 client."""

import socket
from collections.abc import Iterator

import pytest
import serial

from tests.e2e.serving import served
from vbus.board.build import load_board_text
from vbus.server.server import LinkSpec

# pyserial starts its thread in a way that Python will drop.
pytestmark = pytest.mark.filterwarnings("ignore:set(Daemon|Name):DeprecationWarning")

BOARD = """
board.time = "lockstep"
board.power_on = "done"
[chips.x]
part = "LM629N-8"
clock = "8 MHz"
plant = "none"
"""


@pytest.fixture
def place() -> Iterator[str]:
    with served(load_board_text(BOARD, "bench"), LinkSpec("rfc2217:0")) as server:
        url = server.urls[0]
        assert url.startswith("rfc2217:127.0.0.1:")
        yield url.removeprefix("rfc2217:")


def test_a_host_opens_it_as_a_serial_port(place: str) -> None:
    with serial.serial_for_url(f"rfc2217://{place}", 115_200, timeout=30) as port:
        port.write(b"\x10")
        assert port.read(2) == b"D\x84"
        assert port.baudrate == 115_200


def test_a_second_host_has_a_session_of_its_own(place: str) -> None:
    with (
        serial.serial_for_url(f"rfc2217://{place}", timeout=30) as one,
        serial.serial_for_url(f"rfc2217://{place}", timeout=30) as other,
    ):
        for port, number in ((one, b"\x01"), (other, b"\x02")):
            port.write(b"\x02" + number)
            assert port.read(2) == b"E" + number


def test_every_byte_value_passes_both_ways(place: str) -> None:
    values = bytes(range(256))
    with serial.serial_for_url(f"rfc2217://{place}", timeout=30) as port:
        for value in values:
            port.write(bytes([0x02, value]))
        assert port.read(512) == b"".join(b"E" + bytes([value]) for value in values)


def test_settings_and_lines_are_taken(place: str) -> None:
    with serial.serial_for_url(f"rfc2217://{place}", timeout=30) as port:
        port.baudrate = 19_200
        port.parity = serial.PARITY_EVEN
        port.stopbits = serial.STOPBITS_TWO
        port.dtr = False
        port.rts = False
        port.break_condition = True
        port.break_condition = False
        port.reset_input_buffer()
        port.write(b"\x02\x05")
        assert port.read(2) == b"E\x05"
        assert port.cts


def test_a_host_that_takes_nothing_stops_only_itself(place: str) -> None:
    host, _, number = place.rpartition(":")
    with socket.create_connection((host, int(number))) as lazy:
        lazy.setblocking(False)
        try:
            while True:
                lazy.send(b"\x02\x01" * 4096)
        except BlockingIOError:
            pass
        with serial.serial_for_url(f"rfc2217://{place}", timeout=30) as port:
            port.write(b"\x02\x09")
            assert port.read(2) == b"E\x09"
