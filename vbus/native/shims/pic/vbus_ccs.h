/* vbus_ccs.h - the built-in functions of the CCS compiler on the ports of xc.h. Any <18FNNNN.h> comes
 * here; `#use` and its relatives, types and the case of letters are vbus.native.ccs' part. The console
 * is RS232. Timers, ADC, SPI, I2C, interrupts and assembly are not there. License: Apache-2.0.
 */
#ifndef VBUS_SHIM_PIC_CCS_H
#define VBUS_SHIM_PIC_CCS_H

#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <string>

#include "xc.h"

/* A bit: what is assigned loses all but its lowest one. */
struct vbus_int1 {
    bool value;
    vbus_int1(int from = 0) : value(from & 1) {}
    operator bool() const { return value; }
};
typedef uint8_t byte;
typedef vbus_int1 boolean;
#define null 0
#define __pch__ 1

/* Pins: eight times the port's address in a PIC18, and the bit. */
enum { vbus_pins = 0xF80 * 8 };
#define VBUS_CCS_PORT(upper, lower, number)                                                        \
    enum {                                                                                         \
        pin_##lower##0 = vbus_pins + 8 * number, pin_##lower##1, pin_##lower##2, pin_##lower##3,   \
        pin_##lower##4, pin_##lower##5, pin_##lower##6, pin_##lower##7                             \
    };                                                                                             \
    static inline void set_tris_##lower(uint8_t value) { TRIS##upper = value; }                    \
    static inline uint8_t get_tris_##lower(void) { return TRIS##upper; }                           \
    static inline void vbus_output_##lower(uint8_t value, unsigned fast)                           \
    {                                                                                              \
        if (!(fast >> number & 1))                                                                 \
            TRIS##upper = 0;                                                                       \
        LAT##upper = value;                                                                        \
    }                                                                                              \
    static inline uint8_t vbus_input_##lower(unsigned fast)                                        \
    {                                                                                              \
        if (!(fast >> number & 1))                                                                 \
            TRIS##upper = 0xFF;                                                                    \
        return PORT##upper;                                                                        \
    }
VBUS_CCS_PORT(A, a, 0)
VBUS_CCS_PORT(B, b, 1)
VBUS_CCS_PORT(C, c, 2)
VBUS_CCS_PORT(D, d, 3)
VBUS_CCS_PORT(E, e, 4)
VBUS_CCS_PORT(F, f, 5)
VBUS_CCS_PORT(G, g, 6)

/* Ports under #use fast_io, from that line on; the others turn a pin round where it is used. */
#define vbus_fast_a 0
#define vbus_fast_b 0
#define vbus_fast_c 0
#define vbus_fast_d 0
#define vbus_fast_e 0
#define vbus_fast_f 0
#define vbus_fast_g 0
#define vbus_fast                                                                                  \
    (vbus_fast_a | vbus_fast_b << 1 | vbus_fast_c << 2 | vbus_fast_d << 3 | vbus_fast_e << 4       \
     | vbus_fast_f << 5 | vbus_fast_g << 6)

static inline void vbus_direction(unsigned pin, bool out)
{
    unsigned port = (pin - vbus_pins) / 8, bit = 1U << pin % 8, drive = vbus_shim::port_drive(port);

    vbus_shim::set_drive(port, (uint8_t)(out ? drive | bit : drive & ~bit));
}
static inline void vbus_output(unsigned pin, int level, unsigned fast)
{
    unsigned port = (pin - vbus_pins) / 8, bit = 1U << pin % 8, now = vbus_shim::port_level(port);

    vbus_shim::set_level(port, (uint8_t)(level ? now | bit : now & ~bit));
    if (!(fast >> port & 1))
        vbus_direction(pin, true);
}
static inline vbus_int1 input_state(unsigned pin)
{
    return vbus_shim::port_input((pin - vbus_pins) / 8) >> pin % 8;
}
static inline vbus_int1 vbus_input(unsigned pin, unsigned fast)
{
    if (!(fast >> (pin - vbus_pins) / 8 & 1))
        vbus_direction(pin, false);
    return input_state(pin);
}
#define output_low(pin) vbus_output(pin, 0, vbus_fast)
#define output_high(pin) vbus_output(pin, 1, vbus_fast)
#define output_bit(pin, level) vbus_output(pin, level, vbus_fast)
#define output_toggle(pin)                                                                         \
    vbus_output(pin, !(vbus_shim::port_level(((pin) - vbus_pins) / 8) >> (pin) % 8 & 1), vbus_fast)
