/* run_end.c - see run_end.h. License: Apache-2.0. */
#ifndef _GNU_SOURCE
#define _GNU_SOURCE
#endif

#include "run_end.h"

#include <signal.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/time.h>

#define PS_PER_MS UINT64_C(1000000000)
#define TICK_MS 100
#define LEAST_MS 1000

static const char *until, *limit_text;
static uint64_t limit = UINT64_MAX;
static size_t matched;
static FILE *out;
static int middle; /* of a line */
static int over;   /* the text has come */
static volatile unsigned accesses;

static void complete_line(void)
{
    if (middle)
        putc('\n', out);
    middle = 0;
}

/* Whether the text is complete with this byte. */
static int completes(char byte)
{
    while (matched > 0 && until[matched] != byte) {
        size_t shorter = matched - 1;

        while (shorter > 0 && strncmp(until, until + matched - shorter, shorter) != 0)
            shorter--;
        matched = shorter;
    }
    matched += until[matched] == byte;
    return until[matched] == '\0';
}

static void pass_on(char byte)
{
    putc(byte, out);
    middle = byte != '\n';
    if (until != NULL && completes(byte)) {
        over = 1;
        exit(0);
    }
}

void run_end_write(unsigned char byte)
{
    if (out != stdout) /* it comes to pass_on by itself */
        putchar(byte);
    else
        pass_on((char)byte);
}

#ifdef __GLIBC__
#include <bits/types/cookie_io_functions_t.h>

/* A header the compiler was told to include first may have settled what stdio.h shows. */
extern
#ifdef __cplusplus
    "C"
#endif
    FILE *fopencookie(void *, const char *, cookie_io_functions_t);

static ssize_t see(void *cookie, const char *text, size_t size)
{
    size_t turn;

    (void)cookie;
    for (turn = 0; turn < size && !over; turn++) /* the end flushes what is being written again */
        pass_on(text[turn]);
    return (ssize_t)size;
}

/* Whatever the program prints is seen, by whichever function. */
static void watch_stdout(void)
{
    cookie_io_functions_t functions = {NULL, see, NULL, NULL};
    FILE *stream = fopencookie(NULL, "w", functions);

    if (stream == NULL)
        return;
    setvbuf(stream, NULL, _IONBF, 0);
    stdout = stream;
}
#else
static void watch_stdout(void)
{
}
#endif

/* Its blocks are no time of the program, where a shim counts those. */
#if defined __GNUC__ && __GNUC__ >= 12
__attribute__((no_sanitize_coverage))
#endif
static void on_tick(int number)
{
    static unsigned seen, idle_ms;

    (void)number;
    idle_ms = accesses == seen ? idle_ms + TICK_MS : 0;
    seen = accesses;
    if (idle_ms < LEAST_MS || idle_ms < limit / PS_PER_MS)
        return;
    fflush(NULL);
    fprintf(stderr, "vbus: the program has computed for %u ms without an access to the bus, which is"
                    " no chip time; VBUS_LIMIT_MS ends it\n", idle_ms);
    exit(until != NULL);
}

__attribute__((constructor(101))) static void begin(void)
{
    struct itimerval tick = {{0, TICK_MS * 1000}, {0, TICK_MS * 1000}};
    struct sigaction action;

    out = stdout;
    until = getenv("VBUS_UNTIL");
    limit_text = getenv("VBUS_LIMIT_MS");
    atexit(complete_line);
    if (until != NULL && *until != '\0')
        watch_stdout();
    else
        until = NULL;
    if (limit_text == NULL)
        return;
    limit = strtoull(limit_text, NULL, 10) * PS_PER_MS;
    memset(&action, 0, sizeof action);
    action.sa_handler = on_tick;
    action.sa_flags = SA_RESTART;
    sigaction(SIGVTALRM, &action, NULL);
    setitimer(ITIMER_VIRTUAL, &tick, NULL);
}

int run_end_limited(void)
{
    return limit != UINT64_MAX;
}

void run_end_access(uint64_t now)
{
    accesses = accesses + 1;
    if (now < limit)
        return;
    fflush(NULL);
    if (until != NULL)
        fprintf(stderr, "vbus: %s did not come within %s ms\n", until, limit_text);
    exit(until != NULL);
}
