"""A Cortex-M: exceptions, NVIC, SysTick and the debugger's console (semihosting)."""

import struct
from collections.abc import Callable
from typing import Final

from unicorn import arm_const as arm

from vbus.core import exit_codes
from vbus.cpu.machine import CpuMachine, IoRegister, Processor, RegisterBlock, Stopped, stored

HARD_FAULT, SVC, PENDSV, SYSTICK, IRQ = 3, 11, 14, 15, 16
_SWI, _BKPT, _RETURN = 2, 7, 8
"""What the emulator calls an SVC, a BKPT, and a return from an exception."""
_FAULTS: Final = {
    1: "an instruction that this processor does not know", 3: "a jump to where nothing is",
    4: "an access to where nothing is", 17: "an instruction of a coprocessor that is off",
    18: "a jump to code that is not Thumb",
}  # fmt: skip
_THUMB: Final = 1 << 24
_ALIGNED: Final = 1 << 9
_FRAME: Final = (
    arm.UC_ARM_REG_R0, arm.UC_ARM_REG_R1, arm.UC_ARM_REG_R2, arm.UC_ARM_REG_R3, arm.UC_ARM_REG_R12,
    arm.UC_ARM_REG_LR,
)  # fmt: skip
_SEMIHOSTING: Final = 0xAB
_PROCESS_STACK, _THREAD = 4, 8
"""Bits of EXC_RETURN."""


