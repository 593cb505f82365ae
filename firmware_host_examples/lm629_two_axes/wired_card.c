/* wired_card.c - two LM629 at 300H on an ISA card with a reset latch at 30CH. */
#include "axes.h"
#include "lm629_driver.h"

#include <stdio.h>
#include <stdlib.h>
#include <sys/io.h>
#include <time.h>

#define BASE 0x300 /* + 0 command and status of x, + 1 its data; + 2 and + 3 those of y */
#define LATCH (BASE + 12)

uint8_t axis;

uint8_t lm629_bus_read_status(void)
{
    return inb(BASE + 2 * axis);
}

void lm629_bus_write_command(uint8_t command)
{
    outb(command, BASE + 2 * axis);
}

uint8_t lm629_bus_read_data(void)
{
    return inb(BASE + 2 * axis + 1);
}

void lm629_bus_write_data(uint8_t data)
{
    outb(data, BASE + 2 * axis + 1);
}

void axes_init(void)
{
    if (ioperm(BASE, 16, 1) != 0) {
        perror("ioperm");
        exit(1);
    }
    outb(0, LATCH);
    pause_ms(1);
    outb(1, LATCH);
    pause_ms(2);
}
