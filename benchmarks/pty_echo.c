/* The bare limit: a link that answers each byte with two, and nothing else; one host after another.
 * pty_echo [unix:PATH|tcp:PORT]: without either a PTY, whose terminal's name it prints. */
#define _GNU_SOURCE
#include <fcntl.h>
#include <stdio.h>
#include <stdlib.h>
#include <termios.h>
#include <unistd.h>

#include "sockets.h"

static int terminal(void)
{
    int master = posix_openpt(O_RDWR | O_NOCTTY);
    if (master < 0 || grantpt(master) || unlockpt(master))
        exit(1);
    const char *name = ptsname(master);
    int slave = open(name, O_RDWR | O_NOCTTY);
    struct termios raw;
    tcgetattr(slave, &raw);
    cfmakeraw(&raw);
    tcsetattr(slave, TCSANOW, &raw);
    puts(name);
    fflush(stdout);
    return master;
}

static int listening(const char *place)
{
    struct sockaddr_storage address;
    socklen_t length;
    int yes = 1, fd = socket_at(place, &address, &length);
    setsockopt(fd, SOL_SOCKET, SO_REUSEADDR, &yes, sizeof yes);
    if (bind(fd, (struct sockaddr *)&address, length) || listen(fd, 8))
        exit(1);
    puts(place);
    fflush(stdout);
    return fd;
}

/* Answer until the host goes. */
static void serve(int fd)
{
    static unsigned char in[4096], out[8192];
    for (;;) {
        ssize_t n = read(fd, in, sizeof in);
        if (n <= 0)
            return;
        for (ssize_t i = 0; i < n; i++) {
            out[2 * i] = 'D';
            out[2 * i + 1] = 0x84;
        }
        for (ssize_t done = 0; done < 2 * n;) {
            ssize_t w = write(fd, out + done, (size_t)(2 * n - done));
            if (w < 0)
                return;
            done += w;
        }
    }
}

int main(int argc, char **argv)
{
    if (argc < 2) {
        serve(terminal());
        return 1;
    }
    for (int door = listening(argv[1]);;) {
        int fd = prompt(accept(door, NULL, NULL));
        serve(fd);
        close(fd);
    }
}
