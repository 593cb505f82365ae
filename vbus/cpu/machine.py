"""A processor in an emulator as a host: its time, its memory, its bus, and the end of its run.

The emulator is unicorn. What happens at each instruction, port bit and bus cycle is C
(``vbus/native/cpu_link.c``); what is rare is here. Time is counted in clock cycles; everything that
comes at an instant stands in ``events``, and the emulator stops before the instruction at which the
next of them is due. Registers of peripherals are tables: what firmware finds at their addresses.
"""

import ctypes
import os
import sys
from abc import ABC, abstractmethod
from collections.abc import Callable, Mapping
from time import perf_counter
from typing import Any, ClassVar, Final

from msgspec import Struct

from vbus.boardfile.sections import CpuSection
from vbus.core import exit_codes
from vbus.cpu.image import Image

SLICE: Final = 100_000
"""Instructions after which the emulator stops at the latest, to look for the end: some 5 ms."""
NEVER: Final = (1 << 64) - 1
_PAGE: Final = 0x1000
_NEAR: Final = 0x400
"""An access so near the stack pointer is one of the stack."""
# Ports A to L, and one for interrupt inputs; 14 timers of an F4, SysTick and DWT count: the sizes
# of both arrays in ``struct cpu`` of cpu_link.c.
_PORTS: Final = 13
_COUNTERS: Final = 24
INTERRUPTS: Final = 12
"""The port that interrupt inputs of a processor without ports are to the pin decoder."""


class PortBits(ctypes.Structure):
    """What cpu_link.c has of a port: see ``struct cpu_port``."""

    _fields_ = [(name, ctypes.c_uint32) for name in (
        "base", "number", "input", "output", "set", "reset", "level", "drive", "open", "pulled",
        "pull", "off",
    )]  # fmt: skip


class Counter(ctypes.Structure):
    """What cpu_link.c has of a register that counts: see ``struct cpu_counter``."""

    _fields_ = [
        ("address", ctypes.c_uint32), ("on", ctypes.c_uint32), ("zero", ctypes.c_uint64),
        ("divider", ctypes.c_uint64), ("period", ctypes.c_uint64), ("down", ctypes.c_uint64),
    ]  # fmt: skip

    @property
    def round(self) -> int:
        """Clock cycles from one beginning of the count to the next."""
        return int(self.divider) * int(self.period)

    def rounds(self, clock: int) -> int:
        """Return how often it has begun again."""
        return (clock - int(self.zero)) // self.round

    def now(self, clock: int) -> int:
        """Return the count."""
        count = (clock - int(self.zero)) // int(self.divider) % int(self.period)
        return int(self.period) - count if self.down and count else count


class _Opcode(ctypes.Structure):
    _fields_ = [(name, ctypes.c_uint32) for name in ("mask", "value", "after")]


class _Memory(ctypes.Structure):
    _fields_ = [("start", ctypes.c_uint64), ("size", ctypes.c_uint64), ("bytes", ctypes.c_void_p)]


class _Window(ctypes.Structure):
    _fields_ = [("base", ctypes.c_uint64), ("card", ctypes.c_uint32)]


_READ: Final = ctypes.CFUNCTYPE(ctypes.c_uint64, ctypes.c_uint64, ctypes.c_uint32)
_WRITE: Final = ctypes.CFUNCTYPE(None, ctypes.c_uint64, ctypes.c_uint32, ctypes.c_uint64)
_UNCLAIMED: Final = ctypes.CFUNCTYPE(None, ctypes.c_uint64, ctypes.c_uint32)


class _NativeCpu(ctypes.Structure):
    """``struct cpu`` of cpu_link.c."""

    _fields_ = [
        *((name, ctypes.c_uint64) for name in ("clock", "due", "step", "access", "frequency")),
        ("stop", ctypes.c_void_p),
        ("read", _READ),
        ("write", _WRITE),
        ("unclaimed", _UNCLAIMED),
        *((name, ctypes.c_uint32) for name in ("masked", "moved", "big_endian", "port_count")),
        ("counter_count", ctypes.c_uint32),
        ("error", ctypes.c_int32),
        ("memories", _Memory * 4),
        ("opcodes", _Opcode * 8),
        ("ports", ctypes.POINTER(PortBits) * _PORTS),
        ("counters", ctypes.POINTER(Counter) * _COUNTERS),
    ]


