"""MC1241A/MC1141A: one method for each row of the command table."""

from typing import Final

from vbus.chips.tables import Command
from vbus.tools.generate import calls

_HEAD = '''\
# Generated from the command table by vbus.tools.generate; change the table or the generator.
"""The MC1241A's and MC1141A's commands, one call each, for asyncio."""

from vbus.bits import sign_extend
from vbus.client.aio.mc1241a_packets import Mc1241aPackets
from vbus.client.words import words_of


class Mc1241aCommands(Mc1241aPackets):
    """Every command of the manual by its mnemonic, in lower case.

    Values are plain integers in the chip set's own units; long values travel high word first.
    """
'''

_SCOPES: Final = {
    "c": "Acts on the current axis.",
    "g": "Acts on the whole chip set.",
    "i": "Acts on the interrupting axis.",
}


def _note(row: Command) -> str:
    note = _SCOPES.get(row.scope, "")
    if row.buffered and not row.read:
        note += " Takes effect at an update."
    return note.strip()


def from_datasheet() -> str:
    """Return the calls for the command table of the chip's own datasheet."""
    from vbus.chips.mc1241a.datasheet import COMMANDS

    return calls.commands(_HEAD, "vbus/client/aio/mc1241a_commands.py", COMMANDS, _note)
