/* vbus_hal.h - the functions of HAL: GPIO, delays, clock enables, NVIC, UART; see vbus_stm32.h.
 * License: Apache-2.0. */
#ifndef VBUS_SHIM_STM32_HAL_H
#define VBUS_SHIM_STM32_HAL_H

enum HAL_StatusTypeDef { HAL_OK, HAL_ERROR, HAL_BUSY, HAL_TIMEOUT };
#define HAL_MAX_DELAY 0xFFFFFFFFU

/* Mode: its two low bits, 10h open drain, 10000h interrupt, 100000h rising and 200000h falling. */
enum : uint32_t {
    GPIO_MODE_INPUT = 0, GPIO_MODE_OUTPUT_PP = 1, GPIO_MODE_OUTPUT_OD = 0x11, GPIO_MODE_AF_PP = 2,
    GPIO_MODE_AF_OD = 0x12, GPIO_MODE_ANALOG = 3, GPIO_MODE_IT_RISING = 0x110000,
    GPIO_MODE_IT_FALLING = 0x210000, GPIO_MODE_IT_RISING_FALLING = 0x310000
};
enum : uint32_t { GPIO_NOPULL, GPIO_PULLUP, GPIO_PULLDOWN };
enum : uint32_t { GPIO_SPEED_FREQ_LOW, GPIO_SPEED_FREQ_MEDIUM, GPIO_SPEED_FREQ_HIGH,
                  GPIO_SPEED_FREQ_VERY_HIGH };

struct GPIO_InitTypeDef { uint32_t Pin, Mode, Pull, Speed, Alternate; };

static inline void HAL_GPIO_Init(GPIO_TypeDef *port, const GPIO_InitTypeDef *how)
{
    vbus_shim::stm32_pins(port->vbus_port, how->Pin, (vbus_shim::Stm32Mode)(how->Mode & 3),
                          how->Mode & 0x10, (vbus_shim::Stm32Pull)how->Pull);
    for (unsigned line = 0; how->Mode & 0x10000 && line < 16; line++)
        if (how->Pin >> line & 1) {
            vbus_shim::stm32_exti(port->vbus_port, line);
            MODIFY_REG(EXTI->RTSR, 1U << line, (how->Mode >> 20 & 1) << line);
            MODIFY_REG(EXTI->FTSR, 1U << line, (how->Mode >> 21 & 1) << line);
            EXTI->IMR |= 1U << line;
        }
}

static inline void HAL_GPIO_DeInit(GPIO_TypeDef *port, uint32_t pins)
{
    vbus_shim::stm32_pins(port->vbus_port, pins, vbus_shim::INPUT_PIN, false, vbus_shim::NO_PULL);
}

static inline void HAL_GPIO_WritePin(GPIO_TypeDef *port, uint16_t pins, GPIO_PinState state)
{
    port->BSRR = state != GPIO_PIN_RESET ? pins : (uint32_t)pins << 16;
}

static inline GPIO_PinState HAL_GPIO_ReadPin(const GPIO_TypeDef *port, uint16_t pins)
{
    return port->IDR & pins ? GPIO_PIN_SET : GPIO_PIN_RESET;
}

static inline void HAL_GPIO_TogglePin(GPIO_TypeDef *port, uint16_t pins)
{
    uint32_t odr = port->ODR;

    port->BSRR = (odr & pins) << 16 | (~odr & pins);
}

#define __HAL_GPIO_EXTI_GET_IT(line) (EXTI->PR & (line))
#define __HAL_GPIO_EXTI_CLEAR_IT(line) (EXTI->PR = (line))
extern "C" void HAL_GPIO_EXTI_Callback(uint16_t pin);
static inline void HAL_GPIO_EXTI_IRQHandler(uint16_t pin)
{
    if (__HAL_GPIO_EXTI_GET_IT(pin)) {
        __HAL_GPIO_EXTI_CLEAR_IT(pin);
        HAL_GPIO_EXTI_Callback(pin);
    }
}

#define VBUS_ENABLE(port) (VBUS_ENR |= VBUS_CLOCK(port))
#define __HAL_RCC_GPIOA_CLK_ENABLE() VBUS_ENABLE(0)
#define __HAL_RCC_GPIOB_CLK_ENABLE() VBUS_ENABLE(1)
#define __HAL_RCC_GPIOC_CLK_ENABLE() VBUS_ENABLE(2)
#define __HAL_RCC_GPIOD_CLK_ENABLE() VBUS_ENABLE(3)
#define __HAL_RCC_GPIOE_CLK_ENABLE() VBUS_ENABLE(4)
#define __HAL_RCC_GPIOF_CLK_ENABLE() VBUS_ENABLE(5)
#define __HAL_RCC_GPIOG_CLK_ENABLE() VBUS_ENABLE(6)
#define __HAL_RCC_GPIOH_CLK_ENABLE() VBUS_ENABLE(7)
#define __HAL_RCC_GPIOI_CLK_ENABLE() VBUS_ENABLE(8)
#define __HAL_RCC_AFIO_CLK_ENABLE() ((void)0)
#define __HAL_RCC_SYSCFG_CLK_ENABLE() ((void)0)
#define __HAL_RCC_PWR_CLK_ENABLE() ((void)0)
#define __HAL_RCC_USART1_CLK_ENABLE() ((void)0)
#define __HAL_RCC_USART2_CLK_ENABLE() ((void)0)
#define __HAL_AFIO_REMAP_SWJ_NOJTAG() ((void)0)

static inline void HAL_IncTick(void) {}
static inline uint32_t HAL_GetTick(void)
{
    return (uint32_t)(vbus_shim::look_at_clock() / 1000000000);
}
static inline void HAL_Delay(uint32_t ms) { vbus_shim::pass(ms * UINT64_C(1000000000)); }
static inline HAL_StatusTypeDef HAL_Init(void)
{
    SysTick_Config(SystemCoreClock / 1000);
    return HAL_OK;
}
static inline uint32_t HAL_RCC_GetHCLKFreq(void) { return SystemCoreClock; }
static inline void HAL_NVIC_SetPriority(IRQn_Type, uint32_t, uint32_t) {}
static inline void HAL_NVIC_EnableIRQ(IRQn_Type number) { NVIC_EnableIRQ(number); }
static inline void HAL_NVIC_DisableIRQ(IRQn_Type number) { NVIC_DisableIRQ(number); }

/* A UART is the console: it always takes a byte. */
struct UART_InitTypeDef {
    uint32_t BaudRate, WordLength, StopBits, Parity, Mode, HwFlowCtl, OverSampling;
};
struct UART_HandleTypeDef { USART_TypeDef *Instance; UART_InitTypeDef Init; };
enum : uint32_t {
    UART_WORDLENGTH_8B = 0, UART_STOPBITS_1 = 0, UART_PARITY_NONE = 0, UART_HWCONTROL_NONE = 0,
    UART_OVERSAMPLING_16 = 0, UART_MODE_RX = 4, UART_MODE_TX = 8, UART_MODE_TX_RX = 12
};
static inline HAL_StatusTypeDef HAL_UART_Init(UART_HandleTypeDef *) { return HAL_OK; }
static inline HAL_StatusTypeDef HAL_UART_Transmit(UART_HandleTypeDef *uart, const uint8_t *data,
                                                  uint16_t size, uint32_t)
{
    while (size--)
        uart->Instance->DR = *data++;
    return HAL_OK;
}

#endif
