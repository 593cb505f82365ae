"""What is made for one chip family, and from what."""

from functools import partial
from typing import Final

from vbus.chips.clauses import clauses_of
from vbus.chips.family import Family
from vbus.cli.generate import chip_pages, registers, sigrok, stubs
from vbus.cli.generate.layout import ROOT, Target, folder_of

_GENERATED: Final = '"""Made from the tables of the chip by vbus.cli.generate."""\n'


def client_targets(family: Family) -> list[Target]:
    """Return what is made of a chip family's tables, in its folder: numbers, and types of calls.

    Numbers are bits, and registers, if the rows say when each of them counts.
    """
    folder = folder_of(family)
    place = f"{folder.relative_to(ROOT) if folder.is_relative_to(ROOT) else folder}"
    made = f"{place}/generated"
    found: list[Target] = []
    if stubs.calls_class(family) is not None:
        found.append((f"{place}/calls.pyi", partial(stubs.calls, family)))
    counted = any(row.counts for row in family.registers)
    if counted or family.bits:
        found.append((f"{made}/__init__.py", lambda: _GENERATED))
        found.append((f"{made}/bits.py", partial(registers.bits, family)))
    if counted:
        found.append((f"{made}/registers.py", partial(registers.registers, family)))
    return found


def family_targets(family: Family) -> list[Target]:
    """Return all that is made for one chip family, in the folder it is installed in.

    That is what its client needs, its pages, and its decoder for sigrok.
    """
    made = folder_of(family) / "generated"
    pages = [(f"{made}/{family.name}.md", partial(chip_pages.page, family))]
    if clauses_of(family.home):
        path = f"{made}/{family.name}-clauses.md"
        pages.append((path, partial(chip_pages.clause_page, family)))
    return [*client_targets(family), *pages, *sigrok.decoder_targets(family, f"{made}/sigrok")]
