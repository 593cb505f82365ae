/* lm629_bus.h - an LM629 on an STM32: stdperiph.c or hal.c. */
#ifndef LM629_BUS_H
#define LM629_BUS_H

#include <stdint.h>

void lm629_bus_init(void); /* clocks, pins, SysTick, and a hardware reset */
void lm629_bus_delay_ms(uint32_t milliseconds);
void console_write(char character);

extern volatile uint8_t lm629_interrupted; /* HI has risen */

#endif
