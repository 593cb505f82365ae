/* driver.c - moves an LM629 by 100 counts and prints where it should be now.
 *
 *     driver LINK
 *
 * It works on the desk, with the one chip that is there. Two habits in it are wrong for others;
 * both are found by test_driver.py. With -DCAREFUL they are gone.
 */
#include "vbus.h"

#include <stdio.h>
#include <stdlib.h>

#define COMMAND_PORT 0
#define DATA_PORT 1

#define BUSY 0x01
#define TRAJECTORY_COMPLETE 0x04

#ifdef CAREFUL
#define BUSY_POLLS 500
#else
#define BUSY_POLLS 30 /* "busy never took more than 15" */
#endif

static struct vbus bus;

static int must(int result)
{
    if (result < 0) {
        fprintf(stderr, "driver: %s\n", vbus_strerror(result));
        exit(2);
    }
    return result;
}

static int status(void)
{
    return must(vbus_read(&bus, COMMAND_PORT));
}

static void wait_ready(void)
{
    int polls;

    for (polls = 0; polls < BUSY_POLLS; polls++)
        if (!(status() & BUSY))
            return;
}

static void command(unsigned code)
{
    wait_ready();
    must(vbus_write(&bus, COMMAND_PORT, code));
}

static void word(unsigned value)
{
    wait_ready();
    must(vbus_write(&bus, DATA_PORT, value >> 8));
    must(vbus_write(&bus, DATA_PORT, value & 0xFF));
}

static long read_long(void)
{
    unsigned long value = 0;
    int n;

    for (n = 0; n < 4; n++) {
        if (n % 2 == 0)
            wait_ready();
        value = value << 8 | (unsigned)must(vbus_read(&bus, DATA_PORT));
    }
    return value & 0x80000000UL ? -(long)(0xFFFFFFFFUL - value) - 1 : (long)value;
}

static int awake(int first)
{
#ifdef CAREFUL
    return first == 0x84 || first == 0xC4;
#else
    return first == 0x84;
#endif
}

int main(int argc, char **argv)
{
    if (argc != 2) {
        fprintf(stderr, "usage: driver LINK\n");
        return 2;
    }
    must(vbus_open(&bus, argv[1]));
    while (!awake(status()))
        ; /* the reset takes less than 1.5 ms */

    command(0x1D); /* RSTI: all interrupts */
    word(0x0000);
    command(0x1E); /* LFIL: kp */
    word(0x0008);
    word(100);
    command(0x04); /* UDF */
    command(0x1F); /* LTRJ: acceleration, velocity, position */
    word(0x002A);
    word(8);
    word(0);
    word(24);
    word(0);
    word(0);
    word(100);
    command(0x01); /* STT */
    while (!(status() & TRAJECTORY_COMPLETE))
        ;
    command(0x08); /* RDDP */
    printf("at %ld\n", read_long());
    vbus_close(&bus);
    return 0;
}
