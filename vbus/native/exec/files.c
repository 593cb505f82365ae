/* files.c - /dev/port, /dev/mem and /dev/uio0 as the program opens, reads, writes and maps them;
 * ioperm and iopl; fork and the library's start and end. Descriptors: descriptors.c. License: Apache-2.0.
 */
#define _GNU_SOURCE
#include "files.h"

#include "card.h"
#include "clock.h"
#include "listen.h"
#include "spin.h"
#include "sys.h"
#include "timers.h"
#include "trap.h"
#include "turns.h"

#include <errno.h>
#include <pthread.h>
#include <stdarg.h>
#include <stdio.h>
#include <sys/eventfd.h>
#include <sys/mman.h>
#include <sys/uio.h>

#undef open
#undef open64

#define MOST_FILES 1024
#define PAGE 4096u

#define INHERITED 64 /* descriptors looked at when a program starts */
#define UIO_MARK 63

enum kind { NONE, PORTS, MEMORY, UIO };

static const char *const device_names[] = {"", "vbus-port", "vbus-mem"};

static unsigned char kinds[MOST_FILES];
static uint32_t uio_seen[MOST_FILES];
static volatile int uio_last = -1;

static enum kind kind_of(int fd)
{
    return fd >= 0 && fd < MOST_FILES ? (enum kind)kinds[fd] : NONE;
}

static enum kind kind_of_path(const char *path)
{
    if (!card.present || path == NULL || strncmp(path, "/dev/", 5) != 0)
        return NONE;
    if (strcmp(path, "/dev/port") == 0 && !card.memory)
        return PORTS;
    if (strcmp(path, "/dev/mem") == 0 && card.memory)
        return MEMORY;
    return strcmp(path, "/dev/uio0") == 0 ? UIO : NONE;
}

static void begin(void)
{
    if (!card.virtual_time)
        return;
    card_enter();
    card_begin_time();
    card_leave();
}

static void adopt_device(int fd, enum kind kind)
{
    begin();
    if (kind == UIO && card.lines != 0) {
        uio_seen[fd] = card_interrupts();
        card_enter();
        card_watch();
        card_leave();
        if (uio_last < fd)
            uio_last = fd;
    }
    kinds[fd] = (unsigned char)kind;
    files_interrupt();
}

/* A descriptor of the program's own stands for the device: it has a position, can be copied and
 * closed, and means nothing to anybody else. That of interrupts is an event counter, so that every
 * way to wait works; the signal it would send is a mark that is inherited. */
static int open_device(enum kind kind, int flags)
{
    int fd;

    if (kind == UIO)
        fd = eventfd(0, flags & O_CLOEXEC ? EFD_CLOEXEC : 0);
    else
        fd = (int)syscall(SYS_memfd_create, device_names[kind], flags & O_CLOEXEC ? 1 : 0);
    if (fd < 0)
        return -1;
    if (fd >= MOST_FILES) {
        sys_close(fd);
        errno = EMFILE;
        return -1;
    }
    if (kind == UIO)
        syscall(SYS_fcntl, fd, F_SETSIG, UIO_MARK);
    if (flags & O_NONBLOCK)
        fcntl(fd, F_SETFL, O_NONBLOCK);
    adopt_device(fd, kind);
    return fd;
}

#define MODE(flags)                                                                                \
    mode_t mode = 0;                                                                               \
    if ((flags) & (O_CREAT | __O_TMPFILE)) {                                                       \
        va_list rest;                                                                              \
        va_start(rest, flags);                                                                     \
        mode = (mode_t)va_arg(rest, int);                                                          \
        va_end(rest);                                                                              \
    }

