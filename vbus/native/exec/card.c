/* card.c - see card.h. License: Apache-2.0. */
#define _GNU_SOURCE
#include "card.h"

#include "../vbus.h"
#include "clock.h"
#include "files.h"
#include "listen.h"
#include "signals.h"
#include "sys.h"
#include "timers.h"
#include "trap.h"
#include "turns.h"

#include <stdarg.h>
#include <stdlib.h>
#include <sys/resource.h>

#define MOST_PORTS 1024
#define MOST_CHIPS 16
#define MOST_REPORTS 16
#define NO_LINK 4
#define LAST_TRIES 1000 /* milliseconds that another thread has for the rest of a cycle */
#define PS_PER_NS 1000u
#define FLOATING 0xFF
#define STEP_PS UINT64_C(10000000000) /* between looks where nothing is in sight */

struct port {
    uintptr_t address;
    unsigned char chip, chip_address, floating;
    unsigned char answers;      /* whether a chip does */
    unsigned char acknowledges; /* whether side pin `pin` is pulsed low after the access */
    unsigned char pin;
};

struct card_settings card;

static struct {
    struct port ports[MOST_PORTS];
    unsigned count;
} reads, writes;

static struct vbus bus;
static int open_session, slaved;
static int shared; /* other processes use the card too, each with a clock of its own */
static unsigned selected;
static uint64_t cycles[MOST_CHIPS], clock_step;
static uint64_t elapsed;  /* virtual time since it began (ps) */
static uint64_t limit = UINT64_MAX; /* what it may take, once reported; beyond it, report */
static uint64_t owed;     /* of that, not yet reported to the board (lockstep) */
static uint64_t board_at; /* what the board's clock showed when ours showed 0 (slaved) */
static uint64_t begun_ps;
static int watching, line_active;
static volatile uint32_t interrupts;
static volatile uint32_t noticed; /* interrupts the program has had a signal for */
static uint64_t last_rise;        /* of those that a session has reported */
static volatile int telling;      /* a thread holds these three */
static uint64_t quiet_until; /* virtual time (ps) before which the line does not move by itself */
static uintptr_t current_ip;
static volatile pid_t lock; /* the thread that has it */
static volatile int ending; /* the program dies, and what is held back goes first */

/* --- messages --------------------------------------------------------------------------------- */

static size_t add(char *text, size_t size, size_t room, const char *part)
{
    while (*part != '\0' && size < room)
        text[size++] = *part++;
    return size;
}

static size_t add_number(char *text, size_t size, size_t room, uintptr_t value, unsigned base)
{
    char digits[24];
    size_t place = sizeof digits;

    digits[--place] = '\0';
    do {
        digits[--place] = "0123456789abcdef"[value % base];
        value /= base;
    } while (value > 0);
    return add(text, size, room, digits + place);
}

void card_say(const char *format, ...)
{
    char text[600];
    size_t size = add(text, 0, sizeof text - 1, "vbus exec: ");
    va_list rest;

    va_start(rest, format);
    for (; *format != '\0' && size < sizeof text - 1; format++) {
        if (*format != '%') {
            text[size++] = *format;
        } else if (*++format == 's') {
            size = add(text, size, sizeof text - 1, va_arg(rest, const char *));
        } else if (*format == 'x') {
            size = add_number(text, size, sizeof text - 1, va_arg(rest, uintptr_t), 16);
        } else {
            size = add_number(text, size, sizeof text - 1, (unsigned)va_arg(rest, int), 10);
        }
    }
    va_end(rest);
    text[size++] = '\n';
    sys_write(2, text, size);
}

_Noreturn void card_end(int code)
{
    for (;;)
        syscall(SYS_exit_group, code);
}

static char note[512]; /* the file that takes the word */

void card_note(void)
{
    int fd = note[0] == '\0' ? -1
                             : (int)syscall(SYS_openat, AT_FDCWD, note, O_CREAT | O_WRONLY, 0600);

    if (fd >= 0)
        sys_close(fd);
}

int card_wants_rest(void)
{
    return note[0] != '\0' && limit != UINT64_MAX;
}

