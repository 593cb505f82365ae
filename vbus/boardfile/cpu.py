"""``[cpu]``: the processor whose firmware ``vbus exec --cpu`` runs, and its memory."""

from typing import Annotated, Final

from vbus.boardfile.key import Section, row

FAMILIES: Final = ("stm32f1", "stm32f4")


class CpuSection(Section, frozen=True, kw_only=True):
    """``[cpu]``: clock, memory and peripherals of a processor that an emulator runs."""

    clock: Annotated[int, row("clock of the processor", "Hz", low=0)] = 0
    cycles: Annotated[int, row("clock cycles that each instruction takes", low=1, high=1000)] = 1
    access: Annotated[int, row(
        "clock cycles that each byte on the bus of its card takes on top",
        low=0, high=1000)] = 4  # fmt: skip
    family: Annotated[str, row(
        "whose peripherals a Cortex-M has; else stm32f1 with cortex-m3, stm32f4 with cortex-m4",
        choices=FAMILIES)] = ""  # fmt: skip
    rom: Annotated[int, row("where the program memory begins; 0: where it usually is", low=0)] = 0
    rom_size: Annotated[int, row("its size in bytes; 0: as usual", low=0, high=1 << 28)] = 0
    ram: Annotated[int, row("where the RAM begins; 0: where it usually is", low=0)] = 0
    ram_size: Annotated[int, row("its size in bytes; 0: as usual", low=0, high=1 << 28)] = 0
    vectors: Annotated[
        int, row("address of the vector table; 0: the beginning of the program memory", low=0)
    ] = 0
    uart: Annotated[
        int, row("address of the serial port (MC68681, channel A) of a 68000; 0: none", low=0)
    ] = 0
