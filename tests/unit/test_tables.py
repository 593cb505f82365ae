"""What the tables of a datasheet refuse: a row that stands in them twice or in the wrong place."""

import re

import pytest

from vbus.chips.tables import Command, CommandTable, Register, RegisterMap


@pytest.mark.parametrize(
    ("rows", "problem"),
    [
        ((Register("A", (0x00,)), Register("A", (0x01,))), "A stands in the table twice"),
        ((Register("A", (0x05, 0x10)),), "A: address 10H is outside the map"),
        ((Register("A", (-1,)),), "A: address -1H is outside the map"),
        ((Register("A", (3,)), Register("B", (2, 3))), "03H is B and A"),
    ],
)
def test_a_register_map_refuses_an_address_that_is_taken_or_outside(
    rows: tuple[Register, ...], problem: str
) -> None:
    with pytest.raises(ValueError, match=f"^{re.escape(problem)}$"):
        RegisterMap(16, *rows)


def test_a_register_map_finds_rows_by_name_and_by_address() -> None:
    low, high = Register("LOW", (0x00,)), Register("HIGH", (0x0E, 0x0F))
    registers = RegisterMap(16, low, high)

    assert list(registers) == [low, high]
    assert (registers["LOW"], registers["HIGH"]) == (low, high)
    assert [registers.at(address) for address in (0, 1, 13, 14, 15, 16)] == [
        low, None, None, high, high, None,
    ]  # fmt: skip
    assert (low.bits, high.bits) == (8, 16)


class Hooks:
    """What rows name."""

    no_method = 1

    def store(self) -> None: ...

    def start(self) -> None: ...


def test_the_methods_rows_name_are_found_by_address() -> None:
    rows = (
        Register("A", (1, 2)),
        Register("B", (3,), on_write="start"),
        Register("C", (4,), 0, "r"),
    )
    found = RegisterMap(16, *rows).find_hooks("on_write", Hooks, "store")
    assert found == {1: Hooks.store, 2: Hooks.store, 3: Hooks.start}


def test_a_method_for_a_loaded_register_is_that_of_its_last_byte() -> None:
    rows = RegisterMap(16, Register("A", (2, 1, 0), on_loaded="start"), Register("B", (3,)))
    assert rows.find_hooks("on_loaded", Hooks) == {0: Hooks.start}


@pytest.mark.parametrize("name", ["strat", "no_method"])
def test_a_row_that_names_no_method_is_refused(name: str) -> None:
    rows = RegisterMap(16, Register("A", (0,), on_read=name))
    with pytest.raises(ValueError, match=f"^A: there is no method '{name}'$"):
        rows.find_hooks("on_read", Hooks)


@pytest.mark.parametrize(
    ("rows", "problem"),
    [
        ((Command("A", 0x0A), Command("B", 0x0A)), "0AH is B and A"),
        ((Command("A", 0x0A), Command("A", 0x0B)), "A stands in the table twice"),
    ],
)
def test_a_command_table_refuses_a_code_or_a_mnemonic_that_is_taken(
    rows: tuple[Command, ...], problem: str
) -> None:
    with pytest.raises(ValueError, match=f"^{re.escape(problem)}$"):
        CommandTable(*rows)


def test_each_hook_is_found_in_the_first_class_that_has_it() -> None:
    class First:
        def both(self) -> None: ...

    class Second(First):
        def second(self) -> None: ...

    table = CommandTable(
        Command("A", 1, hook="both"), Command("B", 2, hook="second"), Command("C", 3)
    )
    assert table.find_hooks(First, Second) == {"both": First, "second": Second}
    with pytest.raises(ValueError, match=r"^B: there is no method 'second'$"):
        table.find_hooks(First)
