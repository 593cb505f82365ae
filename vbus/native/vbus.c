/* vbus.c - the C client of the byte protocol; see vbus.h. License: Apache-2.0. */
#ifndef _POSIX_C_SOURCE
#define _POSIX_C_SOURCE 200809L
#endif

#include "vbus.h"

#include <errno.h>
#include <fcntl.h>
#include <netinet/in.h>
#include <netinet/tcp.h>
#include <poll.h>
#include <sched.h>
#include <string.h>
#include <sys/file.h>
#include <sys/socket.h>
#include <sys/un.h>
#include <termios.h>
#include <time.h>
#include <unistd.h>

#ifndef MSG_NOSIGNAL
#define MSG_NOSIGNAL 0
#endif

#ifndef DEFAULT_TIMEOUT_MS
#define DEFAULT_TIMEOUT_MS 5000
#endif
#define LONGEST_MS 86400000
#define START_MS 5000 /* how long a board that has begun to start may take */
#define PAUSE_MS 10
#define LOOKS 64 /* for a reply, before sleeping: some 30 us */
#define CROWDED 1024 /* replies not looked for after one that took CROWDED_MS: others want the processor */
#define CROWDED_MS 2
#define PS_PER_MS UINT64_C(1000000000)

const char *vbus_strerror(int error)
{
    switch (error) {
    case VBUS_E_SYSTEM: return "a system call failed (see errno in vbus.system)";
    case VBUS_E_WHERE:
        return "not a link; allowed are pty:PATH, unix:PATH, tcp:ADDRESS:PORT (numeric)";
    case VBUS_E_CLOSED: return "the board has closed the link";
    case VBUS_E_TIMEOUT: return "no reply in time; is the board running? open the session anew";
    case VBUS_E_PROTOCOL:
        return "what came is no reply of the byte protocol; is it this link's protocol?";
    case VBUS_E_ARGUMENT: return "an argument is out of range; nothing was sent";
    case VBUS_E_ORDER: return "replies that were asked for must be taken first; at most 64 may wait";
    case VBUS_E_NAME: return "no such name, or several chips have it";
    case VBUS_E_REFUSED(VBUS_REFUSED_UNKNOWN): return "refused: unknown request";
    case VBUS_E_REFUSED(VBUS_REFUSED_NO_SUCH):
        return "refused: no such line, pin, chip or address";
    case VBUS_E_REFUSED(VBUS_REFUSED_BAD_AT):
        return "refused: AT before the last AT, on a board that is not slaved, or past the end of"
               " time";
    case VBUS_E_REFUSED(VBUS_REFUSED_BAD_LENGTH): return "refused: length 0 or over the limit";
    case VBUS_E_REFUSED(VBUS_REFUSED_BAD_VERSION): return "refused: version not spoken here";
    case VBUS_E_REFUSED(VBUS_REFUSED_CLOSED): return "refused: closed by the board";
    case VBUS_E_REFUSED(VBUS_REFUSED_NO_ROOM): return "refused: the board can take no more hosts";
    case VBUS_E_REFUSED(VBUS_REFUSED_DEADLOCK):
        return "refused: SELECT of a chip claimed by a session that waits for what this one has"
               " claimed";
    default: return error >= 0 ? "no error" : "refused";
    }
}

/* --- opening ---------------------------------------------------------------------------------- */

static int system_error(struct vbus *bus)
{
    bus->system = errno;
    return VBUS_E_SYSTEM;
}

static void begin(struct vbus *bus)
{
    memset(bus, 0, sizeof *bus);
    bus->fd = -1;
    bus->timeout_ms = DEFAULT_TIMEOUT_MS;
    bus->selected = 1;
}

int vbus_attach(struct vbus *bus, int fd)
{
    int type;
    socklen_t size = sizeof type;

    begin(bus);
    bus->fd = fd;
    bus->is_socket = getsockopt(fd, SOL_SOCKET, SO_TYPE, &type, &size) == 0;
    return 0;
}

static int open_pty(struct vbus *bus, const char *path)
{
    struct termios mode;
    int fd = open(path, O_RDWR | O_NOCTTY | O_CLOEXEC);

    if (fd < 0)
        return system_error(bus);
    if (tcgetattr(fd, &mode) == 0) {
        mode.c_iflag &= (tcflag_t)~(IGNBRK | BRKINT | PARMRK | ISTRIP | INLCR | IGNCR | ICRNL
                                    | IXON | IXOFF);
        mode.c_oflag &= (tcflag_t)~OPOST;
        mode.c_lflag &= (tcflag_t)~(ECHO | ECHONL | ICANON | ISIG | IEXTEN);
        mode.c_cflag &= (tcflag_t)~(CSIZE | PARENB);
        mode.c_cflag |= CS8 | CLOCAL | CREAD;
        mode.c_cc[VMIN] = 1;
        mode.c_cc[VTIME] = 0;
    } else {
        system_error(bus);
        close(fd);
        return VBUS_E_SYSTEM;
    }
    if (tcsetattr(fd, TCSANOW, &mode) < 0) {
        system_error(bus);
        close(fd);
        return VBUS_E_SYSTEM;
    }
    return vbus_attach(bus, fd);
}

static int connect_to(struct vbus *bus, const struct sockaddr *address, socklen_t size)
{
    int on = 1;
    int fd = socket(address->sa_family, SOCK_STREAM, 0);

    if (fd < 0)
        return system_error(bus);
    if (fcntl(fd, F_SETFD, FD_CLOEXEC) < 0 || connect(fd, address, size) < 0) {
        system_error(bus);
        close(fd);
        return VBUS_E_SYSTEM;
    }
    if (address->sa_family == AF_INET)
        setsockopt(fd, IPPROTO_TCP, TCP_NODELAY, &on, sizeof on);
    return vbus_attach(bus, fd);
}

static int open_unix(struct vbus *bus, const char *path)
{
    struct sockaddr_un address;

    if (strlen(path) >= sizeof address.sun_path)
        return VBUS_E_WHERE;
    memset(&address, 0, sizeof address);
    address.sun_family = AF_UNIX;
    memcpy(address.sun_path, path, strlen(path));
    return connect_to(bus, (const struct sockaddr *)&address, sizeof address);
}

