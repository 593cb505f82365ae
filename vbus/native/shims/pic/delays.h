/* delays.h - C18's delays, in instruction cycles; 0 is 256. License: Apache-2.0. */
#ifndef VBUS_SHIM_PIC_DELAYS_H
#define VBUS_SHIM_PIC_DELAYS_H

#include "p18cxxx.h"

static inline uint64_t vbus_units(unsigned char count) { return count ? count : 256; }

#define Delay1TCY() _delay(1)
#define Delay10TCY() _delay(10)
#define Delay10TCYx(count) _delay(10 * vbus_units(count))
#define Delay100TCYx(count) _delay(100 * vbus_units(count))
#define Delay1KTCYx(count) _delay(1000 * vbus_units(count))
#define Delay10KTCYx(count) _delay(10000 * vbus_units(count))

#endif
