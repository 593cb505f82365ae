"""A table of values: what is told, what is drawn, and where it is found."""

from types import SimpleNamespace

import pytest

from vbus import plugins
from vbus.chips.tables import Register, RegisterMap
from vbus.core.signals import Value, ValueTable

AXES = ValueTable(
    Value("speed", "axes[{}].speed", unit="cnt/sample", fraction=8, key="v {}", lane="velocity"),
    Value("place", "axes[{}].place", unit="cnt", key="p {}", lane="real"),
    Value("drive", "drive()", key="u", lane="output", step=0.25),
    Value("mode", "mode", key="mode", text=True),
    Value("request", "request", key="interrupt"),
    order=("mode", "u", "v {}", "p {}", "interrupt"),
)
MAP = RegisterMap(4, Register("LOAD", (0, 1), fraction=8, unit="count"), Register("COUNT", (2,)))


def chip() -> SimpleNamespace:
    axes = [SimpleNamespace(speed=384, place=7), SimpleNamespace(speed=-1, place=-7)]
    return SimpleNamespace(
        axes=axes, drive=lambda: 0.6, mode="idle", request=1, load=384, count=2,
        file=SimpleNamespace(load=512, count=3),
    )  # fmt: skip


def test_telemetry_has_the_values_of_the_chip_first_and_then_those_of_each_axis() -> None:
    told = AXES.telemetry(2)(chip())
    assert [*told] == ["mode", "u", "interrupt", "v 1", "p 1", "v 2", "p 2"]
    assert told == {
        "mode": "idle", "u": 0.6, "interrupt": 1, "v 1": 1.5, "p 1": 7, "v 2": -1 / 256, "p 2": -7
    }  # fmt: skip
    assert [*AXES.telemetry(1)(chip())] == ["mode", "u", "interrupt", "v 1", "p 1"]


def test_lanes_come_axis_by_axis_in_the_order_of_all_chips_and_the_interrupt_last() -> None:
    assert [(row.lane, axis) for row, axis in AXES.lanes(2)] == [
        ("real", 0), ("velocity", 0), ("output", 0), ("real", 1), ("velocity", 1)
    ]  # fmt: skip
    assert AXES.steps(2)(chip()) == [7, 384, 2, -7, -1, 1]
    assert [row.scale for row, _ in AXES.lanes(1)] == [1.0, 2.0**-8, 0.25]
    speed = AXES.named("v 2")
    assert speed is not None
    assert (speed.name, speed.plain_unit) == ("speed", "counts/sample")
    assert AXES.named("v x") is AXES.named("nothing") is None


def test_a_family_without_rows_tells_and_draws_its_registers() -> None:
    table = ValueTable(registers=MAP)
    assert table.telemetry(0)(chip()) == {"load": 1.5, "count": 2}
    assert [(row.lane, row.plain_unit) for row, _ in table.lanes(0)] == [
        ("load", "counts"), ("count", "")
    ]  # fmt: skip
    assert table.steps(0)(chip()) == [384, 2, 0]


def test_registers_that_no_row_names_are_found_in_the_register_file() -> None:
    table = ValueTable(
        Value("what is loaded", key="x", lane="x", register="LOAD"), registers=MAP, home="file."
    )
    assert table.telemetry(1)(chip()) == {"x": 2.0}
    assert {name: row.raw(0) for name, row in table.registers.items()} == {
        "LOAD": "chip.file.load", "COUNT": "chip.file.count"
    }  # fmt: skip


def test_the_order_has_the_keys_of_the_rows() -> None:
    with pytest.raises(ValueError, match="order and rows differ in b"):
        ValueTable(Value("a", "a", key="a"), order=("a", "b"))


def test_a_family_that_nobody_knows_has_no_values() -> None:
    assert plugins.family("nothing").values.rows == ()
