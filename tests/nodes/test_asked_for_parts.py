"""What a node is asked by another process for a snapshot, and how the answer travels."""

import asyncio
import base64
from collections.abc import Callable
from itertools import pairwise
from pathlib import Path
from typing import Any, cast

import msgspec
import pytest
import zenoh

from tests.nodes.four_chips import BOARD
from tests.ports import free_endpoint
from tests.waiting import PATIENCE
from tests.zenoh.processes import session_at
from vbus.board.board import Board
from vbus.board.config import read_board_text
from vbus.board.snapshot import Snapshot, take
from vbus.board.snapshot import read as read_board
from vbus.board.snapshot import write as write_board
from vbus.cli.run.snap import save_machine
from vbus.core.errors import SnapshotError, VbusError
from vbus.network.session import close_session
from vbus.nodes.machine import conductor_of
from vbus.nodes.machine_snapshot import SavedNode, read
from vbus.nodes.plan import plan_of
from vbus.serve.nodes import node_link, peers, timebase
from vbus.serve.nodes.node_link import PIECE, NodeLink, Receiver
from vbus.serve.nodes.ordering import Answer, NodeRequest, read_answer
from vbus.serve.nodes.peers import Group
from vbus.serve.nodes.timebase import Timebase
from vbus.serve.registry import ORDER_SECONDS


class Told(Receiver):
    """Answers an order with as many bytes as it says, each other than the one before."""

    def received(self, rank: int, data: bytes) -> None:
        pass

    def present(self, rank: int, there: bool) -> None:
        pass

    def order(self, rank: int, data: bytes, answer: Callable[[bytes], None]) -> None:
        answer(bytes(n % 251 for n in range(int(data))))


async def heard(link: NodeLink, rank: int, data: bytes) -> bytes:
    loop = asyncio.get_running_loop()
    answer: asyncio.Future[bytes] = loop.create_future()
    link.ask(rank, data, PATIENCE, answer.set_result)
    return await asyncio.wait_for(answer, PATIENCE)


