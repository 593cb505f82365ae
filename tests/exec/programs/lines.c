/* Two LM629 at 340h and 342h whose HI are one interrupt: it stands as long as one of them does. */
#include <fcntl.h>
#include <poll.h>
#include <stdint.h>
#include <stdio.h>
#include <sys/io.h>
#include <unistd.h>

static int file;

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

static void enable_and_look(const char *when)
{
    struct pollfd set = {file, POLLIN, 0};
    uint32_t number = 1;

    if (write(file, &number, 4) != 4)
        return;
    number = 0;
    if (poll(&set, 1, 1000) == 1 && read(file, &number, 4) != 4)
        return;
    printf("%s: interrupt %u\n", when, (unsigned)number);
}

int main(void)
{
    uint32_t number;

    if (ioperm(0x340, 4, 1) != 0)
        return 1;
    while (inb(0x340) != 0x84 || inb(0x342) != 0x84)
        ;
    file = open("/dev/uio0", O_RDWR);
    if (read(file, &number, 4) != 4)
        return 1;
    printf("after reset: interrupt %u\n", (unsigned)number);
    clear(0x340);
    enable_and_look("one served");
    clear(0x342);
    enable_and_look("both served");
    outb(0, 0x342); /* RESET of the second */
    enable_and_look("one reset again");
    return 0;
}
