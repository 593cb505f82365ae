"""The page of a board that runs: what comes over its WebSocket, played by the test."""

import json
import math
from typing import Any

import pytest

from tests.browser.conftest import ADDRESS, Open, serve
from tests.browser.recordings import (
    COMMAND,
    MS,
    PAGE,
    SAMPLE,
    SECOND,
    STATUS,
    Recording,
    column,
    frame,
    now,
    samples,
)
from tests.browser.test_page import colour, drawn, state, track, x_of

SLICE = 125
"""Samples in a message: 32 ms of them."""
PIXELS = (
    "((plot) => plot.getContext('2d').getImageData(0, 0, plot.width, plot.height).data)"
    "(document.getElementById('plot'))"
)


class Board:
    """What a server tells its pages, and what it heard from them."""

    def __init__(self, page: Any, control: bool = False) -> None:
        self.page = page
        self.recording = Recording(live=True, control=control)
        for axis in "xy":
            self.recording.axis(axis)
            for name, unit in (("real", "counts"), ("error", "counts"), ("velocity", "counts/s")):
                self.recording.lane(axis, name, "number", name, unit=unit, tick=1)
        self.bus = self.recording.lane(None, "x bus", "packets", "x: packets")
        self.marks = self.recording.lane(None, "violations", "marks", "violations")
        self.count = 0
        self.sockets: list[Any] = []
        self.heard: list[Any] = []
        self.codes: list[str] = []
        page.route_web_socket("**/live", self._opened)
        serve(page, (PAGE / "index.html").read_text())
        page.route("**/enter", self._enter)

    def _enter(self, route: Any) -> None:
        self.codes.append(route.request.post_data)
        route.fulfill(status=204)

    def _opened(self, socket: Any) -> None:
        self.sockets.append(socket)
        socket.on_message(lambda text: self.heard.append(json.loads(text)))
        socket.send(self.recording.description())

    def value(self, n: int) -> int:
        return round(1000 * math.sin(n / 300))

    def play(self, more: bytes = b"") -> None:
        """Send the next slice of all lanes in one message."""
        rows = range(self.count, self.count + SLICE)
        message = more
        for lane in range(6):
            values = [self.value(n) + lane for n in rows]
            message += samples(lane, [n * SAMPLE for n in rows], values, types=(0, 1))
        self.count += SLICE
        message += now(self.count * SAMPLE)
        self.sockets[-1].send(message)

    def packet(self, begin: int, end: int, label: str, kind: int = COMMAND) -> bytes:
        labels = frame(3, 0xFFFF, 1, 0, column([label], 4))
        number = len(self.recording.labels)
        self.recording.labels.append(label)
        columns = column([0], 0), column([end - begin], 0), column([number], 1), column([kind], 3)
        return labels + frame(2, self.bus, 1, begin, *columns)

    def reached(self) -> None:
        """Wait until the page has all that was sent."""
        end = self.count * SAMPLE
        self.page.wait_for_function(f"scope.state.now === {end}n")
        drawn(self.page)


@pytest.fixture
def board(new_page: Open) -> Board:
    page = new_page()
    board = Board(page)
    page.goto(ADDRESS + "#one-time-code")
    page.wait_for_function("document.title.startsWith('bench')")
    return board


def test_the_code_is_shown_once_and_leaves_the_address(board: Board) -> None:
    assert board.codes == ["one-time-code"]
    assert board.page.url == ADDRESS


def test_it_follows_what_comes(board: Board) -> None:
    page = board.page
    for _ in range(20):
        board.play()
    board.reached()
    seen = state(page)
    assert seen["follow"]
    assert seen["now"] <= seen["end"] < seen["now"] + 2 * seen["scale"]
    for n in (0, 1234, board.count - 1):
        assert page.evaluate(f"scope.lane('x.real').at({n * SAMPLE}n)") == board.value(n)


def test_what_is_copied_is_what_would_be_drawn(board: Board) -> None:
    page = board.page
    for n in range(80):
        at = board.count * SAMPLE
        board.play(board.packet(at, at + 20 * MS, f"RDRP {n}") if n % 3 == 0 else b"")
        board.reached()
    page.evaluate(f"window.copied = {PIXELS}")
    columns = state(page)["columns"]
    page.keyboard.press("t")
    page.keyboard.press("t")
    drawn(page)
    assert state(page)["columns"] > columns
    differ = page.evaluate(
        f"(() => {{ const anew = {PIXELS}; return anew.filter((value, at) =>"
        " Math.abs(value - window.copied[at]) > 48).length; })()"
    )
    assert differ == 0, "copied columns are those that would be drawn"


def test_a_message_draws_new_columns_only(board: Board) -> None:
    page = board.page
    for _ in range(40):
        board.play()
    board.reached()
    seen = state(page)
    for _ in range(5):
        board.play()
        board.reached()
    after = state(page)
    tracks = len(after["tracks"])
    new = (after["start"] - seen["start"]) // seen["scale"]
    # Frames of texts and tables come by a clock, so that a busy machine draws more than five.
    assert after["columns"] - seen["columns"] <= tracks * (
        new + 12 * (after["frames"] - seen["frames"])
    )


