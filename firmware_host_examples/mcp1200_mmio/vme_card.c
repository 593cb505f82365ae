/* vme_card.c - an axis on a card with an MCP-1200, a reset latch and a status port; see
 * vme_card.toml. A 24-bit position is three bytes, the most significant one first, so a big-endian
 * computer reads it, and the byte before it, as one word.
 */
#include "mcp1200_driver.h"

#include <fcntl.h>
#include <stdio.h>
#include <stdlib.h>
#include <sys/mman.h>
#include <time.h>
#include <unistd.h>

#define PHYSICAL 0x20005000
#define CONTROL 0xC0
#define FLAGS 0xC1
#define RUN 0x01    /* of CONTROL */
#define ENABLE 0x02
#define PROF 0x01   /* of FLAGS */

static volatile uint8_t *card;

uint8_t mcp1200_bus_read(uint8_t reg)
{
    return card[reg];
}

void mcp1200_bus_write(uint8_t reg, uint8_t data)
{
    card[reg] = data;
}

void mcp1200_pause_us(unsigned microseconds)
{
    struct timespec pause = {0, (long)microseconds * 1000};

    nanosleep(&pause, NULL);
}

static void check(int result, const char *what)
{
    if (result != MCP1200_OK) {
        printf("%s: failed (%d)\n", what, result);
        exit(1);
    }
}

int main(void)
{
    static const struct mcp1200_pid pid = {30, 120, 80};
    static const struct mcp1200_move move = {2500, 40, 0x0080, 0};
    int memory = open("/dev/mem", O_RDWR | O_SYNC);
    uint8_t status;
    unsigned waited = 0;
    int32_t position;

    card = mmap(NULL, 4096, PROT_READ | PROT_WRITE, MAP_SHARED, memory, PHYSICAL);
    if (memory < 0 || card == MAP_FAILED) {
        perror("/dev/mem");
        return 1;
    }
    mcp1200_pause_us(1000);
    printf("latch %02Xh\n", card[CONTROL]);
    card[CONTROL] = RUN;
    check(mcp1200_check_reset(&status), "reset");
    printf("status %02Xh, latch %02Xh\n", status, card[CONTROL]);
    check(mcp1200_start(&pid), "control mode");
    check(mcp1200_begin(&move), "profile");
    while (!(card[FLAGS] & PROF))
        mcp1200_pause_us(50);
    while (card[FLAGS] & PROF) {
        mcp1200_pause_us(500);
        waited++;
    }
    mcp1200_pause_us(200000);
    position = mcp1200_position();
    if (waited <= 100 || labs((long)position - move.final) >= 4) {
        printf("at %ld after %u looks: not there\n", (long)position, waited);
        return 1;
    }
    printf("moved, position reached\n");
    card[CONTROL] = 0;
    mcp1200_pause_us(1000);
    card[CONTROL] = RUN | ENABLE;
    check(mcp1200_check_reset(&status), "second reset");
    position = mcp1200_position();
    printf("position %ld after the reset\n", (long)position);
    return position != 0;
}
