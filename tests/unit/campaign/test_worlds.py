"""Worlds as text, what they change, and the order in which they are tried."""

from collections import Counter
from types import SimpleNamespace

import pytest

from tests.boards import ALONE
from tests.unit.faults.bench import Lm
from tests.unit.faults.bench import build as build_lm
from vbus.board.build import build
from vbus.board.config import read_board_text
from vbus.campaign.account import Account, Axis, SeenCycle, Witness
from vbus.campaign.plan import PlannedWorld, WorldPlan, in_order, plan, shortened, specimens
from vbus.campaign.verdict import NO_EFFECT, judge
from vbus.campaign.world import (
    DIMENSIONS,
    REFERENCE,
    World,
    begin,
    longest_cycle,
    of_world,
    read_world,
)
from vbus.cli.hosted.campaign_runs import FunctionSubject
from vbus.client import Bus
from vbus.client.mcp1200 import Mcp1200
from vbus.core.errors import ConfigError
from vbus.core.kernel import MS
from vbus.serve.in_process import connect_in_process
from vbus.testing.boards import of_part

LM629 = of_part("LM629N-8", "ideal").replace("[board]", '[board]\ntime = "lockstep"')


def planned(text: str, seen: list[SeenCycle], **more: object) -> WorldPlan:
    """Return the plan for a host of which only bus cycles are known."""
    file, source = read_board_text(text)
    return plan(Account(seen=seen), file, build(file, source), **more)  # type: ignore[arg-type]


def row(number: int, group: str, write: bool = True) -> SeenCycle:
    """Return a bus cycle of chip x."""
    return SeenCycle("x", number, write, number * 1_000_000, group)


@pytest.mark.parametrize(
    ("text", "sentence"),
    [
        ("cycle:x.17:flip3", "cycle 17 of x: D3 is inverted"),
        ("cycle:x.17:lost", "cycle 17 of x: its strobe is lost"),
        ("interrupt:x.HI@12000000:late1000000-0", "x.HI is 0 for 1us at 12us"),
        ("phase:+64us:ahead", "the chips 64us ahead"),
        ("specimen:+17us:x.busy=worst:3", 'x.busy = "worst", seed = 3, the chips 17us ahead'),
        ("floating:x:0", "undriven data lines of x show 0"),
        ("fault:x.1@12000000:jam", "jam of x.1 at 12us"),
        ("fault:x.1@12000000+5000000:jam", "jam of x.1 at 12us for 5us"),
        ("threads:program:order17", "threads of the program in the order of seed 17"),
    ],
)
def test_a_world_is_its_text(text: str, sentence: str) -> None:
    world = read_world(text)
    assert (str(world), world.sentence()) == (text, sentence)


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("cycles:x.1:lost", 'did you mean "cycle"'),
        ("cycle:x.1", "DIMENSION:WHERE:HOW"),
        ("cycle:x.1:stolen", "names no world"),
        ("cycle:x.1:flipped", '"flipped" is no way of this dimension'),
        ("cycle:x.0:lost", "a bus cycle's number is 1 or more"),
        ("phase:+1us:behind", "is no way"),
        ("interrupt:x.HI@5:early5", "is no way"),
        ("floating:x:2", "is no way"),
        ("cycle:x.1:lost:y", "DIMENSION:WHERE:HOW"),
        ("fault:x@0:jamm", 'there is no fault "jamm"'),
        ("fault:x.1@0+:jam+", "names no world"),
        ("phase:+x:ahead", "is no duration"),
        ("specimen:+0us:busy", "CHIP.KEY=VALUE"),
        ("threads:program:orderly", "names no world"),
    ],
)
def test_what_names_no_world_is_refused(text: str, message: str) -> None:
    with pytest.raises(ValueError, match=message):
        read_world(text)


def test_one_cycle_is_broken_and_no_other() -> None:
    file, source = read_board_text(LM629)
    board = build(file, source)
    begin(board, read_world("cycle:x.2:flip0"))
    with connect_in_process(board) as bus:
        found = [bus.read(0) for _ in range(3)]
    assert found == [0, 1, 0]


def test_settings_of_a_specimen_stand_in_its_board_file() -> None:
    world = read_world("specimen:+0us:x.busy=worst,x.busy_clk=1:3")
    file, source = of_world(*read_board_text(LM629), world)
    assert 'busy = "worst"\nbusy_clk = 1\n' in source.text
    assert (file.board.seed, file.chips[0].settings["busy_clk"]) == (3, 1)


