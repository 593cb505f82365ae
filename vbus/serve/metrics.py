"""The numbers of a running board as Prometheus metrics, answered by the event loop itself."""

import asyncio
import contextlib
import os
import socket
from collections.abc import Callable, Iterable, Iterator
from typing import Any, Final

from vbus.core.errors import TransportError, listen_errors
from vbus.transports.base import Link
from vbus.transports.sockets import TcpTransport

PATH: Final = "/metrics"
PATIENCE_SECONDS: Final = 5.0
"""How long a client may take to ask, or to take its answer."""
_LINES: Final = 100
TEXT: Final = "text/plain; version=0.0.4; charset=utf-8"
OPEN: Final = "application/openmetrics-text; version=1.0.0; charset=utf-8"
"""The two formats there are: the same lines, but for names of counters and a last line."""


class MetricsPort:
    """Answers HTTP requests for ``/metrics`` on one address.

    Args:
        host: numeric address.
        port: 0 is any free one.
        statistics: what :meth:`vbus.serve.server.Server.statistics` returns.
    """

    def __init__(self, host: str, port: int, statistics: Callable[[], dict[str, Any]]) -> None:
        self._host: str = f"[{host}]" if ":" in host else host
        self._transport: TcpTransport = TcpTransport(f"{host}:{port}", {})
        self._transport.remote = True  # where it is not meant, the address has been refused
        self._boards: list[Callable[[], dict[str, Any]]] = [statistics]
        self._talks: set[asyncio.Task[None]] = set()
        self.url: str = f"http://{self._host}:{port}{PATH}"
        """Where the metrics are, with the port that was found once it is open."""

    def add(self, statistics: Callable[[], dict[str, Any]]) -> None:
        """Show another board of this process too."""
        self._boards.append(statistics)

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
        kind = OPEN if OPEN.partition(";")[0] in accept else TEXT
        lines = exposition([one() for one in self._boards], kind == OPEN)
        return _reply("200 OK", kind, "\n".join((*lines, "")).encode(), method == "HEAD")


def _reply(status: str, content_type: str, body: bytes, head_only: bool = False) -> bytes:
    head = (
        f"HTTP/1.1 {status}\r\nContent-Type: {content_type}\r\nContent-Length: {len(body)}\r\n"
        "Connection: close\r\n\r\n"
    )
    return head.encode() + (b"" if head_only else body)


Samples = Iterable[tuple[dict[str, object], float]]
"""Values, each with its labels."""


def exposition(boards: list[dict[str, Any]], open_metrics: bool) -> Iterator[str]:
    """Give the lines of a page: every number as it is now, each of all boards.

    Args:
        boards: what each board tells of itself.
        open_metrics: in the format of OpenMetrics, else in Prometheus' own.
    """
    for families in zip(*map(_families, boards), strict=True):
        name, kind, text, _ = families[0]
        family = name.removesuffix("_total") if open_metrics else name
        yield f"# HELP {family} {text}"
        yield f"# TYPE {family} {kind}"
        for board, (*_, samples) in zip(boards, families, strict=True):
            for labels, number in samples:
                shown = "".join(f',{key}="{_escaped(value)}"' for key, value in labels.items())
                part = f'{{board="{_escaped(board["board"])}"{shown}}}'
                yield f"{name}{part} {float(number)!r}"
    for name, text, key, unit, scale in (
        ("vbus_lag_seconds", "How late chip time was when it was brought up to date", "lag", "ps",
         1e12),
        ("vbus_round_trip_seconds",
         "From a message's arrival in the server until its answer is handed over", "round_trips",
         "ns", 1e9),
    ):  # fmt: skip
        yield f"# HELP {name} {text}"
        yield f"# TYPE {name} histogram"
        for board in boards:
            yield from _histogram(name, _escaped(board["board"]), board[key], unit, scale)
    if open_metrics:
        yield "# EOF"


def _escaped(value: object) -> str:
    return str(value).replace("\\", r"\\").replace("\n", r"\n").replace('"', r"\"")


def _families(told: dict[str, Any]) -> Iterator[tuple[str, str, str, Samples]]:
    """Give what has one value for each set of labels: its name, its kind, and what it is."""
    links: list[tuple[dict[str, object], dict[str, Any]]] = [
        ({"link": f"{n}:{link['url']}"}, link) for n, link in enumerate(told["links"])
    ]
    yield (
        "vbus_board_info", "gauge", "The board",
        [({"policy": told["policy"], "rate": told["rate"]}, 1)],
    )  # fmt: skip
    yield (
        "vbus_bus_cycles_total", "counter", "Whole bus cycles hosts have made",
        [
            ({"chip": chip["name"], "direction": direction}, chip[f"{direction}s"])
            for chip in told["chips"]
            for direction in ("read", "write")
        ],
    )  # fmt: skip
    yield (
        "vbus_violations_total", "counter", "Breaches of a rule by hosts",
        [({"rule": rule}, count) for rule, count in sorted(told["violations"].items())],
    )  # fmt: skip
    yield (
        "vbus_sessions", "gauge", "Open sessions",
        [(labels, link["sessions"]) for labels, link in links],
    )  # fmt: skip
    yield (
        "vbus_sessions_served_total", "counter", "Sessions opened since the start",
        [(labels, link["served"]) for labels, link in links],
    )  # fmt: skip
    yield (
        "vbus_link_bytes_total", "counter", "Bytes carried by a link",
        [
            ({**labels, "direction": direction}, link[direction])
            for labels, link in links
            for direction in ("received", "sent")
        ],
    )  # fmt: skip
    for name, kind, text, key, scale in (
        ("vbus_chip_time_seconds_total", "counter", "Chip time since the start", "time_ps", 1e12),
        ("vbus_chip_time_left_seconds", "gauge", "Chip time until time ends", "time_left_ps",
         1e12),
        ("vbus_slipped_seconds_total", "counter", "Chip time left out after stalls", "slipped_ps",
         1e12),
        ("vbus_overload_ratio", "gauge",
         "How many times the machine would be enough for what moves; 0 while it keeps up",
         "overload", 1),
        ("vbus_worst_lag_seconds", "gauge", "Largest lag since the start", "worst_lag_ps", 1e12),
    ):  # fmt: skip
        yield name, kind, text, [({}, told[key] / scale)]


def _histogram(
    name: str, board: str, told: dict[str, Any], unit: str, scale: float
) -> Iterator[str]:
    count = 0
    for bound, number in zip(told[f"bounds_{unit}"], told["buckets"], strict=False):
        count += number
        yield f'{name}_bucket{{board="{board}",le="{bound / scale!r}"}} {float(count)!r}'
    yield f'{name}_bucket{{board="{board}",le="+Inf"}} {float(told["count"])!r}'
    yield f'{name}_count{{board="{board}"}} {float(told["count"])!r}'
    yield f'{name}_sum{{board="{board}"}} {told[f"sum_{unit}"] / scale!r}'
