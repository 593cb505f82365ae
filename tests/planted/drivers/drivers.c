/* drivers.c - drivers for an LM629, an MCP-1200 and an MC1241A with the C client, each with mistakes.
 *
 *     drivers lm629|mcp1200|mc1241a MISTAKE     0: the right driver
 *
 * PLANT(N, RIGHT, WRONG) is where mistake N stands. The program makes two moves, and ends with 1 if
 * an axis is not where it should be, or does not answer.
 */
#include "vbus.h"

#include <stdint.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#define MS 1000000000ull /* picoseconds */
#define PLANT(n, right, wrong) (mistake == (n) ? (wrong) : (right))
#define SKIP(n) if (mistake != (n))

static struct vbus bus;
static int mistake;

static void fail(const char *why)
{
    fprintf(stderr, "%s\n", why);
    exit(1);
}

static unsigned get(unsigned address)
{
    int data = vbus_read(&bus, address);

    if (data < 0)
        fail(vbus_strerror(data));
    return (unsigned)data;
}

static void put(unsigned address, unsigned data)
{
    int error = vbus_write(&bus, address, data & 0xFF);

    if (error < 0)
        fail(vbus_strerror(error));
}

static void rest(unsigned ms)
{
    vbus_delay(&bus, ms * MS);
}

static void expect(long found, long wanted, long near)
{
    printf("at %ld\n", found);
    if (labs(found - wanted) > near)
        fail("the axis is elsewhere");
}

/* --- LM629 ------------------------------------------------------------------------------------ */

static void lm_ready(void)
{
    int polls;

    for (polls = 0; polls < 100; polls++)
        if (!(get(0) & PLANT(1, 0x01, 0x02)))
            return;
    fail("busy");
}

static void lm_command(unsigned code)
{
    SKIP(2) lm_ready();
    put(0, code);
}

static void lm_word(unsigned word)
{
    SKIP(3) lm_ready();
    put(1, PLANT(4, word >> 8, word));
    put(1, PLANT(4, word, word >> 8));
}

static void lm_long(int32_t value)
{
    lm_word(PLANT(5, (uint32_t)value >> 16, (uint32_t)value) & 0xFFFF);
    lm_word(PLANT(5, (uint32_t)value, (uint32_t)value >> 16) & 0xFFFF);
}

static unsigned lm_get_word(void)
{
    unsigned high;

    SKIP(6) lm_ready();
    high = get(1);
    return high << 8 | get(1);
}

static long lm_position(void)
{
    uint32_t high, low;

    lm_command(PLANT(7, 0x0A, 0x08));
    high = lm_get_word();
    low = lm_get_word();
    return PLANT(8, (long)(int32_t)(high << 16 | low), (long)(high << 16 | low));
}

static void lm_move(int32_t velocity, int32_t position)
{
    int ms;

    SKIP(9) {
        lm_command(0x1D);
        lm_word(PLANT(10, 0xFFFB, 0x0004));
    }
    lm_command(0x1F);
    lm_word(PLANT(11, 0x002A, 0x002B));
    lm_long(400);
    lm_long(PLANT(12, velocity, velocity & 0xFFFF));
    lm_long(PLANT(13, position, (uint16_t)position));
    SKIP(14) lm_command(0x01);
    for (ms = 0; !(get(0) & 0x04); ms++) {
        if (ms == 3000)
            fail("the move takes too long");
        rest(1);
    }
    SKIP(15) rest(100);
}

static void lm629(void)
{
    SKIP(16) rest(3);
    lm_command(0x1E);
    lm_word(0x000A);
    lm_word(PLANT(17, 300, 0));
    SKIP(18) lm_word(2000);
    SKIP(19) lm_command(0x04);
    lm_move(4 << 16, 3000);
    expect(lm_position(), 3000, 6);
    lm_move(4 << 16, -3000);
    expect(lm_position(), -3000, 6);
}

/* --- MCP-1200 --------------------------------------------------------------------------------- */

static void mcp_flags(unsigned bits, unsigned level)
{
    int ms;

    for (ms = 0; (get(0x00) & bits) != level; ms++) {
        if (ms == 3000)
            fail("the flags do not come");
        rest(1);
    }
}

static long mcp_position(void)
{
    uint32_t low = PLANT(1, get(0x14), 0), high = get(0x12), middle = get(0x13);
    uint32_t value = high << 16 | middle << 8 | PLANT(1, low, get(0x14));

    return (long)(value & 0x7FFFFF) - (long)(value & PLANT(2, 0x800000, 0));
}