/* Read a decimal number up to `most`; return what follows it, or NULL. */
static const char *decimal(const char *text, unsigned most, unsigned *value)
{
    const char *start = text;

    for (*value = 0; *text >= '0' && *text <= '9' && *value <= most; text++)
        *value = *value * 10 + (unsigned)(*text - '0');
    return text == start || *value > most ? NULL : text;
}

static int open_tcp(struct vbus *bus, const char *place)
{
    struct sockaddr_in address;
    unsigned char *bytes = (unsigned char *)&address.sin_addr;
    unsigned char *port_bytes = (unsigned char *)&address.sin_port;
    unsigned part, port;
    int turn;

    memset(&address, 0, sizeof address);
    address.sin_family = AF_INET;
    if (strncmp(place, "localhost", 9) == 0) {
        bytes[0] = 127;
        bytes[3] = 1;
        place += 9;
    } else {
        for (turn = 0; turn < 4; turn++) {
            if (turn > 0 && *place++ != '.')
                return VBUS_E_WHERE;
            place = decimal(place, 255, &part);
            if (place == NULL)
                return VBUS_E_WHERE;
            bytes[turn] = (unsigned char)part;
        }
    }
    if (*place++ != ':')
        return VBUS_E_WHERE;
    place = decimal(place, 65535, &port);
    if (place == NULL || *place != '\0')
        return VBUS_E_WHERE;
    port_bytes[0] = (unsigned char)(port >> 8);
    port_bytes[1] = (unsigned char)port;
    return connect_to(bus, (const struct sockaddr *)&address, sizeof address);
}

static int open_link(struct vbus *bus, const char *where)
{
    if (strncmp(where, "pty:", 4) == 0)
        return open_pty(bus, where + 4);
    if (strncmp(where, "unix:", 5) == 0)
        return open_unix(bus, where + 5);
    if (strncmp(where, "tcp:", 4) == 0)
        return open_tcp(bus, where + 4);
    if (*where == '/' || *where == '.')
        return open_pty(bus, where);
    return VBUS_E_WHERE;
}

void vbus_close(struct vbus *bus)
{
    if (bus->fd >= 0 && bus->dead == 0)
        vbus_send(bus); /* whatever comes of it, this is the end */
    if (bus->fd >= 0)
        close(bus->fd);
    bus->fd = -1;
    bus->dead = VBUS_E_CLOSED;
}

/* --- sending ---------------------------------------------------------------------------------- */

static int die(struct vbus *bus, int error)
{
    if (bus->dead == 0)
        bus->dead = error;
    return bus->dead;
}

static int64_t clock_ms(void)
{
    struct timespec now;

    clock_gettime(CLOCK_MONOTONIC, &now);
    return (int64_t)now.tv_sec * 1000 + now.tv_nsec / 1000000;
}

/* Write the path of ".NAME.SUFFIX" beside the name of a link; false if there is no room. */
static int beside(char made[VBUS_PATH_ROOM], const char *where, const char *suffix)
{
    const char *colon = strchr(where, ':');
    const char *path = *where != '/' && *where != '.' && colon != NULL ? colon + 1 : where;
    const char *slash = strrchr(path, '/');
    size_t folder = slash == NULL ? 0 : (size_t)(slash + 1 - path);
    size_t name = strlen(path) - folder;

    if (folder + name + strlen(suffix) + 2 > VBUS_PATH_ROOM)
        return 0;
    memcpy(made, path, folder);
    made[folder] = '.';
    memcpy(made + folder + 1, path + folder, name);
    memcpy(made + folder + 1 + name, suffix, strlen(suffix) + 1);
    return 1;
}

/* Whether a process has taken the name of a link and not made it yet. It holds the lock of
 * ".NAME.lock" beside the name as long as it lives. */
static int starting(const char *where)
{
    char lock[VBUS_PATH_ROOM];
    int fd, held;

    if (!beside(lock, where, ".lock"))
        return 0;
    fd = open(lock, O_RDONLY | O_CLOEXEC | O_NOFOLLOW | O_NONBLOCK);
    if (fd < 0)
        return 0;
    held = flock(fd, LOCK_SH | LOCK_NB) < 0 && errno == EWOULDBLOCK;
    close(fd);
    return held;
}

static int open_once(struct vbus *bus, const char *where)
{
    int error;

    begin(bus);
    if (where == NULL) { /* a variable that is not set */
        bus->pause_mark[0] = '\0';
        return VBUS_E_WHERE;
    }
    error = open_link(bus, where);
    if (error < 0 || strncmp(where, "tcp:", 4) == 0 || !beside(bus->pause_mark, where, ".paused"))
        bus->pause_mark[0] = '\0';
    return error;
}

int vbus_open(struct vbus *bus, const char *where)
{
    int64_t end = clock_ms() + START_MS;

    for (;;) {
        int error = open_once(bus, where);

        if (error != VBUS_E_SYSTEM || bus->system != ENOENT || clock_ms() >= end
            || !starting(where))
            return error;
        poll(NULL, 0, PAUSE_MS);
    }
}

int vbus_open_wait(struct vbus *bus, const char *where, int wait_ms)
{
    int64_t end = clock_ms() + wait_ms;

    for (;;) {
        int error = open_once(bus, where);
        int absent = error == VBUS_E_SYSTEM &&
                     (bus->system == ENOENT || bus->system == ECONNREFUSED);

        if (!absent || clock_ms() >= end)
            return error;
        poll(NULL, 0, PAUSE_MS);
    }
}

/* Until when a reply may take (ms), or -1. */
static int64_t deadline_of(const struct vbus *bus)
{
    uint64_t passing = bus->passing / PS_PER_MS;

    if (bus->timeout_ms < 0)
        return -1;
    if (passing > LONGEST_MS)
        passing = LONGEST_MS;
    return clock_ms() + bus->timeout_ms + (int64_t)passing;
}

