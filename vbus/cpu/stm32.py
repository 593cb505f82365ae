"""STM32F1 and F4: the peripherals that a driver's firmware touches, register by register.

Offsets, resets and bits: ST's reference manuals RM0008 (F1) and RM0090 (F4).
"""

import ctypes
from collections.abc import Callable
from typing import ClassVar, Final

from msgspec import Struct

from vbus.cpu.cortex_m import IRQ, CortexM, SystemControl, Trace
from vbus.cpu.dma import Dma, Dma4
from vbus.cpu.i2c import I2cMaster
from vbus.cpu.machine import CpuMachine, IoRegister, PortBits, RegisterBlock, stored

_NONE: Final = 0xFFFFFFFF


class Clocks(RegisterBlock):
    """RCC: an oscillator that is turned on is ready at once."""

    REGISTERS = (
        IoRegister("CR", 0x00, 0x83, "oscillators and PLL on; each is ready then", "ready"),
        IoRegister("CFGR", 0x04, 0, "the clock chosen is the clock used", "switched"),
        *stored("CIR", "APB2RSTR", "APB1RSTR", "AHBENR", "APB2ENR", "APB1ENR", first=0x08),
        IoRegister("BDCR", 0x20, 0, "LSE on, and ready", "low_ready"),
        IoRegister("CSR", 0x24, 0x0C000000, "LSI on, and ready", "slow_ready"),
        *stored("AHBSTR", "CFGR2", first=0x28),
    )

    PRESCALERS: ClassVar[tuple[int, int]] = (8, 11)
    """Where CFGR has PPRE1 and PPRE2."""

    def __init__(self, machine: CpuMachine, name: str, base: int) -> None:
        super().__init__(machine, name, base)
        self.changed: Final[list[Callable[[], None]]] = []
        """What is called when a prescaler may have another value."""

    def settle(self) -> None:
        """Let timers count at the clock they have now."""
        for call in self.changed:
            call()

    def timer_divider(self, bus: int) -> int:
        """Return how many clock cycles of the processor are one of a timer on APB1 or APB2 (0, 1).

        A timer has the clock of its bus, or twice that if the bus has a prescaler.
        """
        scale = self.of("CFGR") >> self.PRESCALERS[bus] & 7
        return 1 << (scale & 3) if scale & 4 else 1

    def _ready(self, name: str, bits: tuple[int, ...]) -> int:
        value = self.of(name)
        for bit in bits:
            # The RDY bit of each oscillator stands above its ON bit.
            value = (value & ~(2 << bit)) | (value >> bit & 1) << bit + 1
        return value

    def ready(self, _: int) -> int:
        """HSI, HSE, PLL, PLL2 (PLLI2S), PLL3 (PLLSAI)."""
        return self._ready("CR", (0, 16, 24, 26, 28))

    def low_ready(self, _: int) -> int:
        """LSE."""
        return self._ready("BDCR", (0,))

    def slow_ready(self, _: int) -> int:
        """LSI."""
        return self._ready("CSR", (0,))

    def switched(self, _: int) -> int:
        """SWS is SW."""
        # SW in bits 1:0 asks for a clock, SWS in bits 3:2 says which one is used.
        value = self.of("CFGR")
        return (value & ~0xC) | (value & 3) << 2


class Clocks4(Clocks):
    """RCC of an F4."""

    PRESCALERS = (10, 13)
    REGISTERS = (
        IoRegister("CR", 0x00, 0x83, "oscillators and PLL on; each is ready then", "ready"),
        IoRegister("PLLCFGR", 0x04, 0x24003010),
        IoRegister("CFGR", 0x08, 0, "the clock chosen is the clock used", "switched"),
        *stored("CIR", "AHB1RSTR", "AHB2RSTR", "AHB3RSTR", first=0x0C),
        *stored("APB1RSTR", "APB2RSTR", first=0x20),
        *stored("AHB1ENR", "AHB2ENR", "AHB3ENR", first=0x30),
        *stored("APB1ENR", "APB2ENR", first=0x40),
        *stored("AHB1LPENR", "AHB2LPENR", "AHB3LPENR", first=0x50),
        *stored("APB1LPENR", "APB2LPENR", first=0x60),
        IoRegister("BDCR", 0x70, 0, "LSE on, and ready", "low_ready"),
        IoRegister("CSR", 0x74, 0x0E000000, "LSI on, and ready", "slow_ready"),
        *stored("SSCGR", "PLLI2SCFGR", "PLLSAICFGR", "DCKCFGR", first=0x80),
    )