class CortexM(Processor):
    """The processor's own part: what waits, what is active, and the frames on the stack."""

    OPCODES = ((0xFFFC, 0xB660, 1), (0xFFF0, 0xF380, 1))  # CPSIE; MSR
    SPIN, WAKES_MASKED = b"\xfe\xe7", True
    PC, SP, RESULT = arm.UC_ARM_REG_PC, arm.UC_ARM_REG_SP, arm.UC_ARM_REG_R0

    def __init__(self, machine: CpuMachine) -> None:
        super().__init__(machine)
        self.pending: Final[set[int]] = set()
        self.standing: Final[set[tuple[int, object]]] = set()
        """Requests of peripherals that have not ended: an exception, and who asks for it."""
        self.active: Final[list[int]] = []
        self.enabled: Final[set[int]] = {HARD_FAULT, SVC, PENDSV, SYSTICK}
        self.priorities: Final[dict[int, int]] = {HARD_FAULT: -1}
        self.vectors = 0
        self.look: Callable[[], None] = lambda: None
        """Lets EXTI look at the pins."""
        self.groups = -2
        """The bits of a priority by which one exception interrupts another (PRIGROUP)."""

    def begin(self) -> None:
        """Stand at the reset vector.

        Raises:
            Stopped: the vector table cannot be one.
        """
        machine = self.machine
        machine.load()
        self.vectors = machine.section.vectors or machine.section.rom
        table = machine.peek(self.vectors, 8)
        stack, start = struct.unpack("<II", table or bytes(8))
        path, wrong = machine.image.path, ""
        if not machine.peek(stack - 4, 4) or stack % 4:
            wrong = f"its first word, the stack pointer, is {stack:08X}h, which is no end of RAM"
        elif not start & 1 or not machine.peek(start & ~1, 2):
            wrong = f"its second word, the reset handler, is {start:08X}h, which is no Thumb code"
        if wrong:
            raise Stopped(
                exit_codes.USAGE,
                f"{path}: no vector table at {self.vectors:08X}h: {wrong}; see the linker script,"
                " and vectors, rom and ram of [cpu]",
            )
        machine.set(self.SP, stack)
        machine.set(self.PC, start)
        machine.set(arm.UC_ARM_REG_LR, 0xFFFFFFFF)

    def where(self) -> int:
        """Return the address of the next instruction, with the bit that says Thumb."""
        return self.here() | 1

    # -- priorities ---------------------------------------------------------------------------

    def pend(self, number: int) -> None:
        """Let an exception wait."""
        self.pending.add(number)
        self.machine.look()

    def request(self, number: int, source: object, stands: bool) -> None:
        """Take the level of a peripheral's request; exception ``number`` comes while it stands."""
        if not stands:
            self.standing.discard((number, source))
        elif (number, source) not in self.standing:
            self.standing.add((number, source))
            self.pend(number)

    def stands(self, number: int) -> bool:
        """Whether a peripheral asks for an exception."""
        return any(one == number for one, _ in self.standing)

    def waiting(self) -> bool:
        """Whether an enabled exception waits."""
        return bool(self.pending & self.enabled)

    def wakes(self) -> bool:
        """Whether WFI is over: also if the exception is masked."""
        return self.waiting()

    def _priority(self, number: int) -> int:
        return self.priorities.get(number, 0)

    def _level(self) -> int:
        """The priority that an exception must be above (a smaller number) to come now."""
        level = min((self._priority(number) & self.groups for number in self.active), default=256)
        base = self.machine.get(arm.UC_ARM_REG_BASEPRI)
        if base:
            level = min(level, base & self.groups)
        if self.machine.get(arm.UC_ARM_REG_PRIMASK):
            level = min(level, 0)
        return -1 if self.machine.get(arm.UC_ARM_REG_FAULTMASK) else level

    def deaf(self) -> bool:
        """Whether PRIMASK or FAULTMASK is set."""
        masks = (arm.UC_ARM_REG_PRIMASK, arm.UC_ARM_REG_FAULTMASK)
        return any(self.machine.get(mask) for mask in masks)

    def enter(self) -> None:
        """Begin the most urgent exception that waits, if its priority allows."""
        # Of equal priorities the lowest number comes first (ARMv7-M).
        number = min(self.pending & self.enabled, key=lambda n: (self._priority(n), n))
        if self._priority(number) & self.groups < self._level():
            self._begin(number)

    def _begin(self, number: int) -> None:
        get, put = self.machine.get, self.machine.set
        self.pending.discard(number)
        xpsr = get(arm.UC_ARM_REG_XPSR)
        stack = get(self.SP)
        # Frames begin at multiples of 8; bit 9 of the saved xPSR says that 4 bytes were left out
        # for that (ARMv7-M).
        frame = (stack - 32) & ~7
        values = [get(register) for register in _FRAME]
        saved = (xpsr & ~_ALIGNED) | (_ALIGNED if (stack - 32) & 4 else 0) | _THUMB
        self.machine.push(frame, struct.pack("<8I", *values, self.here(), saved))
        # EXC_RETURN: F1h to a handler, F9h to a thread on the main stack, FDh on the process stack.
        back = 0xFFFFFFF1
        if not self.active:
            process = bool(get(arm.UC_ARM_REG_CONTROL) & 2)
            back |= _THREAD | (_PROCESS_STACK if process else 0)
        self.active.append(number)
        put(arm.UC_ARM_REG_XPSR, _THUMB | number)
        (handler,) = struct.unpack(
            "<I", self.machine.peek(self.vectors + 4 * number, 4) or bytes(4)
        )
        if not handler & 1:
            raise Stopped(
                exit_codes.FAILURE,
                f"exception {number}{_named(number)} comes, and its vector at"
                f" {self.vectors + 4 * number:08X}h is {handler:08X}h, which is no Thumb code",
            )
        put(arm.UC_ARM_REG_LR, back)
        put(self.PC, handler)

    def _end(self, back: int) -> None:
        """Return from an exception as EXC_RETURN says."""
        get, put = self.machine.get, self.machine.set
        number = self.active.pop() if self.active else 0
        # ARMv7-M: a request that still stands when its handler returns waits again.
        if self.stands(number):
            self.pending.add(number)
        put(arm.UC_ARM_REG_FAULTMASK, 0)
        put(arm.UC_ARM_REG_XPSR, _THUMB | (self.active[-1] if self.active else 0))
        if back & _THREAD:
            control = get(arm.UC_ARM_REG_CONTROL)
            put(arm.UC_ARM_REG_CONTROL, (control & ~2) | (2 if back & _PROCESS_STACK else 0))
        frame = get(self.SP)
        data = self.machine.peek(frame, 32)
        if not data or bool(back & _THREAD) == bool(self.active):
            raise Stopped(
                exit_codes.FAILURE,
                f"the return from exception {number}{_named(number)} has no frame on the stack"
                f" ({frame:08X}h, EXC_RETURN {back:08X}h)",
            )
        *values, where, xpsr = struct.unpack("<8I", data)
        for register, value in zip(_FRAME, values, strict=True):
            put(register, value)
        put(self.SP, frame + 32 + (4 if xpsr & _ALIGNED else 0))
        put(self.PC, where | 1)
        put(arm.UC_ARM_REG_XPSR, xpsr & ~_ALIGNED)

    # -- what instructions ask for --------------------------------------------------------------

    def trap(self, number: int) -> None:
        """Serve SVC, BKPT and returns; end the run at a fault.

        Raises:
            Stopped: the firmware has done what a processor cannot do, or has asked for the end.
        """
        machine, here = self.machine, self.here()
        if number == _RETURN or (number == 3 and here >= 0xFFFFFFE0):
            self._end(here | 1)
        elif number == _SWI:
            self.pend(SVC)
        elif number == _BKPT:
            if machine.peek(here, 2) != bytes((_SEMIHOSTING, 0xBE)):
                raise Stopped(
                    exit_codes.FAILURE, f"a breakpoint (BKPT) at {machine.image.place(here)}"
                )
            self._console()
            machine.set(self.PC, here + 2 | 1)
        else:
            what = _FAULTS.get(number, f"fault {number} of the emulator")
            raise Stopped(exit_codes.FAILURE, f"{what}, at {machine.image.place(here)}")

    def _console(self) -> None:
        """Do what a debugger does for semihosting: write, and end."""
        machine = self.machine
        what, where = (machine.get(n) for n in (arm.UC_ARM_REG_R0, arm.UC_ARM_REG_R1))
        answer = 0
        if what in (0x18, 0x20):  # SYS_EXIT, SYS_EXIT_EXTENDED
            reason, code = where, 0
            if what == 0x20:
                reason, code = struct.unpack("<II", machine.peek(where, 8) or bytes(8))
            raise Stopped(code & 0xFF if reason == 0x20026 else exit_codes.FAILURE)
        if what == 3:  # SYS_WRITEC
            machine.put(machine.peek(where, 1))
        elif what == 4:  # SYS_WRITE0
            text = bytearray()
            while (byte := machine.peek(where + len(text), 1)) not in (b"", b"\0"):
                text += byte
            machine.put(bytes(text))
        elif what == 5:  # SYS_WRITE
            _, start, size = struct.unpack("<III", machine.peek(where, 12) or bytes(12))
            machine.put(machine.peek(start, size))
        elif what in (1, 9):  # SYS_OPEN, SYS_ISTTY
            answer = 1
        elif what != 2:  # SYS_CLOSE
            answer = 0xFFFFFFFF
            machine.once(
                f"semihosting {what}",
                f"semihosting call {what:02X}h is not modelled: the answer is -1; at"
                f" {machine.at()}",
            )
        machine.set(arm.UC_ARM_REG_R0, answer)

    def levels(self) -> None:
        """Pass the look on to EXTI."""
        self.look()


