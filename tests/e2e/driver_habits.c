/* What drivers of the real chips do, on port I/O: habits that are legal, careless or wrong.
 *
 *     driver_habits PART      prints what the chip made of it
 *
 * LM629 at 340H (commands, status) and 341H (data); MC1241A at 340H (data) and 341H (commands, and
 * HostRdy in D7).
 */
#define _GNU_SOURCE
#include <fcntl.h>
#include <stdint.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/io.h>
#include <sys/mman.h>
#include <time.h>
#include <unistd.h>

#define BASE 0x340

/* --- LM629 ------------------------------------------------------------------------------------ */

static unsigned polls_of_busy(unsigned limit)
{
    unsigned polls = 1;

    while ((inb(BASE) & 1) && polls++ < limit)
        ;
    return polls;
}

static void ready(void)
{
    while (inb(BASE) & 1)
        ;
}

static void command(unsigned code)
{
    ready();
    outb((unsigned char)code, BASE);
}

static void put_word(unsigned word)
{
    ready();
    outb((unsigned char)(word >> 8), BASE + 1);
    outb((unsigned char)word, BASE + 1);
}

static unsigned get_word(void)
{
    unsigned high;

    ready();
    high = inb(BASE + 1);
    return high << 8 | inb(BASE + 1);
}

static unsigned status(void)
{
    ready();
    return inb(BASE);
}

static unsigned long get_long(unsigned code)
{
    unsigned long high;

    command(code);
    high = get_word();
    return high << 16 | get_word();
}

static void clear(void)
{
    command(0x1D);
    put_word(0);
}

static void limit(void)
{
    unsigned turn, polls, most = 0;

    for (turn = 0; turn < 20; turn++) {
        outb(0x1D, BASE);
        polls = polls_of_busy(30);
        most = polls > most ? polls : most;
        outb(0xFF, BASE + 1);
        outb(0x00, BASE + 1);
        polls = polls_of_busy(30);
        most = polls > most ? polls : most;
    }
    printf("%s\n", most < 30 ? "within 30 polls" : "busy after 30 polls");
    printf("status %02X\n", status());
}

static void between(void)
{
    unsigned first, second, third;

    command(0x1D);
    first = polls_of_busy(1000);
    outb(0, BASE + 1);
    second = polls_of_busy(1000);
    outb(0, BASE + 1);
    third = polls_of_busy(1000);
    printf("polls %u %u %u, status %02X\n", first, second, third, status());
}

static volatile unsigned long spun;

static void spin(unsigned long turns)
{
    while (turns-- > 0)
        spun++;
}

/* BogoMIPS: the fastest of many measurements, as an interrupted one is too slow. */
static double turns_per_us(void)
{
    double best = 0;
    int turn;

    for (turn = 0; turn < 20; turn++) {
        struct timespec began, ended;
        double us;

        clock_gettime(CLOCK_MONOTONIC, &began);
        spin(20000);
        clock_gettime(CLOCK_MONOTONIC, &ended);
        us = (double)(ended.tv_sec - began.tv_sec) * 1e6 + (double)(ended.tv_nsec - began.tv_nsec) / 1e3;
        best = 20000 / us > best ? 20000 / us : best;
    }
    return best;
}

/* 60 us after each byte that makes it busy, and never a look at the status. */
static void delays(void)
{
    unsigned long pause = (unsigned long)(60 * turns_per_us());
    static const unsigned char filter[] = {0, 15, 0, 50, 0, 10, 0, 50, 0, 100};
    unsigned turn, high;

    outb(0x1E, BASE);
    spin(pause);
    for (turn = 0; turn < sizeof filter; turn += 2) {
        outb(filter[turn], BASE + 1);
        outb(filter[turn + 1], BASE + 1);
        spin(pause);
    }
    outb(0x04, BASE);
    spin(pause);
    outb(0x0C, BASE);
    spin(pause);
    high = inb(BASE + 1) & 0xDF; /* without "filter updated", which lasts a sample */
    printf("signals %02X%02X", high, inb(BASE + 1));
    spin(pause);
    printf(", status %02X\n", inb(BASE));
}

/* For ever, unless the chip comes up as the manual says. */
static void retry(void)
{
    unsigned tries = 0, before, after;

    do {
        outb(0x00, BASE);
        usleep(200);
        tries++;
        before = inb(BASE);
        if (before != 0x84 && before != 0xC4)
            continue;
        clear();
        after = status();
        if (after == 0x80 || after == 0xC0)
            break;
    } while (1);
    printf("%s, %02X, %02X\n", tries > 1 ? "after several tries" : "at once", before, after);
}

static void too_long(void)
{
    clear();
    command(0x1E);
    put_word(0x0002); /* kd alone follows */
    put_word(100);
    printf("complete %02X\n", status());
    put_word(200); /* one too many */
    printf("too long %02X\n", status());
    clear();
    printf("cleared %02X, desired position %08lX\n", status(), get_long(0x08));
    printf("read too far %04X\n", get_word());
    printf("status %02X\n", status());
    clear();
    printf("cleared %02X\n", status());
}