/* Wait until the descriptor is ready: 1, or 0 when time is up, or an error. */
static int ready(struct vbus *bus, short events, int64_t deadline)
{
    struct pollfd wanted;

    wanted.fd = bus->fd;
    wanted.events = events;
    for (;;) {
        int64_t left = deadline < 0 ? -1 : deadline - clock_ms();
        int found;

        if (deadline >= 0 && left < 0)
            left = 0;
        found = poll(&wanted, 1, left > LONGEST_MS ? LONGEST_MS : (int)left);
        if (found > 0)
            return 1;
        if (found == 0)
            return 0;
        if (errno != EINTR)
            return die(bus, system_error(bus));
    }
}

/* No reply in time: false, or true with a new deadline if the board is paused. */
static int paused(struct vbus *bus, int64_t *deadline)
{
    int before = bus->paused;

    bus->paused = bus->told || (bus->pause_mark[0] != '\0' && access(bus->pause_mark, F_OK) == 0);
    if (bus->paused)
        poll(NULL, 0, PAUSE_MS);
    if (bus->paused || before) /* a board that goes on has its time to answer, too */
        *deadline = deadline_of(bus);
    return bus->paused || before;
}

static int lost(struct vbus *bus)
{
    if (errno == EIO || errno == EPIPE || errno == ECONNRESET)
        return die(bus, VBUS_E_CLOSED);
    return die(bus, system_error(bus));
}

static int send_out(struct vbus *bus)
{
    size_t sent = 0;
    int64_t deadline = deadline_of(bus);

    while (sent < bus->out_size) {
        const unsigned char *rest = bus->out + sent;
        size_t size = bus->out_size - sent;
        ssize_t now = bus->is_socket ? send(bus->fd, rest, size, MSG_NOSIGNAL)
                                     : write(bus->fd, rest, size);

        if (now >= 0) {
            sent += (size_t)now;
        } else if (errno == EAGAIN || errno == EWOULDBLOCK) {
            int found = ready(bus, POLLOUT, deadline);

            if (found == 0 && paused(bus, &deadline))
                continue;
            if (found <= 0)
                return found < 0 ? found : die(bus, VBUS_E_TIMEOUT);
        } else if (errno != EINTR) {
            return lost(bus);
        }
    }
    bus->out_size = 0;
    bus->run = 0;
    return 0;
}

/* Make room for a request of `size` bytes. */
static int make_room(struct vbus *bus, size_t size)
{
    bus->run = 0;
    return bus->out_size + size > sizeof bus->out ? send_out(bus) : 0;
}

static void with_u64(unsigned char *request, unsigned char code, uint64_t value);

/* Queue a time stamp that was held back. */
static int tell_stamp(struct vbus *bus)
{
    int error;

    if (!bus->unsent_stamp)
        return 0;
    error = make_room(bus, 9);
    if (error < 0)
        return error;
    with_u64(bus->out + bus->out_size, VBUS_AT, bus->stamp);
    bus->out_size += 9;
    bus->number++;
    bus->unsent_stamp = 0;
    return 0;
}

/* Queue a poll answered from a lease at the time stamp: one more of an open POLLED_AT, if it can be. */
static int tell_stamped_poll(struct vbus *bus)
{
    uint64_t step = bus->stamp - bus->run_end;
    unsigned char *end;
    int error;

    if (bus->run == 0 || bus->stamp < bus->run_end || step > UINT32_MAX
        || bus->out[bus->run] > 255 - 4 || bus->out_size + 4 > sizeof bus->out) {
        error = make_room(bus, 11);
        if (error < 0)
            return error;
        end = bus->out + bus->out_size;
        with_u64(end + 1, (unsigned char)bus->lease_address, bus->stamp);
        end[0] = VBUS_POLLED_AT;
        end[10] = 0;
        bus->run = bus->out_size + 10;
        bus->out_size += 11;
        bus->number++;
    } else {
        end = bus->out + bus->out_size;
        end[0] = (unsigned char)(step >> 24);
        end[1] = (unsigned char)(step >> 16);
        end[2] = (unsigned char)(step >> 8);
        end[3] = (unsigned char)step;
        bus->out[bus->run] = (unsigned char)(bus->out[bus->run] + 4);
        bus->out_size += 4;
    }
    bus->run_end = bus->stamp;
    bus->unsent_stamp = 0;
    return 0;
}

/* Queue what tells of the polls answered from a lease: they come before whatever is asked next. */
static int tell_polls(struct vbus *bus)
{
    unsigned char *end;

    int error;

    bus->run = 0;
    if (bus->lease_polls == 0)
        return 0;
    error = make_room(bus, 4);
    if (error < 0)
        return error;
    end = bus->out + bus->out_size;
    end[0] = VBUS_POLLED;
    end[1] = (unsigned char)bus->lease_address;
    end[2] = (unsigned char)(bus->lease_polls >> 8);
    end[3] = (unsigned char)bus->lease_polls;
    bus->out_size += 4;
    bus->number++;
    bus->passing += bus->lease_polls * bus->lease_cycle;
    bus->lease_polls = 0;
    return 0;
}

/* Queue a request; send it unless requests are held back or its reply is waited for anyway. */
static int put(struct vbus *bus, const unsigned char *head, size_t size, const unsigned char *tail,
               size_t tail_size, int asks)
{
    int error;

    if (bus->dead != 0)
        return bus->dead;
    error = tell_polls(bus);
    if (error == 0)
        error = tell_stamp(bus);
    if (error < 0)
        return error;
    if (head[0] != VBUS_DELAY && head[0] != VBUS_AT) { /* a lease outlives time passing, no more */
        bus->leased = 0;
        bus->stamped = 0;
    }
    if (bus->out_size + size + tail_size > sizeof bus->out) {
        error = send_out(bus);
        if (error < 0)
            return error;
    }
    memcpy(bus->out + bus->out_size, head, size);
    if (tail_size > 0)
        memcpy(bus->out + bus->out_size + size, tail, tail_size);
    bus->out_size += size + tail_size;
    bus->number++;
    return asks || bus->buffering ? 0 : send_out(bus);
}