static void mcp_move(int32_t position)
{
    put(0x26, PLANT(3, 0x18, 0));
    put(0x27, 0);
    put(0x28, PLANT(4, 10, 250));
    put(PLANT(5, 0x29, 0x2B), (uint32_t)position);
    put(0x2A, (uint32_t)position >> 8);
    put(PLANT(5, 0x2B, 0x29), (uint32_t)position >> 16);
    put(0x00, PLANT(6, 0x08, 0x00));
    SKIP(7) mcp_flags(PLANT(8, 0x04, 0x02), 0);
    rest(60);
}

static void mcp1200(void)
{
    put(0x05, 0);
    SKIP(9) {
        rest(1);
        mcp_flags(0x02, 0x02);
    }
    SKIP(10) put(0x02, 0x01);
    put(0x01, PLANT(11, 0x08, 0x48));
    put(0x61, PLANT(12, 64, 0));
    put(0x63, 64);
    if (mistake == 13)
        put(0x4B, 0x80);
    put(0x05, PLANT(14, 3, 2));
    SKIP(15) {
        mcp_flags(0x02, 0);
        rest(5);
    }
    mcp_move(9000);
    expect(mcp_position(), 9000, 3);
    mcp_move(-4000);
    expect(mcp_position(), -4000, 3);
    put(0x05, 1);
}

/* --- MC1241A ---------------------------------------------------------------------------------- */

static unsigned sum;

static void mc_ready(void)
{
    int polls;

    for (polls = 0; polls < 5000; polls++)
        if (get(1) & 0x80)
            return;
    fail("HostRdy does not come");
}

static void mc_command(unsigned code)
{
    SKIP(1) mc_ready();
    put(1, code);
    sum = code;
}

static void mc_word(unsigned word)
{
    SKIP(2) mc_ready();
    put(0, word >> 8);
    put(0, word);
    sum += word & 0xFFFF;
}

static unsigned mc_get(void)
{
    unsigned high;

    mc_ready();
    high = get(0);
    return high << 8 | get(0);
}

static void mc_end(void)
{
    SKIP(3)
    if (mc_get() != (sum & 0xFFFF))
        fail("the checksum is wrong");
}

static void mc_set(unsigned code, unsigned word)
{
    mc_command(code);
    mc_word(word);
    mc_end();
}

static void mc_long(unsigned code, int32_t value)
{
    mc_command(code);
    mc_word(PLANT(4, (uint32_t)value >> 16, (uint32_t)value));
    mc_word(PLANT(4, (uint32_t)value, (uint32_t)value >> 16));
    mc_end();
}

static void mc_do(unsigned code)
{
    mc_command(code);
    mc_end();
}

static unsigned mc_status(void)
{
    unsigned word;

    mc_command(0x31);
    word = mc_get();
    sum += word;
    mc_end();
    return word;
}

static long mc_position(unsigned code)
{
    uint32_t high, low;

    mc_command(code);
    high = mc_get();
    low = mc_get();
    sum += high + low;
    mc_end();
    return (long)(int32_t)PLANT(5, high << 16 | low, low << 16 | high);
}

static void mc_move(int32_t position)
{
    int polls;

    SKIP(6) mc_set(0x34, PLANT(7, 0xFFFE, 0x0001));
    mc_long(0x10, position);
    mc_long(0x11, PLANT(8, 15 << 16, 15));
    mc_long(0x12, PLANT(9, 0x1000, 0));
    SKIP(10) mc_do(0x1A);
    for (polls = 0; !(mc_status() & 0x01); polls++) {
        if (polls == 200)
            fail("the move takes too long");
        rest(10);
    }
    SKIP(15) rest(20);
}

static void mc1241a(void)
{
    unsigned word;

    mc_command(PLANT(11, 0x01, 0x02));
    word = mc_get();
    sum += word;
    mc_end();
    SKIP(12) mc_set(0x77, PLANT(13, 24000, 24000 >> 8));
    SKIP(16) mc_do(0x1A);
    mc_set(0x68, PLANT(14, 40, 0));
    mc_move(5000);
    expect(mc_position(0x1D), 5000, 0);
    expect(mc_position(0x37), 781, 3);
    mc_move(-2000);
    expect(mc_position(0x37), -312, 3);
}

int main(int count, char **arguments)
{
    const char *chip = count > 1 ? arguments[1] : "", *link = getenv("VBUS_LINK");

    if (link == NULL || vbus_open(&bus, link) < 0)
        fail("there is no board");
    bus.timeout_ms = -1; /* chip time decides that it hangs, not how busy the machine is */
    mistake = count > 2 ? atoi(arguments[2]) : 0;
    if (strcmp(chip, "lm629") == 0)
        lm629();
    else if (strcmp(chip, "mcp1200") == 0)
        mcp1200();
    else
        mc1241a();
    vbus_close(&bus);
    return 0;
}
