"""Orders for a coming instant: the same instant of chip time on all nodes."""

from __future__ import annotations

from typing import TYPE_CHECKING, Final

import msgspec

from vbus.boardfile.sections import BoardFile
from vbus.circuit.orders import LEAD
from vbus.core.errors import ConfigError, NodeError, NodeLostError, VbusError
from vbus.core.kernel import MS, US
from vbus.network.session import open_session
from vbus.nodes.machine_snapshot import NO_ROUNDS, SavedNode
from vbus.nodes.messages import LARGEST
from vbus.nodes.node import Node
from vbus.nodes.plan import pins_of, plan_of
from vbus.nodes.scenario import Scenario, read_scenario
from vbus.serve.serving import network_of

if TYPE_CHECKING:
    import zenoh

ANSWER_SECONDS: Final = 3.0
"""How long a node may take to answer an order; not measured."""
LABEL: Final = "order"
"""Who it is, in traces."""
NO_ORDER: Final = "this is no order"


class NodeRequest(msgspec.Struct, frozen=True, forbid_unknown_fields=True):
    """What is asked of a node.

    Attributes:
        digest: of the board file.
        at: instant at which the lines begin (ps); -1: tell chip time, order nothing.
        lines: a scenario; its instants count from ``at``.
        save: in virtual time: the round at whose end the node's part of a snapshot is wanted; -1:
            none is.
    """

    digest: str
    at: int = -1
    lines: str = ""
    save: int = -1


class Answer(msgspec.Struct, frozen=True):
    """What a node says to an order.

    Attributes:
        node: its name.
        now: its chip time (ps).
        taken: requests it will carry out.
        error: why it takes none.
        uncertainty: how far its clock may be from that of all (ps).
        part: of a snapshot, if one was wanted.
    """

    node: str
    now: int = 0
    taken: int = 0
    error: str = ""
    uncertainty: int = 0
    part: SavedNode | None = None


_request: Final = msgspec.json.Decoder(NodeRequest)
_answer: Final = msgspec.json.Decoder(Answer)


def read_request(data: bytes) -> NodeRequest:
    """Return what is asked of a node.

    Raises:
        ConfigError: that is not to be understood; says why.
    """
    if len(data) > LARGEST:
        raise ConfigError(f"it has {len(data)} bytes; at most {LARGEST} are read")
    try:
        return _request.decode(data)
    except (msgspec.DecodeError, UnicodeDecodeError, RecursionError) as error:
        raise ConfigError(str(error)) from None


def read_answer(node: str, data: bytes) -> Answer:
    """Return what a node has answered.

    Raises:
        VbusError: that is not to be understood; names the node.
    """
    try:
        return _answer.decode(data)
    except (msgspec.DecodeError, UnicodeDecodeError, RecursionError) as error:
        raise VbusError(f"node {node} gives an answer that is none: {error}") from None


def is_of_another(node: str) -> str:
    """Say that who asks a node has another board than that."""
    return (
        f"node {node} runs another board file or version of vbus: give every node the same, and"
        " the process that gives orders"
    )


def take_order(node: Node, request: NodeRequest, uncertainty: int) -> Answer:
    """Take an order for a node whose time is up to date; all of it, or nothing.

    Args:
        node: the node.
        request: the order.
        uncertainty: how far its clock may be from that of all (ns).
    """
    now = node.board.now
    if request.save >= 0:
        return Answer(node.name, now, error=NO_ROUNDS)
    if request.at < 0:
        return Answer(node.name, now, uncertainty=uncertainty * 1000)
    try:
        pins = {chip.name: set(chip.pins) for chip in node.board.chips}
        scenario = read_scenario(request.lines, "order", pins, US)
    except ConfigError as error:
        return Answer(node.name, now, error=f"{NO_ORDER}: {error}")
    if request.at - LEAD < now:
        return Answer(
            node.name,
            now,
            error=f"it comes {(now - request.at + LEAD) / 1e9:.3f} ms too late; order it further"
            " ahead",
        )
    node.orders_of(LABEL, saved=False)
    for order in scenario.orders:
        node.order(LABEL, msgspec.structs.replace(order, when=request.at + order.when))
    return Answer(node.name, now, len(scenario.orders))