static int post(struct vbus *bus, const unsigned char *request, size_t size)
{
    return put(bus, request, size, NULL, 0, 0);
}

void vbus_buffer(struct vbus *bus)
{
    bus->buffering = 1;
}

int vbus_flush(struct vbus *bus)
{
    bus->buffering = 0;
    return vbus_send(bus);
}

int vbus_send(struct vbus *bus)
{
    int error = bus->dead != 0 ? bus->dead : tell_polls(bus);

    if (error == 0)
        error = tell_stamp(bus);
    return error < 0 ? error : send_out(bus);
}

/* --- receiving -------------------------------------------------------------------------------- */

/* Get more bytes: 1, or 0 when time is up, or an error. A host alone on its board looks for them first,
 * which takes less than to sleep and be woken, and lets the board run before each look. Where somebody
 * else runs then, whoever sleeps is let in sooner. */
static int receive(struct vbus *bus, int64_t deadline)
{
    int looks = bus->is_socket && bus->leasing && bus->crowded == 0 ? LOOKS : 0, before = errno;
    int64_t began = looks > 0 ? clock_ms() : 0;

    if (bus->crowded > 0)
        bus->crowded--;
    for (;;) {
        ssize_t now;
        int found = looks > 0 || deadline < 0 ? 1 : ready(bus, POLLIN, deadline);

        if (found <= 0)
            return found;
        if (looks > 0)
            sched_yield();
        now = looks > 0 ? recv(bus->fd, bus->in, sizeof bus->in, MSG_DONTWAIT)
                        : read(bus->fd, bus->in, sizeof bus->in);
        if (looks > 0 && clock_ms() - began >= CROWDED_MS)
            bus->crowded = CROWDED;
        if (now > 0) {
            bus->in_begin = 0;
            bus->in_end = (size_t)now;
            return 1;
        }
        if (now == 0)
            return die(bus, VBUS_E_CLOSED);
        if (looks > 0 && (errno == EAGAIN || errno == EWOULDBLOCK)) {
            looks = bus->crowded > 0 ? 0 : looks - 1;
            errno = before; /* which callers may still have to tell of */
        } else if (errno == EAGAIN || errno == EWOULDBLOCK) {
            found = ready(bus, POLLIN, deadline);
            if (found <= 0)
                return found;
        } else if (errno != EINTR) {
            return lost(bus);
        }
    }
}

/* Take `size` bytes of a reply that has begun; a NULL target drops them. */
static int take(struct vbus *bus, unsigned char *data, size_t size, int64_t deadline)
{
    while (size > 0) {
        size_t here = bus->in_end - bus->in_begin;

        if (here == 0) {
            int found = receive(bus, deadline);

            if (found == 0 && paused(bus, &deadline))
                continue;
            if (found <= 0)
                return found < 0 ? found : die(bus, VBUS_E_TIMEOUT);
            continue;
        }
        if (here > size)
            here = size;
        if (data != NULL) {
            memcpy(data, bus->in + bus->in_begin, here);
            data += here;
        }
        bus->in_begin += here;
        size -= here;
    }
    return 0;
}

static uint64_t number_of(const unsigned char *bytes, unsigned size)
{
    uint64_t value = 0;

    while (size-- > 0)
        value = value << 8 | *bytes++;
    return value;
}

static int take_event(struct vbus *bus, int64_t deadline)
{
    unsigned char body[12];
    int error = take(bus, body, sizeof body, deadline);

    if (error == 0 && bus->on_event != NULL)
        bus->on_event(bus->context, (uint32_t)number_of(body, 4), number_of(body + 4, 8));
    return error;
}

/* Take the report that the board is paused, or that it goes on; comes after HELLO. */
static int take_pause(struct vbus *bus, int64_t deadline)
{
    unsigned char body;
    int error = take(bus, &body, 1, deadline);

    if (error == 0)
        bus->told = body != 0;
    return error;
}

/* Take a refusal: its error if it is request `number`'s, else 0; it is kept for later then. */
static int take_refusal(struct vbus *bus, uint16_t number, int64_t deadline)
{
    unsigned char body[3];
    int error = take(bus, body, sizeof body, deadline);
    unsigned refused;

    if (error < 0)
        return error;
    refused = (unsigned)number_of(body + 1, 2);
    error = VBUS_E_REFUSED((int)body[0]);
    if (body[0] == VBUS_REFUSED_UNKNOWN || body[0] == VBUS_REFUSED_BAD_LENGTH
        || body[0] == VBUS_REFUSED_BAD_VERSION)
        die(bus, error);
    if (bus->pending == 0 || refused == number)
        bus->refused = refused;
    if (refused == number || bus->dead != 0)
        return error;
    if (bus->pending == 0)
        bus->pending = error;
    return 0;
}

/* Take the rest of a leased byte's reply, and of one that tells what comes then. */
static int take_lease(struct vbus *bus, int tag, unsigned char *data, int64_t deadline)
{
    unsigned char body[30];
    int error = take(bus, body, tag == VBUS_TAG_FORESEEN ? 30 : 21, deadline);

    if (error == 0) {
        *data = body[0];
        bus->leased = 1;
        bus->lease_data = body[0];
        bus->lease_outputs = (uint32_t)number_of(body + 1, 4);
        bus->lease_now = number_of(body + 5, 8);
        bus->lease_until = bus->lease_end = number_of(body + 13, 8);
        if (tag == VBUS_TAG_FORESEEN) {
            bus->lease_then = body[21];
            bus->lease_end = number_of(body + 22, 8);
        }
    }
    return error;
}

