/* What drivers do to a card, each under a name; prints what it has seen.
 *
 * The card is an MCP-1200: R20h to R27h keep bytes.
 */
#define _GNU_SOURCE
#include <errno.h>
#include <fcntl.h>
#include <poll.h>
#include <pthread.h>
#include <semaphore.h>
#include <setjmp.h>
#include <signal.h>
#include <stdint.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/auxv.h>
#include <sys/io.h>
#include <sys/mman.h>
#include <sys/select.h>
#include <sys/syscall.h>
#include <sys/time.h>
#include <sys/wait.h>
#include <time.h>
#include <unistd.h>

#define BASE 0x300
#define KEEP (BASE + 0x20) /* three plain registers */

static void own(void)
{
    if (iopl(3) != 0 || ioperm(BASE, 128, 1) != 0) {
        perror("ioperm");
        exit(1);
    }
}

/* --- ports ------------------------------------------------------------------------------------ */

static void ports(void)
{
    unsigned char bytes[6] = {0x11, 0x12, 0x13, 0x14, 0x15, 0x16}, back[6] = {0};
    uint16_t words[2] = {0x2221, 0x2423}, got[2] = {0};
    uint32_t longs[1] = {0x00434241}, long_got[1] = {0};

    own();
    outb(0x5A, KEEP);
    printf("byte %02x\n", inb(KEEP));
    outw(0x2211, KEEP);
    printf("word %04x %02x %02x\n", inw(KEEP), inb(KEEP), inb(KEEP + 1));
    outl(0x00332211, KEEP);
    printf("long %06x\n", (unsigned)inl(KEEP) & 0xFFFFFF);
    outsb(KEEP, bytes, 6);
    printf("outsb %02x\n", inb(KEEP));
    insb(KEEP, back, 6);
    printf("insb %02x %02x\n", back[0], back[5]);
    outsw(KEEP, words, 2);
    insw(KEEP, got, 2);
    printf("words %04x %04x\n", got[0], got[1]);
    outsl(KEEP, longs, 1);
    insl(KEEP, long_got, 1);
    printf("longs %06x\n", (unsigned)long_got[0] & 0xFFFFFF);
    __asm__ volatile("movb $0x77, %%al; outb %%al, $0x20" ::: "eax");
    {
        unsigned char value;

        __asm__ volatile("inb $0x20, %%al" : "=a"(value));
        printf("immediate %02x\n", value);
    }
    outb(0, 0x80);
    __asm__ volatile("cli; sti");
}

static void forbidden(void)
{
    if (ioperm(BASE, 16, 1) != 0)
        exit(1);
    inb(BASE + 7);
    printf("allowed\n");
    fflush(stdout);
    inb(BASE + 16);
    printf("not reached\n");
}

static void nobody(void)
{
    int turn;

    own();
    for (turn = 0; turn < 3; turn++)
        printf("%02x\n", inb(BASE + 0x7000));
    outb(1, BASE + 0x7000);
    printf("%04x\n", inw(BASE + 0x7F));
}

static void device(void)
{
    unsigned char byte = 0x31, three[3] = {1, 2, 3};
    int fd = open("/dev/port", O_RDWR), copy;
    FILE *file;

    if (fd < 0)
        exit(1);
    printf("pwrite %zd\n", pwrite(fd, &byte, 1, KEEP));
    byte = 0;
    printf("pread %zd", pread(fd, &byte, 1, KEEP));
    printf(" %02x\n", byte);
    lseek(fd, KEEP, SEEK_SET);
    printf("write %zd\n", write(fd, three, 3));
    copy = dup(fd);
    close(fd);
    lseek(copy, KEEP + 1, SEEK_SET);
    memset(three, 0, 3);
    printf("read %zd", read(copy, three, 2));
    printf(" %02x %02x at %lx\n", three[0], three[1], (long)lseek(copy, 0, SEEK_CUR));
    close(copy);
    file = fopen("/dev/port", "r+b");
    setvbuf(file, NULL, _IONBF, 0);
    fseek(file, KEEP, SEEK_SET);
    fputc(0x3C, file);
    fseek(file, KEEP, SEEK_SET);
    printf("stream %02x\n", fgetc(file));
    fclose(file);
    printf("openat %d\n", openat(AT_FDCWD, "/dev/port", O_RDONLY) >= 0);
}

/* --- memory ----------------------------------------------------------------------------------- */

static volatile unsigned char *map(const char *path, long place)
{
    int fd = open(path, O_RDWR | O_SYNC);
    void *memory = mmap(NULL, 4096, PROT_READ | PROT_WRITE, MAP_SHARED, fd, place);

    if (fd < 0 || memory == MAP_FAILED) {
        perror(path);
        exit(1);
    }
    close(fd);
    return memory;
}

