"""What a run came to, and what all of them together say."""

import json
from xml.etree import ElementTree

import pytest

from vbus.campaign.account import Account, Axis
from vbus.campaign.plan import PlannedWorld, WorldPlan
from vbus.campaign.report import Saved, as_json, as_junit, as_page, lines
from vbus.campaign.verdict import (
    DETECTED,
    FOUND,
    HANG,
    NO_EFFECT,
    SILENT,
    SLOW,
    Campaign,
    Result,
    early,
    judge,
)
from vbus.campaign.world import World, read_world

MOVE = Axis([(0, 200, 0, 203)], 200, 5, False)
GOOD = Account(
    output="at 2000\n",
    errors="1 of 3\n2 of 3\n",
    axes={"x.1": MOVE},
    values={"x kp": (300, 0), "x real": (200, 4)},
)


def other(**changes: object) -> Account:
    """Return what became of a run that differs from the good one in this."""
    given = {name: getattr(GOOD, name) for name in ("output", "errors", "axes", "values")}
    return Account(**(given | changes))


@pytest.mark.parametrize(
    ("run", "verdict", "reason"),
    [
        (other(), NO_EFFECT, ""),
        (other(code=1, errors="oh\nno\n"), DETECTED, "exit code 1: no"),
        (other(errors="once more\n"), DETECTED, "it says: once more"),
        (other(errors="1 of 3\n2 of 3\nso\n"), DETECTED, "it says: so"),
        (other(errors="1 of 3\n"), SILENT, "it does not complain: 2 of 3"),
        (other(errors=""), SILENT, "it does not complain: 1 of 3"),
        (other(stuck="it polled"), HANG, "it polled"),
        (other(stuck="it polled", slow=True), SLOW, "it polled"),
        (other(values={"x kp": (44, 0), "x real": (200, 4)}), SILENT, "x kp is 44, not 300"),
        (other(values={"x kp": (300, 0), "x real": (204, 4)}), NO_EFFECT, ""),
        (other(values={"x kp": (300, 0), "x real": (205, 4)}), SILENT, "x real is 205, not 200"),
        (other(output="at 2004\n"), NO_EFFECT, ""),
        (other(output="at 2005\n"), SILENT, 'line 1 it says is "at 2005", not "at 2000"'),
        (other(output=""), SILENT, 'line 1 it says is missing, not "at 2000"'),
        (
            other(axes={"x.1": Axis([(0, 100, 0, 100)], 100, 5, False)}),
            SILENT,
            "x.1 is at 100 in the end, not at 200",
        ),
        (
            other(axes={"x.1": Axis([(0, 200, 0, 300)], 200, 5, False)}),
            SILENT,
            "x.1 goes from 0 to 300 in move 1, not from 0 to 203",
        ),
        (
            other(axes={"x.1": Axis([*MOVE.moves, *MOVE.moves], 200, 5, False)}),
            SILENT,
            "x.1 makes 1 move more",
        ),
        # It creeps to its target in a step of its own.
        (
            other(axes={"x.1": Axis([*MOVE.moves, (200, 203, 200, 203)], 203, 5, False)}),
            NO_EFFECT,
            "",
        ),
        (
            other(axes={"x.1": Axis(MOVE.moves, 200, 50, False)}),
            SILENT,
            "x.1 is as fast as 50 counts/ms, not 5",
        ),
        (other(axes={"x.1": Axis(MOVE.moves, 200, 5, True)}), SILENT, "x.1 runs on at the end"),
        (
            other(output="", findings=["x lm628.busy-write"]),
            FOUND,
            'line 1 it says is missing, not "at 2000"',
        ),
    ],
)
def test_a_run_is_judged_by_the_reference_run(run: Account, verdict: str, reason: str) -> None:
    result = judge(GOOD, run)
    assert (result.verdict, result.reason) == (verdict, reason)