class Port(RegisterBlock):
    """GPIO: its data registers work in cpu_link.c, once its clock is on.

    Attributes:
        RESETS: what registers of a port hold after a reset that those of others do not: its pins
            are the debugger's.
    """

    RESETS: ClassVar[dict[str, dict[int, int]]] = {}

    def __init__(self, machine: CpuMachine, name: str, base: int) -> None:
        letter = name[-1]
        super().__init__(machine, name, base, self.RESETS.get(letter))
        self.bits: Final = PortBits(base=base, number=ord(letter) - ord("A"), off=1)
        by_name = {row.name: row.offset for row in self.REGISTERS}
        for field, register in (("input", "IDR"), ("output", "ODR"), ("set", "BSRR"),
                                ("reset", "BRR")):  # fmt: skip
            setattr(self.bits, field, by_name.get(register, _NONE))
        self._lent = 0
        self.modes()
        machine.shared.ports[machine.shared.port_count] = ctypes.pointer(self.bits)
        machine.shared.port_count += 1

    def has_clock(self, offset: int) -> bool:
        """Whether it has its clock; cpu_link.c has to know."""
        on = super().has_clock(offset)
        self.bits.off = not on
        return on

    def write(self, offset: int, size: int, value: int) -> None:
        """Take what is written."""
        super().write(offset, size, value)
        self._take_modes()

    def _take_modes(self) -> None:
        self.modes()
        self.bits.drive |= self._lent
        self.bits.open |= self._lent
        self.machine.native.cpu_port_moved(ctypes.byref(self.bits))

    def lend(self, mask: int, on: bool) -> None:
        """Let another peripheral have these pins, as open drains, or take them back."""
        if on != (self._lent & mask == mask):
            self._lent ^= mask
            self.bits.level |= mask  # nothing is pulled low until that moves them
            self._take_modes()

    def idr(self, _: int) -> int:
        """Levels at the pins."""
        return int(self.machine.native.cpu_input(self.bits.number))

    def odr(self, _: int) -> int:
        """What is driven."""
        return int(self.bits.level)

    def put_odr(self, _: int, value: int) -> None:
        """Drive this; a byte of it leaves the other as it is."""
        self.bits.level = value & 0xFFFF

    def put_bsrr(self, _: int, value: int) -> None:
        """Set by the low half, reset by the high one; setting wins."""
        # Of a bit that is to be set and reset, the set counts.
        self.bits.level = (self.bits.level & ~(value >> 16)) | (value & 0xFFFF)

    def put_brr(self, _: int, value: int) -> None:
        """Reset."""
        self.bits.level &= ~value

    def modes(self) -> None:
        """Say what the pins are by the configuration."""

    def _mask(self, holds: list[bool]) -> int:
        return sum(1 << bit for bit, one in enumerate(holds) if one)


_DATA: Final = (
    ("IDR", "levels at the pins", "idr", ""), ("ODR", "what is driven", "odr", "put_odr"),
    ("BSRR", "set, reset in the high half", "", "put_bsrr"),
)  # fmt: skip


class Port1(Port):
    """GPIO of an F1: four bits of CRL or CRH for each pin."""

    REGISTERS = (
        # After a reset every pin is a floating input.
        IoRegister("CRL", 0x00, 0x44444444, "MODE and CNF of pins 0 to 7"),
        IoRegister("CRH", 0x04, 0x44444444, "MODE and CNF of pins 8 to 15"),
        *(IoRegister(*row[:1], 8 + 4 * n, 0, *row[1:]) for n, row in enumerate(_DATA)),
        IoRegister("BRR", 0x14, 0, "reset", "", "put_brr"),
        IoRegister("LCKR", 0x18),
    )

    def modes(self) -> None:
        """MODE 0 is an input, pulled if CNF is 2; CNF 1 of an output is open drain."""
        word = self.of("CRL") | self.of("CRH") << 32
        each = [(word >> 4 * pin & 3, word >> 4 * pin + 2 & 3) for pin in range(16)]
        self.bits.drive = self._mask([mode > 0 and kind < 2 for mode, kind in each])
        self.bits.open = self._mask([mode > 0 and kind == 1 for mode, kind in each])
        self.bits.pulled = self._mask([mode == 0 and kind == 2 for mode, kind in each])


