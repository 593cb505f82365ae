/* ppi_card.c - two LM629 on the ports of an 82C55 at 360H. */
#include "axes.h"
#include "lm629_driver.h"

#include <stdio.h>
#include <stdlib.h>
#include <sys/io.h>
#include <time.h>

#define PORT_A 0x360
#define PORT_B 0x361
#define CONTROL 0x363
#define MODE 0x82 /* A and C are outputs, B is an input */
#define LOW(bit) (uint8_t)((bit) << 1)
#define HIGH(bit) (uint8_t)((bit) << 1 | 1)

enum { PS, READ, WRITE, DRIVE, SELECT, RUN = 6 }; /* bits of port C */

uint8_t axis;

static void line(uint8_t what)
{
    outb(what, CONTROL);
}

static uint8_t read_cycle(int data)
{
    uint8_t byte;

    line(data ? HIGH(PS) : LOW(PS));
    line(HIGH(SELECT + axis));
    line(HIGH(READ));
    byte = inb(PORT_B);
    line(LOW(READ));
    line(LOW(SELECT + axis));
    return byte;
}

static void write_cycle(int data, uint8_t byte)
{
    line(data ? HIGH(PS) : LOW(PS));
    outb(byte, PORT_A);
    line(HIGH(DRIVE));
    line(HIGH(SELECT + axis));
    line(HIGH(WRITE));
    line(LOW(WRITE));
    line(LOW(SELECT + axis));
    line(LOW(DRIVE));
}

uint8_t lm629_bus_read_status(void)
{
    return read_cycle(0);
}

void lm629_bus_write_command(uint8_t command)
{
    write_cycle(0, command);
}

uint8_t lm629_bus_read_data(void)
{
    return read_cycle(1);
}

void lm629_bus_write_data(uint8_t data)
{
    write_cycle(1, data);
}

void axes_init(void)
{
    struct timespec reset = {0, 2000000};

    if (ioperm(PORT_A, 8, 1) != 0) {
        perror("ioperm");
        exit(1);
    }
    outb(MODE, CONTROL);
    nanosleep(&reset, NULL);
    line(HIGH(RUN));
    nanosleep(&reset, NULL);
}