void card_say_rest(const char *text, size_t size)
{
    char path[sizeof note + 24];
    int fd;

    snprintf(path, sizeof path, "%s.%d", note, (int)getpid());
    if (text == NULL) {
        if (card_wants_rest())
            syscall(SYS_unlinkat, AT_FDCWD, path, 0);
        return;
    }
    fd = (int)syscall(SYS_openat, AT_FDCWD, path, O_CREAT | O_WRONLY | O_TRUNC | O_CLOEXEC, 0600);
    if (fd >= 0) {
        sys_write(fd, text, size);
        sys_close(fd);
    }
}

void card_say_place(const char *before, uintptr_t ip, const char *after)
{
    Dl_info info;

    if (ip != 0 && dladdr((void *)ip, &info) != 0 && info.dli_fname != NULL)
        card_say("%s instruction at 0x%x (%s+0x%x)%s", before, ip, info.dli_fname,
                 ip - (uintptr_t)info.dli_fbase, after);
    else
        card_say("%s instruction at 0x%x%s", before, ip, after);
}

/* Say which addresses answer reads, or writes, as ranges. */
static void say_mapped(int write)
{
    const struct port *ports = write ? writes.ports : reads.ports;
    unsigned count = write ? writes.count : reads.count;
    char text[256];
    size_t size = 0;
    unsigned turn, first;

    for (turn = 0; turn < count && size < sizeof text - 48; turn++) {
        first = turn;
        while (turn + 1 < count && ports[turn + 1].address == ports[turn].address + 1)
            turn++;
        size = add(text, size, sizeof text - 1, first > 0 ? ", 0x" : "0x");
        size = add_number(text, size, sizeof text - 1, ports[first].address, 16);
        if (turn > first) {
            size = add(text, size, sizeof text - 1, " to 0x");
            size = add_number(text, size, sizeof text - 1, ports[turn].address, 16);
        }
    }
    if (turn < count)
        size = add(text, size, sizeof text - 1, ", ...");
    text[size] = '\0';
    card_say("the card answers %s at %s", write ? "writes" : "reads", size > 0 ? text : "no address");
}

static void must(int error)
{
    if (error >= 0)
        return;
    card_say("the board is gone or refuses: %s",
             error == VBUS_E_SYSTEM ? strerror(bus.system) : vbus_strerror(error));
    if (current_ip != 0)
        card_say_place("it was needed by the", current_ip, "");
    card_end(NO_LINK);
}

/* Say once for each address that no chip is there. */
static void unanswered(uintptr_t address, unsigned size, int write, uintptr_t ip)
{
    static uintptr_t said[MOST_REPORTS];
    static unsigned count;
    unsigned turn;

    for (turn = 0; turn < count; turn++)
        if (said[turn] == address)
            return;
    if (count == MOST_REPORTS)
        return;
    said[count++] = address;
    card_say("no chip answers a %s of %d byte%s at %s 0x%x; %s", write ? "write" : "read", (int)size,
             size > 1 ? "s" : "", card.memory ? "address" : "port", address,
             write ? "it is lost" : "FFh is read");
    card_say_place("by the", ip, "");
    say_mapped(write);
    if (count == MOST_REPORTS)
        card_say("further addresses are not reported");
}

/* --- what vbus exec tells --------------------------------------------------------------------- */

static const char *setting(const char *text, const char *key)
{
    size_t size = strlen(key);

    while (text != NULL && *text != '\0') {
        if (strncmp(text, key, size) == 0 && text[size] == '=')
            return text + size + 1;
        text = strchr(text, ';');
        text = text == NULL ? NULL : text + 1;
    }
    return NULL;
}

static unsigned long long number_setting(const char *text, const char *key)
{
    const char *value = setting(text, key);

    return value == NULL ? 0 : strtoull(value, NULL, 0);
}

