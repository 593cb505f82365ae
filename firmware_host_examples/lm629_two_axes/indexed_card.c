/* indexed_card.c - two LM629 behind an index register at 280H, their port at 281H. */
#include "axes.h"
#include "lm629_driver.h"

#include <stdio.h>
#include <stdlib.h>
#include <sys/io.h>
#include <time.h>

#define INDEX 0x280 /* bit 0: data, not command and status; bit 1: y, not x */
#define PORT 0x281
#define CONTROL 0x282 /* bit 0: no reset */
#define ID 0x283      /* 'M', and 'C' behind it */

uint8_t axis;

static uint16_t port(uint8_t data)
{
    outb((unsigned char)(axis << 1 | data), INDEX);
    return PORT;
}

uint8_t lm629_bus_read_status(void)
{
    return inb(port(0));
}

void lm629_bus_write_command(uint8_t command)
{
    outb(command, port(0));
}

uint8_t lm629_bus_read_data(void)
{
    return inb(port(1));
}

void lm629_bus_write_data(uint8_t data)
{
    outb(data, port(1));
}

void axes_init(void)
{
    if (ioperm(INDEX, 8, 1) != 0) {
        perror("ioperm");
        exit(1);
    }
    if (inb(ID) != 'M' || inb(ID + 1) != 'C') {
        fprintf(stderr, "there is no such card at %XH\n", INDEX);
        exit(1);
    }
    outb(0, CONTROL);
    pause_ms(1);
    outb(1, CONTROL);
    pause_ms(2);
}