def test_a_board_in_real_time_has_one_world() -> None:
    read = read_board_text(LM629.replace("lockstep", "realtime"))
    assert of_world(*read, REFERENCE) == read
    with pytest.raises(ConfigError, match="no two runs are alike"):
        of_world(*read, World("phase", "+1us", "ahead"))


def test_of_each_group_and_way_one_comes_first() -> None:
    made = planned(LM629, [row(1, "a"), row(2, "a"), row(3, "b")], only=["cycle"])
    ways = {(one.group, one.world.way) for one in made.worlds}
    first = [(one.group, one.world.way) for one in made.worlds[: len(ways)]]
    assert {*first} == ways
    assert len(made.worlds) == 3 * (8 + 3)
    assert ways == {(f"x {g}", w) for g in "ab" for w in ("flip", "lost", "doubled", "busy")}


def test_a_short_campaign_has_one_world_of_each_way_of_each_dimension() -> None:
    made = planned(LM629, [row(number, f"g{number}") for number in range(1, 99)])
    ways = {(one.world.dimension, one.world.way) for one in made.worlds}
    assert len(ways) > 8
    first = made.worlds[: len(ways)]
    assert {(one.world.dimension, one.world.way) for one in first} == ways


def test_the_seed_decides_the_order_and_nothing_else_does() -> None:
    rows = [row(number, "a") for number in range(1, 9)]
    orders = [planned(LM629, rows, seed=seed, only=["cycle"]).worlds for seed in (0, 0, 1)]
    assert orders[0] == orders[1]
    assert orders[0] != orders[2]
    assert sorted(map(str, orders[0])) == sorted(map(str, orders[2]))
    back = in_order(list(reversed(orders[0])), 0)
    assert back == orders[0]


def test_of_a_poll_some_are_tried_and_the_others_told() -> None:
    made = planned(LM629, [row(n, "poll", write=False) for n in range(1, 101)], only=["cycle"])
    assert made.left == {("cycle", "flip"): 8 * 36, ("cycle", "lost"): 36,
                         ("cycle", "doubled"): 36, ("cycle", "late"): 36}  # fmt: skip


def test_what_does_not_apply_is_told() -> None:
    made = planned(of_part("MCP-1200", "ideal"), [row(1, "a")], only=DIMENSIONS)
    assert "no busy that the manual bounds" in made.refused["busy"]
    assert "program with a card" in made.refused["threads"]
    assert "has moved" in made.refused["interrupt"]
    assert "waits by the wall clock" in made.refused["link_closed"]
    assert "without messages" in made.refused["link_cut"]


def test_an_interrupt_comes_in_each_place_of_the_loop_that_the_host_waits_in() -> None:
    """The host polls by two cycles from 1 us to the interrupt, and would go on so without it."""
    file, source = read_board_text(LM629)
    polls = [row(n, "ab"[n % 2], write=False) for n in range(1, 8)]
    after = [row(8, "b"), row(9, "a")]
    seen = Account(seen=[*polls, *after], edges=[("x.HI", 7_500_000, 1), ("x.HI", 9_000_000, 0)])
    made = plan(seen, file, build(file, source), only=["interrupt"])
    inside = {one.group: str(one.world) for one in made.worlds if " in " in one.group}
    assert inside == {
        "x.HI rises in x a": "interrupt:x.HI@7500000:late500000-0",
        "x.HI rises in x b": "interrupt:x.HI@7500000:late1500000-0",
    }


def test_an_interrupt_comes_a_cycle_early_or_late() -> None:
    file, source = read_board_text(LM629)
    seen = Account(seen=[row(1, "a"), row(2, "b")], edges=[("x.HI", 5_000_000, 1)])
    made = plan(seen, file, build(file, source), only=["interrupt"])
    assert sorted(str(one.world) for one in made.worlds) == [
        "interrupt:x.HI@4000000:early1000000-1",
        "interrupt:x.HI@5000000:late1000000-0",
    ]
    late, early = sorted((one.world for one in made.worlds), key=lambda world: world.how)[::-1]
    for world, level in ((late, 0), (early, 1)):
        board = build(file, source)
        begin(board, world)
        board.run_until(5_000_000)
        assert board.find_pin("x.HI").net.value == (level if world is late else 0)


