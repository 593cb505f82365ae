/* vbus-avr - runs AVR firmware whose port bits are wired to the chips of a vbus board.
 *
 * Copyright (C) 2026 The vbus developers
 *
 * This program is free software: you can redistribute it and/or modify it under the terms of the GNU
 * General Public License as published by the Free Software Foundation, either version 3 of the
 * License, or (at your option) any later version. It is distributed in the hope that it will be
 * useful, but WITHOUT ANY WARRANTY; without even the implied warranty of MERCHANTABILITY or FITNESS
 * FOR A PARTICULAR PURPOSE. See the GNU General Public License (COPYING) for more details.
 *
 * It is a program of its own because libsimavr is under that licence; it speaks to vbus over a
 * socket.
 */
#define _GNU_SOURCE

#include <ctype.h>
#include <errno.h>
#include <fcntl.h>
#include <getopt.h>
#include <poll.h>
#include <stdarg.h>
#include <stdint.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <termios.h>
#include <time.h>
#include <unistd.h>

#include <simavr/avr_extint.h>
#include <simavr/avr_ioport.h>
#include <simavr/avr_twi.h>
#include <simavr/avr_uart.h>
#include <simavr/sim_avr.h>
#include <simavr/sim_core.h>
#include <simavr/sim_elf.h>
#include <simavr/sim_gdb.h>

#include "pin_link.h"

enum { OK = 0, FAILURE = 1, USAGE = 2, NO_LINK = 4 };

#define SECOND UINT64_C(1000000000000)
#define LOOK_MS 1 /* how often the terminal and the wall clock are looked at, in AVR time */
#define RJMP_SELF 0xCFFF
#define CLI 0x94F8

/* One port of the AVR: simavr's own handlers, and where its registers are. */
struct port {
    unsigned number;
    avr_ioport_t *port;
    avr_io_write_t write[3]; /* PORT, DDR, PIN */
    void *param[3];
    avr_irq_t *irq; /* of bit 0; the others follow */
    unsigned watched;
};

/* An external interrupt that may be one of a low level. */
struct level {
    avr_extint_t *ints;
    unsigned number;
    avr_io_addr_t pin; /* register and bit it is seen in */
    unsigned bit;
};

static struct {
    avr_t *avr;
    struct pin_link link;
    struct port ports[PIN_PORTS];
    struct level levels[EXTINT_COUNT];
    unsigned level_count;
    unsigned ramend; /* of the part itself: the external memory bus begins behind it */
    uint64_t ahead;  /* clock cycles until the access under way is on the bus */
    uint64_t due;    /* before this cycle no timer of the AVR is, but for those set since */
    uint64_t frequency, limit;
    int stop, code, outputs;

    const char *until;
    size_t matched;
    int until_port, until_bit, until_level;
    const char *awaited;

    avr_twi_t *twi;
    avr_irq_t *twi_in;
    unsigned twi_port, scl, sda; /* where its pins are, a bit each */
    unsigned twi_low;            /* those that it pulls low */
    int twi_addressed;           /* an address was sent, and its status has not come */

    int terminal, kept, pace;
    struct timespec began;
    avr_irq_t *uart_in;
    int uart_ready, middle; /* middle: of a line of text */
} sim;

static void stop(int code, const char *message, ...) __attribute__((format(printf, 2, 3)));

static void stop(int code, const char *message, ...)
{
    va_list arguments;

    if (sim.stop)
        return;
    sim.stop = 1;
    sim.code = code;
    if (message != NULL) {
        fflush(stdout);
        fprintf(stderr, "vbus-avr: ");
        va_start(arguments, message);
        vfprintf(stderr, message, arguments);
        va_end(arguments);
        fprintf(stderr, "\n");
    }
}

/* --- time --------------------------------------------------------------------------------------- */

static uint64_t ps_of(uint64_t cycle)
{
    uint64_t us = cycle % sim.frequency * 1000000;

    return cycle / sim.frequency * SECOND + us / sim.frequency * 1000000
           + us % sim.frequency * 1000000 / sim.frequency;
}

/* The first cycle that begins at `instant` or later. */
static uint64_t cycle_at(uint64_t instant)
{
    uint64_t rest = instant % SECOND;
    uint64_t cycle = instant / SECOND * sim.frequency + rest / 1000000 * sim.frequency / 1000000;

    while (ps_of(cycle) < instant)
        cycle++;
    return cycle;
}

/* The time of a request; bytes on the TWI may have been ahead of the instruction. */
static uint64_t now(void *context)
{
    static uint64_t latest;
    uint64_t instant = ps_of(sim.avr->cycle + sim.ahead);

    (void)context;
    latest = instant > latest ? instant : latest;
    return latest;
}

/* --- interrupt lines and other outputs of chips --------------------------------------------------- */

static avr_cycle_count_t look_at_outputs(avr_t *avr, avr_cycle_count_t when, void *param);

/* Put the levels of output lines at the AVR's pins. */
static void show_outputs(void)
{
    unsigned turn, bit;

    for (turn = 0; turn < PIN_PORTS; turn++) {
        struct port *port = &sim.ports[turn];
        unsigned levels = sim.link.pins.external[turn];
        avr_ioport_external_t pulls;

        if (port->port == NULL || !port->watched)
            continue;
        memset(&pulls, 0, sizeof pulls);
        pulls.name = (unsigned char)port->port->name;
        pulls.mask = port->watched & 0xFF;
        pulls.value = levels & port->watched;
        avr_ioctl(sim.avr, AVR_IOCTL_IOPORT_SET_EXTERNAL(port->port->name), &pulls);
        for (bit = 0; bit < 8; bit++)
            if (port->watched >> bit & 1)
                avr_raise_irq(port->irq + bit, levels >> bit & 1);
    }
}

