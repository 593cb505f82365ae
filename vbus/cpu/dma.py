"""DMA1 of an STM32F1 or F4: what I2C and USARTs ask for goes between their registers and memory.

Registers and requests: ST's reference manuals RM0008 (F1) and RM0090 (F4).
A request is served at once, and a copy (MEM2MEM of an F1) is made at once. Priorities, FIFOs and
double buffers are not there, nor are copies by an F4, whose DMA2 alone makes them.
"""

import ctypes
from collections.abc import Callable
from typing import ClassVar, Final

from vbus.cpu.cortex_m import IRQ, CortexM
from vbus.cpu.machine import CpuMachine, IoRegister, RegisterBlock, stored

_DIR, _CIRC, _PINC, _MINC, _PSIZE, _MSIZE = range(6)
"""Bits of a control register, as :attr:`Dma.BITS` lists them."""
_END, _HALF, _ERROR = range(3)
"""What a channel tells, as :attr:`Dma.ENABLES` lists it."""
_COUNT, _PORT, _MEMORY = 4, 8, 12
"""Where a channel has its counter and both addresses, behind its control register."""
_COPIES: Final = 0x4000
"""MEM2MEM: the channel of an F1 waits for no request."""
_PERIPHERALS, _CARD, _CARD_END = 0x40000000, 0x60000000, 0xA0000000


def _channels(first: int, stride: int, many: int, *more: str) -> tuple[IoRegister, ...]:
    rows: list[IoRegister] = []
    for at in range(first, first + stride * many, stride):
        rows += (IoRegister("CR", at, 0, "EN, interrupts, direction, sizes"),
                 *stored("NDTR", "PAR", "MAR", *more, first=at + 4))  # fmt: skip
    return tuple(rows)


