"""Calls made from the tables of a chip family: one for each command, or two for each register."""

from collections.abc import Mapping
from typing import Final

from vbus.chips.family import Family
from vbus.chips.tables import Command, Register
from vbus.tools.generate.layout import docstring, formatted

_HEAD: Final = '''\
# Made from the {rows} table by vbus.tools.generate; change the table or the generator.
"""Calls for the {title}, one {each}, for asyncio."""

{imports}


class {name}({base}):
    """{summary}

    {detail}
    """
'''
_SCOPES: Final = {
    "c": "Acts on the current axis.",
    "g": "Acts on the whole chip set.",
    "i": "Acts on the interrupting axis.",
}


def class_name(family: Family, suffix: str) -> str:
    """Return a class name of a family: ``"Lm628Calls"``."""
    words = family.name.replace("-", "_").split("_")
    return "".join(word.capitalize() for word in words) + suffix


def calls(family: Family) -> str:
    """Return the source of the asyncio calls of a family that has commands or registers."""
    if family.access:
        module, _, base = family.access.partition(":")
        module = f"{family.home}.{module}"
    elif family.registers:
        module, base = "vbus.client.aio.registers", "RegisterCycles"
    else:
        module, base = "vbus.client.aio.packets", "Packets"
    title = family.title or family.name
    kinds = {"name": class_name(family, "Calls"), "base": base, "title": title}
    if family.registers:
        head = _HEAD.format(
            rows="register", each="to read and one to write each register", **kinds,
            imports=f"from {module} import {base}",
            summary="Every register by name, as a whole value in the chip's own units.",
            detail="Several bytes are written most significant byte first and read least"
            " significant byte\n    first.",
        )  # fmt: skip
    else:
        head = _HEAD.format(
            rows="command", each="for each command", **kinds,
            imports="from vbus.bits import sign_extend\n"
            f"from {module} import {base}\nfrom vbus.client.words import words_of",
            summary="Every command by its mnemonic, in lower case.",
            detail="Values are plain integers in the chip's own units; a word is 16 bits, a long"
            " value two words,\n    high word first.",
        )  # fmt: skip
    notes = getattr(family.tables, "NOTES", {})
    lines = [head]
    for command in family.commands:
        lines += [*_method(command, _note(command, notes)), ""]
    for register in family.registers:
        lines += [*_read(register), ""]
        if register.access != "r":
            lines += [*_write(register), ""]
    return formatted("\n".join(lines), f"{family.home.replace('.', '/')}/generated/aio_calls.py")


def _note(row: Command, notes: Mapping[str, str]) -> str:
    parts = [notes.get(row.note, ""), _SCOPES.get(row.scope, "")]
    if row.buffered and not row.read:
        parts.append("Takes effect at an update.")
    return " ".join(note for note in parts if note)


def _method(row: Command, note: str) -> list[str]:
    name = row.name.lower()
    code = f"0x{row.code:02X}"
    title = f"{row.title[:1].upper()}{row.title[1:]} ({row.name}, {row.code:02X}H, {row.clause})."
    if row.read:
        value = f"await self.query({code}, {row.read})"
        return [
            f"    async def {name}(self) -> int:",
            *docstring(title, [note, f"Returns {16 * row.read} bits, {_sense(row)}."]),
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


def _read(row: Register) -> list[str]:
    call = f"self.read_bytes({_bytes(row)}, signed=True)" if row.signed else (
        f"self.read_bytes({_bytes(row)})"
    )  # fmt: skip
    return [
        f"    async def read_{row.name.lower()}(self) -> int:",
        *docstring(f"Read {_title(row)}", [f"Returns {row.bits} bits, {_sense(row)}."]),
        f"        return await {call}",
    ]


def _write(row: Register) -> list[str]:
    return [
        f"    async def write_{row.name.lower()}(self, value: int) -> None:",
        *docstring(f"Write {_title(row)}", [f"Args:\n    value: {row.bits} bits, {_sense(row)}."]),
        f"        await self.write_bytes({_bytes(row)}, value)",
    ]


def _bytes(row: Register) -> str:
    listed = ", ".join(f"0x{address:02X}" for address in row.addresses)
    return f"({listed},)" if len(row.addresses) == 1 else f"({listed})"


def _title(row: Register) -> str:
    names = ", ".join(f"R{address:02X}H" for address in row.addresses)
    return f"{row.title} ({names}, {row.clause})."


def _sense(row: Command | Register) -> str:
    scale = f", in 1/{1 << row.fraction}" if row.fraction else ""
    sense = "two's complement" if row.signed else "unsigned"
    return f"{sense}{scale}"
