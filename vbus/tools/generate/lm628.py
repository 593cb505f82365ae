"""LM628/LM629: one method for each row of the command table."""

from collections.abc import Mapping

from vbus.chips.tables import Command, CommandTable
from vbus.tools.generate.layout import docstring, formatted

_HEAD = '''# Made from the command table by vbus.tools.generate; change the table, or the generator.
"""The LM628's and LM629's commands, one call each, for asyncio."""

from vbus.bits import sign_extend
from vbus.client.aio.lm628_packets import Lm628Packets, words_of


class Lm628Commands(Lm628Packets):
    """Every command of the manual by its mnemonic, in lower case.

    Values are plain integers in the chip's own units; a word is 16 bits, a long value two words,
    high word first.
    """
'''


def commands(table: CommandTable, notes: Mapping[str, str]) -> str:
    """Return the source of the asyncio command calls; ``notes`` are the table's footnotes."""
    lines = [_HEAD]
    for row in table:
        lines += [*_method(row, notes.get(row.note, "")), ""]
    return formatted("\n".join(lines), "vbus/client/aio/lm628_commands.py")


def _method(row: Command, note: str) -> list[str]:
    name = row.name.lower()
    code = f"0x{row.code:02X}"
    title = f"{row.title[:1].upper()}{row.title[1:]} ({row.name}, {row.code:02X}H, {row.clause})."
    if row.read:
        value = f"await self.query({code}, {row.read})"
        return [
            f"    async def {name}(self) -> int:",
            *docstring(title, [note, _returns(row)]),
            f"        return sign_extend({value}, {16 * row.read})" if row.signed
            else f"        return {value}",
        ]  # fmt: skip
    if row.up_to > row.write:
        most = row.up_to - row.write
        arguments = (
            "Args:\n"
            "    control: the control word, which says what follows.\n"
            f"    words: 0 to {most} data words."
        )
        return [
            f"    async def {name}(self, control: int, *words: int) -> None:",
            *docstring(title, [note, arguments]),
            f"        await self.command({code}, control, *words)",
        ]
    if row.write:
        words = "value" if row.write == 1 else "*words_of(value)"
        arguments = f"Args:\n    value: {16 * row.write} bits, {_sense(row)}."
        return [
            f"    async def {name}(self, value: int) -> None:",
            *docstring(title, [note, arguments]),
            f"        await self.command({code}, {words})",
        ]
    return [
        f"    async def {name}(self) -> None:",
        *docstring(title, [note]),
        f"        await self.command({code})",
    ]


def _returns(row: Command) -> str:
    scale = f", in 1/{1 << row.fraction}" if row.fraction else ""
    return f"Returns {16 * row.read} bits, {_sense(row)}{scale}."


def _sense(row: Command) -> str:
    return "two's complement" if row.signed else "unsigned"


def from_datasheet() -> str:
    """Return the calls for the command table of the chip's own datasheet."""
    from vbus.chips.lm628.datasheet import COMMANDS, NOTES

    return commands(COMMANDS, NOTES)
