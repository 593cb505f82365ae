/* main.c - an axis on a memory-mapped MCP-1200.
 *
 *     axis [BASE]           physical address of the chip, hexadecimal; 50008000 if none is given
 *
 * This file is the computer: the chip's 128 registers stand in the lowest byte of as many 32-bit
 * words. The driver is that of ../mcp1200_c.
 */
#include "mcp1200_driver.h"

#include <fcntl.h>
#include <stdio.h>
#include <stdlib.h>
#include <sys/mman.h>
#include <time.h>
#include <unistd.h>

#define PHYSICAL 0x50008000
#define TOLERANCE 3 /* counts: the motor has friction */

struct registers {
    struct {
        volatile uint8_t data;
        uint8_t nothing[3];
    } r[128];
};

static struct registers *chip;

#define REG(number) (chip->r[number].data)

#define R05_MODE 0x05
#define SOFT_RESET 0

/* --- what the driver needs -------------------------------------------------------------------- */

uint8_t mcp1200_bus_read(uint8_t reg)
{
    return REG(reg);
}

void mcp1200_bus_write(uint8_t reg, uint8_t data)
{
    REG(reg) = data;
}

void mcp1200_pause_us(unsigned microseconds)
{
    struct timespec pause;

    pause.tv_sec = microseconds / 1000000;
    pause.tv_nsec = (long)(microseconds % 1000000) * 1000;
    nanosleep(&pause, NULL);
}

/* --- the program ------------------------------------------------------------------------------ */

static void map_chip(off_t physical)
{
    int memory = open("/dev/mem", O_RDWR | O_SYNC);
    void *mapped;

    if (memory < 0) {
        perror("/dev/mem");
        exit(1);
    }
    mapped = mmap(NULL, sizeof *chip, PROT_READ | PROT_WRITE, MAP_SHARED, memory, physical);
    if (mapped == MAP_FAILED) {
        perror("mmap");
        exit(1);
    }
    close(memory);
    chip = mapped;
}

static void check(int result, const char *what)
{
    if (result != MCP1200_OK) {
        printf("%s: failed (%d), status %02Xh\n", what, result, mcp1200_status());
        exit(1);
    }
}

static void move_to(int32_t target)
{
    struct mcp1200_move move = { 0, 40, 0x0080, 0 }; /* 38 turns/s, reached in 42 ms */
    unsigned samples;
    long actual, command;

    move.final = target;
    check(mcp1200_begin(&move), "profile");
    for (samples = 0; mcp1200_flags() & MCP1200_F_PROFILE; samples++)
        mcp1200_pause_us(520);
    mcp1200_pause_us(200000);
    actual = (long)mcp1200_position();
    command = (long)mcp1200_command_position();
    printf("move to %ld: %u samples, command %ld", (long)target, samples, command);
    if (command != target || labs(actual - (long)target) > TOLERANCE) {
        printf(", at %ld: not there\n", actual);
        exit(1);
    }
    printf(", position reached\n");
}

int main(int count, char **arguments)
{
    static const struct mcp1200_pid pid = { 30, 120, 80 };
    uint8_t status;

    map_chip(count > 1 ? (off_t)strtoull(arguments[1], NULL, 16) : PHYSICAL);

    REG(R05_MODE) = SOFT_RESET;
    check(mcp1200_check_reset(&status), "reset");
    printf("reset: status %02Xh\n", status);
    check(mcp1200_start(&pid), "control mode");
    move_to(26000);
    move_to(-1234);
    move_to(0);
    printf("status %02Xh\n", mcp1200_status());
    return 0;
}
