"""Bookmarks: set, listed, gone to, taken away; kept in the page or by the server."""

import csv
import io
import json
from pathlib import Path
from typing import Any

import pytest

from tests.browser.conftest import ADDRESS, Open, keeps_out, until_drawn
from tests.browser.recordings import COMMAND, MS, Recording
from tests.browser.test_live import Board
from tests.browser.test_page import drawn, place, saved, state
from vbus.views.scope.page_file import one_file

HERE = {"at": str(40 * MS), "text": "it <starts> here"}


def description(bookmarks: list[dict[str, str]]) -> tuple[dict[str, Any], list[bytes]]:
    recording = Recording(end=100 * MS)
    bus = recording.lane(None, "x bus", "packets", "x: packets")
    recording.packets(bus, [(10 * MS, 12 * MS, "STT", COMMAND), (60 * MS, 61 * MS, "UDF", COMMAND)])
    recording.lane(None, "bookmarks", "marks", "bookmarks")
    return json.loads(recording.description()) | {"bookmarks": bookmarks}, recording.frames


@pytest.fixture
def page(open_recording: Open) -> Any:
    return open_recording(one_file(*description([HERE])).decode())


def listed(page: Any) -> list[list[str]]:
    page.keyboard.press("2")
    drawn(page)
    found: list[list[str]] = page.evaluate(
        "[...document.querySelectorAll('#marks-table .body .row')].map((row) =>"
        " [...row.querySelectorAll('span')].map((cell) => cell.innerText))"
    )
    return found


def put(page: Any, text: str) -> None:
    page.keyboard.press("m")
    page.keyboard.type(text)
    page.keyboard.press("Enter")
    page.locator("#bookmark").wait_for(state="hidden")


def test_a_bookmark_is_listed_and_gone_to(page: Any) -> None:
    assert listed(page) == [["0.040000000", "bookmark", HERE["text"]]]
    assert page.evaluate("scope.lane('bookmarks').instant(0)") == 40 * MS
    for _ in range(9):
        page.keyboard.press("+")
    page.keyboard.press("Home")
    assert state(page)["end"] < 40 * MS
    page.locator("#marks-table .body .row").first.click()
    drawn(page)
    assert state(page)["start"] < 40 * MS < state(page)["end"]


def test_one_is_set_by_the_keys_and_taken_away(page: Any) -> None:
    place(page, "a", 20 * MS)
    put(page, "m is a letter")
    assert [row[2] for row in listed(page)] == ["m is a letter", HERE["text"]]
    at = page.evaluate("scope.lane('bookmarks').instant(0)")
    assert abs(at - 20 * MS) <= state(page)["scale"]
    page.keyboard.press("m")
    page.keyboard.press("Escape")
    assert len(listed(page)) == 2
    page.locator("#marks-table .body .row").nth(1).click()
    page.get_by_role("button", name="Remove bookmark").click()
    assert [row[2] for row in listed(page)] == ["m is a letter"]


def test_keys_do_what_they_do_as_soon_as_it_is_set(page: Any) -> None:
    page.keyboard.press("m")
    page.keyboard.type("here")
    assert page.evaluate(
        "document.getElementById('bookmark-form').requestSubmit();"
        "document.getElementById('bookmark-text').dispatchEvent("
        "  new KeyboardEvent('keydown', {key: '2', bubbles: true}));"
        "[document.getElementById('bookmark').open, document.getElementById('marks').hidden]"
    ) == [False, False]


def test_the_page_is_saved_anew_with_them(page: Any, new_page: Open, tmp_path: Path) -> None:
    put(page, "</script> & more")
    again = saved(page, lambda: page.select_option("#save", "page"))
    (tmp_path / "saved.html").write_text(again, encoding="utf-8")
    other = new_page()
    other.goto((tmp_path / "saved.html").as_uri())
    until_drawn(other)
    assert sorted(row[2] for row in listed(other)) == sorted([HERE["text"], "</script> & more"])
    assert other.evaluate("scope.lane('x bus').rows") == 2
    other.locator("#marks-table .body .row").first.click()
    other.get_by_role("button", name="Remove bookmark").click()
    drawn(other)
    third = saved(other, lambda: other.select_option("#save", "page"))
    assert len(third) < len(again)
    assert third.count('id="recording"') == 1


def test_they_are_among_packets_as_csv(page: Any) -> None:
    page.keyboard.press("1")
    rows = list(csv.reader(io.StringIO(saved(page, lambda: page.click("#packets-csv")))))
    assert [row[3:] for row in rows] == [
        ["kind", "packet"], ["command", "STT"], ["bookmark", HERE["text"]], ["command", "UDF"],
    ]  # fmt: skip
    assert rows[2][:3] == ["0.040000000000", "", ""]


def test_a_server_keeps_them_for_every_page(new_page: Open) -> None:
    page = new_page()
    board = Board(page)
    board.recording.lane(None, "bookmarks", "marks", "bookmarks")
    page.goto(ADDRESS)
    page.wait_for_function("document.title.startsWith('bench')")
    for _ in range(10):
        board.play()
    board.reached()
    put(page, "mine")
    assert listed(page) == [], "what the server keeps, it tells"
    (order,) = board.heard
    assert order["do"] == "bookmark"
    assert order["bookmark"]["text"] == "mine"
    others = [{"at": str(100 * MS), "text": "of another page"}, order["bookmark"]]
    board.sockets[-1].send(json.dumps({"bookmarks": others}))
    page.wait_for_function("scope.lane('bookmarks').rows === 2")
    assert [row[2] for row in listed(page)] == ["mine", "of another page"], "in order of time"
    page.locator("#marks-table .body .row").nth(1).click()
    page.get_by_role("button", name="Remove bookmark").click()
    page.wait_for_function("true")
    assert board.heard[1] == {"do": "forget", "bookmark": others[0]}


def test_the_question_for_its_text_keeps_nobody_out(page: Any) -> None:
    page.keyboard.press("m")
    assert page.locator("#bookmark").is_visible()
    assert keeps_out(page) == []