/* Wait for the reply `tag` of request `number`; take the fixed part of its body. */
static int reply(struct vbus *bus, uint16_t number, int tag, unsigned char *body, size_t size)
{
    int64_t deadline;
    int error = bus->dead != 0 ? bus->dead : send_out(bus);

    if (error < 0)
        return error;
    deadline = deadline_of(bus);
    for (;;) {
        unsigned char got;

        error = take(bus, &got, 1, deadline);
        if (error == 0 && got == tag)
            error = take(bus, body, size, deadline);
        else if (error == 0 && tag == VBUS_TAG_DATA
                 && (got == VBUS_TAG_LEASED || got == VBUS_TAG_FORESEEN))
            error = take_lease(bus, got, body, deadline);
        else if (error == 0 && got == VBUS_TAG_EVENT) {
            error = take_event(bus, deadline);
            if (error == 0)
                continue;
        } else if (error == 0 && got == VBUS_TAG_PAUSED) {
            error = take_pause(bus, deadline);
            deadline = deadline_of(bus);
            if (error == 0)
                continue;
        } else if (error == 0 && got == VBUS_TAG_REFUSED) {
            error = take_refusal(bus, number, deadline);
            if (error == 0)
                continue;
        } else if (error == 0)
            error = die(bus, VBUS_E_PROTOCOL);
        break;
    }
    bus->passing = 0;
    return error;
}

/* The refusal of an earlier request without a reply, once. */
static int refusal(struct vbus *bus)
{
    int error = bus->pending;

    bus->pending = 0;
    return error;
}

/* Send a request and take its reply. */
static int ask(struct vbus *bus, const unsigned char *request, size_t size, int tag,
               unsigned char *body, size_t body_size)
{
    uint16_t number = bus->number;
    int error = bus->ask_count > 0 ? VBUS_E_ORDER : put(bus, request, size, NULL, 0, 1);

    if (error == 0)
        error = reply(bus, number, tag, body, body_size);
    return error < 0 ? error : refusal(bus);
}

/* --- requests --------------------------------------------------------------------------------- */

static unsigned char low(uint64_t value)
{
    return (unsigned char)(value & 0xFF);
}

/* Write a request with one 64-bit argument. */
static void with_u64(unsigned char *request, unsigned char code, uint64_t value)
{
    int turn;

    request[0] = code;
    for (turn = 8; turn > 0; turn--, value >>= 8)
        request[turn] = low(value);
}

static size_t read_request(unsigned char *request, unsigned address)
{
    if (address < 16) {
        request[0] = low(VBUS_READ4 + address);
        return 1;
    }
    request[0] = VBUS_READ;
    request[1] = low(address);
    return 2;
}

int vbus_echo(struct vbus *bus, unsigned number)
{
    unsigned char request[2], body[1];
    int error;

    if (number > 255)
        return VBUS_E_ARGUMENT;
    request[0] = VBUS_ECHO;
    request[1] = low(number);
    error = ask(bus, request, 2, VBUS_TAG_ECHO, body, 1);
    return error < 0 ? error : body[0];
}

int vbus_select(struct vbus *bus, unsigned mask)
{
    unsigned char request[3];

    if (mask > 0xFFFF)
        return VBUS_E_ARGUMENT;
    request[0] = VBUS_SELECT;
    request[1] = low(mask >> 8);
    request[2] = low(mask);
    bus->selected = mask;
    return post(bus, request, 3);
}

int vbus_claim(struct vbus *bus)
{
    unsigned char request = VBUS_CLAIM, body[1];

    return ask(bus, &request, 1, VBUS_TAG_CLAIM, body, 1);
}

int vbus_unclaim(struct vbus *bus)
{
    unsigned char request = VBUS_UNCLAIM;

    return post(bus, &request, 1);
}

/* The instant of a poll made now, and whether the lease holds at it. */
static int poll_leased(struct vbus *bus, unsigned address)
{
    uint64_t when = bus->lease_now + bus->lease_cycle;

    if (bus->stamped)
        when = bus->stamp > bus->lease_now ? bus->stamp : bus->lease_now;
    if (address != bus->lease_address || when >= bus->lease_end || bus->ask_count > 0)
        return 0;
    if (when >= bus->lease_until) {
        bus->lease_data = bus->lease_then;
        bus->lease_until = bus->lease_end;
    }
    if (bus->unsent_stamp) {
        if (tell_stamped_poll(bus) < 0)
            return 0;
        bus->lease_now = when;
        bus->stamped = 0;
        return 1;
    }
    bus->lease_now = when;
    bus->lease_polls++;
    /* A stamp belongs to one poll; otherwise they are a cycle apart and reported together. */
    if ((bus->stamped || bus->lease_polls == 0xFFFF) && tell_polls(bus) < 0)
        return 0;
    bus->stamped = 0;
    return 1;
}

/* Note what a lease just taken is for. */
static void begin_lease(struct vbus *bus, unsigned address)
{
    unsigned chip = 0;

    while (chip < 15 && (bus->selected >> chip & 1) == 0)
        chip++;
    bus->lease_address = address;
    bus->lease_cycle = bus->cycles[chip];
    bus->leased = bus->lease_cycle > 0;
}

int vbus_read(struct vbus *bus, unsigned address)
{
    unsigned char request[2], body[1];
    int error;

    if (address > 255)
        return VBUS_E_ARGUMENT;
    if (bus->leased && bus->dead == 0 && poll_leased(bus, address))
        return (int)bus->lease_data;
    error = ask(bus, request, read_request(request, address), VBUS_TAG_DATA, body, 1);
    if (bus->leased)
        begin_lease(bus, address);
    return error < 0 ? error : body[0];
}

int vbus_write(struct vbus *bus, unsigned address, unsigned data)
{
    unsigned char request[3];

    if (address > 255 || data > 255)
        return VBUS_E_ARGUMENT;
    if (address < 16) {
        request[0] = low(VBUS_WRITE4 + address);
        request[1] = low(data);
        return post(bus, request, 2);
    }
    request[0] = VBUS_WRITE;
    request[1] = low(address);
    request[2] = low(data);
    return post(bus, request, 3);
}

