/* main.c - an STM32F103 at 72 MHz with an LM629 on its port bits and an MCP-1200 on its FSMC.
 *
 *     LM629   D0-D7   PB8-PB15     /RD  PA2     HI    PA5 (EXTI5)
 *             /PS     PA1          /WR  PA3     /RST  PA4
 *             /CS     Y5 of a 74HC138: A, B, C are PC0, PC1, PC2, /G2A is PC3
 *     MCP-1200        register n at 60000000h + n (NE1, 8 bits)
 *
 * The drivers are those of ../lm629_c and ../mcp1200_c.
 */
#include "lm629_driver.h"
#include "mcp1200_driver.h"
#include "stm32f103.h"

#define PS 0x02
#define RD 0x04
#define WR 0x08
#define RST 0x10
#define NEAR 6         /* counts: a motor hangs back under its friction */
#define CHIP 5         /* which output of the decoder */
#define NO_CHIP 0x08   /* /G2A high */
#define OUTPUTS 0x33333333
#define FLOATING 0x44444444
#define MCP1200 ((__IO uint8_t *)0x60000000)

static volatile uint32_t milliseconds, interrupts;

void SysTick_Handler(void)
{
    milliseconds++;
}

void EXTI9_5_IRQHandler(void)
{
    EXTI->PR = 1 << 5;
    interrupts++;
}

/* --- time: TIM2 counts microseconds ------------------------------------------------------------ */

static void pause_us(unsigned us)
{
    uint16_t began = (uint16_t)TIM2->CNT;

    while ((uint16_t)((uint16_t)TIM2->CNT - began) <= us)
        ;
}

static void pause_ms(uint32_t ms)
{
    uint32_t began = milliseconds;

    while (milliseconds - began <= ms)
        __asm__ volatile("wfi");
}

/* --- the LM629 on port bits -------------------------------------------------------------------- */

static void select_chip(void)
{
    GPIOC->BSRR = CHIP | (uint32_t)(~CHIP & 7) << 16;
    GPIOC->BRR = NO_CHIP;
}

static uint8_t read_cycle(void)
{
    uint8_t data;

    select_chip();
    GPIOA->BRR = RD;
    __asm__ volatile("nop\n\tnop\n\tnop\n\tnop\n\tnop\n\tnop\n\tnop\n\tnop\n\tnop\n\tnop\n\t"
                     "nop\n\tnop\n\tnop\n\tnop"); /* 180 ns */
    data = (uint8_t)(GPIOB->IDR >> 8);
    GPIOA->BSRR = RD;
    GPIOC->BSRR = NO_CHIP;
    return data;
}

static void write_cycle(uint8_t data)
{
    select_chip();
    GPIOA->BRR = WR;
    GPIOB->ODR = (uint32_t)data << 8;
    GPIOB->CRH = OUTPUTS;
    __asm__ volatile("nop\n\tnop\n\tnop\n\tnop\n\tnop\n\tnop\n\tnop\n\tnop"); /* 100 ns */
    GPIOA->BSRR = WR;
    __asm__ volatile("nop\n\tnop\n\tnop\n\tnop\n\tnop\n\tnop\n\tnop\n\tnop\n\tnop"); /* hold */
    GPIOC->BSRR = NO_CHIP;
    GPIOB->CRH = FLOATING;
}

uint8_t lm629_bus_read_status(void)
{
    GPIOA->BRR = PS;
    return read_cycle();
}

void lm629_bus_write_command(uint8_t command)
{
    GPIOA->BRR = PS;
    write_cycle(command);
}

uint8_t lm629_bus_read_data(void)
{
    GPIOA->BSRR = PS;
    return read_cycle();
}

void lm629_bus_write_data(uint8_t data)
{
    GPIOA->BSRR = PS;
    write_cycle(data);
}

/* --- the MCP-1200 on the FSMC ------------------------------------------------------------------ */

uint8_t mcp1200_bus_read(uint8_t reg)
{
    return MCP1200[reg];
}

void mcp1200_bus_write(uint8_t reg, uint8_t data)
{
    MCP1200[reg] = data;
}

void mcp1200_pause_us(unsigned us)
{
    pause_us(us);
}

/* --- USART1 ------------------------------------------------------------------------------------ */

static void put(char c)
{
    while (!(USART1->SR & USART_SR_TXE))
        ;
    USART1->DR = (uint8_t)c;
}

static void say(const char *text)
{
    while (*text != '\0')
        put(*text++);
}

static void say_number(int32_t number)
{
    char digits[10];
    uint32_t rest = number < 0 ? 0 - (uint32_t)number : (uint32_t)number;
    unsigned count = 0;

    if (number < 0)
        put('-');
    do {
        digits[count++] = (char)('0' + rest % 10);
        rest /= 10;
    } while (rest);
    while (count)
        put(digits[--count]);
}

static int failed(int result, const char *what)
{
    if (result == 0)
        return 0;
    say(what);
    say(": failed\n");
    return 1;
}

/* --- the program ------------------------------------------------------------------------------- */

