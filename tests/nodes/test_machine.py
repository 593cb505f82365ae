"""A machine of four nodes in one process, and the agreement about time under any network."""

import heapq
import random
import re
from contextlib import suppress
from dataclasses import replace

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from tests.nodes.four_chips import BOARD, scenario
from tests.undeclared import undeclared
from vbus.board.config import read_board_text
from vbus.board.snapshot import Snapshot
from vbus.core import state
from vbus.core.errors import NodeMismatchError, SnapshotError
from vbus.core.kernel import END, NEVER, US
from vbus.nodes.machine import Machine, build_nodes, conductor_of, trace_hash
from vbus.nodes.messages import Mark, Message, Need, NodeReport, Reports, decode, encode
from vbus.nodes.node import merged
from vbus.nodes.plan import pins_of, plan_of
from vbus.nodes.scenario import Scenario, read_scenario
from vbus.nodes.sync import Participant
from vbus.protocols.port import PortError

FILE, SOURCE = read_board_text(BOARD, "four.toml")
PLAN = plan_of(FILE)


def played(end_ms: int = 20) -> Scenario:
    return read_scenario(scenario(end_ms), "four.txt", pins_of(FILE), US)


@pytest.fixture(scope="module")
def machine() -> Machine:
    made = Machine(FILE, SOURCE, played())
    made.run()
    return made


def edges(machine: Machine, node: int) -> list[tuple[int, str]]:
    trace = machine.nodes[node].trace
    assert trace is not None
    return [(when, text) for when, text in trace.lines() if text.startswith("e ")]


def test_the_run_ends_where_the_scenario_does_and_takes_few_rounds(machine: Machine) -> None:
    assert all(conductor.finished for conductor in machine.conductors)
    assert {conductor.participant.granted for conductor in machine.conductors} == {20_000 * US + 1}
    assert machine.conductors[0].participant.round <= 100
    assert {conductor.state for conductor in machine.conductors} == {"rests"}
    assert len({conductor.participant.round for conductor in machine.conductors}) == 1


def test_an_edge_reaches_the_other_nodes_exactly_one_delay_later(machine: Machine) -> None:
    sent = [when for when, text in edges(machine, 2) if text == "e TRIG 0"]
    came = [when for when, text in edges(machine, 1) if text == "e TRIG 0"]
    home = [when for when, text in edges(machine, 3) if text == "e TRIG 0"]
    assert len(sent) == 2
    assert came == home == [when + 250 * US for when in sent]
    sync = [when for when, text in edges(machine, 3) if text.startswith("e /SYNC") and when < 19e9]
    assert [when + 200 * US for when in sync] == [
        when for when, text in edges(machine, 2) if text.startswith("e /SYNC") and when < 19.3e9
    ]


def test_a_breakpoint_of_one_chip_captures_on_two_others(machine: Machine) -> None:
    """TRIG of the MCP-1200 is index of an LM629, and home of the MC1241A."""
    lines = machine.nodes[1].trace.lines()  # type: ignore[union-attr]
    status = [int(text.split()[-1], 16) for _, text in lines if text.startswith("r y 0 ")]
    assert status[0] & 8 == 0
    assert status[-1] & 8 == 8  # index observed
    words = [text for _, text in machine.nodes[3].trace.lines()]  # type: ignore[union-attr]
    assert any(text == "e READY 1" for text in words)


def test_two_lm629_on_two_nodes_start_at_one_instant(machine: Machine) -> None:
    starts = [
        [when for when, text in machine.nodes[node].trace.lines() if text == f"w {name} 0 1"]  # type: ignore[union-attr]
        for node, name in enumerate("xy")
    ]
    assert starts[0] == starts[1] == [3_000 * US]


def test_a_board_with_nodes_repeats_exactly(machine: Machine) -> None:
    again = Machine(FILE, SOURCE, played())
    again.run()
    assert again.trace_hash() == machine.trace_hash()


def test_the_hash_sees_an_instant_that_differs_by_a_picosecond(machine: Machine) -> None:
    text = scenario().replace("18800.000us m pin", "18800.000001us m pin")
    other = Machine(FILE, SOURCE, read_scenario(text, "f", pins_of(FILE), US))
    other.run()
    assert other.trace_hash() != machine.trace_hash()