int vbus_reads(struct vbus *bus, unsigned address, unsigned count, unsigned char *data)
{
    unsigned char request[3], got[1];
    int error;

    if (address > 255 || count < 1 || count > 255)
        return VBUS_E_ARGUMENT;
    request[0] = VBUS_READS;
    request[1] = low(address);
    request[2] = low(count);
    error = ask(bus, request, 3, VBUS_TAG_BYTES, got, 1);
    if (error == 0 && got[0] != count)
        error = die(bus, VBUS_E_PROTOCOL);
    return error < 0 ? error : take(bus, data, count, deadline_of(bus));
}

int vbus_writes(struct vbus *bus, unsigned address, unsigned count, const unsigned char *data)
{
    unsigned char request[3];

    if (address > 255 || count < 1 || count > 255)
        return VBUS_E_ARGUMENT;
    request[0] = VBUS_WRITES;
    request[1] = low(address);
    request[2] = low(count);
    return put(bus, request, 3, data, count, 0);
}

int vbus_wait(struct vbus *bus, uint64_t longest, uint64_t *instant)
{
    unsigned char request[9], body[9];
    int error;

    with_u64(request, VBUS_WAIT, longest);
    bus->passing += longest;
    error = ask(bus, request, 9, VBUS_TAG_WAIT, body, 9);
    if (error == 0 && instant != NULL)
        *instant = number_of(body + 1, 8);
    return error < 0 ? error : body[0];
}

int vbus_ask_read(struct vbus *bus, unsigned address)
{
    unsigned char request[2];
    uint16_t number = bus->number;
    int error;

    if (address > 255)
        return VBUS_E_ARGUMENT;
    if (bus->ask_count == VBUS_MOST_ASKED)
        return VBUS_E_ORDER;
    error = put(bus, request, read_request(request, address), NULL, 0, 1);
    if (error == 0)
        bus->asked[(bus->ask_first + bus->ask_count++) % VBUS_MOST_ASKED] = number;
    return error;
}

int vbus_take_read(struct vbus *bus)
{
    unsigned char body[1];
    uint16_t number;
    int error;

    if (bus->ask_count == 0)
        return VBUS_E_ORDER;
    number = bus->asked[bus->ask_first];
    bus->ask_first = (bus->ask_first + 1) % VBUS_MOST_ASKED;
    bus->ask_count--;
    error = reply(bus, number, VBUS_TAG_DATA, body, 1);
    bus->leased = 0; /* what has been asked since may have ended it */
    if (error == 0)
        error = refusal(bus);
    return error < 0 ? error : body[0];
}

int vbus_lines(struct vbus *bus, unsigned mask, unsigned levels)
{
    unsigned char request[5];

    if (mask > 0xFFFF || levels > 0xFFFF)
        return VBUS_E_ARGUMENT;
    request[0] = VBUS_LINES;
    request[1] = low(mask >> 8);
    request[2] = low(mask);
    request[3] = low(levels >> 8);
    request[4] = low(levels);
    return post(bus, request, 5);
}

int vbus_drive(struct vbus *bus, unsigned data)
{
    unsigned char request[2];

    if (data > 255)
        return VBUS_E_ARGUMENT;
    request[0] = VBUS_DRIVE;
    request[1] = low(data);
    return post(bus, request, 2);
}

int vbus_release(struct vbus *bus)
{
    unsigned char request = VBUS_RELEASE;

    return post(bus, &request, 1);
}

int vbus_sample(struct vbus *bus, uint32_t *outputs)
{
    unsigned char request = VBUS_SAMPLE, body[5];
    int error = ask(bus, &request, 1, VBUS_TAG_SAMPLE, body, 5);

    if (error == 0 && outputs != NULL)
        *outputs = (uint32_t)number_of(body + 1, 4);
    return error < 0 ? error : body[0];
}

int vbus_pin(struct vbus *bus, unsigned pin, unsigned level)
{
    unsigned char request[3];

    if (pin > 255 || level > 2)
        return VBUS_E_ARGUMENT;
    request[0] = VBUS_PIN;
    request[1] = low(pin);
    request[2] = low(level);
    return post(bus, request, 3);
}

int vbus_getpin(struct vbus *bus, unsigned pin)
{
    unsigned char request[2], body[1];
    int error;

    if (pin > 255)
        return VBUS_E_ARGUMENT;
    request[0] = VBUS_GETPIN;
    request[1] = low(pin);
    error = ask(bus, request, 2, VBUS_TAG_DATA, body, 1);
    return error < 0 ? error : body[0];
}

int vbus_delay(struct vbus *bus, uint64_t duration)
{
    unsigned char request[9];

    with_u64(request, VBUS_DELAY, duration);
    bus->passing += duration;
    if (bus->leased) {
        if (bus->stamped && bus->stamp > bus->lease_now)
            bus->lease_now = bus->stamp;
        bus->stamped = 0;
        bus->lease_now += duration;
        bus->leased = bus->lease_now < bus->lease_end;
    }
    return post(bus, request, 9);
}

int vbus_at(struct vbus *bus, uint64_t instant)
{
    unsigned char request[9];
    int error;

    /* With a lease in force a poll is likely to come; then its stamp travels with it. */
    if (bus->leased && bus->stamped_polls && bus->dead == 0) {
        error = bus->lease_polls > 0 ? tell_polls(bus) : 0;
        if (error == 0 && bus->unsent_stamp)
            error = tell_stamp(bus);
        bus->stamp = instant;
        bus->stamped = bus->unsent_stamp = 1;
        return error;
    }
    with_u64(request, VBUS_AT, instant);
    error = post(bus, request, 9);
    bus->stamp = instant;
    bus->stamped = 1;
    return error;
}

int vbus_now(struct vbus *bus, uint64_t *instant)
{
    unsigned char request = VBUS_NOW, body[8];
    int error = ask(bus, &request, 1, VBUS_TAG_NOW, body, 8);

    if (error == 0)
        *instant = number_of(body, 8);
    return error;
}

int vbus_sync(struct vbus *bus, uint32_t *outputs, uint64_t *edge)
{
    unsigned char request = VBUS_SYNC, body[12];
    int error = ask(bus, &request, 1, VBUS_TAG_SYNC, body, 12);

    if (error == 0 && outputs != NULL)
        *outputs = (uint32_t)number_of(body, 4);
    if (error == 0 && edge != NULL)
        *edge = number_of(body + 4, 8);
    return error;
}

