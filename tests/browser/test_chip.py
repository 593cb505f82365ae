"""The chip's view: registers, bits and commands at an instant, clauses, and what a packet did."""

from functools import cache
from typing import Any

import pytest

from tests.browser.conftest import ADDRESS, Open, keeps_out
from tests.browser.recordings import COMMAND, MS, STATUS, Recording, column, frame, samples
from tests.browser.test_live import Board
from tests.browser.test_page import colour, drawn, place, track, x_of

FIELDS = [[7, "MOTOR_OFF", "Motor Off"], [2, "DONE", "Trajectory Complete"], [0, "BUSY", "Busy"]]
CLAUSE = {
    "name": "LM-STA-1", "title": "Status byte", "kind": "manual", "section": "Table 7",
    "text": "Bits of the\nstatus byte.\n\n1. One,\n   and more.\n2. Two.\n\n| a | b |",
    "named_by": ["lm628: RDSTAT: Read Status"],
}  # fmt: skip
LFIL = {"name": "LFIL", "code": 0x1E, "title": "Load Filter", "clause": "LM-CMD-19"}


@cache
def looked_into() -> str:
    recording = Recording(end=100 * MS)
    recording.axis("x")
    real = recording.lane("x", "real", "number", "real position", unit="counts")
    recording.frames.append(samples(real, [0, 30 * MS], [0, 4]))
    bus = recording.lane(None, "x bus", "packets", "x: packets")
    recording.register("x", "status byte", [(0, 0x80), (20 * MS, 0x81), (21 * MS, 0x04)],
                       digits=2, fields=FIELDS, clause="LM-STA-1")  # fmt: skip
    recording.register("x", "kp", [(0, 0), (39 * MS + MS // 2, 300)], group="filter", unit="cnt")
    recording.register("x", "velocity", [(0, 0), (10 * MS, 0xFFFE8000)], fraction=16, signed=32)
    recording.register("x", "mode", [(0, 3), (5 * MS, 1)], words=["off", "time"])
    recording.register("x", "sum", [(0, 0), (90 * MS, 7)], moves=True)
    recording.chips[0]["registers"].append({
        **recording.chips[0]["registers"][1], "lane": real, "name": "real position",
        "unit": "counts",
    })  # fmt: skip
    recording.chips[0]["commands"] = [LFIL, {**LFIL, "name": "UDF", "code": 4}]
    recording.tables([[recording.chips[0]["registers"][3]["lane"], 3, "03H control"]], [CLAUSE])
    texts = ["LFIL kp=300  [LM-CMD-19]", "RDSTAT 81H BUSY"]
    cycles = ["w0 1E w1 01 w1 2C", "r0 81"]
    recording.frames.append(frame(3, 0xFFFF, 2, 0, column(texts, 4), column(cycles, 4)))
    recording.frames.append(
        frame(
            2, bus, 2, 20 * MS, column([0, 5 * MS], 2), column([19 * MS, 0], 2), column([0, 1], 2),
            column([COMMAND, STATUS], 3), column([[10 * MS], 0], 4),
        )
    )  # fmt: skip
    return recording.page()


def rows(page: Any) -> dict[str, list[str]]:
    """The rows of the table: by name, value and since when."""
    drawn(page)
    page.wait_for_function("document.querySelectorAll('#chip-table .body .row').length > 5")
    found = page.evaluate(
        "[...document.querySelectorAll('#chip-table .body .row')].map((row) =>"
        " [...row.children].map((cell) => cell.textContent).concat(row.dataset.kind))"
    )
    return {name.strip(): others for name, *others in found}


@pytest.fixture
def chip(open_recording: Open) -> Any:
    page = open_recording(looked_into())
    page.keyboard.press("6")
    return page


def test_registers_have_the_values_of_the_instant_that_is_looked_at(chip: Any) -> None:
    place(chip, "a", 60 * MS)
    found = rows(chip)
    assert found["status byte"] == ["04H", "0.0210000", ""]
    assert found["MOTOR_OFF"][0] == "○ 0  Motor Off"
    assert found["DONE"][0] == "● 1  Trajectory Complete"
    assert found["velocity"][0] == "\u22121.5"
    assert found["mode"][0] == "time"
    assert found["real position"][0] == "4 counts"
    assert found["▸ kp"] == ["300 cnt", "0.0395000", "changed"], "the sum moves by itself"
    assert found["filter"] == ["", "", "group"]
    chip.mouse.move(0, 0)
    place(chip, "a", 3 * MS)
    found = rows(chip)
    assert found["mode"] == ["03H control", "", ""]
    assert found["status byte"] == ["80H", "", ""]
    assert found["kp"][0] == "0 cnt"


def test_bits_that_changed_last_are_told_apart(chip: Any) -> None:
    place(chip, "a", 30 * MS)
    found = rows(chip)
    assert {name for name, row in found.items() if row[2] == "changed"} == {
        "▸ status byte", "▸   MOTOR_OFF", "▸   DONE", "▸   BUSY",
    }  # fmt: skip


def test_commands_have_their_last_packet(chip: Any) -> None:
    place(chip, "a", 60 * MS)
    assert rows(chip)["LFIL 1EH"] == ["kp=300", "0.0200000", ""]
    assert rows(chip)["UDF 04H"] == ["–", "", ""]


def test_a_row_is_a_key_away_from_its_clause(chip: Any) -> None:
    chip.locator("#chip-table [role=grid]").focus()
    for _ in range(3):
        chip.keyboard.press("ArrowDown")
    told = chip.locator("#chip-detail").inner_text().splitlines()
    assert "Bit 7, MOTOR_OFF: Motor Off" in told
    assert "LM-STA-1: Status byte" in told
    assert "Bits of the status byte." in told
    assert "1. One, and more." in told
    assert "| a | b |" in told
    assert told[-1] == "lm628: RDSTAT: Read Status"
    assert "0.021 s: 81H → 04H" in told


def test_rows_are_searched(chip: Any) -> None:
    chip.fill("#chip-search", "motor")
    drawn(chip)
    names = chip.locator("#chip-table .body .row span:first-child").all_inner_texts()
    assert [name.strip("▸ ") for name in names] == ["status", "status byte", "MOTOR_OFF"]


STEPS = [
    "0 ps: write 1EH, address 0H (command)",
    "at once, status byte: ● BUSY",
    "after 1 ms, status byte: ○ MOTOR_OFF, ● DONE, ○ BUSY",
    "10 ms: write 01H, address 01H",
    "19 ms: write 2CH, address 01H",
    "after 500 µs, kp: 0 cnt → 300 cnt",
]


def test_a_packet_is_told_step_by_step(open_recording: Open) -> None:
    page = open_recording(looked_into())
    box = page.locator("#over").bounding_box()
    row = track(page, "x bus")
    at = box["x"] + x_of(page, 22 * MS), box["y"] + row["top"] + row["height"] / 2
    page.mouse.click(*at)
    flat = page.evaluate(
        "[...document.querySelectorAll('#packets-detail li')].map((li) =>"
        " li.firstChild.textContent)"
    )
    assert flat == STEPS
    page.keyboard.press("6")
    page.mouse.click(*at)
    assert page.locator("#chip").is_visible()
    assert page.locator("#chip-detail").inner_text().startswith("LFIL kp=300")


def test_registers_of_a_running_board_are_asked_for_while_they_are_seen(new_page: Open) -> None:
    page = new_page()
    board = Board(page)
    page.goto(ADDRESS)
    page.wait_for_function("document.title.startsWith('bench')")

    def heard(*orders: bool) -> None:
        board.play()
        board.reached()
        page.evaluate("new Promise((go) => setTimeout(go))")
        assert board.heard == [{"do": "registers", "on": on} for on in orders]

    heard()
    page.keyboard.press("6")
    heard(True)
    page.keyboard.press("p")
    drawn(page)
    heard(True, False)
    page.keyboard.press("p")
    drawn(page)
    heard(True, False, True)
    board.sockets[-1].close()
    page.wait_for_function("document.getElementById('state').classList.contains('lost')")
    page.wait_for_function("!document.getElementById('state').classList.contains('lost')")
    board.count = 0
    heard(True, False, True, True)
    page.keyboard.press("1")
    heard(True, False, True, True, False)


def test_the_chip_keeps_nobody_out(open_recording: Open) -> None:
    page = open_recording(looked_into(), color_scheme="light")
    page.keyboard.press("6")
    page.locator("#chip-table .body .row").nth(2).click()
    drawn(page)
    assert keeps_out(page) == []
    page.emulate_media(color_scheme="dark")
    drawn(page)
    assert max(colour(page, "surface")) < 64
    assert keeps_out(page, "color-contrast") == []