static void failed(int error)
{
    if (error < 0)
        stop(NO_LINK, "the board is lost: %s", pin_link_strerror(error));
}

/* Take the lines' levels as told last, and look again when the next one may move. */
static void take_outputs(void)
{
    avr_cycle_timer_cancel(sim.avr, look_at_outputs, NULL);
    sim.link.told = 0;
    show_outputs();
    if (sim.link.edge != VBUS_NO_EDGE && sim.link.edge / SECOND < UINT64_C(10000000)) {
        uint64_t due = cycle_at(sim.link.edge), here = sim.avr->cycle;

        avr_cycle_timer_register(sim.avr, due > here ? due - here : 1, look_at_outputs, NULL);
    }
}

/* Learn the lines' levels now. */
static void sync_outputs(void)
{
    failed(pin_link_sync(&sim.link));
    if (!sim.stop)
        take_outputs();
}

static avr_cycle_count_t look_at_outputs(avr_t *avr, avr_cycle_count_t when, void *param)
{
    (void)avr;
    (void)when;
    (void)param;
    sync_outputs();
    return 0;
}

/* --- ports ---------------------------------------------------------------------------------------- */

static unsigned taken_by_the_bus(unsigned port);

static void port_moved(struct port *port)
{
    avr_t *avr = sim.avr;
    unsigned drive = avr->data[port->port->r_ddr], level = avr->data[port->port->r_port];
    unsigned taken = taken_by_the_bus(port->number);

    if (sim.twi != NULL && port->number == sim.twi_port && avr_regbit_get(avr, sim.twi->twen)) {
        taken |= sim.scl | sim.sda;
        drive = (drive & ~taken) | sim.twi_low;
    }
    drive &= ~taken | sim.twi_low;
    level &= ~taken;
    if (sim.stop)
        return;
    if (sim.link.pins.drive[port->number] == drive && sim.link.pins.level[port->number] == level)
        return;
    pin_decoder_port(&sim.link.pins, port->number, drive, level);
    if (sim.link.error != 0)
        failed(sim.link.error);
    else if (sim.outputs && sim.link.touched)
        sync_outputs();
    else if (sim.outputs && sim.link.told)
        take_outputs();
    if (sim.until_port == (int)port->number && drive >> sim.until_bit & 1
        && (int)(level >> sim.until_bit & 1) == sim.until_level)
        stop(OK, NULL);
}

/* Tell those parts of the AVR that listen to a pin; most often it is as they were told last. */
static void tell_pin(avr_irq_t *irq, uint32_t level)
{
    if (irq->value != level || irq->flags & IRQ_FLAG_INIT)
        avr_raise_irq(irq, level);
}

/* PORT or DDR is written. simavr's own asks the listeners of each pin, of which there are many. */
static void write_register(avr_t *avr, avr_io_addr_t address, uint8_t value, void *param)
{
    struct port *port = param;
    const avr_ioport_t *own = port->port;
    int which = address != own->r_port;
    avr_irq_t *pin = port->irq;
    unsigned level, drive, pulled, up, told, shown;

    if (avr->gdb != NULL || avr->io[AVR_DATA_TO_IO(own->r_port)].irq != NULL) {
        port->write[which](avr, address, value, port->param[which]);
        port_moved(port);
        return;
    }
    avr->data[address] = value;
    tell_pin(pin + (which == 0 ? IOPORT_IRQ_REG_PORT : IOPORT_IRQ_DIRECTION_ALL), value);
    level = avr->data[own->r_port];
    drive = avr->data[own->r_ddr];
    pulled = own->external.pull_mask & ~drive;
    up = level & ~drive & ~pulled;
    shown = (level & drive) | (own->external.pull_value & pulled) | up;
    for (told = drive | pulled | up; told != 0; told >>= 1, shown >>= 1, pin++)
        if (told & 1)
            tell_pin(pin, shown & 1);
    shown = ((avr->data[own->r_pin] & ~drive) | (level & drive)) & ~own->external.pull_mask & 0xFF;
    tell_pin(port->irq + IOPORT_IRQ_PIN_ALL, shown | own->external.pull_value);
    port_moved(port);
}

/* Ones toggle. SBI touches one bit only, though simavr computes it as a read, an OR and a write. */
static void write_pin(avr_t *avr, avr_io_addr_t address, uint8_t value, void *param)
{
    struct port *port = param;

    if (avr->flash[avr->pc + 1] == 0x9A)
        value = (uint8_t)(1U << (avr->flash[avr->pc] & 7));
    port->write[2](avr, address, value, port->param[2]);
    port_moved(port);
}

static uint8_t read_pin(avr_t *avr, avr_io_addr_t address, void *param)
{
    struct port *port = param;

    pin_decoder_look(&sim.link.pins, port->number);
    if (sim.link.error != 0)
        failed(sim.link.error);
    avr->data[address] = (uint8_t)pin_decoder_input(&sim.link.pins, port->number);
    return avr->data[address];
}

static void take_over(struct port *port, int which, avr_io_addr_t address, avr_io_write_t mine)
{
    unsigned io = AVR_DATA_TO_IO(address);

    port->write[which] = sim.avr->io[io].w.c;
    port->param[which] = sim.avr->io[io].w.param;
    sim.avr->io[io].w.c = mine;
    sim.avr->io[io].w.param = port;
}

