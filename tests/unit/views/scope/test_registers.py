"""What the scope records of the registers of a chip, and what it tells of them."""

import math
from itertools import pairwise
from pathlib import Path
from typing import Any

import pytest

from docs.examples.down_counter.dc8.family import FAMILY as DC8
from tests.unit.views.conftest import LM629, lm629_command, lm629_move
from tests.unit.views.scope.decoded import Seen, frames
from tests.unit.views.scope.test_recording import SAMPLE, run, seen
from vbus import plugins
from vbus.board.build import load_board_text
from vbus.board.host_bus import HostBus
from vbus.cli.look.explain_clauses import explained
from vbus.core.kernel import MS, US
from vbus.views.clauses import clause_frame
from vbus.views.scope.frames import numbers
from vbus.views.scope.recording import Recorder
from vbus.views.scope.registers import EVERY

BUSY = 15 * US

OTHERS = """
[board]
name = "others"
time = "lockstep"
power_on = "done"

[chips.m]
part = "MCP-1200"
clock = "8 MHz"
plant = "none"

[chips.p]
part = "MC1241A"
clock = "25 MHz"
plants = ["none", "none"]
"""


def recorded(text: str, host: Any) -> Seen:
    board = load_board_text(text)
    recorder = Recorder(board, edges=True)
    recorder.start()
    host(board.open_port("h"))
    recorder.stop()
    return seen(recorder)


@pytest.fixture(scope="module")
def move() -> Seen:
    return recorded(LM629, lm629_move)


def packet(found: Seen, name: str) -> tuple[int, int, str]:
    """When a packet began and ended, and its cycles."""
    return next(
        (at, at + span, found.cycles[label])
        for at, span, label, _, _ in found.rows["x bus"]
        if found.labels[label].startswith(name)
    )


@pytest.mark.spec("LM-PID-1", "LM-CMD-5")
def test_a_register_changes_when_the_chip_is_ready_and_its_copy_with_the_sample(move: Seen) -> None:
    begin, end, cycles = packet(move, "LFIL")
    assert cycles == "w0 1E w1 00 w1 0A w1 01 w1 2C w1 07 w1 D0"
    loaded = move.held("x", "kp loaded")
    assert loaded[0] == (0, 0)
    assert [value for _, value in loaded] == [0, 0x012C]
    assert begin < loaded[1][0] < end
    assert move.held("x", "kd loaded") == [(0, 0), (end + BUSY, 0x07D0)]
    assert move.held("x", "kp") == [(0, 0), (SAMPLE, 0x012C)]


def test_the_cycles_inside_a_packet_have_their_instants(move: Seen) -> None:
    ((at, span, _, _, inner),) = [
        row for row in move.rows["x bus"] if move.labels[row[2]].startswith("LFIL")
    ]
    words = [
        when for when, value in move.rows[move.names[move.register("x", "status byte")["lane"]]]
        if value & 1 and at < when <= at + span
    ]  # fmt: skip
    assert len(inner) == 5
    assert [at + offset for offset in inner] == sorted({at + offset for offset in inner})
    assert set(words) >= {at + inner[1], at + inner[3]}, "busy rises with the last byte of a word"


def whole_move(port: HostBus) -> None:
    """A move with its flags taken back before, and nobody on the bus while it goes on."""
    lm629_command(port, 0x1E, 0x000A, 300, 2000)
    lm629_command(port, 0x04)
    lm629_command(port, 0x1D, 0x0000)
    lm629_command(port, 0x1F, 0x002A, 0, 4000, 4, 0, 0, 200)
    lm629_command(port, 0x01)
    port.delay(200 * MS)


@pytest.fixture(scope="module")
def quiet() -> Seen:
    return recorded(LM629, whole_move)


