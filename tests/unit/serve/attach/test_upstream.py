"""Sessions with a board elsewhere: in order, held back where nobody takes more, ended whole."""

import asyncio
import os
import socket
from collections.abc import Callable, Coroutine
from types import SimpleNamespace
from typing import Any

import pytest

from tests.unit.fake_port import FakePort
from vbus.core.errors import TransportError
from vbus.serve.attach import upstream as upstream_module
from vbus.serve.attach.meter import Meter, Trips
from vbus.serve.attach.relay import Passage, RelayPort, RelaySession
from vbus.serve.attach.upstream import MOST_PENDING, Upstream, opened
from vbus.serve.detached_waits import DetachedWaits, DisconnectPoller
from vbus.serve.loop import HostLoop
from vbus.serve.session import Services, SpinTurn
from vbus.serve.time.pacer import TimeSource
from vbus.serve.time.statistics import ROUND_TRIP_NS, Histogram
from vbus.transports.base import Link
from vbus.transports.sockets import SocketLink


class Board:
    """Something that listens, and does what a test says."""

    def __init__(self) -> None:
        self.listener = socket.create_server(("127.0.0.1", 0))
        self.listener.setblocking(False)
        self.where = f"tcp:127.0.0.1:{self.listener.getsockname()[1]}"
        self.loop = asyncio.get_running_loop()

    async def accept(self) -> socket.socket:
        link, _ = await self.loop.sock_accept(self.listener)
        link.setblocking(False)
        return link

    async def heard(self, link: socket.socket, count: int) -> bytes:
        data = b""
        while len(data) < count and (part := await self.loop.sock_recv(link, 65536)):
            data += part
        return data


def upstream(board: Board, before: Upstream | None = None) -> Upstream:
    return Upstream(board.loop, board.where, Meter(Trips()), before)


def run(test: Callable[[Board], Coroutine[Any, Any, None]]) -> None:
    async def main() -> None:
        board = Board()
        with board.listener:
            async with asyncio.timeout(60):
                await test(board)

    with asyncio.Runner(loop_factory=HostLoop) as runner:
        runner.run(main())


def test_the_session_of_a_terminals_next_host_begins_when_the_last_is_over() -> None:
    async def test(board: Board) -> None:
        one = upstream(board)
        one.send(b"first")
        one.finish(False)
        two = upstream(board, one)
        two.send(b"second")
        link = await board.accept()
        assert await board.heard(link, 100) == b"first"  # and no more will come
        for _ in range(20):  # turns of the loop, in which a session would begin
            await asyncio.sleep(0)
        assert not two.over.is_set()
        board.listener.settimeout(0)
        try:
            board.listener.accept()
        except BlockingIOError:
            pass
        else:
            raise AssertionError("two sessions at once")
        board.listener.setblocking(False)
        link.close()
        with await board.accept() as other:
            assert await board.heard(other, 6) == b"second"
            two.finish(False)
        await two.over.wait()

    run(test)