int vbus_pass(struct vbus *bus, uint64_t longest, uint32_t *outputs, uint64_t *passed)
{
    unsigned char request[9], body[12];
    int error;

    with_u64(request, VBUS_PASS, longest);
    bus->passing += longest;
    error = ask(bus, request, 9, VBUS_TAG_PASS, body, 12);
    if (error == 0 && outputs != NULL)
        *outputs = (uint32_t)number_of(body, 4);
    if (error == 0 && passed != NULL)
        *passed = number_of(body + 4, 8);
    return error;
}

int vbus_events(struct vbus *bus, uint32_t mask)
{
    unsigned char request[5];

    request[0] = VBUS_EVENTS;
    request[1] = low(mask >> 24);
    request[2] = low(mask >> 16);
    request[3] = low(mask >> 8);
    request[4] = low(mask);
    return post(bus, request, 5);
}

int vbus_wait_event(struct vbus *bus, int timeout_ms)
{
    unsigned char tag;
    int error = bus->dead != 0 ? bus->dead : bus->ask_count > 0 ? VBUS_E_ORDER : vbus_send(bus);

    while (error == 0) {
        if (bus->in_begin == bus->in_end) {
            int found = receive(bus, timeout_ms < 0 ? -1 : clock_ms() + timeout_ms);

            if (found <= 0)
                return found;
        }
        error = take(bus, &tag, 1, deadline_of(bus));
        if (error == 0 && tag == VBUS_TAG_EVENT) {
            error = take_event(bus, deadline_of(bus));
            return error < 0 ? error : 1;
        }
        if (error == 0 && tag == VBUS_TAG_PAUSED) {
            error = take_pause(bus, deadline_of(bus));
        } else if (error == 0 && tag == VBUS_TAG_REFUSED) {
            error = take_refusal(bus, bus->number, deadline_of(bus));
            if (error == 0)
                error = refusal(bus);
        } else if (error == 0)
            error = die(bus, VBUS_E_PROTOCOL);
    }
    return error;
}

/* --- HELLO ------------------------------------------------------------------------------------ */

/* Ask for the description; return its length. Its bytes follow in the stream. */
static int ask_hello(struct vbus *bus)
{
    unsigned char request[2], body[2];
    int error;

    request[0] = VBUS_HELLO;
    request[1] = VBUS_VERSION;
    error = ask(bus, request, 2, VBUS_TAG_HELLO, body, 2);
    return error < 0 ? error : (int)number_of(body, 2);
}

int vbus_hello(struct vbus *bus, unsigned char *description, size_t size)
{
    int64_t deadline;
    int error, length = ask_hello(bus);

    if (length < 0)
        return length;
    if (size > (size_t)length)
        size = (size_t)length;
    deadline = deadline_of(bus);
    error = take(bus, description, size, deadline);
    if (error == 0)
        error = take(bus, NULL, (size_t)length - size, deadline);
    return error < 0 ? error : length;
}

/* A walk through the description as it arrives: no more than one name is kept. */
struct walk {
    struct vbus *bus;
    int64_t deadline;
    size_t left;
    int error;
};

static uint32_t walk_number(struct walk *walk, unsigned size)
{
    unsigned char bytes[8];

    if (walk->error == 0 && size > walk->left)
        walk->error = die(walk->bus, VBUS_E_PROTOCOL);
    if (walk->error == 0)
        walk->error = take(walk->bus, bytes, size, walk->deadline);
    if (walk->error < 0)
        return 0;
    walk->left -= size;
    return (uint32_t)number_of(bytes, size);
}

static void walk_over(struct walk *walk, uint32_t size)
{
    if (walk->error == 0 && size > walk->left)
        walk->error = die(walk->bus, VBUS_E_PROTOCOL);
    if (walk->error == 0)
        walk->error = take(walk->bus, NULL, size, walk->deadline);
    walk->left -= walk->error == 0 ? size : 0;
}

/* What a msgpack value begins with. */
enum kind { PLAIN, STRING, ARRAY, MAP };

/* Take the head of a value: `size` is the bytes that follow it, or its number of items. */
static enum kind walk_head(struct walk *walk, uint32_t *size)
{
    unsigned type = (unsigned)walk_number(walk, 1);

    *size = 0;
    if (type <= 0x7F || type >= 0xE0)
        return PLAIN;
    if (type <= 0x9F) {
        *size = type & 0x0F;
        return type <= 0x8F ? MAP : ARRAY;
    }
    if (type <= 0xBF) {
        *size = type & 0x1F;
        return STRING;
    }
    if (type >= 0xC4 && type <= 0xC6) { /* binary */
        *size = walk_number(walk, 1U << (type - 0xC4));
        return PLAIN;
    }
    if (type >= 0xD9 && type <= 0xDB) {
        *size = walk_number(walk, 1U << (type - 0xD9));
        return STRING;
    }
    if (type >= 0xDC) {
        *size = walk_number(walk, type & 1 ? 4 : 2);
        return type <= 0xDD ? ARRAY : MAP;
    }
    if (type >= 0xCA && type <= 0xCB)
        *size = 4U << (type - 0xCA);
    else if (type >= 0xCC && type <= 0xCF)
        *size = 1U << (type - 0xCC);
    else if (type >= 0xD0 && type <= 0xD3)
        *size = 1U << (type - 0xD0);
    return PLAIN;
}

/* Take a whole value and everything in it. */
static void walk_past(struct walk *walk)
{
    uint64_t items = 1;

    while (items > 0 && walk->error == 0) {
        uint32_t size;
        enum kind kind = walk_head(walk, &size);

        items--;
        if (kind == ARRAY || kind == MAP)
            items += (uint64_t)size << (kind == MAP);
        else
            walk_over(walk, size);
    }
}

