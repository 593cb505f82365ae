"""Nodes of other processes, asked for their parts of a snapshot over the link of this one."""

from collections.abc import Callable
from typing import Any, Final

import msgspec

from vbus.cluster.node_link import NodeLink
from vbus.cluster.ordering import NodeRequest, read_answer
from vbus.cluster.peers import Peers
from vbus.cluster.timebase import LET_IN
from vbus.errors import VbusError
from vbus.kernel import NEVER

ASK_SECONDS: Final = LET_IN + 30.0
"""How long a node may take: it says itself why it waits, and what it sends may be long."""


class Elsewhere:
    """Takes the order to ask a node of another process.

    Args:
        peers: the nodes of this process, and what they know of the others.
        link: to the others.
    """

    def __init__(self, peers: Peers, link: NodeLink) -> None:
        self._peers: Peers = peers
        self._link: NodeLink = link

    def order(self, request: dict[str, Any], reply: Callable[[dict[str, Any]], None]) -> None:
        """Ask ``node`` for its part at the end of ``round``; without one, whether it is there.

        Args:
            request: names both.
            reply: takes once, soon or late, what an order's reply has.
        """
        name, number = request.get("node"), request.get("round", -1)
        plan = self._peers.plan
        if name not in plan.nodes or not (isinstance(number, int) and -1 <= number <= NEVER):
            reply({"error": f"{name} is no node of {plan.board}, or {number} no round of it"})
            return

        def take(data: bytes) -> None:
            try:
                reply({"done": self._done(str(name), number, data)})
            except VbusError as error:
                reply({"error": str(error)})

        asked = msgspec.json.encode(NodeRequest(plan.digest, save=number))
        self._link.ask(plan.rank(str(name)), asked, ASK_SECONDS, take)

    def _done(self, name: str, number: int, data: bytes) -> Any:
        """Return what a node has answered, for JSON.

        Raises:
            VbusError: it has not, refuses, or makes no sense.
        """
        state = self._peers.state_seen(name)
        if not data and number < 0:
            return {"answers": False, "state": state}
        if not data:
            raise VbusError(f"node {name} does not answer ({state}); is it running (vbus ls)?")
        answer = read_answer(name, data)
        if answer.error:
            raise VbusError(answer.error)
        if number < 0:
            return {"answers": True, "state": state}
        if answer.part is None:
            raise VbusError(f"node {name} gives an answer without its part of the snapshot")
        return msgspec.to_builtins(answer.part)