class Port4(Port):
    """GPIO of an F4: two bits of MODER for each pin."""

    RESETS: ClassVar[dict[str, dict[int, int]]] = {
        "A": {0x00: 0xA8000000, 0x0C: 0x64000000},
        "B": {0x00: 0x00000280, 0x08: 0x000000C0, 0x0C: 0x00000100},
    }
    REGISTERS = (
        IoRegister("MODER", 0x00, 0, "0 input, 1 output, 2 another peripheral's, 3 analog"),
        IoRegister("OTYPER", 0x04, 0, "1: open drain"),
        IoRegister("OSPEEDR", 0x08),
        IoRegister("PUPDR", 0x0C, 0, "1: pulled up"),
        *(IoRegister(*row[:1], 16 + 4 * n, 0, *row[1:]) for n, row in enumerate(_DATA)),
        *stored("LCKR", "AFRL", "AFRH", first=0x1C),
    )

    def modes(self) -> None:
        """Take what the pins are."""
        modes, pulls = self.of("MODER"), self.of("PUPDR")
        self.bits.drive = self._mask([modes >> 2 * pin & 3 == 1 for pin in range(16)])
        self.bits.open = self.of("OTYPER") & 0xFFFF
        self.bits.pull = self._mask([pulls >> 2 * pin & 3 == 1 for pin in range(16)])


class Choice(RegisterBlock):
    """AFIO or SYSCFG: which port's pins EXTI sees."""

    REGISTERS = (
        *stored("EVCR", "MAPR"),
        IoRegister("EXTICR", 0x08, 0, "port of each of four lines", count=4),
        IoRegister("MAPR2", 0x1C),
        IoRegister("CMPCR", 0x20),
    )


class ExternalInterrupts(RegisterBlock):
    """EXTI: edges at port bits."""

    VECTORS: ClassVar[dict[int, int]] = {
        **{6 + line: 1 << line for line in range(5)}, 23: 0x03E0, 40: 0xFC00
    }  # fmt: skip
    """The lines that share an interrupt (vector tables of RM0008 and RM0090)."""

    REGISTERS = (
        *stored("IMR", "EMR", "RTSR", "FTSR"),
        IoRegister("SWIER", 0x10, 0, "as if an edge came", write="put_swier"),
        IoRegister("PR", 0x14, 0, "edges that came; a 1 clears", write="put_pr"),
    )

    def __init__(
        self, machine: CpuMachine, name: str, base: int, processor: CortexM, choice: Choice
    ) -> None:
        super().__init__(machine, name, base)
        self._processor: Final = processor
        processor.look = self.look
        self._choice: Final = choice
        self._levels = 0

    def write(self, offset: int, size: int, value: int) -> None:
        """Take what is written: edges count from now on."""
        super().write(offset, size, value)
        self._levels = self._now()

    def _now(self) -> int:
        levels = 0
        wanted = (self.of("RTSR") | self.of("FTSR")) & 0xFFFF
        ports: dict[int, int] = {}
        for line in range(16):
            if wanted >> line & 1:
                port = self._choice.values[8 + (line & ~3)] >> 4 * (line & 3) & 15
                if port not in ports:
                    ports[port] = self.machine.native.cpu_input(port) if port < 12 else 0
                levels |= ports[port] & 1 << line
        return levels

    def look(self) -> None:
        """Compare the pins with what they were."""
        levels = self._now()
        up, down = levels & ~self._levels, self._levels & ~levels
        self._levels = levels
        self._came((up & self.of("RTSR")) | (down & self.of("FTSR")))

    def _came(self, lines: int) -> None:
        self.values[0x14] |= lines & self.of("IMR")
        for number, shared in self.VECTORS.items():
            self._processor.request(IRQ + number, self, bool(self.values[0x14] & shared))

    def put_swier(self, _: int, value: int) -> None:
        """Let lines come."""
        self._came(value)

    def put_pr(self, _: int, value: int) -> None:
        """Forget lines."""
        self.values[0x14] &= ~value
        self._came(0)


