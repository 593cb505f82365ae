"""Wires whose levels are found out late, and what a saved state keeps of them."""

from itertools import pairwise

import pytest

from vbus.board import snapshot
from vbus.board.board import Board
from vbus.board.build import load_board_text
from vbus.circuit.circuit import STRETCH
from vbus.core.kernel import END, MS, NS, US
from vbus.core.signals import EdgeTaker

TWO = """
[board]
name = "two"
time = "lockstep"
power_on = "done"
[chips.x]
part = "LM629N-8"
clock = "8 MHz"
plant = "m"
[chips.y]
part = "MCP-1200"
clock = "20 MHz"
plant = "n"
[plants.m]
model = "ideal"
[plants.n]
model = "ideal"
[nets]
wire = ["x.HI", "y./STOP"]
"""


def test_a_wire_joins_at_least_one_pin_and_pins_of_one_width_only() -> None:
    board = load_board_text(TWO)
    with pytest.raises(ValueError, match=r"^net 'none' joins no pins$"):
        board.join("none", [])
    with pytest.raises(ValueError, match=r"^net 'odd' joins pins of different widths$"):
        board.join("odd", ["x.HI", "y.DB0-DB7"])


@pytest.mark.core("interpreted")
def test_time_beyond_its_end_is_refused_before_any_passes() -> None:
    board = load_board_text(TWO)
    passed: list[int] = []

    def look() -> None:
        passed.append(board.now)
        raise TimeoutError

    board.kernel.timer(look).at(1000 * MS)
    with pytest.raises(ValueError, match=r"^time ends at 9151314442816847872 ps"):
        board.run_until(END + 1)
    assert not passed


