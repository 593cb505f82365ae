"""Serving what a board file describes."""

import asyncio
import logging
from collections.abc import Awaitable, Callable, Mapping
from contextlib import closing
from math import isinf
from pathlib import Path

import msgspec

from vbus.board.build import build, card_of, pin_map_of
from vbus.board.check.network_checks import metrics_address
from vbus.board.config import read_board_file
from vbus.boardfile.sections import BoardFile, HostSection, WaveSection, ZenohSection
from vbus.boardfile.source import Source
from vbus.core.errors import ConfigError, OptionError, content, value_errors
from vbus.core.interpreter import keep_what_is_made
from vbus.network.security import Security
from vbus.network.session import Network
from vbus.serve.loop import tell_ready
from vbus.serve.orders.snapshots import load_into
from vbus.serve.recording import Recording
from vbus.serve.registry import own_board
from vbus.serve.server import LinkSpec, Server, run

log = logging.getLogger("vbus")


def links_of(file: BoardFile) -> list[LinkSpec]:
    """Return the hosts of a board file as the server wants them."""
    return [link_of(file, host, host.transport, host.protocol) for host in file.hosts]


def link_of(file: BoardFile, host: HostSection, transport: str, protocol: str) -> LinkSpec:
    """Return one host of a board file as the server wants it, perhaps at another address."""
    return LinkSpec(
        transport, protocol, list(host.chips), host.cycle, card_of(file, host),
        pin_map_of(file, host.pinmap), network_of(file.zenoh), host.remote, host,
    )  # fmt: skip


def network_of(zenoh: ZenohSection) -> Network:
    """Return where a board file puts its board on the network."""
    security = None
    if zenoh.certificate:
        security = Security(zenoh.certificate, zenoh.key, zenoh.authority, zenoh.allow)
    return Network(zenoh.listen, zenoh.connect, security, zenoh.grace * 1e-12, zenoh.remote)


def serve(
    path: str | Path,
    rate: float | None = None,
    on_ready: Callable[[Server], None] | None = None,
    report: Callable[[str], None] | None = None,
    record: Mapping[str, object] | None = None,
    metrics: str = "",
    snapshot: str = "",
) -> None:
    """Serve the board a file describes until SIGINT or SIGTERM.

    Args:
        path: the board file.
        rate: replaces the file's own rate: chip seconds per second, ``inf`` for no limit.
        on_ready: called once when every link is open.
        report: takes sentences about what happens to links (a device was unplugged).
        record: replaces keys of the file's ``[record]``; ``wave`` is one more waveform file.
        metrics: replaces ``listen`` of the file's ``[metrics]``.
        snapshot: file to go on from; see :mod:`vbus.board.snapshot`.

    Raises:
        ConfigError: the file has mistakes, or no hosts.
        OptionError: one of these makes no sense, or not for this board.
        TransportError: a link cannot be opened.
        SnapshotError: the snapshot is none, or is of another board.
        VbusError: a file cannot be written, or has not all it should have.
    """
    file, source = read_board_file(path)
    file = recorded(file, record or {}, metrics)
    serve_read(file, source, rate, on_ready, report, snapshot)


def recorded(file: BoardFile, record: Mapping[str, object], metrics: str) -> BoardFile:
    """Return a board file with what a command line wants recorded; see :func:`serve`.

    Args:
        file: the board file.
        record: replaces keys of its ``[record]``.
        metrics: replaces ``listen`` of its ``[metrics]``.
    """
    wanted = dict(record)
    waves = file.waves
    if "wave" in wanted:
        waves = (*waves, WaveSection(name="command line", file=str(wanted.pop("wave"))))
    records = msgspec.structs.replace(file.record, **wanted)
    counted = msgspec.structs.replace(file.metrics, listen=metrics or file.metrics.listen)
    return msgspec.structs.replace(file, record=records, waves=waves, metrics=counted)


def paced(file: BoardFile, rate: float | None) -> BoardFile:
    """Return a board file with another rate, if there is one.

    Raises:
        OptionError: the board has no rate, or its nodes cannot keep to this one.
    """
    if rate is None:
        return file
    if file.board.time != "realtime":
        raise OptionError(
            f"{file.path}: a rate makes sense in real time only; this board is {file.board.time}"
        )
    if file.nodes and isinf(rate):
        raise OptionError(
            f"{file.path}: --rate max is for boards without nodes: these keep step by the wall"
            ' clock; give a number, or write time = "lockstep", which runs as fast as it can'
        )
    return msgspec.structs.replace(file, board=msgspec.structs.replace(file.board, rate=rate))


def metrics_of(file: BoardFile) -> tuple[str, int] | None:
    """Return where the numbers of a board are read, if anywhere.

    Raises:
        OptionError: that is no address; what the file itself says has been checked.
    """
    counted = file.metrics
    with value_errors(OptionError, "--metrics: "):
        return metrics_address(counted.listen, counted.remote) if counted.listen else None


def serve_read(
    file: BoardFile,
    source: Source,
    rate: float | None = None,
    on_ready: Callable[[Server], None] | None = None,
    report: Callable[[str], None] | None = None,
    snapshot: str = "",
    before: Callable[[Server], Awaitable[None]] | None = None,
) -> None:
    """Serve a board file that has been read; see :func:`serve`.

    Args:
        before: what is waited for before ``on_ready`` is called.
    """
    if not file.hosts:
        raise ConfigError(
            f"{file.path}: there is no [[hosts]], so nothing could attach; write one, such as\n"
            f'[[hosts]]\ntransport = "pty:$VBUS_RUNTIME/{file.board.name}"'
        )
    file = paced(file, rate)
    address = metrics_of(file)
    board = build(file, source)
    if snapshot:
        if file.record.journal:
            raise OptionError(
                "a journal begins at power-on: there is none of a run that goes on from a snapshot"
            )
        from vbus.board.snapshot import read

        load_into(board, read(content(snapshot), snapshot))
    recording = Recording(board, source.text, file.path, report or log.warning)

    async def begin(server: Server) -> None:
        server.keep(recording)
        recording.start(asyncio.get_running_loop())
        if before is not None:
            await before(server)

    def ready(server: Server) -> None:
        keep_what_is_made()
        if on_ready is not None:
            on_ready(server)
        tell_ready()

    with own_board(board.name), closing(recording):
        recording.open(file.record, file.waves)
        links, settle = links_of(file), recording.settle
        run(board, links, file.board.stall, ready, report, address, settle, begin)
    recording.check()
