"""The processors that there are: what each is to the emulator, and where its memory usually is."""

import ctypes
from collections.abc import Callable
from importlib import import_module
from typing import Final

from msgspec import Struct
from msgspec.structs import replace

from vbus.boardfile.sections import CpuSection
from vbus.cli.cpu.image import ARM, M68K, Image, read_dos, read_elf
from vbus.cli.cpu.machine import CpuMachine


class CpuSettings(Struct):
    """What ``vbus exec --cpu`` tells the program that runs an image.

    Attributes:
        processor: which one.
        cpu: its section of the board file, with the usual values where that says nothing.
        cycles: clock cycles after which the run ends; 0: none.
        until: what the firmware sends at the end.
        stats: whether the speed is printed at the end.
    """

    processor: str
    cpu: CpuSection
    cycles: int = 0
    until: str = ""
    stats: bool = False


class ProcessorKind(Struct, frozen=True):
    """A processor.

    Attributes:
        built: module of this package whose ``build`` makes one.
        arch: name of the emulator's architecture, behind ``UC_ARCH_``.
        modes: names of its modes, behind ``UC_MODE_``.
        model: name of its model, as the emulator has it; empty: the usual one.
        read: reads an image and says whether it is for this processor.
        memory: where program memory begins and its size, and the same of RAM.
        keys: those of ``[cpu]`` that not every processor has.
        family: whose peripherals it has, if the board file names none.
    """

    built: str
    arch: str
    modes: tuple[str, ...]
    model: str
    read: Callable[[str], Image]
    memory: tuple[int, int, int, int]
    keys: tuple[str, ...] = ()
    family: str = ""


def _arm(path: str) -> Image:
    return read_elf(path, ARM, "arm-none-eabi-gcc")


def _m68k(path: str) -> Image:
    return read_elf(path, M68K, "m68k-linux-gnu-gcc")


_VME: Final = (0, 0x40000, 0x100000, 0x40000)
_M: Final = (0x08000000, 0x100000, 0x20000000, 0x20000)
_MEMORY: Final = ("rom", "rom_size", "ram", "ram_size", "vectors")
_M_KEYS: Final = (*_MEMORY, "family")
_VME_KEYS: Final = (*_MEMORY, "uart")
PROCESSORS: Final = {
    "cortex-m3": ProcessorKind(
        "stm32", "ARM", ("THUMB", "MCLASS"), "CPU_ARM_CORTEX_M3", _arm, _M, _M_KEYS, "stm32f1"
    ),
    "cortex-m4": ProcessorKind(
        "stm32", "ARM", ("THUMB", "MCLASS"), "CPU_ARM_CORTEX_M4", _arm, _M, _M_KEYS, "stm32f4"
    ),
    "68000": ProcessorKind(
        "m68k", "M68K", ("BIG_ENDIAN",), "CPU_M68K_M68000", _m68k, _VME, _VME_KEYS, "68000"
    ),
    "68020": ProcessorKind(
        "m68k", "M68K", ("BIG_ENDIAN",), "CPU_M68K_M68020", _m68k, _VME, _VME_KEYS, "68020"
    ),
    "8086": ProcessorKind("pc", "X86", ("16",), "", read_dos, (0, 0, 0, 0)),
}


def with_defaults(kind: ProcessorKind, section: CpuSection) -> CpuSection:
    """Return a section in which everything has its usual value that the file leaves out."""
    rom, rom_size, ram, ram_size = kind.memory
    return replace(
        section,
        family=section.family or kind.family,
        rom=section.rom or rom,
        rom_size=section.rom_size or rom_size,
        ram=section.ram or ram,
        ram_size=section.ram_size or ram_size,
    )


def foreign(kind: ProcessorKind, section: CpuSection) -> list[str]:
    """Return the keys of a section that mean nothing to a processor."""
    keys = {*_M_KEYS, *_VME_KEYS} - set(kind.keys)
    return sorted(key for key in keys if getattr(section, key))


def machine_of(settings: CpuSettings, image: Image, native: ctypes.CDLL) -> CpuMachine:
    """Return a machine with its processor, memory, peripherals and image."""
    import unicorn

    kind = PROCESSORS[settings.processor]
    names = import_module(f"unicorn.{kind.arch.lower()}_const")
    mode = sum(getattr(unicorn, f"UC_MODE_{name}") for name in kind.modes)
    model = getattr(names, f"UC_{kind.model}") if kind.model else None
    arch = getattr(unicorn, f"UC_ARCH_{kind.arch}")
    machine = CpuMachine(native, settings.cpu, arch, mode, model, settings.cycles, settings.until)
    machine.image = image
    import_module(f"vbus.cli.cpu.{kind.built}").build(machine)
    return machine
