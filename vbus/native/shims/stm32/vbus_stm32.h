/* vbus_stm32.h - GPIO, EXTI, SysTick and USART of an STM32F1 or F4 as objects, with the functions of
 * HAL and of the Standard Peripheral Library; see ports.h. Include the vendor's header: stm32f10x.h,
 * stm32f1xx_hal.h, stm32f4xx.h or stm32f4xx_hal.h.
 *
 * Ports A to K. The clock is 72 MHz (F1) or 168 MHz (F4), or F_CPU. A port whose clock is not enabled
 * in RCC takes no writes, with a message. USARTs are the console. I2C1 (PB6, PB7) and I2C2
 * (PB10, PB11) have the libraries' functions and no registers. Timers, DMA, SPI, ADC and bit-band
 * addresses are not there: code that uses them does not compile. License: Apache-2.0.
 */
#ifndef VBUS_SHIM_STM32_H
#define VBUS_SHIM_STM32_H

#include "../ports.h"

#if !defined VBUS_STM32F1 && !defined VBUS_STM32F4
#error "include stm32f10x.h, stm32f1xx_hal.h, stm32f4xx.h or stm32f4xx_hal.h"
#endif
#ifndef F_CPU
#ifdef VBUS_STM32F1
#define F_CPU 72000000UL
#else
#define F_CPU 168000000UL
#endif
#endif

#define __IO volatile
#define __I volatile const
#define __O volatile

namespace vbus_shim {

enum Stm32Register {
    CRL, CRH, IDR, ODR, BSRR, BRR, LCKR, MODER, OTYPER, OSPEEDR, PUPDR, AFR0, AFR1, BSRRL, BSRRH,
    EXTI_IMR, EXTI_EMR, EXTI_RTSR, EXTI_FTSR, EXTI_SWIER, EXTI_PR, SYSTICK_CTRL, SYSTICK_LOAD,
    SYSTICK_VAL, SYSTICK_CALIB, DWT_CYCCNT, USART_SR, USART_DR
};
enum Stm32Mode { INPUT_PIN, OUTPUT_PIN, OTHER_PIN, ANALOG_PIN };
enum Stm32Pull { NO_PULL, PULL_UP, PULL_DOWN };

uint32_t stm32_read(unsigned index);
void stm32_write(unsigned index, uint32_t value);
void stm32_pins(unsigned port, unsigned pins, Stm32Mode mode, bool open_drain, Stm32Pull pull);
void stm32_exti(unsigned port, unsigned line); /* this line's port */
void stm32_irq(int number, bool on);
void stm32_interrupts(bool on);
extern volatile uint32_t stm32_clocks; /* those of the ports, a bit each */
bool stm32_core(uint32_t hertz, bool f1);

/* I2C as a master: a whole transfer (false: a byte was not acknowledged), or one step at a time. */
void stm32_i2c_clock(unsigned bus, uint32_t hertz);
bool stm32_i2c(unsigned bus, uint8_t address, const uint8_t *head, unsigned heads,
               const uint8_t *out, unsigned outs, uint8_t *in, unsigned ins);
enum Stm32I2cStep { I2C_START, I2C_ADDRESS, I2C_SEND, I2C_ACK, I2C_POS, I2C_STOP, I2C_CLEAR };
void stm32_i2c_step(unsigned bus, Stm32I2cStep what, uint32_t value);
uint32_t stm32_i2c_flags(unsigned bus, uint32_t wanted); /* SR1, and SR2 in the high half */
uint8_t stm32_i2c_taken(unsigned bus);

/* A register of the vendor's structures; what they have in an index is the port and the register. */
struct Stm32 : Register32 {
    constexpr Stm32(Stm32Register which, unsigned port = 0)
        : Register32(port | (unsigned)which << 4, stm32_read, stm32_write) {}
    using Register32::operator=;
};

#ifndef VBUS_SHIM_SOURCE
#ifdef VBUS_STM32F1
namespace { const bool core_is_set __attribute__((unused)) = stm32_core(F_CPU, true); }
#else
namespace { const bool core_is_set __attribute__((unused)) = stm32_core(F_CPU, false); }
#endif
#endif

} // namespace vbus_shim

