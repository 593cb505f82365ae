/* main.c - two stepper axes behind the ISA circuit of the MC1241A manual.
 *
 * This file is the board and the program. The board is the manual's: data at 340H, commands at
 * 342H, HostRdy in D7 of 344H, reset at 348H. Port accesses and delays are those of DOS compilers.
 */
#include "mc1241a_driver.h"

#include <conio.h>
#include <dos.h>
#include <stdio.h>
#include <stdlib.h>

/* --- the board -------------------------------------------------------------------------------- */

#define BADR 0x340

int mc1241a_bus_ready(void)
{
    return inp(BADR + 4) & 0x80;
}

void mc1241a_bus_write_command(uint8_t command)
{
    outp(BADR + 2, command);
}

uint8_t mc1241a_bus_read_data(void)
{
    return (uint8_t)inp(BADR);
}

void mc1241a_bus_write_data(uint8_t data)
{
    outp(BADR, data);
}

void mc1241a_bus_reset(void)
{
    outp(BADR + 8, 0);
}

void mc1241a_pause_ms(unsigned milliseconds)
{
    delay(milliseconds);
}

/* --- the machine ------------------------------------------------------------------------------ */

#define TURN 12800L      /* microsteps in a turn: 200 full steps of 64 */
#define COUNTS 2000L     /* encoder counts in a turn */
#define STEP_RATIO 40    /* COUNTS / TURN * 256 */
#define AMPLITUDE 24000  /* of 32767 */
#define TOLERANCE 3      /* counts: a motor hangs back under its friction */

/* Usteps per cycle of 542.72 us, and per cycle per cycle, in 1/65536. */
#define VELOCITY (24L << 16)
#define ACCELERATION (1L << 14)
#define SLOW (4L << 16)
#define FAST (80L << 16)
#define ERROR_LIMIT 30   /* counts; at full speed a cycle is 12 counts, and the motor swings */

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

static void load(int32_t position, int32_t velocity, int32_t acceleration)
{
    CHECK(mc1241a_write_long(MC1241A_SET_POS, position));
    CHECK(mc1241a_write_long(MC1241A_SET_VEL, velocity));
    CHECK(mc1241a_write_long(MC1241A_SET_ACC, acceleration));
}

static uint16_t wait_for(uint16_t bits)
{
    uint16_t status;

    CHECK(mc1241a_wait(MC1241A_GET_STATUS, bits, 5, 2000, &status));
    return status;
}

static void expect_at(const char *what, int32_t microsteps)
{
    int32_t target, actual, counts = microsteps / (TURN / 400) * (COUNTS / 400);

    mc1241a_pause_ms(50);
    target = number(MC1241A_GET_TRGT_POS);
    actual = number(MC1241A_GET_ACTL_POS);
    if (target != microsteps || labs((long)(actual - counts)) > TOLERANCE) {
        printf("%s: target %ld, actual %ld: not there\n", what, (long)target, (long)actual);
        exit(1);
    }
    printf("  %s: at %ld\n", what, (long)target);
}

static void set_up(uint8_t axis)
{
    printf("  status %04X\n", word(axis));
    CHECK(mc1241a_command(MC1241A_SET_PHASE_2));
    CHECK(mc1241a_write_word(MC1241A_SET_STEP_RATIO, STEP_RATIO));
    CHECK(mc1241a_write_word(MC1241A_SET_BUF_MTR_CMD, AMPLITUDE));
}

/* "External Breakpoints and Homing": the axis stops in the cycle that sees the home switch. */
static void home(void)
{
    printf("homing: axis 1\n");
    if (!(word(MC1241A_GET_HOME) & 1)) {
        printf("  at home already\n");
        exit(1);
    }
    load(-12345, SLOW, ACCELERATION);
    CHECK(mc1241a_command(MC1241A_UPDATE));      /* start home move */
    CHECK(mc1241a_command(MC1241A_SET_EXT_BRK)); /* initiate external breakpoint mode */
    CHECK(mc1241a_command(MC1241A_STOP));        /* load (but do not update) a stop command */
    printf("  status %04X\n", wait_for(MC1241A_BREAKPOINT));
    printf("  home switch %s\n", word(MC1241A_GET_HOME) & 1 ? "open" : "closed");
    mc1241a_pause_ms(50);
    printf("  found at %ld counts\n", (long)number(MC1241A_GET_ACTL_POS));
    CHECK(mc1241a_write_long(MC1241A_SET_ACTL_POS, 0));
    CHECK(mc1241a_command(MC1241A_CLR_STATUS));
}

