/* avr/interrupt.h - ISR() for INTn_vect and PCINTn_vect; they run between two accesses to ports, at
 * delays and while sleeping. License: Apache-2.0. */
#ifndef VBUS_SHIM_AVR_INTERRUPT_H
#define VBUS_SHIM_AVR_INTERRUPT_H

#include <avr/io.h>

namespace vbus_shim {
void avr_interrupts(bool on);
}

#define sei() vbus_shim::avr_interrupts(true)
#define cli() vbus_shim::avr_interrupts(false)
#define reti() return
#define ISR_BLOCK
#define ISR_NOBLOCK
#define ISR_NAKED
#define ISR(vector, ...) extern "C" void vector(void); extern "C" void vector(void)
#define SIGNAL(vector) ISR(vector)
#define EMPTY_INTERRUPT(vector) ISR(vector) { }

#endif
