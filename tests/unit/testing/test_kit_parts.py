"""Every chip, plant, protocol and transport of the project passes its own conformance kit."""

import os
import socket
from collections.abc import Callable
from pathlib import Path

import pytest

from vbus.board.board import Board
from vbus.board.build import load_board_text
from vbus.plugins import PLANTS, names, plant_class
from vbus.protocols.base import Protocol
from vbus.protocols.byte import ByteProtocol
from vbus.protocols.text import TextProtocol
from vbus.testing import check_chip, check_plant, check_protocol, check_transport
from vbus.testing.boards import for_test, of_part
from vbus.transports.base import Link, Transport
from vbus.transports.pty import PtyTransport
from vbus.transports.sockets import TcpTransport, UnixTransport


def maker(part: str, plant: str = "") -> Callable[[], Board]:
    _, source = for_test(of_part(part, plant), "board.toml")
    return lambda: load_board_text(source.text)


@pytest.mark.parametrize(
    ("part", "plant"),
    [
        ("LM628N-8", "dc_motor"),
        ("LM629N-8", "ideal"),
        ("MCP-1200", "dc_motor"),
        ("MCP-1200", "stepper"),
        ("MC1241A", "stepper"),
        ("MC1141A", "ideal"),
    ],
)
def test_our_chips_keep_the_contract(part: str, plant: str) -> None:
    check_chip(maker(part, plant), cycles=120)


@pytest.mark.parametrize("model", sorted({*names(PLANTS)} - {"fmu"}))  # one with a unit: test_fmu
def test_our_plants_keep_the_contract(model: str) -> None:
    check_plant(plant_class(model))


@pytest.mark.parametrize(
    ("protocol", "requests"),
    [
        (ByteProtocol, bytes.fromhex("10 20 1E 10 21 00 21 0F 10 11 12 10 FF 10")),
        (TextProtocol, b"r 0\nw 0 1E\nr 0\nw 1 00\nnonsense\nr 0\nr 1\n"),
    ],
)
def test_our_protocols_keep_the_contract(protocol: type[Protocol], requests: bytes) -> None:
    check_protocol(protocol, requests)


def unix(url: str) -> int:
    with socket.socket(socket.AF_UNIX) as connection:
        connection.connect(url.partition(":")[2])
        return connection.detach()


def tcp(url: str) -> int:
    host, _, port = url.partition(":")[2].rpartition(":")
    return socket.create_connection((host.strip("/"), int(port)), 10).detach()


def terminal(url: str) -> int:
    return os.open(url.partition(":")[2], os.O_RDWR | os.O_NOCTTY)


class ReadsItself(UnixTransport):
    """Hands over what it has read when its loop has time, as on a busy machine."""

    def open(self, loop, on_link) -> None:  # type: ignore[no-untyped-def]
        def begin(link: Link) -> None:
            def read(fd: int, size: int) -> bytes:
                loop.call_later(0.3, link.on_data, os.read(fd, size))
                raise BlockingIOError

            link.read = read
            on_link(link)

        super().open(loop, begin)


def test_our_transports_keep_the_contract(tmp_path: Path) -> None:
    cases: list[tuple[Callable[[], Transport], Callable[[str], int]]] = [
        (lambda: UnixTransport(str(tmp_path / "u"), {}), unix),
        (lambda: ReadsItself(str(tmp_path / "r"), {}), unix),
        (lambda: TcpTransport("127.0.0.1:0", {}), tcp),
        (lambda: PtyTransport(str(tmp_path / "p"), {}), terminal),
    ]
    for factory, dial in cases:
        check_transport(factory, dial)
