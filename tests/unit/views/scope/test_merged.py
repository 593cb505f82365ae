"""Recordings on one page: what each part told is there, under names that tell the parts apart."""

from typing import Any

import pytest

from tests.nodes.four_chips import BOARD as FOUR
from tests.nodes.four_chips import scenario
from tests.unit.views.conftest import LM629, lm629_move
from tests.unit.views.scope.decoded import Seen
from vbus.board.build import load_board_text
from vbus.board.config import read_board_text
from vbus.core.kernel import MS, US
from vbus.nodes.machine import Machine
from vbus.nodes.plan import pins_of
from vbus.nodes.scenario import read_scenario
from vbus.views.clauses import clause_frame
from vbus.views.scope.frames import ALL, NOW, frame
from vbus.views.scope.lanes import MARK_TITLES
from vbus.views.scope.merged import Merged
from vbus.views.scope.recording import Recorder


def recording(name: str, *hosts: Any) -> tuple[dict[str, Any], list[bytes]]:
    """Record a board, in as many messages as it has hosts, and one more."""
    board = load_board_text(LM629.replace('name = "bench"', f'name = "{name}"'))
    recorder = Recorder(board, edges=True)
    recorder.start()
    messages = []
    for number, host in enumerate(hosts):
        messages += recorder.take()
        host(board.open_port(f"h{number}"))
    recorder.stop()
    messages += recorder.take()
    return recorder.lanes.described(live=False), messages


def wrong(port: Any) -> None:
    """Say something the manual has no word for: a violation, with a packet for it."""
    port.write(0, 0x55)


def together(*parts: tuple[dict[str, Any], list[bytes]]) -> tuple[Seen, list[Seen]]:
    """Merge parts, their messages by turns; return what a page has seen of all, and of each."""
    merged = Merged([told for told, _ in parts])
    data = b""
    for place in range(max(len(messages) for _, messages in parts)):
        for number, (_, messages) in enumerate(parts):
            if place < len(messages):
                data += merged.take(number, messages[place])
    for number in merged.by_end():
        data += merged.end(number)
    return Seen(merged.description, data), [Seen(t, b"".join(m)) for t, m in parts]


def check(seen: Seen, alone: Seen, front: str = "") -> None:
    """Look for all that a part told alone."""
    marks = {lane["name"] for lane in alone.description["lanes"] if lane["kind"] == "marks"}
    packets = {lane["name"] for lane in alone.description["lanes"] if lane["kind"] == "packets"}
    assert any(alone.rows[name] for name in packets)
    for name, rows in alone.rows.items():
        if name in marks:
            left = [(at, mark["text"]) for at, mark in seen.rows[name]]
            assert all((at, mark["text"]) in left for at, mark in rows)
        elif name in packets:
            assert seen.packets(front + name) == alone.packets(name)
        else:
            assert seen.rows[front + name] == rows, name
    for chip in alone.chips:
        for register in chip["registers"]:
            lane = seen.register(front + chip["name"], register["name"])["lane"]
            assert seen.rows[seen.names[lane]] == alone.rows[alone.names[register["lane"]]]
    said = {text for (lane, value), text in alone.words.items()}
    assert said <= {text for (lane, value), text in seen.words.items()}


def test_boards_with_chips_of_one_name_stand_under_the_names_of_the_boards() -> None:
    seen, parts = together(
        recording("left", wrong, lm629_move), recording("right", lm629_move, wrong, wrong)
    )
    check(seen, parts[0], "left.")
    check(seen, parts[1], "right.")
    assert [axis["name"] for axis in seen.description["axes"]] == ["left.x", "right.x"]
    assert seen.description["board"] == "left + right"
    assert seen.description["xy"] == [["left.x.real", "right.x.real", "left.x.desired",
                                       "right.x.desired"]]  # fmt: skip
    assert seen.now == max(part.now for part in parts)


def test_two_runs_of_one_board_are_numbered() -> None:
    seen, parts = together(recording("axis", lm629_move), recording("axis", wrong))
    check(seen, parts[0], "axis_1.")
    check(seen, parts[1], "axis_2.")


def test_a_violation_stands_with_the_packet_of_its_own_part() -> None:
    seen, parts = together(recording("left", lm629_move), recording("right", wrong, wrong))

    def said(page: Seen) -> list[tuple[int, str]]:
        marks = page.rows["violations"]
        return [(at, page.labels[mark["label"]]) for at, mark in marks if mark["label"] is not None]

    assert all(said(part) for part in parts)
    assert sorted(said(seen)) == sorted(said(parts[0]) + said(parts[1]))


def test_marks_of_one_kind_are_one_lane_and_every_lane_has_a_number_of_its_own() -> None:
    seen, parts = together(recording("left", wrong), recording("right", wrong))
    lanes = seen.description["lanes"]
    assert [lane["id"] for lane in lanes] == [*range(len(lanes))]
    assert len({*seen.names.values()}) == len(lanes)
    marks = [lane for lane in parts[0].description["lanes"] if lane["kind"] == "marks"]
    assert len(lanes) == 2 * len(parts[0].description["lanes"]) - len(marks)


