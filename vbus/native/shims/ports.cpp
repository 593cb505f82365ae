/* ports.cpp - see ports.h. License: Apache-2.0. */
#define VBUS_SHIM_SOURCE
#include "ports.h"

#include "pin_link.h"
#include "run_end.h"

#include <poll.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <unistd.h>

namespace vbus_shim {

unsigned in_shim;

namespace {

struct pin_link chips;
bool is_open;
const uint64_t NEVER = UINT64_MAX;
uint64_t own_time, period = 62500, alarm_at = NEVER, owed;
port_t drive[PIN_PORTS], level[PIN_PORTS], pull_down[PIN_PORTS];
bool (*serve)();
bool serving;

uint64_t time_stamp(void *)
{
    return own_time;
}

void leave()
{
    Inside shim;

    if (is_open && chips.error == 0)
        pin_link_close(&chips);
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
    const char *where;

    if (is_open)
        return;
    where = getenv("VBUS_LINK");
    if (where == NULL)
        fail("no board: set VBUS_LINK to a link with a pin map, such as unix:PATH");
    if (pin_link_open(&chips, where, VBUS_PORT_BITS) == VBUS_E_SYSTEM) {
        fprintf(stderr, "vbus: %s: %s\n", where, strerror(chips.bus.system));
        exit(4);
    }
    must(chips.error);
    chips.clock = time_stamp;
    is_open = true;
    atexit(leave);
}

void settle()
{
    uint64_t duration = owed;

    owed = 0;
    if (duration)
        pass(duration);
}

void access()
{
    settle();
    open_link();
    if (chips.slaved || alarm_at != NEVER)
        own_time += period;
    run_end_access(own_time);
}

void update(unsigned port)
{
    access();
    pin_decoder_port(&chips.pins, port, drive[port], level[port]);
    must(chips.error);
    serve_interrupts();
}

} // namespace

port_t port_drive(unsigned port)
{
    Inside shim;

    access();
    return drive[port];
}

port_t port_level(unsigned port)
{
    Inside shim;

    access();
    return level[port];
}

port_t port_input(unsigned port)
{
    Inside shim;

    access();
    return port_lines(port);
}

port_t port_lines(unsigned port)
{
    Inside shim;

    open_link();
    if (pin_link_watches(&chips, port)
        && (!chips.slaved || chips.touched || own_time >= chips.edge))
        must(pin_link_sync(&chips));
    pin_decoder_look(&chips.pins, port);
    must(chips.error);
    return (port_t)(pin_decoder_input(&chips.pins, port)
                    & ~(pull_down[port] & ~(drive[port] | chips.pins.driven[port])));
}

void set_port(unsigned port, port_t driven, port_t value)
{
    Inside shim;

    drive[port] = driven;
    level[port] = value;
    update(port);
}

void set_pull_down(unsigned port, port_t pins)
{
    pull_down[port] = pins;
}

void set_drive(unsigned port, port_t value)
{
    set_port(port, value, level[port]);
}

void set_level(unsigned port, port_t value)
{
    set_port(port, drive[port], value);
}

void set_clock_period(uint64_t value)
{
    period = value;
}

/* In steps that end where interrupts are to be served. */
void pass(uint64_t duration)
{
    Inside shim;
    uint64_t target = own_time + duration, stop;

    open_link();
    do {
        stop = target;
        if (serve_interrupts() && chips.slaved && chips.edge > own_time && chips.edge < stop)
            stop = chips.edge;
        if (alarm_at > own_time && alarm_at < stop)
            stop = alarm_at;
        if (stop <= own_time)
            break;
        if (!chips.slaved)
            must(vbus_delay(&chips.bus, stop - own_time));
        own_time = stop;
        run_end_access(own_time);
    } while (stop < target);
    serve_interrupts();
}

uint64_t own_instant()
{
    return own_time + owed;
}

void set_alarm(uint64_t instant)
{
    alarm_at = instant;
}

void compute(uint64_t duration)
{
    Inside shim;

    owed += duration;
    if (owed >= (!is_open || chips.slaved ? VBUS_US : 100 * VBUS_US))
        settle();
}

uint64_t look_at_clock()
{
    Inside shim;
    uint64_t now;

    open_link();
    if (chips.slaved) {
        pass(chips.step);
        return own_time;
    }
    must(vbus_delay(&chips.bus, chips.step));
    must(vbus_now(&chips.bus, &now));
    run_end_access(now);
    return now;
}

bool own_clock(uint64_t *now)
{
    Inside shim;

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
    Inside shim;
    bool enabled;

    if (serve == NULL || serving || !is_open
        || (chips.pins.output_count == 0 && alarm_at == NEVER))
        return false;
    serving = true;
    enabled = serve();
    serving = false;
    return enabled;
}

void sleep()
{
    Inside shim;
    uint64_t wake = alarm_at;

    open_link();
    if (!chips.slaved) {
        pass(10 * VBUS_US);
        return;
    }
    if (chips.touched || own_time >= chips.edge)
        must(pin_link_sync(&chips));
    wake = chips.edge < wake ? chips.edge : wake;
    if (wake == NEVER) {
        fprintf(stderr, "vbus: the program sleeps for ever\n");
        exit(1);
    }
    pass(wake > own_time ? wake - own_time : period);
}

void console_write(uint8_t byte)
{
    Inside shim;
    open_link();
    run_end_write(byte);
}

bool console_ready()
{
    Inside shim;
    struct pollfd in = {0, POLLIN, 0};

    fflush(NULL);
    return poll(&in, 1, 0) == 1 && in.revents & POLLIN;
}

int console_read()
{
    unsigned char byte;

    return console_ready() && read(0, &byte, 1) == 1 ? byte : -1;
}

} // namespace vbus_shim
