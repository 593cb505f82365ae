"""Faults of wires and of parts of glue: shorted, slow."""

import io
import re

import pytest

from tests.unit.glue.test_cards import LATCH, WIRED, Slot
from tests.unit.glue.test_cycles import DECODED
from tests.unit.views.conftest import read
from tests.unit.views.test_replay import played
from vbus.board.build import load_board_text
from vbus.board.snapshot import fork, restore, take
from vbus.core.errors import ConfigError
from vbus.core.kernel import MS, NS, US
from vbus.record.journal import Journal


def running() -> Slot:
    slot = Slot(WIRED)
    slot.outb(LATCH, 0x01)
    slot.port.delay(4 * MS)
    return slot


def test_a_wire_that_is_shorted_selects_nobody_until_it_is_mended() -> None:
    slot = running()
    assert slot.inb(0x302) == 0x84
    fault = slot.board.faults.arm("net_stuck", "y./CS", level=1)
    assert (slot.inb(0x302), slot.inb(0x300)) == (0xFF, 0x84)
    twin = fork(slot.board)
    assert twin.find_pin("y./CS").net.value == 1
    slot.board.faults.clear(fault)
    assert slot.inb(0x302) == 0x84
    twin.faults.clear()
    assert twin.find_pin("y./CS").net.bends == ()
    found = [(one.what, one.text) for one in slot.board.faults.log]
    assert found == [("begun", "y./CS is high, whatever drives it"), ("ended", "cleared")]


def test_a_wire_is_named_by_its_own_name_or_a_pin_on_it_and_shorted_low_holds_reset() -> None:
    slot = running()
    for name in ("RST", "u2.Q0", "x./RST"):
        fault = slot.board.faults.arm("net_stuck", name, level=0)
        assert slot.board.find_pin("y./RST").net.value == 0
        slot.board.faults.clear(fault)
        assert slot.board.find_pin("y./RST").net.value == 1


def test_a_slow_decoder_selects_later_and_then_is_as_fast_as_it_was() -> None:
    board = load_board_text(DECODED)
    port = board.open_port("host")
    enable, select = port.pin_number("u1.1/G"), board.find_pin("x./CS").net

    def after(level: int) -> list[int]:
        port.pin(enable, level)
        found = []
        for ahead in (15 * NS - 1, 1, 40 * NS - 1, 1):
            board.run_for(ahead)
            found.append(select.value)
        return found

    port.pin(port.pin_number("u1.1A"), 0)
    port.pin(enable, 1)
    board.run_for(US)
    assert after(0) == [1, 0, 0, 0]
    fault = board.faults.arm("part_slow", "u1", by=40_000)
    assert after(1) == [0, 0, 0, 1]
    board.faults.clear(fault)
    assert after(0) == [1, 0, 0, 0]


def test_a_slow_part_without_a_delay_of_its_own_is_judged_behind_it_in_a_journal_too() -> None:
    """WR comes to the chips late, and the select has gone: T7 is broken; the replay agrees."""
    file = io.BytesIO()
    board = load_board_text(WIRED)
    journal = Journal(board, file, WIRED, "board.toml")
    port = board.open_port("host", ["x", "y", "slot"])
    port.select(4)
    port.write(12, 1)
    port.delay(4 * MS)
    port.read(0)
    port.delay(US)
    board.faults.arm("part_slow", "match", by=200_000, until="for 1 ms")
    port.read(2)
    twin = fork(board)
    states = [block.queue for part in board.glue.parts for block in part.blocks]
    assert [block.queue for part in twin.glue.parts for block in part.blocks] == states
    port.delay(2 * MS)
    port.read(0)
    port.close()
    journal.close()
    rules = {violation.rule for violation in board.violations}
    assert "lm628.T7" in rules
    _, entries = read(file.getvalue())
    assert [entry.op for entry in entries if entry.op in ("arm", "fault")] == [
        "arm",
        "fault",
        "fault",
    ]
    assert played(file.getvalue()).divergence is None


@pytest.mark.spec("LM-TIM-16")
@pytest.mark.parametrize(("name", "given"), [("byte_flipped", {"mask": 8}), ("bit_stuck", {})])
def test_a_byte_that_is_another_one_has_its_hold_time(name: str, given: dict[str, int]) -> None:
    """A level that went with the strobe would be a breach of a host that breaks no rule."""
    slot = running()
    slot.ready(0x300)
    fault = slot.board.faults.arm(name, "x", **given)
    slot.outb(0x300, 0x1E)  # LFIL becomes 16H, which is no command, or LTRJ
    slot.port.delay(100 * US)
    assert (fault.state, fault.fired) == ("over", 1)
    assert not [one for one in slot.board.violations if re.match(r"lm628\.T\d", one.rule)]


def test_what_a_fault_has_slowed_is_on_its_way_in_a_restored_board_too() -> None:
    """A part without a delay of its own has no timer until a fault makes it slow."""
    board = load_board_text(DECODED.replace('delay = "15 ns"\n', ""))
    port = board.open_port("host")
    for name in ("u1.1A", "u1.1/G"):
        port.pin(port.pin_number(name), 0)
    fault = board.faults.arm("part_slow", "u1", by=40_000)
    port.pin(port.pin_number("u1.1/G"), 1)
    board.run_for(10 * NS)
    board.faults.clear(fault)
    kept, twin = take(board), fork(board)
    seen = []
    for one in (board, twin, board):
        if len(seen) == 2:
            restore(one, kept)
        select, now, levels = one.find_pin("x./CS").net, one.now, []
        for ahead in (30 * NS - 1, 30 * NS):
            one.run_until(now + ahead)
            levels.append(select.value)
        seen.append(levels)
    assert seen == [[0, 1]] * 3


@pytest.mark.parametrize(
    ("name", "target", "message"),
    [
        ("net_stuck", "", "net_stuck: say on which wire; the wires with names are main./PS,"),
        ("net_stuck", "NONE", "net_stuck: no chip called 'NONE'"),
        ("net_stuck", "x./XS", "LM629N-8 has no pin '/XS'"),
        ("net_stuck", "slot.D0-D7", "slot.D0-D7 is a bundle; bit_stuck breaks one of its wires"),
        (
            "part_slow",
            "u9",
            'there is no part of glue "u9"; there are match, u1',
        ),
        ("part_slow", "", "say on which part of glue; there are match, u1, u2, u3, irq"),
    ],
)
def test_a_target_that_is_none_is_refused(name: str, target: str, message: str) -> None:
    with pytest.raises(ValueError, match=re.escape(message)):
        Slot(WIRED).board.faults.arm(name, target)


def test_a_board_file_may_break_its_wires_and_parts() -> None:
    broken = WIRED + '\n[[faults]]\nfault = "net_stuck"\ntarget = "IRQ5"\nlevel = 0\n'
    board = load_board_text(broken)
    assert board.find_pin("irq.1Y").net.value == 0
    with pytest.raises(ConfigError, match='there is no part of glue "u7"'):
        load_board_text(WIRED + '\n[[faults]]\nfault = "part_slow"\ntarget = "u7"\n')
