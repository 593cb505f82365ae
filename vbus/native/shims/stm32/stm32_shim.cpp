/* stm32_shim.cpp - the registers behind vbus_stm32.h. License: Apache-2.0. */
#define VBUS_SHIM_SOURCE
#define VBUS_STM32F1
#define USE_HAL_DRIVER
#include "vbus_stm32.h"
#include "../i2c.h"

#include <stdio.h>

/* A firmware that handles an interrupt defines its handler; the others stay empty. */
#define HANDLER(name) extern "C" __attribute__((weak)) void name(void) {}
HANDLER(SysTick_Handler)
HANDLER(EXTI0_IRQHandler) HANDLER(EXTI1_IRQHandler) HANDLER(EXTI2_IRQHandler)
HANDLER(EXTI3_IRQHandler) HANDLER(EXTI4_IRQHandler) HANDLER(EXTI9_5_IRQHandler)
HANDLER(EXTI15_10_IRQHandler)
extern "C" __attribute__((weak)) void HAL_GPIO_EXTI_Callback(uint16_t) {}
#define CALLBACK(name) extern "C" __attribute__((weak)) void name(I2C_HandleTypeDef *) {}
CALLBACK(HAL_I2C_MasterTxCpltCallback) CALLBACK(HAL_I2C_MasterRxCpltCallback)
CALLBACK(HAL_I2C_MemTxCpltCallback) CALLBACK(HAL_I2C_MemRxCpltCallback)
CALLBACK(HAL_I2C_ErrorCallback)

uint32_t SystemCoreClock = 72000000;

namespace vbus_shim {

volatile uint32_t stm32_clocks;

namespace {

const unsigned PORTS = 11, PINS = 16, FIRST_CLOCK_F1 = 2;
const uint32_t BY_ODR = 3; /* an F1 pulls an input to what ODR has */

struct Port {
    uint32_t modes, pulls; /* two bits a pin, as MODER and PUPDR have them */
    uint16_t odr, open_drain;
    uint16_t low; /* pins that I2C pulls low */
    bool warned;
} ports[PORTS];

bool is_f1 = true, interrupts = true;
uint64_t irqs; /* enabled in the NVIC */
uint32_t exti[EXTI_PR - EXTI_IMR + 1];
uint8_t exti_port[PINS];
uint32_t lines_were;
uint64_t period = 13888, cycles_from, tick_next;
uint32_t tick_control, tick_load;

uint32_t two(uint32_t pairs, unsigned pin) { return pairs >> 2 * pin & 3; }

void set_two(uint32_t &pairs, unsigned pin, uint32_t value)
{
    pairs = (pairs & ~(3U << 2 * pin)) | value << 2 * pin;
}

/* What the pins of a port do now. An open-drain output that is let go has a pull-up on the board. */
void apply(unsigned number)
{
    const Port &port = ports[number];
    port_t drive = 0, up = 0, down = 0;

    for (unsigned pin = 0; pin < PINS; pin++) {
        uint32_t pull = two(port.pulls, pin), bit = 1U << pin;

        if (two(port.modes, pin) == OUTPUT_PIN) {
            up |= port.odr & bit;
            drive |= bit & ~(port.open_drain & port.odr);
        } else if (two(port.modes, pin) == INPUT_PIN) {
            bool high = pull == BY_ODR ? port.odr & bit : pull == PULL_UP;

            (high ? up : down) |= pull != NO_PULL ? bit : 0;
        }
    }
    set_pull_down(number, down);
    set_port(number, drive | port.low, up & (port_t)~port.low);
}

/* Without its clock a port is dead. */
bool clocked(unsigned number)
{
    Port &port = ports[number];

    if (stm32_clocks >> (number + (is_f1 ? FIRST_CLOCK_F1 : 0)) & 1)
        return true;
    if (!port.warned)
        fprintf(stderr, "vbus: GPIO%c is used while its clock is off: it reads 0 and takes no writes;"
                        " enable the clock in RCC first\n", 'A' + (int)number);
    port.warned = true;
    return false;
}

uint32_t read_f1_mode(const Port &port, unsigned first)
{
    uint32_t word = 0;

    for (unsigned pin = first; pin < first + 8; pin++) {
        uint32_t mode = two(port.modes, pin), kind = port.open_drain >> pin & 1;

        if (mode == INPUT_PIN)
            kind = two(port.pulls, pin) ? 8 : 4;
        else
            kind = mode == ANALOG_PIN ? 0 : kind << 2 | (mode == OTHER_PIN) << 3 | 3;
        word |= kind << 4 * (pin - first);
    }
    return word;
}

void write_f1_mode(Port &port, unsigned first, uint32_t word)
{
    for (unsigned pin = first; pin < first + 8; pin++, word >>= 4) {
        bool out = word & 3;

        set_two(port.modes, pin, out ? (word & 8 ? OTHER_PIN : OUTPUT_PIN)
                                     : (word & 12 ? INPUT_PIN : ANALOG_PIN));
        set_two(port.pulls, pin, !out && word & 8 ? BY_ODR : (uint32_t)NO_PULL);
        port.open_drain = (uint16_t)((port.open_drain & ~(1U << pin))
                                     | (uint32_t)(out && word & 4) << pin);
    }
}

/* --- I2C ---------------------------------------------------------------------------------------- */

enum : uint32_t {
    SB = 1, ADDR = 2, BTF = 4, RXNE = 0x40, TXE = 0x80, AF = 0x400, MSL = 1 << 16, BUSY = 2 << 16,
    TRA = 4 << 16
};

/* A byte comes when the driver asks for its flag, so that what it has said of the acknowledge and of
 * the stop counts: as it does in time with the part, where a byte takes 20 us or more. */
class I2cUnit : public I2cMaster {
public:
    I2cUnit(unsigned scl, unsigned sda) : scl_(1U << scl), sda_(1U << sda) {}

