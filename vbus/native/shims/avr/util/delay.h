/* util/delay.h - delays in chip time. License: Apache-2.0. */
#ifndef VBUS_SHIM_UTIL_DELAY_H
#define VBUS_SHIM_UTIL_DELAY_H

#include "../../ports.h"

#ifndef F_CPU
#define F_CPU 1000000UL
#endif

static inline void _delay_us(double microseconds)
{
    vbus_shim::pass((uint64_t)(microseconds * 1e6));
}

static inline void _delay_ms(double milliseconds)
{
    vbus_shim::pass((uint64_t)(milliseconds * 1e9));
}

static inline void _delay_loop_1(uint8_t turns)
{
    vbus_shim::pass((turns ? turns : 256) * (UINT64_C(3000000000000) / F_CPU));
}

static inline void _delay_loop_2(uint16_t turns)
{
    vbus_shim::pass((turns ? turns : 65536) * (UINT64_C(4000000000000) / F_CPU));
}

#endif
