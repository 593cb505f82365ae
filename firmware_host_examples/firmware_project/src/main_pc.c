/* main_pc.c - the target "PC": bus cycles go to a virtual board at $VBUS_LINK.
 *
 *     main_pc POSITION     exit code: that of axis.h
 */
#include "axis.h"
#include "vbus.h"

#include <stdio.h>
#include <stdlib.h>

static struct vbus bus;

static uint8_t must(int result)
{
    if (result < 0) {
        fprintf(stderr, "%s\n", vbus_strerror(result));
        exit(99);
    }
    return (uint8_t)result;
}

uint8_t bus_read_status(void) { return must(vbus_read(&bus, 0)); }
void bus_write_command(uint8_t code) { must(vbus_write(&bus, 0, code)); }
uint8_t bus_read_data(void) { return must(vbus_read(&bus, 1)); }
void bus_write_data(uint8_t data) { must(vbus_write(&bus, 1, data)); }

void bus_pause_us(unsigned long us) { must(vbus_delay(&bus, us * VBUS_US)); }

int main(int argc, char **argv)
{
    const char *link = getenv("VBUS_LINK");
    int32_t reached = 0;
    int result;

    if (argc != 2 || link == NULL) {
        fprintf(stderr, "usage: VBUS_LINK=... %s POSITION\n", argv[0]);
        return 98;
    }
    must(vbus_open(&bus, link));
    result = axis_start();
    if (result == AXIS_OK)
        result = axis_move((int32_t)atol(argv[1]), &reached);
    if (result == AXIS_OK)
        printf("%ld\n", (long)reached);
    vbus_close(&bus);
    return result;
}
