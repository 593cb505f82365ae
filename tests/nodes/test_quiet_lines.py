"""A wired interrupt line that cannot move costs no rounds; one that can moves as it always did."""

import random

import pytest

from tests.nodes.four_chips import Script
from vbus.board.config import read_board_text
from vbus.chips.lm628.axis import ServoAxis
from vbus.chips.mcp1200.output import OutputPins
from vbus.core.kernel import US
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
    monkeypatch.setattr(ServoAxis, "may_interrupt", lambda axis: True)
    every = run(garbled(seed))
    assert found.trace_hash() == every.trace_hash()
    assert found.conductors[0].participant.round <= every.conductors[0].participant.round
    assert sum(node.number for node in every.nodes) > 1, "no line has moved"


MCP = """\
[board]
time = "lockstep"
power_on = "done"

[nodes.a]
[nodes.b]

[chips.x]
part = "MCP-1200"
clock = "2 MHz"
plant = "x"
node = "a"

[chips.y]
part = "MCP-1200"
clock = "1 MHz"
plant = "y"
node = "b"

[plants.x]
model = "ideal"

[plants.y]
model = "dc_motor"

[nets]
"TO_Y" = { pins = ["x.PROF", "y./STOP"], delay = "100 us" }
"TO_X" = { pins = ["y.TRIG", "x./STOP"], delay = "170 us" }
"IDLE" = { pins = ["y.IDLE", "x./LIMIT"], delay = "130 us" }
"""


def written(script: Script, at: float, chip: str, *pairs: tuple[int, int]) -> float:
    """Have a host write registers; return when that is done (us)."""
    for register, data in pairs:
        script.line(at, f"{chip} w {register:x} {data:x}")
        at += 40
    return at


def controlled(script: Script, chip: str) -> float:
    """Have an axis hold its position in control mode; return when that is written (us)."""
    return written(script, 100, chip, (0x05, 1), (0x0F, 0x40), (0x22, 0x20), (0x05, 3))


def machine_of(script: Script) -> Machine:
    file, source = read_board_text(MCP)
    text = "\n".join([*script.lines, "end 130ms"]) + "\n"
    return Machine(file, source, read_scenario(text, "s", pins_of(file), US))


def test_an_mcp1200_whose_wired_pins_cannot_move_needs_no_rounds() -> None:
    def rounds(*pairs: tuple[int, int]) -> int:
        script = Script()
        for chip in "xy":
            written(script, controlled(script, chip), chip, *pairs)
        file, source = read_board_text(MCP.replace('"IDLE"', '#"IDLE"'))
        text = "\n".join([*script.lines, "end 130ms"]) + "\n"
        machine = Machine(file, source, read_scenario(text, "s", pins_of(file), US))
        machine.run()
        return machine.conductors[0].participant.round

    quiet = rounds()
    assert quiet < 100
    assert rounds((0x0C, 0x01), (0x0D, 0x00), (0x0E, 0x00), (0x00, 0x08)) > 3 * quiet


def random_axes(seed: int) -> Script:
    """Return two axes of which hosts ask for everything that moves PROF, TRIG and IDLE."""
    draw = random.Random(seed)
    script = Script()
    for chip in "xy":
        at = controlled(script, chip)
        while at < 110_000:
            at += draw.choice((40, 500, 5_000, 15_000))
            far = draw.choice((3, 200, 40_000))
            goal = ((0x0C, far >> 16), (0x0D, far >> 8 & 255), (0x0E, far & 255))
            at = written(script, at, chip, *draw.choice((
                ((0x05, 1),), ((0x05, 3),), ((0x05, 0),), ((0x05, 2),),
                (*goal, (0x00, 0x08)), ((0x00, 0x00),), ((0x00, 0x0B),), ((0x00, 0x03),),
                ((0x0F, draw.choice((0, 2, 60, 255))),),
                ((0x04, draw.randrange(256)),), ((0x03, draw.randrange(256)),),
                ((draw.randrange(0x70), draw.randrange(256)),),
                ((0x28, 4), (0x27, 1), (0x26, 0), (0x05, 3)),
            )))  # fmt: skip
            if draw.randrange(3) == 0:
                script.line(at, f"{chip} r {draw.randrange(0x70):x}")
                at += 40
    return script


@pytest.mark.core("interpreted")
@pytest.mark.parametrize("seed", range(8))
def test_an_mcp1200_does_the_same_as_if_every_sample_were_waited_for(
    seed: int, monkeypatch: pytest.MonkeyPatch
) -> None:
    found = machine_of(random_axes(seed))
    found.run()
    monkeypatch.setattr(OutputPins, "may_move", lambda pins: True)
    every = machine_of(random_axes(seed))
    every.run()
    assert found.trace_hash() == every.trace_hash()
    assert found.conductors[0].participant.round <= every.conductors[0].participant.round
    assert sum(node.number for node in every.nodes) > 1, "no line has moved"
