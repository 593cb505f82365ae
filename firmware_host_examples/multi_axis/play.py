"""Plays a score on the nodes of a board: the host's process, in virtual or in real time."""

import asyncio
import json
import time
from collections.abc import Callable
from pathlib import Path
from typing import Any

import msgpack

from multi_axis.chips import Cycle
from multi_axis.score import MS, PIN, READ, US, Event, Score
from vbus.board.config import read_board_file
from vbus.boardfile.sections import BoardFile
from vbus.client.aio.bus import Bus, connect
from vbus.client.message import Later
from vbus.core.errors import NodeError, TransportError, VbusError
from vbus.network import keys
from vbus.network.session import close_session, open_session
from vbus.serve.nodes.ordering import order

PATIENCE = 60.0
"""Seconds to wait for nodes that are being started, or for a busy machine."""
CHUNK = 400
"""Events in one message."""
AHEAD = 2500 * MS
"""How far ahead a score is ordered in real time."""


class Played:
    """What has come of a score.

    Attributes:
        cycles: bus cycles of each chip, in order; instants count from the score's beginning.
        status: in real time, what each node tells of itself (vbus ls --json).
    """

    def __init__(self) -> None:
        self.cycles: dict[str, list[Cycle]] = {}
        self.status: dict[str, dict[str, Any]] = {}


def play(board: Path, score: Score, endpoint: str, period: int) -> Played:
    """Play a score on a board whose nodes are running, or being started.

    Args:
        board: the board file.
        score: what the host does.
        endpoint: where the nodes and this host meet.
        period: in real time the score begins at a multiple of this (ps).

    Raises:
        VbusError: a node is not there, is lost, or comes too late.
    """
    file, _ = read_board_file(board)
    if file.board.time == "realtime":
        return _in_real_time(file, score, endpoint, period)
    return asyncio.run(_in_virtual_time(file, score, endpoint))


# -- virtual time: one session with each chip ------------------------------------------------------


async def _in_virtual_time(file: BoardFile, score: Score, endpoint: str) -> Played:
    """Every session runs its part; the nodes see to it that time is one."""
    played = Played()
    buses = await asyncio.gather(
        *(
            _open(
                f"zenoh:{file.board.name}.{chip.node}/{chip.name}?connect={endpoint}&patience={PATIENCE:g}"
            )
            for chip in file.chips
        )
    )
    # Instants at which something happens on all chips are asked for, not believed.
    common = set.intersection(*({e.at for e in score.of({c.name})} for c in file.chips))
    try:
        results = await asyncio.gather(
            *(
                _run(bus, score.of({chip.name}), common, score.end + US)
                for bus, chip in zip(buses, file.chips, strict=True)
            )
        )
    finally:
        for bus in buses:
            await bus.close()
    played.cycles = {chip.name: found for chip, found in zip(file.chips, results, strict=True)}
    return played


async def _open(where: str) -> Bus:
    """Open a session, as soon as the node is there."""
    end = time.monotonic() + PATIENCE
    while True:
        try:
            return await connect(where, PATIENCE)
        except TransportError:
            if time.monotonic() > end:
                raise
            await asyncio.sleep(0.1)


async def _run(bus: Bus, events: list[Event], common: set[int], end: int) -> list[Cycle]:
    """Run one chip's events, each at its instant, and wait for the end; return its cycles."""
    cycle = bus.info.chips[0].cycle_ps
    now = await bus.now()
    if bus.info.policy != "lockstep":
        raise VbusError(f"{bus.info.board} runs in {bus.info.policy}; give --real-time here too")
    if now:
        raise VbusError(
            f"time of {bus.info.board} stands at {now / 1e9:g} ms: start the nodes anew"
        )
    found: list[Cycle] = []
    for first in range(0, len(events), CHUNK):
        results: list[tuple[Event, Later[int] | None, Later[int] | None]] = []
        async with bus.batch() as batch:
            for event in events[first : first + CHUNK]:
                begin = event.at - (0 if event.verb == PIN else cycle)
                if begin > now:
                    batch.delay(begin - now)
                data = None
                if event.verb == PIN:
                    batch.pin(event.pin, event.data)
                elif event.verb == READ:
                    data = batch.read(event.address)
                else:
                    batch.write(event.address, event.data)
                now = event.at
                results.append((event, data, batch.now() if event.at in common else None))
            batch.now()
        for event, data, when in results:
            if event.verb != PIN:
                byte = event.data if data is None else data.value
                at = event.at if when is None else when.value
                found.append(Cycle(at, event.verb != READ, event.address, byte))
    # A session that has let time pass holds it for all: it is let go up to the end.
    await bus.delay(end - now)
    await bus.now()
    return found


# -- real time: ordered for an instant that is to come ---------------------------------------------


def _in_real_time(file: BoardFile, score: Score, endpoint: str, period: int) -> Played:
    """The nodes take the whole score, and what they do is watched."""
    name = file.board.name
    rows: dict[str, list[list[Any]]] = {chip.name: [] for chip in file.chips}
    lost: list[int] = []

    def take(chip: str) -> Callable[[Any], None]:
        def sample(message: Any) -> None:
            missing, some = msgpack.unpackb(message.payload.to_bytes())
            lost.append(missing)
            rows[chip] += some

        return sample

    session = open_session(connect=(endpoint,), mode="client")
    try:
        kept = [
            session.declare_subscriber(
                keys.cycles(f"{name}.{chip.node}", chip.name), take(chip.name)
            )
            for chip in file.chips
        ]
        begin = _order(file, score, endpoint, period)
        wanted = {c: sum(e.verb != PIN for e in score.of({c})) for c in rows}
        end = time.monotonic() + PATIENCE
        while any(len(rows[chip]) < wanted[chip] for chip in rows):
            if any(lost) or time.monotonic() > end:
                seen = ", ".join(f"{chip} {len(rows[chip])} of {wanted[chip]}" for chip in rows)
                raise VbusError(f"not all bus cycles were seen: {seen}; is a node overloaded?")
            time.sleep(0.02)
        played = Played()
        for chip, found in rows.items():
            # Row: instant, host, write, address, data.
            played.cycles[chip] = [Cycle(r[0] - begin, bool(r[2]), r[3], r[4]) for r in found]
        for node in file.nodes:
            for reply in session.get(keys.status(f"{name}.{node.name}"), timeout=5.0):
                if reply.ok is not None:
                    played.status[node.name] = json.loads(reply.ok.payload.to_bytes())["node"]
        del kept
    finally:
        close_session(session)
    return played


def _order(file: BoardFile, score: Score, endpoint: str, period: int) -> int:
    """Order the score on all nodes, as soon as they are there; return when it begins (ps)."""
    end = time.monotonic() + PATIENCE
    while True:
        try:
            # An order of nothing: whether all nodes are there.
            order(file, "", "score", AHEAD, (endpoint,))
            break
        except (NodeError, TransportError):
            if time.monotonic() > end:
                raise
            time.sleep(0.1)
    return order(file, score.lines(), "score", AHEAD, (endpoint,), period)[0]