static void show_memory(volatile unsigned char *card)
{
    unsigned char copy[3];

    card[0x20] = 0x41;
    card[0x21] = 0x42;
    printf("bytes %02x %02x\n", card[0x20], card[0x21]);
    *(volatile uint16_t *)(card + 0x20) = 0x5251;
    printf("word %04x\n", *(volatile uint16_t *)(card + 0x20));
    card[0x20] |= 0x80;
    card[0x21]++;
    printf("changed %02x %02x\n", card[0x20], card[0x21]);
    memset((void *)(card + 0x20), 0x66, 3);
    memcpy(copy, (void *)(card + 0x20), 3);
    printf("block %02x %02x %02x\n", copy[0], copy[1], copy[2]);
}

static void memory(void)
{
    show_memory(map("/dev/mem", 0x40000000));
}

static void uio(void)
{
    show_memory(map("/dev/uio0", 0));
}

static void fixed(void)
{
    show_memory((volatile unsigned char *)0x50000000);
}

static void strided(void)
{
    volatile uint32_t *card = (volatile uint32_t *)map("/dev/mem", 0x40000000);

    card[0x20] = 0x12345678;
    card[0x21] = 0x9A;
    printf("%08x %08x\n", (unsigned)card[0x20], (unsigned)card[0x21]);
    printf("%02x\n", ((volatile unsigned char *)card)[0x84]);
}

static void unsupported(void)
{
    volatile unsigned char *card = map("/dev/mem", 0x40000000);

    __asm__ volatile("paddb (%0), %%mm0" : : "r"(card + 0x20));
    printf("not reached\n");
}

/* --- signals, threads, processes -------------------------------------------------------------- */

static sigjmp_buf back;
static volatile int *volatile nowhere = (volatile int *)8;
static volatile int seen;

static void on_fault(int number)
{
    (void)number;
    siglongjmp(back, 1);
}

static void on_fault_info(int number, siginfo_t *info, void *context)
{
    (void)context;
    printf("signal %d at %p\n", number, info->si_addr);
    siglongjmp(back, 1);
}

static void faults(void)
{
    struct sigaction action;
    sigset_t all;

    own();
    signal(SIGSEGV, on_fault);
    if (sigsetjmp(back, 1) == 0)
        *nowhere = 1;
    else
        printf("caught\n");
    outb(0x21, KEEP);
    printf("still %02x\n", inb(KEEP));
    memset(&action, 0, sizeof action);
    action.sa_sigaction = on_fault_info;
    action.sa_flags = SA_SIGINFO;
    sigaction(SIGSEGV, &action, NULL);
    if (sigsetjmp(back, 1) == 0)
        *nowhere = 1;
    sigaction(SIGSEGV, NULL, &action);
    printf("handler %d\n", action.sa_sigaction == on_fault_info);
    sigfillset(&all);
    sigprocmask(SIG_BLOCK, &all, NULL);
    printf("blocked %02x\n", inb(KEEP));
}

static void on_alarm(int number)
{
    (void)number;
    seen = inb(KEEP);
}

static void handler(void)
{
    struct sigaction action;

    own();
    outb(0x19, KEEP);
    memset(&action, 0, sizeof action);
    action.sa_handler = on_alarm;
    sigfillset(&action.sa_mask);
    sigaction(SIGUSR1, &action, NULL);
    raise(SIGUSR1);
    printf("in a handler %02x\n", seen);
}

static void crash(void)
{
    own();
    printf("%02x\n", inb(KEEP));
    fflush(stdout);
    *nowhere = 1;
}

static void *work(void *data)
{
    unsigned number = (unsigned)(uintptr_t)data, turn;
    uintptr_t wrong = 0;

    for (turn = 0; turn < 300; turn++) {
        outb((unsigned char)(turn + number), (unsigned short)(KEEP + number));
        wrong += inb((unsigned short)(KEEP + number)) != ((turn + number) & 0xFF);
    }
    return (void *)wrong;
}

static void threads(void)
{
    pthread_t thread[3];
    uintptr_t turn;
    void *wrong;

    own();
    for (turn = 0; turn < 3; turn++)
        pthread_create(&thread[turn], NULL, work, (void *)turn);
    for (turn = 0; turn < 3; turn++) {
        pthread_join(thread[turn], &wrong);
        printf("wrong %d\n", (int)(uintptr_t)wrong);
    }
}

static void forks(void)
{
    int status;

    own();
    outb(0x0A, KEEP);
    fflush(stdout);
    if (fork() == 0) {
        printf("child %02x\n", inb(KEEP));
        outb(0x0B, KEEP);
        fflush(stdout);
        _exit(5);
    }
    wait(&status);
    printf("parent %02x, child's code %d\n", inb(KEEP), WEXITSTATUS(status));
}

static void closes(void)
{
    int fd;

    own();
    outb(0x0C, KEEP);
    for (fd = 3; fd < 1024; fd++)
        close(fd);
    printf("low descriptor %d\n", open("/dev/null", O_RDONLY));
    printf("after closing all %02x\n", inb(KEEP));
}

