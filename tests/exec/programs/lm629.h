/* An LM629 at 340h, driven as its manual has it: Busy is waited for before each command and word. */
#include <stddef.h>
#include <sys/io.h>

#define BASE 0x340

static const unsigned char nothing[] = {0, 0};

static void ready(void)
{
    while (inb(BASE) & 1)
        ;
}

static void command(unsigned code, unsigned count, const unsigned char *data)
{
    unsigned turn;

    ready();
    outb((unsigned char)code, BASE);
    for (turn = 0; turn + 1 < count; turn += 2) {
        ready();
        outb(data[turn], BASE + 1);
        outb(data[turn + 1], BASE + 1);
    }
    ready();
}

/* A filter, and a move that interrupts when it is complete; STT starts it. */
static void load_move(unsigned char acceleration, unsigned position)
{
    static const unsigned char complete[] = {0, 4};
    static const unsigned char filter[] = {0, 15, 0, 50, 0, 10, 0, 50, 0, 100};
    unsigned char move[] = {0, 42, 0, 0, 0, acceleration, 0, 2, 0, 0, 0, 0,
                            (unsigned char)(position >> 8), (unsigned char)position};

    command(0x1D, 2, nothing);  /* RSTI: clear what is pending */
    command(0x1C, 2, complete); /* MSKI: trajectory complete interrupts */
    command(0x1E, sizeof filter, filter);
    command(0x04, 0, NULL); /* UDF */
    command(0x1F, sizeof move, move);
}
