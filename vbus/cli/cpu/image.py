"""Firmware images: what is in an ELF file, and whether it is for the processor."""

from bisect import bisect_right
from pathlib import Path
from typing import Final

from msgspec import Struct

from vbus.core.elf import LOADED, MAGIC, Elf
from vbus.core.errors import ProgramError
from vbus.core.file_kinds import HEAD, is_none, unreadable

ARM, M68K = 40, 4
_MACHINES: Final = {
    2: "a SPARC", 3: "an 80386", M68K: "a 68000", 8: "a MIPS", 20: "a PowerPC", ARM: "an ARM",
    62: "a PC (x86-64)", 70: "a 68HC11", 83: "an AVR", 183: "an ARM of 64 bits", 243: "a RISC-V",
}  # fmt: skip
_UNKNOWN: Final = 0x1000
"""How far a function may reach at most whose size is not known."""


class Image(Struct):
    """What an image has in it.

    Attributes:
        path: the file.
        entry: address of the first instruction.
        segments: where each part is loaded, and its bytes.
        end: address behind the data of the program in RAM, or 0.
        places: addresses of functions, in order.
        names: their names.
        sizes: their sizes in bytes; 0 where it is not known.
    """

    path: str
    entry: int
    segments: list[tuple[int, bytes]]
    end: int
    places: list[int]
    names: list[str]
    sizes: list[int]

    def place(self, address: int) -> str:
        """Return an address, and where it is in the program if that is known."""
        at = bisect_right(self.places, address) - 1
        beyond = address - self.places[at] if at >= 0 else address
        if at < 0 or beyond >= (self.sizes[at] or _UNKNOWN):
            return f"{address:08X}h"
        return f"{address:08X}h ({self.names[at]}{f'+{beyond:X}h' if beyond else ''})"


def read_file(path: str) -> bytes:
    """Return what is in an image.

    Raises:
        ProgramError: it cannot be read.
    """
    try:
        return Path(path).read_bytes()
    except OSError as error:
        missing = isinstance(error, FileNotFoundError)
        raise ProgramError(f"{path}: {unreadable(path, error)}", missing) from None


def read_elf(path: str, machine: int, compiler: str) -> Image:
    """Read an ELF image of 32 bits.

    Args:
        path: the file.
        machine: number of the processor in the file's head.
        compiler: what makes such images.

    Raises:
        ProgramError: it cannot be read, is none, or is for another processor.
    """
    data = read_file(path)
    wanted = f"firmware image (ELF) for {_MACHINES[machine]}"
    if not data.startswith(MAGIC) or len(data) < 52:
        made = f"{compiler} links one (a .hex or .bin file lacks the names)"
        raise ProgramError(is_none(path, data[:HEAD], wanted, made), False)
    program = Elf(data)
    if program.machine != machine or program.wide:
        other = _MACHINES.get(program.machine, f"machine {program.machine}")
        raise ProgramError(
            f"{path}: an image for {other}; this processor is {_MACHINES[machine]}; link it by"
            f" {compiler}, or name the processor of the image with --cpu",
            False,
        )
    try:
        return _read(path, program)
    except ValueError:
        raise ProgramError(f"{path}: this ELF file is damaged; link it again", False) from None


def _read(path: str, program: Elf) -> Image:
    segments, end = [], 0
    for one in program.segments():
        if one.kind != LOADED:
            continue
        if one.size:
            segments.append((one.physical, program.data[one.offset : one.offset + one.size]))
        if one.virtual != one.physical or one.memory > one.size:
            end = max(end, one.virtual + one.memory)
    functions: dict[int, tuple[str, int]] = {}
    for name, value, size in program.functions():
        functions.setdefault(value & ~1, (name, size))  # bit 0 says Thumb
    places = sorted(functions)
    return Image(
        path, program.entry, segments, end, places, [functions[at][0] for at in places],
        [functions[at][1] for at in places],
    )  # fmt: skip


def read_dos(path: str) -> Image:
    """Read a .COM or .EXE file; where it is loaded is decided later.

    Raises:
        ProgramError: it cannot be read, or is none.
    """
    data = read_file(path)
    exe, second = data[:2] == b"MZ", int.from_bytes(data[0x3C:0x40], "little")
    if exe and second and data[second : second + 2] in (b"PE", b"NE", b"LE"):
        raise ProgramError(f"{path}: a program for Windows, and this is DOS", False)
    if data[:4] == MAGIC or not data or (len(data) < 28 if exe else len(data) > 0xFE00):
        made = "nasm -f bin or bcc makes one"
        raise ProgramError(is_none(path, data[:HEAD], "DOS program (.COM or .EXE)", made), False)
    return Image(path, 0, [(0, data)], 0, [], [], [])
