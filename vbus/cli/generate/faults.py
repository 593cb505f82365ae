"""Fills the tables of the page about faults."""

from typing import Final

from vbus.cli.generate.board_file import option_table
from vbus.cli.generate.layout import filled, table
from vbus.faults.messages import MESSAGES, OF_BYTES
from vbus.faults.row import AXIS, COUNTED, LINK, NET, ONCE, WIRE, Fault
from vbus.faults.table import faults as known_faults

_ENDS: Final = {ONCE: "over at once", COUNTED: "once, for a time, until cleared"}


def faults() -> str:
    """Return the page with its tables up to date."""
    families: dict[str, list[Fault]] = {}
    for fault in known_faults().values():
        families.setdefault(fault.family, []).append(fault)
    return filled("faults", {name: _rows(family) for name, family in families.items()})


def _rows(family: list[Fault]) -> list[str]:
    rows = table(
        ("fault", "what happens", "for", "ends"),
        (
            (f"`{fault.name}`", fault.title, _for(fault),
             _ENDS.get(fault.acts, "for a time, until cleared"))
            for fault in family
        ),
    )  # fmt: skip
    for fault in family:
        if fault.parameters:
            rows += ["", f"`{fault.name}`:", "", *option_table(fault.parameters)]
    return rows


def _for(fault: Fault) -> str:
    if fault.target == LINK:
        if fault.name == OF_BYTES:
            return "links of bytes"
        return "links over Zenoh" if fault.family == MESSAGES else "links"
    if fault.target == WIRE:
        return "wires between nodes"
    if not fault.of_chip:
        return "wires of a board" if fault.target == NET else "parts of glue"
    if fault.families:
        return ", ".join(fault.families)
    if fault.shaft:
        return "axes with a `dc_motor` or `stepper`"
    return "every axis" if fault.target == AXIS else "every chip"
