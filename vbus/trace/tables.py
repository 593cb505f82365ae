"""The tables of all chip families that come with vbus, for those who explain them."""

from collections.abc import Iterator
from functools import cache

from vbus.chips.lm628 import datasheet as lm628
from vbus.chips.mc1241a import datasheet as mc1241a
from vbus.chips.mcp1200 import datasheet as mcp1200
from vbus.chips.strobes import AcTable
from vbus.chips.tables import Command, Register


def commands() -> Iterator[tuple[str, Command]]:
    """Give every command with its family."""
    for row in lm628.COMMANDS:
        yield lm628.FAMILY, row
    for row in mc1241a.COMMANDS:
        yield mc1241a.FAMILY, row


def registers() -> Iterator[tuple[str, Register]]:
    """Give every register with its family."""
    for row in mcp1200.REGISTERS:
        yield mcp1200.FAMILY, row


def ac_tables() -> Iterator[tuple[str, str, AcTable]]:
    """Give every table of AC characteristics: family, supply (or ""), table."""
    yield lm628.FAMILY, "", lm628.AC
    yield mc1241a.FAMILY, "", mc1241a.AC
    for supply, table in mcp1200.AC.items():
        yield mcp1200.FAMILY, supply, table


@cache
def ac_rules() -> frozenset[str]:
    """Return the names of the rules that measure an interval, in ps."""
    return frozenset(rule.name for _, _, table in ac_tables() for rule in table.rules.values())
