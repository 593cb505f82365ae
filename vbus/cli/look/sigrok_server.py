"""The pins of a running board for PulseView and sigrok-cli, by BeagleLogic's protocol over TCP.

That is what libsigrok's driver ``beaglelogic`` speaks, as it is: lines of text that ask for or set
a number, and ``get``, after which samples flow until ``close`` or the end of the connection.
"""

import asyncio
import socket
from collections.abc import Callable, Iterator, Sequence
from contextlib import ExitStack, closing, contextmanager, suppress
from dataclasses import dataclass, field
from typing import Any, Final

from vbus.cli.sources import Feed
from vbus.core.errors import VbusError, listen_errors
from vbus.core.kernel import SECOND
from vbus.views.scope.pin_recording import Sampler

CHANNELS: Final = (
    "P8_45", "P8_46", "P8_43", "P8_44", "P8_41", "P8_42", "P8_39", "P8_40", "P8_27", "P8_29",
    "P8_28", "P8_30", "P8_21", "P8_20",
)  # fmt: skip
"""What the driver calls its channels; it does not ask for names."""

BYTES_OF_UNIT: Final = {0: 2, 1: 1}
"""Bytes of a sample by what the driver sets as ``sampleunit``."""

SEGMENT: Final = 1 << 14
"""Bytes of a TCP segment at most: even, for the driver takes what it has read for whole samples."""

LONGEST_LINE: Final = 256


def channels_of(description: dict[str, Any]) -> dict[str, str]:
    """Return what is at each of the driver's channels, by its name."""
    wires: list[str] = []
    for lane in description["lanes"]:
        bits = range(lane["width"])
        wires += [lane["name"]] if len(bits) == 1 else [f"{lane['name']}:{bit}" for bit in bits]
    return dict(zip(CHANNELS, wires, strict=False))


@dataclass(eq=False, slots=True)
class SigrokServer:
    """Serves the pins of one chip.

    Attributes:
        board: name of the board.
        chip: name of the chip; "" where there is only one.
        pins: names of pins; none: the host bus first, then the others.
        host: address to listen on.
        port: 0 is any free one.
        report: takes lines: where it listens, and what each channel is.
    """

    board: str
    chip: str
    pins: Sequence[str]
    host: str
    port: int
    report: Callable[[str], None]
    _server: asyncio.Server | None = field(default=None, init=False)

    @contextmanager
    def _told(self) -> Iterator[tuple[dict[str, Any], Iterator[bytes]]]:
        """Watch the pins: what they are, and the frames until the board ends.

        Raises:
            TransportError: no board of that name can be watched.
            VbusError: it has no such chip or pin.
        """
        with closing(Feed(self.board)) as feed:
            yield feed.ask("pins", chip=self.chip, pins=list(self.pins)), feed.messages()

    async def start(self) -> None:
        """Listen from now on.

        Raises:
            VbusError: there is no such board, chip or pin.
            TransportError: the address is taken, or not of this computer.
        """
        with self._told() as (description, _):
            pass  # what is wrong with board, chip or pins is said before anything listens
        family = socket.AF_INET6 if ":" in self.host else socket.AF_INET
        with listen_errors(f"{self.host}:{self.port}", "with --sigrok"), ExitStack() as undo:
            listening = undo.enter_context(socket.socket(family, socket.SOCK_STREAM))
            # Connections of the last server may still be in TIME_WAIT.
            listening.setsockopt(socket.SOL_SOCKET, socket.SO_REUSEADDR, 1)
            listening.setsockopt(socket.IPPROTO_TCP, socket.TCP_MAXSEG, SEGMENT)
            listening.bind((self.host, self.port))
            undo.pop_all()
        self._server = await asyncio.start_server(self._serve, sock=listening, limit=LONGEST_LINE)
        port = listening.getsockname()[1]
        self.report(f"beaglelogic:conn=tcp/{self.host}/{port}")
        for channel, wire in channels_of(description).items():
            self.report(f"{channel} {description['chip']}.{wire}")

    async def stop(self) -> None:
        """Listen no more."""
        if self._server is not None:
            self._server.close()

    async def _serve(self, reader: asyncio.StreamReader, writer: asyncio.StreamWriter) -> None:
        numbers = {
            "samplerate": 20_000_000, "sampleunit": 1, "triggerflags": 0, "memalloc": 1 << 30,
            "bufunitsize": 1 << 16,
        }  # fmt: skip
        capture: asyncio.Task[None] | None = None
        with suppress(ConnectionError, ValueError):  # a line too long is a ValueError
            while line := await reader.readline():
                word, _, number = line.decode("ascii", "replace").strip().partition(" ")
                if word in ("get", "close") and capture is not None:
                    capture.cancel()
                if word == "get":
                    capture = asyncio.create_task(self._capture(writer, numbers))
                elif word == "version":
                    writer.write(b"BeagleLogic 1.0\n")
                elif (number and not (number.isdecimal() and 0 <= int(number) <= SECOND)) or (
                    word == "samplerate" and number and not int(number)
                ):  # fmt: skip
                    writer.write(b"error: a number is 0 to %d, a samplerate not 0\n" % SECOND)
                elif word in numbers and number:
                    numbers[word] = int(number)
                    writer.write(b"ok\n")
                elif word in numbers:
                    writer.write(b"%d\n" % numbers[word])
                if capture is None or capture.done():
                    await writer.drain()
        if capture is not None:
            capture.cancel()
        writer.close()

    async def _capture(self, writer: asyncio.StreamWriter, numbers: dict[str, int]) -> None:
        """Send samples from now on, as time goes on, to the end of the board."""
        rate, width = numbers["samplerate"], BYTES_OF_UNIT.get(numbers["sampleunit"], 2)
        with suppress(OSError, VbusError), self._told() as (description, messages):
            sampler = Sampler(description, rate, width)
            while frames := await asyncio.to_thread(next, messages, b""):
                for samples in sampler.take(frames):
                    writer.write(samples)
                    await writer.drain()
        writer.close()