static void find_ports(void)
{
    avr_io_t *io;
    unsigned turn;

    for (io = sim.avr->io_port; io != NULL; io = io->next) {
        avr_ioport_t *found = (avr_ioport_t *)io;
        struct port *port;
        unsigned number;

        if (strcmp(io->kind, "port") != 0)
            continue;
        number = (unsigned)(found->name - 'A');
        if (number >= PIN_PORTS)
            continue;
        port = &sim.ports[number];
        port->number = number;
        port->port = found;
        port->irq = avr_io_getirq(sim.avr, AVR_IOCTL_IOPORT_GETIRQ(found->name), 0);
        take_over(port, 0, found->r_port, write_register);
        take_over(port, 1, found->r_ddr, write_register);
        take_over(port, 2, found->r_pin, write_pin);
        sim.avr->io[AVR_DATA_TO_IO(found->r_pin)].r.c = read_pin;
        sim.avr->io[AVR_DATA_TO_IO(found->r_pin)].r.param = port;
    }
    for (turn = 0; turn < sim.link.pins.output_count; turn++) {
        const struct pin_source *source = &sim.link.pins.outputs[turn].source;

        sim.outputs = 1;
        sim.ports[source->port].watched |= 1U << source->bit;
    }
}

/* The port of a pin that the part does not have, or -1. */
static int missing_among(const struct pin_side *list, unsigned count)
{
    unsigned turn;

    for (turn = 0; turn < count; turn++)
        if (list[turn].source.kind == 1 && sim.ports[list[turn].source.port].port == NULL)
            return list[turn].source.port;
    return -1;
}

/* The port of a wire that the part does not have, or -1. */
static int missing_port(void)
{
    const struct pin_decoder *pins = &sim.link.pins;
    unsigned chip, line;
    int port;

    for (chip = 0; chip < pins->chip_count; chip++) {
        /* The sources of a chip lie one behind the other. */
        const struct pin_source *all = &pins->chips[chip].select;

        for (line = 0; line < 4 + 8 + 8 + 8; line++)
            if (all[line].kind == 1 && sim.ports[all[line].port].port == NULL)
                return all[line].port;
    }
    port = missing_among(pins->sides, pins->side_count);
    if (port < 0)
        port = missing_among(pins->lines, pins->line_count);
    return port < 0 ? missing_among(pins->outputs, pins->output_count) : port;
}

/* --- interrupts of a low level --------------------------------------------------------------------
 *
 * An external interrupt is one of a low level after a reset. For those simavr looks at the pin after
 * each instruction as long as it is low, whether the interrupt is enabled or not; where the pins are a
 * data bus, that is most of all it does. It is told not to, and here the pin is looked at while the
 * interrupt is enabled.
 */

static avr_cycle_count_t look_at_level(avr_t *avr, avr_cycle_count_t when, void *param)
{
    struct level *level = param;
    avr_int_vector_t *vector = &level->ints->eint[level->number].vector;

    if (!avr_regbit_get(avr, vector->enable) || avr->data[level->pin] >> level->bit & 1
        || avr_regbit_get_array(avr, level->ints->eint[level->number].isc, 2) != 0)
        return 0;
    if (avr->sreg[S_I] && !vector->pending)
        avr_raise_interrupt(avr, vector);
    return when + 1;
}

static void pin_of_level_moved(avr_irq_t *irq, uint32_t value, void *param)
{
    struct level *level = param;

    if (!value && avr_regbit_get(sim.avr, level->ints->eint[irq->irq].vector.enable))
        avr_cycle_timer_register(sim.avr, 1, look_at_level, level);
}

static void write_enables(avr_t *avr, avr_io_addr_t address, uint8_t value, void *param)
{
    unsigned turn;

    (void)param;
    avr_core_watch_write(avr, address, value);
    for (turn = 0; turn < sim.level_count; turn++)
        avr_cycle_timer_register(avr, 1, look_at_level, &sim.levels[turn]);
}

static void find_levels(void)
{
    avr_io_t *io = sim.avr->io_port;
    avr_extint_t *ints;
    unsigned number;

    while (io != NULL && strcmp(io->kind, "extint") != 0)
        io = io->next;
    ints = (avr_extint_t *)io;
    for (number = 0; ints != NULL && number < EXTINT_COUNT; number++) {
        struct level *level = &sim.levels[sim.level_count];
        avr_io_addr_t enables = ints->eint[number].vector.enable.reg;

        if (ints->eint[number].isc[1].reg == 0)
            continue; /* there is none, or one of edges */
        sim.level_count++;
        level->ints = ints;
        level->number = number;
        level->pin = sim.ports[(ints->eint[number].port_ioctl & 0xFF) - 'A'].port->r_pin;
        level->bit = ints->eint[number].port_pin;
        avr_extint_set_strict_lvl_trig(sim.avr, (uint8_t)number, 0);
        avr_irq_register_notify(ints->io.irq + number, pin_of_level_moved, level);
        if (sim.avr->io[AVR_DATA_TO_IO(enables)].w.c != write_enables)
            avr_register_io_write(sim.avr, enables, write_enables, NULL);
    }
}

/* --- external memory -------------------------------------------------------------------------------
 *
 * simavr knows no memory but its own. It is given so much that each access ends there, and what the
 * chips have to do with it is done around the instruction: before a load the byte is fetched, after a
 * store it is sent.
 */

#define ALL_OF_IT 0xFFFF
#define XMCRA 0x74
#define XMCRB 0x75
#define SRE 0x80
#define PORTC 0x28
#define DDRC 0x27
#define SECTOR 0x2000

struct access {
    enum { NONE, LOAD, STORE } kind;
    unsigned address;
};

static const char *const WITH_A_BUS[] = {
    "atmega640", "atmega1280", "atmega1281", "atmega2560", "atmega2561", NULL,
};

static int has_a_bus(const char *part)
{
    const char *const *known = WITH_A_BUS;

    while (*known != NULL && strcmp(*known, part) != 0)
        known++;
    return *known != NULL;
}

static unsigned pair(unsigned number)
{
    return sim.avr->data[number] | sim.avr->data[number + 1] << 8;
}

