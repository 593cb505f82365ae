"""Snapshots of a running board: taken and loaded on orders (see :mod:`vbus.server.control`)."""

import base64
from typing import TYPE_CHECKING, Any

from vbus.board.board import Board
from vbus.board.host_bus import HostBus
from vbus.board.snapshot import Hosts, Snapshot, read, restore, take, write
from vbus.errors import SnapshotError

if TYPE_CHECKING:
    from vbus.server.server import Server


def load_into(board: Board, snapshot: Snapshot, wires: Hosts | None = None) -> None:
    """Bring a board to a snapshot.

    Raises:
        SnapshotError: the snapshot is of another board, or the board writes a journal.
    """
    if board.port_type is not HostBus:
        raise SnapshotError(
            f'"{board.name}" writes a journal, which begins at power-on and could not be replayed'
            " over a jump in time; run the board without one"
        )
    restore(board, snapshot, wires)


class SnapshotOrders:
    """``snap.save`` and ``snap.load``, for one served board.

    Args:
        server: the board's server; its control socket takes the orders from now on.
    """

    def __init__(self, server: "Server") -> None:
        self._server: Server = server
        server.control.orders["snap.save"] = self._save
        server.control.orders["snap.load"] = self._load

    def _wires(self) -> Hosts:
        """Return the wire formats of all sessions, by the place of their port."""
        wires = {id(session.port): session.protocol for session in self._server.sessions()}
        return {
            number: wires[id(port)]
            for number, port in enumerate(self._server.board.ports)
            if id(port) in wires
        }

    def _save(self, request: dict[str, Any]) -> dict[str, Any]:
        snapshot = take(self._server.board, self._wires())
        data = write(snapshot)
        return {
            "when_ps": snapshot.when,
            "hash": snapshot.digest,
            "data": base64.b64encode(data).decode(),
        }

    def _load(self, request: dict[str, Any]) -> dict[str, Any]:
        snapshot = read(base64.b64decode(request["data"], validate=True))
        server = self._server
        load_into(server.board, snapshot, self._wires())
        server.pacer.jumped()
        for session in list(server.sessions()):
            session.resume()
        return {"when_ps": snapshot.when, "hash": snapshot.digest}