extern uint32_t SystemCoreClock;
static inline void SystemInit(void) {}
static inline void SystemCoreClockUpdate(void) {}

/* --- registers ---------------------------------------------------------------------------------- */

struct GPIO_TypeDef {
    const unsigned vbus_port;
#ifdef VBUS_STM32F1
    vbus_shim::Stm32 CRL, CRH, IDR, ODR, BSRR, BRR, LCKR;
    constexpr explicit GPIO_TypeDef(unsigned port)
        : vbus_port(port), CRL(vbus_shim::CRL, port), CRH(vbus_shim::CRH, port),
          IDR(vbus_shim::IDR, port), ODR(vbus_shim::ODR, port), BSRR(vbus_shim::BSRR, port),
          BRR(vbus_shim::BRR, port), LCKR(vbus_shim::LCKR, port) {}
#else
    vbus_shim::Stm32 MODER, OTYPER, OSPEEDR, PUPDR, IDR, ODR, BSRR, BSRRL, BSRRH, LCKR;
    vbus_shim::Stm32 AFR[2];
    constexpr explicit GPIO_TypeDef(unsigned port)
        : vbus_port(port), MODER(vbus_shim::MODER, port), OTYPER(vbus_shim::OTYPER, port),
          OSPEEDR(vbus_shim::OSPEEDR, port), PUPDR(vbus_shim::PUPDR, port),
          IDR(vbus_shim::IDR, port), ODR(vbus_shim::ODR, port), BSRR(vbus_shim::BSRR, port),
          BSRRL(vbus_shim::BSRRL, port), BSRRH(vbus_shim::BSRRH, port),
          LCKR(vbus_shim::LCKR, port), AFR{{vbus_shim::AFR0, port}, {vbus_shim::AFR1, port}} {}
#endif
};

struct EXTI_TypeDef { vbus_shim::Stm32 IMR, EMR, RTSR, FTSR, SWIER, PR; };
struct SysTick_Type { vbus_shim::Stm32 CTRL, LOAD, VAL, CALIB; };
struct DWT_Type { volatile uint32_t CTRL; vbus_shim::Stm32 CYCCNT; };
struct CoreDebug_Type { volatile uint32_t DEMCR; };
struct I2C_TypeDef { const unsigned vbus_bus; };
struct USART_TypeDef { vbus_shim::Stm32 SR, DR; volatile uint32_t BRR, CR1, CR2, CR3, GTPR; };
#ifdef VBUS_STM32F1
struct RCC_TypeDef {
    volatile uint32_t &APB2ENR; /* bits 2 to 8 are ports A to G */
    volatile uint32_t AHBENR, APB1ENR, APB2RSTR, APB1RSTR;
};
#else
struct RCC_TypeDef {
    volatile uint32_t &AHB1ENR; /* bits 0 to 10 are ports A to K */
    volatile uint32_t AHB2ENR, AHB3ENR, APB1ENR, APB2ENR, AHB1RSTR, APB1RSTR, APB2RSTR;
};
#endif

namespace vbus_shim {

/* One object each, however many files include this. */
template <unsigned PORT> struct Stm32Port { static GPIO_TypeDef gpio; };
template <unsigned PORT> GPIO_TypeDef Stm32Port<PORT>::gpio(PORT);
template <class T> struct Stm32Unit { static RCC_TypeDef rcc; };
template <class T> RCC_TypeDef Stm32Unit<T>::rcc = {stm32_clocks, 0, 0, 0, 0
#ifdef VBUS_STM32F4
    , 0, 0, 0
#endif
};
extern EXTI_TypeDef exti_unit;
extern SysTick_Type systick;
extern DWT_Type dwt;
extern CoreDebug_Type core_debug;
extern USART_TypeDef usart[6];
extern I2C_TypeDef i2c_unit[2];

} // namespace vbus_shim

