/* lm629_bus.h - the wiring of an LM629 to an ATmega328P; see lm629_bus.c. */
#ifndef LM629_BUS_H
#define LM629_BUS_H

void lm629_bus_init(void); /* port directions, and a hardware reset */

#endif