def test_a_host_that_gives_up_and_leaves_a_motor_under_power_is_told() -> None:
    def left(drive: float, runs: bool = False, **more: object) -> list[str]:
        axis = Axis(MOVE.moves, 200, 5, runs, [], drive)
        return judge(GOOD, other(axes={"x.1": axis}, **more)).findings

    driven = "x.1 is left with its motor at more than half of full command"
    assert left(0.5, code=1) == left(0.5, errors="no\n") == left(1.0, stuck="it polled") == [driven]
    assert left(0.4, code=1) == left(1.0) == []
    assert left(1.0, runs=True, code=1) == ["x.1 is left running"]
    held = Account(axes={"x.1": Axis([], 0, 0, False, [], 0.6)})
    assert judge(held, Account(code=1, axes=held.axes)).findings == []


def test_what_is_found_where_the_host_says_so_is_told_once() -> None:
    worlds = [world(number, "lost") for number in (10, 9, 8)]
    found = [Result(DETECTED, "no", ["x lm628.left-armed"])] * 2 + [Result(DETECTED, "no")]
    results = dict(zip([one.name for one in worlds], found, strict=True))
    made = Campaign(WorldPlan(worlds, {}, {}), results)
    assert list(lines(made, None, again, 0))[-2:] == [
        "detected, and yet x lm628.left-armed: 2 worlds, first x LFIL 1 of 3 (write) after RSTI,"
        " cycle 9 of x: its strobe is lost",
        "    again cycle:x.9:lost",
    ]


def test_flags_are_compared_but_for_bits_that_go_on_changing() -> None:
    one, two, three = (
        Account(values={"x status": value}) for value in ((252, -2), (253, -1), (188, -1))
    )
    assert judge(one, two).verdict == judge(two, one).verdict == NO_EFFECT
    assert judge(one, three).reason == "x status is 188, not 252"


def world(number: int, way: str) -> PlannedWorld:
    """Return a world of chip x."""
    return PlannedWorld(World("cycle", f"x.{number}", way), "x LFIL 1 of 3 (write) after RSTI")


def campaign() -> Campaign:
    """Return a campaign that has tried four worlds of five."""
    plan = WorldPlan(
        [world(9, "flip1"), world(2, "flip0"), world(1, "lost"), world(3, "lost"),
         world(4, "lost")],
        {("cycle", "lost"): 7}, {"threads": "one order", "busy": "one order"},
    )  # fmt: skip
    silent = Result(SILENT, "kp <is> 44", [])
    return Campaign(plan, {
        "cycle:x.9:flip1": silent, "cycle:x.2:flip0": silent,
        "cycle:x.1:lost": Result(DETECTED, "exit code 1"), "cycle:x.3:lost": Result(NO_EFFECT),
    })  # fmt: skip


def again(one: PlannedWorld) -> str:
    """Return what runs a world again."""
    return f"again {one.world}"


def test_the_table_has_each_way_with_its_coverage_and_what_was_not_tried() -> None:
    assert [" ".join(line.split()) for line in lines(campaign(), None, again, None)] == [
        "detected no effect hang finding silent tried not tried coverage",
        "cycle flip 0 0 0 0 2 2 0 0 %",
        "cycle lost 1 1 0 0 0 2 8 100 %",
        "not tried: threads, busy: one order",
        "silent: x LFIL 1 of 3 (write) after RSTI, cycle 2 of x: D0 is inverted",
        "kp <is> 44",
        "again cycle:x.2:flip0",
    ]


def test_a_baseline_excuses_what_it_names() -> None:
    made = campaign()
    (one,) = made.new(())
    assert one.planned.world.where == "x.2"
    assert made.new([one.key]) == []


def test_a_file_of_results_is_json_and_the_same_whatever_came_first() -> None:
    results = {
        "cycle:x.2:lost": Result(SILENT, "x", [], "STT"),
        "cycle:x.1:lost": Result(NO_EFFECT),
    }
    saved = Saved({"a": "0", "b": "1"}, results)
    back = Saved({"b": "1", "a": "0"}, dict(reversed(results.items())))
    assert as_json(saved) == as_json(back)
    found = json.loads(as_json(saved))
    assert found["results"]["cycle:x.2:lost"]["verdict"] == SILENT
    assert found["keys"] == [["cycle", "STT", "lost"]]


