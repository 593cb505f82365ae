/* What an LM629 driver does: reset, set the filter, load a trajectory, poll until it is complete.
 * Prints how often each wait has polled.
 *
 *     polling_host WHERE [leases] [posting] [sleeps] [slaved]
 */
#include "vbus.h"

#include <stdio.h>
#include <stdlib.h>
#include <string.h>

static struct vbus bus;
static int sleeps, slaved;
static uint64_t own_clock;

static int must(int result)
{
    if (result < 0) {
        printf("%s\n", vbus_strerror(result));
        exit(1);
    }
    return result;
}

static void tick(void)
{
    if (slaved)
        must(vbus_at(&bus, own_clock += 3 * VBUS_US / 2));
}

static int status(void)
{
    tick();
    return must(vbus_read(&bus, 0));
}

static void write_byte(unsigned address, unsigned data)
{
    tick();
    must(vbus_write(&bus, address, data));
}

static void wait_for(int mask, int value)
{
    int count = 1;

    for (; (status() & mask) != value; count++)
        if (sleeps && slaved)
            own_clock += 5 * VBUS_US;
        else if (sleeps)
            must(vbus_delay(&bus, 5 * VBUS_US));
    printf("%d\n", count);
}

static void command(unsigned code, unsigned count, const unsigned char *data)
{
    unsigned turn;

    write_byte(0, code);
    wait_for(1, 0);
    for (turn = 0; turn + 1 < count; turn += 2) {
        write_byte(1, data[turn]);
        write_byte(1, data[turn + 1]);
        wait_for(1, 0);
    }
}

int main(int count, char **arguments)
{
    static const unsigned char filter[] = {0, 15, 0, 50, 0, 10, 0, 50, 0, 100};
    static const unsigned char move[] = {0, 42, 0, 0, 0, 20, 0, 2, 0, 0, 0, 0, 4, 0};
    int turn;

    must(vbus_open(&bus, arguments[1]));
    for (turn = 2; turn < count; turn++) {
        if (strcmp(arguments[turn], "leases") == 0)
            must(vbus_leases(&bus, 1));
        if (strcmp(arguments[turn], "posting") == 0)
            vbus_buffer(&bus);
        sleeps |= strcmp(arguments[turn], "sleeps") == 0;
        slaved |= strcmp(arguments[turn], "slaved") == 0;
    }
    wait_for(0xFF, 0x84);
    command(0x1E, sizeof filter, filter);
    command(0x04, 0, NULL);
    command(0x1F, sizeof move, move);
    command(0x01, 0, NULL);
    wait_for(4, 4);
    must(vbus_flush(&bus));
    must(vbus_echo(&bus, 1));
    vbus_close(&bus);
    return 0;
}
