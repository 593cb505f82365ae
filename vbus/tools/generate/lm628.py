"""LM628/LM629: one method for each row of the command table."""

from collections.abc import Mapping

from vbus.chips.tables import CommandTable
from vbus.tools.generate import calls

_HEAD = '''# Made from the command table by vbus.tools.generate; change the table, or the generator.
"""The LM628's and LM629's commands, one call each, for asyncio."""

from vbus.bits import sign_extend
from vbus.client.aio.lm628_packets import Lm628Packets
from vbus.client.words import words_of


class Lm628Commands(Lm628Packets):
    """Every command of the manual by its mnemonic, in lower case.

    Values are plain integers in the chip's own units; a word is 16 bits, a long value two words,
    high word first.
    """
'''


def commands(table: CommandTable, notes: Mapping[str, str]) -> str:
    """Return the source of the asyncio command calls; ``notes`` are the table's footnotes."""
    path = "vbus/client/aio/lm628_commands.py"
    return calls.commands(_HEAD, path, table, lambda row: notes.get(row.note, ""))


def from_datasheet() -> str:
    """Return the calls for the command table of the chip's own datasheet."""
    from vbus.chips.lm628.datasheet import COMMANDS, NOTES

    return commands(COMMANDS, NOTES)
