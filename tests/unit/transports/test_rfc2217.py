"""A link that speaks Telnet, on a socket that takes a part at a time."""

import asyncio
import re
import socket
from collections.abc import Iterator
from contextlib import suppress

import pytest

from vbus.transports.base import ignore
from vbus.transports.rfc2217 import MOST_OWED, Rfc2217Link, SerialSettings

UNKNOWN = b"\xff\xfd\x63"
"""DO, of an option that nothing here knows."""
REFUSED = b"\xff\xfc\x63"


Ends = tuple[Rfc2217Link, socket.socket]


@pytest.fixture
def ends() -> Iterator[Ends]:
    """A link that has begun to negotiate, and its host's end."""
    near, far = socket.socketpair()
    near.setsockopt(socket.SOL_SOCKET, socket.SO_SNDBUF, 1)
    near.setblocking(False)
    far.setblocking(False)
    loop = asyncio.new_event_loop()
    link = Rfc2217Link(loop, near, "host", SerialSettings(), False, ignore)
    far.recv(4096)
    yield link, far
    link.close()
    far.close()
    loop.close()


def test_what_a_full_socket_takes_in_parts_comes_whole_and_options_between_bytes(
    ends: Ends,
) -> None:
    link, far = ends
    sent = bytearray(b"\xff\x01\xff\xff" * 20_000)
    data, came, asked = bytes(sent), b"", 0
    while sent:
        try:
            del sent[: link.write(link.fd, sent)]
        except BlockingIOError:
            came += far.recv(777)
            if asked < 20:
                asked += far.send(UNKNOWN) // len(UNKNOWN)
                with pytest.raises(BlockingIOError):
                    link.read(link.fd, 448)
    with suppress(BlockingIOError):
        while True:
            came += far.recv(1 << 16)
    assert asked == 20
    assert came.count(REFUSED) >= 19, "the last may still wait for room"
    plain = re.sub(rb"\xff(?:(\xff)|[\xfb-\xfe].)", lambda found: found[1] or b"", came)
    assert plain == data


def test_reading_gives_what_stands_between_options(ends: Ends) -> None:
    link, far = ends
    far.sendall(UNKNOWN + b"\x10\xff\xff\x11")
    assert link.read(link.fd, 448) == b"\x10\xff\x11"
    far.sendall(UNKNOWN)
    with pytest.raises(BlockingIOError):
        link.read(link.fd, 448)
    far.shutdown(socket.SHUT_WR)
    assert link.read(link.fd, 448) == b""
    assert far.recv(100) == REFUSED * 2


def test_a_host_that_asks_and_reads_no_answers_is_as_one_that_has_gone(ends: Ends) -> None:
    link, far = ends

    def ask() -> None:
        for _ in range(MOST_OWED):
            far.send(UNKNOWN)
            with suppress(BlockingIOError):
                link.read(link.fd, 448)

    with pytest.raises(ConnectionResetError):
        ask()
