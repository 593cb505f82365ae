/* axis.h - one axis on an LM629. The target supplies the bus cycles and a pause. */
#ifndef AXIS_H
#define AXIS_H

#include <stdint.h>

uint8_t bus_read_status(void);
void bus_write_command(uint8_t command);
uint8_t bus_read_data(void);
void bus_write_data(uint8_t data);
void bus_pause_us(unsigned long us);

#define AXIS_OK 0
#define AXIS_BUSY 1    /* the chip stays busy */
#define AXIS_RESET 2   /* the chip does not come out of reset */
#define AXIS_STALLED 3 /* the position error was exceeded; the motor is off */
#define AXIS_LATE 4    /* the move does not end */

int axis_start(void);                              /* reset check, filter, error limit */
int axis_move(int32_t position, int32_t *reached); /* move there, wait, read back */

#endif