def test_edges_of_one_instant_are_taken_in_order_of_node_and_number() -> None:
    _, second, third, _ = build_nodes(FILE, SOURCE)
    trig = next(rank for rank, wire in enumerate(PLAN.wires) if wire.name == "TRIG")
    second.start_trace()
    # They come out of order: node 2 lets go before it pulls again, node 3 lets go last.
    came = [(10, 3, 5, trig, -1, False), (10, 2, 8, trig, 0, True), (10, 2, 7, trig, -1, False)]
    second.accept(came)
    second.board.run_until(250 * US + 9)
    assert second.board.nets["TRIG"].value == 1
    second.board.run_until(250 * US + 10)
    assert second.board.nets["TRIG"].value == 0
    # What a node sends is numbered without gaps.
    port = third.board.open_port("host", ["m"])
    number = port.pin_number("m.TRIG")
    third.take_edges()
    for level in (0, 2, 0, 2):
        port.pin(number, level)
    sent = third.take_edges()
    assert [edge[4] for edge in sent] == [0, -1, 0, -1]
    assert [edge[2] for edge in sent] == list(range(sent[0][2], sent[0][2] + 4))


def test_an_end_of_a_wire_is_always_listened_to() -> None:
    _, second, _, _ = build_nodes(FILE, SOURCE)
    assert {end.heard for end in second.ends.values()} == {True}


# -- any network ----------------------------------------------------------------------------------


def run_on_network(seed: int, end_ms: int, slowest: int = 20) -> Machine:
    """Run with every message delayed and reordered, nodes polled in any order, some twice."""
    draw = random.Random(seed)
    made = Machine(FILE, SOURCE, played(end_ms))
    flying: list[tuple[int, int, int, bytes]] = []
    now = count = 0
    while True:
        progress = False
        for conductor in draw.sample(made.conductors, len(made.conductors)):
            report = conductor.poll()
            progress = progress or report is not None or conductor.state == "runs"
            if report is None:
                continue
            for other in range(len(made.conductors)):
                for _ in range(draw.choice((1, 1, 1, 2))):
                    count += 1
                    late = now + draw.randint(0, slowest)
                    heapq.heappush(flying, (late, count, other, encode(report)))
        if progress:
            continue
        if not flying:
            return made
        now, _, target, data = heapq.heappop(flying)
        message = decode(data, "test", len(PLAN.nodes), len(PLAN.wires))
        assert isinstance(message, NodeReport)
        if message.node != target:
            made.conductors[target].participant.receive(message)


def test_the_order_in_which_messages_come_changes_nothing(machine: Machine) -> None:
    reference = Machine(FILE, SOURCE, played(8))
    reference.run()
    hashes = {run_on_network(seed, 8).trace_hash() for seed in range(5)}
    assert hashes == {reference.trace_hash()}


