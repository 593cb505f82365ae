"""Lanes as channels of the Foxglove SDK: a run as an MCAP file, and a board live.

Every message is of a schema in protobuf and has its instant in picoseconds as a field; its log time
is chip time in nanoseconds.
"""

import asyncio
import io
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from functools import cache
from typing import Any, ClassVar, Final

from vbus.core.errors import import_errors, listen_errors
from vbus.core.kernel import NS
from vbus.views.scope.lane import Lane
from vbus.views.scope.lanes import LINE, MARK_LANE, NUMBER, PACKET_LANE
from vbus.views.scope.recording import COMMAND, OTHER, READ, STATUS_READ, VIOLATED, WRITTEN
from vbus.views.scope.rows import Row, Rows
from vbus.views.wave.signals import plain

with import_errors(
    "MCAP files and Foxglove need foxglove-sdk and protobuf", "foxglove-sdk protobuf"
):
    import foxglove
    from foxglove.websocket import Capability, ServerListener
    from google.protobuf import descriptor_pb2, descriptor_pool, message_factory

PACKAGE: Final = "vbus"
# Some three seconds of one LM629: 3,906 samples a second, in five lanes that move.
MOST_MESSAGES: Final = 1 << 16
"""Messages buffered for a client that does not read; of more, the oldest are left out."""
_TIME: Final = ("time_ps", "UINT64")
MESSAGES: Final[dict[str, tuple[str, tuple[tuple[str, str], ...]]]] = {
    NUMBER: ("Value", (_TIME, ("value", "DOUBLE"))),
    LINE: ("Level", (_TIME, ("level", "UINT32"))),
    PACKET_LANE: ("Packet", (
        _TIME, ("length_ps", "UINT64"), ("text", "STRING"), ("kind", "STRING"),
    )),
    MARK_LANE: ("Mark", (
        _TIME, ("text", "STRING"), ("kind", "STRING"), ("rule", "STRING"), ("clause", "STRING"),
    )),
}  # fmt: skip
"""By kind of lane: name of the message, and its fields with their types."""

PACKET_KINDS: Final = {
    COMMAND: "command", WRITTEN: "written", READ: "read", STATUS_READ: "status",
    VIOLATED: "violation", OTHER: "other",
}  # fmt: skip


@cache
def _file() -> Any:
    """Return the schemas as a file of protobuf."""
    file = descriptor_pb2.FileDescriptorProto(
        name=f"{PACKAGE}.proto", package=PACKAGE, syntax="proto3"
    )
    for name, fields in MESSAGES.values():
        message = file.message_type.add(name=name)
        for number, (field, type_) in enumerate(fields, 1):
            message.field.add(
                name=field, number=number, type=f"TYPE_{type_}", label="LABEL_OPTIONAL"
            )
    return file


@cache
def _class_of(kind: str) -> Any:
    """Return the message class for a kind of lane."""
    pool = descriptor_pool.DescriptorPool()
    pool.Add(_file())
    name, _ = MESSAGES[kind]
    return message_factory.GetMessageClass(pool.FindMessageTypeByName(f"{PACKAGE}.{name}"))