def test_a_long_answer_comes_in_pieces_and_whole_or_not_at_all(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    endpoint = free_endpoint()

    async def ask() -> None:
        links = [NodeLink("m", "abc", [rank]) for rank in (0, 1)]
        await links[0].open(Told(), [endpoint], [], None, False, PATIENCE, print)
        await links[1].open(Told(), [], [endpoint], None, False, PATIENCE, print)
        try:
            for there, here in ((0, 1), (1, 0)):
                for size in (0, 1, PIECE, PIECE + 1, 5 * PIECE, 1_500_000):
                    found = await heard(links[here], there, b"%d" % size)
                    assert found == bytes(n % 251 for n in range(size))
            assert await heard(links[0], 2, b"1") == b""  # nobody is there
            monkeypatch.setattr(node_link, "LARGEST_ANSWER", 3 * PIECE)
            assert len(await heard(links[0], 1, b"%d" % (3 * PIECE))) == 3 * PIECE
            assert await heard(links[0], 1, b"%d" % (3 * PIECE + 1)) == b""
            session = session_at(endpoint)

            def lose(query: zenoh.Query) -> None:
                for piece in (b"one", b"two"):
                    query.reply(query.key_expr, piece, attachment=query.payload)
                query.drop()

            session.declare_queryable("vbus/m/@nodes/c/orders", lose, complete=True)
            loop = asyncio.get_running_loop()
            while not await heard(links[1], 2, b"6"):
                await asyncio.sleep(0.01)
            assert await heard(links[1], 2, b"6") == b"onetwo"
            for size in (b"9", b"3", b"", b"x"):
                assert await heard(links[1], 2, size) == b""
            await loop.run_in_executor(None, close_session, session)
        finally:
            for link in reversed(links):
                link.close()

    asyncio.run(ask())


FILE, SOURCE = read_board_text(BOARD)
PLAN = plan_of(FILE)


def machine(nodes: str = "abcd", link: NodeLink | None = None) -> Timebase:
    return Timebase(Group(PLAN, link), [conductor_of(FILE, SOURCE, name, None) for name in nodes])


def ordered(base: Timebase, data: bytes) -> Answer:
    """Give node b an order; return its answer."""

    async def give() -> bytes:
        loop = asyncio.get_running_loop()
        base.start(loop)
        answer: asyncio.Future[bytes] = loop.create_future()
        base.order(1, data, answer.set_result)
        try:
            return await asyncio.wait_for(answer, PATIENCE)
        finally:
            base.stop()

    return read_answer("b", asyncio.run(give()))


@pytest.mark.parametrize("data", [b"[", b'{"node":"\xff"}'])
def test_an_answer_that_is_none_names_its_node(data: bytes) -> None:
    with pytest.raises(VbusError, match=r"^node b gives an answer that is none: "):
        read_answer("b", data)


def test_a_node_answers_with_its_part_when_the_round_has_ended() -> None:
    answer = ordered(machine(), msgspec.json.encode(NodeRequest(PLAN.digest, save=7)))
    assert answer.part is not None
    assert (answer.node, answer.error, answer.part.round) == ("b", "", 7)
    snapshot = read_board(answer.part.data)
    assert answer.now == snapshot.when
    assert snapshot.text == BOARD
    other = conductor_of(FILE, SOURCE, "b", None)
    other.load(snapshot)
    assert other.node.board.now == snapshot.when
    again = ordered(machine(), msgspec.json.encode(NodeRequest(PLAN.digest)))
    assert (again.node, again.error, again.part) == ("b", "", None)


def test_a_node_that_waits_for_others_says_so(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(timebase, "LET_IN", 0.01)
    answer = ordered(machine("ab"), msgspec.json.encode(NodeRequest(PLAN.digest, save=7)))
    assert answer.error.startswith("node b waits for the others, so round 7 has not ended; ")


def test_a_part_that_cannot_be_had_is_refused_in_words(monkeypatch: pytest.MonkeyPatch) -> None:
    data = msgspec.json.encode(NodeRequest(PLAN.digest, save=2))
    for error, said in (
        (SnapshotError("x is not what it was"), "x is not what it was"),
        (RuntimeError("oh"), "internal error; its own messages say more"),
    ):
        base = machine()

        def fail(error: Exception = error) -> Snapshot:
            raise error

        monkeypatch.setattr(base.conductors[1], "save", fail)
        assert ordered(base, data).error == f"node b cannot be saved: {said}"
    monkeypatch.setattr(peers, "LARGEST_ANSWER", 500)
    refused = ordered(machine(), data)
    assert refused.part is None
    assert refused.error.startswith("node b: its answer has ")
    assert refused.error.endswith(" bytes, and at most 500 are sent")


class Line:
    """Stands in for a link to other nodes: has an answer ready."""

    def __init__(self, answer: bytes) -> None:
        self.answer: bytes = answer
        self.asked: list[tuple[int, NodeRequest]] = []

    def ask(self, rank: int, data: bytes, seconds: float, take: Callable[[bytes], None]) -> None:
        assert timebase.LET_IN < seconds < ORDER_SECONDS
        self.asked.append((rank, msgspec.json.decode(data, type=NodeRequest)))
        take(self.answer)


PART = SavedNode(7, b"state")


@pytest.mark.parametrize(
    ("request_", "answer", "reply"),
    [
        (
            {"node": "c", "round": 7},
            msgspec.json.encode(Answer("c", 5, part=PART)),
            {"done": {"round": 7, "data": "c3RhdGU="}},
        ),
        ({"node": "c"}, b"", {"done": {"answers": False, "state": "not here yet"}}),
        (
            {"node": "c"},
            msgspec.json.encode(Answer("c", 5)),
            {"done": {"answers": True, "state": "not here yet"}},
        ),
        (
            {"node": "c", "round": 7},
            b"",
            {"error": "node c does not answer (not here yet); is it running (vbus ls)?"},
        ),
        (
            {"node": "c", "round": 7},
            msgspec.json.encode(Answer("c", 5, error="node c waits")),
            {"error": "node c waits"},
        ),
        (
            {"node": "c", "round": 7},
            msgspec.json.encode(Answer("c", 5)),
            {"error": "node c gives an answer without its part of the snapshot"},
        ),
        ({"node": "z", "round": 7}, None, {"error": "z is no node of four, or 7 no round of it"}),
        ({"node": ["a"]}, None, {"error": "['a'] is no node of four, or -1 no round of it"}),
        (
            {"node": "c", "round": "x"},
            None,
            {"error": "c is no node of four, or x no round of it"},
        ),
        (
            {"node": "c", "round": 1 << 63},
            None,
            {"error": f"c is no node of four, or {1 << 63} no round of it"},
        ),
        ({}, None, {"error": "None is no node of four, or -1 no round of it"}),
    ],
)  # fmt: skip
def test_what_a_node_elsewhere_answers_is_checked(
    request_: dict[str, Any], answer: bytes | None, reply: dict[str, Any]
) -> None:
    line = Line(answer or b"")
    replies: list[dict[str, Any]] = []
    machine("ab", cast("NodeLink", line)).save_node(request_, replies.append)
    assert replies == [reply]
    expected = [(2, NodeRequest(PLAN.digest, save=request_.get("round", -1)))]
    assert line.asked == ([] if answer is None else expected)


@pytest.mark.parametrize("answer", [b"x", b"[]", b"\xff", b'{"node":"c","part":{"round":1}}'])
def test_an_answer_that_is_none_is_refused(answer: bytes) -> None:
    replies: list[dict[str, Any]] = []
    base = machine("ab", cast("NodeLink", Line(answer)))
    base.save_node({"node": "c", "round": 7}, replies.append)
    assert replies[0]["error"].startswith("node c gives an answer that is none: ")


def test_nodes_elsewhere_that_were_asked_too_late_are_asked_for_a_later_round(
    monkeypatch: pytest.MonkeyPatch, tmp_path: Path
) -> None:
    numbers: list[int] = []

    def order(board: str, do: str, **values: Any) -> dict[str, Any]:
        if "round" not in values:
            assert (board, do, values) == ("m.a", "snap.node", {"node": "b"})
            return {"answers": True, "state": "runs"}
        late = 0
        assert (board, do) == ("m.a", "snap.node")
        if values["node"] == "b":
            numbers.append(values["round"])
            late = 900 * (len(numbers) < 4)
        data = write_board(take(Board(values["node"])))
        return {"round": values["round"] + late, "data": base64.b64encode(data).decode()}

    monkeypatch.setattr("vbus.serve.registry.order", order)
    file = tmp_path / "m.snap"
    save_machine("m", {"a": {"round": 10, "others": {"b": "runs"}}}, file, True)
    found = read(file.read_bytes())
    assert len(numbers) == 4
    assert all(later > before + 900 for before, later in pairwise(numbers))
    assert (found.round, list(found.nodes)) == (numbers[-1], ["a", "b"])
    assert [part.board for part in found.nodes.values()] == ["a", "b"]


def test_of_several_refusals_that_which_is_no_consequence_is_told(
    monkeypatch: pytest.MonkeyPatch, tmp_path: Path
) -> None:
    def order(board: str, do: str, **values: Any) -> dict[str, Any]:
        if values["node"] == "b" and "round" in values:
            raise VbusError("node b waits for its host")
        if values["node"] == "a":
            raise VbusError("node a waits for the others, so")
        return {"answers": True, "state": "runs"}

    monkeypatch.setattr("vbus.serve.registry.order", order)
    with pytest.raises(VbusError, match=r"^node b waits for its host$"):
        save_machine("m", {"a": {"others": {"b": "runs"}}}, tmp_path / "m.snap", True)


def test_what_names_no_node_has_no_rank() -> None:
    link = NodeLink("m", "abc", [0])
    ranks = [link._rank(zenoh.KeyExpr(f"vbus/m/@nodes/{name}/alive")) for name in "cad"]
    assert ranks == [2, 0, -1]


def test_messages_are_held_back_for_up_to_so_many_milliseconds(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    for given, seconds in (("7:30", 0.03), ("7", 0.02)):
        monkeypatch.setenv(node_link.TEST_DISTURB, given)
        assert NodeLink("m", "abc", [0])._longest == seconds