class SerialPort(RegisterBlock):
    """USART: what is sent goes to stdout at once, and nothing is received."""

    REGISTERS = (
        IoRegister("SR", 0x00, 0xC0, "TXE and TC are always 1", write="nothing"),
        IoRegister("DR", 0x04, 0, "the byte to send", write="send"),
        *stored("BRR", "CR1", "CR2", "CR3", "GTPR", first=0x08),
    )

    def __init__(
        self, machine: CpuMachine, name: str, base: int, processor: CortexM, number: int, dma: Dma
    ) -> None:
        super().__init__(machine, name, base)
        self._processor: Final = processor
        self._number: Final = IRQ + number
        self._dma: Final = dma
        dma.asks.append(self.settle)

    def settle(self) -> None:
        """Let DMA send (DMAT of CR3), and interrupt (TXEIE and TCIE of CR1)."""
        while self.of("CR3") & 0x80 and self._dma.serve(f"{self.name}_TX"):
            pass
        self._processor.request(self._number, self, bool(self.of("CR1") & 0xC0))

    def send(self, _: int, value: int) -> None:
        """Send a byte."""
        self.machine.put(bytes((value & 0xFF,)))


class Stm32Timer(RegisterBlock):
    """TIMx: counts up, at the clock divided by PSC + 1, and interrupts when it begins again."""

    REGISTERS = (
        IoRegister("CR1", 0x00, 0, "CEN counts; OPM stops at the update"),
        *stored("CR2", "SMCR", first=0x04),
        IoRegister("DIER", 0x0C, 0, "UIE: the update interrupts"),
        IoRegister("SR", 0x10, 0, "UIF: the update came", "sr", "put_sr"),
        IoRegister("EGR", 0x14, 0, "UG: begin again", write="put_egr"),
        *stored("CCMR1", "CCMR2", "CCER", first=0x18),
        IoRegister("CNT", 0x24, 0, "the count", "cnt"),
        IoRegister("PSC", 0x28, 0, "divides the clock"),
        IoRegister("ARR", 0x2C, 0xFFFF, "the last count"),
        *stored("RCR", "CCR1", "CCR2", "CCR3", "CCR4", "BDTR", "DCR", "DMAR", "OR", first=0x30),
    )

    def __init__(
        self, machine: CpuMachine, name: str, base: int, processor: CortexM, number: int,
        wide: bool, clocks: Clocks,
    ) -> None:  # fmt: skip
        super().__init__(machine, name, base)
        self._clocks: Final = clocks
        clocks.changed.append(self._reclock)
        self._processor: Final = processor
        self._number: Final = number
        self._mask: Final = 0xFFFFFFFF if wide else 0xFFFF
        self.values[0x2C] = self._mask
        self._counter: Final = machine.counter(base + 0x24, self._mask + 1)
        self._held = 0
        """The count while it stands still."""

    def _catch_up(self) -> None:
        """Notice updates up to now."""
        counter = self._counter
        past = counter.rounds(self.machine.shared.clock)
        if not counter.on or past < 1:
            return
        counter.zero += past * counter.round
        self.values[0x10] |= 1
        self._ask()
        # CR1: with OPM the timer clears CEN at its update.
        if self.of("CR1") & 8:
            self.values[0x00] &= ~1
            self._held = counter.on = 0

    def _ask(self) -> None:
        """Interrupt as long as UIF stands and UIE lets it."""
        stands = bool(self.values[0x10] & self.of("DIER") & 1)
        self._processor.request(IRQ + self._number, self, stands)

    def write(self, offset: int, size: int, value: int) -> None:
        """Take what is written, after the updates up to now."""
        self._catch_up()
        count = self.cnt(0)
        super().write(offset, size, value)
        place = offset & ~3
        if place in (0x24, 0x2C):
            self.values[place] &= self._mask
        if place in (0x00, 0x24, 0x28, 0x2C):
            # Also a PSC, and an ARR without ARPE, count at once; in a part a PSC waits for the
            # next update (TIMx_PSC).
            self._restart(self.values[0x24] if place == 0x24 else count)
        self._ask()
        self._plan()

    def _restart(self, count: int) -> None:
        """Count from ``count`` on, as the registers are now."""
        counter = self._counter
        counter.divider = ((self.of("PSC") & 0xFFFF) + 1) * self._scale()
        counter.period = self.of("ARR") + 1
        self._held, counter.on = count, self.of("CR1") & 1
        counter.zero = self.machine.shared.clock - count * counter.divider

    def _scale(self) -> int:
        return self._clocks.timer_divider(int(self.base >= 0x40010000))

    def _reclock(self) -> None:
        """Count on at another clock."""
        if self._counter.divider != ((self.of("PSC") & 0xFFFF) + 1) * self._scale():
            self._catch_up()
            self._restart(self.cnt(0))
            self._plan()

    def _plan(self) -> None:
        self.machine.events.pop(self, None)
        counter = self._counter
        if counter.on and self.of("DIER") & 1:
            self.machine.events[self] = (counter.zero + counter.round, self._due)
            self.machine.look()

    def _due(self) -> None:
        self._catch_up()
        self._plan()

    def cnt(self, _: int) -> int:
        """The count."""
        counter = self._counter
        return counter.now(self.machine.shared.clock) if counter.on else self._held

    def sr(self, _: int) -> int:
        """What came."""
        self._catch_up()
        return self.of("SR")

    def put_sr(self, _: int, value: int) -> None:
        """A 0 clears."""
        self.values[0x10] &= value

    def put_egr(self, _: int, value: int) -> None:
        """Begin again; UIF comes, unless URS is set."""
        if value & 1:
            self._restart(0)
            # CR1: with URS only a count that runs over sets UIF.
            self.values[0x10] |= not self.of("CR1") & 4


