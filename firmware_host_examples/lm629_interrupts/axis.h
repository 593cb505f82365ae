/* axis.h - what the three programs have in common: the axis, its moves, and what is printed. */
#ifndef AXIS_H
#define AXIS_H

#include "lm629_card.h"

#include <stdint.h>

#define MOVES 3

extern struct lm629 card;
extern const int32_t targets[MOVES];

/* End the program with a message unless the result is LM629_OK. */
void check(int result, const char *what);

/* Reset, filter, and trajectory complete as what interrupts. */
void open_axis(void);

void start_move(int number);

/* After trajectory complete: let the load settle and print whether the axis is there. */
void tell(int number, uint8_t status);

#endif
