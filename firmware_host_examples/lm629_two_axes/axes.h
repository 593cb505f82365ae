/* axes.h - two LM629, of which one is spoken to at a time.
 *
 * Each layer gives the axes, and the four bus functions of ../lm629_c/lm629_driver.h; pauses and
 * characters are the computer's, and stand in main.c.
 */
#ifndef AXES_H
#define AXES_H

#include <stdint.h>

#define X 0
#define Y 1

extern uint8_t axis; /* which chip the bus functions reach */

void axes_init(void); /* both chips come out of a hardware reset */
void pause_ms(uint16_t milliseconds);
void put_char(char c);

#endif
