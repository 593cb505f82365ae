"""How a terminal tells one client from the next when the system's reports come late."""

import asyncio
import errno
import os
import termios
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import pytest

from vbus.transports import pty
from vbus.transports.base import Link
from vbus.transports.open_watch import OpenWatch


class SlowWatch(OpenWatch):
    """A watch whose reports can be held back, as a busy machine does."""

    late = False

    def read(self) -> list[bool]:
        return [] if self.late else super().read()


@pytest.mark.parametrize("late", [False, True])
def test_the_next_client_is_told_from_the_last_although_the_report_of_an_open_came_late(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, late: bool
) -> None:
    monkeypatch.setattr(pty, "OpenWatch", SlowWatch)
    seen: list[str] = []

    def on_link(link: Link) -> None:
        number = len([line for line in seen if line.startswith("begin")])
        seen.append(f"begin {number}")
        link.on_data = lambda data: seen.append(f"data {number} {data.hex()}")

        def ended(carry_out: bool) -> None:
            seen.append(f"end {number}")
            link.close()

        link.on_end = ended

    loop = asyncio.new_event_loop()
    transport = pty.PtyTransport(str(tmp_path / "x"), {})
    transport.open(loop, on_link)
    assert transport._terminal is not None
    watch, link = transport._terminal.watch, lambda: transport._link
    assert isinstance(watch, SlowWatch)
    try:
        watch.late = late
        first = os.open(tmp_path / "x", os.O_RDWR | os.O_NOCTTY)
        transport._notice()
        watch.late = False
        os.close(first)
        second = os.open(tmp_path / "x", os.O_RDWR | os.O_NOCTTY)
        os.write(second, b"\x31")
        current = link()
        assert current is not None
        transport._notice(os.read(current.fd, 10))
        loop.run_until_complete(asyncio.sleep(0))
        os.close(second)
    finally:
        transport.close()
        loop.close()
    assert seen[:3] == ["begin 0", "end 0", "begin 1"]
    assert seen[3:4] == ["data 1 31"]


@pytest.fixture
def loop() -> Iterator[asyncio.AbstractEventLoop]:
    loop = asyncio.new_event_loop()
    yield loop
    loop.close()


def test_what_a_client_set_that_came_and_went_unseen_is_not_there_for_the_next(
    tmp_path: Path, loop: asyncio.AbstractEventLoop
) -> None:
    transport = pty.PtyTransport(str(tmp_path / "x"), {})
    transport.open(loop, lambda link: None)
    first = os.open(tmp_path / "x", os.O_RDWR | os.O_NOCTTY)
    settings = termios.tcgetattr(first)
    settings[3] |= termios.ECHO | termios.ICANON
    termios.tcsetattr(first, termios.TCSANOW, settings)
    os.close(first)
    transport._notice()
    second = os.open(tmp_path / "x", os.O_RDWR | os.O_NOCTTY)
    assert not termios.tcgetattr(second)[3] & (termios.ECHO | termios.ICANON)
    os.close(second)
    transport.close()


def test_a_terminal_that_cannot_be_replaced_for_now_is_replaced_later(
    tmp_path: Path, loop: asyncio.AbstractEventLoop, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(pty, "REST_SECONDS", 0)
    links: list[Link] = []
    reports: list[str] = []
    tries: list[None] = []
    make = pty._Terminal.make

    def scarce(*arguments: Any) -> pty._Terminal:
        tries.append(None)
        if len(tries) < 4:
            raise OSError(errno.EMFILE, os.strerror(errno.EMFILE))
        return make(*arguments)

    transport = pty.PtyTransport(str(tmp_path / "x"), {})
    transport.report = reports.append
    transport.open(loop, links.append)
    with open(tmp_path / "x", "r+b", buffering=0):
        transport._notice()
        monkeypatch.setattr(pty._Terminal, "make", scarce)
        links[0].hang_up()
    assert transport.state == "lost: Too many open files"
    assert not os.path.lexists(tmp_path / "x"), "the name would lead to somebody else's terminal"
    for _ in range(10):
        loop.run_until_complete(asyncio.sleep(0))
    assert len(tries) == 4
    assert transport.state == "waiting"
    assert reports == [f"{tmp_path / 'x'}: lost: Too many open files; it is tried again"]
    with open(tmp_path / "x", "r+b", buffering=0):
        transport._notice()
    assert len(links) == 2
    transport.close()
