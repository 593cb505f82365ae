/* Two LM629 at 340h and 342h whose HI are one interrupt: it stands as long as one of them does. */
#include <fcntl.h>
#include <poll.h>
#include <stdint.h>
#include <stdio.h>
#include <sys/io.h>
#include <unistd.h>

#include "served.h"

static int file;

static void enable(void)
{
    uint32_t on = 1;

    if (write(file, &on, 4) != 4)
        printf("not enabled\n");
}

static void look(const char *when, int ms)
{
    struct pollfd set = {file, POLLIN, 0};
    uint32_t number = 0;

    if (poll(&set, 1, ms) == 1 && read(file, &number, 4) != 4)
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
    enable();
    look("one served", 60000);
    clear(0x342);
    enable();
    look("both served", 1000);
    outb(0, 0x342); /* RESET of the second; the interrupt is still enabled */
    look("one reset again", 60000);
    return 0;
}
