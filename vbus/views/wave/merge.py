"""Waveforms of several nodes as one VCD text: one time axis, a scope for each node."""

from collections.abc import Iterable, Iterator
from heapq import merge
from itertools import count
from typing import Final, TextIO

# VCD allows the printable characters from "!" to "~".
_CODES: Final = [chr(code) for code in range(33, 127)]

_Block = tuple[int, int, list[str]]
"""Tick, place of the node, changes of that tick."""


def merge_waves(waves: Iterable[tuple[str, Iterable[str]]], file: TextIO) -> None:
    """Write one VCD text made of those of several nodes.

    The texts are those :class:`~vbus.views.wave.vcd_file.VcdFile` writes, so they have one time
    scale. What happens on several nodes in one tick is written in the order of ``waves``.

    Args:
        waves: name of a node, and the lines of its text.
        file: takes the text.
    """
    # Each text begins with the first identifier: in one file they would be the same.
    codes = map(_code, count())
    head: list[str] = []
    scopes: list[str] = []
    blocks: list[Iterator[_Block]] = []
    for place, (name, text) in enumerate(waves):
        lines = (line.rstrip("\n") for line in text)
        new: dict[str, str] = {}
        scopes.append(f"$scope module {name} $end")
        for line in lines:
            words = line.split()
            if line.startswith("$enddefinitions"):
                break
            if line.startswith("$var"):
                new[words[3]] = words[3] = next(codes)
                scopes.append(" ".join(words))
            elif line.startswith(("$scope", "$upscope")):
                scopes.append(line)
            elif not place:
                head.append(line)
        scopes.append("$upscope $end")
        blocks.append(_blocks(lines, place, new))
    file.writelines(f"{line}\n" for line in [*head, *scopes, "$enddefinitions $end"])
    written = latest = -1
    for tick, _, changes in merge(*blocks, key=lambda block: block[:2]):
        latest = tick
        # A tick without changes needs no line, unless it is the end.
        if changes and tick != written:
            file.write(f"#{tick}\n")
            written = tick
        file.writelines(changes)
    if latest != written:
        file.write(f"#{latest}\n")
    file.flush()


def _code(number: int) -> str:
    """Return the identifier of a variable: short, and printable."""
    code = ""
    while True:
        number, digit = divmod(number, len(_CODES))
        code += _CODES[digit]
        if not number:
            return code
        number -= 1


def _blocks(lines: Iterable[str], place: int, new: dict[str, str]) -> Iterator[_Block]:
    """Give the changes of a text tick by tick, with the new identifiers."""
    tick = -1
    changes: list[str] = []
    for line in lines:
        if line.startswith("#"):
            if tick >= 0:
                yield tick, place, changes
            tick, changes = int(line[1:]), []
        elif line and not line.startswith("$"):
            if line[0] in "brs":
                value, _, old = line.rpartition(" ")
                changes.append(f"{value} {new[old]}\n")
            else:
                changes.append(f"{line[0]}{new[line[1:]]}\n")
    if tick >= 0:
        yield tick, place, changes
