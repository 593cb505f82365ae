"""Whose a terminal's bytes are, in whatever order the system tells who came and went."""

import asyncio
import errno
import os
import termios
from collections.abc import Iterator
from itertools import count
from pathlib import Path
from typing import Any

import pytest

from vbus.transports import pty
from vbus.transports.base import Link
from vbus.transports.linux import IN_CLOSE, IN_MODIFY, IN_OPEN


@pytest.fixture
def loop() -> Iterator[asyncio.AbstractEventLoop]:
    loop = asyncio.new_event_loop()
    yield loop
    loop.close()


class Hosts:
    """A transport without a server: what its sessions would see, in order."""

    def __init__(self, path: Path, loop: asyncio.AbstractEventLoop) -> None:
        self.path, self.loop = path, loop
        self.seen: list[str] = []
        self.links: list[Link] = []
        self._numbers = count()
        self.transport = pty.PtyTransport(str(path), {})
        self.transport.open(loop, self._began)

    def _began(self, link: Link) -> None:
        number = next(self._numbers)
        self.links.append(link)

        def took(data: bytes) -> None:
            self.seen.append(f"{number} {data.hex()}")

        def ended(carry_out: bool) -> None:
            while carry_out and (data := self._read(link)):
                took(data)
            self.seen.append(f"{number} ends")
            link.close()

        link.on_data, link.on_end = took, ended

    @staticmethod
    def _read(link: Link) -> bytes:
        try:
            return link.read(link.fd, 100)
        except OSError:
            return b""

    def open(self) -> int:
        return os.open(self.path, os.O_RDWR | os.O_NOCTTY)

    def look(self) -> None:
        """The server looks at whatever has happened by now."""
        for terminal in tuple(self.transport._terminals):
            self.transport._notice(terminal)
        self.loop.run_until_complete(asyncio.sleep(0))


@pytest.fixture
def hosts(tmp_path: Path, loop: asyncio.AbstractEventLoop) -> Iterator[Hosts]:
    hosts = Hosts(tmp_path / "x", loop)
    yield hosts
    hosts.transport.close()


def test_close_and_open_are_learned_of_at_once(hosts: Hosts) -> None:
    """The name leads elsewhere since the first byte of the one that goes."""
    first = hosts.open()
    os.write(first, b"\x31")
    hosts.look()
    assert hosts.seen == ["0 31"]
    os.write(first, b"\x01")
    os.close(first)
    second = hosts.open()
    os.write(second, b"\x10")
    hosts.look()
    assert hosts.seen == ["0 31", "0 01", "0 ends", "1 10"]
    os.close(second)


@pytest.mark.parametrize("order", [(0, 1), (1, 0)])
def test_the_hang_up_is_seen_late_or_early(hosts: Hosts, order: tuple[int, int]) -> None:
    """Whatever terminal is looked at first: the one that has gone has ended by then."""
    first = hosts.open()
    os.write(first, b"\x31")
    hosts.look()
    os.write(first, b"\x01")
    os.close(first)
    second = hosts.open()
    os.write(second, b"\x10")
    terminals = tuple(hosts.transport._terminals)
    for place in order:
        hosts.transport._notice(terminals[place])
    assert hosts.seen == ["0 31", "0 01", "0 ends", "1 10"]
    os.close(second)


def test_who_has_written_nothing_yet_is_not_taken_for_one_that_has_gone(hosts: Hosts) -> None:
    first = hosts.open()
    os.write(first, b"\x31")
    os.close(first)
    second = hosts.open()
    hosts.look()
    assert hosts.seen == ["0 31", "0 ends"]
    os.write(second, b"\x10")
    hosts.look()
    assert hosts.links[1].read(hosts.links[1].fd, 100) == b"\x10"
    assert len(hosts.links) == 2
    os.close(second)


def test_of_bytes_nobody_can_tell_apart_none_is_lost(hosts: Hosts) -> None:
    first = hosts.open()
    os.write(first, b"\x10")
    os.close(first)
    second = hosts.open()
    os.write(second, b"\x11")
    hosts.look()
    assert hosts.seen == ["0 1011"]
    third = hosts.open()
    os.write(third, b"\x12")
    hosts.look()
    assert hosts.seen == ["0 1011", "1 12"]
    os.close(second)
    os.close(third)