/* Read "r340=0.1/7F r344!5 w341=0.1!5 ..." up to the semicolon; the entries come sorted by address. */
static void read_card(const char *text)
{
    while (text != NULL && (*text == 'r' || *text == 'w')) {
        struct port port = {0, 0, 0, FLOATING, 0, 0, 0};
        int write = *text == 'w';
        char *end;

        port.address = strtoull(text + 1, &end, 16);
        port.answers = *end == '=';
        if (port.answers) {
            port.chip = (unsigned char)(strtoul(end + 1, &end, 16) % MOST_CHIPS);
            port.chip_address = (unsigned char)strtoul(end + 1, &end, 16);
            port.floating = *end == '/' ? (unsigned char)strtoul(end + 1, &end, 16) : 0;
        }
        port.acknowledges = *end == '!';
        if (port.acknowledges)
            port.pin = (unsigned char)strtoul(end + 1, &end, 16);
        if (card.end == 0 || port.address < card.first)
            card.first = port.address;
        if (port.address >= card.end)
            card.end = port.address + 1;
        if (write && writes.count < MOST_PORTS)
            writes.ports[writes.count++] = port;
        else if (!write && reads.count < MOST_PORTS)
            reads.ports[reads.count++] = port;
        text = *end == ' ' ? end + 1 : NULL;
    }
}

void card_read_settings(void)
{
    const char *text = getenv("VBUS_EXEC"), *policy = setting(text, "policy"), *next;
    unsigned turn;

    if (text == NULL || policy == NULL || getenv("VBUS_LINK") == NULL)
        return;
    card.present = 1;
    card.virtual_time = strncmp(policy, "realtime", 8) != 0;
    slaved = strncmp(policy, "slaved", 6) == 0;
    card.memory = number_setting(text, "memory") != 0;
    card.big = number_setting(text, "big") != 0;
    card.fixed = (uintptr_t)number_setting(text, "fixed");
    card.lines = (uint32_t)number_setting(text, "lines");
    card.low = (uint32_t)number_setting(text, "low");
    card.signal = (int)number_setting(text, "signal");
    card.edge = number_setting(text, "edge") != 0;
    card.order = (unsigned)number_setting(text, "order");
    next = setting(text, "note");
    if (next != NULL && strcspn(next, ";") < sizeof note)
        memcpy(note, next, strcspn(next, ";"));
    clock_step = number_setting(text, "step");
    if (number_setting(text, "limit") != 0)
        limit = number_setting(text, "limit");
    next = setting(text, "cycles");
    for (turn = 0; turn < MOST_CHIPS && next != NULL; turn++) {
        char *end;

        cycles[turn] = strtoull(next, &end, 10);
        next = *end == ',' ? end + 1 : NULL;
    }
    read_card(setting(text, "card"));
}

/* --- the session ------------------------------------------------------------------------------ */

static int take_lock(pid_t self)
{
    pid_t nobody = 0;

    return __atomic_compare_exchange_n(&lock, &nobody, self, 0, __ATOMIC_ACQUIRE, __ATOMIC_RELAXED);
}

static void await_lock(pid_t self)
{
    while (ending || !take_lock(self))
        syscall(SYS_sched_yield);
}

void card_enter(void)
{
    await_lock(turns_enter()->tid);
}

void card_leave(void)
{
    __atomic_store_n(&lock, 0, __ATOMIC_RELEASE);
    card_notice();
    turns_offer();
    turns_leave();
}

int card_interrupting(uint32_t outputs)
{
    return ((outputs ^ card.low) & card.lines) != 0;
}

void card_lock_interrupts(void)
{
    while (__atomic_exchange_n(&telling, 1, __ATOMIC_ACQUIRE))
        syscall(SYS_sched_yield);
}

void card_unlock_interrupts(void)
{
    __atomic_store_n(&telling, 0, __ATOMIC_RELEASE);
}

void card_hear(int *active, uint32_t outputs, uint64_t instant)
{
    int now = card_interrupting(outputs);

    card_lock_interrupts();
    if (now && !*active && (card.virtual_time || instant > last_rise)) {
        last_rise = instant;
        card_interrupt();
    }
    card_unlock_interrupts();
    *active = now;
}

static void on_event(void *context, uint32_t outputs, uint64_t instant)
{
    (void)context;
    card_hear(&line_active, outputs, instant);
}

