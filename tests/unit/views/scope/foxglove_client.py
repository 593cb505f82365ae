"""A client of Foxglove's WebSocket protocol, written from its specification."""

import base64
import ssl
import struct
from collections import defaultdict
from collections.abc import AsyncIterator, Callable
from contextlib import asynccontextmanager
from typing import Any

from aiohttp import ClientSession, ClientWebSocketResponse, WSMsgType
from google.protobuf import descriptor_pb2, descriptor_pool, message_factory

PROTOCOL = "foxglove.sdk.v1"
MESSAGE_DATA = 1
TIME = 2


class FoxgloveClient:
    """What a viewer knows.

    Attributes:
        channels: as advertised, by topic.
        told: log time and message, by topic.
        now: the server's time (ns).
    """

    def __init__(self, socket: ClientWebSocketResponse) -> None:
        self.channels: dict[str, dict[str, Any]] = {}
        self.told: dict[str, list[tuple[int, Any]]] = defaultdict(list)
        self.now = -1
        self.name = ""
        self._socket = socket
        self._subscribed: list[tuple[str, Any]] = []

    async def greet(self, count: int) -> None:
        """Take the greeting and so many channels."""
        info = await self._socket.receive_json(timeout=60)
        assert info["op"] == "serverInfo"
        self.name = info["name"]
        while len(self.channels) < count:
            told = await self._socket.receive_json(timeout=60)
            assert told["op"] == "advertise"
            self.channels |= {channel["topic"]: channel for channel in told["channels"]}

    async def subscribe(self, *topics: str) -> None:
        wanted = []
        for topic in topics:
            channel = self.channels[topic]
            assert channel["encoding"] == channel["schemaEncoding"] == "protobuf"
            wanted.append({"id": len(self._subscribed), "channelId": channel["id"]})
            self._subscribed.append((topic, _class_of(channel)))
        await self._socket.send_json({"op": "subscribe", "subscriptions": wanted})

    async def take(self, enough: Callable[[], object]) -> None:
        """Take messages until that is enough."""
        while not enough():
            message = await self._socket.receive(timeout=60)
            assert message.type == WSMsgType.BINARY, message
            if message.data[0] == TIME:
                (self.now,) = struct.unpack_from("<Q", message.data, 1)
                continue
            assert message.data[0] == MESSAGE_DATA
            number, when = struct.unpack_from("<IQ", message.data, 1)
            topic, made = self._subscribed[number]
            self.told[topic].append((when, made.FromString(message.data[13:])))


def _class_of(channel: dict[str, Any]) -> Any:
    pool = descriptor_pool.DescriptorPool()
    data = base64.b64decode(channel["schema"])
    for file in descriptor_pb2.FileDescriptorSet.FromString(data).file:
        pool.Add(file)
    return message_factory.GetMessageClass(pool.FindMessageTypeByName(channel["schemaName"]))


@asynccontextmanager
async def connected(
    url: str, channels: int, tls: ssl.SSLContext | bool = True
) -> AsyncIterator[FoxgloveClient]:
    """Give a client that knows so many channels."""
    async with (
        ClientSession() as session,
        session.ws_connect(url, protocols=[PROTOCOL], max_msg_size=0, ssl=tls) as socket,
    ):
        assert socket.protocol == PROTOCOL
        client = FoxgloveClient(socket)
        await client.greet(channels)
        yield client