def _named(number: int) -> str:
    if number >= IRQ:
        return f" (interrupt {number - IRQ})"
    names = {HARD_FAULT: "HardFault", SVC: "SVC", PENDSV: "PendSV", SYSTICK: "SysTick"}
    return f" ({names[number]})" if number in names else ""


class SystemControl(RegisterBlock):
    """SysTick, NVIC and the system control block, at E000E000h."""

    REGISTERS = (
        IoRegister("ICTR", 0x004, 1),
        IoRegister("ACTLR", 0x008),
        IoRegister("SYST_CSR", 0x010, 0, "SysTick on, its interrupt, COUNTFLAG", "csr", "put_csr"),
        IoRegister("SYST_RVR", 0x014, 0, "reload value", write="put_rvr"),
        IoRegister("SYST_CVR", 0x018, 0, "counts down; a write clears it", "cvr", "put_cvr"),
        IoRegister("SYST_CALIB", 0x01C),
        IoRegister("NVIC_ISER", 0x100, 0, "enable interrupts", "iser", "put_iser", 8),
        IoRegister("NVIC_ICER", 0x180, 0, "disable them", "iser", "put_icer", 8),
        IoRegister("NVIC_ISPR", 0x200, 0, "let them wait", "ispr", "put_ispr", 8),
        IoRegister("NVIC_ICPR", 0x280, 0, "forget them", "ispr", "put_icpr", 8),
        IoRegister("NVIC_IABR", 0x300, 0, "which are active", "iabr", count=8),
        IoRegister("NVIC_IPR", 0x400, 0, "priorities, a byte each", count=60),
        IoRegister("CPUID", 0xD00, 0x411FC231),
        IoRegister("ICSR", 0xD04, 0, "let PendSV and SysTick wait", "icsr", "put_icsr"),
        IoRegister("VTOR", 0xD08, 0, "address of the vector table", "vtor", "put_vtor"),
        IoRegister(
            "AIRCR", 0xD0C, 0xFA050000, "PRIGROUP; SYSRESETREQ ends the run", write="put_aircr"
        ),
        IoRegister("SCR", 0xD10),
        IoRegister("CCR", 0xD14, 0x200),
        IoRegister("SHPR", 0xD18, 0, "priorities of exceptions 4 to 15", count=3),
        *stored("SHCSR", "CFSR", "HFSR", "DFSR", "MMFAR", "BFAR", "AFSR", first=0xD24),
        IoRegister("CPACR", 0xD88, 0, "floating point on"),
        IoRegister("STIR", 0xF00, 0, "let an interrupt wait", write="put_stir"),
        IoRegister("FPCCR", 0xF34, 0xC0000000),
    )

    def __init__(
        self, machine: CpuMachine, name: str, base: int, processor: CortexM, m4: bool
    ) -> None:
        super().__init__(machine, name, base, {0x004: 2, 0xD00: 0x410FC241} if m4 else None)
        self._processor: Final = processor
        self._counter: Final = machine.counter(base + 0x18, 1, down=True)
        self._seen = 0
        """How often SysTick had come to 0 when COUNTFLAG was read last."""

    def write(self, offset: int, size: int, value: int) -> None:
        """Take what is written; priorities count at once."""
        super().write(offset, size, value)
        # STM32s have the upper four bits of a priority.
        for first, end, number in ((0x400, 0x4F0, IRQ), (0xD18, 0xD24, 4)):
            for place in range(offset, offset + size) if first <= offset < end else ():
                byte = self.values[place & ~3] >> 8 * (place & 3) & 0xF0
                self._processor.priorities[number + place - first] = byte
        self.machine.look()

    # -- SysTick ------------------------------------------------------------------------------

    def csr(self, _: int) -> int:
        """Control and status; a read clears COUNTFLAG."""
        control = self.of("SYST_CSR")
        count = self._counter.rounds(self.machine.shared.clock) if control & 1 else 0
        flag, self._seen = count > self._seen, count
        return control | flag << 16

    def put_csr(self, _: int, value: int) -> None:
        """Start, stop, and let it interrupt or not."""
        changed = (self.of("SYST_CSR") ^ value) & 5
        self.values[0x10] = value & 7
        if changed:
            self.put_cvr(0, 0)
        else:
            self._plan()

    def put_rvr(self, _: int, value: int) -> None:
        """Count from here, beginning now."""
        # SYST_RVR: the reload value has 24 bits.
        self.values[0x14] = value & 0xFFFFFF
        self.put_cvr(0, 0)

    def cvr(self, _: int) -> int:
        """The count of a timer that stands still."""
        return 0

    def put_cvr(self, _: int, __: int) -> None:
        """Begin again."""
        counter, control = self._counter, self.of("SYST_CSR")
        counter.on = bool(control & 1 and self.of("SYST_RVR"))
        # CLKSOURCE: the clock of the processor, or an eighth of it, as STM32s have it.
        counter.divider, counter.period = 1 if control & 4 else 8, self.of("SYST_RVR") + 1
        counter.zero, self._seen = self.machine.shared.clock, 0
        self._plan()

    def _plan(self) -> None:
        machine, counter = self.machine, self._counter
        machine.events.pop("SysTick", None)
        if counter.on and self.of("SYST_CSR") & 2:
            coming = counter.rounds(machine.shared.clock) + 1
            machine.events["SysTick"] = (counter.zero + coming * counter.round, self._tick)

    def _tick(self) -> None:
        self._processor.pend(SYSTICK)
        self._plan()

    # -- NVIC ---------------------------------------------------------------------------------

    @staticmethod
    def _numbers(place: int, bits: int) -> set[int]:
        return {IRQ + place * 8 + bit for bit in range(32) if bits >> bit & 1}

    @staticmethod
    def _bits(place: int, numbers: set[int]) -> int:
        first = IRQ + place * 8
        return sum(1 << n - first for n in numbers if 0 <= n - first < 32)

    def iser(self, place: int) -> int:
        """Which interrupts are enabled."""
        return self._bits(place, self._processor.enabled)

    def put_iser(self, place: int, value: int) -> None:
        """Enable some."""
        self._processor.enabled.update(self._numbers(place, value))

    def put_icer(self, place: int, value: int) -> None:
        """Disable some."""
        self._processor.enabled.difference_update(self._numbers(place, value))

    def ispr(self, place: int) -> int:
        """Which interrupts wait."""
        return self._bits(place, self._processor.pending)

    def put_ispr(self, place: int, value: int) -> None:
        """Let some wait."""
        self._processor.pending.update(self._numbers(place, value))

    def put_icpr(self, place: int, value: int) -> None:
        """Forget some."""
        processor = self._processor
        gone = {one for one in self._numbers(place, value) if not processor.stands(one)}
        processor.pending.difference_update(gone)

    def iabr(self, place: int) -> int:
        """Which interrupts are active."""
        return self._bits(place, set(self._processor.active))

    def put_stir(self, _: int, value: int) -> None:
        """Let one wait."""
        self._processor.pend(IRQ + (value & 0x1FF))

    # -- the system control block -----------------------------------------------------------------

    def icsr(self, _: int) -> int:
        """What waits and what is active."""
        processor = self._processor
        active = processor.active[-1] if processor.active else 0
        waits = min(processor.pending & processor.enabled, default=0)
        return (
            # VECTACTIVE, VECTPENDING, PENDSVSET, PENDSTSET.
            active | waits << 12 | (PENDSV in processor.pending) << 28
            | (SYSTICK in processor.pending) << 26
        )  # fmt: skip

    def put_icsr(self, _: int, value: int) -> None:
        """Let PendSV or SysTick wait, or forget it."""
        for bit, number, wait in ((28, PENDSV, True), (27, PENDSV, False), (26, SYSTICK, True),
                                  (25, SYSTICK, False)):  # fmt: skip
            if value >> bit & 1:
                (self._processor.pending.add if wait else self._processor.pending.discard)(number)

    def vtor(self, _: int) -> int:
        """Where the vector table is."""
        return self._processor.vectors

    def put_vtor(self, _: int, value: int) -> None:
        """Move the vector table; address 0 shows the program memory."""
        # VTOR: the table begins at a multiple of 128.
        self._processor.vectors = (value & ~0x7F) or self.machine.section.rom

    def put_aircr(self, _: int, value: int) -> None:
        """Split priorities; a request for a reset ends the run."""
        # VECTKEY: without it a write of AIRCR is ignored.
        if value >> 16 != 0x05FA:
            return
        self.values[0xD0C] = 0xFA050000 | value & 0x700
        self._processor.groups = -2 << (value >> 8 & 7)
        if value & 4:
            why = f"the firmware resets the processor (AIRCR), at {self.machine.at()}"
            raise Stopped(exit_codes.FAILURE, why)


class Trace(RegisterBlock):
    """DWT: the counter of clock cycles."""

    REGISTERS = (
        IoRegister("DWT_CTRL", 0x000, 0x40000000, "CYCCNTENA", write="control"),
        IoRegister("DWT_CYCCNT", 0x004, 0, "clock cycles", write="put_count"),
        *stored("DWT_CPICNT", "DWT_EXCCNT", "DWT_SLEEPCNT", "DWT_LSUCNT", first=0x008),
        IoRegister("DWT_LAR", 0xFB0),
    )

    def __init__(self, machine: CpuMachine, name: str, base: int) -> None:
        super().__init__(machine, name, base)
        self._counter: Final = machine.counter(base + 4, 1 << 32)

    def control(self, _: int, value: int) -> None:
        """Let it count."""
        self.values[0x00] = value
        self._counter.on = value & 1

    def put_count(self, _: int, value: int) -> None:
        """Set the counter."""
        self.values[0x04] = value
        self._counter.zero = self.machine.shared.clock - value
