/* An LM629 moves so many counts, and its interrupt is waited for: awaits COUNTS */
#include <fcntl.h>
#include <stdint.h>
#include <stdio.h>
#include <stdlib.h>
#include <time.h>
#include <unistd.h>

#include "lm629.h"

static double seconds(void)
{
    struct timespec now;

    clock_gettime(CLOCK_MONOTONIC, &now);
    return (double)now.tv_sec + (double)now.tv_nsec / 1e9;
}

int main(int count, char **arguments)
{
    uint32_t number;
    double begun;
    int fd;

    if (count < 2 || ioperm(BASE, 2, 1) != 0)
        return 1;
    while (inb(BASE) != 0x84)
        ;
    load_move(20, (unsigned)atoi(arguments[1]));
    begun = seconds();
    command(0x01, 0, NULL);
    fd = open("/dev/uio0", O_RDWR);
    if (read(fd, &number, sizeof number) != sizeof number)
        return 1;
    printf("%.1f s\n", seconds() - begun);
    return 0;
}