class Stopped(Exception):
    """The run is over.

    Args:
        code: exit code.
        why: a sentence for stderr; empty if that is as it should be.
    """

    def __init__(self, code: int, why: str = "") -> None:
        super().__init__(why)
        self.code: Final = code


class Processor(ABC):
    """What one kind of processor adds to a machine.

    Args:
        machine: what it is part of.

    Attributes:
        OPCODES: instructions that may let a masked interrupt in: mask, value, and after how many
            instructions it comes.
        PC: the emulator's number of the program counter.
        SPIN: an instruction that jumps to itself, as bytes.
        WAKES_MASKED: an interrupt that is masked ends the instruction that waits, too.
        RESULT: the emulator's number of the register that has the exit code at the end.
    """

    OPCODES: ClassVar[tuple[tuple[int, int, int], ...]] = ()
    SPIN: ClassVar[bytes] = b""
    WAKES_MASKED: ClassVar[bool] = False
    PC: int
    SP: int
    RESULT: int

    def __init__(self, machine: "CpuMachine") -> None:
        self.machine: Final = machine

    @abstractmethod
    def begin(self) -> None:
        """Map memory, load the image, and stand before the first instruction."""

    @abstractmethod
    def waiting(self) -> bool:
        """Whether an interrupt waits, be it masked or not."""

    @abstractmethod
    def wakes(self) -> bool:
        """Whether one ends the instruction that waits for interrupts."""

    @abstractmethod
    def enter(self) -> None:
        """Begin the most urgent interrupt that waits, if it may come."""

    @abstractmethod
    def deaf(self) -> bool:
        """Whether all interrupts are off."""

    @abstractmethod
    def trap(self, number: int) -> None:
        """Do what an instruction or a fault asks for that the emulator does not know."""

    @abstractmethod
    def levels(self) -> None:
        """Look at inputs that interrupt: one may have moved."""

    def here(self) -> int:
        """Return the address of the next instruction."""
        return int(self.machine.get(self.PC))

    def where(self) -> int:
        """Return the same, for the emulator."""
        return self.here()


class IoRegister(Struct, frozen=True):
    """A register of a peripheral, or several of the same kind one behind the other.

    Attributes:
        name: as the reference manual has it.
        offset: its distance from the block's base.
        reset: what it holds after a reset.
        title: what it does; empty: it is storage.
        read: method that gives its value; else it is what was written.
        write: method that takes a value; else the value is stored.
        count: how many there are.
    """

    name: str
    offset: int
    reset: int = 0
    title: str = ""
    read: str = ""
    write: str = ""
    count: int = 1


def stored(*names: str, first: int = 0) -> tuple[IoRegister, ...]:
    """Return rows of storage, one behind the other."""
    return tuple(IoRegister(name, first + 4 * place) for place, name in enumerate(names))


