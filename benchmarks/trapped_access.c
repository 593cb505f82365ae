/* The same bus operations by the C client and by trapped instructions: trapped_access WHAT ROUNDS
 *
 * Prints "name ns" per operation, each name once in each round. Every measurement is a child of its
 * own, so one session at a time is open at the board. WHAT is
 *     cycles    MCP-1200 at ports 300H on: cycles that are each asked for, and posted writes
 *     polls     LM629 at ports 300H and 301H: its status
 *     limits    without a board: an echo over a socket, and a fault with an empty handler
 */
#define _GNU_SOURCE
#include "vbus.h"

#include <fcntl.h>
#include <signal.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/io.h>
#include <sys/socket.h>
#include <sys/syscall.h>
#include <sys/wait.h>
#include <time.h>
#include <ucontext.h>
#include <unistd.h>

#define BASE 0x300
#define STATUS 0  /* of the LM629; no side effects: leases are given */
#define GAIN 0x61 /* of the MCP-1200; each read of it is a round trip */

/* Past the library, whose clocks are the chips'. */
static double now_ns(void)
{
    struct timespec now;

    syscall(SYS_clock_gettime, CLOCK_MONOTONIC, &now);
    return (double)now.tv_sec * 1e9 + (double)now.tv_nsec;
}

static void must(int result)
{
    if (result < 0) {
        fprintf(stderr, "%s\n", vbus_strerror(result));
        exit(1);
    }
}

static struct vbus bus;
static int pair[2], ports;

static void open_client(void)
{
    must(vbus_open(&bus, getenv("VBUS_LINK")));
}

static void open_leasing(void)
{
    open_client();
    must(vbus_leases(&bus, 1));
}

static void open_posting(void)
{
    open_client();
    vbus_buffer(&bus);
}

static void client_gain(void)
{
    must(vbus_read(&bus, GAIN));
}

static void client_status(void)
{
    must(vbus_read(&bus, STATUS));
}

static void client_write(void)
{
    must(vbus_write(&bus, GAIN, 30));
}

static void open_ports(void)
{
    if (ioperm(BASE, 128, 1) != 0)
        exit(1);
}

static void trapped_gain(void)
{
    (void)inb(BASE + GAIN);
}

static void trapped_status(void)
{
    (void)inb(BASE + STATUS);
}

static void trapped_write(void)
{
    outb(30, BASE + GAIN);
}

static void open_device(void)
{
    ports = open("/dev/port", O_RDWR);
    if (ports < 0)
        exit(1);
}

static void device_status(void)
{
    unsigned char byte;

    if (pread(ports, &byte, 1, BASE + STATUS) != 1)
        exit(1);
}

/* --- the limits ------------------------------------------------------------------------------- */

static void open_echo(void)
{
    char bytes[2];

    if (socketpair(AF_UNIX, SOCK_STREAM, 0, pair) != 0)
        exit(1);
    if (fork() != 0) {
        close(pair[1]);
        return;
    }
    close(pair[0]);
    while (read(pair[1], bytes, 2) == 2 && write(pair[1], bytes, 2) == 2)
        ;
    _exit(0);
}

static void echo(void)
{
    char bytes[2] = {0x30, GAIN};

    if (write(pair[0], bytes, 2) != 2 || read(pair[0], bytes, 2) != 2)
        exit(1);
}

static void on_fault(int number, siginfo_t *info, void *context)
{
    (void)number;
    (void)info;
    ((ucontext_t *)context)->uc_mcontext.gregs[REG_RIP] += 1; /* inb %dx, %al */
}

static void open_fault(void)
{
    struct sigaction action;

    memset(&action, 0, sizeof action);
    action.sa_sigaction = on_fault;
    action.sa_flags = SA_SIGINFO;
    sigaction(SIGSEGV, &action, NULL);
}

static void fault(void)
{
    (void)inb(BASE);
}

static void open_both(void)
{
    open_echo();
    open_fault();
}

/* The least that a trapped cycle can cost: a fault right after the CPU has done something else. */
static void fault_and_echo(void)
{
    fault();
    echo();
}

static const struct measurement {
    const char *what, *name;
    void (*open)(void), (*operate)(void);
    long count;
} measurements[] = {
    {"limits", "echo", open_echo, echo, 3000},
    {"limits", "fault", open_fault, fault, 30000},
    {"limits", "fault and echo", open_both, fault_and_echo, 3000},
    {"cycles", "client plain", open_client, client_gain, 3000},
    {"cycles", "trapped plain", open_ports, trapped_gain, 3000},
    {"cycles", "client posted", open_posting, client_write, 10000},
    {"cycles", "trapped posted", open_ports, trapped_write, 10000},
    {"polls", "client polls", open_client, client_status, 3000},
    {"polls", "client leased", open_leasing, client_status, 300000},
    {"polls", "trapped leased", open_ports, trapped_status, 30000},
    {"polls", "device leased", open_device, device_status, 30000},
};

static void measure(const struct measurement *what)
{
    long turn;
    double began, ended;

    what->open();
    for (turn = 0; turn < what->count / 10; turn++)
        what->operate();
    began = now_ns();
    for (turn = 0; turn < what->count; turn++)
        what->operate();
    if (what->operate == client_write) {
        must(vbus_flush(&bus));
        must(vbus_echo(&bus, 0));
    } else if (what->operate == trapped_write) {
        trapped_gain(); /* the fence */
    }
    ended = now_ns();
    printf("%s\t%.1f\n", what->name, (ended - began) / (double)what->count);
    fflush(stdout);
    exit(0);
}

int main(int count, char **arguments)
{
    const char *what = count > 2 ? arguments[1] : "";
    long round, rounds = count > 2 ? atol(arguments[2]) : 0;
    size_t turn;

    for (round = 0; round < rounds; round++)
        for (turn = 0; turn < sizeof measurements / sizeof measurements[0]; turn++) {
            int status = 0;
            pid_t child;

            if (strcmp(measurements[turn].what, what) != 0)
                continue;
            child = fork();
            if (child == 0)
                measure(&measurements[turn]);
            if (child < 0 || waitpid(child, &status, 0) != child || status != 0) {
                fprintf(stderr, "%s failed\n", measurements[turn].name);
                return 1;
            }
        }
    return 0;
}
