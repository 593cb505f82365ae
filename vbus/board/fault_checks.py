"""Checks of ``[[faults]]`` that need no board: triggers and ends."""

from vbus.board.sections import FaultSection
from vbus.board.source import Source
from vbus.board.toml_lines import Path
from vbus.faults.row import Fault
from vbus.faults.trigger import When, read_until, read_when


def check_fault(section: FaultSection, fault: Fault, source: Source, path: Path) -> None:
    """Note what is wrong with the trigger or the end of one fault."""
    when: When | None = None
    try:
        when = read_when(section.when or None)
    except ValueError as error:
        source.fail((*path, "when"), str(error).partition(": ")[2])
    try:
        read_until(section.until or None, when or read_when(None), fault)
    except ValueError as error:
        source.fail((*path, "until"), str(error))
