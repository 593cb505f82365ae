/* An LM629 at 340h, maybe another at 342h, on a card that may have a flip-flop for its interrupt.
 * After each step it enables the interrupt and tells whether one comes.
 */
#include <fcntl.h>
#include <poll.h>
#include <stdint.h>
#include <stdio.h>
#include <string.h>
#include <sys/io.h>
#include <unistd.h>

#include "served.h"

static int file;

static void enable_and_look(const char *when)
{
    struct pollfd set = {file, POLLIN, 0};
    uint32_t number = 1;
    int come;

    if (write(file, &number, 4) != 4)
        return;
    come = poll(&set, 1, 20);
    if (come == 1 && read(file, &number, 4) != 4)
        return;
    printf("%s: %s\n", when, come == 1 ? "interrupt" : "none");
}

int main(int count, char **arguments)
{
    const char *how = count > 1 ? arguments[1] : "";
    uint32_t number;

    if (ioperm(0x340, 5, 1) != 0)
        return 1;
    while (inb(0x340) != 0x84 || (*how != 's' && inb(0x342) != 0x84))
        ;
    file = open("/dev/uio0", O_RDWR);
    if (read(file, &number, 4) != 4)
        return 1;
    if (strcmp(how, "shared") == 0) {
        clear(0x340);
        enable_and_look("own chip served");
        return 0;
    }
    for (number = 0; number < 2; number++) {
        if (strcmp(how, "read") == 0)
            printf("%02x ", inb(0x344));
        else
            outb(0, 0x344);
        enable_and_look("acknowledged");
        if (number == 0) {
            clear(0x340);
            clear(0x342);
            enable_and_look("cleared");
        }
    }
    outb(0, 0x342); /* RESET */
    while ((inb(0x342) & 0xBF) != 0x84)
        ;
    enable_and_look("reset");
    enable_and_look("enabled again");
    return 0;
}
