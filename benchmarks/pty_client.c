/* Status reads over a link: pty_client PLACE MESSAGES READS_PER_MESSAGE
 * PLACE is a terminal's path, or unix:PATH, or tcp:PORT of this computer.
 * Prints median, mean and 99th percentile of one message's round trip, in ns. */
#define _GNU_SOURCE
#include <fcntl.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <unistd.h>

#include "sockets.h"
#include "times.h"

static int connected(const char *place)
{
    struct sockaddr_storage address;
    socklen_t length;
    int fd = socket_at(place, &address, &length);
    return connect(fd, (struct sockaddr *)&address, length) ? -1 : prompt(fd);
}

int main(int argc, char **argv)
{
    if (argc != 4)
        return 2;
    int fd = is_socket(argv[1]) ? connected(argv[1]) : open(argv[1], O_RDWR | O_NOCTTY);
    long count = atol(argv[2]), reads = atol(argv[3]);
    if (fd < 0 || count < 1 || reads < 1 || reads > 1000)
        return 2;
    unsigned char request[1000], reply[2000];
    memset(request, 0x10, sizeof request); /* READ of address 0: the status byte */
    long long *times = malloc(sizeof *times * (size_t)count), sum = 0;
    for (long i = -count / 10; i < count; i++) {
        long long start = now();
        if (write(fd, request, (size_t)reads) != reads)
            return 1;
        for (long got = 0; got < 2 * reads;) {
            ssize_t n = read(fd, reply + got, (size_t)(2 * reads - got));
            if (n <= 0)
                return 1;
            got += n;
        }
        if (reply[0] != 'D')
            return 1;
        if (i >= 0)
            sum += times[i] = now() - start;
    }
    qsort(times, (size_t)count, sizeof *times, order);
    printf("%lld %lld %lld\n", times[count / 2], sum / count, times[count * 99 / 100]);
    return 0;
}
