"""Faults of a running board, by orders (:mod:`vbus.serve.local_socket`), and of its links."""

from collections.abc import Sequence
from typing import TYPE_CHECKING, Any, Final

import msgspec

from vbus.board.board import Board
from vbus.core.options import Value
from vbus.faults.row import MESSAGES, LinkActs, misfit
from vbus.serve.host_entry import HostEntry
from vbus.serve.local_socket import Order
from vbus.serve.message_session import MessageSession
from vbus.serve.session import Session
from vbus.transports.traffic import AnswerFault, MessageFault, Traffic

if TYPE_CHECKING:
    from vbus.faults.armed import Armed

_KEYS: Final = ("name", "target", "when", "until", "parameters")


class _LinkFault(AnswerFault):
    """One fault on one session."""

    def __init__(self, session: Session, name: str, once: bool) -> None:
        super().__init__(name, once)
        self._session: Session = session

    def begin(self) -> "_LinkFault":
        """Act from now on."""
        self._session.add_filter(self._pass)
        if self.name == "link_dead":
            self._session.stop_reading()
        return self

    def _pass(self, out: bytearray) -> None:
        if self.bend(out):
            self.undo()

    def undo(self) -> None:
        """Let the session send and read as ever; what was held back is sent now."""
        self._session.remove_filter(self._pass, bytes(self.held_back))
        if self.name == "link_dead":
            self._session.read_again()


class FaultOrders(LinkActs):
    """``fault.arm``, ``fault.clear``, ``fault.list`` and ``fault.log``; and faults of links.

    Args:
        board: the board.
        hosts: the host entries.
    """

    def __init__(self, board: Board, hosts: Sequence[HostEntry]) -> None:
        self._board: Board = board
        self._hosts: Sequence[HostEntry] = hosts
        self._of_messages: dict[int, tuple[Traffic, MessageFault]] = {}
        self.acting: dict[int, tuple[HostEntry, str, list[_LinkFault]]] = {}
        """Faults that act on links, by number: the host entry, name, sessions."""

    # -- orders -------------------------------------------------------------------------------

    def orders(self) -> dict[str, Order]:
        """Return the orders by name."""
        return {
            "fault.arm": self._arm,
            "fault.clear": self._clear,
            "fault.list": self._list,
            "fault.log": self._log,
        }

    def _arm(self, request: dict[str, Any]) -> dict[str, Any]:
        given = {key: request.get(key) for key in _KEYS}
        parameters = given["parameters"] or {}
        if not isinstance(parameters, dict):
            raise ValueError("parameters are a JSON object")
        armed = self._board.faults.arm(
            str(request["name"]), given["target"] or "", given["when"], given["until"], **parameters
        )
        return _as_json(armed)

    def _clear(self, request: dict[str, Any]) -> list[dict[str, Any]]:
        which = request.get("which", "all")
        return [_as_json(armed) for armed in self._board.faults.clear(which)]

    def _list(self, request: dict[str, Any]) -> list[dict[str, Any]]:
        return [_as_json(armed) for armed in self._board.faults.all()]

    def _log(self, request: dict[str, Any]) -> Any:
        return msgspec.to_builtins(list(self._board.faults.log))

    # -- links --------------------------------------------------------------------------------

    def check(self, name: str, target: str) -> None:
        """Refuse a fault that a link can never have.

        Raises:
            ValueError: it is of messages and the link carries bytes, or the other way round.
        """
        fault, host = self._board.faults.find(name), self._host(target)
        if host is None:
            if fault.family == MESSAGES:
                raise ValueError(_no_link(target))
            return
        transport = host.transport
        if said := misfit(fault, target, transport.url, transport.traffic is not None):
            raise ValueError(said)

    def _host(self, target: str) -> HostEntry | None:
        """Return the host entry of a link, ``"host0"``; None if there is none."""
        place = int(target[4:])
        return self._hosts[place] if place < len(self._hosts) else None

    def begin(
        self, number: int, name: str, target: str, once: bool, values: dict[str, Value]
    ) -> str:
        """Let a fault act on a link.

        Raises:
            ValueError: there is no such link, it has no host, or it cannot have the fault.
        """
        self.check(name, target)
        host = self._host(target)
        if host is None:
            raise ValueError(_no_link(target))
        sessions, transport = list(host.sessions), host.transport
        if transport.traffic is not None and name != "link_closed":
            fault = MessageFault(name, values, once)
            transport.traffic.add(fault)
            if not once:
                self._of_messages[number] = transport.traffic, fault
            return f"{len(sessions)} sessions"
        if name != "link_closed" and any(
            isinstance(session, MessageSession) for session in sessions
        ):
            raise ValueError(f"{target} carries whole messages; its faults are its own")
        if not sessions and name != "link_dead":
            raise ValueError(f"no host is connected to {target}")
        if name == "link_closed":
            for session in sessions:
                session.hang_up_soon("closed by a fault")
            return f"{len(sessions)} sessions closed"
        faults = [_LinkFault(session, name, once).begin() for session in sessions]
        if not once:
            self.acting[number] = (host, name, faults)
        return f"{len(sessions)} sessions"

    def end(self, number: int) -> None:
        """Let it act no more."""
        if number in self._of_messages:
            traffic, fault = self._of_messages.pop(number)
            traffic.remove(fault)
        for one in self.acting.pop(number)[2] if number in self.acting else ():
            one.undo()

    def connected(self, host: HostEntry, session: Session) -> None:
        """A host has connected while faults act: they act on it too."""
        for where, name, faults in self.acting.values():
            if where is host and not isinstance(session, MessageSession):
                faults.append(_LinkFault(session, name, False).begin())


def _no_link(target: str) -> str:
    return f"there is no link {target}: count the [[hosts]] from 0"


def _as_json(armed: "Armed") -> dict[str, Any]:
    return {
        "number": armed.number,
        "name": armed.name,
        "target": armed.target,
        "when": armed.when.text,
        "until": armed.until.text,
        "parameters": armed.values,
        "state": armed.state,
        "fired": armed.fired,
        "text": str(armed),
    }
