"""The numbers of a running board as Prometheus metrics, answered by the event loop itself."""

from __future__ import annotations

import asyncio
import contextlib
import socket
from collections.abc import Callable, Iterator
from typing import TYPE_CHECKING, Any, Final

from vbus.errors import PluginError, TransportError

if TYPE_CHECKING:
    from prometheus_client.metrics_core import Metric

PATH: Final = "/metrics"
PATIENCE_SECONDS: Final = 5.0
"""How long a client may take to ask, or to take its answer."""
_LINES: Final = 100
_MISSING: Final = "metrics need prometheus-client; install it with: pip install prometheus-client"


class MetricsPort:
    """Answers HTTP requests for ``/metrics`` on one address.

    Args:
        host: numeric address.
        port: 0 is any free one.
        statistics: what :meth:`vbus.server.server.Server.statistics` returns.

    Raises:
        PluginError: prometheus-client is not installed.
    """

    def __init__(self, host: str, port: int, statistics: Callable[[], dict[str, Any]]) -> None:
        try:
            from prometheus_client import CollectorRegistry
        except ImportError as error:
            raise PluginError(_MISSING) from error
        self._host: str = host
        self._port: int = port
        self._registry: CollectorRegistry = CollectorRegistry()
        self._registry.register(Collector(statistics))
        self._socket: socket.socket | None = None
        self._task: asyncio.Task[None] | None = None

    @property
    def url(self) -> str:
        """Where the metrics are, with the port that was found."""
        host = f"[{self._host}]" if ":" in self._host else self._host
        return f"http://{host}:{self._port}{PATH}"

    def open(self, loop: asyncio.AbstractEventLoop) -> None:
        """Listen from now on.

        Raises:
            TransportError: the address is taken, or not of this computer.
        """
        family = socket.AF_INET6 if ":" in self._host else socket.AF_INET
        listener = socket.socket(family, socket.SOCK_STREAM)
        try:
            listener.setsockopt(socket.SOL_SOCKET, socket.SO_REUSEADDR, 1)
            listener.bind((self._host, self._port))
            listener.listen(16)
        except OSError as error:
            listener.close()
            raise TransportError(
                f"{self.url}: cannot listen: {error.strerror}; free the address, or give another"
                " in [metrics] or --metrics (port 0 is any free one)"
            ) from error
        listener.setblocking(False)
        self._port = listener.getsockname()[1]
        self._socket = listener
        self._task = loop.create_task(self._serve(listener))

    def close(self) -> None:
        """Listen no more; may be called again."""
        if self._task is not None:
            self._task.cancel()
            self._task = None
        if self._socket is not None:
            self._socket.close()
            self._socket = None

    async def _serve(self, listener: socket.socket) -> None:
        loop = asyncio.get_running_loop()
        talks: set[asyncio.Task[None]] = set()
        try:
            while True:
                try:
                    client, _ = await loop.sock_accept(listener)
                except OSError:  # the client gave up, or descriptors have run out for now
                    await asyncio.sleep(0.1)
                    continue
                talk = loop.create_task(self._talk(client))
                talks.add(talk)
                talk.add_done_callback(talks.discard)
        finally:
            for talk in talks:
                talk.cancel()

    async def _talk(self, client: socket.socket) -> None:
        writer: asyncio.StreamWriter | None = None
        try:
            reader, writer = await asyncio.open_connection(sock=client)
            with contextlib.suppress(OSError, ValueError, TimeoutError):
                async with asyncio.timeout(PATIENCE_SECONDS):
                    writer.write(await self._answer(reader))
                    await writer.drain()
        finally:
            if writer is None:
                client.close()
            else:
                writer.close()

    async def _answer(self, reader: asyncio.StreamReader) -> bytes:
        """Read one request; return the whole reply."""
        method, _, rest = (await reader.readline()).decode("latin-1").partition(" ")
        target = rest.partition(" ")[0].partition("?")[0]
        accept = ""
        for _ in range(_LINES):
            line = (await reader.readline()).decode("latin-1").strip()
            if not line:
                break
            name, _, value = line.partition(":")
            if name.lower() == "accept":
                accept = value.strip()
        else:
            return _reply(
                "431 Request Header Fields Too Large", "text/plain", b"too many headers\n"
            )
        if method not in ("GET", "HEAD"):
            return _reply("405 Method Not Allowed", "text/plain", b"only GET and HEAD\n")
        if target != PATH:
            return _reply("404 Not Found", "text/plain", f"metrics are at {PATH}\n".encode())
        from prometheus_client.exposition import choose_encoder

        encoder, content_type = choose_encoder(accept)
        body = encoder(self._registry)
        return _reply("200 OK", content_type, body, method == "HEAD")


