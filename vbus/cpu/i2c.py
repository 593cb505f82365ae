"""I2C1 and I2C2 of an STM32F1 or F4 as a master, a bit each at its instants.

Registers and flags: ST's reference manuals RM0008 (F1) and RM0090 (F4).
Slave addresses, 10-bit addresses and stretched clocks are not there.
"""

import ctypes
from collections.abc import Callable, Generator, Iterator
from typing import Final

from vbus.cpu.cortex_m import IRQ, CortexM
from vbus.cpu.dma import Dma
from vbus.cpu.machine import CpuMachine, IoRegister, PortBits, RegisterBlock, stored

PE, START, STOP, ACK, POS, RESET = (1 << bit for bit in (0, 8, 9, 10, 11, 15))
SB, ADDR, BTF, RXNE, TXE, AF = (1 << bit for bit in (0, 1, 2, 6, 7, 10))
MASTER, BUSY, SENDS = 1, 2, 4
ITERREN, ITEVTEN, ITBUFEN, DMAEN, LAST = (1 << bit for bit in range(8, 13))
"""Bits of CR2 that ask for interrupts and DMA."""

Moves = Iterator[tuple[int, int]]
"""Levels of SCL and SDA, each for half a bit."""


class I2cMaster(RegisterBlock):
    """One I2C, on two bits of a port; the bits are its own while PE is set.

    While SCL is low the master waits for its firmware: for an address in DR, for ADDR to be
    cleared, for the next byte, or for the last one to be read.
    """

    REGISTERS = (
        IoRegister("CR1", 0x00, 0, "PE, START, STOP, ACK, POS, SWRST", write="put_cr1"),
        IoRegister("CR2", 0x04, 0, "FREQ: the bus clock in MHz; interrupts and DMA"),
        *stored("OAR1", "OAR2", first=0x08),
        IoRegister("DR", 0x10, 0, "the byte to send, or received", "dr", "put_dr"),
        IoRegister("SR1", 0x14, 0, "SB, ADDR, BTF, RXNE, TXE, AF", "sr1", "put_sr1"),
        IoRegister("SR2", 0x18, 0, "MSL, BUSY, TRA", "sr2", "nothing"),
        *stored("CCR", "TRISE", "FLTR", first=0x1C),
    )

    def __init__(
        self, machine: CpuMachine, name: str, base: int, bits: PortBits,
        lend: Callable[[int, bool], None], scl: int, sda: int, number: int,
        processor: CortexM, dma: Dma,
    ) -> None:  # fmt: skip
        super().__init__(machine, name, base)
        self._processor: Final = processor
        self._number: Final = IRQ + number
        """Of its event interrupt; the error interrupt has the next."""
        self._dma: Final = dma
        dma.asks.append(self.settle)
        self._bits: Final = bits
        self._lend: Final = lend
        self._scl: Final = scl
        self._sda: Final = sda
        self._begin()

    def _begin(self) -> None:
        self._flags = self._state = 0
        self._moves: Moves | None = None
        self._waiting: int | None = None
        """A byte in DR that is not shifted out yet."""
        self._shifted: int | None = None
        """A byte received while DR was still full."""
        self._more = False
        """A further byte is to be received."""
        self._bytes = 0
        self.machine.events.pop(self, None)

    # -- lines --------------------------------------------------------------------------------

    def _drive(self, scl: int, sda: int) -> None:
        bits = self._bits
        mask = 1 << self._scl | 1 << self._sda
        bits.level = (bits.level & ~mask) | scl << self._scl | sda << self._sda
        self.machine.native.cpu_port_moved(ctypes.byref(bits))

    def _sensed(self) -> int:
        return int(self.machine.native.cpu_input(self._bits.number)) >> self._sda & 1

    def _send(self, byte: int) -> Generator[tuple[int, int], None, bool]:
        """Clock a byte out; return whether it was acknowledged."""
        for bit in range(7, -1, -1):
            yield 0, byte >> bit & 1
            yield 1, byte >> bit & 1
        yield 0, 1
        yield 1, 1
        refused = self._sensed()
        yield 0, 1
        self._flags |= AF if refused else 0
        return not refused

    def _address(self, byte: int) -> Moves:
        if (yield from self._send(byte)):
            self._flags |= ADDR
            self._state = MASTER | BUSY | (0 if byte & 1 else SENDS)
            self._bytes = 0

    def _transmit(self, byte: int) -> Moves:
        self._flags |= TXE  # DR is free again
        if (yield from self._send(byte)) and self._waiting is None:
            self._flags |= BTF

    def _receive(self) -> Moves:
        byte = 0
        for _ in range(8):
            yield 0, 1
            yield 1, 1
            byte = byte << 1 | self._sensed()
        # With POS, ACK is meant for the second byte; the first is acknowledged.
        first = bool(self.of("CR1") & POS) and self._bytes == 0
        more = first or bool(self.of("CR1") & ACK)
        # CR2: with LAST the last byte that DMA has room for is not acknowledged.
        if self.of("CR2") & (DMAEN | LAST) == DMAEN | LAST:
            more = more and self._dma.left(f"{self.name}_RX") != 1
        self._bytes += 1
        yield 0, int(not more)
        yield 1, int(not more)
        yield 0, 1
        self._more = more
        if self._flags & RXNE:
            self._shifted = byte
            self._flags |= BTF
        else:
            self.values[0x10] = byte
            self._flags |= RXNE

    def _start(self) -> Moves:
        yield from (((0, 1), (1, 1)) if self._state & BUSY else ())
        yield 1, 0
        yield 0, 0
        # CR1: START and STOP end when they have been sent.
        self.values[0x00] &= ~START
        self._flags = (self._flags & RXNE) | SB
        self._state = MASTER | BUSY

    def _stop(self) -> Moves:
        yield 0, 0
        yield 1, 0
        yield 1, 1
        self.values[0x00] &= ~STOP
        self._flags &= RXNE | AF | (BTF if self._shifted is not None else 0)
        self._state = 0
        self._waiting = None

    # -- what is next -------------------------------------------------------------------------

    def _go_on(self) -> None:
        """Begin what is next, unless something is under way or the firmware has to act first."""
        if self._moves is not None or not self.of("CR1") & PE:
            return
        control, sends = self.of("CR1"), self._state & SENDS
        if control & STOP and self._state & BUSY and not self._flags & (SB | ADDR):
            if sends or not self._more or self._shifted is not None or self._flags & AF:
                self._moves = self._stop()
        if self._moves is None and control & START and not control & STOP:
            self._moves = self._start()
        elif self._moves is None and self._state & BUSY and not self._flags & (ADDR | AF):
            if self._flags & SB or sends:
                if self._waiting is not None:
                    byte, self._waiting = self._waiting, None
                    made = self._address if self._flags & SB else self._transmit
                    self._flags &= ~(SB | BTF)
                    self._moves = made(byte)
            elif self._more and self._shifted is None:
                self._moves = self._receive()
        if self._moves is not None:
            self._move()

    def _move(self) -> None:
        """Move the lines, and come again half a bit later."""
        assert self._moves is not None
        levels = next(self._moves, None)
        if levels is None:
            self._moves = None
            self._go_on()
            self.settle()
            return
        self._drive(*levels)
        clocks = self.of("CCR") & 0xFFF or 1
        if self.of("CCR") & 0x8000:  # fast: three parts, or with DUTY 25, are a bit
            clocks = clocks * (25 if self.of("CCR") & 0x4000 else 3) // 2
        megahertz = self.of("CR2") & 63
        frequency = megahertz * 10**6 if megahertz else self.machine.section.clock
        half = max(clocks * self.machine.section.clock // frequency, 1)
        self.machine.events[self] = (self.machine.shared.clock + half, self._move)
        self.machine.look()

    # -- requests -----------------------------------------------------------------------------

    def settle(self) -> None:
        """Ask for transfers by DMA, and interrupt as long as a flag stands."""
        control = self.of("CR2")
        while control & DMAEN and self._flags & TXE and self._dma.serve(f"{self.name}_TX"):
            pass
        while control & DMAEN and self._flags & RXNE and self._dma.serve(f"{self.name}_RX"):
            pass
        # CR2: ITBUFEN adds TXE and RXNE to the events that ITEVTEN lets interrupt.
        events = SB | ADDR | BTF | (TXE | RXNE if control & ITBUFEN else 0)
        event = bool(control & ITEVTEN and self._flags & events)
        self._processor.request(self._number, self, event)
        error = bool(control & ITERREN and self._flags & AF)
        self._processor.request(self._number + 1, self, error)

    # -- registers ----------------------------------------------------------------------------

    def put_cr1(self, _: int, value: int) -> None:
        """Turn on or off, begin or end."""
        if value & RESET:
            self._begin()
        # A STOP is one of a transfer: firmware that writes CR1 as it was may set it too late.
        self.values[0x00] = value if self._state & BUSY else value & ~STOP
        mask = 1 << self._scl | 1 << self._sda
        self._lend(mask, bool(value & PE))
        if not value & PE:
            self._begin()
        elif self._moves is None and not self._state & BUSY:
            self._drive(1, 1)
        self._go_on()

    def dr(self, _: int) -> int:
        """The byte received; the one behind it comes after that."""
        byte = self.values[0x10]
        self._flags &= ~(RXNE | BTF)
        if self._shifted is not None:
            self.values[0x10], self._shifted = self._shifted, None
            self._flags |= RXNE
        self._go_on()
        return byte

    def put_dr(self, _: int, value: int) -> None:
        """Send a byte, or an address after a start."""
        self._waiting = value & 0xFF
        self._flags &= ~(TXE | BTF)
        self._go_on()

    def sr1(self, _: int) -> int:
        """What has happened."""
        return self._flags

    def put_sr1(self, _: int, value: int) -> None:
        """A 0 clears the acknowledge failure."""
        # SR1: of the flags here only AF is cleared by a write.
        self._flags &= ~AF | value

    def sr2(self, _: int) -> int:
        """Whether the bus is in use; reading it clears ADDR, which lets the bytes come."""
        state = self._state
        # SR2: a read of SR2 behind one of SR1 clears ADDR; drivers read both.
        if self._flags & ADDR:
            self._flags &= ~ADDR
            self._flags |= TXE if state & SENDS else 0
            self._more = not state & SENDS
            self._go_on()
        return state