def test_nodes_of_a_machine_keep_the_names_of_their_chips_and_share_one_time() -> None:
    file, source = read_board_text(FOUR)
    machine = Machine(file, source, read_scenario(scenario(), "s", pins_of(file), US))
    recorders = [Recorder(node.board, edges=False) for node in machine.nodes]
    for recorder in recorders:
        recorder.start()
    machine.run()
    told = []
    for recorder in recorders:
        recorder.stop()
        told.append((recorder.lanes.described(live=False), recorder.take()))
    seen, parts = together(*told)
    for part in parts:
        clashing = {name for name in part.rows if name not in seen.rows}
        assert all(f"{part.description['board'].partition('.')[2]}.{name}" in seen.rows
                   for name in clashing)  # fmt: skip
    axes = [axis["name"] for part in parts for axis in part.description["axes"]]
    assert [axis["name"] for axis in seen.description["axes"]] == axes
    assert seen.description["board"] == file.board.name
    for part in parts:
        for axis in part.description["axes"]:
            assert seen.rows[f"{axis['name']}.real"] == part.rows[f"{axis['name']}.real"]


def test_time_is_that_of_the_part_that_is_farthest_behind() -> None:
    told, _ = recording("left", wrong)
    merged = Merged([told, told | {"board": "right"}])

    def now(part: int, instant: int) -> int | None:
        data = merged.take(part, frame(NOW, ALL, 0, instant))
        return Seen(merged.description, data).now if data else None

    assert now(0, 5 * MS) is None
    assert now(1, 2 * MS) == 2 * MS
    assert now(1, 7 * MS) == 5 * MS
    assert now(0, 5 * MS) is None
    assert Seen(merged.description, merged.end(0)).now == 7 * MS
    assert merged.end(1) == b""


def test_a_part_that_comes_back_goes_on_where_it_was() -> None:
    def parts(first: int, last: int, after: int = -1) -> tuple[dict[str, Any], list[bytes]]:
        """Record a board whose host does the same each time, from one of its packets to another."""
        board = load_board_text(LM629)
        recorder = Recorder(board, edges=False)
        port = board.open_port("h")
        messages = []
        for number in range(last):
            if number == first:
                told = recorder.lanes.described(live=True)
                recorder.start(after)
            lm629_move(port) if number % 2 else wrong(port)
            if number >= first:
                messages.append(b"".join(recorder.take()))
        recorder.stop()
        return told, messages

    told, whole = parts(0, 6)
    merged = Merged([told | {"board": "left"}, told | {"board": "right"}])
    data = b"".join(merged.take(0, message) for message in whole)
    data += b"".join(merged.take(1, message) for message in whole[:3]) + merged.end(1)
    data += merged.event(1, "has gone")
    came = Seen(told, b"".join(whole[:3])).now
    assert merged.came(1) == came
    back, rest = parts(1, 6, came)
    assert int(back["now"]) < came
    assert merged.fits(1, back)
    assert not merged.fits(1, back | {"axes": []})
    data += merged.begin_again(1, back)
    data += b"".join(merged.take(1, message) for message in rest)
    seen, alone = Seen(merged.description, data), Seen(told, b"".join(whole))
    for name, rows in alone.rows.items():
        if name not in MARK_TITLES.values():
            assert [row[0] for row in seen.rows[f"right.{name}"]] == [row[0] for row in rows], name
    assert seen.packets("right.x bus") == alone.packets("x bus")
    assert len(seen.rows["violations"]) == 2 * len(alone.rows["violations"]) > 2
    said = [mark["text"] for _, mark in seen.rows["nodes"]]
    assert said == ["right has gone", f"right is back at {back['now']} ps"]
    assert merged.came(1) == seen.now == alone.now


def test_what_nobody_saw_of_a_part_that_comes_back_late_is_told() -> None:
    told, _ = recording("left", wrong)
    merged = Merged([part | {"live": True} for part in (told, told | {"board": "right"})])
    merged.take(1, frame(NOW, ALL, 0, 5 * MS))
    merged.end(1)
    seen = Seen(merged.description, merged.begin_again(1, told | {"now": str(7 * MS)}))
    ((_, mark),) = seen.rows["nodes"]
    assert mark["text"] == f"right is back at {7 * MS} ps, not seen since {5 * MS} ps"


def test_clauses_pass_as_they_are() -> None:
    told, _ = recording("left", wrong)
    merged = Merged([told, told | {"board": "right"}])
    clauses = clause_frame(["LM628"])
    assert merged.take(1, clauses) == clauses


def test_more_lanes_than_frames_can_number_are_refused() -> None:
    told, _ = recording("left", wrong)
    many = told | {"lanes": told["lanes"] * (40_000 // len(told["lanes"]))}
    with pytest.raises(ValueError, match="more than one page has"):
        Merged([many, many | {"board": "right"}])
