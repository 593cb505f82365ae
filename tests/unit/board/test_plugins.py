"""Parts found by name through entry points."""

import re

import pytest

from tests.unit.board import parts
from vbus import plugins
from vbus.chips.base import Chip
from vbus.chips.family import Family
from vbus.core.entry_points import EntryPoint
from vbus.core.errors import ConfigError, PluginError


@pytest.fixture
def registered(acme: None, monkeypatch: pytest.MonkeyPatch) -> dict[str, dict[str, str]]:
    """The registered parts, to be changed."""
    entries = {group: dict(rows) for group, rows in parts.ENTRIES.items()}
    monkeypatch.setattr(parts, "ENTRIES", entries)
    return entries


def test_a_chip_is_found_by_the_beginning_of_its_part_number(acme: None) -> None:
    assert plugins.chip_class("ACME-2") is parts.Acme


def test_the_longest_name_that_fits_a_part_wins(registered: dict[str, dict[str, str]]) -> None:
    registered["vbus.chips"] |= {"AC": f"{parts.HERE}:Grumpy", "ACME-2": f"{parts.HERE}:Twin"}
    assert plugins.chip_class("ACME-1") is parts.Acme
    assert plugins.chip_class("ACME-2") is parts.Twin
    assert plugins.chip_class("ACID") is parts.Grumpy


def test_an_entry_may_be_a_family_or_a_chip_class(registered: dict[str, dict[str, str]]) -> None:
    registered["vbus.chips"]["ACME"] = f"{parts.HERE}:FAMILY"
    assert plugins.family_of("TWIN-1") == Family("twin", parts.Twin)
    assert plugins.family_of("ACME-1") is parts.FAMILY
    assert plugins.chip_class("ACME-1") is parts.Acme


def test_what_a_family_leaves_out_is_none_and_what_is_broken_says_so() -> None:
    assert parts.FAMILY.load("coverage", object) is None
    assert parts.FAMILY.object("host") == 3
    assert (parts.FAMILY.commands, parts.FAMILY.registers) == ((), ())
    assert parts.FAMILY.rules == parts.Acme.RULES
    with pytest.raises(
        PluginError,
        match=r"^family acme: packets = 'no_such_module:Packets' cannot be loaded: ModuleNotFound",
    ):
        parts.FAMILY.object("packets")
    with pytest.raises(
        PluginError,
        match=r"^family acme: upsets = 'parts:Motor' is not a subclass of Chip$",
    ):
        parts.FAMILY.load("upsets", Chip)


def test_a_family_is_found_by_its_name_and_broken_plugins_are_passed_over(acme: None) -> None:
    assert plugins.family("twin").chip is parts.Twin
    assert plugins.family("nobody") == Family("nobody")


def test_a_board_asks_no_plugin_but_those_of_its_chips(
    acme: None, monkeypatch: pytest.MonkeyPatch
) -> None:
    plugins.family_of("TWIN-1")
    monkeypatch.setattr(plugins, "load", None)
    assert plugins.family("twin").chip is parts.Twin


def test_a_broken_entry_point_costs_nothing_until_it_is_wanted(acme: None) -> None:
    assert "BROKEN" in plugins.names(plugins.CHIPS)
    with pytest.raises(PluginError, match=r'^part "BROKEN" of .* cannot be loaded: ModuleNotFound'):
        plugins.chip_class("BROKEN-7")


def test_an_unknown_name_is_answered_with_the_known_ones(acme: None) -> None:
    with pytest.raises(
        ConfigError,
        match=r'^unknown plant model "moter"; did you mean "motor"\? known are motor, steps$',
    ):
        plugins.plant_class("moter")


def test_a_name_claimed_by_two_distributions_is_refused(
    registered: dict[str, dict[str, str]], monkeypatch: pytest.MonkeyPatch
) -> None:
    def twice(group: str) -> list[EntryPoint]:
        return [*parts.entry_points(group), EntryPoint("ACME", "other:Chip", group)]

    monkeypatch.setattr(plugins, "entry_points", twice)
    message = (
        f'part "ACME" is claimed twice: by {parts.HERE}:Acme and by other:Chip;'
        " uninstall one of them"
    )
    with pytest.raises(PluginError, match=f"^{re.escape(message)}$"):
        plugins.chip_class("ACME-1")


def test_the_same_entry_point_seen_twice_is_one(
    registered: dict[str, dict[str, str]], monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(plugins, "entry_points", lambda group: parts.entry_points(group) * 2)
    assert plugins.chip_class("ACME-1") is parts.Acme


def test_a_source_tree_that_is_not_installed_says_how_to_install_it(
    acme: None, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(plugins, "entry_points", lambda group: [])
    message = (
        "no vbus.chips entry points are registered: vbus runs from a source tree that is not"
        ' installed; run "pip install -e ." in it'
    )
    with pytest.raises(PluginError, match=f"^{re.escape(message)}$"):
        plugins.chip_class("ACME-1")


@pytest.mark.parametrize(
    ("group", "expected"),
    [
        (plugins.CHIPS, {"LM628", "LM629", "MCP-1200", "MCP1200", "MC1241A", "MC1141A"}),
        (plugins.PLANTS, {"dc_motor", "ideal", "stepper"}),
        (plugins.PROTOCOLS, {"byte", "framed", "terminal", "text"}),
        (plugins.TRANSPORTS, {"pty", "unix", "tcp", "serial", "rfc2217"}),
    ],
)
def test_the_parts_of_vbus_are_registered_like_any_other(group: str, expected: set[str]) -> None:
    assert expected <= set(plugins.names(group))