#define GPIOA (&vbus_shim::Stm32Port<0>::gpio)
#define GPIOB (&vbus_shim::Stm32Port<1>::gpio)
#define GPIOC (&vbus_shim::Stm32Port<2>::gpio)
#define GPIOD (&vbus_shim::Stm32Port<3>::gpio)
#define GPIOE (&vbus_shim::Stm32Port<4>::gpio)
#define GPIOF (&vbus_shim::Stm32Port<5>::gpio)
#define GPIOG (&vbus_shim::Stm32Port<6>::gpio)
#define GPIOH (&vbus_shim::Stm32Port<7>::gpio)
#define GPIOI (&vbus_shim::Stm32Port<8>::gpio)
#define GPIOJ (&vbus_shim::Stm32Port<9>::gpio)
#define GPIOK (&vbus_shim::Stm32Port<10>::gpio)
#define RCC (&vbus_shim::Stm32Unit<void>::rcc)
#define EXTI (&vbus_shim::exti_unit)
#define SysTick (&vbus_shim::systick)
#define DWT (&vbus_shim::dwt)
#define CoreDebug (&vbus_shim::core_debug)
#define I2C1 (&vbus_shim::i2c_unit[0])
#define I2C2 (&vbus_shim::i2c_unit[1])
#define USART1 (&vbus_shim::usart[0])
#define USART2 (&vbus_shim::usart[1])
#define USART3 (&vbus_shim::usart[2])
#define USART6 (&vbus_shim::usart[5])

#define SET_BIT(reg, bits) ((reg) |= (bits))
#define CLEAR_BIT(reg, bits) ((reg) &= ~(bits))
#define READ_BIT(reg, bits) ((reg) & (bits))
#define WRITE_REG(reg, value) ((reg) = (value))
#define READ_REG(reg) ((uint32_t)(reg))
#define MODIFY_REG(reg, clear, set) ((reg) = ((reg) & ~(clear)) | (set))
#define UNUSED(value) ((void)(value))

enum FunctionalState { DISABLE, ENABLE };
enum FlagStatus { RESET, SET };
typedef FlagStatus ITStatus;
enum ErrorStatus { ERROR, SUCCESS };
enum { GPIO_PIN_RESET, GPIO_PIN_SET };
typedef int GPIO_PinState;
enum BitAction { Bit_RESET, Bit_SET };

#define VBUS_PINS(prefix)                                                                          \
    enum : uint16_t {                                                                              \
        prefix##0 = 1, prefix##1 = 2, prefix##2 = 4, prefix##3 = 8, prefix##4 = 16,                \
        prefix##5 = 32, prefix##6 = 64, prefix##7 = 128, prefix##8 = 256, prefix##9 = 512,         \
        prefix##10 = 1024, prefix##11 = 2048, prefix##12 = 4096, prefix##13 = 8192,                \
        prefix##14 = 16384, prefix##15 = 32768, prefix##All = 65535                                \
    };
VBUS_PINS(GPIO_PIN_)
VBUS_PINS(GPIO_Pin_)

/* --- the core ----------------------------------------------------------------------------------- */

enum IRQn_Type {
    SysTick_IRQn = -1, EXTI0_IRQn = 6, EXTI1_IRQn, EXTI2_IRQn, EXTI3_IRQn, EXTI4_IRQn,
    EXTI9_5_IRQn = 23, I2C1_EV_IRQn = 31, I2C1_ER_IRQn, I2C2_EV_IRQn, I2C2_ER_IRQn, USART1_IRQn = 37, USART2_IRQn, USART3_IRQn, EXTI15_10_IRQn
};
extern "C" {
void SysTick_Handler(void);
void EXTI0_IRQHandler(void);
void EXTI1_IRQHandler(void);
void EXTI2_IRQHandler(void);
void EXTI3_IRQHandler(void);
void EXTI4_IRQHandler(void);
void EXTI9_5_IRQHandler(void);
void EXTI15_10_IRQHandler(void);
}

