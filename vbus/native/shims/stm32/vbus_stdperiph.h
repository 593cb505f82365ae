/* vbus_stdperiph.h - the functions of the Standard Peripheral Library: GPIO, RCC, EXTI, NVIC, USART, I2C;
 * see vbus_stm32.h. License: Apache-2.0. */
#ifndef VBUS_SHIM_STM32_STDPERIPH_H
#define VBUS_SHIM_STM32_STDPERIPH_H

typedef uint8_t u8;
typedef uint16_t u16;
typedef uint32_t u32;
typedef volatile uint8_t vu8;
typedef volatile uint16_t vu16;
typedef volatile uint32_t vu32;

#ifdef VBUS_STM32F1
enum GPIOMode_TypeDef {
    GPIO_Mode_AIN = 0x0, GPIO_Mode_IN_FLOATING = 0x04, GPIO_Mode_IPD = 0x28, GPIO_Mode_IPU = 0x48,
    GPIO_Mode_Out_OD = 0x14, GPIO_Mode_Out_PP = 0x10, GPIO_Mode_AF_OD = 0x1C, GPIO_Mode_AF_PP = 0x18
};
enum GPIOSpeed_TypeDef { GPIO_Speed_10MHz = 1, GPIO_Speed_2MHz, GPIO_Speed_50MHz };
struct GPIO_InitTypeDef {
    uint16_t GPIO_Pin;
    GPIOSpeed_TypeDef GPIO_Speed;
    GPIOMode_TypeDef GPIO_Mode;
};
static inline void GPIO_StructInit(GPIO_InitTypeDef *how)
{
    *how = {GPIO_Pin_All, GPIO_Speed_2MHz, GPIO_Mode_IN_FLOATING};
}
static inline void GPIO_Init(GPIO_TypeDef *port, const GPIO_InitTypeDef *how)
{
    unsigned mode = how->GPIO_Mode;

    vbus_shim::stm32_pins(
        port->vbus_port, how->GPIO_Pin,
        mode & 0x10 ? mode & 8 ? vbus_shim::OTHER_PIN : vbus_shim::OUTPUT_PIN
                    : mode ? vbus_shim::INPUT_PIN : vbus_shim::ANALOG_PIN,
        mode & 4,
        mode == GPIO_Mode_IPU ? vbus_shim::PULL_UP
                              : mode == GPIO_Mode_IPD ? vbus_shim::PULL_DOWN : vbus_shim::NO_PULL);
}
enum : uint32_t {
    RCC_APB2Periph_AFIO = 1, RCC_APB2Periph_GPIOA = 4, RCC_APB2Periph_GPIOB = 8,
    RCC_APB2Periph_GPIOC = 16, RCC_APB2Periph_GPIOD = 32, RCC_APB2Periph_GPIOE = 64,
    RCC_APB2Periph_GPIOF = 128, RCC_APB2Periph_GPIOG = 256, RCC_APB2Periph_USART1 = 1 << 14,
    RCC_APB1Periph_USART2 = 1 << 17, RCC_APB1Periph_USART3 = 1 << 18
};
enum : uint32_t { GPIO_Remap_SWJ_JTAGDisable = 0x300200, GPIO_Remap_SWJ_Disable = 0x300400 };
static inline void GPIO_PinRemapConfig(uint32_t, FunctionalState) {}
static inline void RCC_APB2PeriphClockCmd(uint32_t which, FunctionalState on)
{
    MODIFY_REG(RCC->APB2ENR, which, on ? which : 0);
}
static inline void GPIO_EXTILineConfig(uint8_t port, uint8_t line)
{
    vbus_shim::stm32_exti(port, line);
}
#define VBUS_SOURCES(prefix) enum { prefix##A, prefix##B, prefix##C, prefix##D, prefix##E, prefix##F, prefix##G };
VBUS_SOURCES(GPIO_PortSourceGPIO)
#define VBUS_LINE(number) GPIO_PinSource##number = number
#else
enum GPIOMode_TypeDef { GPIO_Mode_IN, GPIO_Mode_OUT, GPIO_Mode_AF, GPIO_Mode_AN };
enum GPIOOType_TypeDef { GPIO_OType_PP, GPIO_OType_OD };
enum GPIOPuPd_TypeDef { GPIO_PuPd_NOPULL, GPIO_PuPd_UP, GPIO_PuPd_DOWN };
enum GPIOSpeed_TypeDef { GPIO_Speed_2MHz, GPIO_Speed_25MHz, GPIO_Speed_50MHz, GPIO_Speed_100MHz };
struct GPIO_InitTypeDef {
    uint32_t GPIO_Pin;
    GPIOMode_TypeDef GPIO_Mode;
    GPIOSpeed_TypeDef GPIO_Speed;
    GPIOOType_TypeDef GPIO_OType;
    GPIOPuPd_TypeDef GPIO_PuPd;
};
static inline void GPIO_StructInit(GPIO_InitTypeDef *how)
{
    *how = {GPIO_Pin_All, GPIO_Mode_IN, GPIO_Speed_2MHz, GPIO_OType_PP, GPIO_PuPd_NOPULL};
}
static inline void GPIO_Init(GPIO_TypeDef *port, const GPIO_InitTypeDef *how)
{
    vbus_shim::stm32_pins(port->vbus_port, how->GPIO_Pin, (vbus_shim::Stm32Mode)how->GPIO_Mode,
                          how->GPIO_OType == GPIO_OType_OD, (vbus_shim::Stm32Pull)how->GPIO_PuPd);
}
enum : uint32_t {
    RCC_AHB1Periph_GPIOA = 1, RCC_AHB1Periph_GPIOB = 2, RCC_AHB1Periph_GPIOC = 4,
    RCC_AHB1Periph_GPIOD = 8, RCC_AHB1Periph_GPIOE = 16, RCC_AHB1Periph_GPIOF = 32,
    RCC_AHB1Periph_GPIOG = 64, RCC_AHB1Periph_GPIOH = 128, RCC_AHB1Periph_GPIOI = 256,
    RCC_APB2Periph_SYSCFG = 1 << 14, RCC_APB2Periph_USART1 = 16, RCC_APB1Periph_USART2 = 1 << 17
};
static inline void RCC_AHB1PeriphClockCmd(uint32_t which, FunctionalState on)
{
    MODIFY_REG(RCC->AHB1ENR, which, on ? which : 0);
}
static inline void RCC_APB2PeriphClockCmd(uint32_t, FunctionalState) {}
static inline void SYSCFG_EXTILineConfig(uint8_t port, uint8_t line)
{
    vbus_shim::stm32_exti(port, line);
}
#define VBUS_SOURCES(prefix) enum { prefix##A, prefix##B, prefix##C, prefix##D, prefix##E, prefix##F, prefix##G, prefix##H, prefix##I };
VBUS_SOURCES(EXTI_PortSourceGPIO)
#define VBUS_LINE(number) EXTI_PinSource##number = number, GPIO_PinSource##number = number
#endif
enum {
    VBUS_LINE(0), VBUS_LINE(1), VBUS_LINE(2), VBUS_LINE(3), VBUS_LINE(4), VBUS_LINE(5),
    VBUS_LINE(6), VBUS_LINE(7), VBUS_LINE(8), VBUS_LINE(9), VBUS_LINE(10), VBUS_LINE(11),
    VBUS_LINE(12), VBUS_LINE(13), VBUS_LINE(14), VBUS_LINE(15)
};
static inline void RCC_APB1PeriphClockCmd(uint32_t, FunctionalState) {}

