"""The conformance suites of protocols and transports."""

import asyncio
import os
import select
import threading
from collections.abc import Callable
from contextlib import suppress
from queue import Empty, SimpleQueue
from random import Random
from typing import Final

from vbus.board.board import Board
from vbus.board.build import load_board_text
from vbus.core.errors import TransportError
from vbus.core.kernel import NEVER
from vbus.core.state import save
from vbus.protocols.base import Protocol
from vbus.protocols.port import HostPort
from vbus.testing.boards import default_part, for_test, of_part
from vbus.testing.checks import Nonconformance, demand, hand_over, packed
from vbus.transports.base import Link, Transport

ALL_BYTES: Final = bytes(range(256))
_PATIENCE: Final = 20.0
"""Seconds after which what a transport owes is given up: far above what a busy machine takes."""


class _ProtocolRun:
    """A protocol on a port of a board of its own."""

    def __init__(self, factory: Callable[[HostPort], Protocol]) -> None:
        file, source = for_test(of_part(default_part()), "board.toml")
        self.board: Board = load_board_text(source.text, file.path)
        self.board.run_until(self.board.chips[0].ready_at())
        self.port = self.board.open_port("host")
        self.factory = factory
        self.protocol: Protocol = factory(self.port)

    def give(self, data: bytes) -> bytes:
        try:
            self.protocol.receive(data)
            while self.port.held and self.port.hold_until < NEVER:
                self.board.run_until(max(self.port.hold_until, self.board.now))
                if self.port.go_on():
                    self.protocol.resume()
            self.protocol.report_events()
        except Exception as error:
            raise Nonconformance(
                f"{type(self.protocol).__name__}: the bytes {data[:32].hex(' ')} raised"
                f" {type(error).__name__}: {error}; a host must get an answer, whatever it sends"
            ) from error
        return self.protocol.take()

    def hand_over(self) -> None:
        """Let another protocol of the same kind go on in this one's place."""
        before, self.protocol = self.protocol, self.factory(self.port)
        hand_over(type(before).__name__, before, self.protocol)


def check_protocol(
    factory: Callable[[HostPort], Protocol], requests: bytes, seed: int = 0, rounds: int = 40
) -> None:
    """Check that a protocol keeps the contract of :class:`~vbus.protocols.base.Protocol`.

    Args:
        factory: makes the protocol on a port; the class itself will do.
        requests: a host's bytes that use what the protocol can, on a board with one LM629.
        seed: of cuts and garbage.
        rounds: how many of either.

    Raises:
        Nonconformance: it does not; says what differs.
    """
    random = Random(seed)
    whole = _ProtocolRun(factory)
    name = type(whole.protocol).__name__
    expected, state = whole.give(requests), whole.board.state_hash()
    demand(bool(expected), f"{name}: no answer to {requests[:32].hex(' ')}")
    for turn in range(rounds):
        run = _ProtocolRun(factory)
        cuts = sorted(random.sample(range(len(requests) + 1), min(turn % 6, len(requests))))
        pieces = [requests[a:b] for a, b in zip([0, *cuts], [*cuts, len(requests)], strict=True)]
        if turn == 1:
            pieces = [bytes([byte]) for byte in requests]
        answer = b""
        for piece in pieces:
            answer += run.give(piece)
            if turn % 2:
                run.hand_over()
        where = f"cut at {cuts}" if turn != 1 else "byte by byte"
        cut = ", saved and loaded at the cuts" if turn % 2 else ""
        demand(
            answer == expected,
            f"{name}: {where}{cut}, the same bytes give {answer[:48].hex(' ')}…, not"
            f" {expected[:48].hex(' ')}…",
        )
        demand(
            run.board.state_hash() == state,
            f"{name}: {where}{cut}, the same bytes leave the board in another state",
        )
    for _ in range(rounds):
        run = _ProtocolRun(factory)
        run.give(random.randbytes(random.randint(1, 200)))
        run.protocol.reset()
        run.protocol.take()
        fresh = run.factory(run.port)
        demand(
            packed(name, save(run.protocol)) == packed(name, save(fresh)),
            f"{name}: reset() after garbage keeps something of it: its state is not a new one's",
        )


