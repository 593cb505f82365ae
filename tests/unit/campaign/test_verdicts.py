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
    judge,
)
from vbus.campaign.world import World

MOVE = Axis([(0, 200, 0, 203)], 200, 5, False)
GOOD = Account(
    output="at 2000\n", axes={"x.1": MOVE}, values={"x kp": (300, 0), "x real": (200, 4)}
)


def other(**changes: object) -> Account:
    """Return what became of a run that differs from the good one in this."""
    given = {name: getattr(GOOD, name) for name in ("output", "axes", "values")}
    return Account(**(given | changes))  # type: ignore[arg-type]


@pytest.mark.parametrize(
    ("run", "verdict", "reason"),
    [
        (other(), NO_EFFECT, ""),
        (other(code=1, errors="oh\nno\n"), DETECTED, "exit code 1: no"),
        (other(errors="once more\n"), DETECTED, "it says: once more"),
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
    results = {"b": Result(SILENT, "x"), "a": Result(NO_EFFECT)}
    saved = Saved({"": "0"}, results)
    back = Saved({"": "0"}, dict(reversed(results.items())))
    assert as_json(saved) == as_json(back)
    assert json.loads(as_json(saved))["results"]["b"]["verdict"] == SILENT


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
             "<table><tr><th>way<th>detected<th>no effect")  # fmt: skip
    assert [text for text in there if text not in page] == []
    assert page.count("<table>") == page.count("</table>") == 2
    assert [text for text in ("http", "src=") if text in page] == []


def test_a_way_that_was_left_out_altogether_has_a_row_with_what_is_left() -> None:
    made = Campaign(WorldPlan([], {("cycle", "late"): 7}, {}), {})
    assert [(row.dimension, row.way, row.tried, row.left) for row in made.totals()] == [
        ("cycle", "late", 0, 7)
    ]


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
