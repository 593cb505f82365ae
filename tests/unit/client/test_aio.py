"""The asyncio client: the same calls, awaited."""

import asyncio
import socket

import pytest

from tests.unit.client.served import Served
from vbus.client.aio import Event, connect
from vbus.client.aio.waits import Waits
from vbus.core.errors import TransportError
from vbus.core.kernel import US


@pytest.mark.asyncio
async def test_a_session_over_every_kind_of_link(served: Served) -> None:
    async with await connect(served.where) as bus:
        await bus.write(0, 0x1E)
        assert await bus.read(0) == 1
        async with bus.claim():
            assert await bus.chip("y").reads(1, 2) == b"\x13\x14"
        async with bus.batch() as batch:
            now = batch.now()
        assert now.value == 4 * US
        # Nothing is left in the event loop between calls.
        assert not asyncio.get_running_loop().remove_reader(bus.link.fd)
        assert not asyncio.get_running_loop().remove_writer(bus.link.fd)


@pytest.mark.asyncio
async def test_tasks_may_share_a_bus(pty_served: Served) -> None:
    pty_served.port.answers = {address: [address] for address in range(8)}
    async with await connect(pty_served.where) as bus:
        for _ in range(20):
            assert await asyncio.gather(*(bus.read(a) for a in range(8))) == list(range(8))


@pytest.mark.asyncio
async def test_the_event_loop_runs_while_a_reply_is_awaited(pty_served: Served) -> None:
    async with await connect(pty_served.where) as bus:
        pty_served.mute = True
        read = asyncio.create_task(bus.read(0))
        await asyncio.sleep(0)
        assert not read.done()
        bus.timeout = 0.01
        read.cancel()
        with pytest.raises(asyncio.CancelledError):
            await read
        with pytest.raises(TransportError, match="no reply to ECHO within"):
            await bus.echo()


@pytest.mark.asyncio
async def test_a_message_bigger_than_the_links_buffers_gets_through(served: Served) -> None:
    async with await connect(served.where) as bus:
        async with bus.batch() as batch:
            reads = [batch.reads(1, 255) for _ in range(2000)]
            batch.writes(1, bytes(255))
        assert sum(len(read.value) for read in reads) == 510_000


@pytest.mark.asyncio
async def test_events_are_waited_for(pty_served: Served) -> None:
    async with await connect(pty_served.where) as bus:
        await bus.events("x.HI")
        await bus.write(0, 1)
        assert await bus.next_event() == Event(1, US)
        assert await bus.next_event(timeout=0.0) is None


@pytest.mark.asyncio
async def test_what_has_come_is_taken_although_the_time_is_over() -> None:
    """A program that had no turn looks late."""
    near, far = socket.socketpair()
    with near, far:
        waits = Waits()
        assert not await waits.until_ready(near.fileno(), False, 0.0)
        far.send(b"x")
        assert await waits.until_ready(near.fileno(), False, 0.0)
