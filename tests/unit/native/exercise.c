/* Calls the C client as its arguments say, and prints what comes back.
 *
 *     exercise WHERE [call arguments...]...      WHERE may be "fd:N"
 */
#ifndef _XOPEN_SOURCE
#define _XOPEN_SOURCE 700
#endif

#include "vbus.h"

#include <inttypes.h>
#include <signal.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/time.h>

static struct vbus bus;
static volatile sig_atomic_t signals_seen;
static char **next;

static unsigned number(void)
{
    return (unsigned)strtoul(*next++, NULL, 16);
}

static void print(const char *call, int result)
{
    if (result < 0)
        printf("%s: %s", call, vbus_strerror(result));
    else
        printf("%s %x", call, (unsigned)result);
}

static void on_event(void *context, uint32_t outputs, uint64_t instant)
{
    printf("%s %" PRIx32 " at %" PRIu64 "\n", (const char *)context, outputs, instant);
}

static void on_signal(int number_of_signal)
{
    (void)number_of_signal;
    signals_seen = 1;
}

/* From now on a signal comes every millisecond and interrupts system calls. */
static void interrupt_calls(void)
{
    struct itimerval often = {{0, 1000}, {0, 1000}};
    struct sigaction action;

    memset(&action, 0, sizeof action);
    action.sa_handler = on_signal;
    sigaction(SIGALRM, &action, NULL);
    setitimer(ITIMER_REAL, &often, NULL);
}

static int writes(void)
{
    unsigned address = number();
    const char *text = *next++;

    return vbus_writes(&bus, address, (unsigned)strlen(text), (const unsigned char *)text);
}

static void run(const char *call)
{
    unsigned char bytes[300];
    uint64_t instant = 0;
    uint32_t outputs = 0;
    unsigned a, b;
    int result, turn;

    if (strcmp(call, "read") == 0)
        print(call, vbus_read(&bus, number()));
    else if (strcmp(call, "write") == 0)
        a = number(), print(call, vbus_write(&bus, a, number()));
    else if (strcmp(call, "reads") == 0) {
        a = number();
        b = number();
        print(call, result = vbus_reads(&bus, a, b, bytes));
        for (turn = 0; result == 0 && turn < (int)b; turn++)
            printf(" %02x", bytes[turn]);
    } else if (strcmp(call, "writes") == 0)
        print(call, writes());
    else if (strcmp(call, "select") == 0)
        print(call, vbus_select(&bus, number()));
    else if (strcmp(call, "claim") == 0)
        print(call, vbus_claim(&bus));
    else if (strcmp(call, "unclaim") == 0)
        print(call, vbus_unclaim(&bus));
    else if (strcmp(call, "wait") == 0) {
        print(call, vbus_wait(&bus, number() * VBUS_US, &instant));
        printf(" at %" PRIu64, instant);
    } else if (strcmp(call, "buffer") == 0)
        vbus_buffer(&bus), print(call, 0);
    else if (strcmp(call, "flush") == 0)
        print(call, vbus_flush(&bus));
    else if (strcmp(call, "ask") == 0)
        print(call, vbus_ask_read(&bus, number()));
    else if (strcmp(call, "take") == 0)
        print(call, vbus_take_read(&bus));
    else if (strcmp(call, "lines") == 0)
        a = number(), print(call, vbus_lines(&bus, a, number()));
    else if (strcmp(call, "drive") == 0)
        print(call, vbus_drive(&bus, number()));
    else if (strcmp(call, "release") == 0)
        print(call, vbus_release(&bus));
    else if (strcmp(call, "sample") == 0) {
        print(call, vbus_sample(&bus, &outputs));
        printf(" %" PRIx32, outputs);
    } else if (strcmp(call, "pin") == 0)
        a = number(), print(call, vbus_pin(&bus, a, number()));
    else if (strcmp(call, "getpin") == 0)
        print(call, vbus_getpin(&bus, number()));
    else if (strcmp(call, "delay") == 0)
        print(call, vbus_delay(&bus, number() * VBUS_US));
    else if (strcmp(call, "at") == 0)
        print(call, vbus_at(&bus, number() * VBUS_US));
    else if (strcmp(call, "now") == 0) {
        print(call, vbus_now(&bus, &instant));
        printf(" at %" PRIu64, instant);
    } else if (strcmp(call, "sync") == 0) {
        print(call, vbus_sync(&bus, &outputs, &instant));
        printf(" %" PRIx32 " until %" PRIu64, outputs, instant);
    } else if (strcmp(call, "nulls") == 0) {
        print("wait", vbus_wait(&bus, VBUS_US, NULL));
        print(" sample", vbus_sample(&bus, NULL));
        print(" sync", vbus_sync(&bus, &outputs, NULL));
        print(" sync", vbus_sync(&bus, NULL, &instant));
        print(" pass", vbus_pass(&bus, VBUS_US, NULL, NULL));
        printf(" %" PRIx32 " until %" PRIu64, outputs, instant);
    } else if (strcmp(call, "echo") == 0)
        print(call, vbus_echo(&bus, number()));
    else if (strcmp(call, "events") == 0)
        print(call, vbus_events(&bus, number()));
    else if (strcmp(call, "event") == 0)
        print(call, vbus_wait_event(&bus, (int)number()));
    else if (strcmp(call, "hello") == 0) {
        print(call, vbus_hello(&bus, bytes, 9));
        printf(" %.7s", (const char *)bytes + 2);
    } else if (strcmp(call, "number") == 0) {
        const char *list = *next++;

        print(call, vbus_number(&bus, list, *next++));
    } else if (strcmp(call, "timeout") == 0)
        bus.timeout_ms = (int)number(), print(call, 0);
    else if (strcmp(call, "leases") == 0)
        print(call, vbus_leases(&bus, (int)number()));
    else if (strcmp(call, "signals") == 0)
        interrupt_calls(), print(call, 0);
    else if (strcmp(call, "interrupted") == 0)
        print(call, signals_seen);
    else if (strcmp(call, "refused") == 0)
        print(call, (int)bus.refused);
    else if (strcmp(call, "pause") == 0)
        print(call, getchar());
    else
        printf("%s?", call);
    printf("\n");
    fflush(stdout);
}

int main(int count, char **arguments)
{
    const char *where = arguments[1];
    int error;

    (void)count;
    if (strncmp(where, "fd:", 3) == 0)
        error = vbus_attach(&bus, atoi(where + 3));
    else if (strcmp(where, "unset") == 0)
        error = vbus_open(&bus, NULL);
    else
        error = vbus_open(&bus, where);
    if (error < 0) {
        printf("%s", vbus_strerror(error));
        if (error == VBUS_E_SYSTEM)
            printf(": %s", strerror(bus.system));
        printf("\n");
        return 1;
    }
    bus.on_event = on_event;
    bus.context = (void *)"event";
    for (next = arguments + 2; *next != NULL;)
        run(*next++);
    vbus_close(&bus);
    return 0;
}
