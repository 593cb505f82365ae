/* main.c - homes and moves an axis with the driver of mcp1200_driver.c on a virtual board.
 *
 *     axis LINK             LINK as vbus run prints it
 *
 * This file is the board: it supplies the driver's bus functions and the pause, and counts the
 * pulses on TRIG. On real hardware they would be port accesses and an interrupt; here they are
 * calls of the C client.
 */
#include "mcp1200_driver.h"
#include "vbus.h"

#include <stdio.h>
#include <stdlib.h>

#define TOLERANCE 3 /* counts: the motor has friction */

static struct vbus bus;
static unsigned trigger;
static unsigned pulses;

/* --- what the driver needs -------------------------------------------------------------------- */

static int must(int result, const char *what)
{
    if (result < 0) {
        fprintf(stderr, "%s: %s\n", what, vbus_strerror(result));
        exit(2);
    }
    return result;
}

uint8_t mcp1200_bus_read(uint8_t reg)
{
    return (uint8_t)must(vbus_read(&bus, reg), "bus read");
}

void mcp1200_bus_write(uint8_t reg, uint8_t data)
{
    must(vbus_write(&bus, reg, data), "bus write");
}

void mcp1200_pause_us(unsigned microseconds)
{
    must(vbus_delay(&bus, microseconds * VBUS_US), "pause");
}

/* --- the rest of the board -------------------------------------------------------------------- */

static void on_event(void *context, uint32_t outputs, uint64_t instant)
{
    (void)context;
    (void)instant;
    if (!(outputs >> trigger & 1))
        pulses++;
}

static void watch_trigger(void)
{
    trigger = (unsigned)must(vbus_number(&bus, "outputs", "TRIG"), "TRIG");
    bus.on_event = on_event;
    must(vbus_events(&bus, UINT32_C(1) << trigger), "events");
}

/* --- the program ------------------------------------------------------------------------------ */

static void check(int result, const char *what)
{
    if (result != MCP1200_OK) {
        printf("%s: failed (%d), status %02Xh\n", what, result, mcp1200_status());
        exit(1);
    }
}

static void move_to(const struct mcp1200_move *move)
{
    char phases[8];
    unsigned seen = 0;
    uint8_t phase, last = 0;
    long real;

    printf("move to %ld, %s\n", (long)move->final, move->jerk ? "S-curve" : "trapezoid");
    check(mcp1200_begin(move), "profile");
    while (mcp1200_flags() & MCP1200_F_PROFILE) {
        phase = mcp1200_phase();
        if (phase != last && phase != 0 && seen < sizeof phases - 1)
            phases[seen++] = (char)('0' + phase);
        last = phase;
        mcp1200_pause_us(520);
    }
    phases[seen] = '\0';
    printf("  phases %s\n", phases);
    mcp1200_pause_us(200000);
    real = (long)mcp1200_position();
    if (mcp1200_command_position() != move->final || labs(real - (long)move->final) > TOLERANCE) {
        printf("  command %ld, actual %ld: not there\n", (long)mcp1200_command_position(), real);
        exit(1);
    }
    printf("  position reached\n");
}

int main(int count, char **arguments)
{
    static const struct mcp1200_pid pid = { 30, 120, 80 };
    static const struct mcp1200_move out = { 26000, 40, 0x0080, 0 };
    static const struct mcp1200_move back = { 0, 40, 0x0080, 0x0800 };
    uint8_t status;
    int32_t index;
    uint64_t now;

    if (count != 2) {
        fprintf(stderr, "usage: %s LINK\n", arguments[0]);
        return 2;
    }
    must(vbus_open(&bus, arguments[1]), arguments[1]);

    check(mcp1200_check_reset(&status), "reset");
    printf("reset: status %02Xh\n", status);
    check(mcp1200_start(&pid), "control mode");

    check(mcp1200_home(0x0200, 0x0010, &index), "home");
    printf("home: index captured at %ld\n", (long)index);

    watch_trigger();
    mcp1200_breakpoints(15000, 2500);
    move_to(&out);
    printf("  %u pulses on TRIG: at 15000 and every 2500 counts\n", pulses);
    if (pulses != 1 + (26000 - 15000) / 2500)
        exit(1);
    mcp1200_breakpoints_off();

    move_to(&back);
    printf("status %02Xh\n", mcp1200_status());
    must(vbus_now(&bus, &now), "time");
    printf("%lu us of chip time\n", (unsigned long)(now / VBUS_US));
    vbus_close(&bus);
    return 0;
}