@pytest.mark.spec("LM-STA-1", "LM-STA-4")
def test_flags_have_the_instant_of_their_sample(quiet: Seen) -> None:
    status = quiet.held("x", "status byte")
    (complete,) = [when for (_, old), (when, new) in pairwise(status) if new & ~old & 0x04]
    assert complete % SAMPLE == 0
    velocity = dict(quiet.rows["x.profile"])
    assert velocity[complete] == 0
    row = quiet.register("x", "status byte")
    assert [7, "MOTOR_OFF", "Motor Off"] in row["fields"]
    assert row["clause"] == "LM-STA-1"


@pytest.mark.spec("LM-CMD-19", "LM-PID-1")
def test_each_filter_parameter_is_shown_as_lfil_loaded_it() -> None:
    def host(port: HostBus) -> None:
        lm629_command(port, 0x1E, 0x050F, 0x11, 0x22, 0x33, 0x44)
        port.delay(MS)
        port.read(0)

    found = recorded(LM629, host)
    loaded = {name: found.held("x", f"{name} loaded")[-1][1] for name in ("kp", "ki", "kd", "il")}
    assert loaded == {"kp": 0x11, "ki": 0x22, "kd": 0x33, "il": 0x44}
    assert found.held("x", "ds loaded")[-1][1] == 5


@pytest.mark.spec("LM-TRJ-1", "LM-TRJ-3")
def test_rates_have_sixteen_bits_of_fraction_and_the_control_word_its_five_bits(move: Seen) -> None:
    for name in ("velocity", "velocity loaded", "acceleration", "acceleration loaded"):
        assert move.register("x", name)["fraction"] == 16, name
    fields = move.register("x", "trajectory control word")["fields"]
    assert sorted(number for number, *_ in fields) == [8, 9, 10, 11, 12]


@pytest.mark.spec("PMD-STA-1", "PMD-CMD-70", "PMD-CMD-8")
def test_words_have_four_digits_and_positions_no_fraction() -> None:
    found = recorded(OTHERS, lambda port: port.delay(MS))
    assert found.register("p", "status word 1")["digits"] == 4
    assert found.register("p", "limit sense")["digits"] == 4
    for name in ("position 1", "position buffered 1", "velocity buffered 2"):
        row = found.register("p", name)
        assert row["fraction"] == (16 if "velocity" in name else 0), name


def test_what_a_lane_has_already_is_not_recorded_twice(move: Seen) -> None:
    assert move.names[move.register("x", "real position")["lane"]] == "x.real"
    assert move.names[move.register("x", "desired velocity")["lane"]] == "x.profile"


def test_what_moves_by_itself_is_looked_at_now_and_then(quiet: Seen) -> None:
    assert quiet.register("x", "motor command")["moves"]
    moved = [when for when, _ in quiet.held("x", "motor command") if when > 2 * MS]
    assert len(moved) == 4
    assert min(b - a for a, b in pairwise(moved)) >= EVERY


def test_registers_with_addresses_are_read_without_a_bus_cycle() -> None:
    def host(port: HostBus) -> None:
        port.select(1)
        port.write(0x22, 0x55)
        port.delay(US)
        port.write(0x05, 0x03)
        port.delay(MS)

    found = recorded(OTHERS, host)
    ((_, before), (when, after)) = found.held("m", "LEAD_GAIN")
    assert (before, after) == (0x40, 0x55)
    assert when == found.rows["m bus"][0][0] + 4 * 125_000, "visible four clocks later"
    row = found.register("m", "LEAD_GAIN")
    assert (row["addresses"], row["clause"], row["reset"]) == ([0x22], "MCP-REG-23", 0x40)
    assert found.names[found.register("m", "ACTUAL_POSITION")["lane"]] == "m.real"
    assert found.words[found.register("m", "MODE")["lane"], 3] == "03H control"
    assert found.register("m", "STATUS")["fields"][0] == [0, "BUSY", "BUSY pin state"]


