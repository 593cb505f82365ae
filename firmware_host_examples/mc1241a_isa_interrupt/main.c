/* main.c - two stepper axes on an ISA card whose interrupt steers them.
 *
 * This file is the computer and the program: ports from user space, the card's interrupt by a
 * blocking read of /dev/uio0. The driver is that of ../mc1241a_isa_c.
 */
#include "mc1241a_driver.h"

#include <fcntl.h>
#include <stdio.h>
#include <stdlib.h>
#include <sys/io.h>
#include <time.h>
#include <unistd.h>

/* --- the board -------------------------------------------------------------------------------- */

#define BASE 0x340 /* + 0 data, + 2 commands, + 4 HostRdy in D7, + 8 reset */

int mc1241a_bus_ready(void)
{
    return inb(BASE + 4) & 0x80;
}

void mc1241a_bus_write_command(uint8_t command)
{
    outb(command, BASE + 2);
}

uint8_t mc1241a_bus_read_data(void)
{
    return inb(BASE);
}

void mc1241a_bus_write_data(uint8_t data)
{
    outb(data, BASE);
}

void mc1241a_bus_reset(void)
{
    outb(0, BASE + 8);
}

void mc1241a_pause_ms(unsigned milliseconds)
{
    struct timespec pause;

    pause.tv_sec = milliseconds / 1000;
    pause.tv_nsec = (long)(milliseconds % 1000) * 1000000;
    nanosleep(&pause, NULL);
}

static int interrupt_file;

static uint32_t wait_for_interrupt(void)
{
    uint32_t number;

    if (read(interrupt_file, &number, sizeof number) != sizeof number) {
        perror("/dev/uio0");
        exit(1);
    }
    return number;
}

static void enable_interrupt(void)
{
    uint32_t on = 1;

    if (write(interrupt_file, &on, sizeof on) != sizeof on) {
        perror("/dev/uio0");
        exit(1);
    }
}

static void open_board(void)
{
    if (ioperm(BASE, 9, 1) != 0) {
        perror("ioperm");
        exit(1);
    }
    interrupt_file = open("/dev/uio0", O_RDWR);
    if (interrupt_file < 0) {
        perror("/dev/uio0");
        exit(1);
    }
}

/* --- the machine ------------------------------------------------------------------------------ */

#define TURN 12800L       /* microsteps in a turn: 200 full steps of 64 */
#define STEP_RATIO 40     /* encoder counts for a microstep, in 1/256: 2000 in a turn */
#define AMPLITUDE 24000   /* of 32767 */

/* Microsteps per cycle of 542.72 us, and per cycle per cycle, in 1/65536. */
#define VELOCITY (24L << 16)
#define ACCELERATION (1L << 14)

static void check(int result, const char *what)
{
    static const char *const why[] = { "", "HostRdy stays low", "checksum", "not in time" };

    if (result == MC1241A_OK)
        return;
    printf("%s: %s\n", what, why[-result]);
    exit(1);
}

#define CHECK(call) check(call, #call)

static uint16_t word(uint8_t command)
{
    uint16_t value;

    CHECK(mc1241a_read_word(command, &value));
    return value;
}

static int32_t number(uint8_t command)
{
    int32_t value;

    CHECK(mc1241a_read_long(command, &value));
    return value;
}

static void set_up(uint8_t axis)
{
    word(axis);
    CHECK(mc1241a_command(MC1241A_SET_PHASE_2));
    CHECK(mc1241a_write_word(MC1241A_SET_STEP_RATIO, STEP_RATIO));
    CHECK(mc1241a_write_word(MC1241A_SET_BUF_MTR_CMD, AMPLITUDE));
    CHECK(mc1241a_write_long(MC1241A_SET_VEL, VELOCITY));
    CHECK(mc1241a_write_long(MC1241A_SET_ACC, ACCELERATION));
    CHECK(mc1241a_write_word(MC1241A_SET_INTRPT_MASK, MC1241A_MOTION_COMPLETE));
}

/* The next target of each axis; 0, where it started, is the last. */
static const int32_t way[2][4] = { { TURN, -TURN, TURN / 2, 0 }, { 3 * TURN, 0, 0, 0 } };
static unsigned place[2];

/* The manual's interrupt service: find the axis, look why, clear that, let the line go. */
static int service(void)
{
    uint16_t status = word(MC1241A_GET_INTRPT);
    int axis = MC1241A_AXIS(status);
    int32_t target;

    word(MC1241A_SET_I);
    target = number(MC1241A_GET_TRGT_POS);
    printf("axis %d, status %04X: %ld microsteps, %ld counts", axis, status, (long)target,
           (long)number(MC1241A_GET_ACTL_POS));
    CHECK(mc1241a_write_word(MC1241A_RST_INTRPT, (uint16_t)~MC1241A_MOTION_COMPLETE & 0xFF));
    if (target == 0) {
        printf(", home\n");
        return 1;
    }
    target = way[axis - 1][++place[axis - 1]];
    CHECK(mc1241a_write_long(MC1241A_SET_POS, target));
    CHECK(mc1241a_command(MC1241A_UPDATE));
    printf(", on to %ld\n", (long)target);
    return 0;
}

int main(void)
{
    int home = 0;

    open_board();
    CHECK(mc1241a_reset());
    printf("version %04X\n", word(MC1241A_GET_VRSN));
    set_up(MC1241A_SET_1);
    CHECK(mc1241a_write_long(MC1241A_SET_POS, way[0][0]));
    set_up(MC1241A_SET_2);
    CHECK(mc1241a_write_long(MC1241A_SET_POS, way[1][0]));
    CHECK(mc1241a_write_word(MC1241A_MULTI_UPDATE, 0x0003)); /* both start in the same cycle */

    while (home < 2) {
        enable_interrupt();
        printf("interrupt %u: ", (unsigned)wait_for_interrupt());
        home += service();
    }
    printf("%ld cycles\n", (long)number(MC1241A_GET_TIME));
    return 0;
}
