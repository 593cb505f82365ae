"""Snapshots of a running board: taken and loaded on orders of :mod:`vbus.serve.local_socket`."""

import base64
from collections.abc import Callable, Iterator
from typing import TYPE_CHECKING, Any

from vbus.board.board import Board
from vbus.board.host_bus import HostBus
from vbus.core.errors import SnapshotError
from vbus.serve.local_socket import Order
from vbus.serve.session import Session
from vbus.serve.time.pacer import WallClockPacer

if TYPE_CHECKING:
    from vbus.board.snapshot import Hosts, Snapshot


def load_into(board: Board, snapshot: "Snapshot", wires: "Hosts | None" = None) -> None:
    """Bring a board to a snapshot.

    Raises:
        SnapshotError: the snapshot is of another board, or the board writes a journal.
    """
    from vbus.board.snapshot import restore

    if board.port_type is not HostBus:
        raise SnapshotError(
            f'"{board.name}" writes a journal, which begins at power-on and could not be replayed'
            " over a jump in time; run the board without one"
        )
    restore(board, snapshot, wires)


def snapshot_orders(
    board: Board, pacer: WallClockPacer, sessions: Callable[[], Iterator[Session]]
) -> dict[str, Order]:
    """Return ``snap.save`` and ``snap.load``, for one served board.

    Args:
        board: the board.
        pacer: what moves its time.
        sessions: gives those that are open.
    """

    def wires() -> "Hosts":
        """Return the wire formats of all sessions, by the place of their port."""
        known = {id(session.port): session.protocol for session in sessions()}
        return {
            number: known[id(port)] for number, port in enumerate(board.ports) if id(port) in known
        }

    def save(request: dict[str, Any]) -> dict[str, Any]:
        from vbus.board.snapshot import take, write

        snapshot = take(board, wires())
        data = write(snapshot)
        return {
            "when_ps": snapshot.when,
            "hash": snapshot.digest,
            "data": base64.b64encode(data).decode(),
        }

    def load(request: dict[str, Any]) -> dict[str, Any]:
        from vbus.board.snapshot import read

        snapshot = read(base64.b64decode(request["data"], validate=True))
        load_into(board, snapshot, wires())
        pacer.jumped()
        for session in list(sessions()):
            session.resume()
        return {"when_ps": snapshot.when, "hash": snapshot.digest}

    return {"snap.save": save, "snap.load": load}