/* Take a string, cut to what fits; an empty one where the value is no string. */
static void walk_string(struct walk *walk, char *text, size_t room)
{
    uint32_t size, kept;
    enum kind kind = walk_head(walk, &size);

    *text = '\0';
    if (kind != STRING) {
        if (walk->error == 0)
            walk->error = die(walk->bus, VBUS_E_PROTOCOL);
        return;
    }
    kept = size < room ? size : (uint32_t)room - 1;
    if (walk->error == 0 && size <= walk->left)
        walk->error = take(walk->bus, (unsigned char *)text, kept, walk->deadline);
    else if (walk->error == 0)
        walk->error = die(walk->bus, VBUS_E_PROTOCOL);
    if (walk->error == 0) {
        walk->left -= kept;
        text[kept] = '\0';
        walk_over(walk, size - kept);
    }
}

/* Take one item of a list: a name, or a map that has one. */
static void walk_item(struct walk *walk, int is_map, char *name, size_t room)
{
    char key[32];
    uint32_t pairs;

    if (!is_map) {
        walk_string(walk, name, room);
        return;
    }
    *name = '\0';
    if (walk_head(walk, &pairs) != MAP && walk->error == 0)
        walk->error = die(walk->bus, VBUS_E_PROTOCOL);
    for (; pairs > 0 && walk->error == 0; pairs--) {
        walk_string(walk, key, sizeof key);
        if (strcmp(key, "name") == 0)
            walk_string(walk, name, room);
        else
            walk_past(walk);
    }
}

static int walk_list(struct walk *walk, int is_map, const char *name)
{
    char item[128];
    uint32_t count, turn;
    int exact = -1, suffix = -1, suffixes = 0;

    if (walk_head(walk, &count) != ARRAY && walk->error == 0)
        walk->error = die(walk->bus, VBUS_E_PROTOCOL);
    for (turn = 0; turn < count && walk->error == 0; turn++) {
        const char *dot;

        walk_item(walk, is_map, item, sizeof item);
        dot = strchr(item, '.');
        if (strcmp(item, name) == 0)
            exact = (int)turn;
        else if (dot != NULL && strcmp(dot + 1, name) == 0) {
            suffix = (int)turn;
            suffixes++;
        }
    }
    if (exact >= 0)
        return exact;
    return suffixes == 1 ? suffix : VBUS_E_NAME;
}

int vbus_number(struct vbus *bus, const char *list, const char *name)
{
    struct walk walk;
    char key[32];
    uint32_t pairs;
    int found = VBUS_E_NAME;
    int length = ask_hello(bus);

    if (length < 0)
        return length;
    walk.bus = bus;
    walk.deadline = deadline_of(bus);
    walk.left = (size_t)length;
    walk.error = 0;
    if (walk_head(&walk, &pairs) != MAP && walk.error == 0)
        walk.error = die(bus, VBUS_E_PROTOCOL);
    for (; pairs > 0 && walk.error == 0; pairs--) {
        walk_string(&walk, key, sizeof key);
        if (strcmp(key, list) == 0)
            found = walk_list(&walk, strcmp(list, "chips") == 0, name);
        else
            walk_past(&walk);
    }
    return walk.error < 0 ? walk.error : found;
}

/* Take the value of a chip's "cycle_ps". */
static uint64_t walk_cycle(struct walk *walk)
{
    unsigned type = (unsigned)walk_number(walk, 1);
    uint64_t value = type;

    if (type >= 0xCC && type <= 0xCF) {
        unsigned half = type == 0xCF ? 4 : 1U << (type - 0xCC);

        value = walk_number(walk, half);
        if (type == 0xCF)
            value = value << 32 | walk_number(walk, 4);
    }
    return value;
}

/* Take the list of chips: how long a bus cycle of each takes. */
static void walk_chips(struct walk *walk)
{
    char key[32];
    uint32_t count, pairs, turn;

    if (walk_head(walk, &count) != ARRAY && walk->error == 0)
        walk->error = die(walk->bus, VBUS_E_PROTOCOL);
    for (turn = 0; turn < count && walk->error == 0; turn++) {
        if (walk_head(walk, &pairs) != MAP && walk->error == 0)
            walk->error = die(walk->bus, VBUS_E_PROTOCOL);
        for (; pairs > 0 && walk->error == 0; pairs--) {
            walk_string(walk, key, sizeof key);
            if (strcmp(key, "cycle_ps") == 0 && turn < 16)
                walk->bus->cycles[turn] = walk_cycle(walk);
            else
                walk_past(walk);
        }
    }
}

/* Take the list of features. */
static void walk_features(struct walk *walk)
{
    char name[32];
    uint32_t count;

    if (walk_head(walk, &count) != ARRAY && walk->error == 0)
        walk->error = die(walk->bus, VBUS_E_PROTOCOL);
    for (; count > 0 && walk->error == 0; count--) {
        walk_string(walk, name, sizeof name);
        walk->bus->stamped_polls |= strcmp(name, "polled_at") == 0;
        walk->bus->foreseeing |= strcmp(name, "leases_ahead") == 0;
    }
}

int vbus_leases(struct vbus *bus, int on)
{
    unsigned char request[2];
    struct walk walk;
    char key[32];
    uint32_t pairs;
    int length = on ? ask_hello(bus) : 0;

    if (length < 0)
        return length;
    walk.bus = bus;
    walk.deadline = deadline_of(bus);
    walk.left = (size_t)length;
    walk.error = 0;
    if (on && walk_head(&walk, &pairs) != MAP && walk.error == 0)
        walk.error = die(bus, VBUS_E_PROTOCOL);
    for (; on && pairs > 0 && walk.error == 0; pairs--) {
        walk_string(&walk, key, sizeof key);
        if (strcmp(key, "chips") == 0)
            walk_chips(&walk);
        else if (strcmp(key, "features") == 0)
            walk_features(&walk);
        else
            walk_past(&walk);
    }
    if (walk.error < 0)
        return walk.error;
    bus->leasing = on != 0;
    request[0] = VBUS_LEASES;
    request[1] = low(on == 0 ? 0U : bus->foreseeing ? 2U : 1U);
    return post(bus, request, 2);
}
