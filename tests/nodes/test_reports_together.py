"""What the nodes of a process report travels as one message: fewer of them, and the same run."""

import asyncio
from collections import Counter
from typing import cast

import pytest

from tests.nodes.four_chips import BOARD, scenario
from vbus.board.config import read_board_text
from vbus.core.errors import VbusError
from vbus.core.kernel import US
from vbus.nodes.conductor import Conductor
from vbus.nodes.machine import Machine, conductor_of, trace_hash
from vbus.nodes.messages import NodeReport, Reports, decode, encode
from vbus.nodes.plan import pins_of, plan_of
from vbus.nodes.scenario import read_scenario
from vbus.serve.nodes import timebase
from vbus.serve.nodes.node_link import NodeLink
from vbus.serve.nodes.peers import Group
from vbus.serve.nodes.timebase import Timebase
from vbus.serve.output_file import OutputFile

FILE, SOURCE = read_board_text(BOARD)
PLAN = plan_of(FILE)
NODES = PLAN.nodes


class Link:
    """Carries messages between processes that are none, and counts them."""

    def __init__(self) -> None:
        self.others: list[Timebase] = []
        self.sent: Counter[str] = Counter()
        self.names: set[tuple[int, ...]] = set()

    def send(self, rank: int, data: bytes) -> None:
        message = decode(data, NODES[rank], len(NODES), len(PLAN.wires))
        self.sent[type(message).__name__] += 1
        if isinstance(message, Reports):
            self.names.add(tuple(report.node for report in message.reports))
        for other in self.others:
            asyncio.get_running_loop().call_soon(other.received, rank, data)


def processes(groups: list[str]) -> tuple[list[Timebase], list[Link]]:
    played = read_scenario(scenario(), "s", pins_of(FILE), US)
    links = [Link() for _ in groups]
    bases = []
    for nodes, link in zip(groups, links, strict=True):
        conductors = [conductor_of(FILE, SOURCE, node, played) for node in nodes]
        bases.append(Timebase(Group(PLAN, cast("NodeLink", link)), conductors))
    for base, link in zip(bases, links, strict=True):
        link.others = [other for other in bases if other is not base]
    return bases, links


async def run(bases: list[Timebase]) -> None:
    loop = asyncio.get_running_loop()
    for base in bases:
        base.start(loop)
    for base in bases:
        for other in bases:
            for conductor in other.conductors if other is not base else ():
                base.present(conductor.node.rank, True)
    async with asyncio.timeout(60):
        for base in bases:
            await base.finished.wait()
    for base in bases:
        base.stop()
        assert base.failure is None


@pytest.mark.parametrize("groups", [["abcd"], ["ab", "cd"], ["abc", "d"], ["a", "b", "c", "d"]])
def test_a_process_sends_one_message_a_round(groups: list[str]) -> None:
    machine = Machine(FILE, SOURCE, read_scenario(scenario(), "s", pins_of(FILE), US))
    machine.run()
    bases, links = processes(groups)
    asyncio.run(run(bases))
    rounds = machine.conductors[0].participant.round
    nodes = [conductor.node for base in bases for conductor in base.conductors]
    assert trace_hash(sorted(nodes, key=lambda node: node.rank)) == machine.trace_hash()
    for group, link in zip(groups, links, strict=True):
        several = len(group) > 1
        together = link.sent["Reports"]
        assert (together > 0) == several
        # Who has come in the middle asks again, so there may be a few more.
        assert rounds <= together + link.sent["NodeReport"] <= rounds + 12 * len(group)
        assert link.names == ({tuple(map(NODES.index, group))} if several else set())


def test_a_report_in_the_name_of_who_hears_it_is_told_and_ignored() -> None:
    said: list[str] = []
    conductors = [conductor_of(FILE, SOURCE, node) for node in "ab"]
    base = Timebase(Group(PLAN, report=said.append), conductors)

    async def hear() -> None:
        base.start(asyncio.get_running_loop())
        forged = NodeReport(PLAN.digest, 0, 0, 0, 0, -1, ())
        base.received(2, encode(Reports(PLAN.digest, 2, 0, (forged,))))
        base.stop()

    asyncio.run(hear())
    assert base.failure is None
    assert said == ["node c has sent a message in the name of another"]


def test_every_node_of_a_message_has_been_heard_of() -> None:
    conductors = [conductor_of(FILE, SOURCE, node) for node in "ab"]
    base = Timebase(Group(PLAN), conductors)

    async def hear() -> dict[str, str]:
        base.start(asyncio.get_running_loop())
        reports = tuple(NodeReport(PLAN.digest, rank, 0, 0, 0, -1, ()) for rank in (2, 3))
        base.received(2, encode(Reports(PLAN.digest, 2, 0, reports)))
        others: dict[str, str] = base.status(0)["others"]
        base.stop()
        return others

    others = asyncio.run(hear())
    assert (others["c"], others["d"]) == ("here", "here")


def test_a_round_costs_what_lies_between_the_first_and_the_last() -> None:
    base = Timebase(Group(PLAN), [conductor_of(FILE, SOURCE, node) for node in "ab"])
    base._began, base._ended = 1.0, 1.5
    for rounds, each in ((1, 0.0), (3, 250_000.0)):
        base.rounds = 2 * rounds  # of both nodes
        timing = base.figures()["timing"]
        assert (timing["rounds"], timing["us_per_round"]) == (rounds, each)


def test_a_snapshot_that_cannot_be_written_is_told_and_the_last_one(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    class Full:
        def write(self, data: bytes, sync: bool) -> None:
            raise VbusError("a.snap: No space left on device")

    said: list[str] = []
    conductors = [conductor_of(FILE, SOURCE, "a")]
    base = Timebase(Group(PLAN, report=said.append), conductors, cast("OutputFile", Full()))
    monkeypatch.setattr(Conductor, "save", lambda conductor: None)
    monkeypatch.setattr(timebase, "write", lambda snapshot: b"")
    base.write_snapshot(conductors[0])
    assert said == ["a.snap: No space left on device; no more snapshots are written"]
    assert base.lost == ["a.snap: No space left on device"]
    base._keep_snapshot(conductors[0])
    assert len(said) == 1
