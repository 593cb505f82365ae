"""The numbers of a running board as Prometheus metrics, answered by the event loop itself."""

from __future__ import annotations

import asyncio
import contextlib
import os
import socket
from collections.abc import Callable, Iterable, Iterator
from typing import TYPE_CHECKING, Any, Final

from vbus.core.errors import TransportError, import_errors, listen_errors
from vbus.transports.base import Link
from vbus.transports.sockets import TcpTransport

if TYPE_CHECKING:
    from prometheus_client.metrics_core import Metric

PATH: Final = "/metrics"
PATIENCE_SECONDS: Final = 5.0
"""How long a client may take to ask, or to take its answer: half of Prometheus's own timeout."""
_LINES: Final = 100
"""Lines of a request that are read: no scraper sends as many."""


class MetricsPort:
    """Answers HTTP requests for ``/metrics`` on one address.

    Args:
        host: numeric address.
        port: 0 is any free one.
        statistics: what :meth:`vbus.serve.server.Server.statistics` returns.

    Raises:
        PluginError: prometheus-client is not installed.
    """

    def __init__(self, host: str, port: int, statistics: Callable[[], dict[str, Any]]) -> None:
        with import_errors("metrics need prometheus-client", "prometheus-client"):
            from prometheus_client import CollectorRegistry
        self._host: str = f"[{host}]" if ":" in host else host
        self._transport: TcpTransport = TcpTransport(f"{host}:{port}", {})
        self._transport.remote = True  # where it is not meant, the address has been refused
        self._registry: CollectorRegistry = CollectorRegistry()
        self._collector: Collector = Collector(statistics)
        self._registry.register(self._collector)
        self._talks: set[asyncio.Task[None]] = set()
        self.url: str = f"http://{self._host}:{port}{PATH}"
        """Where the metrics are, with the port that was found once it is open."""

    def add(self, statistics: Callable[[], dict[str, Any]]) -> None:
        """Show another board of this process too."""
        self._collector.boards.append(statistics)

    def open(self, loop: asyncio.AbstractEventLoop) -> None:
        """Listen from now on.

        Raises:
            TransportError: the address is taken, or not of this computer.
        """

        def linked(link: Link) -> None:
            talk = loop.create_task(self._talk(link))
            self._talks.add(talk)
            talk.add_done_callback(self._talks.discard)

        with listen_errors(self.url, "in [metrics] or --metrics", TransportError):
            self._transport.open(loop, linked)
        port = self._transport.url.rpartition(":")[2]
        self.url = f"http://{self._host}:{port}{PATH}"

    def close(self) -> None:
        """Listen no more; may be called again."""
        self._transport.close()
        for talk in self._talks:
            talk.cancel()

    async def _talk(self, link: Link) -> None:
        with contextlib.closing(link), contextlib.suppress(OSError, ValueError, TimeoutError):
            client = socket.socket(fileno=os.dup(link.fd))
            reader, writer = await asyncio.open_connection(sock=client)
            with contextlib.closing(writer):
                async with asyncio.timeout(PATIENCE_SECONDS):
                    writer.write(await self._answer(reader))
                    await writer.drain()

    async def _answer(self, reader: asyncio.StreamReader) -> bytes:
        """Read one request; return the whole reply."""
        try:
            return await self._answer_to(reader)
        except ValueError as error:  # a line too long, or an Accept header that makes no sense
            return _reply("400 Bad Request", "text/plain", f"{error}\n".encode())

    async def _answer_to(self, reader: asyncio.StreamReader) -> bytes:
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
    """Makes Prometheus metrics of the statistics of boards, at each request."""

    def __init__(self, statistics: Callable[[], dict[str, Any]]) -> None:
        self.boards: list[Callable[[], dict[str, Any]]] = [statistics]

    def describe(self) -> Iterator[Metric]:
        """Say nothing beforehand: the names do not depend on anything."""
        return iter(())

    def collect(self) -> Iterator[Metric]:
        """Yield every metric as it is now, each with the samples of all boards."""
        for metric, *others in zip(*(self._metrics(one()) for one in self.boards), strict=True):
            for other in others:
                metric.samples += other.samples
            yield metric

    @staticmethod
    def _metrics(statistics: dict[str, Any]) -> Iterator[Metric]:
        board = statistics["board"]
        yield _info(board, statistics)
        yield from _families(board, statistics)
        text = "How late chip time was when it was brought up to date"
        yield _histogram("vbus_lag_seconds", text, board, statistics["lag"], "ps", 1e12)
        yield _histogram(
            "vbus_round_trip_seconds",
            "From a message's arrival in the server until its answer is handed over",
            board,
            statistics["round_trips"],
            "ns",
            1e9,
        )


