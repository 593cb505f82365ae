/* An LM629 driver on I/O ports: reset, filter, move; prints how often each wait has polled. */
#include <stdio.h>
#include <sys/io.h>
#include <unistd.h>

#define BASE 0x340

static int sleeps;

static void wait_for(int mask, int value)
{
    int count = 1;

    for (; (inb(BASE) & mask) != value; count++)
        if (sleeps)
            usleep(5);
    printf("%d\n", count);
}

static void command(unsigned code, unsigned count, const unsigned char *data)
{
    unsigned turn;

    outb((unsigned char)code, BASE);
    wait_for(1, 0);
    for (turn = 0; turn + 1 < count; turn += 2) {
        outb(data[turn], BASE + 1);
        outb(data[turn + 1], BASE + 1);
        wait_for(1, 0);
    }
}

int main(int count, char **arguments)
{
    static const unsigned char filter[] = {0, 15, 0, 50, 0, 10, 0, 50, 0, 100};
    static const unsigned char move[] = {0, 42, 0, 0, 0, 20, 0, 2, 0, 0, 0, 0, 4, 0};

    (void)arguments;
    sleeps = count > 1;
    if (ioperm(BASE, 2, 1) != 0)
        return 1;
    wait_for(0xFF, 0x84);
    command(0x1E, sizeof filter, filter);
    command(0x04, 0, NULL);
    command(0x1F, sizeof move, move);
    command(0x01, 0, NULL);
    wait_for(4, 4);
    return 0;
}
