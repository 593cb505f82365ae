"""What triggers look at: conditions, and the first bytes of commands."""

from collections.abc import Callable

from vbus import plugins
from vbus.chips.base import Chip
from vbus.circuit.circuit import Circuit
from vbus.core.kernel import Timer
from vbus.core.values.lexer import ConditionError
from vbus.core.values.settings import among
from vbus.events.condition import COMMAND
from vbus.events.watch import Watch

Writes = tuple[tuple[int, int], ...]
"""Addresses and bytes; byte -1 stands for any."""


class ConditionWatch(Watch):
    """A watch to which a command has come with its first byte.

    Args:
        text: the condition.
        board: the board.
        chip: whose commands are meant where none is named; None: no chip's.
        met: is called at the instant at which the condition holds.

    Raises:
        ValueError: it makes no sense on this board, or cannot be a trigger of a fault.
    """

    def __init__(
        self, text: str, board: Circuit, chip: Chip | None, met: Callable[[], None]
    ) -> None:
        try:
            super().__init__(text, board, "when =", met)
        except ConditionError as error:
            raise ValueError(str(error)) from None
        if self.condition.remembers:
            raise ValueError(
                f'when = "{text}": a fault waits for what is, and for edges of pins and values:'
                ' no "stable for", "previous", or edge of a flag or a comparison'
            )
        self._writes: list[tuple[str, str, Writes]] = []
        for name, wanted in self.condition.commands:
            of = board.chip(name) if name else chip
            if of is None:
                raise ValueError(f'when = "{text}": a fault of a link or a wire has no command')
            self._writes.append((of.name, wanted, write_of(of, wanted)))

    def reads(self) -> bool:
        """Read no packets: commands are known by their first byte."""
        return False

    def timer(self, look: Callable[[], None]) -> Timer:
        """Return a timer that hosts' promises heed: what a fault does, they notice."""
        return self.board.kernel.timer(look, saved=False)

    def bus_cycle(
        self, when: int, host: str, chip: str, write: bool, address: int, data: int
    ) -> None:
        """Take down the commands that begin."""
        for name, wanted, writes in self._writes if write else ():
            if name in chip.split("+") and begins(writes, address, data):
                self.happen(COMMAND, name, wanted)
        super().bus_cycle(when, host, chip, write, address, data)


def begins(writes: Writes, address: int, data: int) -> bool:
    """Tell whether a write is the beginning of a command, as :func:`write_of` gives it."""
    return (address, data) in writes or (address, -1) in writes


def write_of(chip: Chip, name: str) -> Writes:
    """Return the writes that are a command's beginning, or go to a register.

    Args:
        chip: the chip.
        name: the mnemonic, or the register's name, or its address in hexadecimal ("R05H").

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
    raise ValueError(f'{chip.part} has no {kind} "{name}"; {among(name.upper(), names, "it has")}')
