/* Twenty-seven odd things that programs do, each under a name. The card is an MCP-1200: R20h to R27h
 * keep bytes. Each prints what it found there.
 */
#define _GNU_SOURCE
#include <errno.h>
#include <limits.h>
#include <linux/audit.h>
#include <linux/filter.h>
#include <linux/seccomp.h>
#include <pthread.h>
#include <setjmp.h>
#include <signal.h>
#include <spawn.h>
#include <stddef.h>
#include <stdint.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/io.h>
#include <sys/prctl.h>
#include <sys/resource.h>
#include <sys/syscall.h>
#include <sys/time.h>
#include <sys/wait.h>
#include <time.h>
#include <ucontext.h>
#include <unistd.h>

#define KEEP 0x320

extern char **environ;

static char *self;
static volatile int found;
static char room[65536];
static sigjmp_buf back;

static int add(int value)
{
    outb((unsigned char)(inb(KEEP) + value), KEEP);
    return inb(KEEP);
}

static void set(int value)
{
    outb((unsigned char)value, KEEP);
}

/* --- threads ---------------------------------------------------------------------------------- */

static void *add_ten(void *data)
{
    int turn, wrong = 0;
    unsigned short own = (unsigned short)(KEEP + 1 + (long)data);

    for (turn = 0; turn < 10; turn++) {
        outb((unsigned char)turn, own);
        wrong += inb(own) != turn;
    }
    return (void *)(long)wrong;
}

static void threads(void)
{
    pthread_t all[4];
    void *wrong;
    long turn, sum = 0;

    for (turn = 0; turn < 4; turn++)
        pthread_create(&all[turn], NULL, add_ten, (void *)turn);
    for (turn = 0; turn < 4; turn++) {
        pthread_join(all[turn], &wrong);
        sum += (long)wrong;
    }
    printf("wrong %ld\n", sum);
}

static void *add_one(void *data)
{
    add(1);
    found = 1;
    return data;
}

static void detached_thread(void)
{
    pthread_attr_t attributes;
    pthread_t thread;

    pthread_attr_init(&attributes);
    pthread_attr_setdetachstate(&attributes, PTHREAD_CREATE_DETACHED);
    pthread_create(&thread, &attributes, add_one, NULL);
    while (!found)
        usleep(100);
    printf("%02x\n", inb(KEEP));
}

static void smallest_stack(void)
{
    pthread_attr_t attributes;
    pthread_t thread;

    pthread_attr_init(&attributes);
    pthread_attr_setstacksize(&attributes, PTHREAD_STACK_MIN);
    pthread_create(&thread, &attributes, add_one, NULL);
    pthread_join(thread, NULL);
    printf("%02x\n", inb(KEEP));
}

static void *poll_for_ever(void *data)
{
    for (;;) {
        inb(KEEP);
        pthread_testcancel();
    }
    return data;
}

static void cancel(void *(*work)(void *))
{
    pthread_t thread;
    void *result;

    pthread_create(&thread, NULL, work, NULL);
    usleep(50);
    pthread_cancel(thread);
    pthread_join(thread, &result);
    printf("cancelled %d, %02x\n", result == PTHREAD_CANCELED, add(1));
}

static void cancelled_thread(void)
{
    cancel(poll_for_ever);
}

static void *cancelled_by_itself(void *data)
{
    pthread_setcanceltype(PTHREAD_CANCEL_ASYNCHRONOUS, NULL);
    for (;;)
        inb(KEEP);
    return data;
}

static void asynchronous_cancel(void)
{
    cancel(cancelled_by_itself);
}

static void *main_is_gone(void *data)
{
    pthread_join(*(pthread_t *)data, NULL);
    printf("%02x\n", add(1));
    return NULL;
}

static void main_leaves_first(void)
{
    static pthread_t mine;
    pthread_t thread;

    mine = pthread_self();
    pthread_create(&thread, NULL, main_is_gone, &mine);
    pthread_exit(NULL);
}

static void *forks(void *data)
{
    int status;
    pid_t child = fork();

    if (child == 0)
        _exit(add(1));
    waitpid(child, &status, 0);
    found = WEXITSTATUS(status);
    return data;
}

static void fork_in_a_thread(void)
{
    pthread_t thread;

    pthread_create(&thread, NULL, forks, NULL);
    pthread_join(thread, NULL);
    printf("child %02x, parent %02x\n", found, add(1));
}

/* --- processes -------------------------------------------------------------------------------- */

static void fork_and_both_go_on(void)
{
    forks(NULL);
    printf("child %02x, parent %02x\n", found, add(1));
}

static char *again[3];

static void vfork_and_exec(void)
{
    pid_t child = vfork();
    int status;

    if (child == 0) {
        execv(self, again);
        _exit(99);
    }
    waitpid(child, &status, 0);
    printf("parent %02x\n", add(1));
}

