"""A wired interrupt line that cannot move costs no rounds; one that can moves as it always did."""

import random

import pytest

from tests.nodes.four_chips import Script
from vbus.board.config import read_board_text
from vbus.chips.lm628.axis import Axis
from vbus.kernel import US
from vbus.nodes.machine import Machine
from vbus.nodes.plan import pins_of
from vbus.nodes.scenario import read_scenario

BOARD = """\
[board]
time = "lockstep"
power_on = "done"

[nodes.a]
[nodes.b]

[chips.x]
part = "LM629N-8"
clock = "8 MHz"
plant = "x"
node = "a"

[chips.y]
part = "LM629N-6"
clock = "6 MHz"
plant = "y"
node = "b"

[plants.x]
model = "dc_motor"

[plants.y]
model = "dc_motor"

[nets]
"TO_Y" = { pins = ["x.HI", "y./IN"], delay = "100 us" }
"TO_X" = { pins = ["y.HI", "x./IN"], delay = "170 us" }
"""
SAMPLES = 130_000 / 256
"""Of a chip with 8 MHz in 130 ms."""


def moving(script: Script, chip: str, target: int) -> float:
    """Have an axis begin a move; return when that is written (us)."""
    at = script.lm(100, chip, 0x1E, 0x000F, 300, 10, 2000, 100)
    at = script.lm(at, chip, 0x04)
    at = script.lm(at, chip, 0x1D, 0)
    at = script.lm(at, chip, 0x1F, 0x00AA, 0, 400, 8, 0, target >> 16, target & 0xFFFF)
    return script.lm(at, chip, 0x01)


def run(script: Script) -> Machine:
    file, source = read_board_text(BOARD)
    text = "\n".join([*script.lines, "end 130ms"]) + "\n"
    machine = Machine(file, source, read_scenario(text, "s", pins_of(file), US))
    machine.run()
    return machine


def rounds(mask: int) -> int:
    """Return the rounds of a run with these interrupts enabled."""
    script = Script()
    for chip in "xy":
        script.lm(moving(script, chip, 200_000), chip, 0x1C, mask)
    return run(script).conductors[0].participant.round


def test_axes_that_move_with_no_interrupt_enabled_need_no_rounds() -> None:
    assert rounds(0) < SAMPLES / 5


def test_an_interrupt_that_may_come_is_waited_for_in_every_sample() -> None:
    assert rounds(0x20) > SAMPLES  # a position error, which does not come


def garbled(seed: int) -> Script:
    """Return two axes that move, with interrupts enabled and reset at all times."""
    draw = random.Random(seed)
    script = Script()
    for chip in "xy":
        at = moving(script, chip, draw.choice((40, 3000, 200_000)))
        script.lm(at, chip, 0x1B, draw.choice((5, 300)))  # LPEI
        while at < 90_000:
            at += draw.choice((20, 300, 5_000, 20_000))
            deed = draw.randrange(6)
            if deed == 0:
                at = script.lm(at, chip, 0x1C, draw.choice((0, 0x04, 0x02, 0x20, 0x40, 0x7E)))
            elif deed == 1:
                at = script.lm(at, chip, 0x1D, draw.choice((0, 0x7B, 0xFF)))
            elif deed == 2:
                at = script.lm(at, chip, 0x21, 0, draw.randrange(100))  # SBPR
            elif deed == 3:
                at = script.lm(at, chip, 0x01)
            elif deed == 4:
                script.line(at, f"{chip} r 0")
                at += 40
            else:
                at = script.lm(at, chip, 0x0A, read=2)
    return script


@pytest.mark.core("interpreted")
@pytest.mark.parametrize("seed", range(6))
def test_what_happens_is_the_same_as_if_every_sample_were_waited_for(
    seed: int, monkeypatch: pytest.MonkeyPatch
) -> None:
    found = run(garbled(seed))
    monkeypatch.setattr(Axis, "may_interrupt", lambda axis: True)
    every = run(garbled(seed))
    assert found.trace_hash() == every.trace_hash()
    assert found.conductors[0].participant.round <= every.conductors[0].participant.round
    assert sum(node.number for node in every.nodes) > 1, "no line has moved"
