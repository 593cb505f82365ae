"""STM32 firmware, with HAL and with the Standard Peripheral Library, compiled for the PC."""

import subprocess
from collections.abc import Callable
from pathlib import Path

import pytest

from tests.shims.conftest import EXAMPLES, Run, compile_for, flags, require
from tests.shims.test_shims import AVR, CONTROL, DATA, pins

Driver = Callable[..., Path]
FOLDER = EXAMPLES / "lm629_stm32"

WIRES = (
    "".join(f'PB{bit + 8} = "D{bit}"\n' for bit in range(8))
    + 'PA4 = "/CS"\nPA5 = "/PS"\nPA6 = "/RD"\nPA7 = "/WR"\nPC13 = "/RST"\n'
)

F1 = """
#include "stm32f10x.h"
#include <stdio.h>
void init(void)
{
    RCC->APB2ENR |= RCC_APB2ENR_IOPAEN | RCC_APB2ENR_IOPBEN | RCC_APB2ENR_IOPCEN;
    GPIOA->BSRR = 0xF0;
    GPIOA->CRL = (GPIOA->CRL & 0x0000FFFF) | 0x33330000;
    GPIOB->CRH = 0x44444444;
}
uint8_t status(void)
{
    uint8_t byte;
    GPIOA->BRR = 0x30;          /* /CS, /PS */
    GPIOA->BSRR = 0x40 << 16;   /* /RD */
    byte = GPIOB->IDR >> 8;
    GPIOA->BSRR = 0x70;
    return byte;
}
"""


def test_the_example_makes_the_same_cycles_with_either_library(tmp_path: Path, run: Run) -> None:
    board = (FOLDER / "board.toml").read_text()
    told = []
    for library in ("stdperiph", "hal"):
        program = compile_for(
            "stm32", tmp_path / library, f"-I{FOLDER.parent / 'lm629_c'}", FOLDER / "main.c",
            FOLDER / f"{library}.c", FOLDER.parent / "lm629_c" / "lm629_driver.c",
        )  # fmt: skip
        ran = run(program, board)
        assert ran.said == (FOLDER / "expected.txt").read_text()
        assert "x w 0 01" in ran.bus
        told.append([line for line in ran.bus if " w " in line])
    assert told[0] == told[1]


@pytest.mark.parametrize("time", ["slaved", "lockstep", "realtime"])
def test_a_delay_that_only_waits_for_ticks_takes_chip_time(
    driver: Driver, run: Run, time: str
) -> None:
    """Three ticks of 72000 clock periods, of 13888 ps here; in lockstep 100 us more at most."""
    program = driver(
        "stm32",
        F1
        + """
static __IO uint32_t left;
void SysTick_Handler(void) { if (left) left--; }
int main(void)
{
    SysTick_Config(SystemCoreClock / 1000);
    init();
    left = 3;
    while (left)
        ;
    printf("%02X\\n", status());
    return 0;
}
""",
    )
    ran = run(program, pins(time, wires=WIRES))
    assert (ran.said, ran.bus) == ("84\n", ["x r 0 84"])
    if time != "realtime":
        assert 0 <= ran.when - 3 * 72000 * 13888 < (5_000_000 if time == "slaved" else 120_000_000)


def test_a_loop_that_counts_takes_chip_time(driver: Driver, run: Run) -> None:
    program = driver(
        "stm32",
        F1 + "int main(void) { init(); for (volatile int i = 0; i < 72000; i++) ;"
        ' printf("%02X\\n", status()); return 0; }',
    )
    ran = run(program, pins(wires=WIRES))
    assert ran.said == "84\n"
    assert 3_000_000_000 < ran.when < 10_000_000_000


