/* arm.h - a Cortex-M without a library: vectors, console, registers. */
#include <stdint.h>

#define R(address) (*(volatile uint32_t *)(address))
#define R8(address) (*(volatile uint8_t *)(address))
#define CLOCKS R(0x40021018)
#define GPIOA 0x40010800
#define GPIOB 0x40010C00
#define GPIOC 0x40011000
#define UNUSED __attribute__((unused)) static

int main(void);

UNUSED void put(const char *text)
{
    while (*text != '\0')
        R(0x40004404) = (uint8_t)*text++; /* USART2, at one place in both families */
}

UNUSED void number(uint32_t value)
{
    char text[12], *end = text + 11;

    *end = '\0';
    do
        *--end = (char)('0' + value % 10);
    while (value /= 10);
    put(end);
    put("\n");
}

/* The clocks of all that is not a port, of an F4 or an F1. */
static void clock_all(void)
{
    int f4 = (R(0xE000ED00) & 0xF0) == 0x40;

    R(f4 ? 0x40023830 : 0x40021014) = f4 ? 0x600000 : 0x103;
    R(f4 ? 0x40023840 : 0x4002101C) = ~0u;
    R(f4 ? 0x40023844 : 0x40021018) = f4 ? ~0u : 0x7801;
}

void reset(void)
{
    clock_all();
    register int result __asm__("r0") = main();

    __asm__ volatile("cpsid i\n\tb ." : : "r"(result));
}