class RegisterBlock:
    """A peripheral: its registers, the lowest byte of each at the lowest address.

    Args:
        machine: what it is part of.
        name: as the reference manual has it.
        base: its address.
        resets: what registers hold after a reset, by their offsets, where their rows do not say so.

    Attributes:
        REGISTERS: its rows.
        SIZE: of one register in bytes.
        enable: the block, register and bit that turn its clock on; None: it always has one.
    """

    REGISTERS: ClassVar[tuple[IoRegister, ...]] = ()
    SIZE: ClassVar[int] = 4

    def __init__(
        self, machine: "CpuMachine", name: str, base: int, resets: Mapping[int, int] | None = None
    ) -> None:
        self.machine: Final = machine
        self.name: Final = name
        self.base: Final = base
        self.enable: tuple[RegisterBlock, str, int] | None = None
        self.values: Final[dict[int, int]] = {}
        self._rows: Final[dict[int, IoRegister]] = {}
        for row in self.REGISTERS:
            for number in range(row.count):
                place = row.offset + number * self.SIZE
                self.values[place] = row.reset
                self._rows[place] = row
        self.values.update(resets or {})

    def of(self, name: str) -> int:
        """Return what a register holds, by its name."""
        return next(self.values[row.offset] for row in self.REGISTERS if row.name == name)

    def has_clock(self, offset: int) -> bool:
        """Whether it has its clock; without one a real peripheral does not answer."""
        if self.enable is None:
            return True
        block, register, bit = self.enable
        on = bool(block.of(register) >> bit & 1)
        if not on:
            self.machine.once(
                f"clock {self.name}",
                f"{self.name} has no clock (bit {bit} of {block.name} {register} is 0): accesses"
                f" are lost, reads give 0; the first is at offset {offset:02X}h, by the"
                f" instruction at {self.machine.at()}",
            )
        return on

    def read(self, offset: int, size: int) -> int:
        """Return what is read at an offset."""
        if not self.has_clock(offset):
            return 0
        place = offset - offset % self.SIZE
        row = self._rows.get(place)
        if row is None:
            self.machine.missing(f"{self.name}+{offset:02X}h", self.base + offset, False)
            return 0
        value = self.values[place]
        # A method gives the whole register, of which bytes or halves may be read.
        if row.read:
            method: Callable[[int], Any] = getattr(self, row.read)
            value = method(place - row.offset)
        self.settle()
        return (value >> 8 * (offset - place)) & ((1 << 8 * size) - 1)

    def write(self, offset: int, size: int, value: int) -> None:
        """Take what is written at an offset."""
        if not self.has_clock(offset):
            return
        place = offset - offset % self.SIZE
        row = self._rows.get(place)
        if row is None:
            self.machine.missing(f"{self.name}+{offset:02X}h", self.base + offset, True)
            return
        shift = 8 * (offset - place)
        # A method takes a narrow access as one of the whole register, with 0 beside it.
        if row.write:
            method: Callable[[int, int], Any] = getattr(self, row.write)
            method(place - row.offset, value << shift)
        else:
            mask = ((1 << 8 * size) - 1) << shift
            self.values[place] = (self.values[place] & ~mask) | (value << shift & mask)
        self.settle()

    def nothing(self, _: int, __: int) -> None:
        """Take what is written to a register that cannot be written."""

    def settle(self) -> None:
        """Do what an access has led to: interrupt, or ask for a transfer."""