static void too_short(void)
{
    clear();
    command(0x1F);
    put_word(0x002A);
    put_word(0);
    ready();
    outb(0x12, BASE + 1); /* half a word, and then something else */
    printf("desired position %08lX, status %02X\n", get_long(0x08), status());
    command(0x20);
    put_word(0);
    printf("signals ");
    command(0x0C);
    printf("%04X, status %02X\n", get_word(), status());
}

static void unread(void)
{
    unsigned long whole;

    clear();
    command(0x0C); /* RDSIGS, and nobody reads it */
    command(0x0A); /* RDRP, one word of two */
    printf("high word %04X\n", get_word());
    whole = get_long(0x08);
    printf("desired position %08lX, status %02X\n", whole, status());
}

/* --- MC1241A ---------------------------------------------------------------------------------- */

static unsigned host_ready(void)
{
    unsigned polls = 1;

    while (!(inb(BASE + 1) & 0x80))
        if (polls++ == 1000)
            break;
    return polls;
}

static void pmd_command(unsigned code)
{
    host_ready();
    outb((unsigned char)code, BASE + 1);
}

static void pmd_put(unsigned word)
{
    host_ready();
    outb((unsigned char)(word >> 8), BASE);
    outb((unsigned char)word, BASE);
}

static unsigned pmd_get(void)
{
    unsigned high;

    host_ready();
    high = inb(BASE);
    return high << 8 | inb(BASE);
}

static void pmd_unread(void)
{
    pmd_command(0x37); /* GET_ACTL_POS: two words and a checksum, all left there */
    pmd_command(0x6C); /* GET_VRSN */
    printf("version %04X\n", pmd_get());
    pmd_command(0x10); /* SET_POS, its checksum never read */
    pmd_put(0x0001);
    pmd_put(0x2345);
    pmd_command(0x4A); /* GET_POS */
    printf("position %04X", pmd_get());
    printf("%04X", pmd_get());
    printf(", checksum %04X\n", pmd_get());
}

static void pmd_lengths(void)
{
    pmd_command(0x10);
    pmd_put(0x0001);
    pmd_put(0x0000);
    pmd_command(0x10); /* cut short: as if it had not been sent */
    pmd_put(0x7777);
    pmd_command(0x4A);
    printf("position %04X", pmd_get());
    printf("%04X\n", pmd_get());
    pmd_command(0x29); /* SET_POS_ERR with a word too many */
    pmd_put(0x0123);
    pmd_put(0x4567);
    printf("checksum %04X\n", pmd_get());
    pmd_command(0x6C);
    pmd_get();
    pmd_get();
    printf("read too far %04X\n", pmd_get());
    pmd_command(0x31); /* GET_STATUS */
    printf("status %04X\n", pmd_get());
}

static void pmd_ready(void)
{
    unsigned first, second;

    pmd_command(0x29);
    host_ready();
    outb(0x01, BASE);
    first = host_ready(); /* between the bytes of a word */
    outb(0x23, BASE);
    second = host_ready();
    printf("between %u, after %s\n", first, second > 1 && second < 1000 ? "some" : "none");
    pmd_command(0xEE); /* no command of any chip */
    pmd_put(0x1111);
    pmd_put(0x2222);
    printf("unknown: checksum %04X, ready %s\n", pmd_get(), host_ready() < 1000 ? "again" : "never");
    pmd_command(0x6C);
    printf("version %04X\n", pmd_get());
}

/* --- structures of big-endian computers ------------------------------------------------------- */

/* Registers of the MCP-1200 as a big-endian computer sees them: numbers lie MSB first. */
struct registers {
    uint8_t before[0x0C];
    uint16_t command_high; /* MSB and CSB */
    uint8_t command_low;   /* loads all three */
    uint8_t between[0x15 - 0x0F];
} __attribute__((packed));

static void big_endian(void)
{
    int memory = open("/dev/mem", O_RDWR);
    volatile struct registers *chip =
        mmap(NULL, 4096, PROT_READ | PROT_WRITE, MAP_SHARED, memory, 0x40000000);
    volatile uint16_t *high;
    void *address;

    if (chip == MAP_FAILED)
        exit(1);
    chip->command_high = 0x1234;
    chip->command_low = 0x56;
    printf("low %02X, ", chip->command_low); /* latches the others */
    printf("high %04X\n", chip->command_high);
    address = (void *)((uintptr_t)chip + 0x0C);
    high = address;
    printf("bytes %02X %02X\n", ((volatile uint8_t *)high)[0], ((volatile uint8_t *)high)[1]);
}

int main(int count, char **arguments)
{
    static const struct {
        const char *name;
        void (*run)(void);
    } parts[] = {
        {"limit", limit},     {"between", between},       {"delays", delays},
        {"retry", retry},     {"long", too_long},         {"short", too_short},
        {"unread", unread},   {"pmd-unread", pmd_unread}, {"pmd-lengths", pmd_lengths},
        {"pmd-ready", pmd_ready}, {"big-endian", big_endian},
    };
    unsigned turn;

    for (turn = 0; count > 1 && turn < sizeof parts / sizeof parts[0]; turn++)
        if (strcmp(arguments[1], parts[turn].name) == 0) {
            if (parts[turn].run != big_endian && ioperm(BASE, 2, 1) != 0)
                return 1;
            parts[turn].run();
            return 0;
        }
    return 64;
}