Samples = Iterable[tuple[tuple[str, ...], float]]
"""Values, each with what its labels say."""


def _families(board: str, statistics: dict[str, Any]) -> Iterator[Metric]:
    """Yield what has one value for each set of labels."""
    from prometheus_client.core import CounterMetricFamily, GaugeMetricFamily

    links = [
        ((f"{number}:{link['url']}",), link) for number, link in enumerate(statistics["links"])
    ]
    rows: tuple[tuple[Any, str, str, tuple[str, ...], Samples], ...] = (
        (
            CounterMetricFamily, "vbus_bus_cycles", "Whole bus cycles hosts have made",
            ("chip", "direction"),
            [
                ((chip["name"], direction), chip[f"{direction}s"])
                for chip in statistics["chips"]
                for direction in ("read", "write")
            ],
        ),
        (
            CounterMetricFamily, "vbus_violations", "Breaches of a rule by hosts", ("rule",),
            [((rule,), count) for rule, count in sorted(statistics["violations"].items())],
        ),
        (
            GaugeMetricFamily, "vbus_sessions", "Open sessions", ("link",),
            [(labels, link["sessions"]) for labels, link in links],
        ),
        (
            CounterMetricFamily, "vbus_sessions_served", "Sessions opened since the start",
            ("link",), [(labels, link["served"]) for labels, link in links],
        ),
        (
            CounterMetricFamily, "vbus_link_bytes", "Bytes carried by a link",
            ("link", "direction"),
            [
                ((*labels, direction), link[direction])
                for labels, link in links
                for direction in ("received", "sent")
            ],
        ),
    )  # fmt: skip
    single = (
        (kind, name, text, (), [((), statistics[key] / scale)])
        for kind, name, text, key, scale in (
            (CounterMetricFamily, "vbus_chip_time_seconds", "Chip time since the start",
             "time_ps", 1e12),
            (GaugeMetricFamily, "vbus_chip_time_left_seconds", "Chip time until time ends",
             "time_left_ps", 1e12),
            (CounterMetricFamily, "vbus_slipped_seconds", "Chip time left out after stalls",
             "slipped_ps", 1e12),
            (GaugeMetricFamily, "vbus_overload_ratio",
             "How many times the machine would be enough for what moves; 0 while it keeps up",
             "overload", 1),
            (GaugeMetricFamily, "vbus_worst_lag_seconds", "Largest lag since the start",
             "worst_lag_ps", 1e12),
        )
    )  # fmt: skip
    for kind, name, text, labels, samples in (*rows, *single):
        family = kind(name, text, labels=("board", *labels))
        for values, number in samples:
            family.add_metric((board, *values), number)
        yield family


def _info(board: str, statistics: dict[str, Any]) -> Metric:
    from prometheus_client.core import InfoMetricFamily

    info = InfoMetricFamily("vbus_board", "The board", labels=("board",))
    info.add_metric((board,), {"policy": statistics["policy"], "rate": str(statistics["rate"])})
    return info


def _histogram(
    name: str, text: str, board: str, statistics: dict[str, Any], unit: str, scale: float
) -> Metric:
    from prometheus_client.core import HistogramMetricFamily

    buckets = []
    count = 0
    for bound, number in zip(statistics[f"bounds_{unit}"], statistics["buckets"], strict=False):
        count += number
        buckets.append((repr(bound / scale), count))
    buckets.append(("+Inf", statistics["count"]))
    family = HistogramMetricFamily(name, text, labels=("board",))
    family.add_metric((board,), buckets, statistics[f"sum_{unit}"] / scale)
    return family
