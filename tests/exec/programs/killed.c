/* Waits for an interrupt and has no handler for its signal. */
#include <fcntl.h>
#include <sys/io.h>
#include <unistd.h>

int main(void)
{
    if (ioperm(0x340, 2, 1) != 0)
        return 1;
    fcntl(0, F_SETFL, O_ASYNC);
    while (inb(0x340) != 0x84)
        ;
    for (;;)
        inb(0x340);
}
