/* hal.c - an LM629 on the pins of an STM32F407 (168 MHz), with HAL. The pins are those of stdperiph.c:
 *
 *     D0-D7   PB8-PB15       /CS  PA4      /RD   PA6      /RST  PC13
 *     HI      PA0 (EXTI0)    /PS  PA5      /WR   PA7
 */
#include "lm629_bus.h"
#include "lm629_driver.h"

#include "stm32f4xx_hal.h"

#define CS GPIO_PIN_4
#define PS GPIO_PIN_5
#define RD GPIO_PIN_6
#define WR GPIO_PIN_7
#define RST GPIO_PIN_13
#define HI GPIO_PIN_0
#define DATA_PINS 0xFF00
#define DATA_MODER 0xFFFF0000 /* two bits each */
#define DATA_OUTPUTS 0x55550000

volatile uint8_t lm629_interrupted;

static UART_HandleTypeDef huart2;

void SysTick_Handler(void)
{
    HAL_IncTick();
}

void EXTI0_IRQHandler(void)
{
    HAL_GPIO_EXTI_IRQHandler(HI);
}

void HAL_GPIO_EXTI_Callback(uint16_t pin)
{
    if (pin == HI)
        lm629_interrupted = 1;
}

void lm629_bus_delay_ms(uint32_t milliseconds)
{
    HAL_Delay(milliseconds);
}

/* A quarter of a microsecond, by the counter of clock periods. */
static void pause(void)
{
    uint32_t begun = DWT->CYCCNT;

    while (DWT->CYCCNT - begun < SystemCoreClock / 4000000)
        ;
}

static void write_cycle(uint8_t data)
{
    HAL_GPIO_WritePin(GPIOA, CS, GPIO_PIN_RESET);
    GPIOB->ODR = (GPIOB->ODR & ~DATA_PINS) | (uint32_t)data << 8;
    MODIFY_REG(GPIOB->MODER, DATA_MODER, DATA_OUTPUTS);
    HAL_GPIO_WritePin(GPIOA, WR, GPIO_PIN_RESET);
    pause();
    HAL_GPIO_WritePin(GPIOA, WR, GPIO_PIN_SET);
    HAL_GPIO_WritePin(GPIOA, CS, GPIO_PIN_SET);
    CLEAR_BIT(GPIOB->MODER, DATA_MODER);
}

static uint8_t read_cycle(void)
{
    uint8_t data = 0, bit;

    HAL_GPIO_WritePin(GPIOA, CS, GPIO_PIN_RESET);
    HAL_GPIO_WritePin(GPIOA, RD, GPIO_PIN_RESET);
    pause();
    for (bit = 0; bit < 8; bit++)
        if (HAL_GPIO_ReadPin(GPIOB, GPIO_PIN_8 << bit) == GPIO_PIN_SET)
            data |= 1 << bit;
    HAL_GPIO_WritePin(GPIOA, RD, GPIO_PIN_SET);
    HAL_GPIO_WritePin(GPIOA, CS, GPIO_PIN_SET);
    return data;
}

uint8_t lm629_bus_read_status(void)
{
    HAL_GPIO_WritePin(GPIOA, PS, GPIO_PIN_RESET);
    return read_cycle();
}

void lm629_bus_write_command(uint8_t command)
{
    HAL_GPIO_WritePin(GPIOA, PS, GPIO_PIN_RESET);
    write_cycle(command);
}

uint8_t lm629_bus_read_data(void)
{
    HAL_GPIO_WritePin(GPIOA, PS, GPIO_PIN_SET);
    return read_cycle();
}

void lm629_bus_write_data(uint8_t data)
{
    HAL_GPIO_WritePin(GPIOA, PS, GPIO_PIN_SET);
    write_cycle(data);
}

void console_write(char character)
{
    HAL_UART_Transmit(&huart2, (uint8_t *)&character, 1, HAL_MAX_DELAY);
}

void lm629_bus_init(void)
{
    GPIO_InitTypeDef pins = {0};

    HAL_Init();
    CoreDebug->DEMCR |= CoreDebug_DEMCR_TRCENA_Msk;
    DWT->CTRL |= DWT_CTRL_CYCCNTENA_Msk;
    __HAL_RCC_GPIOA_CLK_ENABLE();
    __HAL_RCC_GPIOB_CLK_ENABLE();
    __HAL_RCC_GPIOC_CLK_ENABLE();
    __HAL_RCC_USART2_CLK_ENABLE();
    huart2.Instance = USART2;
    huart2.Init.BaudRate = 115200;
    huart2.Init.WordLength = UART_WORDLENGTH_8B;
    huart2.Init.StopBits = UART_STOPBITS_1;
    huart2.Init.Parity = UART_PARITY_NONE;
    huart2.Init.Mode = UART_MODE_TX_RX;
    HAL_UART_Init(&huart2);
    HAL_GPIO_WritePin(GPIOA, CS | PS | RD | WR, GPIO_PIN_SET);
    HAL_GPIO_WritePin(GPIOC, RST, GPIO_PIN_RESET);
    pins.Pin = CS | PS | RD | WR;
    pins.Mode = GPIO_MODE_OUTPUT_PP;
    pins.Pull = GPIO_NOPULL;
    pins.Speed = GPIO_SPEED_FREQ_HIGH;
    HAL_GPIO_Init(GPIOA, &pins);
    pins.Pin = RST;
    HAL_GPIO_Init(GPIOC, &pins);
    pins.Pin = DATA_PINS;
    pins.Mode = GPIO_MODE_INPUT;
    HAL_GPIO_Init(GPIOB, &pins);
    HAL_Delay(1);
    HAL_GPIO_WritePin(GPIOC, RST, GPIO_PIN_SET);
    HAL_Delay(2); /* the reset takes up to 1.5 ms */
    pins.Pin = HI;
    pins.Mode = GPIO_MODE_IT_RISING;
    HAL_GPIO_Init(GPIOA, &pins);
    HAL_NVIC_SetPriority(EXTI0_IRQn, 1, 0);
    HAL_NVIC_EnableIRQ(EXTI0_IRQn);
}