/* What the instruction at the program counter does to data memory, pushes and calls left out. */
static struct access next_access(void)
{
    const unsigned char *flash = sim.avr->flash + sim.avr->pc;
    unsigned code = flash[0] | flash[1] << 8, down = 0;
    struct access found = {code & 0x0200 ? STORE : LOAD, 0};

    if ((code & 0xD000) == 0x8000) { /* LDD, STD, LD and ST by Y or Z */
        found.address = pair(code & 8 ? 28 : 30)
                        + ((code & 7) | (code >> 7 & 0x18) | (code >> 8 & 0x20));
    } else if ((code & 0xFC00) == 0x9000) {
        switch (code & 15) {
        case 0: found.address = flash[2] | flash[3] << 8; break; /* LDS, STS */
        case 2: down = 1; /* fall through */
        case 1: found.address = pair(30); break;
        case 10: down = 1; /* fall through */
        case 9: found.address = pair(28); break;
        case 14: down = 1; /* fall through */
        case 12: case 13: found.address = pair(26); break;
        default: found.kind = NONE;
        }
    } else {
        found.kind = NONE;
    }
    found.address = (found.address - down) & 0xFFFF;
    if (found.address <= sim.ramend)
        found.kind = NONE;
    return found;
}

/* Address lines that XMM2:0 gives back are those of port C. */
static unsigned on_the_bus(unsigned address)
{
    unsigned count = sim.avr->data[XMCRB] & 7;
    unsigned mine = count == 7 ? 0 : 0xFF >> count, port = sim.avr->data[PORTC] & sim.avr->data[DDRC];

    return (address & 0xFF) | ((address >> 8 & mine) | (port & ~mine & 0xFF)) << 8;
}

/* The bits of a port that are the memory interface while it is on: port A, the address lines of port C
 * that XMM does not free, and /WR, /RD and ALE on port G. They are no port bits then. */
static unsigned taken_by_the_bus(unsigned port)
{
    unsigned count;

    if (sim.link.card.count == 0 || !(sim.avr->data[XMCRA] & SRE))
        return 0;
    count = sim.avr->data[XMCRB] & 7;
    return port == 0 ? 0xFF : port == 2 ? (count == 7 ? 0 : 0xFF >> count) : port == 6 ? 0x07 : 0;
}

static void write_control(avr_t *avr, avr_io_addr_t address, uint8_t value, void *param)
{
    static const unsigned PORTS[] = {0, 2, 6};
    unsigned turn;

    (void)param;
    avr->data[address] = value;
    for (turn = 0; turn < sizeof PORTS / sizeof *PORTS; turn++)
        if (sim.ports[PORTS[turn]].port != NULL)
            port_moved(&sim.ports[PORTS[turn]]);
}

/* One clock cycle more than internal memory, and the wait states of the sector. */
static unsigned extra_cycles(unsigned address)
{
    unsigned control = sim.avr->data[XMCRA], limit = control >> 4 & 7;

    return 1 + (limit > 0 && address < limit * SECTOR ? control & 3 : control >> 2 & 3);
}

static void say_once(const char *message, unsigned address)
{
    static const char *said[4];
    unsigned turn = 0;

    while (turn < 4 && said[turn] != NULL && said[turn] != message)
        turn++;
    if (turn == 4 || said[turn] == message)
        return;
    said[turn] = message;
    fflush(stdout);
    fprintf(stderr, "vbus-avr: %s: address %04X, by the instruction at %05X\n", message, address,
            (unsigned)sim.avr->pc);
}

/* What the bus does in an access; `data` is the byte of a store. Returns that of a load. */
static unsigned bus_access(struct access access, unsigned data)
{
    unsigned address = on_the_bus(access.address);
    const struct card_port *port
        = card_table_find(&sim.link.card, address, access.kind == STORE);

    if (port == NULL) {
        say_once("no chip answers on the external memory bus", address);
        return 0xFF;
    }
    if (port->answers && access.kind == STORE)
        pin_link_write(&sim.link, 1U << port->chip, port->chip_address, data);
    else if (port->answers)
        data = pin_link_read(&sim.link, 1U << port->chip, port->chip_address);
    if (port->acknowledges) {
        pin_link_side(&sim.link, port->pin, 0);
        pin_link_side(&sim.link, port->pin, 2);
    }
    failed(sim.link.error);
    return data | port->floating;
}

/* An instruction with the bus around it; returns where the next one is. */
static avr_flashaddr_t run_with_a_bus(avr_t *avr)
{
    struct access access = next_access();
    avr_flashaddr_t after;
    unsigned extra = 0;

    if (access.kind != NONE && !(avr->data[XMCRA] & SRE)) {
        say_once("the external memory interface is off (SRE)", access.address);
        access.kind = NONE;
        avr->data[next_access().address] = 0xFF;
    }
    if (access.kind != NONE)
        extra = extra_cycles(access.address);
    if (access.kind == LOAD) {
        sim.ahead = 2 + extra;
        avr->data[access.address] = (uint8_t)bus_access(access, 0);
        sim.ahead = 0;
    }
    after = avr_run_one(avr);
    avr->cycle += extra;
    if (access.kind == STORE)
        bus_access(access, avr->data[access.address]);
    if (access.kind != NONE && sim.outputs && !sim.stop) {
        if (sim.link.touched)
            sync_outputs();
        else if (sim.link.told)
            take_outputs();
    }
    return after;
}

/* --- TWI -------------------------------------------------------------------------------------------
 *
 * simavr's TWI speaks in bytes, and cares little for how long they take. Here they become moves of SCL
 * and SDA: a bit every microsecond, one byte behind the other.
 */