static void posted(void)
{
    own();
    outb(0x0D, KEEP);
    _exit(0);
}

static void store(void)
{
    own();
    outb((unsigned char)strtoul(getenv("BYTE"), NULL, 16), KEEP);
}

static void show(void)
{
    own();
    printf("%02x\n", inb(KEEP));
}

static void endless(void)
{
    own();
    inb(KEEP);
    printf("polling\n");
    fflush(stdout);
    for (;;)
        outb(inb(KEEP), KEEP);
}

/* --- time ------------------------------------------------------------------------------------- */

static long long now(void)
{
    struct timespec when;

    clock_gettime(CLOCK_MONOTONIC, &when);
    return (long long)when.tv_sec * 1000000 + when.tv_nsec / 1000;
}

static void *late(void *data)
{
    (void)data;
    return NULL;
}

static void times(void)
{
    struct timespec wait = {1000, 500}, until;
    struct timeval short_while = {30, 0}, a, b;
    pthread_mutex_t mutex = PTHREAD_MUTEX_INITIALIZER;
    pthread_cond_t condition = PTHREAD_COND_INITIALIZER;
    pthread_t thread;
    struct pollfd in;
    int pipes[2];
    time_t start;
    long long before;

    own();
    before = now();
    sleep(3600);
    printf("sleep %lld\n", now() - before);
    before = now();
    usleep(2500);
    printf("usleep %lld\n", now() - before);
    before = now();
    nanosleep(&wait, NULL);
    printf("nanosleep %lld\n", now() - before);
    clock_gettime(CLOCK_MONOTONIC, &until);
    until.tv_sec += 50;
    before = now();
    clock_nanosleep(CLOCK_MONOTONIC, TIMER_ABSTIME, &until, NULL);
    printf("until %lld\n", (now() - before + 50) / 100);
    before = now();
    printf("select %d", select(0, NULL, NULL, NULL, &short_while));
    printf(" %lld\n", now() - before);
    if (pipe(pipes) != 0)
        exit(1);
    in.fd = pipes[0];
    in.events = POLLIN;
    before = now();
    printf("poll %d", poll(&in, 1, 700));
    printf(" %lld\n", now() - before);
    if (write(pipes[1], "x", 1) != 1)
        exit(1);
    printf("poll %d\n", poll(&in, 1, 700));
    gettimeofday(&a, NULL);
    gettimeofday(&b, NULL);
    printf("step %ld\n", (long)(b.tv_usec - a.tv_usec));
    start = time(NULL);
    sleep(7);
    printf("time %ld\n", (long)(time(NULL) - start));
    pthread_create(&thread, NULL, late, NULL);
    pthread_join(thread, NULL);
    clock_gettime(CLOCK_REALTIME, &until);
    until.tv_nsec += 20000000;
    if (until.tv_nsec >= 1000000000)
        until.tv_sec++, until.tv_nsec -= 1000000000;
    pthread_mutex_lock(&mutex);
    printf("condition %d\n", pthread_cond_timedwait(&condition, &mutex, &until) == ETIMEDOUT);
    before = now();
    while (now() < before + 100)
        ;
    printf("busy loop ends\n");
}

/* Calls by number: what is not bent is told, or refused. */
static void numbers(void)
{
    struct timespec brief = {0, 1000};
    long result;

    own();
    inb(KEEP);
    result = syscall(SYS_ppoll, NULL, 0, &brief, NULL, 8);
    printf("ppoll %ld", result);
    result = syscall(SYS_ppoll, NULL, 0, &brief, NULL, 8);
    printf(" %ld\n", result);
    result = syscall(SYS_io_uring_setup, 4, NULL);
    printf("io_uring %ld, as if it were not there %d\n", result, errno == ENOSYS);
    printf("vDSO %lu\n", getauxval(AT_SYSINFO_EHDR));
}

int main(int count, char **arguments)
{
    static const struct {
        const char *name;
        void (*run)(void);
    } parts[] = {
        {"ports", ports},     {"forbidden", forbidden}, {"nobody", nobody},   {"device", device},
        {"memory", memory},   {"uio", uio},             {"fixed", fixed},     {"strided", strided},
        {"faults", faults},   {"handler", handler},     {"crash", crash},     {"threads", threads},
        {"forks", forks},     {"closes", closes},       {"posted", posted},   {"show", show},
        {"endless", endless}, {"times", times},         {"store", store},
        {"unsupported", unsupported}, {"numbers", numbers},
    };
    unsigned turn;

    for (turn = 0; count > 1 && turn < sizeof parts / sizeof parts[0]; turn++)
        if (strcmp(arguments[1], parts[turn].name) == 0) {
            parts[turn].run();
            return 0;
        }
    return 64;
}