@settings(max_examples=200, deadline=None)
@given(
    st.integers(2, 5),
    st.lists(st.tuples(st.integers(0, 4), st.integers(0, 400), st.integers(0, 60)), max_size=30),
    st.randoms(use_true_random=False),
)
def test_nodes_agree_on_one_order_of_events_whatever_the_network_does(
    nodes: int, script: list[tuple[int, int, int]], draw: random.Random
) -> None:
    """Toy nodes: an event at an instant is heard by the next node, which answers later."""
    lookahead = 10

    def play(shuffle: bool) -> list[tuple[int, int, str]]:
        seen: list[tuple[int, int, str]] = []
        agenda: list[list[tuple[int, int, int, int]]] = [[] for _ in range(nodes)]
        for number, (node, when, answer) in enumerate(script):
            heapq.heappush(agenda[node % nodes], (when, 0, number, answer))
        parts = [
            Participant([str(n) for n in range(nodes)], n, lookahead, "") for n in range(nodes)
        ]
        numbers = [0] * nodes
        outbox: list[list[tuple[int, int, int, int, int, bool]]] = [[] for _ in range(nodes)]
        flying: list[tuple[int, NodeReport]] = []
        while True:
            moved = False
            for me in range(nodes):
                part = parts[me]
                if part.reported and part.ready():
                    for when, node, number, _, level, _ in part.grant():
                        if (node + 1) % nodes == me:
                            heapq.heappush(agenda[me], (when + lookahead, node + 1, number, level))
                            assert when + lookahead >= part.granted - 400 * lookahead
                    moved = True
                if not part.reported and not (part.rested and not part.heard_of_round()):
                    while agenda[me] and agenda[me][0][0] < part.granted:
                        when, origin, number, answer = heapq.heappop(agenda[me])
                        seen.append((when, me, f"{origin} {number}"))
                        if answer:
                            outbox[me].append((when, me, numbers[me], 0, answer // 2, False))
                            numbers[me] += 1
                    following = agenda[me][0][0] if agenda[me] else NEVER
                    report = part.report(following, 1000, outbox[me])
                    outbox[me] = []
                    flying += [(other, report) for other in range(nodes) if other != me]
                    moved = True
            if flying:
                place = draw.randrange(len(flying)) if shuffle else 0
                target, report = flying.pop(place)
                parts[target].receive(report)
            elif not moved:
                assert len({part.granted for part in parts}) == 1
                # On each node events came in order of their instants.
                for me in range(nodes):
                    mine = [when for when, node, _ in seen if node == me]
                    assert mine == sorted(mine)
                return sorted(seen)

    assert play(shuffle=True) == play(shuffle=False)


def test_time_waits_for_a_host_that_has_begun_to_use_it_until_it_waits_itself() -> None:
    conductor = conductor_of(FILE, SOURCE, "a")
    port = conductor.node.board.open_port("h")
    assert not conductor.busy()
    assert not port.delay(US)
    assert not conductor.busy()
    conductor.participant.granted = US
    assert not conductor.busy()
    conductor.participant.granted = US + 1
    assert conductor.busy()


# -- snapshots, mistakes --------------------------------------------------------------------------


def test_a_node_that_rejoins_from_a_snapshot_changes_nothing(machine: Machine) -> None:
    """It dies after a snapshot, has lost what it did since, and catches up from the others."""
    made = Machine(FILE, SOURCE, played())
    saved: Snapshot | None = None
    while made.conductors[2].participant.granted < 14_000 * US:
        for conductor in made.conductors:
            made.poll(conductor)
            if conductor is made.conductors[2] and not saved and conductor.participant.reported:
                if conductor.participant.granted > 9_000 * US:
                    saved = conductor.save()
    reborn = conductor_of(FILE, SOURCE, "c", played())
    assert saved is not None
    reborn.load(saved)
    assert reborn.node.board.limit == reborn.participant.granted - 1
    made.conductors[2] = reborn
    for conductor in made.conductors:
        for report in list(conductor.participant.log.values()):
            if conductor is not reborn:
                reborn.participant.receive(report)
    made.run()
    assert made.trace_hash() == machine.trace_hash()


def test_a_node_that_starts_anew_lives_through_it_all_again(machine: Machine) -> None:
    made = Machine(FILE, SOURCE, played())
    while made.conductors[0].participant.granted < 14_000 * US:
        for conductor in made.conductors:
            made.poll(conductor)
    reborn = conductor_of(FILE, SOURCE, "a", played())
    made.conductors[0] = reborn
    for conductor in made.conductors[1:]:
        for report in list(conductor.participant.log.values()):
            reborn.participant.receive(report)
    made.run()
    assert made.trace_hash() == machine.trace_hash()


@pytest.mark.parametrize("until", [3, 12, 24, 36, 48, 60, 72, 78, 80])
def test_all_nodes_go_on_from_snapshots_taken_anywhere(machine: Machine, until: int) -> None:
    made = Machine(FILE, SOURCE, played())
    saved: dict[int, Snapshot] = {}
    while len(saved) < len(made.conductors):
        for rank, conductor in enumerate(made.conductors):
            if rank not in saved:
                made.poll(conductor)
                if conductor.participant.reported and conductor.participant.round >= until:
                    saved[rank] = conductor.save()
    again = Machine(FILE, SOURCE, played())
    for rank, conductor in enumerate(again.conductors):
        conductor.load(saved[rank])
    for conductor in again.conductors:
        for other in again.conductors:
            if other is not conductor:
                for report in list(conductor.participant.log.values()):
                    other.participant.receive(report)
    again.run()
    assert again.trace_hash() == machine.trace_hash()


def test_a_snapshot_of_another_node_or_of_nothing_is_refused() -> None:
    made = Machine(FILE, SOURCE, played(8))
    while not made.conductors[0].participant.reported:
        made.conductors[0].poll()
    other = conductor_of(FILE, SOURCE, "b", played(8))
    snapshot = made.conductors[0].save()
    with pytest.raises(SnapshotError, match=r'the snapshot is of board "four.a" with .*"four.b"'):
        other.load(snapshot)
    mine = conductor_of(FILE, SOURCE, "a", played(8))
    state = {name: field for name, field in snapshot.state.items() if name != "beyond"}
    before = mine.node.board.state_hash()
    for beyond in ({}, {"beyond": {}}, {"beyond": {**snapshot.state["beyond"], "agreed": None}}):
        with pytest.raises(SnapshotError, match=r"node a|leave --trace out"):
            mine.load(replace(snapshot, state={**state, **beyond}))
        assert mine.node.board.state_hash() == before
    agreed = {**snapshot.state["beyond"]["agreed"], "round": 9}
    beyond = {**snapshot.state["beyond"], "agreed": agreed}
    with pytest.raises(SnapshotError, match="no report of its round 9"):
        mine.load(replace(snapshot, state={**state, "beyond": beyond}))


def test_the_worst_of_late_edges_is_told_whichever_comes_first() -> None:
    made = Machine(FILE, SOURCE, played(8))
    made.run()
    node = made.nodes[1]
    wire = next(rank for rank, end in node.ends.items() if 2 in end.far)
    on_time = node.board.kernel.now - node.wires[wire].delay
    node.accept([(on_time - late, 2, 900 + late, wire, 1, False) for late in (0, 10, 30, 20)])
    assert (node.late, node.worst_late) == (3, 30)
    node.accept([(0, 2, 999, wire, 1, False)])
    assert (node.late, node.worst_late) == (4, on_time)


def test_a_node_with_another_board_is_refused_by_name() -> None:
    part = Participant(("a", "b"), 0, 10, "1111")
    with pytest.raises(NodeMismatchError, match="node b runs another board file") as caught:
        part.receive(NodeReport("2222", 1, 0, 0, 0, -1, ()))
    assert caught.value.node == "b"


def test_a_node_keeps_its_latest_65536_reports_for_those_that_rejoin() -> None:
    part = Participant(("a",), 0, 10, "1")
    for _ in range(65538):
        part.report(NEVER, -1, [])
        part.grant()
    assert (min(part.log), max(part.log), len(part.log)) == (2, 65537, 65536)


def test_a_snapshot_holds_the_latest_two_reports() -> None:
    part = Participant(("a",), 0, 10, "1")
    for _ in range(3):
        part.report(NEVER, -1, [])
        part.grant()
    part.report(NEVER, -1, [])
    assert [decode(data, "a", 1, 0).round for data in part.latest] == [2, 3]


@pytest.mark.parametrize(
    ("message", "text"),
    [
        (NodeReport("1", 1, 0, 0, 0, -1, ()), "the state was made by another node"),
        (Need("1", 0, 0, 1), "the state was made by another node"),
        (
            NodeReport("2", 0, 0, 0, 0, -1, ()),
            "the state was made with another board file or version",
        ),
    ],
)
def test_a_saved_report_of_another_node_or_board_is_refused(message: Message, text: str) -> None:
    part = Participant(("a", "b"), 0, 10, "1")
    part.report(NEVER, -1, [])
    with pytest.raises(SnapshotError, match=text):
        part.check({**state.save(part), "latest": [encode(message)]})


def test_a_node_that_tells_two_stories_is_refused_by_name() -> None:
    part = Participant(("a", "b"), 0, 10, "1")
    part.receive(NodeReport("1", 1, 0, 0, 5, -1, ()))
    part.receive(NodeReport("1", 1, 0, 0, 5, -1, ()))
    with pytest.raises(NodeMismatchError, match="node b has sent two different reports of round 0"):
        part.receive(NodeReport("1", 1, 0, 0, 6, -1, ()))


def test_time_is_granted_up_to_its_end_inclusive_and_no_further() -> None:
    part = Participant(("a",), 0, 10, "1")
    for until in (END, NEVER):
        part.report(NEVER, until, [])
        part.grant()
        assert part.granted == END + 1, "everything before this instant"
    part.report(NEVER, NEVER, [])
    part.grant()
    assert part.rested


def test_a_host_on_a_node_comes_to_the_end_of_time_and_is_refused_what_lies_beyond() -> None:
    made = Machine(FILE, SOURCE)
    port = made.nodes[0].board.open_port("late")
    assert not port.delay(END)
    while not port.go_on():
        for conductor in made.conductors:
            made.poll(conductor)
    assert port.delay(END)
    assert made.nodes[0].board.now == END
    with pytest.raises(PortError, match=f"time ends at {END} ps"):
        port.delay(1)
    with pytest.raises(PortError, match=f"time ends at {END} ps"):
        port.read(0)


GOOD_REPORT = NodeReport("1", 1, 3, 50, 60, -1, ((40, 1, 0, 0, 1, False),))
GOOD = encode(GOOD_REPORT)


@pytest.mark.parametrize(
    ("data", "message"),
    [
        (b"", "an empty message"),
        (b"\x03" + GOOD[1:], "version 3; this vbus speaks version 1"),
        (GOOD[:-3], "bytes that are no message"),
        (b"\x01\xc1\xff", "bytes that are no message"),
        (b"\x01\x95\xa1\x95\xa1d\x01\x00\x02", "bytes that are no message"),  # no UTF-8
        (b"\x01\x99" + GOOD[2:] + b"\x07", "bytes that are no message"),  # a ninth element
        (encode(NodeReport("1", 7, 0, 0, 0, -1, ())), "cannot be: node 7 of 4"),
        (encode(NodeReport("1", 1, 0, 9, 5, -1, ())), "horizon 9, next event 5"),
        (encode(NodeReport("1", 1, 0, 9, 9, -1, ((3, 1, 0, 9, 1, False),))), "on wire 9"),
        (encode(NodeReport("1", 1, 0, 9, 9, -1, ((9, 1, 0, 0, 1, False),))), "an edge at 9 ps"),
        (
            encode(Reports("1", 1, 0, (GOOD_REPORT, NodeReport("1", 2, 0, 9, 5, -1, ())))),
            "horizon 9, next event 5",
        ),
        (encode(Reports("1", 1, 0, (NodeReport("1", 4, 0, 0, 0, -1, ()),))), "node 4 of 4"),
        (b"\x01" + b"\x91" * 5000, "bytes that are no message"),
        (bytes(17 << 20), "a message of 17825792 bytes"),
    ],
)
def test_a_message_that_makes_no_sense_is_refused_with_its_sender(
    data: bytes, message: str
) -> None:
    with pytest.raises(NodeMismatchError, match="node b has sent") as caught:
        decode(data, "b", 4, 4)
    assert message in str(caught.value)


@settings(max_examples=300, deadline=None)
@given(st.binary(max_size=60))
def test_random_bytes_are_a_message_or_an_error(data: bytes) -> None:
    with suppress(NodeMismatchError):
        assert encode(decode(GOOD[:1] + data, "b", 4, 4))


def test_traces_are_merged_by_instant_then_node_then_sequence() -> None:
    traces = [[(5, "a"), (7, "b"), (7, "c")], [(5, "d"), (6, "e"), (7, "f")]]
    assert list(merged(traces)) == [
        "5 0 a\n", "5 1 d\n", "6 1 e\n", "7 0 b\n", "7 0 c\n", "7 1 f\n",
    ]  # fmt: skip


def test_the_whole_trace_is_that_of_the_nodes_merged(machine: Machine) -> None:
    assert machine.trace_hash() == trace_hash(machine.nodes)
    assert machine.trace_hash() != trace_hash(machine.nodes[::-1])


def test_every_attribute_of_a_node_is_state_wiring_or_derived() -> None:
    conductor = conductor_of(FILE, SOURCE, "b", played(8))
    node = conductor.node
    for part in (node, conductor.participant, node.trace, *node.orders, *node.wire_ends):
        assert undeclared(part) == set(), part


@pytest.mark.parametrize(
    ("change", "text"),
    [
        ({"number": "1"}, "node a.number: wants an integer of 64 bits, not '1'"),
        ({"wire_ends": ()}, "node a.wire_ends: wants "),
        ({"trace": None}, "node a.trace: wants the fields of NodeTrace by name, not None"),
        ({"more": 1}, "node a.more: is no field of Node"),
        ({"agreed": None}, "node a.agreed: wants the fields of Participant by name, not None"),
    ],
)
def test_a_bad_state_of_a_node_is_named_and_changes_nothing(
    change: dict[str, object], text: str
) -> None:
    made = Machine(FILE, SOURCE, played(8))
    made.run()
    node = made.conductors[0].node
    made.conductors[0].participant.report(NEVER, -1, [])
    before = node.save()
    with pytest.raises(SnapshotError, match=re.escape(text)):
        node.prepare({**before, "number": 7, **change}).apply()
    assert repr(node.save()) == repr(before)


def test_a_mark_that_claims_to_be_surer_than_sure_is_refused() -> None:
    with pytest.raises(NodeMismatchError, match="an uncertainty of -1 ns"):
        decode(encode(Mark(PLAN.digest, 0, 3, 1000, -1)), "a", len(PLAN.nodes), len(PLAN.wires))
    sure = Mark(PLAN.digest, 0, 3, 1000, 0)
    assert decode(encode(sure), "a", len(PLAN.nodes), len(PLAN.wires)) == sure