static const struct {
    const char *part;
    char port;
    unsigned char scl, sda;
} TWI_PINS[] = {
    {"atmega48", 'C', 5, 4}, {"atmega88", 'C', 5, 4}, {"atmega168", 'C', 5, 4}, {"atmega328", 'C', 5, 4},
    {"atmega8", 'C', 5, 4}, {"atmega164", 'C', 0, 1}, {"atmega324", 'C', 0, 1}, {"atmega644", 'C', 0, 1},
    {"atmega1284", 'C', 0, 1}, {"atmega16", 'C', 0, 1}, {"atmega32", 'C', 0, 1}, {"atmega640", 'D', 0, 1},
    {"atmega128", 'D', 0, 1}, {"atmega256", 'D', 0, 1}, {"atmega64", 'D', 0, 1},
};

/* Let SCL and SDA be at these levels a third of a microsecond further on; what is on SDA then. */
static unsigned twi_move(unsigned scl, unsigned sda)
{
    static uint64_t moved; /* at which cycle */
    struct port *port = &sim.ports[sim.twi_port];

    moved = (moved > sim.avr->cycle ? moved : sim.avr->cycle) + sim.frequency / 3000000;
    sim.ahead = moved - sim.avr->cycle;
    sim.twi_low = (scl ? 0 : sim.scl) | (sda ? 0 : sim.sda);
    port_moved(port);
    return (sim.link.pins.external[sim.twi_port] & sim.sda) != 0;
}

/* Nine bits, of which SDA is let go where they are 1; what has been on it. */
static unsigned twi_bits(unsigned bits)
{
    unsigned place, found = 0;

    for (place = 0; place < 9; place++) {
        unsigned bit = bits >> (8 - place) & 1;

        twi_move(0, bit);
        found = found << 1 | twi_move(1, bit);
        twi_move(0, bit);
    }
    return found;
}

static void twi_out(avr_irq_t *irq, uint32_t value, void *param)
{
    avr_twi_msg_irq_t message;
    uint64_t own = sim.ahead;
    unsigned found;

    (void)irq;
    (void)param;
    message.u.v = value;
    /* simavr 1.6 leaves TWINT set, and firmware that polls it would take the status before. */
    avr_regbit_clear(sim.avr, sim.twi->twi.raised);
    if (message.u.twi.msg & TWI_COND_START) {
        sim.twi_addressed = 1;
        twi_move(!(sim.twi_low & sim.scl), 1);
        twi_move(1, 1);
        twi_move(1, 0); /* the start, or one that is repeated */
        found = twi_bits((unsigned)message.u.twi.addr << 1 | 1);
        if (!(found & 1))
            avr_raise_irq(sim.twi_in, avr_twi_irq_msg(TWI_COND_ACK, message.u.twi.addr, 1));
    } else if (message.u.twi.msg & TWI_COND_WRITE) {
        found = twi_bits((unsigned)message.u.twi.data << 1 | 1);
        if (!(found & 1))
            avr_raise_irq(sim.twi_in, avr_twi_irq_msg(TWI_COND_ACK, message.u.twi.addr, 1));
    } else if (message.u.twi.msg & TWI_COND_READ) {
        found = twi_bits(0x1FE | !avr_regbit_get(sim.avr, sim.twi->twea));
        avr_raise_irq(sim.twi_in,
                      avr_twi_irq_msg(TWI_COND_READ, message.u.twi.addr, (uint8_t)(found >> 1)));
    }
    if (message.u.twi.msg & TWI_COND_STOP) {
        twi_move(0, 0);
        twi_move(1, 0);
        twi_move(1, 1);
    }
    /* The processor waits until the lines have moved: what it does next comes behind that. */
    if (sim.ahead > own)
        sim.avr->cycle += sim.ahead - own;
    sim.ahead = own;
}

/* simavr 1.6 gives an address that is to be written to the status of a data byte: 28h for 18h. */
static void twi_status(avr_irq_t *irq, uint32_t value, void *param)
{
    (void)irq;
    (void)param;
    if (sim.twi_addressed && (value == 0x28 || value == 0x30))
        avr_regbit_setto_raw(sim.avr, sim.twi->twsr, value - 0x10);
    sim.twi_addressed = 0;
}

static void open_twi(const char *part)
{
    avr_io_t *io = sim.avr->io_port;
    unsigned turn = 0, count = sizeof TWI_PINS / sizeof *TWI_PINS;

    while (turn < count && strncmp(part, TWI_PINS[turn].part, strlen(TWI_PINS[turn].part)) != 0)
        turn++;
    while (io != NULL && strcmp(io->kind, "twi") != 0)
        io = io->next;
    if (io == NULL || turn == count)
        return;
    sim.twi_port = (unsigned)(TWI_PINS[turn].port - 'A');
    sim.scl = 1U << TWI_PINS[turn].scl;
    sim.sda = 1U << TWI_PINS[turn].sda;
    if (!(sim.ports[sim.twi_port].watched & sim.sda))
        return; /* nothing is wired there */
    sim.twi = (avr_twi_t *)io;
    sim.twi_in = avr_io_getirq(sim.avr, AVR_IOCTL_TWI_GETIRQ(sim.twi->name), TWI_IRQ_INPUT);
    avr_irq_register_notify(
        avr_io_getirq(sim.avr, AVR_IOCTL_TWI_GETIRQ(sim.twi->name), TWI_IRQ_OUTPUT), twi_out, NULL);
    avr_irq_register_notify(
        avr_io_getirq(sim.avr, AVR_IOCTL_TWI_GETIRQ(sim.twi->name), TWI_IRQ_STATUS), twi_status, NULL);
}

/* --- UART ----------------------------------------------------------------------------------------- */

