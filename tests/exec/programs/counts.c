/* Runs a program and counts its faults or the messages it sends: counts faults|messages PROGRAM ... */
#include <signal.h>
#include <stdio.h>
#include <string.h>
#include <sys/ptrace.h>
#include <sys/syscall.h>
#include <sys/user.h>
#include <sys/wait.h>
#include <unistd.h>

#define CALL (SIGTRAP | 0x80)

static int is_send(pid_t child)
{
    struct user_regs_struct registers;

    ptrace(PTRACE_GETREGS, child, NULL, &registers);
#ifdef __x86_64__
    return registers.orig_rax == SYS_sendto;
#else
    return registers.orig_eax == SYS_sendto
           || (registers.orig_eax == SYS_socketcall && registers.ebx == 11);
#endif
}

int main(int count, char **arguments)
{
    int messages = count > 2 && strcmp(arguments[1], "messages") == 0, status = 0, entered = 0;
    long counted = 0;
    pid_t child = fork();

    if (child == 0) {
        ptrace(PTRACE_TRACEME, 0, NULL, NULL);
        execv(arguments[2], arguments + 2);
        _exit(127);
    }
    while (waitpid(child, &status, 0) == child && WIFSTOPPED(status)) {
        int number = WSTOPSIG(status);

        if (number == CALL && (entered = !entered) != 0)
            counted += is_send(child);
        counted += !messages && number == SIGSEGV;
        ptrace(PTRACE_SETOPTIONS, child, NULL, PTRACE_O_TRACESYSGOOD);
        ptrace(messages ? PTRACE_SYSCALL : PTRACE_CONT, child, NULL,
               number == SIGTRAP || number == CALL ? 0 : number);
    }
    printf("%ld %s\n", counted, messages ? "messages" : "faults");
    return WIFEXITED(status) ? WEXITSTATUS(status) : 1;
}