static inline void GPIO_SetBits(GPIO_TypeDef *port, uint16_t pins) { port->BSRR = pins; }
static inline void GPIO_ResetBits(GPIO_TypeDef *port, uint16_t pins)
{
    port->BSRR = (uint32_t)pins << 16;
}
static inline void GPIO_WriteBit(GPIO_TypeDef *port, uint16_t pins, BitAction value)
{
    port->BSRR = value != Bit_RESET ? pins : (uint32_t)pins << 16;
}
static inline void GPIO_Write(GPIO_TypeDef *port, uint16_t value) { port->ODR = value; }
static inline void GPIO_ToggleBits(GPIO_TypeDef *port, uint16_t pins) { port->ODR ^= pins; }
static inline uint16_t GPIO_ReadInputData(GPIO_TypeDef *port) { return (uint16_t)port->IDR; }
static inline uint16_t GPIO_ReadOutputData(GPIO_TypeDef *port) { return (uint16_t)port->ODR; }
static inline uint8_t GPIO_ReadInputDataBit(GPIO_TypeDef *port, uint16_t pins)
{
    return port->IDR & pins ? 1 : 0;
}
static inline uint8_t GPIO_ReadOutputDataBit(GPIO_TypeDef *port, uint16_t pins)
{
    return port->ODR & pins ? 1 : 0;
}