def test_silent_outcomes_of_a_file_are_those_of_all_its_results() -> None:
    saved = Saved({"t": "0"})
    saved.take(PlannedWorld(World("phase", "+1us", "ahead"), "place", "t"), Result(FOUND), None)
    saved.take(world(3, "flip7"), Result(SILENT), None)
    saved.take(world(4, "lost"), Result(DETECTED), None)
    assert saved.silent() == [
        ("cycle", "x LFIL 1 of 3 (write) after RSTI", "flip"), ("phase", "t: place", "phase"),
    ]  # fmt: skip


def test_of_a_specimen_that_is_told_the_least_is_looked_for() -> None:
    long = PlannedWorld(World("specimen", "+17us", "x.a=1,x.b=2", 3), "x.a")
    silent = {long.name: Result(SILENT, "so"), "cycle:x.1:lost": Result(SILENT)}
    made = Campaign(WorldPlan([long, world(1, "lost")], {}, {}), silent)
    tried: list[str] = []

    def run(one: World) -> Result:
        tried.append(str(one))
        return Result(SILENT if "x.b=2" in one.how else NO_EFFECT)

    found = made.with_least(run, lambda: False).tried
    assert [one.result.least for one in found] == [str(long.world), ""]
    assert tried == [], "there is no time for it"
    less = made.with_least(run, lambda: True)
    assert [str(one.replay.world) for one in less.listed()] == [
        "cycle:x.1:lost", "specimen:+0us:x.b=2",
    ]  # fmt: skip
    assert "again specimen:+0us:x.b=2" in "".join(lines(less, None, again, None))
    assert long.name not in tried
    tried.clear()
    assert less.with_least(run, lambda: True).listed() == less.listed()
    assert tried == []


@pytest.mark.parametrize(
    ("name", "told"),
    [("phase:+64us:ahead", True), ("specimen:+0us:x.b=2", True), ("threads:program:order3", True),
     ("cycle:x.1:lost", False), ("fault:x@20:power_on_c4", False)],
)  # fmt: skip
def test_a_host_that_fails_with_nothing_broken_is_told(name: str, told: bool) -> None:
    one = PlannedWorld(read_world(name), "x")
    made = Campaign(WorldPlan([one], {}, {}), {name: Result(DETECTED, "exit code 1")})
    assert (
        any("fails, and nothing is broken" in line for line in lines(made, None, again, None))
        == told
    )
    assert not made.new(())


def test_a_world_that_has_not_come_about_is_said_to_be_so() -> None:
    lost = World("cycle", "x.9", "lost")
    waits = other(unfired=[("jam", "x.1", "at 3 ps"), ("strobe_lost", "x", "cycle 9")])
    assert judge(GOOD, waits, lost).reason == "nothing was broken: the run ended before cycle 9"
    assert judge(GOOD, waits).reason == ""


def test_junit_has_a_case_for_each_group_and_way() -> None:
    made = campaign()
    suite = ElementTree.fromstring(as_junit(made, made.new(()), again))
    assert suite.attrib == {"name": "vbus campaign", "tests": "2", "failures": "1"}
    assert suite[0].attrib["name"] == "x LFIL 1 of 3 (write) after RSTI: flip"
    assert suite[0][0].text == "cycle 2 of x: D0 is inverted: kp <is> 44\nagain cycle:x.2:flip0"