def test_late_packets_come_to_their_place(board: Board) -> None:
    page = board.page
    for _ in range(10):
        board.play()
    board.play(board.packet(200 * MS, 201 * MS, "RDSTAT 80H", STATUS))
    board.play(board.packet(300 * MS, 310 * MS, "STT"))
    board.reached()
    board.play(board.packet(100 * MS, 280 * MS, "LTRJ position 500"))
    board.play()
    board.reached()
    page.wait_for_function("document.getElementById('packets-count').textContent === '3 packets'")
    rows = page.locator("#packets-table .body .row").all()
    assert [row.locator("span").nth(2).inner_text() for row in rows] == [
        "LTRJ position 500", "RDSTAT 80H", "STT",
    ]  # fmt: skip
    row = track(page, "x bus")
    y = row["top"] + row["height"] / 2 - 10
    data = page.evaluate(
        "([x, y]) => [...document.getElementById('plot').getContext('2d')"
        ".getImageData(x, y, 1, 1).data]",
        [round(x_of(page, 250 * MS)), round(y)],
    )
    assert data[:3] == colour(page, "packet-0"), "it is drawn where other columns were copied"


def test_hold_and_follow(board: Board) -> None:
    page = board.page
    for _ in range(20):
        board.play()
    board.reached()
    page.keyboard.press("Space")
    drawn(page)
    held = state(page)
    for _ in range(10):
        board.play()
    board.reached()
    assert state(page)["start"] == held["start"]
    page.keyboard.press("Space")
    drawn(page)
    assert state(page)["start"] > held["start"]


def test_a_trigger_holds_the_view_where_it_became_true(board: Board) -> None:
    page = board.page
    board.play()
    board.reached()
    page.keyboard.press("5")
    page.fill("#condition", "x.real > 900")
    page.select_option("#mode", "single")
    page.click("#arm")
    for _ in range(90):
        board.play()
    board.reached()
    first = next(n for n in range(SLICE, board.count) if board.value(n) > 900)
    seen = state(page)
    assert seen["trigger"] == first * SAMPLE
    assert not seen["follow"]
    assert x_of(page, first * SAMPLE) == pytest.approx(seen["width"] / 4, abs=1)
    assert page.locator("#arm").get_attribute("aria-pressed") == "false"


def test_it_comes_back_after_the_server_did(board: Board) -> None:
    page = board.page
    for _ in range(5):
        board.play()
    board.reached()
    board.sockets[-1].close()
    page.wait_for_function("document.getElementById('state').classList.contains('lost')")
    page.wait_for_function("!document.getElementById('state').classList.contains('lost')")
    assert len(board.sockets) == 2
    board.count = 0
    for _ in range(3):
        board.play()
    board.reached()
    assert page.evaluate("scope.lane('x.real').rows") == 3 * SLICE


def test_orders_only_where_the_server_takes_them(new_page: Open, board: Board) -> None:
    assert board.page.locator("#control").is_hidden()
    board.page.keyboard.press("g")
    board.page.keyboard.press("s")
    page = new_page()
    other = Board(page, control=True)
    page.goto(ADDRESS)
    page.wait_for_function("document.title.startsWith('bench')")
    page.click("#pause")
    page.keyboard.press("s")
    page.wait_for_function("true")
    told = {"state": "paused", "text": "paused", "now_ps": "12", "rate": 1.0}
    other.sockets[-1].send(json.dumps({"answer": "paused", "control": told}))
    page.wait_for_function("document.getElementById('control-state').textContent === 'paused'")
    assert page.locator("#pause").get_attribute("aria-pressed") == "true"
    page.keyboard.press("g")
    page.wait_for_function("true")
    other.sockets[-1].send(json.dumps({"answer": "x rests", "error": True}))
    page.wait_for_function("document.getElementById('control-told').textContent === 'x rests'")
    assert other.heard == [{"do": "pause"}, {"do": "step", "by": "cycle", "count": 1}, {"do": "go"}]
    assert board.heard == []


def test_what_is_left_out_is_said_beside_the_state(board: Board) -> None:
    page = board.page
    board.play()
    board.reached()
    state_of = "document.getElementById('state').textContent"
    assert page.evaluate(state_of) == "live, lockstep"
    text = "all before 2.000 s is left out: the scope keeps 256 MiB"
    mark = {"text": text, "kind": "gap", "rule": None, "clause": None, "label": None}
    board.play(frame(4, board.marks, 1, 0, column([0], 0), column([mark], 4)))
    board.reached()
    assert page.evaluate(state_of) == f"live, lockstep; {text}"


def test_two_pages_at_once(new_page: Open, board: Board) -> None:
    page = new_page()
    other = Board(page)
    page.goto(ADDRESS)
    page.wait_for_function("document.title.startsWith('bench')")
    for _ in range(4):
        board.play()
        other.play()
    board.reached()
    other.reached()
    assert state(page)["now"] == state(board.page)["now"] < SECOND