class Dma(RegisterBlock):
    """DMA1 of an F1, whose channel 1 is number 0 here.

    Attributes:
        CHANNELS: offset of the first control register, distance of the next, how many there are.
        VECTORS: interrupt of each channel.
        FLAGS: where the flags of each begin in the status registers, which follow each other.
        ENABLES: bits of the control register that let the end, the half and an error interrupt.
        LAG: how much further left a flag stands than the bit that lets it interrupt; so 1 is an F4.
        BITS: where the control register has DIR, CIRC, PINC, MINC, PSIZE and MSIZE.
        REQUESTS: the channels that may serve a peripheral, and CHSEL for it.
        asks: functions that let a peripheral ask again, because a channel has been turned on.
    """

    CHANNELS: ClassVar[tuple[int, int, int]] = (0x08, 20, 7)
    VECTORS: ClassVar[tuple[int, ...]] = tuple(range(11, 18))
    FLAGS: ClassVar[tuple[int, ...]] = tuple(range(0, 28, 4))
    ENABLES: ClassVar[tuple[int, int, int]] = (2, 4, 8)
    LAG: ClassVar[int] = 0
    BITS: ClassVar[tuple[int, ...]] = (4, 5, 6, 7, 8, 10)
    REQUESTS: ClassVar[dict[str, tuple[tuple[int, ...], int]]] = {  # RM0008, the table of requests
        "I2C1_TX": ((5,), 0), "I2C1_RX": ((6,), 0), "I2C2_TX": ((3,), 0), "I2C2_RX": ((4,), 0),
        "USART1_TX": ((3,), 0), "USART2_TX": ((6,), 0), "USART3_TX": ((1,), 0),
    }  # fmt: skip
    REGISTERS = (
        IoRegister("ISR", 0x00, 0, "what came", "status", "nothing"),
        IoRegister("IFCR", 0x04, 0, "a 1 clears", write="clear"),
        *_channels(*CHANNELS),
    )

    def __init__(self, machine: CpuMachine, name: str, base: int, processor: CortexM) -> None:
        super().__init__(machine, name, base)
        self._processor: Final = processor
        self.asks: Final[list[Callable[[], None]]] = []
        self._flags = 0
        first, stride, many = self.CHANNELS
        self._places: Final = range(first, first + stride * many, stride)
        self._whole: Final = [0] * many
        """Transfers of a round, which a circular channel begins again."""

    def _bit(self, channel: int, which: int) -> int:
        """Return two bits of a channel's control register from one of ``BITS`` on."""
        return self.values[self._places[channel]] >> self.BITS[which] & 3

    # -- requests -----------------------------------------------------------------------------

    def _channel(self, request: str) -> int | None:
        """Return the channel that is on for a request."""
        channels, choice = self.REQUESTS.get(request, ((), 0))
        for channel in channels:
            control = self.values[self._places[channel]]
            if control & 1 and control >> 25 & 7 == choice and self._left(channel):
                return channel
        return None

    def _left(self, channel: int) -> int:
        return self.values[self._places[channel] + _COUNT] & 0xFFFF

    def left(self, request: str) -> int:
        """Return how many transfers a request has left; 0: no channel serves it."""
        channel = self._channel(request)
        return 0 if channel is None else self._left(channel)

    def serve(self, request: str) -> bool:
        """Make one transfer; return whether a channel has made one."""
        channel = self._channel(request)
        if channel is not None:
            self._transfer(channel)
        return channel is not None

    def _get(self, address: int, size: int) -> int | None:
        """Return what memory, the card or a peripheral has at an address; None: nothing."""
        machine = self.machine
        if data := machine.peek(address, size):
            return int.from_bytes(data, "little")
        if _CARD <= address < _CARD_END:
            return int(machine.native.cpu_card_read(ctypes.c_uint64(address), size))
        return machine.peripheral_read(address, size) if address >= _PERIPHERALS else None

    def _put(self, address: int, size: int, value: int) -> bool:
        machine, value = self.machine, value & (1 << 8 * size) - 1
        if _CARD <= address < _CARD_END:
            machine.native.cpu_card_write(ctypes.c_uint64(address), size, ctypes.c_uint64(value))
        elif address >= _PERIPHERALS:
            machine.peripheral_write(address, size, value)
        else:
            return machine.poke(address, value.to_bytes(size, "little"))
        return True

    def _transfer(self, channel: int) -> None:
        """Make one transfer."""
        at, left = self._places[channel], self._left(channel)
        done = self._whole[channel] - left
        sizes = [1 << self._bit(channel, which) for which in (_PSIZE, _MSIZE)]
        port, memory = (
            self.values[at + where] + (done * size if self._bit(channel, which) & 1 else 0)
            for where, which, size in zip((_PORT, _MEMORY), (_PINC, _MINC), sizes, strict=True)
        )
        # Counted before the peripheral is touched, which may have its next request by that.
        self.values[at + _COUNT] = left - 1
        ends = [(port, sizes[0]), (memory, sizes[1])]
        if self._bit(channel, _DIR) & 1:
            ends.reverse()
        value = self._get(*ends[0])
        moved = value is not None and self._put(*ends[1], value)
        if not moved:
            # TEIF: an error of the bus turns the channel off.
            self.values[at] &= ~1
            self._came(channel, _ERROR)
        elif left == 1:
            self._came(channel, _END)
            if self._bit(channel, _CIRC) & 1:
                self.values[at + _COUNT] = self._whole[channel]
            elif self.LAG:
                self.values[at] &= ~1  # RM0090; an F1's stays on, with nothing left
        elif left - 1 == self._whole[channel] // 2:
            self._came(channel, _HALF)

    def _came(self, channel: int, which: int) -> None:
        self._flags |= self.ENABLES[which] << self.LAG + self.FLAGS[channel]
        self._ask()

    def _ask(self) -> None:
        """Let the flags interrupt whose enables are set."""
        for at, vector, shift in zip(self._places, self.VECTORS, self.FLAGS, strict=True):
            wanted = self.values[at] & sum(self.ENABLES)
            came = bool(self._flags >> shift + self.LAG & wanted)
            self._processor.request(IRQ + vector, self, came)

    # -- registers ----------------------------------------------------------------------------

    def write(self, offset: int, size: int, value: int) -> None:
        """Take what is written; a channel that is turned on begins a round."""
        place = offset & ~3
        was = self.values.get(place, 0) & 1
        super().write(offset, size, value)
        if place in self._places:
            channel = self._places.index(place)
            control = self.values[place]
            if control & 1 and not was:
                self._whole[channel] = self._left(channel)
                if not self.LAG and control & _COPIES:
                    while self.values[place] & 1 and self._left(channel):
                        self._transfer(channel)
                else:
                    self._warn(channel, control)
                for ask in self.asks:
                    ask()
            self._ask()

    def _warn(self, channel: int, control: int) -> None:
        """Name a channel that nothing will move."""
        copies = self.LAG and control & 0x80
        if copies or not any(
            channel in channels and control >> 25 & 7 == choice
            for channels, choice in self.REQUESTS.values()
        ):
            word = "stream" if self.LAG else "channel"
            self.machine.once(
                f"{self.name} {channel}",
                f"{self.name} {word} {channel + 1 - self.LAG} is turned on and moves nothing: the"
                f" requests that are modelled are {', '.join(self.REQUESTS)}; the instruction at"
                f" {self.machine.at()}",
            )

    def status(self, place: int) -> int:
        """Flags; of an F1 the lowest of each channel says that there is another."""
        flags = self._flags
        if not self.LAG:
            flags |= sum(bool(flags >> shift & 14) << shift for shift in self.FLAGS)
        return flags >> 8 * place & 0xFFFFFFFF

    def clear(self, place: int, value: int) -> None:
        """Forget flags; the lowest of a channel of an F1 stands for all of its four."""
        if not self.LAG:
            value |= sum(15 * (value >> shift & 1) << shift for shift in self.FLAGS)
        self._flags &= ~(value << 8 * place)
        self._ask()


class Dma4(Dma):
    """DMA1 of an F4, which calls its channels streams."""

    CHANNELS = (0x10, 24, 8)
    VECTORS = (*range(11, 18), 47)
    FLAGS = (0, 6, 16, 22, 32, 38, 48, 54)
    ENABLES = (16, 8, 4)
    LAG = 1
    BITS = (6, 8, 9, 10, 11, 13)
    REQUESTS: ClassVar[dict[str, tuple[tuple[int, ...], int]]] = {  # RM0090, the same table
        "I2C1_TX": ((6, 7), 1), "I2C1_RX": ((0, 5), 1), "I2C2_TX": ((7,), 7),
        "I2C2_RX": ((2, 3), 7), "USART2_TX": ((6,), 4), "USART3_TX": ((3,), 4),
        "UART4_TX": ((4,), 4), "UART5_TX": ((7,), 4),
    }  # fmt: skip
    REGISTERS = (
        IoRegister("ISR", 0x00, 0, "LISR and HISR: what came", "status", "nothing", 2),
        IoRegister("IFCR", 0x08, 0, "LIFCR and HIFCR: a 1 clears", "", "clear", 2),
        *_channels(*CHANNELS, "M1AR", "FCR"),
    )