    uint32_t flags(uint32_t wanted)
    {
        uint32_t seen, state = flags_ & (MSL | BUSY);
        bool before = held_;

        while ((wanted & RXNE && !held_) || (wanted & BTF && held_ < 2) || (stops_ && !held_))
            if (!take())
                break;
        seen = flags_ | (held_ ? (uint32_t)RXNE : 0) | (held_ > 1 ? (uint32_t)BTF : 0);
        if (wanted & ADDR)
            flags_ &= ~ADDR;
        /* RXNE comes with the byte's acknowledge, before a stop has ended the bus. */
        return !before && held_ ? seen | state : seen;
    }
    uint8_t taken()
    {
        uint8_t value = bytes_[0];

        flags_ &= ~ADDR;
        if (!held_ && take())
            value = bytes_[0];
        bytes_[0] = bytes_[1];
        held_ -= held_ > 0;
        return value;
    }
    void step(Stm32I2cStep what, uint32_t value)
    {
        switch (what) {
        case I2C_START:
            flags(0); /* a stop that waits for its byte comes first */
            if (value) {
                start();
                flags_ = SB | MSL | BUSY;
                held_ = 0;
                receives_ = false;
            }
            break;
        case I2C_ADDRESS:
            receives_ = value & 1;
            first_ = true;
            flags_ = MSL | BUSY | (!send((uint8_t)value) ? (uint32_t)AF
                                   : receives_ ? (uint32_t)ADDR : ADDR | TXE | TRA);
            receives_ = receives_ && !(flags_ & AF);
            break;
        case I2C_SEND:
            flags_ = MSL | BUSY | TRA | (send((uint8_t)value) ? TXE | BTF : (uint32_t)AF);
            break;
        case I2C_ACK: more_ = value; break;
        case I2C_POS: next_ = value == 0x800; break;
        case I2C_CLEAR: flags_ &= ~(value & AF); break;
        case I2C_STOP:
            stops_ = value;
            if (value && !receives_)
                finish();
            break;
        }
    }

private:
    void line(unsigned pin, bool level)
    {
        Port &port = ports[PORT];

        port.low = (uint16_t)(level ? port.low & ~pin : port.low | pin);
        apply(PORT);
    }
    void clock(bool level) override { line(scl_, level); }
    void data(bool level) override { line(sda_, level); }
    bool sensed() override { return port_input(PORT) & sda_; }
    bool take()
    {
        bool more = more_ || (next_ && first_); /* POS: the acknowledge is meant for the second */

        if (!receives_ || held_ > 1)
            return false;
        flags_ &= ~ADDR;
        bytes_[held_++] = receive(more);
        first_ = false;
        receives_ = more;
        if (stops_)
            finish();
        return true;
    }
    void finish()
    {
        stop();
        stops_ = receives_ = false;
        flags_ &= AF;
    }

