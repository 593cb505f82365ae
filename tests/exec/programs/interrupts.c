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
#include <sys/io.h>
#include <sys/select.h>
#include <time.h>
#include <unistd.h>

#define BASE 0x340

static volatile sig_atomic_t signals;

static void on_signal(int number)
{
    (void)number;
    signals++;
}

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

static void reset_and_count(void)
{
    static const unsigned char nothing[] = {0, 0};
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

static void start_move(void)
{
    static const unsigned char filter[] = {0, 15, 0, 50, 0, 10, 0, 50, 0, 100};
    static const unsigned char move[] = {0, 42, 0, 0, 0, 20, 0, 2, 0, 0, 0, 0, 4, 0};
    static const unsigned char complete[] = {0, 4}, nothing[] = {0, 0};

    while (inb(BASE) != 0x84)
        ;
    command(0x1D, 2, nothing);  /* RSTI: clear what is pending */
    command(0x1C, 2, complete); /* MSKI: trajectory complete interrupts */
    command(0x1E, sizeof filter, filter);
    command(0x04, 0, NULL);
    command(0x1F, sizeof move, move);
    command(0x01, 0, NULL);
}

int main(int count, char **arguments)
{
    const char *how = count > 1 ? arguments[1] : "";
    int fd = -1;
    uint32_t number = 1;

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
    start_move();
    signals = 0; /* the reset has interrupted too */
    if (strcmp(how, "uio") == 0 || strcmp(how, "poll") == 0 || strcmp(how, "select") == 0)
        fd = open("/dev/uio0", O_RDWR);
    printf("moving %02x\n", inb(BASE));
    if (strcmp(how, "poll") == 0) {
        struct pollfd in;

        in.fd = fd;
        in.events = POLLIN;
        printf("poll %d\n", poll(&in, 1, 10));
        printf("poll %d\n", poll(&in, 1, 10000));
    }
    if (strcmp(how, "select") == 0) {
        fd_set in;

        FD_ZERO(&in);
        FD_SET(fd, &in);
        printf("select %d\n", select(fd + 1, &in, NULL, NULL, NULL));
    }
    if (strcmp(how, "early") == 0 && read(fd, &number, 4) != 4)
        return 1; /* that of the reset */
    if (fd >= 0) {
        if (read(fd, &number, 4) != 4)
            return 1;
        printf("interrupt %u\n", (unsigned)number);
    } else if (strcmp(how, "signal") == 0) {
        while (!signals)
            pause();
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
