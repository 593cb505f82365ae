/* ports.cpp - see ports.h. License: Apache-2.0. */
#include "ports.h"

#include "pin_link.h"

#include <poll.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <unistd.h>

namespace vbus_shim {
namespace {

struct pin_link chips;
bool is_open;
uint64_t own_time, period = 62500, limit = UINT64_MAX;
uint8_t drive[PIN_PORTS], level[PIN_PORTS];
bool (*serve)();
bool serving, middle; /* middle: of a line of text */
const char *until;
size_t matched;

uint64_t time_stamp(void *)
{
    return own_time;
}

void leave()
{
    if (is_open && chips.error == 0)
        pin_link_close(&chips);
    if (middle)
        putchar('\n');
    fflush(stdout);
}

void fail(const char *what)
{
    fflush(stdout);
    fprintf(stderr, "vbus: %s\n", what);
    is_open = false;
    exit(4);
}

void must(int error)
{
    if (error < 0)
        fail(pin_link_strerror(error));
}

void open_link()
{
    const char *where, *text;

    if (is_open)
        return;
    where = getenv("VBUS_LINK");
    if (where == NULL)
        fail("no board: set VBUS_LINK to a link with a pin map, such as unix:PATH");
    if (pin_link_open(&chips, where) == VBUS_E_SYSTEM) {
        fprintf(stderr, "vbus: %s: %s\n", where, strerror(chips.bus.system));
        exit(4);
    }
    must(chips.error);
    chips.clock = time_stamp;
    is_open = true;
    atexit(leave);
    text = getenv("VBUS_LIMIT_MS");
    if (text != NULL)
        limit = strtoull(text, NULL, 10) * VBUS_MS;
    until = getenv("VBUS_UNTIL");
}

void check_limit(uint64_t now)
{
    if (now < limit)
        return;
    fflush(stdout);
    if (until != NULL)
        fprintf(stderr, "vbus: %s did not come within %s ms\n", until, getenv("VBUS_LIMIT_MS"));
    exit(until != NULL);
}

void access()
{
    open_link();
    if (chips.slaved)
        own_time += period;
    check_limit(own_time);
}

void update(unsigned port)
{
    access();
    pin_decoder_port(&chips.pins, port, drive[port], level[port]);
    must(chips.error);
    serve_interrupts();
}

} // namespace

uint8_t port_drive(unsigned port)
{
    access();
    return drive[port];
}

uint8_t port_level(unsigned port)
{
    access();
    return level[port];
}

uint8_t port_input(unsigned port)
{
    access();
    return port_lines(port);
}

uint8_t port_lines(unsigned port)
{
    open_link();
    if (pin_link_watches(&chips, port)
        && (!chips.slaved || chips.touched || own_time >= chips.edge))
        must(pin_link_sync(&chips));
    return (uint8_t)pin_decoder_input(&chips.pins, port);
}

void set_drive(unsigned port, uint8_t value)
{
    drive[port] = value;
    update(port);
}

void set_level(unsigned port, uint8_t value)
{
    level[port] = value;
    update(port);
}

void set_clock_period(uint64_t value)
{
    period = value;
}

void pass(uint64_t duration)
{
    uint64_t target = own_time + duration;

    open_link();
    if (!chips.slaved) {
        must(vbus_delay(&chips.bus, duration));
        serve_interrupts();
        return;
    }
    while (serve != NULL && serve_interrupts() && chips.edge <= target && chips.edge > own_time) {
        own_time = chips.edge;
        check_limit(own_time);
    }
    if (target > own_time)
        own_time = target;
    check_limit(own_time);
    serve_interrupts();
}

uint64_t look_at_clock()
{
    uint64_t now;

    open_link();
    if (chips.slaved) {
        pass(chips.step);
        return own_time;
    }
    must(vbus_delay(&chips.bus, chips.step));
    must(vbus_now(&chips.bus, &now));
    check_limit(now);
    return now;
}

bool own_clock(uint64_t *now)
{
    access();
    *now = own_time;
    return chips.slaved;
}

void set_interrupts(bool (*how)())
{
    serve = how;
}

bool serve_interrupts()
{
    bool enabled;

    if (serve == NULL || serving || !is_open || chips.pins.output_count == 0)
        return false;
    serving = true;
    enabled = serve();
    serving = false;
    return enabled;
}

void sleep()
{
    open_link();
    if (!chips.slaved) {
        pass(10 * VBUS_US);
        return;
    }
    if (chips.touched || own_time >= chips.edge)
        must(pin_link_sync(&chips));
    if (chips.edge == VBUS_NO_EDGE) {
        fprintf(stderr, "vbus: the program sleeps for ever\n");
        exit(1);
    }
    pass(chips.edge > own_time ? chips.edge - own_time : period);
}

void console_write(uint8_t byte)
{
    open_link();
    putchar(byte);
    middle = byte != '\n';
    if (until == NULL)
        return;
    while (matched > 0 && until[matched] != (char)byte) {
        size_t shorter = matched - 1;

        while (shorter > 0 && strncmp(until, until + matched - shorter, shorter) != 0)
            shorter--;
        matched = shorter;
    }
    if (until[matched] == (char)byte && until[++matched] == '\0')
        exit(0);
}

bool console_ready()
{
    struct pollfd in = {0, POLLIN, 0};

    fflush(stdout);
    return poll(&in, 1, 0) == 1 && in.revents & POLLIN;
}

int console_read()
{
    unsigned char byte;

    return console_ready() && read(0, &byte, 1) == 1 ? byte : -1;
}

} // namespace vbus_shim
