/* The same bus operations by the C client and by trapped instructions: trapped_access WHAT ROUNDS
 *
 * Prints "name ns" per operation, each name once in each round. Every measurement is a child of its
 * own, so one session at a time is open at the board. WHAT is
 *     cycles    MCP-1200 at ports 340H on: cycles that are each asked for, and posted writes
 *     polls     LM629 at ports 340H and 341H: its status
 *     motor     LM629 with a motor and an interrupt: a home search, moves that are waited for; wall
 *               time for each nanosecond of chip time
 *     limits    without a board: an echo over a socket, and a fault with an empty handler
 */
#define _GNU_SOURCE
#include "lm629.h"
#include "vbus.h"

#include <fcntl.h>
#include <pthread.h>
#include <signal.h>
#include <stdint.h>
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

#ifdef __x86_64__
#define IP REG_RIP
#define ALL_CLOCKS "syscall" : "+a"(number) : "D"(CLOCK_MONOTONIC), "S"(&now) : "rcx", "r11", "memory"
#else
#define IP REG_EIP
#define ALL_CLOCKS "int $0x80" : "+a"(number) : "b"(CLOCK_MONOTONIC), "c"(&now) : "memory"
#endif

#define STATUS 0  /* of the LM629; no side effects: leases are given */
#define LOOP 1000 /* accesses in a loop of the program's */
#define GAIN 0x61 /* of the MCP-1200; each read of it is a round trip */

/* By an instruction of its own, past the library, whose clocks are the chips'. */
static double now_ns(void)
{
    struct timespec now;
    long number = SYS_clock_gettime;

    __asm__ volatile(ALL_CLOCKS);
    return (double)now.tv_sec * 1e9 + (double)now.tv_nsec;
}

static double chip_ns(void)
{
    struct timespec now;

    clock_gettime(CLOCK_MONOTONIC, &now);
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

/* A loop of the program's: it is followed from one access to the next. */
static void polled_status(void)
{
    unsigned left;

    for (left = LOOP; left > 0 && !(inb(BASE + STATUS) & 0x20); left--)
        ;
}

static void *await_interrupt(void *data)
{
    uint32_t number;

    while (read(*(int *)data, &number, sizeof number) == sizeof number)
        ; /* the reset has interrupted too */
    return NULL;
}

/* The same with a second thread, which sleeps until an interrupt comes. */
static void open_threads(void)
{
    static int fd;
    pthread_t thread;

    open_ports();
    fd = open("/dev/uio0", O_RDWR);
    if (fd < 0 || pthread_create(&thread, NULL, await_interrupt, &fd) != 0)
        exit(1);
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
    ((ucontext_t *)context)->uc_mcontext.gregs[IP] += 1; /* inb %dx, %al */
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

/* --- a motor ---------------------------------------------------------------------------------- */

static void open_motor(void)
{
    open_ports();
    while (inb(BASE) & 1)
        ;
    outb(0, BASE); /* RESET */
    while ((inb(BASE) & 0xBF) != 0x84)
        ;
    load_move(20, 2000);
}

/* Velocity mode, until the index pulse has been seen. */
static void find_home(void)
{
    static const unsigned char forward[] = {0x18, 0x28, 0, 0, 0, 20, 0, 1, 0, 0};

    command(0x1F, sizeof forward, forward);
    command(0x03, 0, NULL); /* SIP */
    command(0x01, 0, NULL);
    while (!(inb(BASE) & 8))
        ;
}

/* A move, and sleep until the interrupt of its end. */
static void await_move(void)
{
    uint32_t number;
    int fd = open("/dev/uio0", O_RDWR);

    command(0x01, 0, NULL);
    if (read(fd, &number, sizeof number) != sizeof number)
        exit(1);
    close(fd);
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
    {"polls", "polled", open_ports, polled_status, 300},
    {"polls", "leased with a thread", open_threads, trapped_status, 30000},
    {"polls", "polled with a thread", open_threads, polled_status, 300},
    {"polls", "device leased", open_device, device_status, 30000},
    {"motor", "home", open_motor, find_home, 1},
    {"motor", "interrupt", open_motor, await_move, 1},
};

static void measure(const struct measurement *what)
{
    long turn;
    double began, ended, parts = (double)what->count, chips = 0;

    what->open();
    for (turn = 0; turn < what->count / 10; turn++)
        what->operate();
    if (what->open == open_motor)
        chips = chip_ns();
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
    if (what->operate == polled_status)
        parts *= LOOP;
    if (what->open == open_motor)
        parts = chip_ns() - chips;
    printf("%s\t%.3f\n", what->name, (ended - began) / parts);
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
