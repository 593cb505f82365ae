/* Many terminals at once.
 *   fair_links serve N                      an echo with epoll: N terminals, two bytes for each one
 *   fair_links trips SECONDS TERMINAL...    status reads on all of them, one under way on each;
 *                                           prints trips per second, p50 and p99 (ns)
 *   fair_links steady SECONDS TERMINAL FLOODED...
 *                                           a read each millisecond on the first beside floods of
 *                                           16 reads under way on the others; prints p50 and p99 */
#define _GNU_SOURCE
#include <fcntl.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/epoll.h>
#include <termios.h>
#include <unistd.h>

#include "times.h"

enum { MOST = 1024, TIMES = 1 << 22, FLOOD = 16 };

static void add(int epoll, int fd, unsigned number)
{
    struct epoll_event event = {.events = EPOLLIN, .data.u32 = number};
    epoll_ctl(epoll, EPOLL_CTL_ADD, fd, &event);
}

static int serve(int count)
{
    static int masters[MOST];
    int epoll = epoll_create1(0);

    for (int i = 0; i < count; i++) {
        struct termios raw;
        int master = posix_openpt(O_RDWR | O_NOCTTY);
        grantpt(master);
        unlockpt(master);
        int slave = open(ptsname(master), O_RDWR | O_NOCTTY);
        tcgetattr(slave, &raw);
        cfmakeraw(&raw);
        tcsetattr(slave, TCSANOW, &raw); /* left open, so that the master never hangs up */
        masters[i] = master;
        add(epoll, master, (unsigned)i);
        printf("%s\n", ptsname(master));
    }
    fflush(stdout);
    for (;;) {
        struct epoll_event events[64];
        int ready = epoll_wait(epoll, events, 64, -1);
        for (int i = 0; i < ready; i++) {
            unsigned char in[4096], out[8192];
            int fd = masters[events[i].data.u32];
            ssize_t n = read(fd, in, sizeof in);
            if (n <= 0)
                return 1;
            for (ssize_t k = 0; k < n; k++) {
                out[2 * k] = 'D';
                out[2 * k + 1] = in[k];
            }
            if (write(fd, out, (size_t)(2 * n)) != 2 * n)
                return 1;
        }
    }
}

static long long times[TIMES];

static void print(long count, double seconds)
{
    qsort(times, (size_t)count, sizeof *times, order);
    printf("%.0f %lld %lld\n", (double)count / seconds, times[count / 2], times[count * 99 / 100]);
}

int main(int argc, char **argv)
{
    static int fds[MOST];
    static long long began[MOST];
    static int got[MOST];
    unsigned char request[FLOOD], reply[4096];

    if (argc == 3 && strcmp(argv[1], "serve") == 0)
        return serve(atoi(argv[2]));
    if (argc < 4 || argc > MOST)
        return 2;
    int steady = strcmp(argv[1], "steady") == 0, count = argc - 3;
    double seconds = atof(argv[2]);
    int epoll = epoll_create1(0);
    memset(request, 0x10, sizeof request); /* READ of address 0: the status byte */
    for (int i = 0; i < count; i++) {
        fds[i] = open(argv[3 + i], O_RDWR | O_NOCTTY | O_NONBLOCK);
        if (fds[i] < 0)
            return 2;
        add(epoll, fds[i], (unsigned)i);
    }
    long long start = now(), warm = start + (long long)(seconds * 1e8), next = start;
    long long end = warm + (long long)(seconds * 1e9);
    long done = 0;
    for (int i = steady; i < count; i++) {
        int n = steady ? FLOOD : 1;
        began[i] = now();
        if (write(fds[i], request, (size_t)n) != n)
            return 1;
    }
    for (;;) {
        struct epoll_event events[64];
        long long t = now();
        if (t >= end)
            break;
        if (steady && t >= next && !began[0]) {
            next = t + 1000000;
            began[0] = now();
            if (write(fds[0], request, 1) != 1)
                return 1;
        }
        struct timespec rest = {0, 200000};
        if (steady && next - t < 200000)
            rest.tv_nsec = next > t ? next - t : 0;
        int ready = epoll_pwait2(epoll, events, 64, &rest, NULL);
        for (int k = 0; k < ready; k++) {
            unsigned i = events[k].data.u32;
            int flood = steady && i;
            ssize_t n = read(fds[i], reply, sizeof reply);
            if (n <= 0)
                return 1;
            got[i] += (int)n;
            if (flood) {
                int again = got[i] / 2;
                got[i] -= 2 * again;
                for (; again > 0; again -= FLOOD)
                    if (write(fds[i], request, (size_t)(again < FLOOD ? again : FLOOD)) < 1)
                        return 1;
                continue;
            }
            if (got[i] < 2)
                continue;
            got[i] = 0;
            t = now();
            if (t >= warm && done < TIMES)
                times[done++] = t - began[i];
            began[i] = 0;
            if (steady)
                continue;
            began[i] = now();
            if (write(fds[i], request, 1) != 1)
                return 1;
        }
    }
    print(done, seconds);
    return 0;
}
