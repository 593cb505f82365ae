/* dos.h - port accesses and delays as DOS compilers have them. License: Apache-2.0. */
#ifndef VBUS_SHIM_DOS_H
#define VBUS_SHIM_DOS_H

#include <conio.h>

static inline void vbus_delay_ms(unsigned milliseconds)
{
    card_pass((uint64_t)milliseconds * 1000000000U);
}

#define delay(milliseconds) vbus_delay_ms(milliseconds)
#define _disable() ((void)0)
#define _enable() ((void)0)
#define disable() ((void)0)
#define enable() ((void)0)

#endif
