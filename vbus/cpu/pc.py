"""A PC with an 8086 and DOS: ports, interrupt controller, timer, and what programs ask of DOS.

Each BIOS and DOS service has a stub in ROM from F000:0000h on, eight bytes apart: it calls the
interrupt it is for from there, which is served here. So a program may replace a vector, and chain
to the old one.
"""

import struct
from collections.abc import Callable
from datetime import datetime, timedelta
from typing import Final

from unicorn import x86_const as x86

from vbus.core import exit_codes
from vbus.cpu.machine import INTERRUPTS, CpuMachine, Processor, Stopped

_STUBS, _STUB = 0xF000, 8
_PSP, _TOP = 0x0100, 0x9FFF
"""Segments: where a program is loaded, and where its memory ends."""
_ENABLED, _CARRY, _ZERO = 0x0200, 0x0001, 0x0040
# The timer's clock is 14.31818 MHz, divided by 12.
_TICKS, _TIMER_HZ, _DAY = 0x46C, 1193182, 0x1800B0
_ORDER: Final[tuple[int, ...]] = (0, 1, *range(8, 16), *range(3, 8))
"""Lines of the interrupt controllers, the most urgent first."""
_EPOCH: Final = datetime(1990, 1, 1)
_SEGMENTS: Final = (x86.UC_X86_REG_DS, x86.UC_X86_REG_ES, x86.UC_X86_REG_SS, x86.UC_X86_REG_CS)


