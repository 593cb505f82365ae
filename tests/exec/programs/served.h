/* An LM629 at a base whose interrupt a program serves. */
#include <sys/io.h>

static void ready(unsigned short base)
{
    while (inb(base) & 1)
        ;
}

/* RSTI: the chip's line goes down. */
static void clear(unsigned short base)
{
    ready(base);
    outb(0x1D, base);
    ready(base);
    outb(0, base + 1);
    outb(0, base + 1);
    ready(base);
}
