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
namespace {

struct pin_link chips;
bool is_open;
uint64_t own_time, period = 62500;
uint8_t drive[PIN_PORTS], level[PIN_PORTS];
bool (*serve)();
bool serving;

uint64_t time_stamp(void *)
{
    return own_time;
}

void leave()
{
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
    if (pin_link_open(&chips, where) == VBUS_E_SYSTEM) {
        fprintf(stderr, "vbus: %s: %s\n", where, strerror(chips.bus.system));
        exit(4);
    }
    must(chips.error);
    if (chips.pins.highest > 7)
        fail("the pin map uses a bit above 7; the ports of an AVR or PIC have bits 0 to 7");
    chips.clock = time_stamp;
    is_open = true;
    atexit(leave);
}

void access()
{
    open_link();
    if (chips.slaved)
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
    pin_decoder_look(&chips.pins, port);
    must(chips.error);
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
        run_end_access(own_time);
    }
    if (target > own_time)
        own_time = target;
    run_end_access(own_time);
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
    run_end_access(now);
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
    run_end_write(byte);
}

bool console_ready()
{
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
