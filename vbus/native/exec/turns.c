/* turns.c - where time is virtual, one thread of the program runs at a time. License: Apache-2.0.
 *
 * The thread that has the turn runs. It is given away at bus accesses, looks at clocks and waits
 * only, to the next ready thread in order of creation, or to one that a seed draws; so what threads do
 * to each other is the same in every run. While none is ready the last one to wait lets the chips'
 * time pass, to the next instant at which one is. A wait is never one of the kernel's: it is a place
 * in the table below.
 */
#define _GNU_SOURCE
#include "turns.h"

#include "card.h"
#include "clock.h"
#include "files.h"
#include "signals.h"
#include "sys.h"
#include "timers.h"
#include "trap.h"

#include <errno.h>
#include <limits.h>
#include <linux/futex.h>
#include <stdio.h>
#include <stdlib.h>
#include <sys/stat.h>

#define MOST_SETS 1024
#define GRACE_MS 1   /* of wall time, for what other processes send */
#define DOZE_MS 10   /* between looks where nothing of ours can happen */
#define RESCUE_MS 50 /* after which a turn that sleeps in the kernel is taken away */
#define SPINS 256    /* calls of others after which one that looks at memory has its turn */
#define SOUND_SLEEP 3 /* looks in a row that find a thread asleep */

static struct guest guests[MOST_GUESTS];
static volatile unsigned places, living, last_number, last_wait;
static struct guest *volatile holder;
static int on;
static volatile unsigned entries;
static unsigned spinning; /* those who wait for memory */
static __thread struct guest *mine __attribute__((tls_model("initial-exec")));
static pthread_key_t leaving;

int turns_on(void)
{
    return on;
}

int turns_many(void)
{
    return on && living > 1;
}

struct guest *turns_holder(void)
{
    return holder;
}

unsigned turns_entries(void)
{
    return entries;
}

struct guest *turns_self(void)
{
    return mine;
}

/* --- the table -------------------------------------------------------------------------------- */

struct guest *turns_add(void)
{
    unsigned place;

    for (place = 0; place < MOST_GUESTS; place++) {
        struct guest *guest = &guests[place];
        unsigned free_place = 0;

        if (!__atomic_compare_exchange_n(&guest->number, &free_place, UINT_MAX, 0, __ATOMIC_SEQ_CST,
                                         __ATOMIC_SEQ_CST))
            continue;
        guest->state = OUTSIDE;
        guest->inside = guest->detached = guest->rounds = guest->asynchronous = 0;
        guest->kept = 0;
        guest->cancelled = guest->ended = 0;
        guest->wait = NULL;
        guest->trapped = NULL;
        guest->tid = 0;
        if (place >= places)
            places = place + 1;
        __atomic_add_fetch(&living, 1, __ATOMIC_SEQ_CST);
        guest->number = __atomic_add_fetch(&last_number, 1, __ATOMIC_SEQ_CST);
        return guest;
    }
    card_say("more than %d threads at once are not supported where time is virtual", MOST_GUESTS);
    return NULL;
}

void turns_drop(struct guest *guest)
{
    if (!guest->ended)
        __atomic_sub_fetch(&living, 1, __ATOMIC_SEQ_CST);
    guest->number = 0;
}

struct guest *turns_next(const struct guest *after)
{
    struct guest *found = NULL;
    unsigned place;

    for (place = 0; place < places; place++) {
        struct guest *guest = &guests[place];

        if (guest->number != 0 && guest->number != UINT_MAX && !guest->ended
            && (after == NULL || guest->number > after->number)
            && (found == NULL || guest->number < found->number))
            found = guest;
    }
    return found;
}

struct guest *turns_find(pthread_t thread)
{
    unsigned place;

    for (place = 0; place < places; place++)
        if (guests[place].number != 0 && guests[place].tid != 0
            && pthread_equal(guests[place].thread, thread))
            return &guests[place];
    return NULL;
}

/* A thread that was not started through us is known from its first call on. */
static struct guest *me(void)
{
    if (mine == NULL) {
        struct guest *guest = turns_add();

        if (guest == NULL)
            card_end(1);
        guest->thread = pthread_self();
        guest->tid = (pid_t)syscall(SYS_gettid);
        mine = guest;
        if (living > 1)
            pthread_setspecific(leaving, guest);
    }
    return mine;
}

/* --- the turn --------------------------------------------------------------------------------- */

static void doze(volatile int *word, int seen, unsigned ms)
{
    struct timespec longest = {ms / 1000, (long)(ms % 1000) * 1000000};

    syscall(SYS_futex, word, FUTEX_WAIT_PRIVATE, seen, &longest, NULL, 0);
}

