"""The event loop that serves hosts directly is an event loop like any other for everything else."""

import asyncio
import os
import socket
from collections.abc import Iterator
from contextlib import nullcontext

import pytest

from tests.waiting import PATIENCE
from vbus.serve.loop import HostLoop, done_before


class Echo:
    """A direct reader that answers, and remembers."""

    def __init__(self, loop: HostLoop) -> None:
        self.near, self.far = socket.socketpair()
        self.near.setblocking(False)
        self.far.settimeout(PATIENCE)
        self.seen: list[bytes] = []
        self._loop = loop
        loop.add_direct_reader(self.near.fileno(), self.read)

    def read(self) -> None:
        data = self.near.recv(100)
        self.seen.append(data)
        if data == b"raise":
            raise RuntimeError("broken")
        if data == b"leave":
            self._loop.remove_reader(self.near.fileno())
        if data == b"soon":
            self._loop.call_soon(self.seen.append, b"later")
        if data == b"timer":
            self._loop.call_later(0, self.seen.append, b"later")

    def close(self) -> None:
        self._loop.remove_reader(self.near.fileno())
        self.near.close()
        self.far.close()


@pytest.fixture
def loop() -> Iterator[HostLoop]:
    loop = HostLoop()
    yield loop
    loop.close()


@pytest.fixture
def echo(loop: HostLoop) -> Iterator[Echo]:
    echo = Echo(loop)
    yield echo
    echo.close()


@pytest.mark.parametrize("fails", [False, True])
def test_nothing_is_left_to_a_loop_of_what_was_waited_for_beside_work(
    loop: HostLoop, fails: bool
) -> None:
    """A task that is left is reported when it is no more, in whatever runs then."""

    async def work() -> None:
        if fails:
            raise RuntimeError("broken")

    ends = (asyncio.Event(), asyncio.Event())
    with pytest.raises(RuntimeError) if fails else nullcontext():
        assert loop.run_until_complete(done_before(ends, work()))
    assert asyncio.all_tasks(loop) == set()


async def until(seen: list[bytes], wanted: list[bytes]) -> None:
    for _ in range(10_000):
        if seen == wanted:
            return
        await asyncio.sleep(0)
    raise AssertionError(f"{seen} instead of {wanted}")


def test_a_direct_reader_is_called_while_the_event_loop_waits_for_something_else(
    loop: HostLoop, echo: Echo
) -> None:
    other, wake = socket.socketpair()
    other.setblocking(False)
    done = loop.create_future()
    loop.add_reader(other.fileno(), lambda: done.done() or done.set_result(other.recv(9)))
    loop.call_soon(echo.far.send, b"one")

    def answer() -> None:
        echo.near.recv(100)
        wake.send(b"done")

    loop.add_direct_reader(echo.near.fileno(), answer)
    assert loop.run_until_complete(asyncio.wait_for(done, PATIENCE)) == b"done"
    loop.remove_reader(other.fileno())
    other.close()
    wake.close()


@pytest.mark.parametrize("how", [b"soon", b"timer"])
def test_what_a_direct_reader_schedules_is_done_though_nothing_else_wakes_the_loop(
    loop: HostLoop, echo: Echo, how: bytes
) -> None:
    async def main() -> None:
        done = loop.create_future()
        echo.far.send(how)

        class Seen(list[bytes]):
            def append(self, item: bytes) -> None:
                super().append(item)
                if item == b"later":
                    done.set_result(None)

        echo.seen = Seen()
        await done

    loop.run_until_complete(main())
    assert echo.seen == [how, b"later"]


def test_a_direct_reader_that_fails_is_reported_and_the_loop_goes_on(
    loop: HostLoop, echo: Echo
) -> None:
    reports: list[str] = []
    loop.set_exception_handler(lambda _, context: reports.append(str(context["exception"])))
    echo.far.send(b"raise")
    loop.run_until_complete(until(echo.seen, [b"raise"]))
    echo.far.send(b"again")
    loop.run_until_complete(until(echo.seen, [b"raise", b"again"]))
    assert reports == ["broken"]


def test_a_removed_direct_reader_is_called_no_more(loop: HostLoop, echo: Echo) -> None:
    echo.far.send(b"leave")
    loop.run_until_complete(until(echo.seen, [b"leave"]))
    echo.far.send(b"more")
    loop.run_until_complete(asyncio.sleep(0.01))
    assert echo.seen == [b"leave"]


def test_a_descriptor_may_be_read_directly_and_written_by_the_loop(
    loop: HostLoop, echo: Echo
) -> None:
    written: list[int] = []

    def write() -> None:
        written.append(echo.near.send(b"x"))
        loop.remove_writer(echo.near.fileno())

    loop.add_writer(echo.near.fileno(), write)
    echo.far.send(b"one")
    loop.run_until_complete(until(echo.seen, [b"one"]))
    assert written == [1]


def test_a_host_that_never_stops_asking_does_not_keep_timers_and_signals_waiting(
    loop: HostLoop,
) -> None:
    near, far = os.pipe()
    os.write(far, b"x")
    loop.add_direct_reader(near, lambda: None)  # never reads: readable for ever

    async def main() -> None:
        await asyncio.sleep(0.01)

    loop.run_until_complete(asyncio.wait_for(main(), PATIENCE))
    loop.remove_reader(near)
    os.close(near)
    os.close(far)


def test_sockets_streams_and_tasks_work_as_in_any_event_loop(loop: HostLoop, echo: Echo) -> None:
    async def main() -> bytes:
        async def serve(reader: asyncio.StreamReader, writer: asyncio.StreamWriter) -> None:
            writer.write(await reader.readexactly(3))
            writer.close()

        server = await asyncio.start_server(serve, "127.0.0.1", 0)
        reader, writer = await asyncio.open_connection(*server.sockets[0].getsockname())
        writer.write(b"abc")
        answer = await reader.read()
        writer.close()
        await writer.wait_closed()
        server.close()
        await server.wait_closed()
        return answer

    assert loop.run_until_complete(asyncio.wait_for(main(), PATIENCE)) == b"abc"


def test_a_descriptor_that_is_used_again_at_once_keeps_its_new_reader(
    loop: HostLoop, echo: Echo
) -> None:
    old, ready = os.pipe()
    new, wake = os.pipe()
    os.write(ready, b"x")
    seen: list[bytes] = []

    def replace() -> None:
        echo.near.recv(100)
        loop.remove_reader(old)
        os.dup2(new, old)  # the number is that of another file now
        loop.add_reader(old, lambda: seen.append(os.read(old, 9)))

    async def main() -> None:
        loop.add_reader(old, seen.append, b"old")
        loop.add_direct_reader(echo.near.fileno(), replace)
        echo.far.send(b"now")  # both are ready at the same look
        await asyncio.sleep(0)
        await asyncio.sleep(0)
        os.write(wake, b"new")
        await until(seen, [b"new"])

    loop.run_until_complete(main())
    loop.remove_reader(old)
    for fd in (old, ready, new, wake):
        os.close(fd)
