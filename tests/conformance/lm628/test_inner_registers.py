"""Registers that only commands reach, as tools show them: formats and bits of the manual."""

import pytest

from vbus.chips.lm628.datasheet import VALUES


@pytest.mark.spec("LM-TRJ-2")
@pytest.mark.parametrize(
    ("name", "unit"),
    [
        ("acceleration loaded", "cnt/sample/sample"), ("acceleration", "cnt/sample/sample"),
        ("velocity loaded", "cnt/sample"), ("velocity", "cnt/sample"),
        ("desired velocity", "cnt/sample"), ("desired position", "cnt"),
    ],
)  # fmt: skip
def test_what_has_a_fraction_has_sixteen_bits_of_it(name: str, unit: str) -> None:
    (row,) = (row for row in VALUES.rows if row.group and row.name == name)
    assert (row.fraction, row.unit) == (16, unit)


@pytest.mark.spec("LM-TRJ-1")
def test_the_control_word_keeps_its_bits_12_to_8() -> None:
    (row,) = (row for row in VALUES.rows if row.name == "trajectory control word")
    assert [bit.number for bit in row.fields] == [12, 11, 10, 9, 8]


@pytest.mark.spec("LM-CMD-17")
def test_the_interrupt_mask_has_the_flags_that_raise_hi() -> None:
    (row,) = (row for row in VALUES.rows if row.name == "interrupt mask")
    assert [bit.number for bit in row.fields] == [6, 5, 4, 3, 2, 1]


@pytest.mark.spec("LM-PID-7")
def test_the_motor_command_is_shown_as_what_samples_change() -> None:
    row = VALUES.named("command")
    assert row is not None
    assert (row.name, row.moves) == ("motor command", True)
