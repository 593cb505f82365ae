/* listen.c - interrupts in real time, where they come while the program waits in the kernel.
 * License: Apache-2.0.
 *
 * A thread with a session of its own, which does nothing on the bus, hears of each edge of the line.
 * The signal it sends and the descriptor it makes readable end the program's waits as on a real card.
 * The program's own session hears of them too: an access comes after the interrupts before it, however
 * late this thread has its turn.
 */
#define _GNU_SOURCE
#include "listen.h"

#include "../vbus.h"
#include "card.h"
#include "sys.h"
#include "trap.h"

#include <pthread.h>
#include <stdlib.h>
#include <sys/resource.h>

static struct vbus line;
static volatile int listening;
static int active;

static void on_edge(void *context, uint32_t outputs, uint64_t instant)
{
    (void)context;
    card_hear(&active, outputs, instant);
    card_notice();
}

static void *hear(void *data)
{
    int error;

    (void)data;
    do
        error = vbus_wait_event(&line, -1);
    while (error >= 0);
    card_say("the board is gone: %s", vbus_strerror(error));
    card_end(4);
}

void listen_begin(void)
{
    static int (*real)(pthread_t *, const pthread_attr_t *, void *(*)(void *), void *);
    const char *where = getenv("VBUS_LINK");
    uint32_t outputs = 0;
    pthread_attr_t attributes;
    pthread_t thread;
    sigset_t before;
    int error, fd;

    if (listening)
        return;
    listening = 1;
    error = where == NULL ? VBUS_E_WHERE : vbus_open(&line, where);
    line.timeout_ms = REPLY_MS;
    fd = error < 0 ? -1 : (int)syscall(SYS_fcntl, line.fd, F_DUPFD_CLOEXEC, 800);
    if (fd >= 0) {
        sys_close(line.fd);
        line.fd = fd;
    }
    line.on_event = on_edge;
    if (error >= 0)
        error = vbus_events(&line, card.lines);
    if (error >= 0)
        error = vbus_sync(&line, &outputs, NULL);
    if (error < 0) {
        card_say("the board is gone: %s", vbus_strerror(error));
        card_end(4);
    }
    line.timeout_ms = -1;
    if (!active && card_interrupting(outputs)) {
        active = 1;
        card_interrupt();
    }
    if (real == NULL)
        *(void **)&real = dlsym(RTLD_NEXT, "pthread_create");
    pthread_attr_init(&attributes);
    pthread_attr_setdetachstate(&attributes, PTHREAD_CREATE_DETACHED);
    sys_block(&before);
    real(&thread, &attributes, hear, NULL);
    sys_restore(&before);
    pthread_attr_destroy(&attributes);
}

int listen_owns(int fd)
{
    return listening && fd == line.fd && fd >= 0;
}

void listen_forget(void)
{
    if (listening)
        sys_close(line.fd);
    listening = active = 0;
}
