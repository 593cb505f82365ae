"""What triggers look at: bus cycles, commands, edges."""

from collections.abc import Callable
from typing import ClassVar

from vbus.board import plugins
from vbus.board.settings import listed, suggestion
from vbus.chips.base import Chip
from vbus.signals import Observer
from vbus.state import Names

Cycle = Callable[[int, str, bool, int, int], None]
"""Is told of a bus cycle: instant, chips, write, address, byte."""


class CycleWatcher(Observer):
    """Sees whole bus cycles, in the place of somebody who wants to hear of them."""

    WIRING: ClassVar[Names] = ("*",)

    def __init__(self, tell: Cycle) -> None:
        self._tell: Cycle = tell

    def bus_cycle(
        self, when: int, host: str, chip: str, write: bool, address: int, data: int
    ) -> None:
        """Pass it on."""
        self._tell(when, chip, write, address, data)


class EdgeWatcher(Observer):
    """Sees the edges of one net and tells of those to one level."""

    def __init__(self, level: int, tell: Callable[[], None]) -> None:
        self._level: int = level
        self._tell: Callable[[], None] = tell

    def edge(self, when: int, net: str, level: int) -> None:
        """Pass it on."""
        if level == self._level:
            self._tell()


def write_of(chip: Chip, name: str) -> tuple[tuple[int, int], ...]:
    """Return the writes that are a command's beginning, or go to a register.

    Args:
        chip: the chip.
        name: the mnemonic, or the register's name, or its address in hexadecimal ("R05H").

    Returns:
        Addresses and bytes; byte -1 stands for any.

    Raises:
        ValueError: the chip has none of that name.
    """
    family = plugins.family(chip.FAMILY)
    tables = family.tables
    names: list[str] = []
    for row in family.commands:
        if tables is not None and row.name.upper() == name.upper():
            return ((tables.COMMAND_PORT, row.code),)
        names.append(row.name)
    kind = "command" if names else "register"
    for register in family.registers:
        places = [f"R{address:02X}H" for address in register.addresses]
        if name.upper() == register.name:
            return tuple((address, -1) for address in register.addresses)
        if name.upper() in places:
            return ((register.addresses[places.index(name.upper())], -1),)
        names.append(register.name)
    if not names:
        raise ValueError(f"{chip.part}: its commands have no names known here")
    hint = suggestion(name.upper(), names)
    raise ValueError(f'{chip.part} has no {kind} "{name}"; {hint}it has {listed(names)}')