static void wake(struct guest *guest)
{
    __atomic_add_fetch(&guest->go, 1, __ATOMIC_SEQ_CST);
    syscall(SYS_futex, &guest->go, FUTEX_WAKE_PRIVATE, 1, NULL, NULL, 0);
}

static void pass_to(struct guest *guest)
{
    __atomic_store_n(&holder, guest, __ATOMIC_SEQ_CST);
    wake(guest);
}

static int seize(struct guest *from, struct guest *to)
{
    return __atomic_compare_exchange_n(&holder, &from, to, 0, __ATOMIC_SEQ_CST, __ATOMIC_SEQ_CST);
}

#define ROOM 256

static void ask_kernel(const struct guest *guest, const char *what, char text[ROOM])
{
    char path[48];
    ssize_t size;
    int fd;

    snprintf(path, sizeof path, "/proc/self/task/%d/%s", (int)guest->tid, what);
    fd = sys_open(path, O_RDONLY | O_CLOEXEC);
    size = fd < 0 ? 0 : sys_read(fd, text, ROOM - 1);
    if (fd >= 0)
        sys_close(fd);
    text[size > 0 ? size : 0] = '\0';
}

/* What the kernel says a thread does: 'R', 'S', 'D' ..., or 0. */
static char doing(const struct guest *guest)
{
    char text[ROOM], *end;

    ask_kernel(guest, "stat", text);
    end = strrchr(text, ')');
    return end != NULL && end[1] == ' ' ? end[2] : 0;
}

/* Whether a thread prints, and it is not this process that reads it: the reader is waited for, however
 * slow. */
static int prints(const struct guest *guest)
{
    char text[ROOM], *first;
    struct stat out, other;
    long call;
    int to, fd;

    ask_kernel(guest, "syscall", text);
    call = strtol(text, &first, 10);
    to = (int)strtol(first, NULL, 16);
    if ((call != SYS_write && call != SYS_writev) || (to != 1 && to != 2) || fstat(to, &out) != 0)
        return 0;
    for (fd = 0; fd < MOST_SETS; fd++)
        if (fstat(fd, &other) == 0 && other.st_dev == out.st_dev && other.st_ino == out.st_ino
            && S_ISFIFO(out.st_mode) && (syscall(SYS_fcntl, fd, F_GETFL) & O_ACCMODE) == O_RDONLY)
            return 0;
    return 1;
}

/* The turn of a thread that sleeps in a system call of which we know nothing goes on without it. */
static void rescue(struct guest *to)
{
    struct guest *stuck = holder;
    int turn, runs = RUNS;

    if (stuck == NULL || stuck->state != RUNS || stuck->inside > 0 || stuck->trapped != NULL)
        return; /* one that has been given the turn, and not yet woken, sleeps too */
    for (turn = 0; turn < SOUND_SLEEP; turn++) {
        char now = doing(stuck);

        if (holder != stuck || stuck->inside > 0 || (now != 'S' && now != 0))
            return;
        sys_poll(NULL, 0, GRACE_MS);
    }
    if (prints(stuck) || !seize(stuck, to))
        return;
    if (__atomic_load_n(&stuck->inside, __ATOMIC_SEQ_CST) == 0)
        __atomic_compare_exchange_n(&stuck->state, &runs, OUTSIDE, 0, __ATOMIC_SEQ_CST,
                                    __ATOMIC_SEQ_CST);
    else if (seize(to, stuck)) /* it has just come back */
        wake(stuck);
}

static void await(struct guest *self)
{
    while (holder != self) {
        int seen = self->go;

        if (holder == self || seize(NULL, self))
            break;
        doze(&self->go, seen, RESCUE_MS);
        if (holder != self && self->go == seen)
            rescue(self);
    }
}

static unsigned rested; /* by entries, what vbus exec has the report of; 0: no thread's waits */

void turns_say_begun(void)
{
    if (card_wants_rest())
        card_say_rest(clock_follows() ? "0 1\nend\n" : "0 0\nend\n", 8);
    rested = 0;
}

void turns_stir(void)
{
    int error = errno;

    if (!rested)
        return;
    turns_say_begun();
    errno = error;
}

static void take(struct guest *self)
{
    if (holder == self)
        return;
    self->state = READY;
    await(self);
    self->state = RUNS;
}

struct guest *turns_enter(void)
{
    struct guest *self = me();

    if (__atomic_fetch_add(&self->inside, 1, __ATOMIC_SEQ_CST) == 0 && on)
        take(self);
    entries++;
    return self;
}