class CpuMachine:
    """A processor, its memory and its peripherals, as a session of a board.

    Args:
        native: the library that cpu_link.c is part of.
        section: ``[cpu]`` of the board file.
        arch: the emulator's number of the architecture.
        mode: of its mode.
        model: of the model; None: as usual.
        ends: clock cycles after which the run ends; 0: none.
        until: what firmware sends at the end.

    Attributes:
        engine: the emulator.
        events: what is due at which clock cycle, by who wants it.
        blocks: peripherals.
    """

    def __init__(
        self, native: ctypes.CDLL, section: CpuSection, arch: int, mode: int, model: int | None,
        ends: int = 0, until: str = "",
    ) -> None:  # fmt: skip
        from unicorn import Uc, UcError
        from unicorn.unicorn_const import UC_HOOK_CODE, UC_HOOK_INTR, UC_HOOK_MEM_INVALID
        from unicorn.unicorn_py3.unicorn import uclib

        self.native: Final = native
        self.section: Final = section
        self.engine: Final = Uc(arch, mode)
        self.error: Final = UcError
        if model is not None:
            self.engine.ctl_set_cpu_model(model)
        self.get: Final = self.engine.reg_read
        self.set: Final = self.engine.reg_write
        for name in ("cpu_edge", "cpu_cycles", "cpu_card_row", "cpu_card_read", "cpu_read"):
            getattr(native, name).restype = ctypes.c_uint64
        self.shared: Final = _NativeCpu.in_dll(native, "cpu")
        self.shared.step, self.shared.access = section.cycles, section.access
        self.shared.frequency = section.clock
        # The same function that Python calls: C stops the emulator without a way through Python.
        self.shared.stop = ctypes.cast(uclib.uc_emu_stop, ctypes.c_void_p)
        self._callbacks: Final = (
            _READ(self.peripheral_read),
            _WRITE(self.peripheral_write),
            _UNCLAIMED(self.unclaimed),
        )
        self.shared.read, self.shared.write, self.shared.unclaimed = self._callbacks
        self._uclib: Final = uclib
        self._kept: Final[list[Any]] = []
        self.memories: Final[list[tuple[int, int, Any]]] = []
        self.blocks: Final[dict[int, RegisterBlock]] = {}
        self.translate: Callable[[int, int, int | None], int | None] = lambda *_: None
        self.events: Final[dict[object, tuple[int, Callable[[], None]]]] = {}
        self.said: Final[set[str]] = set()
        self.failure: BaseException | None = None
        self._traps: Final[list[int]] = []
        self.processor: Processor
        self.image: Image
        self._until: Final = until.encode()
        self._awaited: Final = until or ""
        self._sent = b""
        self._middle = False
        self._began = 0.0
        if ends:
            self.events["end"] = (ends, self._ends)
        self._hook(UC_HOOK_CODE, native.cpu_tick)
        self.engine.hook_add(UC_HOOK_INTR, self._trap)
        self.engine.hook_add(UC_HOOK_MEM_INVALID, self._invalid)

    def _hook(self, kind: int, function: Any) -> None:
        handle = ctypes.c_size_t()
        self._kept.append(handle)
        # Past unicorn's own hook_add, which calls Python at each instruction.
        self._uclib.uc_hook_add(
            self.engine._uch, ctypes.byref(handle), kind, ctypes.cast(function, ctypes.c_void_p),
            None, ctypes.c_uint64(1), ctypes.c_uint64(0),
        )  # fmt: skip

    # -- memory -------------------------------------------------------------------------------

    def memory(self, start: int, size: int, written: bool, also: int | None = None) -> None:
        """Map memory, and show it a second time at ``also``."""
        from unicorn.unicorn_const import UC_PROT_EXEC, UC_PROT_READ, UC_PROT_WRITE

        size = -(-size // _PAGE) * _PAGE
        # The emulator maps whole pages, from the boundary of one on.
        buffer = (ctypes.c_ubyte * (size + _PAGE))()
        address = -(-ctypes.addressof(buffer) // _PAGE) * _PAGE
        self._kept.append(buffer)
        access = UC_PROT_READ | UC_PROT_EXEC | (UC_PROT_WRITE if written else 0)
        for place in (start,) if also is None else (start, also):
            self.engine.mem_map_ptr(place, size, access, ctypes.c_void_p(address))
            row = self.shared.memories[len(self.memories)]
            row.start, row.size, row.bytes = place, size, address
            self.memories.append((place, size, address))

    def peek(self, address: int, size: int) -> bytes:
        """Return bytes of memory; none if they are not all there."""
        for start, length, at in self.memories:
            if start <= address and address + size <= start + length:
                return ctypes.string_at(at + address - start, size)
        return b""

    def poke(self, address: int, data: bytes) -> bool:
        """Write bytes into memory that the processor may write; return whether it may."""
        try:
            self.engine.mem_write(address, data)
        except self.error:
            return False
        return True

    def push(self, stack: int, frame: bytes) -> None:
        """Put the frame of an exception where the stack ends now.

        Raises:
            Stopped: there is no RAM.
        """
        if not self.poke(stack, frame):
            raise Stopped(
                exit_codes.FAILURE,
                f"stack overflow: an exception has no RAM for its frame at {stack:08X}h; the"
                f" instruction at {self.at()}",
            )
        self.set(self.processor.SP, stack)

    def wired_levels(self, port: int) -> int:
        """Return the levels at those bits of a port to which anything is wired."""
        return int(self.native.cpu_input(port) & self.native.cpu_wired(port))

    def has_ports(self, ports: range, what: str) -> None:
        """Refuse a pin map that uses a port which this processor does not have.

        Args:
            ports: the numbers of those it has.
            what: their names, for the message.

        Raises:
            Stopped: it uses another.
        """
        for port in range(_PORTS):
            if port not in ports and self.native.cpu_wired(port):
                name = "IRQ inputs" if port == INTERRUPTS else f"port {'ABCDEFGHIJKL'[port]}"
                raise Stopped(
                    exit_codes.USAGE, f"the pin map uses {name}, and this processor has {what}"
                )

    def load(self) -> None:
        """Put the image into memory.

        Raises:
            Stopped: there is no memory where it belongs.
        """
        for address, data in self.image.segments:
            for start, length, at in self.memories:
                if start <= address and address + len(data) <= start + length:
                    ctypes.memmove(at + address - start, data, len(data))
                    break
            else:
                there = ", ".join(
                    f"{start:08X}h to {start + size - 1:08X}h" for start, size, _ in self.memories
                )
                raise Stopped(
                    exit_codes.USAGE,
                    f"{self.image.path}: {len(data)} bytes belong at {address:08X}h, where this"
                    f" processor has no memory; it has {there}; see rom and ram of [cpu]",
                )

    def window(self, start: int, size: int, card: bool = False) -> None:
        """Let accesses to these addresses reach peripherals, or the card."""
        window = _Window(start, card)
        # The emulator has its address alone.
        self._kept.append(window)
        pointer = ctypes.cast(ctypes.pointer(window), ctypes.c_void_p)
        read = ctypes.cast(self.native.cpu_read, ctypes.c_void_p)
        write = ctypes.cast(self.native.cpu_write, ctypes.c_void_p)
        self._uclib.uc_mmio_map(self.engine._uch, start, size, read, pointer, write, pointer)

    def card_windows(self, end: int) -> None:
        """Map every page in which the host's card has addresses, those below ``end``.

        Raises:
            Stopped: something else is there.
        """
        pages: set[int] = set()
        row = 0
        while (address := self.native.cpu_card_row(row)) != NEVER:
            pages.add(address // _PAGE)
            row += 1
        for page in sorted(pages):
            start = page * _PAGE
            if start >= end or any(at <= start < at + size for at, size, _ in self.memories):
                raise Stopped(
                    exit_codes.USAGE,
                    f"the card has addresses at {start:08X}h, where this processor has memory, or"
                    " which it does not reach; see base of the card, and rom and ram of [cpu]",
                )
            self.window(start, _PAGE, True)

    def counter(self, address: int, period: int, down: bool = False) -> Counter:
        """Return a register that counts, and stands still as yet."""
        counter = Counter(address=address, divider=1, period=period, down=down)
        self.shared.counters[self.shared.counter_count] = ctypes.pointer(counter)
        self.shared.counter_count += 1
        return counter

    def add(self, block: RegisterBlock, size: int = 0x400) -> None:
        """Put a peripheral at its address."""
        for place in range(block.base, block.base + size, 0x400):
            self.blocks[place & ~0x3FF] = block

    # -- what C does not know -----------------------------------------------------------------

    def peripheral_read(self, address: int, size: int) -> int:
        """Return what a peripheral answers."""
        try:
            found = self.translate(address, size, None)
            if found is not None:
                return found
            block = self.blocks.get(address & ~0x3FF)
            if block is None:
                return self.missing("", address, False)
            return block.read(address - block.base, size)
        except BaseException as error:
            return self._fail(error)

    def peripheral_write(self, address: int, size: int, value: int) -> None:
        """Let a peripheral take a value."""
        try:
            if self.translate(address, size, value) is not None:
                return
            block = self.blocks.get(address & ~0x3FF)
            if block is None:
                self.missing("", address, True)
            else:
                block.write(address - block.base, size, value)
        except BaseException as error:
            self._fail(error)

    def _fail(self, error: BaseException) -> int:
        """Keep an error until the emulator, which knows no exceptions, has stopped."""
        self.failure = self.failure or error
        self.look()
        return 0

    def guarded(self, function: Callable[..., int | None]) -> Callable[..., int]:
        """Return a function that the emulator may call: it raises nothing."""

        def call(*arguments: object) -> int:
            try:
                return function(*arguments) or 0
            except BaseException as error:
                return self._fail(error)

        return call

    def look(self) -> None:
        """Stop before the next instruction: an interrupt may wait, or an event be nearer."""
        self.shared.due = self.shared.clock

    def _trap(self, _: Any, number: int, __: Any) -> None:
        self._traps.append(number)
        self.engine.emu_stop()

    def _invalid(self, _: Any, access: int, address: int, size: int, __: int, ___: Any) -> bool:
        """Notice an access to nothing; the emulator stops."""
        from unicorn import unicorn_const as names

        # Of several failures the first is the cause.
        if self.failure is None:
            verb = "writes"
            if access in (names.UC_MEM_READ_UNMAPPED, names.UC_MEM_READ_PROT):
                verb = "reads"
            elif access in (names.UC_MEM_FETCH_UNMAPPED, names.UC_MEM_FETCH_PROT):
                verb = "jumps to"
            self.failure = Stopped(exit_codes.FAILURE, self._nothing(verb, address))
        return False

    def _nothing(self, verb: str, address: int) -> str:
        what = "which is program memory" if self.peek(address, 1) else "where nothing is"
        text = f"the firmware {verb} {address:08X}h, {what}"
        if verb != "jumps to" and self._is_stack(address):
            text = f"stack overflow: the stack has reached {address:08X}h"
        return f"{text}; the instruction at {self.at()}"

    def at(self) -> str:
        """Return where the processor is: the next instruction, and its function if it is known."""
        return self.image.place(self.processor.here())

    def _is_stack(self, address: int) -> bool:
        return abs(address - int(self.get(self.processor.SP))) < _NEAR

    # -- what is said -------------------------------------------------------------------------

    def say(self, text: str) -> None:
        """Write a sentence to stderr."""
        self.flush()
        print(f"vbus cpu: {text}", file=sys.stderr, flush=True)

    def once(self, key: str, text: str) -> None:
        """Write a sentence to stderr, but not a second time for the same thing."""
        if key not in self.said:
            self.said.add(key)
            self.say(text)

    def missing(self, name: str, address: int, written: bool) -> int:
        """Say that a register is not modelled; return what a read gives."""
        if self._is_stack(address):
            raise Stopped(exit_codes.FAILURE, self._nothing("writes", address))
        what = f"{name} ({address:08X}h)" if name else f"{address:08X}h"
        then = "is written, to no effect" if written else "is read; the answer is 0"
        self.once(what, f"{what} is not modelled: it {then}; the instruction at {self.at()}")
        return 0

    def unclaimed(self, address: int, written: int) -> None:
        """Say that no chip of the card answers."""
        then = "is written, to no effect" if written else "is read; the answer is FFh"
        text = f"no chip of the card answers at {address:X}h: it {then}"
        self.once(f"card {written} {address:X}", f"{text}; the instruction at {self.at()}")

    def put(self, data: bytes) -> None:
        """Take what firmware sends."""
        sys.stdout.buffer.write(data)
        self._middle = not data.endswith(b"\n")
        if not self._middle:
            sys.stdout.buffer.flush()
        if self._until:
            self._sent = (self._sent + data)[-len(self._until) - len(data) :]
            if self._until in self._sent:
                self._fail(Stopped(exit_codes.OK))

    def flush(self) -> None:
        """Bring what firmware has sent to who reads it."""
        sys.stdout.buffer.flush()

    # -- the run ------------------------------------------------------------------------------

    def run(self) -> int:
        """Run the image to its end; return the exit code.

        Raises:
            Stopped: it cannot begin.
        """
        for row, (mask, value, after) in zip(
            self.shared.opcodes, self.processor.OPCODES, strict=False
        ):
            row.mask, row.value, row.after = mask, value, after
        self.processor.begin()
        limit = int(os.environ.get("VBUS_LIMIT_PS", "0"))
        if limit:
            self.events["limit"] = (self.cycle_at(limit + 1), self._limit)
        self._began = perf_counter()
        self.native.cpu_sync()
        self.moved()
        try:
            while True:
                self._go_on()
        except Stopped as end:
            if self._awaited and end.code == exit_codes.OK and self._until not in self._sent:
                end = Stopped(exit_codes.FAILURE, f'the firmware ended before "{self._awaited}"')
            if self._middle:
                self.put(b"\n")
            self.flush()
            if str(end):
                self.say(str(end))
            if self.native.cpu_close() < 0 and end.code == exit_codes.OK:
                return exit_codes.NO_LINK
            return end.code

    def statistics(self) -> str:
        """Return how much was done, and how fast."""
        seconds = perf_counter() - self._began
        done, cycles = self.shared.clock, self.native.cpu_cycles()
        return (
            f"vbus cpu: {done} clock cycles, {cycles} bus cycles, {seconds:.3f} s,"
            f" {done / seconds / self.section.clock:.2f} x real time"
        )

    def cycle_at(self, instant: int) -> int:
        """Return the first clock cycle that begins at an instant (ps) or later."""
        return -(-instant * self.section.clock // 10**12)

    def moved(self) -> None:
        """Take what the chips' outputs are now, and when the next one may move."""
        self.shared.moved = 0
        self.check()
        edge = self.native.cpu_edge()
        self.events.pop("edge", None)
        if edge != NEVER:
            self.events["edge"] = (max(edge, self.shared.clock + 1), self._edge)
        self.processor.levels()

    def _edge(self) -> None:
        self.native.cpu_sync()
        self.moved()

    def check(self) -> None:
        """End a run whose board is lost."""
        if self.shared.error:
            why = self.native.cpu_sentence(self.shared.error)
            raise Stopped(exit_codes.NO_LINK, f"the board is lost: {why.decode()}")

    def _ends(self) -> None:
        raise Stopped(exit_codes.OK)

    def _limit(self) -> None:
        """Tell the board that time goes on, which ends the run."""
        text = "the limit of chip time is over; the next instruction is at"
        self.once("limit", f"{text} {self.at()}")
        self.events["limit"] = (self.shared.clock + self.section.clock, self._limit)
        self.native.cpu_sync()
        self.check()

    def _fire(self) -> int:
        """Do what is due; return when the next event is."""
        while self.events:
            key = min(self.events, key=lambda key: self.events[key][0])
            when, what = self.events[key]
            if when > self.shared.clock:
                return when
            del self.events[key]
            what()
        return NEVER

    def _go_on(self) -> None:
        from unicorn.unicorn_const import UC_ERR_INSN_INVALID

        due = self._fire()
        shared, processor = self.shared, self.processor
        shared.masked = 0
        if processor.waiting():
            processor.enter()
            shared.masked = processor.waiting()
        # C stops the emulator before the first instruction at or behind this cycle.
        shared.due = min(due, shared.clock + SLICE * shared.step)
        wanted = shared.due
        self._traps.clear()
        try:
            self.engine.emu_start(processor.where(), NEVER)
        except self.error as error:
            if self.failure is None:
                what = str(error)
                if error.errno == UC_ERR_INSN_INVALID:
                    what = "an instruction that this processor does not know"
                self.failure = Stopped(exit_codes.FAILURE, f"{what}, at {self.at()}")
        if self.failure is not None:
            raise self.failure
        if shared.moved:
            self.moved()
        self.check()
        if self._traps:
            processor.trap(self._traps[0])
        elif shared.clock < shared.due:
            self._wait(False)
        elif wanted == shared.due and self._spins():
            self._wait(True)

    def _spins(self) -> bool:
        spin = self.processor.SPIN
        return self.peek(self.processor.here(), len(spin)) == spin

    def _wait(self, spins: bool) -> None:
        """Let time pass until an interrupt comes; without one the run is over.

        Args:
            spins: the processor jumps to itself; else it has executed an instruction that waits.
        """
        processor, shared = self.processor, self.shared
        deaf = processor.deaf() and (spins or not processor.WAKES_MASKED)
        while deaf or not processor.wakes():
            if deaf or not self.events.keys() - {"limit"}:
                if spins:
                    raise Stopped(self.get(processor.RESULT) & 0xFF)
                if deaf or "limit" not in self.events:
                    raise Stopped(
                        exit_codes.FAILURE,
                        f"the firmware waits for an interrupt that cannot come, at {self.at()}",
                    )
            due = min(when for when, _ in self.events.values())
            # Whole instructions pass, so that the instant of the next one is as if none had waited.
            behind = max(0, due - shared.clock)
            shared.clock += -(-behind // shared.step) * shared.step
            self._fire()