static void uart_out(avr_irq_t *irq, uint32_t value, void *param)
{
    char byte = (char)value;

    (void)irq;
    (void)param;
    if (sim.terminal >= 0) {
        while (write(sim.terminal, &byte, 1) < 0 && errno == EINTR)
            ;
    } else {
        putchar(byte);
        sim.middle = byte != '\n';
        if (byte == '\n')
            fflush(stdout);
    }
    if (sim.until == NULL)
        return;
    while (sim.matched > 0 && sim.until[sim.matched] != byte) {
        /* The longest beginning of the pattern that what has come ends with. */
        size_t shorter = sim.matched - 1;

        while (shorter > 0 && strncmp(sim.until, sim.until + sim.matched - shorter, shorter) != 0)
            shorter--;
        sim.matched = shorter;
    }
    if (sim.until[sim.matched] == byte && sim.until[++sim.matched] == '\0')
        stop(OK, NULL);
}

static void uart_accepts(avr_irq_t *irq, uint32_t value, void *param)
{
    (void)irq;
    (void)value;
    sim.uart_ready = param != NULL;
}

static void open_uart(char name)
{
    uint32_t flags = 0; /* no copy on the console, no sleeping while polled */
    avr_irq_t *out = avr_io_getirq(sim.avr, AVR_IOCTL_UART_GETIRQ(name), UART_IRQ_OUTPUT);

    if (out == NULL) {
        stop(USAGE, "there is no uart %c on this part", name);
        return;
    }
    avr_ioctl(sim.avr, AVR_IOCTL_UART_SET_FLAGS(name), &flags);
    avr_irq_register_notify(out, uart_out, NULL);
    sim.uart_in = avr_io_getirq(sim.avr, AVR_IOCTL_UART_GETIRQ(name), UART_IRQ_INPUT);
    avr_irq_register_notify(avr_io_getirq(sim.avr, AVR_IOCTL_UART_GETIRQ(name), UART_IRQ_OUT_XON),
                            uart_accepts, &sim);
    avr_irq_register_notify(avr_io_getirq(sim.avr, AVR_IOCTL_UART_GETIRQ(name), UART_IRQ_OUT_XOFF),
                            uart_accepts, NULL);
}

/* A pseudo terminal in place of stdin and stdout; `link` is a symbolic link to it. */
static void open_terminal(const char *link)
{
    struct termios mode;
    const char *name;

    sim.terminal = posix_openpt(O_RDWR | O_NOCTTY | O_CLOEXEC);
    name = sim.terminal < 0 || grantpt(sim.terminal) || unlockpt(sim.terminal)
               ? NULL : ptsname(sim.terminal);
    /* While this descriptor is open, the terminal neither hangs up nor forgets its mode. */
    sim.kept = name == NULL ? -1 : open(name, O_RDWR | O_NOCTTY | O_CLOEXEC);
    if (sim.kept < 0 || tcgetattr(sim.kept, &mode) < 0) {
        stop(NO_LINK, "no pseudo terminal: %s", strerror(errno));
        return;
    }
    cfmakeraw(&mode);
    tcsetattr(sim.kept, TCSANOW, &mode);
    unlink(link);
    if (symlink(name, link) < 0)
        stop(NO_LINK, "%s: %s", link, strerror(errno));
    fcntl(sim.terminal, F_SETFL, O_NONBLOCK);
}

/* Every LOOK_MS: bytes for the UART, and waiting for the wall clock. */
static avr_cycle_count_t look_outside(avr_t *avr, avr_cycle_count_t when, void *param)
{
    unsigned char byte;

    (void)avr;
    (void)param;
    while (sim.terminal >= 0 && sim.uart_ready && read(sim.terminal, &byte, 1) == 1)
        avr_raise_irq(sim.uart_in, byte);
    if (sim.pace) {
        uint64_t due = ps_of(when) / 1000;
        struct timespec wake = sim.began;

        wake.tv_sec += (time_t)(due / 1000000000);
        wake.tv_nsec += (long)(due % 1000000000);
        if (wake.tv_nsec >= 1000000000) {
            wake.tv_nsec -= 1000000000;
            wake.tv_sec++;
        }
        clock_nanosleep(CLOCK_MONOTONIC, TIMER_ABSTIME, &wake, NULL);
    }
    return when + sim.frequency * LOOK_MS / 1000;
}

/* --- the run -------------------------------------------------------------------------------------- */

/* Sleep instructions take AVR time, which simavr adds up; they take no time of ours. */
static void do_not_sleep(avr_t *avr, avr_cycle_count_t cycles)
{
    (void)avr;
    (void)cycles;
}

static avr_cycle_count_t limit_reached(avr_t *avr, avr_cycle_count_t when, void *param)
{
    (void)avr;
    (void)when;
    (void)param;
    if (sim.awaited != NULL)
        stop(FAILURE, "%s did not come within %llu cycles", sim.awaited,
             (unsigned long long)sim.limit);
    else
        stop(OK, NULL);
    return 0;
}

/* A board knows of no time that has not been told: it ends firmware that goes on beyond a limit. */
static avr_cycle_count_t tell_time(avr_t *avr, avr_cycle_count_t when, void *param)
{
    (void)avr;
    (void)param;
    sync_outputs();
    return when + sim.frequency;
}

/* Whether firmware waits for ever with interrupts off, as when it has returned from main. */
static int ended_at(const avr_t *avr, avr_flashaddr_t place)
{
    const unsigned char *flash = avr->flash + place;

    return !avr->sreg[S_I] && (flash[0] | flash[1] << 8) == RJMP_SELF;
}

/* The result of main is in r24. */
static void say_the_end(void)
{
    const unsigned char *flash = sim.avr->flash + sim.avr->pc;

    stop((flash[-2] | flash[-1] << 8) == CLI && sim.awaited == NULL ? sim.avr->data[24] : OK, NULL);
    if (sim.awaited != NULL) {
        sim.stop = 0;
        stop(FAILURE, "the firmware has ended before %s came", sim.awaited);
    }
}