class Channels:
    """A channel for each lane of a board.

    Args:
        rows: knows the lanes.
        context: of the SDK, to which files and servers belong.
    """

    def __init__(self, rows: Rows, context: Any) -> None:
        self._channels: dict[Lane, Any] = {}
        self._lanes: dict[str, Lane] = {}
        """By topic."""
        self._latest: dict[Lane, Row] = {}
        data = descriptor_pb2.FileDescriptorSet(file=[_file()]).SerializeToString()
        for lane in rows.lanes:
            if lane.kind not in MESSAGES:
                continue
            topic = _topic(lane)
            # Lanes whose names differ only in signs would be one topic.
            while topic in self._lanes:
                topic += "_"
            self._lanes[topic] = lane
            name, _ = MESSAGES[lane.kind]
            self._channels[lane] = foxglove.Channel(
                topic,
                message_encoding="protobuf",
                schema=foxglove.Schema(name=f"{PACKAGE}.{name}", encoding="protobuf", data=data),
                metadata={"lane": lane.full_name, "title": lane.title, "unit": lane.unit},
                context=context,
            )

    def log(self, row: Row) -> None:
        """Tell a row to who listens."""
        when, lane, value = row
        self._latest[lane] = row
        self._channels[lane].log(_message(when, lane, value), log_time=when // NS)

    def repeat(self, topic: str) -> None:
        """Send the latest row of a topic once more, for a new listener."""
        row = self._latest.get(self._lanes[topic])
        if row is not None:
            self.log(row)


def _topic(lane: Lane) -> str:
    """Return a topic that needs no quotes: ``/x/real``, ``/x/HI``, ``/x/bus``, ``/violations``."""
    name = lane.full_name
    if lane.kind == PACKET_LANE:
        name = ".".join(name.rsplit(" ", 1))
    return "".join(f"/{plain(part)}" for part in name.split("."))


def _message(when: int, lane: Lane, value: Any) -> bytes:
    if lane.kind == PACKET_LANE:
        fields = {
            "length_ps": value.length, "text": value.text, "kind": PACKET_KINDS[value.kind],
        }  # fmt: skip
    elif lane.kind == MARK_LANE:
        fields = {name: value[name] or "" for name in ("text", "kind", "rule", "clause")}
    elif lane.kind == LINE:
        fields = {"level": int(value)}
    else:
        fields = {"value": value}
    data: bytes = _class_of(lane.kind)(time_ps=when, **fields).SerializeToString()
    return data


def mcap_file(description: dict[str, Any], frames: Sequence[bytes]) -> bytes:
    """Return a run as an MCAP file; the same run gives the same bytes.

    Args:
        description: the description that comes before the first frame.
        frames: the recording.
    """
    rows = Rows(description)
    context = foxglove.Context()
    file = io.BytesIO()
    with foxglove.open_mcap(file, context=context) as writer:
        channels = Channels(rows, context)
        for row in rows.take(b"".join(frames)):
            channels.log(row)
        about = {
            "board": description["board"], "version": description["vbus"],
            "end_ps": description["now"],
        }  # fmt: skip
        writer.write_metadata("vbus", about)
    return file.getvalue()


class _Listener(ServerListener):  # type: ignore[misc]
    """Called by the SDK, in a thread of its own, when clients subscribe.

    Args:
        subscribed: takes a topic that has a new listener.
    """

    def __init__(self, subscribed: Callable[[str], None]) -> None:
        self._subscribed: Callable[[str], None] = subscribed

    def on_subscribe(self, client: Any, channel: Any) -> None:
        """A client listens to a topic from now on."""
        self._subscribed(channel.topic)


@dataclass(eq=False)
class FoxgloveServer:
    """Serves the lanes of a running board by the protocol of Foxglove's WebSocket.

    Attributes:
        description: the description that comes before the first frame.
        host: address to listen on.
        port: 0 is any free one.
        report: takes the address, once it listens.
        tls: certificate and key (PEM), where other computers are let in.
        pages: how many clients are waited for when the board has ended: none.
    """

    description: dict[str, Any]
    host: str
    port: int
    report: Callable[[str], None]
    tls: tuple[bytes, bytes] | None = None
    pages: ClassVar[int] = 0

    def __post_init__(self) -> None:
        self._rows: Rows = Rows(self.description)
        self._context: Any = foxglove.Context()
        self._channels: Channels = Channels(self._rows, self._context)
        self._server: Any = None

    async def start(self) -> None:
        """Listen from now on.

        Raises:
            TransportError: the address is taken, or not of this computer.
        """
        loop = asyncio.get_running_loop()

        def subscribed(topic: str) -> None:
            loop.call_soon_threadsafe(self._channels.repeat, topic)

        certificate, key = self.tls or (None, None)
        with listen_errors(f"{self.host}:{self.port}", "with --foxglove", RuntimeError):
            self._server = foxglove.start_server(
                name=self.description["board"], host=self.host, port=self.port,
                capabilities=[Capability.Time], server_listener=_Listener(subscribed),
                context=self._context, message_backlog_size=MOST_MESSAGES,
                tls_cert=certificate, tls_key=key,
            )  # fmt: skip
        shown = f"[{self.host}]" if ":" in self.host else self.host
        scheme = "ws" if self.tls is None else "wss"
        self.report(f"{scheme}://{shown}:{self._server.port}")

    async def stop(self) -> None:
        """Send every client away and listen no more."""
        self._server.stop()

    def add(self, frames: bytes) -> None:
        """Tell what is new."""
        for row in self._rows.take(frames):
            self._channels.log(row)
        self._server.broadcast_time(self._rows.now // NS)