class Storage(RegisterBlock):
    """Registers that are accepted, and do nothing."""

    REGISTERS = (IoRegister("R", 0x00, count=0x100),)


class Device(RegisterBlock):
    """What the factory wrote: the size of the flash, and a unique number."""

    REGISTERS = (
        # Electronic signature: at 1FFFF7E0h of an F1, from 1FFF7A10h on of an F4.
        IoRegister("SIZE", 0x3E0, 0xFFFF0200, "of an F1"),
        IoRegister("UID", 0x3E8, 1, "of an F1", count=3),
        IoRegister("UID", 0x210, 1, "of an F4", count=3),
        IoRegister("SIZE", 0x220, 0x0400 << 16, "of an F4"),
    )


class Stm32Family(Struct, frozen=True):
    """Where a family has its peripherals.

    Attributes:
        timers: base and interrupt of each, by its name.
        uarts: the same of each.
        clocks: what has its clock by the bits of each register of RCC, from bit 0 on.
        storage: base of what is accepted, and does nothing; its registers that are not 0 after a
            reset, by their offsets.
        named: base of what is not modelled; accesses there name it.
        places: base of RCC, EXTI, AFIO or SYSCFG, the first port, and what the factory wrote.
        ports: how many ports there are.
        dma: base of DMA1.
    """

    timers: dict[str, tuple[int, int]]
    uarts: dict[str, tuple[int, int]]
    clocks: dict[str, str]
    storage: dict[str, tuple[int, dict[int, int]]]
    named: dict[str, int]
    places: tuple[int, int, int, int, int]
    ports: int
    dma: int