def test_the_page_asks_for_nothing_and_each_cell_says_how_to_run_it_again() -> None:
    page = as_page(campaign(), "--board <b> -- ./host", again).decode()
    there = ("again cycle:x.9:flip1", "kp &lt;is&gt; 44", "--board &lt;b&gt;", "silent 2/2",
             "detected 1/2", "<tr><th>cycle flip<td>0<td>0<td>0<td>0<td>2<td>2<td>0<td>0 %",
             "<table><tr><th>way<th>detected<th>no effect",
             "<tr><td class=l>x LFIL 1 of 3 (write) after RSTI")  # fmt: skip
    assert [text for text in there if text not in page] == []
    assert page.count("<table>") == page.count("</table>") == 2
    assert [text for text in ("http", "src=") if text in page] == []


def test_a_cell_of_the_page_says_what_was_not_tried_and_rows_come_as_cycles_do() -> None:
    plan = [
        PlannedWorld(World("cycle", f"x.{n}", way), group)
        for n, way, group in ((9, "lost", "late"), (2, "lost", "soon"), (2, "busy", "soon"))
    ]
    page = as_page(Campaign(WorldPlan(plan, {}, {}), {}), "", again).decode()
    assert page.endswith(
        "<th>lost<th>busy<tr><td class=l>soon<td class=left>not tried<td class=left>not tried"
        "<tr><td class=l>late<td class=left>not tried<td></table>\n"
    )  # fmt: skip


def test_a_way_that_was_left_out_altogether_has_a_row_with_what_is_left() -> None:
    made = Campaign(WorldPlan([], {("cycle", "late"): 7}, {}), {})
    assert [(row.dimension, row.way, row.tried, row.left) for row in made.totals()] == [
        ("cycle", "late", 0, 7)
    ]


def test_what_the_campaign_did_not_come_to_is_said() -> None:
    made = Campaign(WorldPlan([world(1, "lost")], {("cycle", "late"): 7}, {}), {})
    assert list(lines(made, None, again, None))[-1] == (
        "not tried: cycle lost, cycle late: the campaign ended before"
    )


def test_beyond_the_most_outcomes_there_is_one_line_that_counts_the_others() -> None:
    worlds = [world(number, way) for number, way in enumerate(("flip0", "lost", "doubled"), 1)]
    silent = {one.name: Result(SILENT, "kp is 44") for one in worlds}
    found = list(lines(Campaign(WorldPlan(worlds, {}, {}), silent), (), again, 1))
    assert found[-1] == "2 more; --all tells them, --json and --page have them"
    assert [line for line in found if "more;" in line] == found[-1:]


def test_of_outcomes_alike_the_earliest_cycle_is_shown_by_its_number() -> None:
    worlds = [world(number, "lost") for number in (10, 9)]
    made = Campaign(WorldPlan(worlds, {}, {}), {one.name: Result(SILENT, "so") for one in worlds})
    assert [one.planned.world.where for one in made.listed()] == ["x.9"]


def test_pins_of_a_chip_are_listed_before_its_axes() -> None:
    """A name of a fault stands before "jam" in no other order."""
    worlds = [PlannedWorld(World("fault", f"x.{what}@4", "jam"), "") for what in ("1", "HI", "0")]
    assert [one.world.where for one in sorted(worlds, key=early)] == ["x.0@4", "x.HI@4", "x.1@4"]


def test_results_of_another_state_of_a_test_are_forgotten_and_no_others() -> None:
    saved = Saved({"t": "1", "": "1"})
    for test in ("t", ""):
        saved.take(PlannedWorld(World("cycle", "x.1", "lost"), "", test), Result(FOUND), None)
    assert [*saved.of("1", "t")] == ["t: cycle:x.1:lost"]
    assert saved.of("2", "t") == {}
    assert [*saved.results] == [*saved.of("1")] == ["cycle:x.1:lost"]


def test_a_campaign_that_is_stopped_has_stored_the_last_hundred_results() -> None:
    saved, stored = Saved(), list[bytes]()
    for number in range(250):
        saved.take(world(number, "flip0"), Result(NO_EFFECT), stored.append)
        saved.take(world(number, "flip1"), Result(SLOW), stored.append)
    assert [len(json.loads(file)["results"]) for file in stored] == [100, 200]
    assert len(saved.results) == 250
