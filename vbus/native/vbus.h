/* vbus.h - a virtual hardware bus from C.
 *
 * One header and one C99 file; no dependency beyond POSIX, no allocation, no global state. Builds
 * as C and as C++, for 32 and 64 bits. Every function but vbus_strerror takes the caller's own
 * struct vbus, keeps to calls that POSIX allows in signal handlers (and flock, in vbus_open, and
 * sched_yield), and works over any file descriptor that carries the byte protocol.
 *
 *     struct vbus bus;
 *     if (vbus_open(&bus, "pty:/run/vbus/bench-x") < 0) ...
 *     int status = vbus_read(&bus, 0);             one read cycle at address 0
 *     if (status < 0) puts(vbus_strerror(status));
 *
 * Functions return a value of 0 or more, or one of the negative errors below. Requests that have
 * no reply (writes, strobes, pins, delays) return when they are sent; if the board refuses one of
 * them, the next function that waits for a reply returns the refusal instead.
 *
 * Instants and durations are picoseconds. License: Apache-2.0.
 */
#ifndef VBUS_H
#define VBUS_H

#include <stddef.h>
#include <stdint.h>

#ifdef __cplusplus
extern "C" {
#endif

/* --- the byte protocol ------------------------------------------------------------------------ */

#define VBUS_VERSION 1

/* Requests: first byte. READ4 and WRITE4 have the address in their low four bits. */
#define VBUS_HELLO 0x01
#define VBUS_ECHO 0x02
#define VBUS_SELECT 0x03
#define VBUS_CLAIM 0x04
#define VBUS_UNCLAIM 0x05
#define VBUS_READ4 0x10
#define VBUS_WRITE4 0x20
#define VBUS_READ 0x30
#define VBUS_WRITE 0x31
#define VBUS_READS 0x32
#define VBUS_WRITES 0x33
#define VBUS_WAIT 0x34
#define VBUS_LINES 0x40
#define VBUS_DRIVE 0x41
#define VBUS_RELEASE 0x42
#define VBUS_SAMPLE 0x43
#define VBUS_PIN 0x44
#define VBUS_GETPIN 0x45
#define VBUS_DELAY 0x50
#define VBUS_AT 0x51
#define VBUS_NOW 0x52
#define VBUS_SYNC 0x53
#define VBUS_POLLED 0x54
#define VBUS_POLLED_AT 0x55
#define VBUS_PASS 0x56
#define VBUS_EVENTS 0x60
#define VBUS_LEASES 0x61

/* Replies: first byte. */
#define VBUS_TAG_HELLO 'V'
#define VBUS_TAG_ECHO 'E'
#define VBUS_TAG_CLAIM 'C'
#define VBUS_TAG_DATA 'D'
#define VBUS_TAG_LEASED 'L'
#define VBUS_TAG_FORESEEN 'M'
#define VBUS_TAG_BYTES 'B'
#define VBUS_TAG_WAIT 'R'
#define VBUS_TAG_SAMPLE 'P'
#define VBUS_TAG_NOW 'T'
#define VBUS_TAG_SYNC 'S'
#define VBUS_TAG_PASS 'W'
#define VBUS_TAG_EVENT 'I'
#define VBUS_TAG_PAUSED 'H'
#define VBUS_TAG_REFUSED 'X'

/* Reasons in a refusal. */
#define VBUS_REFUSED_UNKNOWN 1
#define VBUS_REFUSED_NO_SUCH 2
#define VBUS_REFUSED_BAD_AT 3
#define VBUS_REFUSED_BAD_LENGTH 4
#define VBUS_REFUSED_BAD_VERSION 5
#define VBUS_REFUSED_CLOSED 6
#define VBUS_REFUSED_NO_ROOM 7
#define VBUS_REFUSED_DEADLOCK 8

/* --- errors ----------------------------------------------------------------------------------- */

#define VBUS_E_SYSTEM (-1)   /* a system call failed; errno is in vbus.system */
#define VBUS_E_WHERE (-2)    /* not a link: see vbus_open */
#define VBUS_E_CLOSED (-3)   /* the other end has closed the link */
#define VBUS_E_TIMEOUT (-4)  /* no reply in time; the session is over */
#define VBUS_E_PROTOCOL (-5) /* what came is no reply; the session is over */
#define VBUS_E_ARGUMENT (-6) /* an argument out of range; nothing was sent */
#define VBUS_E_ORDER (-7)    /* replies asked for with vbus_ask_read must be taken first */
#define VBUS_E_NAME (-8)     /* no such name, or several chips have it */
#define VBUS_E_REFUSED(reason) (-16 - (reason)) /* vbus.refused is the request's number */

/* --- sessions --------------------------------------------------------------------------------- */

#define VBUS_MOST_ASKED 64          /* reads that may be asked for and not yet taken */
#define VBUS_NO_EDGE UINT64_MAX     /* vbus_sync: no edge is in sight */
#define VBUS_US UINT64_C(1000000)   /* a microsecond */
#define VBUS_MS UINT64_C(1000000000) /* a millisecond */

#define VBUS_PATH_ROOM 1024         /* characters of a link's name that are enough */

struct vbus {
    int fd;         /* the descriptor, or -1 */
    int timeout_ms; /* what a reply may take besides the time its requests let pass; -1: for ever;
                     * while the board is paused, replies are waited for as long */
    int system;     /* errno behind the last VBUS_E_SYSTEM */
    unsigned refused; /* number of the request refused last */

    /* Called for each edge reported (see vbus_events), from inside any function that waits. */
    void (*on_event)(void *context, uint32_t outputs, uint64_t instant);
    void *context;

    /* The rest is the library's own. */
    char pause_mark[VBUS_PATH_ROOM]; /* the file that is there while the board is paused, or "" */
    int is_socket, buffering, dead, pending, paused, told;
    uint16_t number, asked[VBUS_MOST_ASKED];
    unsigned ask_first, ask_count;
    uint64_t passing;
    size_t out_size, in_begin, in_end;
    int leasing, leased, stamped, unsent_stamp, stamped_polls, foreseeing, crowded;
    size_t run; /* where the number of bytes of an open POLLED_AT stands in `out`, or 0 */
    unsigned selected, lease_address, lease_data, lease_then, lease_polls;
    uint32_t lease_outputs;
    uint64_t lease_now, lease_until, lease_end, lease_cycle, stamp, run_end;
    uint64_t cycles[16];
    unsigned char out[2048], in[512];
};

/* Open a session. `where` is "pty:PATH" (or just the path), "unix:PATH" or "tcp:ADDRESS:PORT" with
 * a numeric IPv4 address or "localhost". A terminal is put into raw mode. A board that has begun to
 * start, as the lock of its name shows, is waited for up to 5 s. NULL, as getenv() returns it where
 * VBUS_LINK is not set, is no link: VBUS_E_WHERE. */
int vbus_open(struct vbus *bus, const char *where);

/* The same for a board that may still have to come: tries again for `wait_ms`; 0: once. */
int vbus_open_wait(struct vbus *bus, const char *where, int wait_ms);

/* Make a session of a descriptor that is open; vbus_close closes it. */
int vbus_attach(struct vbus *bus, int fd);

void vbus_close(struct vbus *bus);

/* A sentence about an error. */
const char *vbus_strerror(int error);

/* Ask for the description of the session (msgpack; docs/byte-protocol.md); store up to `size`
 * bytes of it and return how long it is. */
int vbus_hello(struct vbus *bus, unsigned char *description, size_t size);

/* Return the number of a name in one of HELLO's lists: "chips", "lines", "outputs" or "pins".
 * "x./RST" is found by that name, and by "/RST" if only one chip has it. */
int vbus_number(struct vbus *bus, const char *list, const char *name);

/* --- bus cycles ------------------------------------------------------------------------------- */

/* Following cycles go to these chips: bit n is chip n. At the start it is the first chip. */
int vbus_select(struct vbus *bus, unsigned mask);

/* Hold the selected chips' bus for a packet, or let it go. */
int vbus_claim(struct vbus *bus);
int vbus_unclaim(struct vbus *bus);

/* One cycle at address 0 to 255. A read returns the byte. */
int vbus_read(struct vbus *bus, unsigned address);
int vbus_write(struct vbus *bus, unsigned address, unsigned data);

/* 1 to 255 cycles at one address. */
int vbus_reads(struct vbus *bus, unsigned address, unsigned count, unsigned char *data);
int vbus_writes(struct vbus *bus, unsigned address, unsigned count, const unsigned char *data);

/* Let time pass until the chip takes the next cycle, at most `longest`: 1 if it does, else 0.
 * `instant` (or NULL) receives chip time. */
int vbus_wait(struct vbus *bus, uint64_t longest, uint64_t *instant);

/* --- several requests in one message ---------------------------------------------------------- */

/* Keep requests without a reply back, to travel with the next one that has a reply. */
void vbus_buffer(struct vbus *bus);

/* Send the requests held back, and hold back no more. */
int vbus_flush(struct vbus *bus);

/* Send the requests held back, and go on holding back. */
int vbus_send(struct vbus *bus);

/* Answer polls from leases (1) or ask the board each time (0, as at the start). On lockstep and
 * slaved boards a read without side effects tells how long its byte will stay; until then vbus_read
 * gives that byte without asking, and the board gets the number of them, so that time, counts and
 * traces are those of a host that asks. Such a host is alone on its board: over a socket it looks for a
 * reply for some 30 us before it sleeps. Asks for the description of the session. */
int vbus_leases(struct vbus *bus, int on);

/* Ask for a read cycle without waiting, and later take the bytes in the same order. */
int vbus_ask_read(struct vbus *bus, unsigned address);
int vbus_take_read(struct vbus *bus);

/* --- strobes and pins ------------------------------------------------------------------------- */

/* Put the control lines of `mask` to `levels`, all at one instant. */
int vbus_lines(struct vbus *bus, unsigned mask, unsigned levels);

/* Drive D0-D7, let them float, or look at them and (`outputs`, or NULL) at the output lines. */
int vbus_drive(struct vbus *bus, unsigned data);
int vbus_release(struct vbus *bus);
int vbus_sample(struct vbus *bus, uint32_t *outputs);

/* Drive side pin `pin` to 0 or 1, or let it go (2); or look at it. */
int vbus_pin(struct vbus *bus, unsigned pin, unsigned level);
int vbus_getpin(struct vbus *bus, unsigned pin);

/* --- time ------------------------------------------------------------------------------------- */

/* Let time pass for this host: what follows is answered that much later. */
int vbus_delay(struct vbus *bus, uint64_t duration);

/* The host's own clock, on slaved boards: the next cycle happens at `instant`. */
int vbus_at(struct vbus *bus, uint64_t instant);

/* Chip time. */
int vbus_now(struct vbus *bus, uint64_t *instant);

/* Bring the chips up to the host's time; output lines, and an instant before which none moves
 * (or VBUS_NO_EDGE). Either pointer may be NULL. */
int vbus_sync(struct vbus *bus, uint32_t *outputs, uint64_t *edge);

/* Let time pass until an edge of a line of vbus_events, at most `longest`; output lines, and how much
 * has passed. Either pointer may be NULL. */
int vbus_pass(struct vbus *bus, uint64_t longest, uint32_t *outputs, uint64_t *passed);

/* A fence: when it returns `number` (0 to 255), everything before it is done. */
int vbus_echo(struct vbus *bus, unsigned number);

/* Have each edge of the output lines in `mask` reported to on_event. */
int vbus_events(struct vbus *bus, uint32_t mask);

/* Wait up to `timeout_ms` for an event; 1 if on_event was called, else 0. */
int vbus_wait_event(struct vbus *bus, int timeout_ms);

#ifdef __cplusplus
}
#endif

#endif