enum : uint32_t {
    SysTick_CTRL_ENABLE_Msk = 1, SysTick_CTRL_TICKINT_Msk = 2, SysTick_CTRL_CLKSOURCE_Msk = 4,
    SysTick_CTRL_COUNTFLAG_Msk = 1 << 16, SysTick_LOAD_RELOAD_Msk = 0xFFFFFF,
    SysTick_CLKSource_HCLK = 4, SysTick_CLKSource_HCLK_Div8 = 0,
    CoreDebug_DEMCR_TRCENA_Msk = 1 << 24, DWT_CTRL_CYCCNTENA_Msk = 1
};
uint32_t SysTick_Config(uint32_t ticks);
void SysTick_CLKSourceConfig(uint32_t source);

static inline void __enable_irq(void) { vbus_shim::stm32_interrupts(true); }
static inline void __disable_irq(void) { vbus_shim::stm32_interrupts(false); }
static inline void __NOP(void) { vbus_shim::compute(UINT64_C(1000000000000) / F_CPU); }
static inline void __WFI(void) { vbus_shim::sleep(); }
static inline void __DSB(void) {}
static inline void __ISB(void) {}
static inline void __DMB(void) {}
static inline void NVIC_EnableIRQ(IRQn_Type number) { vbus_shim::stm32_irq(number, true); }
static inline void NVIC_DisableIRQ(IRQn_Type number) { vbus_shim::stm32_irq(number, false); }
static inline void NVIC_SetPriority(IRQn_Type, uint32_t) {}
static inline void NVIC_PriorityGroupConfig(uint32_t) {}
static inline void NVIC_SetPriorityGrouping(uint32_t) {}
enum { NVIC_PriorityGroup_0, NVIC_PriorityGroup_1, NVIC_PriorityGroup_2, NVIC_PriorityGroup_3,
       NVIC_PriorityGroup_4 };

enum : uint32_t { USART_SR_RXNE = 0x20, USART_SR_TC = 0x40, USART_SR_TXE = 0x80 };
#ifdef VBUS_STM32F1
enum : uint32_t {
    RCC_APB2ENR_AFIOEN = 1, RCC_APB2ENR_IOPAEN = 4, RCC_APB2ENR_IOPBEN = 8,
    RCC_APB2ENR_IOPCEN = 16, RCC_APB2ENR_IOPDEN = 32, RCC_APB2ENR_IOPEEN = 64,
    RCC_APB2ENR_IOPFEN = 128, RCC_APB2ENR_IOPGEN = 256, RCC_APB2ENR_USART1EN = 1 << 14
};
#define VBUS_CLOCK(port) (4U << (port))
#define VBUS_ENR (RCC->APB2ENR)
#else
enum : uint32_t {
    RCC_AHB1ENR_GPIOAEN = 1, RCC_AHB1ENR_GPIOBEN = 2, RCC_AHB1ENR_GPIOCEN = 4,
    RCC_AHB1ENR_GPIODEN = 8, RCC_AHB1ENR_GPIOEEN = 16, RCC_AHB1ENR_GPIOFEN = 32,
    RCC_AHB1ENR_GPIOGEN = 64, RCC_AHB1ENR_GPIOHEN = 128, RCC_AHB1ENR_GPIOIEN = 256,
    RCC_APB2ENR_SYSCFGEN = 1 << 14
};
#define VBUS_CLOCK(port) (1U << (port))
#define VBUS_ENR (RCC->AHB1ENR)
#endif

#ifdef USE_HAL_DRIVER
#include "vbus_hal.h"
#else
#include "vbus_stdperiph.h"
#endif

#endif