VBUS_PINS(EXTI_Line)
enum EXTIMode_TypeDef { EXTI_Mode_Interrupt = 0, EXTI_Mode_Event = 4 };
enum EXTITrigger_TypeDef {
    EXTI_Trigger_Rising = 8, EXTI_Trigger_Falling = 12, EXTI_Trigger_Rising_Falling = 16
};
struct EXTI_InitTypeDef {
    uint32_t EXTI_Line;
    EXTIMode_TypeDef EXTI_Mode;
    EXTITrigger_TypeDef EXTI_Trigger;
    FunctionalState EXTI_LineCmd;
};
static inline void EXTI_Init(const EXTI_InitTypeDef *how)
{
    uint32_t lines = how->EXTI_Line;

    MODIFY_REG(EXTI->RTSR, lines, how->EXTI_Trigger != EXTI_Trigger_Falling ? lines : 0);
    MODIFY_REG(EXTI->FTSR, lines, how->EXTI_Trigger != EXTI_Trigger_Rising ? lines : 0);
    MODIFY_REG(EXTI->IMR, lines,
               how->EXTI_LineCmd && how->EXTI_Mode == EXTI_Mode_Interrupt ? lines : 0);
}
static inline ITStatus EXTI_GetITStatus(uint32_t line) { return EXTI->PR & line ? SET : RESET; }
static inline FlagStatus EXTI_GetFlagStatus(uint32_t line) { return EXTI->PR & line ? SET : RESET; }
static inline void EXTI_ClearITPendingBit(uint32_t line) { EXTI->PR = line; }
static inline void EXTI_ClearFlag(uint32_t line) { EXTI->PR = line; }

struct NVIC_InitTypeDef {
    uint8_t NVIC_IRQChannel, NVIC_IRQChannelPreemptionPriority, NVIC_IRQChannelSubPriority;
    FunctionalState NVIC_IRQChannelCmd;
};
static inline void NVIC_Init(const NVIC_InitTypeDef *how)
{
    vbus_shim::stm32_irq(how->NVIC_IRQChannel, how->NVIC_IRQChannelCmd);
}

enum : uint16_t { USART_FLAG_RXNE = 0x20, USART_FLAG_TC = 0x40, USART_FLAG_TXE = 0x80 };
enum : uint16_t {
    USART_WordLength_8b = 0, USART_StopBits_1 = 0, USART_Parity_No = 0,
    USART_HardwareFlowControl_None = 0, USART_Mode_Rx = 4, USART_Mode_Tx = 8
};
struct USART_InitTypeDef {
    uint32_t USART_BaudRate;
    uint16_t USART_WordLength, USART_StopBits, USART_Parity, USART_Mode, USART_HardwareFlowControl;
};
static inline void USART_Init(USART_TypeDef *, const USART_InitTypeDef *) {}
static inline void USART_Cmd(USART_TypeDef *, FunctionalState) {}
static inline void USART_SendData(USART_TypeDef *usart, uint16_t data) { usart->DR = data; }
static inline uint16_t USART_ReceiveData(USART_TypeDef *usart) { return (uint16_t)usart->DR; }
static inline FlagStatus USART_GetFlagStatus(USART_TypeDef *usart, uint16_t flag)
{
    return usart->SR & flag ? SET : RESET;
}