    static const unsigned PORT = 1; /* B */
    const unsigned scl_, sda_;
    uint32_t flags_ = 0;
    uint8_t bytes_[2];
    int held_ = 0;
    bool receives_ = false, more_ = false, next_ = false, first_ = false, stops_ = false;
} i2c[] = {{6, 7}, {10, 11}};

/* --- interrupts --------------------------------------------------------------------------------- */

uint64_t tick_time() { return period * (tick_control & SysTick_CTRL_CLKSOURCE_Msk ? 1 : 8); }

/* Where the counter stands now; whether it has reached zero since. */
bool tick()
{
    uint64_t now = own_instant(), round = ((uint64_t)tick_load + 1) * tick_time();
    bool over = tick_control & SysTick_CTRL_ENABLE_Msk && now >= tick_next;

    if (over) {
        tick_control |= SysTick_CTRL_COUNTFLAG_Msk;
        tick_next += ((now - tick_next) / round + 1) * round;
    }
    set_alarm((tick_control & 3) == 3 ? tick_next : UINT64_MAX);
    return over;
}

uint32_t lines()
{
    uint32_t levels = 0;

    for (unsigned line = 0; line < PINS; line++)
        if (exti[0] >> line & 1)
            levels |= port_lines(exti_port[line]) & 1U << line;
    return levels;
}

void call(int irq, uint32_t mask, void (*handler)(void))
{
    if (exti[EXTI_PR - EXTI_IMR] & exti[0] & mask && irqs >> irq & 1 && interrupts)
        handler();
}

bool serve()
{
    if (tick() && tick_control & SysTick_CTRL_TICKINT_Msk && interrupts)
        SysTick_Handler();
    if (exti[0] == 0)
        return false;
    uint32_t now = lines(), moved = now ^ lines_were;

    lines_were = now;
    exti[EXTI_PR - EXTI_IMR] |= moved & exti[0]
                                & ((now & exti[EXTI_RTSR - EXTI_IMR])
                                   | (~now & exti[EXTI_FTSR - EXTI_IMR]));
    call(EXTI0_IRQn, 1, EXTI0_IRQHandler);
    call(EXTI1_IRQn, 2, EXTI1_IRQHandler);
    call(EXTI2_IRQn, 4, EXTI2_IRQHandler);
    call(EXTI3_IRQn, 8, EXTI3_IRQHandler);
    call(EXTI4_IRQn, 16, EXTI4_IRQHandler);
    call(EXTI9_5_IRQn, 0x3E0, EXTI9_5_IRQHandler);
    call(EXTI15_10_IRQn, 0xFC00, EXTI15_10_IRQHandler);
    return true;
}

void write_exti(unsigned which, uint32_t value)
{
    if (which == EXTI_PR)
        exti[EXTI_PR - EXTI_IMR] &= ~value;
    else if (which == EXTI_SWIER)
        exti[EXTI_PR - EXTI_IMR] |= value;
    else
        exti[which - EXTI_IMR] = value;
    if (which == EXTI_IMR || which == EXTI_RTSR || which == EXTI_FTSR)
        lines_were = lines(); /* what moved before is no edge */
}

void write_systick(unsigned which, uint32_t value)
{
    bool was = tick_control & SysTick_CTRL_ENABLE_Msk;

    if (which == SYSTICK_CTRL)
        tick_control = (value & 7) | (tick_control & SysTick_CTRL_COUNTFLAG_Msk);
    else if (which == SYSTICK_LOAD)
        tick_load = value & SysTick_LOAD_RELOAD_Msk;
    else
        tick_control &= ~SysTick_CTRL_COUNTFLAG_Msk;
    if (which == SYSTICK_VAL || (which == SYSTICK_CTRL && !was))
        tick_next = own_instant() + ((uint64_t)tick_load + 1) * tick_time();
    tick();
}

uint32_t read_systick(unsigned which)
{
    uint32_t control;

    tick();
    control = tick_control;
    if (which == SYSTICK_CTRL) {
        tick_control &= ~SysTick_CTRL_COUNTFLAG_Msk;
        return control;
    }
    if (which != SYSTICK_VAL)
        return which == SYSTICK_LOAD ? tick_load : 0;
    return control & SysTick_CTRL_ENABLE_Msk ? (uint32_t)((tick_next - own_instant()) / tick_time())
                                             : 0;
}

const bool is_served = (set_interrupts(serve), true);

} // namespace

uint32_t stm32_read(unsigned index)
{
    Inside shim;
    unsigned which = index >> 4, number = index & 15;

    if (which >= SYSTICK_CTRL && which <= DWT_CYCCNT) {
        compute(period);
        return which == DWT_CYCCNT ? (uint32_t)((own_instant() - cycles_from) / period)
                                   : read_systick(which);
    }
    if (which == USART_DR)
        return (uint8_t)console_read();
    if (which == USART_SR)
        return USART_SR_TXE | USART_SR_TC | (console_ready() ? (uint32_t)USART_SR_RXNE : 0);
    if (which >= EXTI_IMR) {
        compute(period);
        return exti[which - EXTI_IMR];
    }
    if (!clocked(number))
        return 0;
    const Port &port = ports[number];

    switch (which) {
    case IDR: return port_input(number);
    case CRL: return read_f1_mode(port, 0);
    case CRH: return read_f1_mode(port, 8);
    case MODER: return port.modes;
    case OTYPER: return port.open_drain;
    case PUPDR: return port.pulls;
    case ODR: return port_level(number), port.odr;
    default: return 0;
    }
}

void stm32_write(unsigned index, uint32_t value)
{
    Inside shim;
    unsigned which = index >> 4, number = index & 15;

    if (which == DWT_CYCCNT)
        cycles_from = own_instant() - value * period;
    else if (which >= SYSTICK_CTRL && which <= SYSTICK_CALIB)
        write_systick(which, value);
    else if (which == USART_DR)
        console_write((uint8_t)value);
    else if (which >= EXTI_IMR && which <= EXTI_PR)
        write_exti(which, value);
    if (which >= EXTI_IMR || !clocked(number))
        return;
    Port &port = ports[number];

    switch (which) {
    case ODR: port.odr = (uint16_t)value; break;
    case BSRR: port.odr = (uint16_t)((port.odr & ~(value >> 16)) | value); break;
    case BSRRL: port.odr |= (uint16_t)value; break;
    case BRR:
    case BSRRH: port.odr &= (uint16_t)~value; break;
    case CRL: write_f1_mode(port, 0, value); break;
    case CRH: write_f1_mode(port, 8, value); break;
    case MODER: port.modes = value; break;
    case OTYPER: port.open_drain = (uint16_t)value; break;
    case PUPDR: port.pulls = value; break;
    default: return;
    }
    apply(number);
}

void stm32_pins(unsigned number, unsigned pins, Stm32Mode mode, bool open_drain, Stm32Pull pull)
{
    Inside shim;

    if (!clocked(number))
        return;
    Port &port = ports[number];

    for (unsigned pin = 0; pin < PINS; pin++)
        if (pins >> pin & 1) {
            set_two(port.modes, pin, mode);
            set_two(port.pulls, pin, is_f1 && pull ? BY_ODR : (uint32_t)pull);
        }
    port.open_drain = (uint16_t)(open_drain ? port.open_drain | pins : port.open_drain & ~pins);
    if (is_f1 && pull)
        port.odr = (uint16_t)(pull == PULL_UP ? port.odr | pins : port.odr & ~pins);
    apply(number);
}

void stm32_exti(unsigned port, unsigned line) { exti_port[line & 15] = (uint8_t)port; }

void stm32_irq(int number, bool on)
{
    Inside shim;

    if (number >= 0)
        irqs = on ? irqs | UINT64_C(1) << number : irqs & ~(UINT64_C(1) << number);
    serve_interrupts();
}

void stm32_interrupts(bool on)
{
    Inside shim;

    interrupts = on;
    serve_interrupts();
}

bool stm32_core(uint32_t hertz, bool f1)
{
    Inside shim;

    is_f1 = f1;
    SystemCoreClock = hertz;
    period = UINT64_C(1000000000000) / hertz;
    set_clock_period(period);
    return true;
}

void stm32_i2c_clock(unsigned bus, uint32_t hertz) { i2c[bus].set_clock(hertz ? hertz : 100000); }

void stm32_i2c_step(unsigned bus, Stm32I2cStep what, uint32_t value)
{
    Inside shim;

    if (clocked(1))
        i2c[bus].step(what, value);
}

uint32_t stm32_i2c_flags(unsigned bus, uint32_t wanted)
{
    Inside shim;

    compute(period);
    return i2c[bus].flags(wanted);
}

uint8_t stm32_i2c_taken(unsigned bus)
{
    Inside shim;

    return i2c[bus].taken();
}

bool stm32_i2c(unsigned bus, uint8_t address, const uint8_t *head, unsigned heads,
               const uint8_t *out, unsigned outs, uint8_t *in, unsigned ins)
{
    Inside shim;
    I2cUnit &unit = i2c[bus];
    bool heard = clocked(1);

    if (heard && (heads || outs || !ins)) {
        unit.start();
        heard = unit.send((uint8_t)(address & 0xFE));
        while (heard && heads--)
            heard = unit.send(*head++);
        while (heard && outs--)
            heard = unit.send(*out++);
    }
    if (heard && ins) {
        unit.start();
        heard = unit.send(address | 1);
        while (heard && ins--)
            *in++ = unit.receive(ins > 0);
    }
    if (clocked(1))
        unit.stop();
    return heard;
}

I2C_TypeDef i2c_unit[2] = {{0}, {1}};
EXTI_TypeDef exti_unit = {EXTI_IMR, EXTI_EMR, EXTI_RTSR, EXTI_FTSR, EXTI_SWIER, EXTI_PR};
SysTick_Type systick = {SYSTICK_CTRL, SYSTICK_LOAD, SYSTICK_VAL, SYSTICK_CALIB};
DWT_Type dwt = {0, DWT_CYCCNT};
CoreDebug_Type core_debug;
#define USART {USART_SR, USART_DR, 0, 0, 0, 0, 0}
USART_TypeDef usart[6] = {USART, USART, USART, USART, USART, USART};

} // namespace vbus_shim

uint32_t SysTick_Config(uint32_t ticks)
{
    if (ticks == 0 || ticks - 1 > SysTick_LOAD_RELOAD_Msk)
        return 1;
    SysTick->LOAD = ticks - 1;
    SysTick->VAL = 0;
    SysTick->CTRL = 7;
    return 0;
}

void SysTick_CLKSourceConfig(uint32_t source)
{
    MODIFY_REG(SysTick->CTRL, (uint32_t)SysTick_CTRL_CLKSOURCE_Msk, source);
}

/* Every turn of a loop comes here, and takes some four clock periods: a program that waits for a tick
 * or for a handler's flag, or counts, uses chip time without an access. */
#if defined __GNUC__ && __GNUC__ >= 12
extern "C" __attribute__((no_sanitize_coverage)) void __sanitizer_cov_trace_pc(void)
{
    if (vbus_shim::in_shim)
        return;
    vbus_shim::in_shim++;
    vbus_shim::compute(4 * vbus_shim::period);
    vbus_shim::in_shim--;
}
#else
#error "the STM32 shim counts the turns of loops: it wants g++ 12 or later"
#endif
