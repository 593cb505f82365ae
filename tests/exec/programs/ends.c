/* Programs that do not end by themselves, or in a way of their own. The card is an MCP-1200: R20h to
 * R27h keep bytes.
 */
#define _GNU_SOURCE
#include <pthread.h>
#include <signal.h>
#include <stdint.h>
#include <stdio.h>
#include <string.h>
#include <sys/io.h>
#include <sys/syscall.h>
#include <unistd.h>

#define KEEP 0x320

static int *volatile wild = (int *)(uintptr_t)0x1234567890ABCDEF;
static pthread_mutex_t mutex = PTHREAD_MUTEX_INITIALIZER;

static void on_signal(int number)
{
    (void)number;
}

static void *poll_card(void *data)
{
    for (;;)
        inb(KEEP);
    return data;
}

static void *wait_for_mutex(void *data)
{
    pthread_mutex_lock(&mutex);
    return data;
}

/* As a program without the C library would: nobody sees it. */
static long raw_block(int number)
{
    unsigned long mask[2] = {0, 0};
    long result;

    mask[(number - 1) / (8 * sizeof mask[0])] = 1UL << (number - 1) % (8 * sizeof mask[0]);
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
    return result;
}

int main(int count, char **arguments)
{
    const char *how = count > 1 ? arguments[1] : "";
    pthread_t threads[2];

    if (iopl(3) != 0)
        return 1;
    inb(KEEP);
    if (strcmp(how, "stubborn") == 0) {
        signal(SIGTERM, SIG_IGN);
        signal(SIGINT, SIG_IGN);
    }
    if (strcmp(how, "handler") == 0)
        signal(SIGTERM, on_signal);
    puts("up");
    fflush(stdout);
    if (strcmp(how, "wild") == 0)
        return *wild;
    if (strcmp(how, "raw") == 0 && raw_block(SIGSEGV) == 0)
        return inb(KEEP);
    if (strcmp(how, "threads") == 0) {
        pthread_create(&threads[0], NULL, poll_card, NULL);
        pthread_create(&threads[1], NULL, poll_card, NULL);
    }
    if (strcmp(how, "deadlock") == 0) {
        pthread_mutex_lock(&mutex);
        pthread_create(&threads[0], NULL, wait_for_mutex, NULL);
        pthread_join(threads[0], NULL);
    }
    if (strcmp(how, "spins") == 0)
        for (;;)
            ;
    for (;;)
        if (strcmp(how, "polls") == 0 || strcmp(how, "threads") == 0)
            inb(KEEP);
        else
            pause();
}