@pytest.mark.parametrize(
    ("events", "followed", "mixed"),
    [
        ([IN_OPEN, IN_MODIFY], False, False),
        ([IN_OPEN, IN_MODIFY, IN_CLOSE], False, False),
        ([IN_OPEN, IN_CLOSE, IN_OPEN, IN_MODIFY], False, False),
        ([IN_OPEN, IN_OPEN, IN_MODIFY, IN_CLOSE, IN_MODIFY], False, False),
        ([IN_OPEN, IN_MODIFY, IN_CLOSE, IN_OPEN], True, False),
        ([IN_OPEN, IN_MODIFY, IN_CLOSE, IN_OPEN, IN_MODIFY], True, True),
    ],
)
def test_what_is_learned_of_the_order_in_which_hosts_came_wrote_and_went(
    hosts: Hosts, events: list[int], followed: bool, mixed: bool
) -> None:
    terminal = hosts.transport._terminals[-1]
    for event in events:
        terminal.watch.note(event)  # type: ignore[union-attr]
    terminal.learn()
    assert (terminal.followed, terminal.mixed) == (followed, mixed)


def test_what_a_client_set_that_came_and_went_unseen_is_not_there_for_the_next(
    hosts: Hosts,
) -> None:
    first = hosts.open()
    settings = termios.tcgetattr(first)
    settings[3] |= termios.ECHO | termios.ICANON
    termios.tcsetattr(first, termios.TCSANOW, settings)
    os.close(first)
    hosts.look()
    second = hosts.open()
    assert not termios.tcgetattr(second)[3] & (termios.ECHO | termios.ICANON)
    os.close(second)


def test_a_terminal_that_is_opened_as_the_name_leaves_it_is_served(hosts: Hosts) -> None:
    """A name is looked up first, and what it leads to is opened then."""
    left = hosts.transport._terminals[0]
    led_to = os.readlink(hosts.path)
    first = hosts.open()
    os.write(first, b"\x10")
    os.close(first)
    hosts.look()
    late = os.open(led_to, os.O_RDWR | os.O_NOCTTY)
    os.write(late, b"\x11")
    hosts.transport._free_unused(left)
    assert hosts.seen == ["0 10", "0 ends"]
    assert hosts.links[1].read(hosts.links[1].fd, 100) == b"\x11"
    os.close(late)
    hosts.look()
    hosts.transport._free_unused(left)
    assert len(hosts.transport._terminals) == 1


def test_a_terminal_that_cannot_be_made_for_now_is_made_later(
    hosts: Hosts, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(pty, "REST_SECONDS", 0)
    reports: list[str] = []
    tries: list[None] = []
    make = pty._Terminal

    def scarce(*arguments: Any) -> pty._Terminal:
        tries.append(None)
        if len(tries) < 4:
            raise OSError(errno.EMFILE, os.strerror(errno.EMFILE))
        return make(*arguments)

    transport = hosts.transport
    transport.report = reports.append
    with open(hosts.path, "r+b", buffering=0):
        hosts.look()
        monkeypatch.setattr(pty, "_Terminal", scarce)
        hosts.links[0].hang_up()
    assert transport.state == "lost: Too many open files"
    assert not os.path.lexists(hosts.path), "the name would lead to somebody else's terminal"
    for _ in range(10):
        hosts.loop.run_until_complete(asyncio.sleep(0))
    assert len(tries) == 4
    assert transport.state == "waiting"
    assert reports == [f"{hosts.path}: lost: Too many open files; it is tried again"]
    with open(hosts.path, "r+b", buffering=0):
        hosts.look()
    assert len(hosts.links) == 2


def test_the_next_host_comes_while_the_last_ones_bytes_are_read(
    hosts: Hosts, monkeypatch: pytest.MonkeyPatch
) -> None:
    first = hosts.open()
    os.write(first, b"\x31")
    os.close(first)
    terminal = hosts.transport._terminals[0]
    read, second = terminal.read, list[int]()

    def late() -> bytes:
        data = read()
        if not second:
            second.append(hosts.open())
            os.write(second[0], b"\x10")
        return data

    monkeypatch.setattr(terminal, "read", late)
    hosts.look()
    assert hosts.seen == ["0 31"], "the next one has the terminal open"
    os.close(second[0])


def test_a_host_that_writes_as_fast_as_it_is_read_is_not_read_for_ever(
    hosts: Hosts, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(pty.os, "read", lambda fd, size: b"\x10" * size)
    data = hosts.transport._terminals[0].read()
    monkeypatch.undo()
    assert len(data) == pty._MOST_READ


def test_the_next_host_comes_while_one_that_sent_nothing_is_found_to_have_gone(
    hosts: Hosts, monkeypatch: pytest.MonkeyPatch
) -> None:
    first = hosts.open()
    hosts.look()
    os.close(first)
    transport, second = hosts.transport, list[int]()
    renew = transport._renew

    def late(terminal: pty._Terminal, event: str) -> None:
        second.append(hosts.open())
        os.write(second[0], b"\x10")
        renew(terminal, event)

    monkeypatch.setattr(transport, "_renew", late)
    hosts.look()
    assert hosts.seen == [], "its session is the next one's"
    assert hosts._read(hosts.links[-1]) == b"\x10"
    os.close(second[0])
