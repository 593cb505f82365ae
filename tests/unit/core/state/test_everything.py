"""Every attribute of a part of a board that may change is state, wiring, or derived."""

import dataclasses
from collections.abc import Iterator
from typing import Any

import pytest
from msgspec import Struct

from tests.undeclared import attributes, undeclared
from vbus.board.board import Board
from vbus.board.build import load_board_text
from vbus.chips.tables import RegisterMap
from vbus.core import state
from vbus.core.signals import Observer
from vbus.protocols.byte import ByteProtocol
from vbus.protocols.framed import FramedProtocol
from vbus.protocols.text import TextProtocol

BOARD = """\
[board]
name = "all"
[chips.x]
part = "LM629N-8"
clock = "8 MHz"
plant = "servo"
[chips.w]
part = "LM628N-8"
clock = "8 MHz"
plant = "ideal"
[chips.y]
part = "MCP-1200"
clock = "20 MHz"
plant = "servo2"
[chips.z]
part = "MC1241A"
clock = "25 MHz"
plants = ["step1", "step2"]
[chips.v]
part = "MC1141A"
clock = "25 MHz"
plant = "step3"
[plants.servo]
model = "dc_motor"
[plants.ideal]
model = "ideal"
[plants.servo2]
model = "dc_motor"
[plants.step1]
model = "stepper"
[plants.step2]
model = "stepper"
[plants.step3]
model = "stepper"
"""


def whole() -> Board:
    """A board with every chip, plant, host and kind of fault."""
    board = load_board_text(BOARD)
    for kind in ("backlash", "load_step"):
        board.faults.arm(kind, "x")
    board.faults.arm("byte_flipped", "x", when="cycle 1000")
    board.watch("z.PWMMag1A", Observer())
    for name in ("x", "w", "y", "z", "v"):
        port = board.open_port(name, [name])
        port.read(0)
        port.lines(1, 1)
    return board


def inside(value: Any) -> Iterator[Any]:
    """Give what a value holds."""
    if isinstance(value, dict):
        yield from value.values()
    elif isinstance(value, (list, tuple, set, frozenset)):
        yield from value
    elif type(value).__module__.startswith("vbus."):
        for name in attributes(value):
            yield getattr(value, name, None)


def constant(value: Any) -> bool:
    """Tell whether nobody changes it once it is made: a row of a table."""
    if isinstance(value, Struct):
        return value.__struct_config__.frozen
    frozen = dataclasses.is_dataclass(value) and value.__dataclass_params__.frozen  # type: ignore[attr-defined]
    return frozen or isinstance(value, (tuple, Exception, RegisterMap))


def reached(*roots: Any) -> list[Any]:
    """Return every object of ours that can be reached."""
    seen: dict[int, Any] = {}
    waiting = list(roots)
    while waiting:
        value = waiting.pop()
        if id(value) in seen or isinstance(value, type):
            continue
        seen[id(value)] = value
        waiting.extend(inside(value))
    return [one for one in seen.values() if type(one).__module__.startswith("vbus.")]


def test_every_attribute_is_state_wiring_or_derived() -> None:
    board = whole()
    wires = [kind(board.ports[0]) for kind in (ByteProtocol, TextProtocol, FramedProtocol)]
    found = {}
    for part in reached(board, *wires):
        if not constant(part):
            missing = undeclared(part)
            if missing:
                name = f"{type(part).__module__}.{type(part).__qualname__}"
                found.setdefault(name, set()).update(missing)
    assert found == {}


def test_every_declared_name_is_an_attribute_of_the_kind_it_is_declared_to_be() -> None:
    board = whole()
    for part in reached(board):
        if hasattr(part, "STATE") and part.STATE != state.UNDECLARED:
            saved = state.save(part)
            if isinstance(saved, dict) and not isinstance(part, Board):
                state.validate(part, saved, type(part).__name__)
        for name in (*getattr(part, "WIRING", ()), *getattr(part, "DERIVED", ())):
            assert name == "*" or hasattr(part, name), (type(part), name)


def test_what_is_saved_is_what_was_loaded() -> None:
    board, twin = whole(), whole()
    saved = board.save()
    twin.run_for(10**9)
    twin.load(saved)
    assert repr(twin.save()) == repr(saved)


@pytest.mark.parametrize("chip", [0, 1, 2, 3, 4])
def test_a_bad_state_names_part_and_field_and_leaves_the_board_as_it_was(chip: int) -> None:
    board = whole()
    before = board.save()
    part = board.chips[chip]
    bad = {**before, "chips": list(before["chips"])}
    field = next(name for name, value in before["chips"][chip].items() if type(value) is int)
    bad["chips"][chip] = {**before["chips"][chip], field: "three"}
    with pytest.raises(Exception, match=rf"chips\.{part.name}\.{field}: wants an integer of 64"):
        board.load(bad)
    assert repr(board.save()) == repr(before)