def test_phases_leave_out_the_one_of_the_reference_run() -> None:
    made = planned(LM629, [], only=["phase"], phases=4)
    assert sorted(one.world.where for one in made.worlds) == ["+128us", "+192us", "+64us"]
    assert made.refused == {}


def test_a_board_whose_chips_have_no_cycle_has_no_phases() -> None:
    assert longest_cycle(SimpleNamespace(chips=())) == 0  # type: ignore[arg-type]


def test_a_fault_comes_in_the_middle_of_the_cycles_of_the_host() -> None:
    made = planned(LM629, [row(number, "a") for number in range(1, 8)], only=["fault"])
    assert {one.world.where.partition("@")[2] for one in made.worlds} == {"4000000"}


def test_an_axis_is_disturbed_for_a_while_when_it_is_fastest_and_jammed_in_each_move() -> None:
    file, source = read_board_text(of_part("LM629N-8", "dc_motor"))
    axis = Axis([(0, 50, 0, 50), (50, 90, 50, 90)], 90, 9, False, [(5, 7 * MS), (9, 70 * MS)])
    seen = Account(seen=[row(1, "a")], axes={"x.1": axis})
    made = plan(seen, file, build(file, source), only=["fault"])
    of_axis = {one.group: one.world for one in made.worlds if " x.1 " in one.group}
    assert [of_axis[f"jam x.1 in move {number}"].where for number in (1, 2)] == [
        f"x.1@{7 * MS}", f"x.1@{70 * MS}",
    ]  # fmt: skip
    for fault in ("jam", "supply_sag", "a_open"):
        assert of_axis[f"{fault} x.1 for a while"].where == f"x.1@{70 * MS}+{100 * MS}"
    assert "slip x.1 in move 1" not in of_axis
    assert "offset_jump x.1 for a while" not in of_axis


