/* The bare limit: a PTY whose master answers each byte with two, and nothing else.
 * Prints the terminal's name, then serves until killed. */
#define _GNU_SOURCE
#include <fcntl.h>
#include <stdio.h>
#include <stdlib.h>
#include <termios.h>
#include <unistd.h>

int main(void)
{
    int master = posix_openpt(O_RDWR | O_NOCTTY);
    if (master < 0 || grantpt(master) || unlockpt(master))
        return 1;
    const char *name = ptsname(master);
    int slave = open(name, O_RDWR | O_NOCTTY);
    struct termios raw;
    tcgetattr(slave, &raw);
    cfmakeraw(&raw);
    tcsetattr(slave, TCSANOW, &raw);
    puts(name);
    fflush(stdout);
    static unsigned char in[4096], out[8192];
    for (;;) {
        ssize_t n = read(master, in, sizeof in);
        if (n <= 0)
            return 1;
        for (ssize_t i = 0; i < n; i++) {
            out[2 * i] = 'D';
            out[2 * i + 1] = 0x84;
        }
        for (ssize_t done = 0; done < 2 * n;) {
            ssize_t w = write(master, out + done, (size_t)(2 * n - done));
            if (w < 0)
                return 1;
            done += w;
        }
    }
}