#define output_float(pin) vbus_direction(pin, false)
#define output_drive(pin) vbus_direction(pin, true)
#define input(pin) vbus_input(pin, vbus_fast)
#define output_a(value) vbus_output_a(value, vbus_fast)
#define output_b(value) vbus_output_b(value, vbus_fast)
#define output_c(value) vbus_output_c(value, vbus_fast)
#define output_d(value) vbus_output_d(value, vbus_fast)
#define output_e(value) vbus_output_e(value, vbus_fast)
#define output_f(value) vbus_output_f(value, vbus_fast)
#define output_g(value) vbus_output_g(value, vbus_fast)
#define input_a() vbus_input_a(vbus_fast)
#define input_b() vbus_input_b(vbus_fast)
#define input_c() vbus_input_c(vbus_fast)
#define input_d() vbus_input_d(vbus_fast)
#define input_e() vbus_input_e(vbus_fast)
#define input_f() vbus_input_f(vbus_fast)
#define input_g() vbus_input_g(vbus_fast)

#define bit_set(value, bit) ((value) |= 1UL << (bit))
#define bit_clear(value, bit) ((value) &= ~(1UL << (bit)))
#define bit_test(value, bit) ((value) >> (bit) & 1)
#define make8(value, number) ((uint8_t)((uint32_t)(value) >> 8 * (number)))
#define make16(high, low) ((uint16_t)((uint8_t)(high) << 8 | (uint8_t)(low)))
static inline uint32_t make32(uint32_t d, uint32_t c) { return d << 16 | (c & 0xFFFF); }
static inline uint32_t make32(uint8_t d, uint8_t c, uint8_t b, uint8_t a)
{
    return (uint32_t)d << 24 | (uint32_t)c << 16 | (uint32_t)b << 8 | a;
}

static uint32_t vbus_ccs_hertz __attribute__((unused)) = 20000000;
static inline bool vbus_ccs_clock(uint32_t hertz)
{
    vbus_ccs_hertz = hertz;
    vbus_shim::set_clock_period(UINT64_C(4000000000000) / hertz);
    return true;
}
#define delay_ms(milliseconds) vbus_shim::pass((uint64_t)(milliseconds) * UINT64_C(1000000000))
#define delay_us(microseconds) vbus_shim::pass((uint64_t)(microseconds) * 1000000)
#define delay_cycles(cycles)                                                                       \
    vbus_shim::pass((uint64_t)(cycles) * (UINT64_C(4000000000000) / vbus_ccs_hertz))
#define restart_wdt() ((void)0)

/* What is switched off at the beginning of a program; to switch it on does not compile. */
enum { no_analogs, adc_off, psp_disabled, spi_ss_disabled, wdt_off, rtcc_off, t1_disabled, t2_disabled,
       t3_disabled, nc_nc_nc_nc };
template <class... T> static inline void setup_adc_ports(T...) {}
template <class... T> static inline void setup_adc(T...) {}
template <class... T> static inline void setup_psp(T...) {}
template <class... T> static inline void setup_spi(T...) {}
template <class... T> static inline void setup_wdt(T...) {}
template <class... T> static inline void setup_timer_0(T...) {}
template <class... T> static inline void setup_timer_1(T...) {}
template <class... T> static inline void setup_timer_2(T...) {}
template <class... T> static inline void setup_timer_3(T...) {}
template <class... T> static inline void setup_comparator(T...) {}
template <class... T> static inline void setup_vref(T...) {}
template <class... T> static inline void setup_oscillator(T...) {}
template <class... T> static inline void port_b_pullups(T...) {}

/* --- the console -------------------------------------------------------------------------------- */

static inline void vbus_putc(int value) { vbus_shim::console_write((uint8_t)value); }
static inline bool kbhit(void) { return vbus_shim::console_ready(); }
static inline uint8_t vbus_getc(void)
{
    while (!kbhit())
        vbus_shim::pass(10000000);
    return (uint8_t)vbus_shim::console_read();
}

template <class T> static inline long long vbus_wide(T value) { return (long long)value; }
static inline const char *vbus_wide(const char *text) { return text; }
static inline char *vbus_wide(char *text) { return text; }
static inline double vbus_wide(double value) { return value; }
static inline double vbus_wide(float value) { return value; }

/* Numbers of any width go by %u, %lu, %Lx: all are wide here. */
template <class... T> static void vbus_printf(const char *format, T... values)
{
    std::string wide;
    char text[512];
    bool inside = false;

    for (const char *place = format; *place; place++) {
        if (inside && strchr("lLw", *place))
            continue;
        if (inside && strchr("duxX", *place))
            wide += "ll";
        wide += *place;
        inside = inside ? strchr("0123456789.-+", *place) != 0 : *place == '%';
    }
    int size = snprintf(text, sizeof text, wide.c_str(), vbus_wide(values)...);
    for (int turn = 0; turn < size && turn < (int)sizeof text - 1; turn++)
        vbus_putc(text[turn]);
}
static inline void vbus_puts(const char *text) { vbus_printf("%s\r\n", text); }

#endif
