/* util/atomic.h - blocks that no interrupt enters. License: Apache-2.0. */
#ifndef VBUS_SHIM_UTIL_ATOMIC_H
#define VBUS_SHIM_UTIL_ATOMIC_H

#include <avr/interrupt.h>

namespace vbus_shim {
struct Atomic {
    uint8_t old;
    bool restore, more;

    explicit Atomic(bool restores) : old(SREG), restore(restores), more(true) { cli(); }
    ~Atomic()
    {
        if (!restore || old >> SREG_I & 1)
            sei();
    }
};
}

#define ATOMIC_RESTORESTATE true
#define ATOMIC_FORCEON false
#define ATOMIC_BLOCK(type) for (vbus_shim::Atomic vbus_atomic(type); vbus_atomic.more; vbus_atomic.more = false)

#endif
