"""The table of docs/conditions.md: when each form is evaluated, by those who read it."""

import io
import re
from pathlib import Path

import pytest

from tests.unit.views.conftest import LM629, read, record
from vbus.board.board import Board
from vbus.board.build import load_board_text
from vbus.board.host_bus import HostBus
from vbus.core.kernel import MS, US
from vbus.events.watch import ConditionTracker, Watch
from vbus.record.history import History
from vbus.views.wave.wave import Wave

PAGE = (Path(__file__).parents[3] / "docs/conditions.md").read_text()
TABLE = re.search(r"^\| form \| `wait_until`.*?\n\n", PAGE, re.MULTILINE | re.DOTALL)
assert TABLE is not None
FORMS = re.findall(r"^\| `([^`]+)` \|", TABLE[0], re.MULTILINE)


def host(port: HostBus) -> None:
    """An edge of A at 1 ms; RSTI from 4.001 to 5.003 ms; DFH while busy at 5.004 ms."""
    port.delay(MS)
    port.pin(port.pin_number("A"), 1)
    port.delay(3 * MS)
    port.write(0, 0x1D)
    port.delay(MS)
    port.write(1, 0)
    port.write(1, 0)
    port.write(0, 0x02)
    port.delay(2 * MS)


COMMAND, PACKET, BUSY = 4_001 * US, 5_003 * US, 5_004 * US
RESET = 5_018 * US
"""RSTI has been carried out."""


@pytest.mark.parametrize(
    ("form", "until", "wave", "call", "fault"),
    [
        ("x.A == 1", MS, MS, ("pin", MS), MS),
        ("rising(x.A)", MS, MS, ("pin", MS), MS),
        ("not x.status.TRAJECTORY_COMPLETE", RESET, RESET, ("delay", 7_004 * US), RESET),
        ("x.A stable for 2 ms", 3 * MS, 3 * MS, ("delay", 4 * MS), None),
        ("command RSTI", PACKET, PACKET, ("write", PACKET), COMMAND),
        ("lm628.busy-write", BUSY, BUSY, ("write", BUSY), BUSY),
        ("violation", BUSY, BUSY, ("write", BUSY), BUSY),
        ("time >= 2 ms", 2 * MS, 2 * MS, ("delay", 4 * MS), 2 * MS),
    ],
)
def test_each_form_is_evaluated_when_the_table_says(
    form: str, until: int, wave: int, call: tuple[str, int], fault: int | None
) -> None:
    assert first_of_watch(form) == until
    assert first_of_wave(form) == wave
    assert first_call(form) == call
    if fault is None:
        with pytest.raises(ValueError, match="a fault waits for what is"):
            first_of_fault(form)
    else:
        assert first_of_fault(form) == fault


def test_the_table_has_these_forms() -> None:
    mark = test_each_form_is_evaluated_when_the_table_says.pytestmark[0]  # type: ignore[attr-defined]
    assert [row[0] for row in mark.args[1]] == FORMS


def played() -> tuple[Board, HostBus]:
    board = load_board_text(LM629)
    return board, board.open_port("h")


def first_of_watch(form: str) -> int:
    board, port = played()
    met: list[int] = []
    watch = Watch(form, board, met=lambda: met.append(board.now))
    watch.begin()
    host(port)
    watch.end()
    return met[0]


def first_of_wave(form: str) -> int:
    board, port = played()
    file = io.StringIO()
    wave = Wave(board, file, trigger=form, sample=MS)
    wave.start()
    host(port)
    wave.stop()
    found = re.search(r"^#(\d+)", file.getvalue(), re.MULTILINE)
    assert found is not None
    return int(found[1]) * 100


def first_call(form: str) -> tuple[str, int]:
    _, entries = read(record(LM629, host))
    history = History(lambda: load_board_text(LM629), entries)
    found = history.first(ConditionTracker(form, history.board))
    assert found is not None
    return found.op, found.after


def first_of_fault(when: str) -> int:
    board, port = played()
    board.faults.arm("power_on_c4", "x", when)
    host(port)
    return board.faults.log[0].when
