"""Which functions a stack of a process leads through, as far as its programs name them."""

import struct
from bisect import bisect_right
from contextlib import suppress
from functools import lru_cache
from pathlib import Path
from typing import Final, NamedTuple

from vbus.core.elf import LOADED, Elf

# 256 MB: a browser with its symbols; larger files would take seconds of a report.
_LARGEST: Final = 1 << 28
"""Bytes of a program that is read for its symbols."""


class Place(NamedTuple):
    """Where a thread is.

    Attributes:
        inner: function of a library that it is in; "" if none is known.
        outer: function of the program that called it, or a place in it; "" if none is known.
    """

    inner: str
    outer: str


class _Program(NamedTuple):
    """What a file says of its functions.

    Attributes:
        segments: offset in the file, size and address of what is loaded.
        begins: addresses of the functions, sorted.
        functions: end and name of each.
    """

    segments: tuple[tuple[int, int, int], ...]
    begins: tuple[int, ...]
    functions: tuple[tuple[int, str], ...]

    def at(self, offset: int) -> tuple[str, int]:
        """Return the function at an offset in the file, or "", and the address there."""
        for begin, size, address in self.segments:
            if begin <= offset < begin + size:
                where = offset - begin + address
                place = bisect_right(self.begins, where) - 1
                if place >= 0 and where < self.functions[place][0]:
                    return self.functions[place][1], where
                return "", where
        return "", offset


@lru_cache(maxsize=64)
def _program(path: str) -> _Program:
    """Read the functions of a program or library; none if it is no ELF file."""
    with suppress(OSError, ValueError):
        if Path(path).stat().st_size <= _LARGEST:
            return _parsed(Path(path).read_bytes())
    return _Program((), (), ())


def _parsed(data: bytes) -> _Program:
    program = Elf(data)
    segments = [(one.offset, one.size, one.virtual) for one in program.segments()
                if one.kind == LOADED]  # fmt: skip
    found: dict[int, tuple[int, str]] = {}
    for name, value, extent in program.functions():
        text = name.lstrip("_")
        # Of several names of one address the shortest is the one that people know: read, __read.
        if value and extent and (value not in found or len(text) < len(found[value][1])):
            found[value] = (value + extent, text)
    begins = sorted(found)
    return _Program(tuple(segments), tuple(begins), tuple(found[begin] for begin in begins))


def _mappings(pid: int) -> list[tuple[int, int, int, str]]:
    """Return begin, end, offset and file of what a process may execute."""
    found = []
    with suppress(OSError):
        for line in Path(f"/proc/{pid}/maps").read_text(errors="replace").splitlines():
            fields = line.split(maxsplit=5)
            # A return address lies in code: data and stacks are passed over.
            if len(fields) == 6 and "x" in fields[1] and fields[5].startswith("/"):
                begin, _, end = fields[0].partition("-")
                found.append((int(begin, 16), int(end, 16), int(fields[2], 16), fields[5]))
    return found


def places(pid: int, stack: bytes, wide: bool) -> Place:
    """Return where a thread is, by the return addresses on its stack.

    Args:
        pid: its process.
        stack: what stands there, the innermost first.
        wide: whether addresses have 64 bits.
    """
    mappings = _mappings(pid)
    program = ""
    with suppress(OSError):
        program = str(Path(f"/proc/{pid}/exe").readlink())
    size = 8 if wide else 4
    whole = len(stack) // size * size
    inner = ""
    for (word,) in struct.iter_unpack("<Q" if wide else "<I", stack[:whole]):
        for begin, end, offset, path in mappings:
            if begin < word < end:
                # In a container the file is below the root of that process.
                root = Path(f"/proc/{pid}/root{path}")
                name, address = _program(str(root if root.exists() else path)).at(
                    # A return address is behind the call, which may be the last of its function.
                    word - 1 - begin + offset
                )
                if path == program:
                    return Place(inner, name or f"{Path(path).name}+0x{address:x}")
                inner = name or inner
    return Place(inner, "")