_TIMERS: Final = {
    "TIM2": (0x40000000, 28), "TIM3": (0x40000400, 29), "TIM4": (0x40000800, 30),
    "TIM5": (0x40000C00, 50), "TIM6": (0x40001000, 54), "TIM7": (0x40001400, 55),
}  # fmt: skip
_UARTS: Final = {
    "USART2": (0x40004400, 38), "USART3": (0x40004800, 39), "UART4": (0x40004C00, 52),
    "UART5": (0x40005000, 53),
}  # fmt: skip
_NAMED: Final = {
    "RTC": 0x40002800, "WWDG": 0x40002C00, "SPI2": 0x40003800, "SPI3": 0x40003C00,
    "CAN1": 0x40006400, "CAN2": 0x40006800,
    "DAC": 0x40007400, "SPI1": 0x40013000, "CRC": 0x40023000,
}  # fmt: skip
_I2C: Final = (("I2C1", 0x40005400, 6, 7, 31), ("I2C2", 0x40005800, 10, 11, 33))
"""Name, base, the bits of port B for SCL and SDA, which are not moved elsewhere (AFIO), and the
interrupt of events."""
_APB1: Final = (
    "TIM2 TIM3 TIM4 TIM5 TIM6 TIM7 TIM12 TIM13 TIM14 - - WWDG - - SPI2 SPI3 - USART2 USART3 UART4"
    " UART5 I2C1 I2C2 {} - CAN1 CAN2 {} PWR DAC"
)
_IWDG: Final = (0x40003000, {0x08: 0xFFF})
# Of banks 1 to 4: BCR and BTR in turn, and BWTR.
_FSMC: Final = (
    0xA0000000,
    {0x00: 0x30DB, **dict.fromkeys(range(0x08, 0x20, 8), 0x30D2),
     **dict.fromkeys((*range(0x04, 0x20, 8), *range(0x104, 0x120, 8)), 0x0FFFFFFF)},
)  # fmt: skip
FAMILIES: Final = {
    "stm32f1": Stm32Family(
        {**_TIMERS, "TIM1": (0x40012C00, 25), "TIM8": (0x40013400, 44)},
        {**_UARTS, "USART1": (0x40013800, 37)},
        {
            "AHBENR": "DMA1 DMA2 - - - - CRC - FSMC",
            "APB2ENR": "AFIO - GPIOA GPIOB GPIOC GPIOD GPIOE GPIOF GPIOG ADC1 ADC2 TIM1 SPI1 TIM8"
            " USART1 ADC3",
            "APB1ENR": _APB1.format("USB", "BKP"),
        },
        {
            "IWDG": _IWDG, "FSMC": _FSMC, "PWR": (0x40007000, {}), "BKP": (0x40006C00, {}),
            "FLASH": (0x40022000, {0x00: 0x30}), "DBGMCU": (0xE0042000, {0x00: 0x10036414}),
        },
        {
            **_NAMED, "USB": 0x40005C00, "ADC1": 0x40012400, "ADC2": 0x40012800,
            "ADC3": 0x40013C00, "DMA2": 0x40020400,
        },
        (0x40021000, 0x40010400, 0x40010000, 0x40010800, 0x1FFFF400),
        7,
        0x40020000,
    ),
    "stm32f4": Stm32Family(
        {
            **_TIMERS, "TIM1": (0x40010000, 25), "TIM8": (0x40010400, 44),
            "TIM9": (0x40014000, 24), "TIM10": (0x40014400, 25), "TIM11": (0x40014800, 26),
            "TIM12": (0x40001800, 43), "TIM13": (0x40001C00, 44), "TIM14": (0x40002000, 45),
        },
        {**_UARTS, "USART1": (0x40011000, 37), "USART6": (0x40011400, 71)},
        {
            "AHB1ENR": "GPIOA GPIOB GPIOC GPIOD GPIOE GPIOF GPIOG GPIOH GPIOI - - - CRC - - - - - -"
            " - - DMA1 DMA2 - - ETH",
            "AHB3ENR": "FSMC",
            "APB2ENR": "TIM1 TIM8 - - USART1 USART6 - - ADC - - SDIO SPI1 SPI4 SYSCFG - TIM9 TIM10"
            " TIM11 - SPI5 SPI6",
            "APB1ENR": _APB1.format("I2C3", "-"),
        },
        {
            # VOS chooses scale 1, and VOSRDY says that the regulator is there.
            "IWDG": _IWDG, "FSMC": _FSMC, "PWR": (0x40007000, {0x00: 0x4000, 0x04: 0x4000}),
            "FLASH": (0x40023C00, {}), "DBGMCU": (0xE0042000, {0x00: 0x10076413}),
        },
        {
            **_NAMED, "I2C3": 0x40005C00, "ADC": 0x40012000, "SDIO": 0x40012C00,
            "SPI4": 0x40013400, "SPI5": 0x40015000, "SPI6": 0x40015400, "DMA2": 0x40026400,
            "ETH": 0x40028000,
        },
        (0x40023800, 0x40013C00, 0x40013800, 0x40020000, 0x1FFF7800),
        9,
        0x40026000,
    ),
}  # fmt: skip