class _TransportLoop:
    """A transport in an event loop of its own thread, where links are read as by a session."""

    def __init__(self, transport: Transport) -> None:
        self.transport = transport
        self.links: list[Link] = []
        self._new: SimpleQueue[Link] = SimpleQueue()
        self._came: SimpleQueue[bytes] = SimpleQueue()
        self._loop = asyncio.new_event_loop()
        self._thread = threading.Thread(target=self._loop.run_forever, daemon=True)
        self._thread.start()

    def _do(self, what: Callable[[], None]) -> None:
        async def work() -> None:
            what()

        asyncio.run_coroutine_threadsafe(work(), self._loop).result(_PATIENCE)

    def open(self) -> None:
        self._do(lambda: self.transport.open(self._loop, self._link))

    def _link(self, link: Link) -> None:
        self.links.append(link)
        link.on_data = self._came.put  # a transport may read the first bytes itself
        self._new.put(link)

    def link(self) -> Link:
        with suppress(Empty):
            return self._new.get(timeout=_PATIENCE)
        name = type(self.transport).__name__
        raise Nonconformance(f"{name}: a host has come, and on_link was not called")

    def read(self, link: Link) -> None:
        """Take what comes from now on."""
        self._do(lambda: self._loop.add_reader(link.fd, self._readable, link))

    def _readable(self, link: Link) -> None:
        try:
            data = link.read(link.fd, len(ALL_BYTES))
        except BlockingIOError:
            return
        except OSError:
            data = b""
        if data:
            self._came.put(data)
        else:
            self._loop.remove_reader(link.fd)

    def taken(self, count: int) -> bytes:
        """Return so many bytes of the host, or what has come until they were given up."""
        data = b""
        with suppress(Empty):
            while len(data) < count:
                data += self._came.get(timeout=_PATIENCE)
        return data

    def end(self, link: Link) -> None:
        self.links.remove(link)
        self._do(lambda: self._close(link))

    def _close(self, link: Link) -> None:
        self._loop.remove_reader(link.fd)
        link.close()

    def close(self) -> None:
        self._do(self.transport.close)

    def stop(self) -> None:
        """Leave nothing open, as far as the transport can."""
        while self.links:
            with suppress(Exception):  # what it does wrong has been said
                self.end(self.links[-1])
        with suppress(Exception):
            self.close()
        self._loop.call_soon_threadsafe(self._loop.stop)
        self._thread.join()
        self._loop.close()


def _read(fd: int, count: int) -> bytes:
    data = b""
    while len(data) < count and select.select([fd], [], [], _PATIENCE)[0]:
        piece = os.read(fd, count - len(data))
        if not piece:
            break
        data += piece
    return data


def check_transport(factory: Callable[[], Transport], dial: Callable[[str], int]) -> None:
    """Check that a transport that gives descriptors keeps the contract of its base class.

    Args:
        factory: makes the transport, always with the same address.
        dial: attaches a host to the transport's ``url``; returns its descriptor, which reads and
            writes raw bytes. Raises OSError if no host is connected.

    Raises:
        Nonconformance: it does not; says what differs.
    """
    for turn in ("", " opened a second time at the same address"):
        running = _TransportLoop(factory())
        name = f"{type(running.transport).__name__}{turn}"
        try:
            try:
                running.open()
            except TransportError as error:
                raise Nonconformance(f"{name}: it cannot be opened: {error}") from error
            for guest in ("a host", "the next host"):
                _exchange(running, dial, name, guest)
            url = running.transport.url
            running.close()
            running.close()
        finally:
            running.stop()
        try:
            os.close(dial(url))
        except OSError:
            continue
        raise Nonconformance(f"{name}: a host can still attach to {url} after close()")


def _exchange(running: _TransportLoop, dial: Callable[[str], int], name: str, guest: str) -> None:
    """Let a host come, exchange every byte there is, and go."""
    host = dial(running.transport.url)
    try:
        link = running.link()
        demand(not os.get_blocking(link.fd), f"{name}: the link's descriptor blocks")
        try:
            early = os.read(link.fd, 1)
        except BlockingIOError:
            early = b""
        demand(not early, f"{name}: bytes come that {guest} has not sent: {early.hex(' ')}")
        running.read(link)
        for data in (ALL_BYTES, b"\x03\x04\r\n\x11\x13\x7f"):
            os.write(host, data)
            found = running.taken(len(data))
            demand(found == data, f"{name}: {guest} sent {data.hex()}, here is {found.hex()}")
            os.write(link.fd, data)
            found = _read(host, len(data))
            demand(found == data, f"{name}: {guest} was sent {data.hex()} and got {found.hex()}")
    finally:
        os.close(host)
    running.end(link)