def test_each_axis_of_a_chip_set_has_registers_of_its_own() -> None:
    def host(port: HostBus) -> None:
        port.select(2)
        for byte in (0x02,):  # SET_2
            port.write(1, byte)
        port.delay(MS)
        port.write(1, 0x11)  # SET_VEL 2.5 usteps a cycle
        port.delay(MS)
        for byte in (0x00, 0x02, 0x80, 0x00):
            port.write(0, byte)
            port.delay(MS)

    found = recorded(OTHERS, host)
    assert [value for _, value in found.held("p", "velocity buffered 1")] == [0]
    assert [value for _, value in found.held("p", "velocity buffered 2")] == [0, 0x28000]
    assert [value for _, value in found.held("p", "current axis")] == [0, 1]
    row = found.register("p", "velocity buffered 2")
    assert (row["group"], row["fraction"], row["unit"]) == ("axis 2: profile", 16, "ustep/cycle")
    assert found.register("p", "breakpoint mode 1")["words"][6] == "motion complete"
    status = [value for _, value in found.held("p", "status word 2")]
    assert status[0] & 0x1000


def test_the_registers_of_a_plug_in_are_there_too(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.syspath_prepend(Path(__file__).parents[4] / "docs" / "examples" / "down_counter")
    chip = DC8.object("chip")

    def host(port: HostBus) -> None:
        port.write(0, 5)
        port.delay(40 * US)

    monkeypatch.setattr(plugins, "family", lambda name: DC8)
    monkeypatch.setattr(plugins, "chip_class", lambda part: chip)
    text = '[board]\nname = "d"\ntime = "lockstep"\n[chips.d]\npart = "DC-8"\nclock = "1 MHz"\n'
    found = recorded(text, host)
    assert found.held("d", "LOAD")[-1][1] == 5
    assert found.register("d", "COUNT")["clause"] == "DC-REG-2"


def test_nothing_is_looked_at_before_somebody_asks() -> None:
    board = load_board_text(LM629)
    recorder = Recorder(board, edges=False)
    recorder.start()
    port = board.open_port("h")
    lm629_move(port)
    frames = recorder.take(numbers)
    found = Seen(recorder.lanes.described(True), b"".join(frames))
    assert found.held("x", "kp") == []
    recorder.look_inside(True)
    asked = board.now
    found = Seen(found.description, frames[0] + b"".join(recorder.take(numbers)))
    assert found.held("x", "kp") == [(asked, 300)]
    port.delay(MS)
    recorder.look_inside(False)
    found = Seen(found.description, frames[0] + b"".join(recorder.take(numbers)))
    ((when, value),) = found.held("x", "kp")
    assert when == asked + MS
    assert math.isnan(value)
    port.delay(50 * MS)
    found = Seen(found.description, frames[0] + b"".join(recorder.take(numbers)))
    assert found.held("x", "motor command") == []
    recorder.look_inside(True)
    found = Seen(found.description, frames[0] + b"".join(recorder.take(numbers)))
    assert found.held("x", "kp") == [(board.now, 300)]


def test_runs_looked_into_are_equal_to_the_last_byte(monkeypatch: pytest.MonkeyPatch) -> None:
    alone = run(False)
    start = Recorder.start

    def inside(recorder: Recorder) -> None:
        start(recorder)
        recorder.look_inside(True)

    monkeypatch.setattr(Recorder, "start", inside)
    watched = run(True)
    assert alone[:3] == watched[:3]
    assert list(alone[3].violations) == list(watched[3].violations)


def test_clauses_are_told_as_explain_tells_them() -> None:
    (told,) = frames(clause_frame(["lm628", "lm628"]))
    assert (told.kind, told.lane) == (8, 0xFFFF)
    rows = {row["name"]: row for row in told.columns[0]}
    row = rows["LM-STA-1"]
    lines = explained("LM-STA-1")
    assert lines[0] == f"LM-STA-1: {row['title']}"
    assert lines[1] == f"  {row['kind']}: {row['section']}"
    assert set(row["named_by"]) < set(lines)
    words = " ".join(lines[3 : lines.index(row["named_by"][0]) - 1]).split()
    assert words == row["text"].split()
    assert "lm628: status byte: what RDSTAT reads" in row["named_by"]