void turns_leave(void)
{
    struct guest *self = mine;

    turns_stir();
    if (--self->inside == 0 && self->kept > 0)
        signals_run(self);
}

/* --- who is ready ----------------------------------------------------------------------------- */

int64_t turns_now(void)
{
    struct timespec now;

    if (clock_follows())
        return clock_compare(CLOCK_MONOTONIC);
    sys_clock_gettime(CLOCK_MONOTONIC, &now);
    return (int64_t)now.tv_sec * NS + now.tv_nsec;
}

/* Whether a descriptor is ready. Where none but ours are waited for, the kernel is asked only when
 * that may have changed: a thread that sleeps costs another's accesses nothing. */
static int finds(struct wait *wait)
{
    unsigned changes = files_changes();

    if (wait->count == 0 || wait->looked == changes)
        return 0;
    if (sys_poll(wait->set, wait->count, 0) != 0)
        return 1;
    wait->looked = files_inner(wait->set, wait->count) ? changes : 0;
    return 0;
}

static int ending_of(struct guest *guest, int64_t now, int alone)
{
    struct wait *wait = guest->wait;

    if (wait == NULL)
        return INTERRUPTED;
    if (wait->told || (wait->spins && entries - wait->entries >= (alone ? 1 : SPINS)))
        return TOLD;
    if (finds(wait))
        return FOUND;
    if (wait->until <= now)
        return LATE;
    return guest->kept > 0 || (guest->cancelled && !wait->steady) ? INTERRUPTED : -1;
}

static int is_ready(struct guest *guest, int64_t now, int alone)
{
    return guest->state == READY || guest->state == RUNS
           || (guest->state == WAITS && ending_of(guest, now, alone) >= 0);
}

/* One of those that are ready, as the seed draws it; or NULL. Of the same calls the draw is the same, so a
 * look at who is ready, which waits for other processes make more or less often, changes none. */
static struct guest *drawn_ready(int64_t now, int alone)
{
    struct guest *ready[MOST_GUESTS], *guest;
    unsigned count = 0, draw = (entries ^ card.order * 0x9E3779B9u) * 0x85EBCA6Bu;

    for (guest = turns_next(NULL); guest != NULL; guest = turns_next(guest))
        if (is_ready(guest, now, alone))
            ready[count++] = guest;
    draw = (draw ^ draw >> 15) * 0xC2B2AE35u;
    return count == 0 ? NULL : ready[(draw ^ draw >> 16) % count];
}

/* The next that is ready after `self`, itself last; or NULL. */
static struct guest *next_ready(struct guest *self)
{
    int64_t now = turns_now();
    struct guest *guest;
    int alone;

    for (alone = 0; alone < 2; alone++) { /* those who only look at memory come last */
        if (card.order != 0) {
            guest = drawn_ready(now, alone);
            if (guest != NULL || !spinning)
                return guest;
            continue;
        }
        for (guest = turns_next(self); guest != NULL; guest = turns_next(guest))
            if (is_ready(guest, now, alone))
                return guest;
        for (guest = turns_next(NULL); guest != NULL && guest->number <= self->number;
             guest = turns_next(guest))
            if (is_ready(guest, now, alone))
                return guest;
        if (!spinning)
            break;
    }
    return NULL;
}

/* --- while nobody is ready -------------------------------------------------------------------- */

static struct pollfd every[MOST_SETS];

/* Whether anybody outside this process, or in a call of the kernel's, may end a wait; and whether
 * a thread waits for what an interrupt brings. */
static int others(nfds_t *count, int *heeds)
{
    struct guest *guest;
    int found = 0;

    *count = 0;
    *heeds = card.signal != 0;
    for (guest = turns_next(NULL); guest != NULL; guest = turns_next(guest)) {
        struct wait *wait = guest->wait;

        if (guest->state == OUTSIDE || (wait != NULL && wait->shared))
            found = 1;
        if (guest->state != WAITS || wait == NULL)
            continue;
        *heeds |= wait->count > 0;
        found |= wait->count > 0 && !files_inner(wait->set, wait->count);
        if (wait->count <= MOST_SETS - *count) {
            memcpy(every + *count, wait->set, wait->count * sizeof *every);
            *count += wait->count;
        }
    }
    return found;
}

static unsigned rounds = 1; /* how often there was nothing to do but wait */

/* Those who look for themselves whether what they wait for has come: each once in a round. */
static void tell_shared(void)
{
    struct guest *guest;

    for (guest = turns_next(NULL); guest != NULL; guest = turns_next(guest))
        if (guest->state == WAITS && guest->wait != NULL && guest->wait->shared
            && guest->wait->asked != rounds) {
            guest->wait->asked = rounds;
            guest->wait->told = 1;
        }
}