def equip(machine: CpuMachine, processor: CortexM, name: str) -> None:
    """Give a Cortex-M the peripherals of its family."""
    family, f4 = FAMILIES[name], name == "stm32f4"
    rcc, exti, sources, ports, device = family.places
    clocks = (Clocks4 if f4 else Clocks)(machine, "RCC", rcc)
    enables = {
        one: (clocks, register, bit)
        for register, ones in family.clocks.items()
        for bit, one in enumerate(ones.split())
    }

    def add(block: RegisterBlock, size: int = 0x400) -> None:
        block.enable = enables.get(block.name)
        machine.add(block, size)

    dma = (Dma4 if f4 else Dma)(machine, "DMA1", family.dma, processor)
    choice = Choice(machine, "SYSCFG" if f4 else "AFIO", sources)
    for block in (clocks, dma, choice,
                  ExternalInterrupts(machine, "EXTI", exti, processor, choice),
                  Device(machine, "DEVICE", device)):  # fmt: skip
        add(block)
    for name, base in family.named.items():
        add(RegisterBlock(machine, name, base))
    for number, letter in enumerate("ABCDEFGHI"[: family.ports]):
        port = (Port4 if f4 else Port1)(machine, f"GPIO{letter}", ports + 0x400 * number)
        add(port)
        for name, place, scl, sda, number in _I2C if letter == "B" else ():
            add(
                I2cMaster(
                    machine, name, place, port.bits, port.lend, scl, sda, number, processor, dma
                )
            )
    for name, (base, number) in family.timers.items():
        wide = f4 and name in ("TIM2", "TIM5")
        add(Stm32Timer(machine, name, base, processor, number, wide, clocks))
    for name, (base, number) in family.uarts.items():
        add(SerialPort(machine, name, base, processor, number, dma))
    for name, (base, resets) in family.storage.items():
        add(Storage(machine, name, base, resets), 0x1000 if name == "FSMC" else 0x400)
    for control in (SystemControl(machine, "SCS", 0xE000E000, processor, f4),
                    Trace(machine, "DWT", 0xE0001000),
                    Storage(machine, "ITM", 0xE0000000)):  # fmt: skip
        add(control, 0x1000)
    # Peripherals, their bits, the FSMC's registers, the processor's own, and the system memory.
    machine.window(0x40000000, 0x80000)
    machine.window(0x42000000, 0x1000000)
    machine.window(0xA0000000, 0x1000)
    machine.window(0xE0000000, 0x100000)
    machine.window(device & ~0xFFF, 0x1000)
    machine.translate = _BitBand(machine).access


class _BitBand:
    """Bits of the peripherals as words of their own, from 42000000h on."""

    def __init__(self, machine: CpuMachine) -> None:
        self._machine: Final = machine

    def access(self, address: int, size: int, value: int | None) -> int | None:
        """Read or write a bit; None: the address is none of these."""
        if not 0x42000000 <= address < 0x43000000:
            return None
        # The word at 42000000h + 32 * byte + 4 * bit is that bit (ARMv7-M, bit-banding).
        place, bit = 0x40000000 + (address - 0x42000000 >> 5 & ~3), address >> 2 & 31
        word = self._machine.peripheral_read(place, 4)
        if value is None:
            return word >> bit & 1
        word = (word & ~(1 << bit)) | (value & 1) << bit
        self._machine.peripheral_write(place, 4, word)
        return 0


def build(machine: CpuMachine) -> None:
    """Make an STM32 of a machine."""
    section = machine.section
    processor = machine.processor = CortexM(machine)
    machine.memory(section.rom, section.rom_size, False, also=0)
    machine.memory(section.ram, section.ram_size, True)
    if section.family == "stm32f4":
        machine.memory(0x10000000, 0x10000, True)  # CCM
    equip(machine, processor, section.family)
    ports = FAMILIES[section.family].ports
    machine.has_ports(range(ports), f"ports A to {'ABCDEFGHI'[ports - 1]}")
    machine.card_windows(0xE0000000)