static void spawned(void)
{
    pid_t child;
    int status;

    if (posix_spawn(&child, self, NULL, NULL, again, environ) != 0)
        return;
    waitpid(child, &status, 0);
    printf("parent %02x\n", add(1));
}

static void exec_in_place(void)
{
    execv(self, again);
}

static void by_a_shell(void)
{
    char line[4096];
    FILE *pipe;

    snprintf(line, sizeof line, "%s 'add and tell'", self);
    pipe = popen(line, "r");
    if (fgets(line, sizeof line, pipe) == NULL)
        return;
    pclose(pipe);
    printf("shell %.2s, parent %02x\n", line, add(1));
}

static void add_and_tell(void)
{
    printf("%02x\n", add(1));
}

static void few_descriptors(void)
{
    struct rlimit few = {16, 16};
    int fd;

    setrlimit(RLIMIT_NOFILE, &few);
    for (fd = 3; fd < 16; fd++)
        close(fd);
    printf("%02x\n", add(1));
}

static void card_in_atexit(void)
{
    printf("%02x\n", add(1));
}

static void at_exit(void)
{
    atexit(card_in_atexit);
}

/* --- signals ---------------------------------------------------------------------------------- */

static void use_card(int number)
{
    (void)number;
    found = add(1);
}

static void card_in_a_handler(void)
{
    signal(SIGUSR1, use_card);
    raise(SIGUSR1);
    printf("%02x\n", found);
}

static void on_other_stack(int number)
{
    char here;

    (void)number;
    found = &here >= room && &here < room + sizeof room ? add(1) : 0;
}

static void alternate_stack(void)
{
    stack_t stack;
    struct sigaction action;

    memset(&stack, 0, sizeof stack);
    stack.ss_sp = room;
    stack.ss_size = sizeof room;
    sigaltstack(&stack, NULL);
    memset(&action, 0, sizeof action);
    action.sa_handler = on_other_stack;
    action.sa_flags = SA_ONSTACK;
    sigaction(SIGUSR1, &action, NULL);
    raise(SIGUSR1);
    printf("%02x\n", found);
}

static void jump_back(int number)
{
    (void)number;
    siglongjmp(back, 1);
}

static volatile int depth;

static int dig(int level)
{
    volatile char rubble[4096];

    depth = level;
    rubble[0] = (char)inb(KEEP);
    return level < 0 ? 0 : dig(level + 1) + rubble[0];
}

/* The stack runs over in the middle of accesses: the program's own handler, on a stack of its own. */
static void stack_that_overflows(void)
{
    struct rlimit small = {256 * 1024, RLIM_INFINITY};
    stack_t stack;
    struct sigaction action;

    setrlimit(RLIMIT_STACK, &small);
    memset(&stack, 0, sizeof stack);
    stack.ss_sp = room;
    stack.ss_size = sizeof room;
    sigaltstack(&stack, NULL);
    memset(&action, 0, sizeof action);
    action.sa_handler = jump_back;
    action.sa_flags = SA_ONSTACK;
    sigaction(SIGSEGV, &action, NULL);
    if (sigsetjmp(back, 1) == 0)
        dig(0);
    printf("deep %d, %02x\n", depth > 20, add(1));
}

static int descend(int level)
{
    volatile char rubble[1024];

    rubble[0] = level % 500 == 0 ? (char)inb(KEEP) : 0x41;
    return level == 0 ? rubble[0] : descend(level - 1) + (rubble[0] != 0x41);
}

static void deep_recursion(void)
{
    printf("%02x\n", descend(5000));
}

static void jump_out_of_an_access(void)
{
    static const struct itimerval soon = {{0, 0}, {0, 50}};

    signal(SIGALRM, jump_back);
    if (sigsetjmp(back, 1) == 0) {
        setitimer(ITIMER_REAL, &soon, NULL);
        for (;;)
            inb(KEEP);
    }
    printf("%02x\n", add(1));
}

static void own_fault_handler(void)
{
    signal(SIGSEGV, jump_back);
    add(1);
    if (sigsetjmp(back, 1) == 0)
        *(volatile int *)(uintptr_t)found = 1;
    printf("own fault, %02x\n", add(1));
}

static void faults_blocked(void)
{
    sigset_t all;

    sigfillset(&all);
    sigprocmask(SIG_BLOCK, &all, NULL);
    printf("%02x\n", add(1));
}

static void faults_ignored(void)
{
    signal(SIGSEGV, SIG_IGN);
    signal(SIGBUS, SIG_IGN);
    printf("%02x\n", add(1));
}

static void fault_sent_by_hand(void)
{
    signal(SIGSEGV, use_card);
    kill(getpid(), SIGSEGV);
    printf("%02x\n", found);
}