/* Nothing of ours will change memory: threads that look at it may as well do so. */
static void tell_spinning(void)
{
    struct guest *guest;

    for (guest = turns_next(NULL); guest != NULL; guest = turns_next(guest))
        if (guest->state == WAITS && guest->wait != NULL && guest->wait->spins)
            guest->wait->told = 1;
}

static int someone_outside_runs(void)
{
    struct guest *guest;

    for (guest = turns_next(NULL); guest != NULL; guest = turns_next(guest)) {
        char now = guest->state == OUTSIDE ? doing(guest) : 0;

        if (now == 'R' || now == 'D')
            return 1;
    }
    return 0;
}

static int64_t least_left(void)
{
    int64_t now = turns_now(), least = timers_next();
    struct guest *guest;

    for (guest = turns_next(NULL); guest != NULL; guest = turns_next(guest))
        if (guest->state == WAITS && guest->wait != NULL && guest->wait->until < least)
            least = guest->wait->until;
    return least == FOR_EVER ? FOR_EVER : least > now ? least - now : 0;
}

static int glance(nfds_t count, int ms)
{
    int found = sys_poll(every, count, ms);

    tell_shared();
    return found != 0;
}

/* --- when nothing can come -------------------------------------------------------------------- */

/* Whether timers are ours, and a line for each thread: what it waits for, by a letter and its
 * descriptors. It holds until one goes on with the program; one that asks on and on does not. */
static void say_rest(void)
{
    static char text[MOST_GUESTS * 24 + 4096];
    size_t size;
    struct guest *guest;

    if (rested == entries || !card_wants_rest())
        return;
    size = (size_t)snprintf(text, sizeof text, "%u %d\n", entries, clock_follows());
    for (guest = turns_next(NULL); guest != NULL; guest = turns_next(guest)) {
        const struct wait *wait = guest->wait;
        char kind = guest->state != WAITS || wait == NULL ? 'k' : wait->shared == BY_SIGNAL ? 'w'
                    : wait->shared ? 's' : 'w';
        nfds_t turn;

        size += (size_t)snprintf(text + size, 24, "%d %c", (int)guest->tid, kind);
        for (turn = 0; kind != 'k' && turn < wait->count; turn++)
            if (wait->set[turn].fd >= 0) {
                if (size > sizeof text - 64)
                    return;
                size += (size_t)snprintf(text + size, 24, " %d/%d", wait->set[turn].fd,
                                         wait->set[turn].events);
            }
        if (size > sizeof text - 64)
            return;
        text[size++] = '\n';
    }
    memcpy(text + size, "end\n", 4);
    card_say_rest(text, size + 4);
    rested = entries;
}

static void idle(struct guest *self)
{
    int64_t left = least_left();
    nfds_t count;
    int heeds, outer = others(&count, &heeds);

    files_changed(); /* there is time to look anew */
    if (left == 0) {
        timers_fire();
        return;
    }
    if (!clock_follows()) {
        rounds++;
        if (left == FOR_EVER && !heeds && !spinning)
            say_rest();
        glance(count, left > DOZE_MS * 1000000 ? DOZE_MS : (int)(left / 1000000));
        return;
    }
    if (outer) {
        if (glance(count, GRACE_MS) || someone_outside_runs() || next_ready(self) != NULL)
            return;
    }
    rounds++;
    if (card_leap(left, heeds)) {
        timers_fire();
    } else {
        card_check();
        if (!spinning)
            say_rest();
        glance(count, DOZE_MS);
        tell_spinning();
    }
}

/* The caller cannot go on: a thread that can has the turn next. */
static void schedule(struct guest *self)
{
    for (;;) {
        struct guest *next = next_ready(self);

        if (next == self)
            return;
        if (next != NULL) {
            pass_to(next);
            await(self);
            return;
        }
        idle(self);
    }
}

/* --- giving it away --------------------------------------------------------------------------- */

static int hand_over(struct guest *self)
{
    struct guest *next;

    if (living < 2)
        return 0;
    self->state = READY;
    next = next_ready(self);
    if (next != self && next != NULL) {
        pass_to(next);
        await(self);
    }
    self->state = RUNS;
    return next != self;
}

void turns_offer(void)
{
    if (on)
        hand_over(me());
}

void turns_yield(void)
{
    struct guest *self = turns_enter();

    if (!hand_over(self) && clock_follows() && (living > 1 || timers_next() != FOR_EVER
                                                || card.signal))
        card_look();
    card_notice();
    turns_leave();
}

