"""Fills the tables of the page about faults."""

from typing import Final

from vbus.faults import table
from vbus.faults.row import AXIS, COUNTED, LINK, ONCE, Fault
from vbus.tools.generate.board_file import option_table
from vbus.tools.generate.documents import fill
from vbus.tools.generate.layout import ROOT

_ENDS: Final = {ONCE: "over at once", COUNTED: "once, for a time, until cleared"}


def faults() -> str:
    """Return the page with its tables up to date."""
    page = (ROOT / "docs" / "faults.md").read_text()
    known = table.faults().values()
    for family in dict.fromkeys(fault.family for fault in known):
        page = fill(page, family, _rows([fault for fault in known if fault.family == family]))
    return page


def _rows(family: list[Fault]) -> list[str]:
    rows = ["| fault | what happens | for | ends |", "|---|---|---|---|"]
    for fault in family:
        ends = _ENDS.get(fault.acts, "for a time, until cleared")
        rows.append(f"| `{fault.name}` | {fault.title} | {_for(fault)} | {ends} |")
    for fault in family:
        if fault.parameters:
            rows += ["", f"`{fault.name}`:", "", *option_table(fault.parameters)]
    return rows


def _for(fault: Fault) -> str:
    if fault.target == LINK:
        return "links"
    if fault.families:
        return ", ".join(fault.families)
    if fault.shaft:
        return "axes with a `dc_motor` or `stepper`"
    return "every axis" if fault.target == AXIS else "every chip"