/* --- the kernel, and the stack --------------------------------------------------------------- */

static long long now(void)
{
    struct timespec when;

    clock_gettime(CLOCK_MONOTONIC, &when);
    return (long long)when.tv_sec * 1000000000 + when.tv_nsec;
}

static void sleep_by_number(void)
{
    struct timespec long_enough = {0, 5000000};
    long long begun = now();

    syscall(SYS_nanosleep, &long_enough, NULL);
    printf("slept %d, %02x\n", now() - begun >= 5000000, add(1));
}

static void card_under_seccomp(void)
{
    struct sock_filter filter[] = {
        BPF_STMT(BPF_LD | BPF_W | BPF_ABS, offsetof(struct seccomp_data, nr)),
        BPF_JUMP(BPF_JMP | BPF_JEQ | BPF_K, __NR_openat, 0, 1),
        BPF_STMT(BPF_RET | BPF_K, SECCOMP_RET_ERRNO | EACCES),
        BPF_STMT(BPF_RET | BPF_K, SECCOMP_RET_ALLOW),
    };
    struct sock_fprog program = {sizeof filter / sizeof filter[0], filter};
    int refused;

    prctl(PR_SET_NO_NEW_PRIVS, 1, 0, 0, 0);
    prctl(PR_SET_SECCOMP, SECCOMP_MODE_FILTER, &program);
    refused = syscall(SYS_openat, 0, "/dev/null", 0) < 0 && errno == EACCES;
    printf("refused %d, %02x\n", refused, add(1));
}

static void raw_block_of_the_trap(void)
{
    unsigned long mask[2] = {1UL << (SIGSEGV - 1), 0};
    long result;

#ifdef __x86_64__
    register long size __asm__("r10") = 8;

    __asm__ volatile("syscall" : "=a"(result)
                     : "a"(SYS_rt_sigprocmask), "D"(SIG_BLOCK), "S"(mask), "d"(0), "r"(size)
                     : "rcx", "r11", "memory");
#else
    __asm__ volatile("int $0x80" : "=a"(result)
                     : "a"(SYS_rt_sigprocmask), "b"(SIG_BLOCK), "c"(mask), "d"(0), "S"(8)
                     : "memory");
#endif
    printf("blocked %d\n", result == 0);
    fflush(stdout);
    add(1);
}

static ucontext_t outside, inside;

static void card_inside(void)
{
    add(1);
    swapcontext(&inside, &outside);
    add(1);
}

static void coroutine(void)
{
    getcontext(&inside);
    inside.uc_stack.ss_sp = room;
    inside.uc_stack.ss_size = sizeof room;
    inside.uc_link = &outside;
    makecontext(&inside, card_inside, 0);
    swapcontext(&outside, &inside);
    printf("%02x, ", inb(KEEP));
    swapcontext(&outside, &inside);
    printf("%02x\n", inb(KEEP));
}

int main(int count, char **arguments)
{
    static const struct {
        const char *name;
        void (*run)(void);
    } things[] = {
        {"threads", threads}, {"detached thread", detached_thread},
        {"thread with the smallest stack", smallest_stack}, {"cancelled thread", cancelled_thread},
        {"asynchronous cancel", asynchronous_cancel}, {"main thread leaves first", main_leaves_first},
        {"fork in a thread", fork_in_a_thread}, {"fork", fork_and_both_go_on},
        {"vfork and exec", vfork_and_exec}, {"posix_spawn", spawned}, {"exec", exec_in_place},
        {"popen", by_a_shell}, {"few descriptors", few_descriptors}, {"atexit", at_exit},
        {"signal handler", card_in_a_handler}, {"alternate stack", alternate_stack},
        {"stack overflow", stack_that_overflows}, {"deep recursion", deep_recursion},
        {"longjmp out of an access", jump_out_of_an_access},
        {"own fault handler", own_fault_handler}, {"faults blocked", faults_blocked},
        {"faults ignored", faults_ignored}, {"SIGSEGV by kill", fault_sent_by_hand},
        {"sleep by system call", sleep_by_number}, {"seccomp", card_under_seccomp},
        {"trap blocked by system call", raw_block_of_the_trap}, {"coroutine", coroutine},
        {"add and tell", add_and_tell},
    };
    size_t turn;

    self = arguments[0];
    again[0] = self;
    again[1] = (char *)"add and tell";
    if (count < 2 || iopl(3) != 0)
        return 1;
    setvbuf(stdout, NULL, _IOLBF, 0);
    if (strcmp(arguments[1], again[1]) != 0)
        set(0x41);
    for (turn = 0; turn < sizeof things / sizeof things[0]; turn++)
        if (strcmp(things[turn].name, arguments[1]) == 0) {
            things[turn].run();
            return 0;
        }
    return 64;
}