/* Programs close low descriptors, or count on their numbers. */
static void lift_descriptor(void)
{
    struct rlimit limit;
    int least = 900, fd;

    if (getrlimit(RLIMIT_NOFILE, &limit) == 0 && limit.rlim_cur < 1000)
        least = limit.rlim_cur > 100 ? (int)limit.rlim_cur - 64 : 3;
    fd = fcntl(bus.fd, F_DUPFD_CLOEXEC, least);
    if (fd >= 0) {
        sys_close(bus.fd);
        bus.fd = fd;
    }
}

static void open_card(void)
{
    const char *where;
    uint64_t now = 0;
    int error;

    if (open_session)
        return;
    where = getenv("VBUS_LINK");
    error = where == NULL ? VBUS_E_WHERE : vbus_open(&bus, where);
    if (error < 0) {
        card_say("%s: %s", where == NULL ? "VBUS_LINK" : where,
                 error == VBUS_E_SYSTEM ? strerror(bus.system) : vbus_strerror(error));
        card_end(NO_LINK);
    }
    lift_descriptor();
    open_session = 1;
    selected = 1;
    bus.timeout_ms = REPLY_MS;
    bus.on_event = on_event;
    if (card.virtual_time) {
        card_begin_time();
        vbus_buffer(&bus);
        must(vbus_leases(&bus, 1));
        must(vbus_now(&bus, &now));
        board_at = now - begun_ps;
        owed = elapsed - begun_ps;
        begun_ps = elapsed;
        signals_last_words();
    }
    if (watching || card.signal) {
        watching = 0;
        card_watch();
    }
}

void card_forget(void)
{
    if (open_session)
        sys_close(bus.fd);
    open_session = 0;
    begun_ps = elapsed;
    quiet_until = 0;
    noticed = interrupts;
    card_unlock_interrupts();
    __atomic_store_n(&lock, 0, __ATOMIC_RELEASE);
}

int card_in_use(void)
{
    return open_session;
}

int card_owns(int fd)
{
    return open_session && fd == bus.fd && fd >= 0;
}

int card_descriptor(void)
{
    return open_session ? bus.fd : -1;
}

void card_step_aside(int fd)
{
    int other;

    if (!card_owns(fd))
        return;
    card_enter();
    other = (int)syscall(SYS_fcntl, fd, F_DUPFD_CLOEXEC, fd + 1);
    if (other < 0)
        other = (int)syscall(SYS_fcntl, fd, F_DUPFD_CLOEXEC, 3);
    if (other >= 0)
        bus.fd = other;
    card_leave();
}

void card_check(void)
{
    struct pollfd link = {bus.fd, POLLIN | POLLRDHUP, 0};

    if (open_session && sys_poll(&link, 1, 0) > 0 && link.revents & (POLLHUP | POLLRDHUP))
        must(VBUS_E_CLOSED);
}

unsigned card_requests(void)
{
    return bus.number;
}

void card_send(void)
{
    if (open_session)
        must(vbus_send(&bus));
}

void card_share(void)
{
    shared = 1;
    card_send();
}

static int holds_back(void)
{
    return bus.out_size > 0 || bus.lease_polls > 0 || bus.unsent_stamp;
}

void card_send_last(void)
{
    pid_t self = (pid_t)syscall(SYS_gettid);
    sigset_t before;
    unsigned turn;

    sys_block(&before);
    ending = 1;
    for (turn = 0; open_session && lock != self && holds_back() && turn < LAST_TRIES; turn++) {
        if (take_lock(self)) {
            vbus_send(&bus); /* a board that is gone is no news now */
            __atomic_store_n(&lock, 0, __ATOMIC_RELEASE);
            break;
        }
        sys_poll(NULL, 0, 1); /* who has it may wait for a processor */
    }
    ending = 0;
    sys_restore(&before);
}

/* Tell the board how much time has passed, before something happens. */
static void tell_time(void)
{
    if (!card.virtual_time)
        return;
    if (slaved)
        must(vbus_at(&bus, board_at + elapsed));
    else if (owed > 0)
        must(vbus_delay(&bus, owed));
    owed = 0;
}