PINS_F4 = """
#include "stm32f4xx.h"
#include "stm32f4xx_gpio.h"
#include "stm32f4xx_rcc.h"
#include <stdio.h>
#define PUT(pins) printf("%04X ", (pins))
int main(void)
{
    GPIO_InitTypeDef how;
    RCC_AHB1PeriphClockCmd(RCC_AHB1Periph_GPIOD, ENABLE);
    GPIO_StructInit(&how);
    how.GPIO_Pin = GPIO_Pin_0 | GPIO_Pin_1;
    how.GPIO_Mode = GPIO_Mode_IN;
    how.GPIO_PuPd = GPIO_PuPd_DOWN;
    GPIO_Init(GPIOD, &how);
    PUT(GPIO_ReadInputData(GPIOD) & 0xF);   /* pulled down, and floating */
    how.GPIO_Pin = GPIO_Pin_2;
    how.GPIO_Mode = GPIO_Mode_OUT;
    how.GPIO_OType = GPIO_OType_OD;
    GPIO_Init(GPIOD, &how);
    PUT(GPIO_ReadInputData(GPIOD) & 0xF);   /* open drain, low */
    GPIOD->BSRRL = GPIO_Pin_2;
    PUT(GPIO_ReadInputData(GPIOD) & 0xF);   /* let go */
    GPIO_ToggleBits(GPIOD, GPIO_Pin_2);
    PUT(GPIO_ReadInputDataBit(GPIOD, GPIO_Pin_2));
    PUT(GPIOD->MODER & 0xFF);
    PUT((uint16_t)GPIOD->OTYPER);
    GPIOD->BSRR = 1U << 2 | 1U << 18;       /* set wins */
    PUT(GPIO_ReadOutputData(GPIOD));
    return 0;
}
"""


def test_pulls_open_drain_and_the_two_halves_of_bsrr(driver: Driver, run: Run) -> None:
    wires = WIRES + 'PD9 = "HI"\n'
    ran = run(driver("stm32", PINS_F4), pins(wires=wires))
    assert ran.said == "000C 0008 000C 0000 0010 0004 0004 "


def test_a_port_without_its_clock_takes_nothing_and_says_so(driver: Driver, run: Run) -> None:
    program = driver(
        "stm32",
        F1.replace("RCC_APB2ENR_IOPAEN | ", "") + "int main(void) { init(); return status(); }",
    )
    ran = run(program, pins(wires=WIRES), code=0xFF)
    assert ran.bus == []
    assert ran.errors == (
        "vbus: GPIOA is used while its clock is off: it reads 0 and takes no writes; enable the"
        " clock in RCC first\n"
    )


def test_an_endless_loop_ends_at_the_limit(driver: Driver, run: Run) -> None:
    """Its turns are chip time here: the loop needs no access to the bus."""
    program = driver(
        "stm32", F1 + "volatile int never; int main(void) { init(); while (!never) ; }"
    )
    ran = run(program, pins(wires=WIRES), code=1, VBUS_LIMIT_MS="5", VBUS_UNTIL="done")
    assert ran.errors == "vbus: done did not come within 5 ms\n"


@pytest.mark.parametrize(
    ("header", "use", "named"),
    [
        ("stm32f10x.h", "TIM2->CNT = 0;", "TIM2"),
        ("stm32f10x.h", "GPIOA->MODER = 0;", "MODER"),
        ("stm32f10x_i2c.h", "I2C1->DR = 0;", "DR"),
        ("stm32f4xx_hal.h", "GPIOA->CRL = 0;", "CRL"),
        ("stm32f4xx_hal.h", "HAL_SPI_Transmit(0, 0, 0, 0);", "HAL_SPI_Transmit"),
        ("stm32f1xx_hal.h", "*(volatile uint32_t *)(GPIOA_BASE + 12) = 0;", "GPIOA_BASE"),
    ],
)
def test_what_is_not_there_is_named_by_the_compiler(
    tmp_path: Path, header: str, use: str, named: str
) -> None:
    source = tmp_path / "driver.c"
    source.write_text(f'#include "{header}"\nint main(void) {{ {use} return 0; }}\n')
    options = [word for word in flags("stm32") if word.startswith("-")]
    done = subprocess.run(
        [require("g++"), *options, "-c", "-o", str(tmp_path / "x.o"), str(source)],
        capture_output=True,
        text=True,
    )
    assert done.returncode != 0
    assert named in done.stderr.splitlines()[1]


def test_a_pin_map_of_16_bits_is_nothing_for_a_microcontroller_of_8(
    driver: Driver, run: Run
) -> None:
    program = driver("avr", AVR + "int main(void) { init(); return in(1); }", "-DF_CPU=16000000UL")
    ran = run(program, pins(wires=CONTROL + DATA.replace("PB7", "PB12")), code=4)
    assert ran.errors == "vbus: the pin map wires a port bit above 7, and a port has 8 bits here\n"
