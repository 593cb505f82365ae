/* main.c - moves an axis with the driver of lm629_driver.c on a virtual board.
 *
 *     move LINK [-v]        LINK as vbus run prints it; -v prints every bus cycle
 *
 * This file is the board: it supplies the driver's four bus functions, the reset pin, and a
 * pause. On real hardware they would be port accesses; here they are calls of the C client.
 */
#include "lm629_driver.h"
#include "vbus.h"

#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#define COMMAND_PORT 0
#define DATA_PORT 1
#define TOLERANCE 4 /* counts: the motor has friction */

static struct vbus bus;

/* --- the transcript of bus cycles ------------------------------------------------------------- */

static int verbose;
static char last[8];
static unsigned repeats;

static void flush_transcript(void)
{
    if (repeats > 1)
        printf("  %s x%u\n", last, repeats);
    else if (repeats == 1)
        printf("  %s\n", last);
    repeats = 0;
}

static void note(const char *cycle, unsigned data)
{
    char now[sizeof last];

    if (!verbose)
        return;
    sprintf(now, "%s %02X", cycle, data & 0xFF);
    if (strcmp(now, last) != 0)
        flush_transcript();
    strcpy(last, now);
    repeats++;
}

/* --- what the driver needs -------------------------------------------------------------------- */

static void must(int result, const char *what)
{
    if (result < 0) {
        fprintf(stderr, "%s: %s\n", what, vbus_strerror(result));
        exit(2);
    }
}

static uint8_t read_cycle(unsigned port, const char *cycle)
{
    int data = vbus_read(&bus, port);

    must(data, "bus read");
    note(cycle, (unsigned)data);
    return (uint8_t)data;
}

static void write_cycle(unsigned port, uint8_t data, const char *cycle)
{
    must(vbus_write(&bus, port, data), "bus write");
    note(cycle, data);
}

uint8_t lm629_bus_read_status(void)
{
    return read_cycle(COMMAND_PORT, "rs");
}

void lm629_bus_write_command(uint8_t command)
{
    write_cycle(COMMAND_PORT, command, "wc");
}

uint8_t lm629_bus_read_data(void)
{
    return read_cycle(DATA_PORT, "rd");
}

void lm629_bus_write_data(uint8_t data)
{
    write_cycle(DATA_PORT, data, "wd");
}

/* --- the rest of the board -------------------------------------------------------------------- */

static void pause_us(unsigned microseconds)
{
    must(vbus_delay(&bus, microseconds * VBUS_US), "pause");
}

static void pulse_reset(void)
{
    int pin = vbus_number(&bus, "pins", "/RST");

    must(pin, "reset pin");
    must(vbus_pin(&bus, (unsigned)pin, 0), "reset pin");
    pause_us(12);
    must(vbus_pin(&bus, (unsigned)pin, 1), "reset pin");
}

/* --- the program ------------------------------------------------------------------------------ */

static void check(int result, const char *what)
{
    flush_transcript();
    if (result != LM629_OK) {
        printf("%s: failed (%d)\n", what, result);
        exit(1);
    }
}

static void move_to(int32_t target)
{
    struct lm629_move move;
    uint8_t status;
    int32_t real, desired;
    int polls;

    /* 500 lines, 8 MHz: 5 turns/s and 25 turns/s/s, see the manual's worked example. */
    move.position = target;
    move.velocity = 167772;
    move.acceleration = 215;
    printf("move to %ld\n", (long)target);
    check(lm629_clear_flags(LM629_TRAJECTORY_COMPLETE), "RSTI");
    check(lm629_start(&move), "LTRJ, STT");
    for (polls = 0; polls < 5000; polls++) {
        status = lm629_bus_read_status();
        if (status & (LM629_TRAJECTORY_COMPLETE | LM629_POSITION_ERROR | LM629_COMMAND_ERROR))
            break;
        pause_us(1000);
    }
    flush_transcript();
    printf("  status %02Xh\n", status);
    /* A command error tells of a byte that came otherwise, or came twice, or not at all. */
    if (!(status & LM629_TRAJECTORY_COMPLETE)
        || status & (LM629_POSITION_ERROR | LM629_COMMAND_ERROR))
        check(LM629_E_STATUS, "move");
    pause_us(200000);
    check(lm629_read_desired_position(&desired), "RDDP");
    check(lm629_read_real_position(&real), "RDRP");
    if (verbose)
        printf("  desired %ld, real %ld\n", (long)desired, (long)real);
    if (desired != target || labs((long)real - target) > TOLERANCE) {
        printf("  desired %ld, real %ld: not there\n", (long)desired, (long)real);
        exit(1);
    }
    printf("  position reached\n");
}

int main(int count, char **arguments)
{
    static const struct lm629_filter filter = { 200, 200, 2000, 20000, 0 };
    uint8_t first = 0, cleared = 0;
    uint64_t now;

    if (count < 2) {
        fprintf(stderr, "usage: %s LINK [-v]\n", arguments[0]);
        return 2;
    }
    verbose = count > 2 && strcmp(arguments[2], "-v") == 0;
    must(vbus_open(&bus, arguments[1]), arguments[1]);

    pulse_reset();
    if (verbose)
        lm629_bus_read_status();
    pause_us(1500);
    check(lm629_check_reset(&first, &cleared), "reset");
    printf("reset: status %02Xh, after RSTI %02Xh\n", first, cleared);

    check(lm629_load_filter(&filter), "LFIL, UDF");
    printf("filter loaded\n");

    move_to(4000);
    move_to(-1000);
    move_to(0);

    if (verbose) {
        must(vbus_now(&bus, &now), "time");
        printf("%lu us of chip time\n", (unsigned long)(now / VBUS_US));
    }
    vbus_close(&bus);
    return 0;
}