/* As simavr's own, which does all of this after each instruction. The AVR's timers need their turn
 * when the next one is due, or one was set or taken away: that leaves a mark in `run_cycle_count`. */
static void run_to_the_next_event(avr_t *avr)
{
    avr_flashaddr_t after = avr->pc;
    avr_cycle_count_t sleep;
    int step;

    if (avr->gdb) {
        avr_gdb_processor(avr, avr->state == cpu_Stopped);
        if (avr->state == cpu_Stopped)
            return;
    }
    step = avr->state == cpu_Step;
    if (step)
        avr->state = cpu_Running;
    if (avr->state == cpu_Running) {
        avr_cycle_count_t due = avr->gdb ? 0 : sim.due;
        int bus = sim.link.card.count > 0;

        for (;;) {
            after = bus ? run_with_a_bus(avr) : avr_run_one(avr);
            if (avr->cycle >= due || avr->run_cycle_count != 0 || avr->interrupt_state != 0
                || avr->state != cpu_Running || sim.stop || ended_at(avr, after))
                break;
            avr->pc = after;
        }
    }
    sleep = avr_cycle_timer_process(avr);
    avr->pc = after;
    sim.due = avr->cycle + sleep;
    avr->run_cycle_count = 0;
    if (avr->state == cpu_Sleeping) {
        if (!avr->sreg[S_I]) {
            avr->state = cpu_Done;
        } else {
            avr->sleep(avr, sleep);
            avr->cycle += 1 + sleep;
        }
    }
    if (avr->state == cpu_Running || avr->state == cpu_Sleeping)
        avr_service_interrupts(avr);
    if (step)
        avr->state = cpu_StepDone;
}

static void run(void)
{
    while (!sim.stop) {
        int state = avr_run(sim.avr);

        if (state == cpu_Crashed)
            stop(FAILURE, "the firmware has crashed at %05X", (unsigned)sim.avr->pc);
        else if (state == cpu_Done && sim.awaited != NULL)
            stop(FAILURE, "the firmware sleeps for ever before %s came", sim.awaited);
        else if (state == cpu_Done)
            stop(OK, NULL);
        else if (state == cpu_Running && ended_at(sim.avr, sim.avr->pc))
            say_the_end();
    }
}

static void quiet(avr_t *avr, const int level, const char *format, va_list arguments)
{
    (void)avr;
    if (level == LOG_ERROR)
        vfprintf(stderr, format, arguments);
}

/* Read "PB5=1". */
static int read_pin_level(const char *text)
{
    if (*text != 'P' || text[1] < 'A' || text[1] >= 'A' + PIN_PORTS || text[2] < '0' || text[2] > '7'
        || text[3] != '=' || (text[4] != '0' && text[4] != '1') || text[5] != '\0')
        return 0;
    sim.until_port = text[1] - 'A';
    sim.until_bit = text[2] - '0';
    sim.until_level = text[4] - '0';
    return 1;
}

static uint64_t number(const char *option, const char *text)
{
    char *end;
    unsigned long long value = strtoull(text, &end, 10);

    if (!isdigit((unsigned char)*text) || *end != '\0' || value == 0)
        stop(USAGE, "--%s %s: write a whole number above 0", option, text);
    return value;
}

static const char HELP[] =
    "Usage: vbus-avr --link WHERE [options] FIRMWARE.elf\n"
    "Runs AVR firmware whose port bits are wired to a vbus board.\n\n"
    "  --link WHERE      link of the board, such as unix:PATH; it has a pin map\n"
    "  --mmcu NAME       part, such as atmega328p; else what the firmware says\n"
    "  --frequency HZ    clock; else what the firmware says\n"
    "  --cycles N        end after N clock cycles\n"
    "  --until TEXT      end when the firmware has sent TEXT on its UART\n"
    "  --until-pin PIN   end when the firmware drives a pin, such as PB5=1\n"
    "  --uart N          the UART that is stdout, or the terminal; else 0\n"
    "  --pty PATH        a terminal in place of stdout; PATH becomes a link to it\n"
    "  --pace            no faster than real time\n"
    "  --gdb PORT        wait for avr-gdb at this port\n"
    "  --stats           tell cycles, bus cycles and speed at the end\n\n"
    "Exit code: 0, or what main returned; 1 if it did not come to the end asked for; 2 for a wrong\n"
    "command line; 4 if the board is lost.\n";