def _reply(status: str, content_type: str, body: bytes, head_only: bool = False) -> bytes:
    head = (
        f"HTTP/1.1 {status}\r\nContent-Type: {content_type}\r\nContent-Length: {len(body)}\r\n"
        "Connection: close\r\n\r\n"
    )
    return head.encode() + (b"" if head_only else body)


class Collector:
    """Makes Prometheus metrics of a board's statistics, each time somebody asks."""

    def __init__(self, statistics: Callable[[], dict[str, Any]]) -> None:
        self._statistics: Callable[[], dict[str, Any]] = statistics

    def describe(self) -> Iterator[Metric]:
        """Say nothing beforehand: the names do not depend on anything."""
        return iter(())

    def collect(self) -> Iterator[Metric]:
        """Yield every metric as it is now."""
        told = self._statistics()
        board = told["board"]
        yield from _cycles(board, told)
        yield from _links(board, told)
        yield from _time(board, told)
        yield _histogram(
            "vbus_round_trip_seconds",
            "From a message's arrival in the server until its answer is handed over",
            board,
            told["round_trips"],
            "ns",
            1e9,
        )


def _cycles(board: str, told: dict[str, Any]) -> Iterator[Metric]:
    from prometheus_client.core import CounterMetricFamily

    cycles = CounterMetricFamily(
        "vbus_bus_cycles", "Whole bus cycles hosts have made", labels=("board", "chip", "direction")
    )
    for chip in told["chips"]:
        cycles.add_metric((board, chip["name"], "read"), chip["reads"])
        cycles.add_metric((board, chip["name"], "write"), chip["writes"])
    yield cycles
    violations = CounterMetricFamily(
        "vbus_violations", "Breaches of a rule by hosts", labels=("board", "rule")
    )
    for rule, count in sorted(told["violations"].items()):
        violations.add_metric((board, rule), count)
    yield violations


def _links(board: str, told: dict[str, Any]) -> Iterator[Metric]:
    from prometheus_client.core import CounterMetricFamily, GaugeMetricFamily

    open_now = GaugeMetricFamily("vbus_sessions", "Open sessions", labels=("board", "link"))
    served = CounterMetricFamily(
        "vbus_sessions_served", "Sessions opened since the start", labels=("board", "link")
    )
    size = CounterMetricFamily(
        "vbus_link_bytes", "Bytes carried by a link", labels=("board", "link", "direction")
    )
    for number, link in enumerate(told["links"]):
        labels = (board, f"{number}:{link['url']}")
        open_now.add_metric(labels, link["sessions"])
        served.add_metric(labels, link["served"])
        size.add_metric((*labels, "received"), link["received"])
        size.add_metric((*labels, "sent"), link["sent"])
    yield from (open_now, served, size)


def _time(board: str, told: dict[str, Any]) -> Iterator[Metric]:
    from prometheus_client.core import CounterMetricFamily, GaugeMetricFamily, InfoMetricFamily

    info = InfoMetricFamily("vbus_board", "The board", labels=("board",))
    info.add_metric((board,), {"policy": told["policy"], "rate": str(told["rate"])})
    yield info
    for name, text, value in (
        ("vbus_chip_time_seconds", "Chip time since the start", told["time_ps"]),
        ("vbus_slipped_seconds", "Chip time left out after stalls", told["slipped_ps"]),
    ):
        counter = CounterMetricFamily(name, text, labels=("board",))
        counter.add_metric((board,), value / 1e12)
        yield counter
    worst = GaugeMetricFamily(
        "vbus_worst_lag_seconds", "Largest lag since the start", labels=("board",)
    )
    worst.add_metric((board,), told["worst_lag_ps"] / 1e12)
    yield worst
    text = "How late chip time was when it was brought up to date"
    yield _histogram("vbus_lag_seconds", text, board, told["lag"], "ps", 1e12)


def _histogram(
    name: str, text: str, board: str, told: dict[str, Any], unit: str, scale: float
) -> Metric:
    from prometheus_client.core import HistogramMetricFamily

    buckets = []
    count = 0
    for bound, number in zip(told[f"bounds_{unit}"], told["buckets"], strict=False):
        count += number
        buckets.append((repr(bound / scale), count))
    buckets.append(("+Inf", told["count"]))
    family = HistogramMetricFamily(name, text, labels=("board",))
    family.add_metric((board,), buckets, told[f"sum_{unit}"] / scale)
    return family