static void spend(uint64_t ps);

/* What another process has done lies behind this one: a cycle is never before it (slaved). */
static void keep_up(void)
{
    uint64_t now;

    if (!slaved || !shared)
        return;
    must(vbus_now(&bus, &now));
    if (now > board_at + elapsed)
        board_at = now - elapsed;
}

static void begin_cycle(const struct port *port)
{
    unsigned mask = 1u << port->chip;

    keep_up();
    if (!port->answers) { /* a cycle all the same */
        spend(cycles[0]);
        tell_time();
        return;
    }
    if (mask != selected)
        must(vbus_select(&bus, mask));
    selected = mask;
    if (slaved)
        elapsed += cycles[port->chip];
    tell_time();
    if (!slaved)
        elapsed += cycles[port->chip];
}

/* What an access does on the card once the chip has had its cycle. */
static void end_cycle(const struct port *port)
{
    if (port->acknowledges) {
        must(vbus_pin(&bus, port->pin, 0));
        must(vbus_pin(&bus, port->pin, 2));
        if (!card.virtual_time || watching)
            must(vbus_echo(&bus, 0)); /* the line has let go */
    }
}

static const struct port *find(const struct port *ports, unsigned count, uintptr_t address)
{
    unsigned first = 0;

    while (count > 0) {
        unsigned half = count / 2;

        if (ports[first + half].address < address) {
            first += half + 1;
            count -= half + 1;
        } else {
            count = half;
        }
    }
    return ports + first;
}

void card_load(uintptr_t address, unsigned char *data, unsigned size, uintptr_t ip)
{
    unsigned turn, answers = 0;

    for (turn = 0; turn < size; turn++) {
        unsigned place = card.big ? size - 1 - turn : turn;
        const struct port *port = find(reads.ports, reads.count, address + turn);
        int byte;

        data[place] = FLOATING;
        if (port == reads.ports + reads.count || port->address != address + turn)
            continue;
        current_ip = ip;
        answers++;
        open_card();
        begin_cycle(port);
        byte = port->answers ? vbus_read(&bus, port->chip_address) : 0;
        must(byte);
        data[place] = (unsigned char)(byte | port->floating);
        end_cycle(port);
    }
    current_ip = 0;
    quiet_until = 0;
    if (answers == 0)
        unanswered(address, size, 0, ip);
}

void card_store(uintptr_t address, const unsigned char *data, unsigned size, uintptr_t ip)
{
    unsigned turn, answers = 0;

    for (turn = 0; turn < size; turn++) {
        const struct port *port = find(writes.ports, writes.count, address + turn);

        if (port == writes.ports + writes.count || port->address != address + turn)
            continue;
        current_ip = ip;
        answers++;
        open_card();
        begin_cycle(port);
        if (port->answers)
            must(vbus_write(&bus, port->chip_address, data[card.big ? size - 1 - turn : turn]));
        end_cycle(port);
    }
    if (answers == 0)
        unanswered(address, size, 1, ip);
    else if (!card.virtual_time || watching)
        must(vbus_echo(&bus, 0)); /* it has happened then: a delay loop may count from here */
    current_ip = 0;
    quiet_until = 0;
}

/* --- time ------------------------------------------------------------------------------------- */

#define END_OF_TIME ((uint64_t)INT64_MAX + 1 - (1ULL << 56))

static volatile int begun;

void card_begin_time(void)
{
    if (begun)
        return;
    card_set_clocks();
    begun = 1;
    timers_begin();
    turns_say_begun();
}

int card_time_begun(void)
{
    return begun;
}

static void spend(uint64_t ps)
{
    if (ps >= END_OF_TIME - elapsed) {
        card_say("the program waits beyond the end of chip time, which is 106 days after its start");
        card_end(1);
    }
    elapsed += ps;
    if (!slaved && open_session)
        owed += ps;
}