def test_what_a_host_has_sent_before_it_went_waits_for_the_link(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    monkeypatch.setattr(upstream_module, "LEAVING_SECONDS", 0)

    async def test(board: Board) -> None:
        before: Any = SimpleNamespace(over=asyncio.Event())
        one = upstream(board, before)
        one.send(b"last")
        one.finish(False)
        for _ in range(20):  # turns of the loop, in which its time would be over
            await asyncio.sleep(0)
        before.over.set()
        with await board.accept() as link:
            assert await board.heard(link, 100) == b"last"
        await one.over.wait()

    run(test)


def test_what_the_board_does_not_take_is_kept_and_the_host_waits() -> None:
    async def test(board: Board) -> None:
        one = upstream(board)
        rooms: list[bool] = []
        one.on_room = lambda: rooms.append(one.full)
        data = bytes(range(256)) * 20_000
        one.send(data)
        assert one.full
        with await board.accept() as link:
            assert await board.heard(link, len(data)) == data
            assert rooms == [False]
            one.finish(True)
            assert await board.heard(link, 1) == b""
            one_more = []
            one.on_data = one_more.append
            await board.loop.sock_sendall(link, b"late")  # its answers are heard to the end
        await one.over.wait()
        assert one_more == [b"late"]

    run(test)


def test_an_end_that_was_not_asked_for_is_a_loss() -> None:
    async def test(board: Board) -> None:
        ends: list[TransportError | None] = []
        one, two = upstream(board), upstream(board)
        one.on_over = two.on_over = ends.append
        one.send(b"x")
        two.send(b"x")
        for _ in range(2):
            with await board.accept() as link:
                await board.heard(link, 1)
        await one.over.wait()
        await two.over.wait()
        assert [str(end) for end in ends] == [f"{board.where}: closed by the other end"] * 2
        nobody = Upstream(board.loop, "tcp:127.0.0.1:1", Meter(Trips()))
        nobody.on_over = ends.append
        await nobody.over.wait()
        assert "cannot be opened" in str(ends[-1])

    run(test)


def test_a_board_that_has_gone_is_found_by_a_host_that_asks_nothing(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    """On a link that does not tell, such as one of Zenoh."""
    near, far = socket.socketpair()
    looks = iter([None, None, TransportError("gone")])
    said: list[object] = []

    def look() -> None:
        if found := next(looks):
            raise found

    link = SimpleNamespace(
        fd=near.fileno(), by_descriptor=False, unanswered=0, look_for_board=look, close=near.close
    )
    monkeypatch.setattr(upstream_module, "opened", lambda where: link)
    monkeypatch.setattr(upstream_module, "BEAT_SECONDS", 0)

    async def test(board: Board) -> None:
        board.loop.set_exception_handler(lambda loop, wrong: said.append(wrong))
        one = upstream(board)
        one.on_over = said.append
        await one.over.wait()
        assert list(map(str, said)) == ["gone"]

    with near, far:
        run(test)


def test_a_computer_that_vanishes_is_noticed() -> None:
    async def test(board: Board) -> None:
        link = await asyncio.to_thread(opened, board.where)
        with socket.socket(fileno=os.dup(link.fd)) as connected:
            assert connected.getsockopt(socket.SOL_SOCKET, socket.SO_KEEPALIVE) == 1
            assert connected.getsockopt(socket.IPPROTO_TCP, socket.TCP_USER_TIMEOUT) == 25_000
            assert connected.getsockopt(socket.IPPROTO_TCP, socket.TCP_KEEPIDLE) == 10
        link.close()

    run(test)


def test_a_board_waits_for_a_host_that_does_not_read() -> None:
    async def test(board: Board) -> None:
        loop = board.loop
        near, host = socket.socketpair()
        near.setblocking(False)
        host.setblocking(False)
        disconnects = DisconnectPoller(loop)
        disconnects.open()
        services = Services(
            loop, TimeSource(), SpinTurn(), Histogram(ROUND_TRIP_NS), disconnects,
            DetachedWaits(TimeSource()),
            lambda _: None,
        )  # fmt: skip
        way = upstream(board)
        port = RelayPort(way)
        session = RelaySession(services, SocketLink(near, "x"), port, Passage(port))
        session.begin()
        way.send(b"x")
        count = 12 * (1 << 20)
        with await board.accept() as link:
            await board.heard(link, 1)
            sending = asyncio.ensure_future(loop.sock_sendall(link, bytes(count)))
            done, _ = await asyncio.wait([sending], timeout=0.5)
            assert not done
            assert len(session.pending) < 4 * MOST_PENDING
            assert len(await board.heard(host, count)) == count
            await sending
            host.close()
            await board.heard(link, 1)
        await way.over.wait()
        disconnects.close()

    run(test)


def test_where_time_is_a_boards_elsewhere_no_host_waits_for_one_that_has_gone() -> None:
    waits = DetachedWaits(TimeSource())
    gone: Any = SimpleNamespace(port=FakePort())
    waits.under_way.append(gone)
    assert waits.passing
    let_in: list[Link] = []
    near, far = socket.socketpair()
    link = SocketLink(near, "x")
    waits.admit(link, let_in.append)
    assert let_in == [link]
    link.close()
    far.close()