def order(
    file: BoardFile,
    lines: str,
    name: str,
    ahead: int = 100 * MS,
    connect: tuple[str, ...] = (),
    align: int = 1,
) -> tuple[int, list[Answer]]:
    """Order bus cycles on all nodes of a running board for an instant that is to come.

    Args:
        file: the board file, with nodes, in real time.
        lines: a scenario (:func:`read_scenario`) whose instants count from the one agreed on.
        name: of the scenario, for messages.
        ahead: how far ahead that instant lies (ps of chip time).
        connect: endpoints, in place of the board file's.
        align: the instant is a multiple of this (ps), such as a chip's own period; nothing
            is ordered if a node's clock is not known as well as that. 1: any instant will do.

    Returns:
        The instant (ps), and what each node that takes part says.

    Raises:
        ConfigError: the scenario or the period makes no sense, or where the nodes meet is unknown.
        TransportError: no process listens there.
        NodeError: a node does not run, or refuses; names it.
    """
    if align < 1:
        raise ConfigError(f"{align} ps is no period to align to; give a time from 1 ps up")
    plan = plan_of(file)
    scenario = read_scenario(lines, name, pins_of(file), US)
    homes = {chip.name: chip.node for chip in file.chips}
    if plan.policy != "realtime":
        raise ConfigError(
            f"{file.path}: orders are for boards in real time; this one is {plan.policy}, where a"
            " scenario says what happens when: vbus run --scenario"
        )
    meeting = connect or tuple(node.listen for node in file.nodes if node.listen)
    meeting = meeting or file.zenoh.connect
    if not meeting:
        raise ConfigError(f"{file.path}: where do the nodes meet? give the endpoint to connect to")
    session = open_session(connect=meeting, mode="client", security=network_of(file.zenoh).security)
    try:
        root = f"vbus/{plan.board}/@nodes"
        here = [
            _ask(session, f"{root}/{node}/orders", node, NodeRequest(plan.digest))
            for node in plan.nodes
        ]
        vague = max(here, key=lambda answer: answer.uncertainty)
        if 1 < align < vague.uncertainty:
            raise NodeError(
                vague.node,
                f"node {vague.node} knows the time of all to {vague.uncertainty / 1e6:.0f} us only,"
                f" which is more than the {align / 1e6:g} us to align to, and nothing has been"
                " ordered; wait until vbus ls shows less, or align to a longer time",
            )
        at = -(-(max(answer.now for answer in here) + ahead) // align) * align
        answers = []
        for node in plan.nodes:
            mine = _lines_of(scenario, {chip for chip, home in homes.items() if home == node})
            if mine:
                request = NodeRequest(plan.digest, at, mine)
                answers.append(_ask(session, f"{root}/{node}/orders", node, request))
    finally:
        session.close()  # type: ignore[no-untyped-call]
    return at, answers


def _lines_of(scenario: Scenario, chips: set[str]) -> str:
    """Return the part of a scenario for some chips, as text again."""
    levels = {0: "0", 1: "1", 2: "z"}
    verbs = {0: "r {o.address:x}", 1: "w {o.address:x} {o.data:x}", 2: "pin {o.pin} {level}"}
    return "\n".join(
        f"{o.when}ps {o.chips[0]} " + verbs[o.kind].format(o=o, level=levels.get(o.data, ""))
        for o in scenario.of(chips)
    )


def _ask(session: zenoh.Session, key: str, node: str, request: NodeRequest) -> Answer:
    for reply in session.get(key, payload=msgspec.json.encode(request), timeout=ANSWER_SECONDS):
        if reply.ok is None:
            continue
        answer = read_answer(node, reply.ok.payload.to_bytes())
        if answer.error:
            raise NodeError(node, f"node {node} refuses: {answer.error}")
        return answer
    raise NodeLostError(node, f"node {node} does not answer: is it running (vbus ls)?")