class Pc(Processor):
    """The processor, an 8259 (IRQ 0 to 7) and a second (8 to 15), an 8254, and DOS."""

    OPCODES = ((0xFF, 0xFB, 2), (0xFF, 0x9D, 1), (0xFF, 0xCF, 1))  # STI; POPF; IRET
    SPIN = b"\xeb\xfe"
    PC, SP, RESULT = x86.UC_X86_REG_IP, x86.UC_X86_REG_SP, x86.UC_X86_REG_AX

    def __init__(self, machine: CpuMachine) -> None:
        super().__init__(machine)
        self._request: int = 0
        self._service: int = 0
        self._levels: int = 0
        self._mask: int = 0xFFB8
        """Lines are off that nothing of the PC's own is on."""
        self._floor = 0
        """The last stack pointer that is right, in the segment that the program began with."""
        self._stack = 0
        self._divisor, self._half, self._zero = 0x10000, -1, 0
        self._latch: list[int] = []
        self._services: Final[dict[int, Callable[[], None]]] = {
            0x08: self._tick, 0x10: self._screen, 0x16: self._keyboard, 0x1A: self._clock,
            0x20: self._quit, 0x21: self._dos,
        }  # fmt: skip

    def here(self) -> int:
        """Return the address of the next instruction: CS and IP."""
        return int(self._get(x86.UC_X86_REG_CS) << 4) + int(self._get(x86.UC_X86_REG_IP))

    def _get(self, register: int) -> int:
        return int(self.machine.get(register))

    # -- the program ----------------------------------------------------------------------------

    def begin(self) -> None:
        """Set vectors and stubs up, load the program, and stand before its first instruction.

        Raises:
            Stopped: it does not fit.
        """
        machine = self.machine
        for number in range(256):
            stub = _STUB * number
            machine.poke(4 * number, struct.pack("<HH", stub, _STUBS))
            code = bytes((0xCD, number, 0xCF))
            if number == 8:
                code = bytes((0xCD, 0x08, 0xCD, 0x1C, 0xCF))
            elif number not in self._services:
                code = bytes((0xCF,)) if number == 0x1C else code
            machine.poke((_STUBS << 4) + stub, code)
        self._plan()
        data = machine.image.segments[0][1]
        ip, cs, sp, ss, base = 0x100, _PSP, 0xFFFE, _PSP, _PSP + 0x10
        if data[:2] == b"MZ":
            last, pages, count, head, _, _, ss, sp, _, ip, cs, table = struct.unpack_from(
                "<12H", data, 2
            )
            size = pages * 512 - (512 - last if last else 0)
            load = bytearray(data[head * 16 : size])
            for place in range(table, table + 4 * count, 4):
                offset, segment = struct.unpack_from("<HH", data, place)
                at = segment * 16 + offset
                value = struct.unpack_from("<H", load, at)[0] + base
                struct.pack_into("<H", load, at, value & 0xFFFF)
            data, cs, ss = bytes(load), cs + base, ss + base
        if base * 16 + len(data) > _TOP << 4:
            raise Stopped(exit_codes.USAGE, f"{machine.image.path}: too large for 640 KiB")
        machine.poke(base << 4, data)
        self._stack, self._floor = ss, max(0, (base << 4) + len(data) - (ss << 4))
        machine.poke(_PSP << 4, b"\xcd\x20" + struct.pack("<H", _TOP) + bytes(124) + b"\0\r")
        for register, value in zip(_SEGMENTS, (_PSP, _PSP, ss, cs), strict=True):
            machine.set(register, value)
        machine.set(self.SP, sp)
        machine.poke((ss << 4) + sp, bytes(2))
        machine.set(self.PC, ip)
        machine.set(x86.UC_X86_REG_EFLAGS, 2 | _ENABLED)

    # -- interrupts -------------------------------------------------------------------------------

    def levels(self) -> None:
        """Notice edges at IRQ 0 to 15."""
        levels = self.machine.wired_levels(INTERRUPTS)
        # The 8259 of a PC notices edges; a request goes with its line if it is not served before.
        self._request &= ~(self._levels & ~levels)
        self._raise(levels & ~self._levels)
        self._levels = levels

    def _raise(self, lines: int) -> None:
        self._request |= lines
        self.machine.look()

    def _next(self) -> int:
        """The line that may interrupt the one in service; -1: none."""
        for line in _ORDER:
            if self._service >> line & 1:
                return -1
            if (self._request & ~self._mask) >> line & 1 and not (line > 7 and self._mask & 4):
                return line
        return -1

    def waiting(self) -> bool:
        """Whether a line may interrupt."""
        return self._next() >= 0

    def wakes(self) -> bool:
        """Whether HLT is over."""
        return self.waiting() and not self.deaf()

    def deaf(self) -> bool:
        """Whether interrupts are off."""
        return not self._get(x86.UC_X86_REG_EFLAGS) & _ENABLED

    def enter(self) -> None:
        """Begin the interrupt of the most urgent line, if interrupts are on."""
        if not self.deaf():
            line = self._next()
            self._request &= ~(1 << line)
            self._service |= 1 << line
            # IRQ 0 to 7 are interrupts 08h to 0Fh, IRQ 8 to 15 are 70h to 77h.
            self._begin(line + (8 if line < 8 else 0x68))

    def _begin(self, number: int) -> None:
        machine = self.machine
        flags, stack = self._get(x86.UC_X86_REG_EFLAGS), (self._get(self.SP) - 6) & 0xFFFF
        place = (self._get(x86.UC_X86_REG_SS) << 4) + stack
        frame = self._get(self.PC), self._get(x86.UC_X86_REG_CS), flags & 0xFFFF
        if place >> 4 < 0x60 or (self._get(x86.UC_X86_REG_SS) == self._stack
                                 and stack < self._floor):  # fmt: skip
            raise Stopped(
                exit_codes.FAILURE,
                f"stack overflow: SP is {stack:04X}h, and the program is there; the instruction"
                f" at {machine.at()}",
            )
        machine.poke(place, struct.pack("<HHH", *frame))
        machine.set(self.SP, stack)
        ip, cs = struct.unpack("<HH", machine.peek(4 * number, 4))
        machine.set(x86.UC_X86_REG_EFLAGS, flags & ~0x0300)
        machine.set(x86.UC_X86_REG_CS, cs)
        machine.set(self.PC, ip)

    def trap(self, number: int) -> None:
        """Follow a vector; from a stub, do what that is for."""
        cs, ip = self._get(x86.UC_X86_REG_CS), self._get(self.PC)
        if cs != _STUBS or ip != _STUB * number + 2:
            self._begin(number)
        elif number in self._services:
            self._services[number]()
        elif 0x08 <= number < 0x10 or 0x70 <= number < 0x78:
            self._ends(number - 8 if number < 0x10 else number - 0x68)
        else:
            stack = (self._get(x86.UC_X86_REG_SS) << 4) + self._get(self.SP)
            back, segment = struct.unpack("<HH", self.machine.peek(stack, 4) or bytes(4))
            what = {0: "a division by zero", 6: "an illegal instruction"}.get(number)
            at = f"{segment:04X}:{back:04X}"
            if what:
                raise Stopped(exit_codes.FAILURE, f"{what}, at {at}")
            self.machine.once(
                f"int {number}", f"interrupt {number:02X}h is not modelled: it returns; at {at}"
            )

    def _ends(self, line: int) -> None:
        self._service &= ~(1 << line)

    def _flag(self, bit: int, on: bool) -> None:
        """Set a flag that the caller of a service gets."""
        place = (self._get(x86.UC_X86_REG_SS) << 4) + self._get(self.SP) + 4
        (flags,) = struct.unpack("<H", self.machine.peek(place, 2))
        self.machine.poke(place, struct.pack("<H", flags | bit if on else flags & ~bit))

    # -- ports ------------------------------------------------------------------------------------

    def port_in(self, _: object, port: int, size: int, __: object) -> int:
        """Read a port: of the interrupt controllers, of the timer, of the card."""
        if port in (0x21, 0xA1):
            return self._mask >> (8 if port == 0xA1 else 0) & 0xFF
        if port in (0x20, 0xA0):
            return self._request >> (8 if port == 0xA0 else 0) & 0xFF
        if port == 0x40:
            if not self._latch:
                self._latch = list(self._count().to_bytes(2, "little"))
            return self._latch.pop(0)
        if port in (0x61, 0x80):
            return 0
        return int(self.machine.native.cpu_card_read(port, size))

    def port_out(self, _: object, port: int, size: int, value: int, __: object) -> None:
        """Write a port."""
        shift = 8 if port >= 0xA0 else 0
        if port in (0x21, 0xA1):
            self._mask = (self._mask & ~(0xFF << shift)) | (value & 0xFF) << shift
        elif port in (0x20, 0xA0):
            # OCW2: 60h + n ends line n, 20h the most urgent of those in service.
            if value & 0xE0 == 0x60:
                self._ends((value & 7) + shift)
            elif value & 0xE0 == 0x20:
                mine = self._service >> shift & 0xFF
                self._service &= ~((mine & -mine) << shift)
        elif port == 0x43:
            self._half = -1
            # Below 10h: the command that latches counter 0.
            self._latch = list(self._count().to_bytes(2, "little")) if value < 0x10 else []
        elif port == 0x40:
            if self._half < 0:
                self._half = value & 0xFF
            else:
                self._divisor = (value << 8 | self._half) & 0xFFFF or 0x10000
                self._half, self._zero = -1, int(self.machine.shared.clock)
                self._plan()
        elif port not in (0x42, 0x61, 0x80):
            self.machine.native.cpu_card_write(port, size, value)
        self.machine.look()

    def _counts(self) -> int:
        """Counts of the timer since it was set."""
        passed = int(self.machine.shared.clock) - self._zero
        return passed * _TIMER_HZ // self.machine.section.clock

    def _count(self) -> int:
        return (self._divisor - self._counts() % self._divisor) & 0xFFFF

    def _plan(self) -> None:
        """Let IRQ 0 come when the timer is 0 next."""
        counts = (self._counts() // self._divisor + 1) * self._divisor
        when = self._zero - (-counts * self.machine.section.clock // _TIMER_HZ)
        self.machine.events["timer"] = (when, self._zero_count)

    def _zero_count(self) -> None:
        self._raise(1)
        self._plan()

    # -- BIOS -------------------------------------------------------------------------------------

    def _tick(self) -> None:
        (ticks,) = struct.unpack("<I", self.machine.peek(_TICKS, 4))
        self.machine.poke(_TICKS, struct.pack("<I", (ticks + 1) % _DAY))
        self._ends(0)

    def _screen(self) -> None:
        if self._get(x86.UC_X86_REG_AH) == 0x0E:
            self._write(bytes((self._get(x86.UC_X86_REG_AL),)))
        else:
            self._lacks("10h")

    def _keyboard(self) -> None:
        self._flag(_ZERO, True)  # no key

    def _clock(self) -> None:
        if self._get(x86.UC_X86_REG_AH) == 0:
            low, high = struct.unpack("<HH", self.machine.peek(_TICKS, 4))
            self._put(AX=0, CX=high, DX=low)
        else:
            self._lacks("1Ah")

    def _lacks(self, interrupt: str) -> None:
        function = self._get(x86.UC_X86_REG_AH)
        text = f"function {function:02X}h of int {interrupt} is not modelled: it does nothing"
        self.machine.once(f"{interrupt} {function}", text)

    # -- DOS --------------------------------------------------------------------------------------

    def _put(self, **values: int) -> None:
        for name, value in values.items():
            self.machine.set(getattr(x86, f"UC_X86_REG_{name}"), value)

    def _write(self, data: bytes) -> None:
        self.machine.put(data.replace(b"\r", b""))

    def _quit(self) -> None:
        raise Stopped(exit_codes.OK)

    def _text(self, end: bytes) -> bytes:
        text, at = bytearray(), (self._get(x86.UC_X86_REG_DS) << 4) + self._get(x86.UC_X86_REG_DX)
        while (byte := self.machine.peek(at + len(text), 1)) not in (end, b""):
            text += byte
        return bytes(text)

    def _dos(self) -> None:
        """Serve int 21h: output, vectors, time, memory, and the end."""
        machine = self.machine
        function, low = self._get(x86.UC_X86_REG_AH), self._get(x86.UC_X86_REG_AL)
        if function in (0x00, 0x4C):
            raise Stopped(low if function else exit_codes.OK)
        if function in (0x02, 0x06) and self._get(x86.UC_X86_REG_DL) != 0xFF:
            self._write(bytes((self._get(x86.UC_X86_REG_DL),)))
        elif function == 0x06:
            self._flag(_ZERO, True)  # no key
        elif function == 0x09:
            self._write(self._text(b"$"))
        elif function == 0x40:
            at = (self._get(x86.UC_X86_REG_DS) << 4) + self._get(x86.UC_X86_REG_DX)
            size = self._get(x86.UC_X86_REG_CX)
            self._write(machine.peek(at, size))
            self._put(AX=size)
        elif function == 0x25:
            vector = self._get(x86.UC_X86_REG_DX), self._get(x86.UC_X86_REG_DS)
            machine.poke(4 * low, struct.pack("<HH", *vector))
        elif function == 0x35:
            offset, segment = struct.unpack("<HH", machine.peek(4 * low, 4))
            self._put(BX=offset, ES=segment)
        elif function in (0x2A, 0x2C):
            now = _EPOCH + timedelta(seconds=int(machine.shared.clock) / machine.section.clock)
            if function == 0x2A:
                weekday = now.isoweekday() % 7
                self._put(CX=now.year, DX=now.month << 8 | now.day, AL=weekday)
            else:
                fraction = now.second << 8 | now.microsecond // 10_000
                self._put(CX=now.hour << 8 | now.minute, DX=fraction)
        elif function == 0x30:
            self._put(AX=0x0005, BX=0, CX=0)
        elif function == 0x0B:
            self._put(AL=0)
        elif function not in (0x4A, 0x0C):
            text = f"function {function:02X}h of DOS is not modelled: it fails"
            machine.once(f"21 {function}", text)
            self._put(AX=1)
        self._flag(_CARRY, function not in _SERVED)


_SERVED: Final = (0x02, 0x06, 0x09, 0x0B, 0x0C, 0x25, 0x2A, 0x2C, 0x30, 0x35, 0x40, 0x4A)


def build(machine: CpuMachine) -> None:
    """Make a PC of a machine."""
    from unicorn.unicorn_const import UC_HOOK_INSN

    processor = Pc(machine)
    machine.processor = processor
    machine.has_ports(range(INTERRUPTS, INTERRUPTS + 1), "IRQ0 to IRQ15")
    machine.memory(0, 0x100000, True)
    hook = machine.engine.hook_add
    guarded = machine.guarded
    hook(UC_HOOK_INSN, guarded(processor.port_in), None, 1, 0, x86.UC_X86_INS_IN)
    hook(UC_HOOK_INSN, guarded(processor.port_out), None, 1, 0, x86.UC_X86_INS_OUT)