def test_a_fault_for_a_while_is_over_after_it() -> None:
    file, source = read_board_text(of_part("LM629N-8", "dc_motor"))
    board = build(file, source)
    begin(board, read_world(f"fault:x.1@{MS}+{2 * MS}:jam"))
    states = []
    for now in (MS // 2, 2 * MS, 5 * MS):
        board.run_until(now)
        states += [one.state for one in board.faults.all()]
    assert states == ["waiting", "acting", "over"]


def test_dimensions_take_turns_by_their_shares() -> None:
    rows = [row(number, f"g{number}") for number in range(1, 99)]
    made = planned(LM629, rows, only=["cycle", "phase", "specimen"])
    first = len({(one.world.dimension, one.world.way) for one in made.worlds})
    turns = Counter(one.world.dimension for one in made.worlds[first : first + 32])
    assert turns == {"cycle": 8, "phase": 12, "specimen": 12}


def test_threads_run_in_orders_of_a_million() -> None:
    file, source = read_board_text(LM629)
    made = plan(Account(turns=True), file, build(file, source), only=["threads"])
    orders = [int(one.world.how.removeprefix("order")) for one in made.worlds]
    assert len(orders) == len({*orders}) >= 8
    assert min(orders) >= 1
    assert 10_000 < max(orders) <= 1_000_000


def test_specimens_have_each_extreme_alone_first() -> None:
    file, _ = read_board_text(LM629)
    found = list(specimens(file, 0, 20))
    assert len(found) == 20
    assert [world.how for world in found[:2]] == ["x.reset_status=C4", "x.reset_time=1499 us"]
    assert found == list(specimens(file, 0, 20)) != list(specimens(file, 1, 20))


def test_a_specimen_is_shortened_part_by_part() -> None:
    assert [str(one) for one in shortened(read_world("specimen:+17us:x.a=1,x.b=2:3"))] == [
        "specimen:+17us:x.a=1,x.b=2",
        "specimen:+0us:x.a=1,x.b=2:3",
        "specimen:+17us:x.b=2:3",
        "specimen:+17us:x.a=1:3",
    ]
    assert [str(one) for one in shortened(World("specimen", "+17us", "", 3))] == [
        "specimen:+17us:",
        "specimen:+0us::3",
    ]
    assert [*shortened(read_world("cycle:x.1:lost"))] == []


def test_cycles_are_grouped_by_packet_place_and_what_came_before() -> None:
    file, source = read_board_text(LM629)
    board = build(file, source)
    witness = Witness(board, reference=True)
    with connect_in_process(board) as bus:
        bus.delay("3ms")
        bus.write(0, 0x1D)
        bus.write(1, 0)
        bus.read(0)
        bus.write(1, 0)
        bus.write(0, 0x00)
    assert [(one.number, one.group) for one in witness.account().seen] == [
        (1, "RSTI 1 of 3 (write) after the beginning"),
        (2, "RSTI 2 of 3 (write) after the beginning"),
        (3, "RDSTAT (read) after the beginning"),
        (4, "RSTI 3 of 3 (write) after the beginning"),
        (5, "RESET (write) after RSTI"),
    ]


def test_planned_worlds_are_values() -> None:
    assert PlannedWorld(REFERENCE, "") == PlannedWorld(World(), "")


def test_drawn_specimens_have_all_seeds_of_one_digit() -> None:
    file, _ = read_board_text(LM629)
    assert {one.seed for one in specimens(file, 0, 120)} == {*range(10)}


def test_values_of_two_axes_have_the_number_of_the_axis() -> None:
    file, source = read_board_text(of_part("MC1241A", "ideal"))
    values = Witness(build(file, source), reference=True).account().values
    of_axes = {name.split()[0] for name in values}
    assert of_axes == {"x", "x.1", "x.2"}


DONE = '[board]\ntime = "lockstep"\npower_on = "done"'
"""An MCP-1200 that takes commands at once; its STATUS has the BUSY pin, and bits of the host's."""


def controls(bus: Bus) -> None:
    axis = Mcp1200(bus)
    axis.feature(pid=True)
    axis.control()


def test_a_bit_that_rises_in_each_sample_is_none_that_a_host_leaves() -> None:
    file, source = read_board_text(of_part("MCP-1200", "ideal").replace("[board]", DONE))
    host = FunctionSubject(file, source, controls)
    reference = host.run(REFERENCE, None)
    status, near = reference.values["x status"]
    assert isinstance(status, int)
    assert (status | 1, near) == (253, -2)
    for ahead in range(50, 600, 110):
        world = read_world(f"phase:+{ahead}us:ahead")
        assert judge(reference, host.run(world, reference), world).verdict == NO_EFFECT


@pytest.mark.parametrize("later", range(64, 513, 64))
def test_a_bit_that_changes_within_a_sample_is_found_whenever_a_host_ends(later: int) -> None:
    def host(bus: Bus) -> None:
        controls(bus)
        bus.delay(f"{later}us")

    file, source = read_board_text(of_part("MCP-1200", "ideal").replace("[board]", DONE))
    account = FunctionSubject(file, source, host).run(REFERENCE, None)
    assert account.values["x status"][1] == -2


def test_an_account_waits_for_motors_to_come_to_rest() -> None:
    board = build_lm()
    witness = Witness(board)
    Lm(board).move(3000)
    axis = witness.account().axes["x.1"]
    assert not axis.runs
    assert axis.moves[-1][2:] == (axis.moves[-1][0], axis.moves[-1][1])
    assert abs(axis.last - 3000) <= 4
    assert 20 < axis.speed < 50, "looks are a millisecond apart"


def test_edges_of_outputs_are_those_of_the_reference_run() -> None:
    board = build_lm()
    witness = Witness(board, reference=True)
    begun = board.now
    Lm(board).command(0x1D, 0x0000)
    edges = witness.account().edges
    assert [(name, level) for name, _, level in edges][:1] == [("x.HI", 0)]
    assert all(when >= begun for _, when, _ in edges)


@pytest.mark.parametrize("reference", [False, True])
def test_what_hosts_leave_is_the_same_with_edges_noted_and_without(reference: bool) -> None:
    board = build(*read_board_text(LM629, "board.toml"))
    witness = Witness(board, reference=reference)
    # The trajectory-complete flag of the reset is enabled; HI leads to no host.
    board.run_for(5 * MS)
    assert witness.account().findings == []


def test_names_of_bits_differ_by_themselves_between_specimens() -> None:
    file, source = read_board_text(ALONE, "board.toml")
    idle = FunctionSubject(file, source, lambda bus: None)
    reference = idle.run(REFERENCE, None)
    world = read_world("specimen:+0us:x.reset_status=C4")
    run = idle.run(world, reference)
    assert run.values["x names of the signals"] != reference.values["x names of the signals"]
    assert judge(reference, run, world).verdict == NO_EFFECT