static void s_curve(void)
{
    unsigned phases = 0, polls;

    printf("S-curve: axis 1, two turns\n");
    CHECK(mc1241a_command(MC1241A_SET_PRFL_S_CRV));
    CHECK(mc1241a_write_long(MC1241A_SET_POS, 2 * TURN));
    CHECK(mc1241a_write_long(MC1241A_SET_VEL, VELOCITY));
    CHECK(mc1241a_write_word(MC1241A_SET_MAX_ACC, 0x2000));
    CHECK(mc1241a_write_long(MC1241A_SET_JERK, 0x00400000));
    CHECK(mc1241a_command(MC1241A_UPDATE));
    for (polls = 0; polls < 2000; polls++) {
        unsigned phase = word(MC1241A_GET_MODE) >> 13;

        if (phase > 0 && phases % 10 != phase) {
            phases = phases * 10 + phase;
        } else if (phase == 0 && phases != 0) {
            break;
        }
        mc1241a_pause_ms(5);
    }
    printf("  phases %u\n", phases);
    printf("  status %04X\n", wait_for(MC1241A_MOTION_COMPLETE));
    expect_at("axis 1", 2 * TURN);
    CHECK(mc1241a_command(MC1241A_CLR_STATUS));
    CHECK(mc1241a_command(MC1241A_SET_PRFL_TRAP));
}

static void together(void)
{
    printf("both axes, started by one MULTI_UPDATE\n");
    load(0, VELOCITY, ACCELERATION);
    word(MC1241A_SET_2);
    load(-TURN, VELOCITY, ACCELERATION);
    CHECK(mc1241a_write_word(MC1241A_MULTI_UPDATE, 0x0003));
    printf("  axis 2: status %04X\n", wait_for(MC1241A_MOTION_COMPLETE));
    expect_at("axis 2", -TURN);
    CHECK(mc1241a_command(MC1241A_CLR_STATUS));
    word(MC1241A_SET_1);
    printf("  axis 1: status %04X\n", wait_for(MC1241A_MOTION_COMPLETE));
    expect_at("axis 1", 0);
    CHECK(mc1241a_command(MC1241A_CLR_STATUS));
}

/* "Host Interrupts": an axis that is not the current one runs into its positive limit switch so
 * fast that the sudden stop throws the motor out of step: a limit switch trip and a motion error.
 * The manual's card has no interrupt line: we look at GET_INTRPT instead. */
static void interrupt_service(void)
{
    uint16_t status;

    printf("axis 2 runs into its limit switch\n");
    word(MC1241A_SET_2);
    CHECK(mc1241a_write_word(MC1241A_SET_POS_ERR, ERROR_LIMIT));
    CHECK(mc1241a_write_word(
        MC1241A_SET_INTRPT_MASK, MC1241A_MOTION_ERROR | MC1241A_POSITIVE_LIMIT));
    load(10 * TURN, FAST, ACCELERATION);
    CHECK(mc1241a_command(MC1241A_UPDATE));
    word(MC1241A_SET_1);

    CHECK(mc1241a_wait(MC1241A_GET_INTRPT, MC1241A_MOTION_ERROR | MC1241A_POSITIVE_LIMIT, 5, 2000,
                       &status));
    mc1241a_pause_ms(20); /* until the machine is still */
    status = word(MC1241A_SET_I);
    printf("  interrupt of axis %d, status %04X\n", MC1241A_AXIS(status), status);
    if (status & MC1241A_MOTION_ERROR) {
        CHECK(mc1241a_command(MC1241A_MTR_ON)); /* the recovery: the position error is 0 again */
        CHECK(mc1241a_write_word(MC1241A_RST_INTRPT, 0x00EF));
    }
    status = word(MC1241A_SET_I); /* interrupts again for the limit switch */
    printf("  interrupt of axis %d, status %04X\n", MC1241A_AXIS(status), status);
    load(-TURN, VELOCITY, ACCELERATION); /* away from the switch */
    CHECK(mc1241a_write_word(MC1241A_RST_INTRPT, 0x00DF));
    CHECK(mc1241a_command(MC1241A_CLR_STATUS));
    CHECK(mc1241a_command(MC1241A_UPDATE));
    printf("  status %04X\n", wait_for(MC1241A_MOTION_COMPLETE));
    CHECK(mc1241a_command(MC1241A_CLR_STATUS));
    printf("  target %ld, status %04X\n", (long)number(MC1241A_GET_TRGT_POS),
           word(MC1241A_GET_STATUS));
}

int main(void)
{
    CHECK(mc1241a_reset());
    printf("version %04X\n", word(MC1241A_GET_VRSN));
    set_up(MC1241A_SET_2);
    set_up(MC1241A_SET_1);
    CHECK(mc1241a_write_word(MC1241A_MULTI_UPDATE, 0x0003));
    mc1241a_pause_ms(50);

    home();
    s_curve();
    together();
    interrupt_service();
    printf("%ld cycles\n", (long)number(MC1241A_GET_TIME));
    return 0;
}