static void begin(void)
{
    RCC->CR |= RCC_CR_HSEON;
    while (!(RCC->CR & RCC_CR_HSERDY))
        ;
    RCC->CFGR |= RCC_CFGR_PLL_9_X_HSE;
    RCC->CR |= RCC_CR_PLLON;
    while (!(RCC->CR & RCC_CR_PLLRDY))
        ;
    RCC->CFGR |= RCC_CFGR_SW_PLL;
    while (!(RCC->CFGR & RCC_CFGR_SWS_PLL))
        ;
    RCC->AHBENR |= RCC_AHBENR_FSMCEN;
    RCC->APB2ENR |= RCC_APB2ENR_AFIOEN | RCC_APB2ENR_IOPAEN | RCC_APB2ENR_IOPBEN
                    | RCC_APB2ENR_IOPCEN | RCC_APB2ENR_USART1EN;
    RCC->APB1ENR |= RCC_APB1ENR_TIM2EN;

    TIM2->PSC = 72 - 1;
    TIM2->ARR = 0xFFFF;
    TIM2->EGR = TIM_EGR_UG;
    TIM2->CR1 = TIM_CR1_CEN;
    SysTick->LOAD = 72000 - 1;
    SysTick->VAL = 0;
    SysTick->CTRL = SysTick_CTRL_CLKSOURCE | SysTick_CTRL_TICKINT | SysTick_CTRL_ENABLE;
    USART1->BRR = 0x271; /* 115200 baud */
    USART1->CR1 = 0x2008;
    FSMC_Bank1->BTCR[0] = 0x1081; /* NE1: SRAM, 8 bits, writes allowed */
    FSMC_Bank1->BTCR[1] = 0x0F0F;

    GPIOC->BSRR = NO_CHIP;
    GPIOC->CRL = (FLOATING & 0xFFFF0000) | (OUTPUTS & 0x0000FFFF);
    GPIOA->BSRR = PS | RD | WR | RST;
    GPIOA->CRL = (FLOATING & 0xFFF0000F) | (OUTPUTS & 0x000FFFF0);
    GPIOA->BRR = RST;
    pause_us(12);
    GPIOA->BSRR = RST;
    AFIO->EXTICR[1] = 0; /* EXTI5 is PA5 */
    EXTI->RTSR = 1 << 5;
    EXTI->IMR = 1 << 5;
    NVIC_ISER[EXTI9_5_IRQn / 32] = 1 << EXTI9_5_IRQn % 32;
    pause_ms(2); /* the reset takes up to 1.5 ms */
}

/* The LM629 interrupts when a trajectory is complete. */
static void unmask(void)
{
    while (lm629_bus_read_status() & LM629_BUSY)
        ;
    lm629_bus_write_command(0x1C); /* MSKI */
    while (lm629_bus_read_status() & LM629_BUSY)
        ;
    lm629_bus_write_data(0);
    lm629_bus_write_data(LM629_TRAJECTORY_COMPLETE);
}

static int move_lm629(int32_t target)
{
    struct lm629_move move = { 0, 167772, 2150 };
    int32_t real = 0;
    uint32_t came;

    move.position = target;
    if (failed(lm629_clear_flags(LM629_TRAJECTORY_COMPLETE), "RSTI"))
        return 1;
    came = interrupts;
    if (failed(lm629_start(&move), "LTRJ, STT"))
        return 1;
    while (interrupts == came)
        __asm__ volatile("wfi");
    pause_ms(40);
    if (failed(lm629_clear_flags(LM629_TRAJECTORY_COMPLETE), "RSTI")) /* HI falls */
        return 1;
    if (failed(lm629_check_move(target, &real), "move"))
        return 1;
    say("LM629 at ");
    say_number(real);
    put('\n');
    return 0;
}

static int move_mcp1200(int32_t target)
{
    struct mcp1200_move move = { 0, 40, 0x0080, 0 };
    int32_t real, command;

    move.final = target;
    if (failed(mcp1200_begin(&move), "profile"))
        return 1;
    while (mcp1200_flags() & MCP1200_F_PROFILE)
        pause_ms(1);
    pause_ms(60);
    real = mcp1200_position();
    command = mcp1200_command_position();
    say("MCP-1200 at ");
    say_number(real);
    say(", command ");
    say_number(command);
    put('\n');
    return failed(command != target || real < target - NEAR || real > target + NEAR, "move");
}

int main(void)
{
    static const struct lm629_filter filter = { 200, 200, 2000, 20000, 0 };
    static const struct mcp1200_pid pid = { 30, 120, 80 };
    uint8_t first = 0, cleared = 0, status = 0;

    begin();
    if (failed(lm629_check_reset(&first, &cleared), "LM629 reset")
        || failed(mcp1200_check_reset(&status), "MCP-1200 reset")
        || failed(lm629_load_filter(&filter), "LFIL, UDF")
        || failed(mcp1200_start(&pid), "control mode"))
        return 1;
    unmask();
    if (move_lm629(1000) || move_mcp1200(6000) || move_lm629(-500) || move_mcp1200(0))
        return 1;
    say_number((int32_t)interrupts);
    say(" interrupts\ndone\n");
    return 0;
}