@pytest.mark.core("interpreted")
def test_a_chip_that_nobody_listens_to_comes_along_every_few_seconds(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    board = load_board_text(TWO)
    chip = board.chip("x")
    advance = chip.advance
    seen: list[int] = [0]

    def note() -> None:
        seen.append(board.now)
        advance()

    monkeypatch.setattr(chip, "resting", lambda: False)
    monkeypatch.setattr(chip, "advance", note)
    board.run_until(3 * STRETCH)
    assert max(b - a for a, b in pairwise([*seen, board.now])) <= STRETCH


def test_a_board_that_has_just_started_and_takes_a_state_loses_no_wire() -> None:
    board = load_board_text(TWO)
    board.open_port("host")
    board.run_until(MS)
    kept = snapshot.take(board)
    fresh = load_board_text(TWO)
    fresh.open_port("host")
    snapshot.restore(fresh, kept)
    shown = []
    for each in (board, fresh):
        each.find_pin("x.HI").drive(0)
        each.kernel.settle()
        shown.append(each.chip("y").telemetry()["status"])
    assert shown[0] == shown[1]


def drives_an_output(looks: int) -> list[tuple[int, str]]:
    """A host holds IDLE low while it sends the chip into control and back to idle."""
    board = load_board_text(TWO)
    port = board.open_port("host", ["y"])
    for register, value in ((1, 8), (0x26, 0x10), (0x3C, 2), (5, 3), (0, 0x0D)):
        port.write(register, value)
    board.run_for(5 * MS)
    port.pin(port.pin_number("y.IDLE"), 0)
    port.write(5, 1)
    start = board.now
    for look in range(looks):
        board.run_until(start + (look + 1) * 50 * MS // looks)
        board.catch_up()
    return [(found.when, found.detail) for found in board.violations]


def test_a_clash_with_an_output_has_its_instant_however_often_somebody_looks() -> None:
    seldom = drives_an_output(1)
    assert any("IDLE" in detail for _, detail in seldom)
    assert seldom == drives_an_output(500)


def halfway(board: Board) -> None:
    """A write cycle that is played as strobes, and 5 ns of the time its data are held."""
    port = board.open_port("host", ["x"])
    board.faults.arm("bit_stuck", "x", when="at 0 ps", until="cleared", bit=7, level=0)
    port.write(0, 0x1E)
    board.run_for(5 * NS)


def test_a_state_taken_while_data_are_held_lets_go_at_its_instant() -> None:
    board, unseen = load_board_text(TWO), load_board_text(TWO)
    for each in (board, unseen):
        halfway(each)
    twin = snapshot.fork(board)
    for each in (board, unseen, twin):
        each.run_for(10**6)
    released = {each.chip("x").bus_net.let_go_at for each in (board, unseen, twin)}
    assert len(released) == 1
    assert released.pop() > board.now - 10**6
    assert twin.state_hash() == board.state_hash() == unseen.state_hash()


def test_a_clash_that_stands_when_a_state_is_loaded_is_found_and_told_to_nobody() -> None:
    board, twin = load_board_text(TWO), load_board_text(TWO)
    fighting, resting = board.open_port("h", ["x"]), twin.open_port("h", ["x"])
    fighting.pin(fighting.pin_number("x.HI"), 1 - board.find_pin("x.HI").level)
    net = twin.find_pin("x.HI").net
    assert board.find_pin("x.HI").net.clashing

    twin.load(board.save())
    assert net.clashing
    assert [found.rule for found in twin.violations] == []

    resting.let_go()
    assert not net.clashing


def changes(board: Board) -> list[tuple[int, int]]:
    """Return the list to which each change of D0-D7 is added from now on, with its instant.

    A bus that is observed has whole cycles as strobes, and is given back to the hand after them.
    """
    seen: list[tuple[int, int]] = []
    taker = EdgeTaker(lambda when, _, level: seen.append((when, level)))
    board.chip("x").data_pin.net.observe(taker)
    return seen


@pytest.mark.parametrize("looks", [0, 3])
def test_a_read_held_by_hand_shows_changes_at_their_instants_after_whole_cycles(looks: int) -> None:
    """The status byte is live (LM-BUS-3), with /RD held low by hand before a cycle and after it."""
    board = load_board_text(TWO)
    host = board.open_port("host", ["x"])
    seen = changes(board)
    board.run_for(MS)
    host.lines(0b0111, 0b0000)  # /CS, /PS and /RD
    host.write(0, 0x1E)
    busy = host.read(0)
    host.lines(0b0111, 0b0000)
    from_now = board.now
    for _ in range(looks):
        board.run_for(MS)
        board.catch_up()
    board.run_for((3 - looks) * MS)
    assert busy & 1
    ends = [when for when, level in seen if when > from_now and not level & 1]
    assert ends[0] - from_now < 100 * US
    assert seen[-1] == (ends[0], busy & ~1)


@pytest.mark.parametrize("strobes", [0b0100, 0b1100], ids=["/RD", "/RD and /WR"])
@pytest.mark.parametrize("looks", [0, 3])
def test_a_data_read_held_by_hand_shows_one_byte_after_whole_cycles(
    strobes: int, looks: int
) -> None:
    """A data byte stands while /RD is low (LM-BUS-3); both strobes at once give FFh (LM-BUS-4)."""
    board = load_board_text(TWO)
    host = board.open_port("host", ["x"])
    seen = changes(board)
    board.run_for(MS)
    host.lines(0b0001 | strobes, 0b0000)  # /CS and strobes, of the data port
    host.write(0, 0x0B)  # RDRP: a reply whose first byte is 00H
    board.run_for(MS)
    host.read(1)
    host.lines(0b0001 | strobes, 0b0000)
    from_now = board.now
    for _ in range(looks):
        board.run_for(MS)
        board.catch_up()
    board.run_for((3 - looks) * MS)
    shown = 0xFF if strobes == 0b1100 else 0x00
    assert board.chip("x").bus_net.value == shown
    host.lines(strobes, strobes)
    assert {level for when, level in seen if when > from_now} <= {shown}


def test_each_axis_of_a_chip_set_is_found_by_its_number() -> None:
    board = load_board_text(
        '[board]\nname = "b"\n[chips.x]\npart = "MC1241A"\nclock = "25 MHz"\n'
        'plants = ["a", "b"]\n[plants.a]\nmodel = "ideal"\n[plants.b]\nmodel = "ideal"\n'
    )
    assert [*board.axes] == ["x.1", "x.2"]
    assert [*board.axes.values()] == board.plants


@pytest.mark.parametrize("looks", [False, True])
def test_what_a_chip_set_finds_by_itself_comes_before_what_its_host_does_later(looks: bool) -> None:
    """A journal has findings in one order, whoever has looked at the board."""
    board = load_board_text(
        '[board]\nname = "b"\ntime = "lockstep"\npower_on = "done"\n[chips.x]\npart = "MC1241A"\n'
        'clock = "25 MHz"\nplants = ["none", "none"]\n'
    )
    host = board.open_port("host", ["x"])
    select, write, command = (
        1 << host.line_number(name) for name in ("~HostSlct", "~HostWrite", "HostCmd")
    )
    host.lines(select | command, command)
    host.drive(0xA1)  # no command
    for level in (0, write):
        host.delay(US)
        host.lines(write, level)
    board.kernel.run_until(board.now + MS)
    if looks:
        board.catch_up()
    board.kernel.run_until(board.now + MS)
    host.let_go()
    found = [violation.rule for violation in board.violations]
    assert found == ["mc1241a.illegal-command", "mc1241a.T6"]
