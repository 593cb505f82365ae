/* Waits for ever, in one of several ways, and makes no bus cycle meanwhile. */
#include <fcntl.h>
#include <poll.h>
#include <stdint.h>
#include <stdio.h>
#include <string.h>
#include <sys/io.h>
#include <time.h>
#include <unistd.h>

#include "served.h"

int main(int argc, char **argv)
{
    const char *how = argc > 1 ? argv[1] : "";
    struct timespec now;
    uint32_t number;
    int file;

    if (ioperm(0x340, 2, 1) != 0)
        return 1;
    while (inb(0x340) != 0x84)
        ;
    clear(0x340);
    printf("begun\n");
    fflush(stdout);
    while (strcmp(how, "sleeps") == 0)
        sleep(1);
    while (strcmp(how, "polls nothing") == 0)
        poll(NULL, 0, 100);
    while (strcmp(how, "looks at the clock") == 0)
        clock_gettime(CLOCK_MONOTONIC, &now);
    file = open("/dev/uio0", O_RDWR);
    while (read(file, &number, 4) == 4) /* the one that stood after the reset, and no other */
        ;
    return 2;
}
