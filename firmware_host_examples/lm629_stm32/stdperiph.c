/* stdperiph.c - an LM629 on the pins of an STM32F103 (72 MHz), with the Standard Peripheral Library.
 *
 *     D0-D7   PB8-PB15       /CS  PA4      /RD   PA6      /RST  PC13
 *     HI      PA0 (EXTI0)    /PS  PA5      /WR   PA7
 *
 * PB8 to PB15 are the bits of CRH: one store turns the data bus round, and one store to BSRR drives
 * all eight bits of it.
 */
#include "lm629_bus.h"
#include "lm629_driver.h"

#include "stm32f10x.h"
#include "stm32f10x_exti.h"
#include "stm32f10x_gpio.h"
#include "stm32f10x_rcc.h"
#include "stm32f10x_usart.h"
#include "misc.h"

#define CS GPIO_Pin_4
#define PS GPIO_Pin_5
#define RD GPIO_Pin_6
#define WR GPIO_Pin_7
#define RST GPIO_Pin_13
#define HI GPIO_Pin_0

#define DATA_OUT() (GPIOB->CRH = 0x33333333) /* push-pull, 50 MHz */
#define DATA_IN() (GPIOB->CRH = 0x44444444)  /* floating */

volatile uint8_t lm629_interrupted;

static __IO uint32_t ticks_left;

void SysTick_Handler(void)
{
    if (ticks_left != 0)
        ticks_left--;
}

void EXTI0_IRQHandler(void)
{
    if (EXTI_GetITStatus(EXTI_Line0) != RESET) {
        EXTI_ClearITPendingBit(EXTI_Line0);
        lm629_interrupted = 1;
    }
}

void lm629_bus_delay_ms(uint32_t milliseconds)
{
    ticks_left = milliseconds + 1; /* the first tick may come at once */
    while (ticks_left != 0)
        ;
}

static void write_cycle(uint8_t data)
{
    GPIO_ResetBits(GPIOA, CS);
    GPIOB->BSRR = (uint32_t)0xFF << 24 | (uint32_t)data << 8;
    DATA_OUT();
    GPIO_ResetBits(GPIOA, WR);
    __NOP(); /* /WR is low for 100 ns: with the calls some 8 clock periods */
    __NOP();
    __NOP();
    GPIO_SetBits(GPIOA, WR);
    GPIO_SetBits(GPIOA, CS);
    DATA_IN();
}

static uint8_t read_cycle(void)
{
    uint8_t turn, data;

    GPIO_ResetBits(GPIOA, CS);
    GPIO_ResetBits(GPIOA, RD);
    for (turn = 0; turn < 4; turn++) /* access time 180 ns */
        __NOP();
    data = (uint8_t)(GPIO_ReadInputData(GPIOB) >> 8);
    GPIO_SetBits(GPIOA, RD);
    GPIO_SetBits(GPIOA, CS);
    return data;
}

uint8_t lm629_bus_read_status(void)
{
    GPIO_ResetBits(GPIOA, PS);
    return read_cycle();
}

void lm629_bus_write_command(uint8_t command)
{
    GPIO_ResetBits(GPIOA, PS);
    write_cycle(command);
}

uint8_t lm629_bus_read_data(void)
{
    GPIO_SetBits(GPIOA, PS);
    return read_cycle();
}

void lm629_bus_write_data(uint8_t data)
{
    GPIO_SetBits(GPIOA, PS);
    write_cycle(data);
}

void console_write(char character)
{
    while (USART_GetFlagStatus(USART1, USART_FLAG_TXE) == RESET)
        ;
    USART_SendData(USART1, (uint8_t)character);
}

static void interrupt_init(void)
{
    EXTI_InitTypeDef line;
    NVIC_InitTypeDef vector;

    GPIO_EXTILineConfig(GPIO_PortSourceGPIOA, GPIO_PinSource0);
    line.EXTI_Line = EXTI_Line0;
    line.EXTI_Mode = EXTI_Mode_Interrupt;
    line.EXTI_Trigger = EXTI_Trigger_Rising;
    line.EXTI_LineCmd = ENABLE;
    EXTI_Init(&line);
    vector.NVIC_IRQChannel = EXTI0_IRQn;
    vector.NVIC_IRQChannelPreemptionPriority = 1;
    vector.NVIC_IRQChannelSubPriority = 0;
    vector.NVIC_IRQChannelCmd = ENABLE;
    NVIC_Init(&vector);
}

void lm629_bus_init(void)
{
    GPIO_InitTypeDef pins;
    USART_InitTypeDef line;

    SysTick_Config(SystemCoreClock / 1000);
    RCC_APB2PeriphClockCmd(RCC_APB2Periph_GPIOA | RCC_APB2Periph_GPIOB | RCC_APB2Periph_GPIOC
                               | RCC_APB2Periph_AFIO | RCC_APB2Periph_USART1,
                           ENABLE);
    GPIO_SetBits(GPIOA, CS | PS | RD | WR);
    pins.GPIO_Pin = CS | PS | RD | WR;
    pins.GPIO_Mode = GPIO_Mode_Out_PP;
    pins.GPIO_Speed = GPIO_Speed_50MHz;
    GPIO_Init(GPIOA, &pins);
    pins.GPIO_Pin = RST;
    GPIO_Init(GPIOC, &pins);
    pins.GPIO_Pin = HI;
    pins.GPIO_Mode = GPIO_Mode_IN_FLOATING;
    GPIO_Init(GPIOA, &pins);
    DATA_IN();
    line.USART_BaudRate = 115200;
    line.USART_WordLength = USART_WordLength_8b;
    line.USART_StopBits = USART_StopBits_1;
    line.USART_Parity = USART_Parity_No;
    line.USART_Mode = USART_Mode_Tx;
    line.USART_HardwareFlowControl = USART_HardwareFlowControl_None;
    USART_Init(USART1, &line);
    USART_Cmd(USART1, ENABLE);
    GPIO_ResetBits(GPIOC, RST);
    lm629_bus_delay_ms(1);
    GPIO_SetBits(GPIOC, RST);
    lm629_bus_delay_ms(2); /* the reset takes up to 1.5 ms */
    interrupt_init();
}
