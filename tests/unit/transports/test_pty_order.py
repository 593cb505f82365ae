"""What hosts of a terminal have sent, in order, however fast they follow each other."""

import os
from pathlib import Path

import pytest

from vbus.server.loop import HostLoop
from vbus.transports.base import Link
from vbus.transports.pty import PtyTransport


def test_what_the_next_host_has_sent_is_its_own_before_anything_is_read(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setenv("VBUS_RUNTIME", str(tmp_path))
    name = tmp_path / "x"
    got: list[tuple[int, bytes]] = []
    links: list[Link] = []

    def linked(link: Link) -> None:
        links.append(link)
        number = len(links)
        link.on_data = lambda data: got.append((number, data))
        link.on_end = lambda _: link.close()

    loop = HostLoop()
    transport = PtyTransport(str(name), {})
    transport.open(loop, linked)
    try:
        first = os.open(name, os.O_RDWR | os.O_NOCTTY)
        transport._notice()
        os.close(first)
        second = os.open(name, os.O_RDWR | os.O_NOCTTY)
        os.write(second, b"next")
        transport._notice()  # of both at once
        # From here on the loop reads what comes, and may do so before its next turn.
        assert (len(links), got) == (2, [(2, b"next")])
        os.close(second)
    finally:
        transport.close()
        loop.close()
