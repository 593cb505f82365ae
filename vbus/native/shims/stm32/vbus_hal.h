/* vbus_hal.h - the functions of HAL: GPIO, delays, clock enables, NVIC, UART, I2C; see vbus_stm32.h.
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
#define __HAL_RCC_I2C1_CLK_ENABLE() ((void)0)
#define __HAL_RCC_I2C2_CLK_ENABLE() ((void)0)
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

/* I2C: what ends with _IT or _DMA is over, and its callback has been called, when it returns. */
struct I2C_InitTypeDef {
    uint32_t ClockSpeed, DutyCycle, OwnAddress1, AddressingMode, DualAddressMode, OwnAddress2,
        GeneralCallMode, NoStretchMode;
};
struct I2C_HandleTypeDef { I2C_TypeDef *Instance; I2C_InitTypeDef Init; volatile uint32_t ErrorCode; };
enum : uint32_t {
    I2C_DUTYCYCLE_2 = 0, I2C_DUTYCYCLE_16_9 = 0x4000, I2C_ADDRESSINGMODE_7BIT = 0x4000,
    I2C_DUALADDRESS_DISABLE = 0, I2C_GENERALCALL_DISABLE = 0, I2C_NOSTRETCH_DISABLE = 0,
    I2C_MEMADD_SIZE_8BIT = 1, I2C_MEMADD_SIZE_16BIT = 16, GPIO_AF4_I2C1 = 4, GPIO_AF4_I2C2 = 4,
    HAL_I2C_ERROR_NONE = 0, HAL_I2C_ERROR_AF = 4
};
enum HAL_I2C_StateTypeDef { HAL_I2C_STATE_READY = 0x20 };
extern "C" {
void HAL_I2C_MasterTxCpltCallback(I2C_HandleTypeDef *i2c);
void HAL_I2C_MasterRxCpltCallback(I2C_HandleTypeDef *i2c);
void HAL_I2C_MemTxCpltCallback(I2C_HandleTypeDef *i2c);
void HAL_I2C_MemRxCpltCallback(I2C_HandleTypeDef *i2c);
void HAL_I2C_ErrorCallback(I2C_HandleTypeDef *i2c);
}
static inline HAL_StatusTypeDef HAL_I2C_Init(I2C_HandleTypeDef *i2c)
{
    vbus_shim::stm32_i2c_clock(i2c->Instance->vbus_bus, i2c->Init.ClockSpeed);
    i2c->ErrorCode = HAL_I2C_ERROR_NONE;
    return HAL_OK;
}
static inline HAL_StatusTypeDef HAL_I2C_DeInit(I2C_HandleTypeDef *) { return HAL_OK; }
static inline HAL_I2C_StateTypeDef HAL_I2C_GetState(I2C_HandleTypeDef *)
{
    return HAL_I2C_STATE_READY;
}
static inline uint32_t HAL_I2C_GetError(I2C_HandleTypeDef *i2c) { return i2c->ErrorCode; }
static inline void HAL_I2C_EV_IRQHandler(I2C_HandleTypeDef *) {}
static inline void HAL_I2C_ER_IRQHandler(I2C_HandleTypeDef *) {}

static inline HAL_StatusTypeDef vbus_i2c(I2C_HandleTypeDef *i2c, uint16_t device, uint16_t memory,
                                         uint16_t width, const uint8_t *out, unsigned outs,
                                         uint8_t *in, unsigned ins)
{
    const uint8_t head[] = {(uint8_t)(memory >> 8), (uint8_t)memory};
    unsigned heads = width == I2C_MEMADD_SIZE_16BIT ? 2 : width;
    bool heard = vbus_shim::stm32_i2c(i2c->Instance->vbus_bus, (uint8_t)device, head + 2 - heads,
                                      heads, out, outs, in, ins);

    i2c->ErrorCode = heard ? HAL_I2C_ERROR_NONE : HAL_I2C_ERROR_AF;
    return heard ? HAL_OK : HAL_ERROR;
}
static inline HAL_StatusTypeDef HAL_I2C_IsDeviceReady(I2C_HandleTypeDef *i2c, uint16_t device,
                                                      uint32_t trials, uint32_t)
{
    while (trials--)
        if (vbus_i2c(i2c, device, 0, 0, 0, 0, 0, 0) == HAL_OK)
            return HAL_OK;
    return HAL_ERROR;
}
static inline HAL_StatusTypeDef vbus_i2c_over(I2C_HandleTypeDef *i2c, HAL_StatusTypeDef how,
                                              void (*done)(I2C_HandleTypeDef *))
{
    (how == HAL_OK ? done : HAL_I2C_ErrorCallback)(i2c);
    return HAL_OK;
}

/* A transfer by its name, the parameters of its place, what they are to vbus_i2c(), and a callback. */
#define VBUS_I2C(name, place, ends, ...)                                                            \
    static inline HAL_StatusTypeDef name(I2C_HandleTypeDef *i2c, VBUS_LIST place, uint8_t *data,   \
                                         uint16_t size, uint32_t)                                  \
    {                                                                                              \
        return vbus_i2c(i2c, __VA_ARGS__);                                                         \
    }                                                                                              \
    static inline HAL_StatusTypeDef name##_IT(I2C_HandleTypeDef *i2c, VBUS_LIST place,             \
                                              uint8_t *data, uint16_t size)                        \
    {                                                                                              \
        return vbus_i2c_over(i2c, vbus_i2c(i2c, __VA_ARGS__), ends);                               \
    }                                                                                              \
    static inline HAL_StatusTypeDef name##_DMA(I2C_HandleTypeDef *i2c, VBUS_LIST place,            \
                                               uint8_t *data, uint16_t size)                       \
    {                                                                                              \
        return vbus_i2c_over(i2c, vbus_i2c(i2c, __VA_ARGS__), ends);                               \
    }
#define VBUS_LIST(...) __VA_ARGS__
#define VBUS_CELL (uint16_t device, uint16_t memory, uint16_t width)
VBUS_I2C(HAL_I2C_Master_Transmit, (uint16_t device), HAL_I2C_MasterTxCpltCallback, device, 0, 0, data,
         size, 0, 0)
VBUS_I2C(HAL_I2C_Master_Receive, (uint16_t device), HAL_I2C_MasterRxCpltCallback, device, 0, 0, 0, 0,
         data, size)
VBUS_I2C(HAL_I2C_Mem_Write, VBUS_CELL, HAL_I2C_MemTxCpltCallback, device, memory, width, data, size,
         0, 0)
VBUS_I2C(HAL_I2C_Mem_Read, VBUS_CELL, HAL_I2C_MemRxCpltCallback, device, memory, width, 0, 0, data,
         size)

#endif