enum ending turns_wait(struct wait *wait)
{
    struct guest *self = mine;
    int ending;

    wait->told = 0;
    wait->looked = 0;
    wait->since = ++last_wait;
    wait->entries = entries;
    spinning += (unsigned)wait->spins;
    self->wait = wait;
    self->state = WAITS;
    do {
        schedule(self);
        ending = ending_of(self, turns_now(), 1);
    } while (ending < 0);
    self->state = RUNS;
    self->wait = NULL;
    spinning -= (unsigned)wait->spins;
    return (enum ending)ending;
}

enum after turns_interrupt(void)
{
    struct guest *self = mine;
    int inside = self->inside;
    enum after after;

    turns_stir();
    self->inside = 0;
    after = signals_run(self);
    if (self->cancelled) {
        self->cancelled = 0;
        pthread_testcancel(); /* if it is not for now, the C library keeps it in mind */
    }
    self->inside = inside;
    return after;
}

unsigned turns_tell(const void *object, unsigned most)
{
    unsigned done = 0;

    while (done < most) {
        struct guest *guest, *first = NULL;

        for (guest = turns_next(NULL); guest != NULL; guest = turns_next(guest)) {
            struct wait *wait = guest->wait;

            if (wait != NULL && !wait->told && wait->object == object
                && (first == NULL || wait->since < first->wait->since))
                first = guest;
        }
        if (first == NULL)
            break;
        first->wait->told = 1;
        done++;
    }
    return done;
}

unsigned turns_waiting(const void *object)
{
    struct guest *guest;
    unsigned count = 0;

    for (guest = turns_next(NULL); guest != NULL; guest = turns_next(guest))
        count += guest->wait != NULL && !guest->wait->told && guest->wait->object == object;
    return count;
}

/* To one who is ready, or else to one who waits and will look after time meanwhile. */
static void let_go(struct guest *self)
{
    struct guest *next = next_ready(self), *guest;

    for (guest = turns_next(NULL); next == NULL && guest != NULL; guest = turns_next(guest))
        if (guest != self && guest->state == WAITS)
            next = guest;
    if (next != NULL) {
        pass_to(next);
        return;
    }
    __atomic_store_n(&holder, NULL, __ATOMIC_SEQ_CST);
    for (guest = turns_next(NULL); guest != NULL; guest = turns_next(guest))
        if (guest->state == READY && seize(NULL, guest)) {
            pass_to(guest);
            return;
        }
}

void turns_go_out(void)
{
    struct guest *self = me();

    if (on && holder == self) {
        self->state = OUTSIDE;
        let_go(self);
    }
}

void turns_come_back(void)
{
    if (on)
        take(me());
    turns_stir();
}

/* --- beginning and end of threads ------------------------------------------------------------- */

/* Called again and again by the C library, so that what the program wants done at a thread's end
 * comes first. */
static void end_thread(void *data)
{
    struct guest *self = data;

    if (++self->rounds < PTHREAD_DESTRUCTOR_ITERATIONS) {
        pthread_setspecific(leaving, self);
        return;
    }
    sys_block(NULL);
    turns_enter();
    self->ended = 1;
    self->state = ENDED;
    __atomic_sub_fetch(&living, 1, __ATOMIC_SEQ_CST);
    turns_tell(self, UINT_MAX);
    tell_shared(); /* a robust mutex may have lost its owner */
    if (on)
        let_go(self);
    if (self->detached || !on)
        self->number = 0;
}

void *turns_run(void *data)
{
    struct guest *self = data;

    mine = self;
    self->thread = pthread_self();
    __atomic_store_n(&self->tid, (pid_t)syscall(SYS_gettid), __ATOMIC_RELEASE);
    pthread_setspecific(leaving, self);
    await(self);
    self->state = RUNS;
    return self->routine(self->argument);
}

/* Its number in the kernel is known then. */
void turns_await_start(const struct guest *guest)
{
    while (*(volatile const pid_t *)&guest->tid == 0)
        syscall(SYS_sched_yield);
}

void turns_alone(void)
{
    struct guest *self = me();
    unsigned place;

    for (place = 0; place < places; place++)
        if (&guests[place] != self)
            guests[place].number = 0;
    turns_say_begun();
    self->tid = (pid_t)syscall(SYS_gettid);
    living = 1;
    holder = self;
}

void turns_start(void)
{
    struct guest *self = me();

    on = card.virtual_time;
    self->state = RUNS;
    holder = self;
    pthread_key_create(&leaving, end_thread);
    pthread_setspecific(leaving, self);
}
