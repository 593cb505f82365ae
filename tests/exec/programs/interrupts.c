/* A driver that waits for the LM629's interrupt: by reading /dev/uio0, by polling it, or by a signal.
 * Prints the status bytes it finds. Or it counts the signals of resets, which interrupt as well.
 */
#define _GNU_SOURCE
#include <errno.h>
#include <fcntl.h>
#include <poll.h>
#include <signal.h>
#include <stdint.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/select.h>
#include <time.h>
#include <unistd.h>

#include "lm629.h"

static volatile sig_atomic_t signals;

static void on_signal(int number)
{
    (void)number;
    signals++;
}

static void reset_and_count(void)
{
    int turn;

    while (inb(BASE) != 0x84)
        ;
    for (turn = 0; turn < 20; turn++) {
        command(0x1D, 2, nothing);
        signals = 0;
        outb(0, BASE); /* RESET */
        while ((inb(BASE) & 0xBF) != 0x84)
            ;
        printf("%d", (int)signals);
    }
    printf(" signals of 20 resets\n");
}

static void prepare(void)
{
    while (inb(BASE) != 0x84)
        ;
    load_move(20, 1024);
}

int main(int count, char **arguments)
{
    const char *how = count > 1 ? arguments[1] : "";
    int fd = -1;
    uint32_t number = 1;
    sigset_t only, before;

    if (ioperm(BASE, 2, 1) != 0)
        return 1;
    if (strcmp(how, "signal") == 0 || strcmp(how, "sleep") == 0)
        signal(SIGIO, on_signal);
    if (strcmp(how, "early") == 0)
        fd = open("/dev/uio0", O_RDWR);
    if (strcmp(how, "count") == 0) {
        signal(SIGIO, on_signal);
        reset_and_count();
        return 0;
    }
    prepare();
    if (strcmp(how, "early") == 0 && read(fd, &number, 4) != 4)
        return 1; /* that of the reset */
    sigemptyset(&only);
    if (strcmp(how, "signal") == 0)
        sigaddset(&only, SIGIO);
    sigprocmask(SIG_BLOCK, &only, &before);
    signals = 0; /* the reset has interrupted too */
    command(0x01, 0, NULL);
    if (strcmp(how, "uio") == 0 || strcmp(how, "poll") == 0 || strcmp(how, "select") == 0)
        fd = open("/dev/uio0", O_RDWR);
    printf("moving %02x\n", inb(BASE));
    if (strcmp(how, "poll") == 0) {
        struct pollfd in;

        in.fd = fd;
        in.events = POLLIN;
        printf("poll %d\n", poll(&in, 1, 10));
        printf("poll %d\n", poll(&in, 1, 60000));
    }
    if (strcmp(how, "select") == 0) {
        fd_set in;

        FD_ZERO(&in);
        FD_SET(fd, &in);
        printf("select %d\n", select(fd + 1, &in, NULL, NULL, NULL));
    }
    if (fd >= 0) {
        if (read(fd, &number, 4) != 4)
            return 1;
        printf("interrupt %u\n", (unsigned)number);
    } else if (strcmp(how, "signal") == 0) {
        while (!signals)
            sigsuspend(&before);
    } else {
        struct timespec wanted = {100, 0}, left = {0, 0};
        int result = nanosleep(&wanted, &left);

        printf("nanosleep %d, %d, more than 90 s left: %d\n", result, errno == EINTR,
               left.tv_sec >= 90);
    }
    printf("done %02x, signals %d\n", inb(BASE), (int)signals);
    if (fd >= 0) { /* it still stands: it comes again when it is enabled again */
        if (write(fd, &number, 4) != 4 || read(fd, &number, 4) != 4)
            return 1;
        printf("again %u\n", (unsigned)number);
    }
    return 0;
}