#define OPEN(name)                                                                                 \
    PUBLIC int name(const char *path, int flags, ...)                                              \
    {                                                                                              \
        static int (*real)(const char *, int, ...);                                                \
        enum kind kind = kind_of_path(path);                                                       \
        MODE(flags)                                                                                \
        if (kind != NONE)                                                                          \
            return open_device(kind, flags);                                                       \
        if (real == NULL)                                                                          \
            *(void **)&real = dlsym(RTLD_NEXT, #name);                                             \
        return real(path, flags, mode);                                                            \
    }

#define OPENAT(name)                                                                               \
    PUBLIC int name(int folder, const char *path, int flags, ...)                                  \
    {                                                                                              \
        static int (*real)(int, const char *, int, ...);                                           \
        enum kind kind = kind_of_path(path);                                                       \
        MODE(flags)                                                                                \
        if (kind != NONE)                                                                          \
            return open_device(kind, flags);                                                       \
        if (real == NULL)                                                                          \
            *(void **)&real = dlsym(RTLD_NEXT, #name);                                             \
        return real(folder, path, flags, mode);                                                    \
    }

OPEN(open)
OPEN(open64)
OPENAT(openat)
OPENAT(openat64)

/* What fortified programs call. */
#define OPEN_2(name, plain)                                                                        \
    PUBLIC int name(const char *path, int flags);                                                  \
    PUBLIC int name(const char *path, int flags)                                                   \
    {                                                                                              \
        return plain(path, flags, 0);                                                              \
    }
#define OPENAT_2(name, plain)                                                                      \
    PUBLIC int name(int folder, const char *path, int flags);                                      \
    PUBLIC int name(int folder, const char *path, int flags)                                       \
    {                                                                                              \
        return plain(folder, path, flags, 0);                                                      \
    }

OPEN_2(__open_2, open)
OPEN_2(__open64_2, open64)
OPENAT_2(__openat_2, openat)
OPENAT_2(__openat64_2, openat64)

/* --- reading and writing ---------------------------------------------------------------------- */

static ssize_t move(enum kind kind, unsigned char *into, const unsigned char *from, size_t size,
                    uint64_t place)
{
    uintptr_t ip = (uintptr_t)__builtin_return_address(0);
    size_t turn;

    if (kind == PORTS && place >= 0x10000)
        return 0;
    if (kind == PORTS && size > 0x10000 - place)
        size = (size_t)(0x10000 - place);
    card_enter();
    for (turn = 0; turn < size; turn++) {
        if (into != NULL)
            card_load((uintptr_t)place + turn, into + turn, 1, ip);
        else
            card_store((uintptr_t)place + turn, from + turn, 1, ip);
    }
    card_leave();
    return (ssize_t)size;
}

static ssize_t move_here(int fd, unsigned char *into, const unsigned char *from, size_t size)
{
    off64_t place = lseek64(fd, 0, SEEK_CUR);
    ssize_t done = move(kind_of(fd), into, from, size, (uint64_t)place);

    if (done > 0)
        lseek64(fd, place + done, SEEK_SET);
    return done;
}

static volatile unsigned changes = 1;

void files_changed(void)
{
    changes++;
}

unsigned files_changes(void)
{
    return changes;
}

/* What has come and has not been read makes the descriptor readable. */
void files_interrupt(void)
{
    static const uint64_t one = 1;
    uint32_t count = card_interrupts();
    int fd;

    files_changed();
    for (fd = 0; fd <= uio_last; fd++)
        if (kinds[fd] == UIO && uio_seen[fd] != count)
            sys_write(fd, &one, sizeof one);
}

int files_inner(const struct pollfd *set, nfds_t count)
{
    nfds_t turn;

    for (turn = 0; turn < count; turn++)
        if (set[turn].fd >= 0 && kind_of(set[turn].fd) != UIO && !timers_has(set[turn].fd))
            return 0;
    return 1;
}

static ssize_t read_uio(int fd, void *data, size_t size)
{
    struct pollfd full = {fd, POLLIN, 0};
    uint64_t told;
    uint32_t count;

    if (size != 4 || card.lines == 0) {
        errno = card.lines == 0 ? EIO : EINVAL;
        return -1;
    }
    card_refresh();
    while (sys_poll(&full, 1, 0) == 0) {
        if (fcntl(fd, F_GETFL) & O_NONBLOCK) {
            errno = EAGAIN;
            return -1;
        }
        if (clock_waits() ? clock_await(fd, POLLIN) < 0 : poll(&full, 1, -1) < 0)
            return -1;
    }
    turns_enter();
    card_lock_interrupts();
    sys_read(fd, &told, sizeof told);
    count = uio_seen[fd] = card_interrupts();
    card_unlock_interrupts();
    turns_leave();
    memcpy(data, &count, 4);
    return 4;
}

static ssize_t write_uio(const void *data, size_t size)
{
    uint32_t on;

    if (size != 4) {
        errno = EINVAL;
        return -1;
    }
    memcpy(&on, data, 4);
    if (on && card.lines != 0) {
        card_enter();
        card_rearm();
        card_leave();
        files_interrupt();
    }
    return 4;
}

PUBLIC ssize_t read(int fd, void *data, size_t size)
{
    REAL(read);
    switch (kind_of(fd)) {
    case NONE: return clock_await(fd, POLLIN) < 0 ? -1 : real(fd, data, size);
    case UIO: return read_uio(fd, data, size);
    default: return move_here(fd, data, NULL, size);
    }
}

PUBLIC ssize_t write(int fd, const void *data, size_t size)
{
    REAL(write);
    switch (kind_of(fd)) {
    case NONE: return clock_await(fd, POLLOUT) < 0 ? -1 : real(fd, data, size);
    case UIO: return write_uio(data, size);
    default: return move_here(fd, NULL, data, size);
    }
}

#define POSITIONED(name, offset, constant, into, from)                                             \
    PUBLIC ssize_t name(int fd, constant void *data, size_t size, offset place)                    \
    {                                                                                              \
        REAL(name);                                                                                \
        if (kind_of(fd) == NONE || kind_of(fd) == UIO)                                             \
            return real(fd, data, size, place);                                                    \
        return move(kind_of(fd), into, from, size, (uint64_t)place);                               \
    }

POSITIONED(pread, off_t, , data, NULL)
POSITIONED(pread64, off64_t, , data, NULL)
POSITIONED(pwrite, off_t, const, NULL, data)
POSITIONED(pwrite64, off64_t, const, NULL, data)

PUBLIC ssize_t __read_chk(int fd, void *data, size_t size, size_t room);
PUBLIC ssize_t __read_chk(int fd, void *data, size_t size, size_t room)
{
    if (size > room)
        __builtin_trap();
    return read(fd, data, size);
}

PUBLIC ssize_t __pread_chk(int fd, void *data, size_t size, off_t place, size_t room);
PUBLIC ssize_t __pread_chk(int fd, void *data, size_t size, off_t place, size_t room)
{
    if (size > room)
        __builtin_trap();
    return pread(fd, data, size, place);
}

PUBLIC ssize_t __pread64_chk(int fd, void *data, size_t size, off64_t place, size_t room);
PUBLIC ssize_t __pread64_chk(int fd, void *data, size_t size, off64_t place, size_t room)
{
    if (size > room)
        __builtin_trap();
    return pread64(fd, data, size, place);
}

/* --- several buffers at once ------------------------------------------------------------------ */

#define VECTOR(name, one)                                                                          \
    PUBLIC ssize_t name(int fd, const struct iovec *parts, int count)                              \
    {                                                                                              \
        ssize_t all = 0;                                                                           \
        int turn;                                                                                  \
        REAL(name);                                                                                \
        if (kind_of(fd) == NONE && !clock_waits())                                                \
            return real(fd, parts, count);                                                         \
        for (turn = 0; turn < count; turn++) {                                                     \
            ssize_t done = one(fd, parts[turn].iov_base, parts[turn].iov_len);                     \
                                                                                                   \
            if (done < 0)                                                                          \
                return all > 0 ? all : done;                                                       \
            all += done;                                                                           \
            if ((size_t)done < parts[turn].iov_len)                                                \
                break;                                                                             \
        }                                                                                          \
        return all;                                                                                \
    }

#define POSITIONED_VECTOR(name, one, offset)                                                       \
    PUBLIC ssize_t name(int fd, const struct iovec *parts, int count, offset place)                \
    {                                                                                              \
        ssize_t all = 0;                                                                           \
        int turn;                                                                                  \
        REAL(name);                                                                                \
        if (kind_of(fd) == NONE || kind_of(fd) == UIO)                                             \
            return real(fd, parts, count, place);                                                  \
        for (turn = 0; turn < count; turn++)                                                       \
            all += one(fd, parts[turn].iov_base, parts[turn].iov_len, place + all);                \
        return all;                                                                                \
    }

VECTOR(readv, read)
VECTOR(writev, write)
POSITIONED_VECTOR(preadv, pread, off_t)
POSITIONED_VECTOR(preadv64, pread64, off64_t)
POSITIONED_VECTOR(pwritev, pwrite, off_t)
POSITIONED_VECTOR(pwritev64, pwrite64, off64_t)

/* --- streams: their reads do not pass through read -------------------------------------------- */

static ssize_t stream_read(void *cookie, char *data, size_t size)
{
    return read((int)(intptr_t)cookie, data, size);
}

static ssize_t stream_write(void *cookie, const char *data, size_t size)
{
    return write((int)(intptr_t)cookie, data, size);
}

static int stream_seek(void *cookie, off64_t *place, int whence)
{
    *place = lseek64((int)(intptr_t)cookie, *place, whence);
    return *place < 0 ? -1 : 0;
}

static int stream_close(void *cookie)
{
    return close((int)(intptr_t)cookie);
}

static FILE *open_stream(enum kind kind, const char *mode)
{
    static const cookie_io_functions_t functions = {stream_read, stream_write, stream_seek,
                                                    stream_close};
    int fd = open_device(kind, strchr(mode, 'e') != NULL ? O_CLOEXEC : 0);

    return fd < 0 ? NULL : fopencookie((void *)(intptr_t)fd, mode, functions);
}

#define FOPEN(name)                                                                                \
    PUBLIC FILE *name(const char *path, const char *mode)                                          \
    {                                                                                              \
        enum kind kind = kind_of_path(path);                                                       \
        REAL(name);                                                                                \
        return kind == NONE ? real(path, mode) : open_stream(kind, mode);                          \
    }

FOPEN(fopen)
FOPEN(fopen64)

/* --- which descriptors stand for devices ------------------------------------------------------- */

void files_closed(unsigned first, unsigned last)
{
    files_changed();
    timers_closed(first, last);
    for (; first <= last && first < MOST_FILES; first++)
        kinds[first] = NONE;
}

int files_copied(int from, int to)
{
    files_changed();
    if (to >= 0 && to < MOST_FILES)
        kinds[to] = (unsigned char)kind_of(from);
    if (to >= 0 && to < MOST_FILES && kinds[to] == UIO) {
        uio_seen[to] = uio_seen[from];
        uio_last = uio_last < to ? to : uio_last;
    }
    return to;
}

/* Descriptors that another program opened before it became this one, as shells do for `<`. */
static void inherit_devices(void)
{
    int fd;

    for (fd = 0; fd < INHERITED; fd++) {
        char link[32] = "/proc/self/fd/", path[48] = "";
        unsigned kind;

        link[14] = (char)('0' + fd / 10);
        link[15] = (char)('0' + fd % 10);
        if (fd < 10)
            link[14] = link[15], link[15] = '\0';
        if (syscall(SYS_readlinkat, AT_FDCWD, link, path, sizeof path - 1) <= 0)
            continue;
        if (strcmp(path, "anon_inode:[eventfd]") == 0
            && syscall(SYS_fcntl, fd, F_GETSIG) == UIO_MARK)
            adopt_device(fd, UIO);
        for (kind = PORTS; kind <= MEMORY; kind++)
            if (strncmp(path, "/memfd:", 7) == 0
                && strncmp(path + 7, device_names[kind], strlen(device_names[kind])) == 0)
                adopt_device(fd, (enum kind)kind);
    }
}

/* --- memory ----------------------------------------------------------------------------------- */

static void *map_device(void *address, size_t size, int flags, enum kind kind, uint64_t place)
{
    if (kind == PORTS || size == 0 || place % PAGE != 0) {
        errno = kind == PORTS ? ENODEV : EINVAL;
        return MAP_FAILED;
    }
    if (kind == UIO) {
        if (place != 0 || !card.memory) { /* map 0 is the card */
            errno = EINVAL;
            return MAP_FAILED;
        }
        place = card.first & ~(uintptr_t)(PAGE - 1);
    }
    return trap_map(address, size, flags, (uintptr_t)place);
}

#define MMAP(name, offset)                                                                         \
    PUBLIC void *name(void *address, size_t size, int protection, int flags, int fd, offset place) \
    {                                                                                              \
        enum kind kind = flags & MAP_ANONYMOUS ? NONE : kind_of(fd);                               \
        REAL(name);                                                                                \
        if (kind == NONE)                                                                          \
            return real(address, size, protection, flags, fd, place);                              \
        return map_device(address, size, flags, kind, (uint64_t)place);                            \
    }

MMAP(mmap, off_t)
MMAP(mmap64, off64_t)

PUBLIC int munmap(void *address, size_t size)
{
    REAL(munmap);
    trap_unmap(address, size);
    return real(address, size);
}

/* --- ports ------------------------------------------------------------------------------------ */

PUBLIC int ioperm(unsigned long from, unsigned long count, int on)
{
    REAL(ioperm);
    if (!card.present)
        return real(from, count, on);
    begin();
    return trap_allow(from, count, on);
}

PUBLIC int iopl(int level)
{
    REAL(iopl);
    if (!card.present)
        return real(level);
    begin();
    return trap_level(level);
}

/* --- fork, start and end ---------------------------------------------------------------------- */

static void before_fork(void)
{
    card_enter();
    card_share();
}

static void after_fork_in_parent(void)
{
    card_leave();
}

static void after_fork_in_child(void)
{
    turns_alone();
    card_forget();
    listen_forget();
    timers_forget();
    spin_forget();
    turns_leave();
}

__attribute__((constructor(101))) static void start(void)
{
    card_read_settings();
    if (!card.present)
        return;
    sys_find_clock();
    turns_start();
    trap_install();
    inherit_devices();
    pthread_atfork(before_fork, after_fork_in_parent, after_fork_in_child);
    if (card.memory && card.fixed != 0) {
        uintptr_t first = card.first & ~(uintptr_t)(PAGE - 1);
        void *window = trap_map((void *)card.fixed, card.end - first, MAP_FIXED_NOREPLACE, first);

        if (window != (void *)card.fixed) {
            card_say("the address 0x%x of the board file cannot be had for the card", card.fixed);
            card_end(1);
        }
    }
}

__attribute__((destructor)) static void finish(void)
{
    card_enter();
    card_send();
    card_leave();
}

/* What is sent late would be lost by those who leave at once. */
PUBLIC void _exit(int code)
{
    if (card.present)
        finish();
    card_end(code);
}

PUBLIC void abort(void)
{
    void (*real)(void) = NULL;

    if (card.present)
        card_send_last();
    *(void **)&real = dlsym(RTLD_NEXT, "abort");
    real();
    card_end(134);
}

PUBLIC void _Exit(int code)
{
    _exit(code);
}
