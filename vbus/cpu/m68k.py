"""A 68000 or 68020: exceptions, autovectored interrupts, and a serial port (MC68681)."""

import struct
from typing import Final

from unicorn import m68k_const as m68k

from vbus.core import exit_codes
from vbus.cpu.machine import INTERRUPTS, CpuMachine, IoRegister, Processor, RegisterBlock, Stopped

_SUPERVISOR, _TRACES, _MASK = 0x2000, 0xC000, 0x0700
_AUTOVECTOR: Final = 24
_RETURN: Final = 256
"""What the emulator calls RTE."""
_NAMES: Final = {
    4: "an illegal instruction", 5: "a division by zero", 6: "CHK", 7: "TRAPV",
    8: "a privileged instruction", 10: "an instruction of line A", 11: "an instruction of line F",
}  # fmt: skip


class M68000(Processor):
    """The processor: seven interrupt inputs, IRQ1 to IRQ7, each as long as its wire is high."""

    OPCODES = (
        (0xFFC0, 0x46C0, 1),
        (0xFFFF, 0x027C, 1),
        (0xFFFF, 0x0A7C, 1),
        (0xFFFF, 0x4E72, 1),
    )  # fmt: skip  MOVE, ANDI, EORI to SR; STOP
    SPIN = b"\x60\xfe"
    PC, SP, RESULT = m68k.UC_M68K_REG_PC, m68k.UC_M68K_REG_A7, m68k.UC_M68K_REG_D0

    def __init__(self, machine: CpuMachine, format_word: bool) -> None:
        super().__init__(machine)
        self._format_word: Final = format_word
        self._level = 0
        self._edge = False
        """Level 7 cannot be masked, and comes once for each edge."""

    def begin(self) -> None:
        """Stand at the reset vector.

        Raises:
            Stopped: the vector table cannot be one.
        """
        machine = self.machine
        machine.load()
        table = machine.peek(machine.section.vectors, 8)
        stack, start = struct.unpack(">II", table or bytes(8))
        if not machine.peek(stack - 4, 4) or stack & 1 or start & 1 or not machine.peek(start, 2):
            raise Stopped(
                exit_codes.USAGE,
                f"{machine.image.path}: no vector table at {machine.section.vectors:08X}h: stack"
                f" pointer {stack:08X}h, first instruction {start:08X}h; see the linker script, and"
                " vectors, rom and ram of [cpu]",
            )
        # A reset masks all levels but 7, in supervisor state.
        machine.set(m68k.UC_M68K_REG_SR, _SUPERVISOR | _MASK)
        machine.set(self.SP, stack)
        machine.set(self.PC, start)

    def levels(self) -> None:
        """Take the most urgent level that is asked for."""
        levels = self.machine.wired_levels(INTERRUPTS) & 0xFE
        level = levels.bit_length() - 1 if levels else 0
        self._edge = level == 7 and (self._edge or self._level != 7)
        self._level = level
        self.machine.look()

    def _masked(self) -> int:
        return int(self.machine.get(m68k.UC_M68K_REG_SR)) >> 8 & 7

    def waiting(self) -> bool:
        """Whether an interrupt is asked for."""
        return self._edge or 0 < self._level < 7

    def wakes(self) -> bool:
        """Whether STOP is over."""
        return self._edge or self._level > self._masked()

    def deaf(self) -> bool:
        """Whether all levels but 7 are masked."""
        return self._masked() == 7

    def enter(self) -> None:
        """Begin the interrupt, if it is above the mask."""
        if self.wakes():
            self._edge = False
            self._begin(_AUTOVECTOR + self._level, self.here(), self._level)

    def _begin(self, number: int, back: int, level: int | None = None) -> None:
        machine = self.machine
        place = machine.section.vectors + 4 * number
        (handler,) = struct.unpack(">I", machine.peek(place, 4) or bytes(4))
        if handler & 1 or not handler or not machine.peek(handler, 2):
            what = _NAMES.get(number, f"exception {number}")
            raise Stopped(
                exit_codes.FAILURE,
                f"{what} comes at {machine.at()}, and its vector at"
                f" {place:08X}h is {handler:08X}h, where no instruction is",
            )
        status = machine.get(m68k.UC_M68K_REG_SR)
        now = (status & ~_TRACES) | _SUPERVISOR
        if level is not None:
            now = (now & ~_MASK) | level << 8
        machine.set(m68k.UC_M68K_REG_SR, now)
        frame = struct.pack(">HI", status, back)
        # From the 68010 on a frame ends with a format, 0 here, and the offset of its vector.
        if self._format_word:
            frame += struct.pack(">H", 4 * number)
        machine.push(machine.get(self.SP) - len(frame), frame)
        machine.set(self.PC, handler)

    def trap(self, number: int) -> None:
        """Return from an exception, or begin one."""
        machine = self.machine
        if number != _RETURN:
            # TRAP #n: the frame has the address of the instruction behind it.
            self._begin(number, self.here() + (2 if number >= 32 else 0))
            return
        stack = machine.get(self.SP)
        size = 8 if self._format_word else 6
        status, back = struct.unpack(">HI", machine.peek(stack, size)[:6] or bytes(6))
        machine.set(self.SP, stack + size)
        machine.set(m68k.UC_M68K_REG_SR, status)
        machine.set(self.PC, back)


class Duart(RegisterBlock):
    """MC68681, channel A: what is sent goes to stdout at once, and nothing is received."""

    SIZE = 2
    REGISTERS = (
        IoRegister("MRA", 0), IoRegister("SRA", 2, 0x0C, "TxRDY and TxEMT are 1", write="nothing"),
        IoRegister("CRA", 4), IoRegister("TBA", 6, 0, "the byte to send", write="send"),
        IoRegister("ACR", 8), IoRegister("IMR", 10), IoRegister("CTUR", 12), IoRegister("CTLR", 14),
        IoRegister("IVR", 24, 0x0F), IoRegister("OPCR", 26), IoRegister("SOPBC", 28),
        IoRegister("ROPBC", 30),
    )  # fmt: skip

    def send(self, _: int, value: int) -> None:
        """Send a byte."""
        self.machine.put(bytes((value & 0xFF,)))


def build(machine: CpuMachine) -> None:
    """Make a computer with a 68000 of a machine."""
    section = machine.section
    machine.shared.big_endian = True
    machine.processor = M68000(machine, section.family == "68020")
    machine.has_ports(range(INTERRUPTS, INTERRUPTS + 1), "IRQ1 to IRQ7")
    machine.memory(section.rom, section.rom_size, False)
    machine.memory(section.ram, section.ram_size, True)
    machine.card_windows(1 << 32)
    if section.uart:
        machine.add(Duart(machine, "DUART", section.uart))
        machine.window(section.uart & ~0xFFF, 0x1000)
