/* How programs close descriptors, start others and end, each under a name.
 *
 * The card is an MCP-1200: R20h to R27h keep bytes.
 */
#define _GNU_SOURCE
#include <errno.h>
#include <fcntl.h>
#include <linux/audit.h>
#include <linux/filter.h>
#include <linux/seccomp.h>
#include <signal.h>
#include <spawn.h>
#include <stddef.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/io.h>
#include <sys/prctl.h>
#include <sys/syscall.h>
#include <sys/wait.h>
#include <time.h>
#include <unistd.h>

#define KEEP 0x320

extern char **environ;

static const char *self;

static void own(void)
{
    if (iopl(3) != 0)
        exit(1);
}

static void closes(const char *how)
{
    int fd;

    own();
    outb(0x41, KEEP);
    inb(KEEP);
    if (strcmp(how, "closefrom") == 0) {
        closefrom(3);
    } else if (strcmp(how, "close_range") == 0) {
        if (close_range(3, ~0U, 0) != 0)
            exit(2);
    } else if (strcmp(how, "dup2") == 0) {
        for (fd = 3; fd < 1020; fd++)
            dup2(1, fd);
    } else if (daemon(1, 1) != 0) {
        exit(3);
    }
    outb(inb(KEEP) + 1, KEEP);
    printf("%02x\n", inb(KEEP));
}

/* What another program does comes after what this one has done. */
static void starts(const char *how)
{
    char *arguments[] = {(char *)self, "add", NULL};
    char command[4096];
    pid_t child;
    int status;

    own();
    outb(0x10, KEEP);
    snprintf(command, sizeof command, "%s add", self);
    if (strcmp(how, "execv") == 0) {
        execv("/no/such/program", arguments);
        printf("still here %d\n", errno == ENOENT);
        fflush(stdout);
        outb(0x20, KEEP);
        execv(self, arguments);
    } else if (strcmp(how, "execl") == 0) {
        execl(self, self, "add", NULL);
    } else if (strcmp(how, "execle") == 0) {
        execle(self, self, "add", NULL, environ);
    } else if (strcmp(how, "spawn") == 0) {
        posix_spawn(&child, self, NULL, NULL, arguments, environ);
        waitpid(child, &status, 0);
    } else if (strcmp(how, "system") == 0) {
        status = system(command);
    } else if (strcmp(how, "popen") == 0) {
        pclose(popen(command, "w"));
    } else if ((child = vfork()) == 0) {
        execv(self, arguments);
    } else {
        waitpid(child, &status, 0);
    }
    outb(inb(KEEP) + 1, KEEP);
    printf("%02x\n", inb(KEEP));
}

static void add(void)
{
    own();
    outb(inb(KEEP) + 1, KEEP);
    printf("%02x\n", inb(KEEP));
}

/* Tell a process that goes on when this one has ended; it uses the card again when asked to end. */
static void end_softly(int number)
{
    outb((unsigned char)number, KEEP);
    _exit(0);
}

static void leaves(const char *how)
{
    pid_t child;

    own();
    outb(1, KEEP);
    child = fork();
    if (child == 0 && strcmp(how, "orphan") == 0 && fork() != 0)
        _exit(0);
    if (child == 0) {
        signal(SIGTERM, strcmp(how, "stubborn") == 0 ? SIG_IGN : end_softly);
        inb(KEEP);
        printf("%d\n", (int)getpid());
        fflush(stdout);
        for (;;)
            pause();
    }
    if (strcmp(how, "orphan") == 0)
        waitpid(child, NULL, 0); /* else it might be left behind, too */
    while (getchar() != '\n')
        ;
}

static void on_signal(int number)
{
    printf("handler %d\n", number == SIGTERM);
}

static void dies(const char *number)
{
    struct sigaction action;
    volatile int zero = 0;

    own();
    inb(KEEP);
    sigaction(SIGTERM, NULL, &action);
    printf("default %d", action.sa_handler == SIG_DFL);
    printf(" %d", signal(SIGTERM, on_signal) == SIG_DFL);
    raise(SIGTERM);
    printf("own %d\n", signal(SIGTERM, SIG_DFL) == on_signal);
    printf("default %d\n", signal(SIGTERM, SIG_DFL) == SIG_DFL);
    signal(SIGHUP, SIG_IGN);
    raise(SIGHUP);
    fflush(stdout);
    outb(0x0E, KEEP);
    if (atoi(number) == SIGFPE)
        zero = 1 / zero;
    raise(atoi(number));
}

/* A command and the first byte of its data word go out (the status is read); then the end. */
static void cut(void)
{
    own();
    outb(0x1E, 0x340);
    outb(0x12, 0x341);
    inb(0x340);
    raise(SIGKILL);
}

static void whole(void)
{
    own();
    printf("%02x\n", inb(0x340));
    outb(0x00, 0x340);
    while (inb(0x340) & 1)
        ;
    usleep(2000);
    while (inb(0x340) & 1)
        ;
    printf("%02x\n", inb(0x340));
}

static volatile int trapped;

static void on_system_call(int number)
{
    (void)number;
    trapped++;
}

/* Reading costs no system call for the clock: such a call ends the program. */
static void clocks(void)
{
#ifndef __NR_clock_gettime64
#define __NR_clock_gettime64 __NR_clock_gettime
#endif
    struct sock_filter filter[] = {
        BPF_STMT(BPF_LD | BPF_W | BPF_ABS, offsetof(struct seccomp_data, nr)),
        BPF_JUMP(BPF_JMP | BPF_JEQ | BPF_K, __NR_clock_gettime, 1, 0),
        BPF_JUMP(BPF_JMP | BPF_JEQ | BPF_K, __NR_clock_gettime64, 0, 1),
        BPF_STMT(BPF_RET | BPF_K, SECCOMP_RET_TRAP),
        BPF_STMT(BPF_RET | BPF_K, SECCOMP_RET_ALLOW),
    };
    struct sock_fprog program = {sizeof filter / sizeof filter[0], filter};
    struct timespec now;
    int turn;

    signal(SIGSYS, on_system_call);
    own();
    inb(KEEP);
    if (prctl(PR_SET_NO_NEW_PRIVS, 1, 0, 0, 0) != 0
        || prctl(PR_SET_SECCOMP, SECCOMP_MODE_FILTER, &program) != 0) {
        printf("no seccomp\n");
        return;
    }
    clock_gettime(CLOCK_MONOTONIC, &now);
    if (trapped) {
        printf("no vDSO\n");
        return;
    }
    for (turn = 0; turn < 10; turn++)
        inb(KEEP);
    printf("read\n");
}

int main(int count, char **arguments)
{
    const char *part = count > 1 ? arguments[1] : "", *how = count > 2 ? arguments[2] : "";

    self = arguments[0];
    if (strcmp(part, "closes") == 0)
        closes(how);
    else if (strcmp(part, "starts") == 0)
        starts(how);
    else if (strcmp(part, "add") == 0)
        add();
    else if (strcmp(part, "leaves") == 0)
        leaves(how);
    else if (strcmp(part, "dies") == 0)
        dies(how);
    else if (strcmp(part, "cut") == 0)
        cut();
    else if (strcmp(part, "whole") == 0)
        whole();
    else if (strcmp(part, "clocks") == 0)
        clocks();
    else
        return 64;
    return 0;
}