/* Flags as in SR1, with bit 28, or in SR2; events are both registers. */
enum : uint32_t {
    I2C_FLAG_SB = 0x10000001, I2C_FLAG_ADDR = 0x10000002, I2C_FLAG_BTF = 0x10000004,
    I2C_FLAG_RXNE = 0x10000040, I2C_FLAG_TXE = 0x10000080, I2C_FLAG_AF = 0x10000400,
    I2C_FLAG_MSL = 0x10000, I2C_FLAG_BUSY = 0x20000, I2C_FLAG_TRA = 0x40000,
    I2C_EVENT_MASTER_MODE_SELECT = 0x30001, I2C_EVENT_MASTER_TRANSMITTER_MODE_SELECTED = 0x70082,
    I2C_EVENT_MASTER_RECEIVER_MODE_SELECTED = 0x30002, I2C_EVENT_MASTER_BYTE_RECEIVED = 0x30040,
    I2C_EVENT_MASTER_BYTE_TRANSMITTING = 0x70080, I2C_EVENT_MASTER_BYTE_TRANSMITTED = 0x70084,
    RCC_APB1Periph_I2C1 = 1 << 21, RCC_APB1Periph_I2C2 = 1 << 22
};
enum : uint16_t {
    I2C_Mode_I2C = 0, I2C_DutyCycle_2 = 0xBFFF, I2C_DutyCycle_16_9 = 0x4000, I2C_Ack_Disable = 0,
    I2C_Ack_Enable = 0x400, I2C_AcknowledgedAddress_7bit = 0x4000, I2C_NACKPosition_Next = 0x800,
    I2C_NACKPosition_Current = 0xF7FF
};
enum : uint8_t { I2C_Direction_Transmitter, I2C_Direction_Receiver };
struct I2C_InitTypeDef {
    uint32_t I2C_ClockSpeed;
    uint16_t I2C_Mode, I2C_DutyCycle, I2C_OwnAddress1, I2C_Ack, I2C_AcknowledgedAddress;
};
#define VBUS_STEP(name, step, type)                                                                \
    static inline void name(I2C_TypeDef *i2c, type value)                                          \
    {                                                                                              \
        vbus_shim::stm32_i2c_step(i2c->vbus_bus, vbus_shim::step, value);                          \
    }
VBUS_STEP(I2C_GenerateSTART, I2C_START, FunctionalState)
VBUS_STEP(I2C_GenerateSTOP, I2C_STOP, FunctionalState)
VBUS_STEP(I2C_AcknowledgeConfig, I2C_ACK, FunctionalState)
VBUS_STEP(I2C_NACKPositionConfig, I2C_POS, uint16_t)
VBUS_STEP(I2C_SendData, I2C_SEND, uint8_t)
VBUS_STEP(I2C_ClearFlag, I2C_CLEAR, uint32_t)
static inline void I2C_Send7bitAddress(I2C_TypeDef *i2c, uint8_t address, uint8_t direction)
{
    vbus_shim::stm32_i2c_step(i2c->vbus_bus, vbus_shim::I2C_ADDRESS, (address & 0xFE) | direction);
}
static inline uint8_t I2C_ReceiveData(I2C_TypeDef *i2c)
{
    return vbus_shim::stm32_i2c_taken(i2c->vbus_bus);
}
static inline uint32_t I2C_GetLastEvent(I2C_TypeDef *i2c)
{
    return vbus_shim::stm32_i2c_flags(i2c->vbus_bus, 0xFFFFFF);
}
static inline ErrorStatus I2C_CheckEvent(I2C_TypeDef *i2c, uint32_t event)
{
    return (vbus_shim::stm32_i2c_flags(i2c->vbus_bus, event) & event) == event ? SUCCESS : ERROR;
}
static inline FlagStatus I2C_GetFlagStatus(I2C_TypeDef *i2c, uint32_t flag)
{
    return vbus_shim::stm32_i2c_flags(i2c->vbus_bus, flag) & flag & 0xFFFFFF ? SET : RESET;
}
static inline void I2C_Cmd(I2C_TypeDef *, FunctionalState) {}
static inline void I2C_DeInit(I2C_TypeDef *) {}
static inline void I2C_Init(I2C_TypeDef *i2c, const I2C_InitTypeDef *how)
{
    vbus_shim::stm32_i2c_clock(i2c->vbus_bus, how->I2C_ClockSpeed);
    I2C_AcknowledgeConfig(i2c, how->I2C_Ack ? ENABLE : DISABLE);
}

#endif
