"""Sockets take all hosts that wait in one turn of the event loop."""

import asyncio
import socket
from collections.abc import Callable
from contextlib import ExitStack
from pathlib import Path
from typing import Any, cast

import pytest

from tests.waiting import PATIENCE
from vbus.core.errors import TransportError
from vbus.serve.host_entry import HostEntry, LinkSpec
from vbus.transports.base import Link
from vbus.transports.sockets import TcpTransport, UnixTransport

HOSTS = 300


class Readers:
    """Stands for an event loop: has one reader, called by the test as often as it turns."""

    def __init__(self) -> None:
        self.turn: Callable[[], None] = lambda: None

    def add_reader(self, fd: int, callback: Callable[..., None], *arguments: Any) -> None:
        """Take the reader."""
        self.turn = lambda: callback(*arguments)

    def remove_reader(self, fd: int) -> bool:
        """Forget the reader."""
        return True


@pytest.mark.parametrize("scheme", ["tcp", "unix"])
def test_all_hosts_that_wait_are_taken_in_one_turn(tmp_path: Path, scheme: str) -> None:
    loop, links = Readers(), list[Link]()
    path = str(tmp_path / "x") if scheme == "unix" else "0"
    transport = UnixTransport(path, {}) if scheme == "unix" else TcpTransport(path, {})
    transport.open(cast(asyncio.AbstractEventLoop, loop), links.append)
    with ExitStack() as opened:
        opened.callback(transport.close)
        for _ in range(HOSTS):
            if scheme == "unix":
                host = opened.enter_context(socket.socket(socket.AF_UNIX))
                host.setblocking(False)
                host.connect(path)
            else:
                host = opened.enter_context(socket.socket())
                host.settimeout(PATIENCE)
                host.connect(("127.0.0.1", int(transport.url.rpartition(":")[2])))
        loop.turn()
        assert len(links) == HOSTS
        if scheme == "tcp":  # a host is named as its own end is: where it comes from
            assert links[-1].peer == "{}:{}".format(*host.getsockname())
        assert not transport.waiting()
        for link in links:
            link.close()


@pytest.mark.parametrize("scheme", ["pty", "unix", "tcp", "rfc2217", "serial", "zenoh"])
def test_an_option_that_means_nothing_is_refused(scheme: str) -> None:
    with pytest.raises(TransportError, match=rf"^{scheme}:7000: unknown option 'wait'; known: "):
        HostEntry(LinkSpec(f"{scheme}:7000?wait=1"), "host0")
