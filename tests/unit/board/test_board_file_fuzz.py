"""Whatever a board file holds, it gives a board or a list of its mistakes, and nothing else."""

import contextlib
from typing import Any

import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

from tests.unit.board.test_board_file import GOOD
from vbus.board.build import card_of, load_board_text
from vbus.board.config import read_board_text
from vbus.boardfile.source import BoardFileError

pytestmark = pytest.mark.usefixtures("acme")

NAMES = st.sampled_from(
    ["x", "y", "m", "left", "isa", "x.IRQ", "y.READY", "x./SYNC", "x.D0-D7", "q.Z", "", ".", "ä"]
)
TEXTS = st.sampled_from(
    ["ACME-1", "TWIN-1", "GRUMPY", "BROKEN", "ODD", "motor", "steps", "8 MHz", "1 us", "24 V",
     "realtime", "lockstep", "max", "off", "warn", "high", "done", "pty:a", "tcp:0", "no:1",
     "text", "isa", "direct", "9" * 50 + " V", "1e30 s", "\0", "x\ny"]
)  # fmt: skip
KEYS = st.sampled_from(
    ["board", "violations", "chips", "plants", "nets", "buses", "cards", "hosts", "x", "y", "m",
     "part", "clock", "plant", "plants", "model", "supply", "switches", "home", "first", "last",
     "closed", "pins", "rest", "base", "stride", "decode", "block", "ports", "offset", "chip",
     "address", "transport", "protocol", "cycle", "card", "name", "time", "rate", "seed",
     "clock_step", "stall", "power_on", "default", "toy.T1", "busy_clk", "gain", "", "a b"]
)  # fmt: skip
LEAVES = (
    TEXTS
    | NAMES
    | st.integers(-2, 9)
    | st.sampled_from([1 << 70, 0.5, float("inf"), float("nan"), True])
)
VALUES = st.recursive(
    LEAVES,
    lambda inner: st.lists(inner, max_size=3) | st.dictionaries(KEYS, inner, max_size=4),
    max_leaves=12,
)


def written(value: Any) -> str:
    if isinstance(value, bool):
        return "true" if value else "false"
    if isinstance(value, str):
        return '"' + "".join(f"\\U{ord(char):08x}" for char in value) + '"'
    if isinstance(value, list):
        return "[" + ", ".join(written(item) for item in value) + "]"
    if isinstance(value, dict):
        return "{" + ", ".join(f"{written(k)} = {written(v)}" for k, v in value.items()) + "}"
    return str(value)


def load(text: str) -> None:
    with contextlib.suppress(BoardFileError):
        file, _ = read_board_text(text)
        for host in file.hosts:
            card_of(file, host)
        load_board_text(text)


QUIET = settings(
    max_examples=300,
    suppress_health_check=[HealthCheck.function_scoped_fixture, HealthCheck.too_slow],
)


@QUIET
@given(st.dictionaries(KEYS, VALUES, max_size=6))
def test_any_document_is_built_or_refused(data: dict[str, Any]) -> None:
    load("".join(f"{written(key)} = {written(value)}\n" for key, value in data.items()))


@QUIET
@given(st.data())
def test_a_good_file_with_one_value_changed_is_built_or_refused(data: st.DataObject) -> None:
    lines = GOOD.split("\n")
    number = data.draw(
        st.sampled_from([n for n, line in enumerate(lines) if " = " in line and "{" not in line])
    )
    key, _, _ = lines[number].partition(" = ")
    lines[number] = f"{key} = {written(data.draw(VALUES))}"
    load("\n".join(lines))


@QUIET
@given(st.text(st.sampled_from("[]{}=,.\"'#\\\n ab1-"), max_size=40))
def test_any_text_is_built_or_refused(text: str) -> None:
    load(text)