/* A board knows only the time it gets reports of: it ends a program that goes on beyond a limit. */
static void heed_limit(void)
{
    uint64_t edge;

    if (elapsed <= limit)
        return;
    limit = elapsed + STEP_PS;
    open_card();
    tell_time();
    must(vbus_sync(&bus, NULL, &edge));
}

uint64_t card_elapsed(void)
{
    return elapsed / PS_PER_NS;
}

/* Bring the chips up to now, and learn of interrupts and when the next may come. */
static void look_at_line(void)
{
    uint64_t edge, now = 0;

    open_card();
    tell_time();
    must(vbus_sync(&bus, NULL, &edge));
    if (slaved)
        now = board_at + elapsed;
    else if (edge != VBUS_NO_EDGE)
        must(vbus_now(&bus, &now));
    quiet_until = edge == VBUS_NO_EDGE ? UINT64_MAX : elapsed + (edge > now ? edge - now : PS_PER_NS);
}

void card_refresh(void)
{
    if (!watching || !card.virtual_time || elapsed < quiet_until)
        return;
    card_enter();
    look_at_line();
    card_leave();
}

uint64_t card_look(void)
{
    spend(clock_step);
    if (watching && card.virtual_time && elapsed >= quiet_until)
        look_at_line();
    heed_limit();
    return elapsed / PS_PER_NS;
}

void card_pass(uint64_t duration)
{
    spend(duration < END_OF_TIME / PS_PER_NS ? duration * PS_PER_NS : END_OF_TIME);
    if (watching && card.virtual_time && elapsed >= quiet_until)
        look_at_line();
    heed_limit();
}

int card_leap(int64_t longest, int heeds)
{
    uint64_t step = longest == FOR_EVER ? STEP_PS : END_OF_TIME, passed;

    heeds = heeds && watching;
    if (!heeds && longest == FOR_EVER)
        return 0;
    if (longest < (int64_t)(END_OF_TIME / PS_PER_NS))
        step = (uint64_t)longest * PS_PER_NS;
    await_lock(turns_self()->tid);
    if (!heeds) {
        card_pass((uint64_t)longest);
    } else if (noticed == interrupts) {
        if (elapsed >= quiet_until)
            look_at_line();
        if (longest == FOR_EVER && quiet_until == UINT64_MAX && limit == UINT64_MAX) {
            step = 0; /* the line does not move unless the program does something */
        } else if (noticed == interrupts) {
            tell_time();
            must(vbus_pass(&bus, step, NULL, &passed));
            spend(passed);
            owed = 0; /* the board knows */
            quiet_until = elapsed;
        }
    }
    card_send();
    __atomic_store_n(&lock, 0, __ATOMIC_RELEASE);
    card_notice();
    return step > 0;
}

/* --- interrupts ------------------------------------------------------------------------------- */

void card_watch(void)
{
    uint32_t outputs;

    if (card.lines == 0 || watching)
        return;
    watching = 1;
    if (!open_session) {
        open_card(); /* which comes here again */
        return;
    }
    if (!card.virtual_time)
        listen_begin(); /* it tells of a line that stands already */
    must(vbus_events(&bus, card.lines));
    must(vbus_sync(&bus, &outputs, NULL));
    line_active = card_interrupting(outputs);
    if (line_active && card.virtual_time)
        card_interrupt();
}

void card_interrupt(void)
{
    __atomic_add_fetch(&interrupts, 1, __ATOMIC_SEQ_CST);
}

uint32_t card_interrupts(void)
{
    return interrupts;
}

void card_rearm(void)
{
    uint32_t outputs;

    open_card();
    tell_time();
    must(vbus_sync(&bus, &outputs, NULL));
    if (card_interrupting(outputs) && !card.edge)
        card_interrupt();
}

void card_notice(void)
{
    union sigval none = {0};

    timers_fire();
    if (noticed == interrupts)
        return;
    card_lock_interrupts();
    for (; noticed != interrupts; noticed++) {
        files_interrupt();
        if (card.signal && card.virtual_time)
            signals_send(card.signal, SI_KERNEL, none);
        else if (card.signal)
            syscall(SYS_kill, getpid(), card.signal);
    }
    card_unlock_interrupts();
}
