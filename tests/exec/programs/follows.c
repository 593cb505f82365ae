/* Waits for an LM629 in loops of many shapes, and prints what each has seen. In between come what ends
 * such a loop: a signal, a fault of the program's own. With ALONE, an instruction that is never
 * followed stands before each access, so that each faults. With MEMORY the card is no port.
 */
#define _GNU_SOURCE
#include <fcntl.h>
#include <setjmp.h>
#include <signal.h>
#include <stdio.h>
#include <string.h>
#include <sys/io.h>
#include <sys/mman.h>
#include <sys/time.h>
#include <time.h>

#define PAUSE 0x80

#ifdef MEMORY
static volatile unsigned char *window;

#define inb(port) ((port) == PAUSE ? 0xFF : window[(port) - BASE])
#define outb(byte, port) (window[(port) - BASE] = (byte))
#endif

#include "lm629.h"

#define COMPLETE 4

static volatile long polls;
static long alarms, at_alarm[8];
static sigjmp_buf away;

static unsigned char status(void)
{
#ifdef ALONE
    __asm__ volatile("lfence");
#endif
    return inb(BASE);
}

static long in_a_register(void)
{
    long count = 0;

    while (!(status() & COMPLETE))
        count++;
    return count;
}

static long in_memory(void)
{
    for (polls = 0; !(status() & COMPLETE); polls++)
        ;
    return polls;
}

static __attribute__((noinline)) int seen(unsigned char *what, int wanted)
{
    *what = status();
    return (*what & wanted) == wanted;
}

static long by_calls(void)
{
    unsigned char what = 0;
    long count = 0;

    do
        count++;
    while (!seen(&what, COMPLETE));
    return count;
}

/* Two kinds of access; a count that runs out first. */
static long of_two_ports(void)
{
    unsigned left, sum = 0;

    for (left = 5000; left > 0; left--) {
        unsigned char now = status();

        sum = sum * 3 + now;
        if (now & COMPLETE)
            break;
        if (now == 0x84)
            outb(0x1F, BASE);
        sum ^= inb(PAUSE);
    }
    return (long)(left ^ sum << 16);
}

static long with_clock(void)
{
    struct timespec now;
    long count = 0;

    do {
        clock_gettime(CLOCK_MONOTONIC, &now);
        count++;
    } while (!(status() & COMPLETE));
    return count + now.tv_nsec % 1000;
}

static void on_alarm(int number)
{
    (void)number;
    if (alarms < 8)
        at_alarm[alarms] = polls;
    alarms++;
}

static long with_alarms(void)
{
    struct itimerval every = {{0, 3333}, {0, 1234}}, never;
    long turn, sum = 0;

    memset(&never, 0, sizeof never);
    signal(SIGALRM, on_alarm);
    setitimer(ITIMER_REAL, &every, NULL);
    in_memory();
    setitimer(ITIMER_REAL, &never, NULL);
    for (turn = 0; turn < 8; turn++)
        sum = sum * 7 + at_alarm[turn];
    printf("%ld alarms, %ld, %ld, %ld\n", alarms, at_alarm[0], at_alarm[1], at_alarm[2]);
    return sum;
}

static void on_fault(int number, siginfo_t *info, void *context)
{
    (void)context;
    printf("signal %d at %lx after %ld\n", number, (unsigned long)info->si_addr, polls);
    siglongjmp(away, 1);
}

/* The thousandth poll is stored where there is no memory. */
static long beyond_memory(void)
{
    static unsigned char bytes[1000], *volatile next = bytes;
    struct sigaction action;

    memset(&action, 0, sizeof action);
    action.sa_sigaction = on_fault;
    action.sa_flags = SA_SIGINFO;
    sigaction(SIGSEGV, &action, NULL);
    if (sigsetjmp(away, 1) == 0)
        for (polls = 0;; polls++) {
            *next = status();
            next = polls == 999 ? (unsigned char *)0x10 : next + 1;
        }
    return polls;
}

int main(void)
{
    static const struct {
        const char *name;
        long (*wait)(void);
    } shapes[] = {
        {"register", in_a_register}, {"memory", in_memory}, {"calls", by_calls},
        {"two ports", of_two_ports}, {"clock", with_clock}, {"alarms", with_alarms},
        {"fault", beyond_memory},
    };
    unsigned turn;

#ifdef MEMORY
    window = mmap(NULL, 4096, PROT_READ | PROT_WRITE, MAP_SHARED, open("/dev/mem", O_RDWR),
                  0x40000000);
#else
    if (ioperm(BASE, 2, 1) != 0 || ioperm(PAUSE, 1, 1) != 0)
        return 1;
#endif
    while (status() != 0x84)
        ;
    for (turn = 0; turn < sizeof shapes / sizeof *shapes; turn++) {
        load_move(255, 2 * turn + 2);
        command(0x01, 0, NULL);
        printf("%s: %ld\n", shapes[turn].name, shapes[turn].wait());
        while (!(status() & COMPLETE))
            ;
        fflush(stdout);
    }
    return 0;
}
