"""A board as a serial port of the network: pyserial's own RFC 2217 client."""

import socket
from collections.abc import Iterator
from contextlib import suppress

import pytest
import serial

from tests.e2e.serving import served
from vbus.board.build import load_board_text
from vbus.serve.server import LinkSpec

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
    with serial.serial_for_url(f"rfc2217://{place}?timeout=60", 115_200, timeout=60) as port:
        port.write(b"\x10")
        assert port.read(2) == b"D\x84"
        assert port.baudrate == 115_200


def test_a_second_host_has_a_session_of_its_own(place: str) -> None:
    with (
        serial.serial_for_url(f"rfc2217://{place}?timeout=60", timeout=60) as one,
        serial.serial_for_url(f"rfc2217://{place}?timeout=60", timeout=60) as other,
    ):
        for port, number in ((one, b"\x01"), (other, b"\x02")):
            port.write(b"\x02" + number)
            assert port.read(2) == b"E" + number


def test_every_byte_value_passes_both_ways(place: str) -> None:
    values = bytes(range(256))
    with serial.serial_for_url(f"rfc2217://{place}?timeout=60", timeout=60) as port:
        for value in values:
            port.write(bytes([0x02, value]))
        assert port.read(512) == b"".join(b"E" + bytes([value]) for value in values)


@pytest.mark.parametrize(
    "sent",
    [
        b"\xff\xfa" + b"x" * 300,
        b"\xff\xf0",
        b"\xff\xfa\x2c\x01\xff\xf0",
        b"\xff\xfd\x2c\xff\xfe\x2c" * 30_000,
    ],
    ids=["an option without end", "an end alone", "half a speed", "questions without end"],
)
def test_a_host_whose_options_make_no_sense_is_hung_up_on(
    place: str, sent: bytes, caplog: pytest.LogCaptureFixture
) -> None:
    host, port = place.split(":")
    with socket.create_connection((host, int(port)), 60) as link, suppress(OSError):
        for start in range(0, len(sent), 6000):
            link.sendall(sent[start : start + 6000])
        while sent[:2] != b"\xff\xfd" and link.recv(4096):
            pass
    with serial.serial_for_url(f"rfc2217://{place}?timeout=60", timeout=60) as other:
        other.write(b"\x02\x07")
        assert other.read(2) == b"E\x07"
    assert not caplog.records


def test_settings_and_lines_are_taken(place: str) -> None:
    with serial.serial_for_url(f"rfc2217://{place}?timeout=60", timeout=60) as port:
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
        with serial.serial_for_url(f"rfc2217://{place}?timeout=60", timeout=60) as port:
            port.write(b"\x02\x09")
            assert port.read(2) == b"E\x09"
