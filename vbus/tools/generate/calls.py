"""Calls made from the command table of a chip that takes packets: one method for each row."""

from collections.abc import Callable

from vbus.chips.tables import Command, CommandTable
from vbus.tools.generate.layout import docstring, formatted


def commands(head: str, path: str, table: CommandTable, note: Callable[[Command], str]) -> str:
    """Return the source of the asyncio command calls.

    Args:
        head: beginning of the file, up to and including the class docstring.
        path: where the file stands.
        table: the commands.
        note: what a row's docstring says beside its title; may be empty.
    """
    lines = [head]
    for row in table:
        lines += [*_method(row, note(row)), ""]
    return formatted("\n".join(lines), path)


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