int main(int argc, char **argv)
{
    static const struct option options[] = {
        {"link", 1, NULL, 'l'},   {"mmcu", 1, NULL, 'm'},      {"frequency", 1, NULL, 'f'},
        {"cycles", 1, NULL, 'c'}, {"until", 1, NULL, 'u'},     {"until-pin", 1, NULL, 'p'},
        {"uart", 1, NULL, 'n'},   {"pty", 1, NULL, 't'},       {"pace", 0, NULL, 'r'},
        {"gdb", 1, NULL, 'g'},    {"stats", 0, NULL, 's'},     {"help", 0, NULL, 'h'},
        {NULL, 0, NULL, 0},
    };
    static elf_firmware_t firmware;
    const char *link = NULL, *part = NULL, *terminal = NULL;
    char uart = '0';
    uint64_t gdb = 0;
    int option, stats = 0, error;
    struct timespec end;
    double seconds;

    sim.until_port = -1;
    sim.terminal = sim.kept = -1;
    while ((option = getopt_long(argc, argv, "h", options, NULL)) != -1) {
        switch (option) {
        case 'l': link = optarg; break;
        case 'm': part = optarg; break;
        case 'f': sim.frequency = number("frequency", optarg); break;
        case 'c': sim.limit = number("cycles", optarg); break;
        case 'u': sim.until = sim.awaited = optarg; break;
        case 'p':
            sim.awaited = optarg;
            if (!read_pin_level(optarg))
                stop(USAGE, "--until-pin %s: write a port bit and a level, such as PB5=1", optarg);
            break;
        case 'n':
            uart = *optarg;
            if (!isdigit((unsigned char)uart) || optarg[1] != '\0')
                stop(USAGE, "--uart %s: write 0 to 3", optarg);
            break;
        case 't': terminal = optarg; break;
        case 'r': sim.pace = 1; break;
        case 'g': gdb = number("gdb", optarg); break;
        case 's': stats = 1; break;
        case 'h': fputs(HELP, stdout); return OK;
        default: fputs(HELP, stderr); return USAGE;
        }
    }
    if (sim.stop)
        return sim.code;
    if (link == NULL || optind + 1 != argc || (sim.until != NULL && *sim.until == '\0')) {
        fputs(HELP, stderr);
        return USAGE;
    }
    avr_global_logger_set(quiet);
    if (access(argv[optind], R_OK) < 0 || elf_read_firmware(argv[optind], &firmware) < 0) {
        fprintf(stderr, "vbus-avr: %s is no AVR program in ELF format that can be read\n",
                argv[optind]);
        return USAGE;
    }
    if (part == NULL)
        part = firmware.mmcu;
    if (sim.frequency == 0)
        sim.frequency = firmware.frequency;
    if (*part == '\0' || sim.frequency == 0) {
        fprintf(stderr, "vbus-avr: the firmware does not say for which part and clock it is; name"
                        " them with --mmcu and --frequency\n");
        return USAGE;
    }
    sim.avr = avr_make_mcu_by_name(part);
    if (sim.avr == NULL) {
        fprintf(stderr, "vbus-avr: simavr does not know the part \"%s\"; simavr --list-cores lists"
                        " what it knows\n", part);
        return USAGE;
    }
    error = pin_link_open(&sim.link, link, 8);
    if (error < 0) {
        fprintf(stderr, "vbus-avr: %s: %s\n", link,
                error == VBUS_E_SYSTEM ? strerror(sim.link.bus.system) : pin_link_strerror(error));
        return NO_LINK;
    }
    if (!sim.link.slaved) {
        fprintf(stderr, "vbus-avr: chip time must follow the AVR: write time = \"slaved\" in the"
                        " [board] section of the board file\n");
        return USAGE;
    }
    if (sim.link.card.count > 0 && !has_a_bus(part)) {
        fprintf(stderr, "vbus-avr: the host has a card, and an %s has no external memory interface;"
                        " atmega640, 1280, 1281, 2560 and 2561 have one\n", part);
        return USAGE;
    }
    sim.link.clock = now;
    sim.ramend = sim.avr->ramend;
    if (sim.link.card.count > 0)
        sim.avr->ramend = ALL_OF_IT;
    avr_init(sim.avr);
    sim.avr->log = LOG_ERROR;
    avr_load_firmware(sim.avr, &firmware);
    sim.avr->frequency = (uint32_t)sim.frequency;
    sim.avr->sleep = do_not_sleep;
    find_ports();
    find_levels();
    open_twi(part);
    if (sim.link.card.count > 0) {
        avr_register_io_write(sim.avr, XMCRA, write_control, NULL);
        avr_register_io_write(sim.avr, XMCRB, write_control, NULL);
    }
    if (missing_port() >= 0) {
        fprintf(stderr, "vbus-avr: the pin map uses port %c, and an %s has none\n",
                'A' + missing_port(), part);
        return USAGE;
    }
    open_uart(uart);
    if (terminal != NULL)
        open_terminal(terminal);
    if (sim.outputs && !sim.stop)
        sync_outputs();
    if (sim.limit)
        avr_cycle_timer_register(sim.avr, sim.limit, limit_reached, NULL);
    if (getenv("VBUS_LIMIT_PS") != NULL)
        avr_cycle_timer_register(sim.avr, cycle_at(strtoull(getenv("VBUS_LIMIT_PS"), NULL, 10) + 1),
                                 tell_time, NULL);
    if (sim.terminal >= 0 || sim.pace)
        avr_cycle_timer_register(sim.avr, sim.frequency * LOOK_MS / 1000, look_outside, NULL);
    if (gdb) {
        sim.avr->gdb_port = (int)gdb;
        sim.avr->state = cpu_Stopped;
        errno = 0;
        if (gdb > 65535 || avr_gdb_init(sim.avr) < 0) {
            fprintf(stderr, "vbus-avr: gdb cannot be waited for at port %llu: %s; end the program"
                            " that has the port, or name another one, 1024 to 65535\n",
                    (unsigned long long)gdb, gdb > 65535 ? "there is no such port" : strerror(errno));
            return USAGE;
        }
    }
    sim.avr->run = run_to_the_next_event;
    sim.avr->run_cycle_limit = 1;
    clock_gettime(CLOCK_MONOTONIC, &sim.began);
    run();
    if (sim.middle)
        putchar('\n');
    fflush(stdout);
    failed(pin_link_close(&sim.link));
    if (terminal != NULL)
        unlink(terminal);
    clock_gettime(CLOCK_MONOTONIC, &end);
    seconds = (double)(end.tv_sec - sim.began.tv_sec)
              + (double)(end.tv_nsec - sim.began.tv_nsec) / 1e9;
    if (stats)
        fprintf(stderr, "vbus-avr: %llu cycles, %llu %s, %.3f s, %.2f x real time\n",
                (unsigned long long)sim.avr->cycle, (unsigned long long)sim.link.cycles,
                sim.link.pins.line_count > 0 ? "moves of strobes" : "bus cycles", seconds,
                (double)sim.avr->cycle / (double)sim.frequency / seconds);
    return sim.code;
}
