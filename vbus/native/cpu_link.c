/* cpu_link.c - the fast part of vbus.cpu: clock, bus and port bits of a processor that an emulator runs.
 *
 * vbus.cpu builds a library of it, and gives its functions to the emulator (unicorn): cpu_tick before
 * each instruction, cpu_read and cpu_write for accesses to peripherals and cards. It knows nothing of
 * the emulator and is not linked with it. License: Apache-2.0.
 */
#include "pin_link.h"

#include <string.h>

#define MEMORIES 4
#define OPCODES 8
#define COUNTERS 24
#define PAGE 0x400
#define SECOND UINT64_C(1000000000000)

/* The registers of a port that firmware moves all the time; vbus.cpu keeps the others. */
struct cpu_port {
    uint32_t base, number;
    uint32_t input, output, set, reset; /* offsets; ~0: the port has no such register */
    uint32_t level, drive;              /* what is written, and the pins it drives */
    uint32_t open, pulled, pull;        /* open drain; pulled as `level` says; pulled up */
    uint32_t off;                       /* its clock is off */
};

/* A register that counts: while it is on, its value follows from the clock. */
struct cpu_counter {
    uint32_t address, on;
    uint64_t zero, divider, period; /* the cycle at which it was 0, cycles a count, counts a round */
    uint64_t down;                  /* it counts down */
};

struct cpu_opcode {
    uint32_t mask, value, after; /* instructions after which an interrupt may come */
};

struct cpu_memory {
    uint64_t start, size;
    const unsigned char *bytes;
};

struct cpu {
    uint64_t clock, due;    /* clock cycles so far, and before the next instruction of which to stop */
    uint64_t step, access;  /* cycles of an instruction, and of a byte on a card's bus */
    uint64_t frequency;
    void (*stop)(void *engine);
    uint64_t (*read)(uint64_t address, uint32_t size); /* of registers that are not kept here */
    void (*write)(uint64_t address, uint32_t size, uint64_t value);
    void (*nobody)(uint64_t address, uint32_t write); /* a card's bus where no chip answers */
    uint32_t masked, moved; /* look for instructions that let interrupts in; a pin may have moved */
    uint32_t big_endian, port_count, counter_count;
    int32_t error;
    struct cpu_memory memories[MEMORIES];
    struct cpu_opcode opcodes[OPCODES];
    struct cpu_port *ports[PIN_PORTS];
    struct cpu_counter *counters[COUNTERS];
};

struct cpu_window {
    uint64_t base;
    uint32_t card;
};

struct cpu cpu;
static struct pin_link bus;

static uint64_t ps_of(uint64_t cycle)
{
    uint64_t us = cycle % cpu.frequency * 1000000;

    return cycle / cpu.frequency * SECOND + us / cpu.frequency * 1000000
           + us % cpu.frequency * 1000000 / cpu.frequency;
}

static uint64_t now(void *context)
{
    (void)context;
    return ps_of(cpu.clock);
}

/* The first cycle that begins at the instant of the next edge or later; ~0: there is none. */
uint64_t cpu_edge(void)
{
    uint64_t instant = bus.edge, rest = instant % SECOND, cycle;

    if (instant == VBUS_NO_EDGE || instant / SECOND > UINT64_C(10000000))
        return ~UINT64_C(0);
    cycle = instant / SECOND * cpu.frequency + rest / 1000000 * cpu.frequency / 1000000;
    while (ps_of(cycle) < instant)
        cycle++;
    return cycle;
}

static void keep_error(void)
{
    if (bus.error == 0)
        return;
    cpu.error = bus.error;
    cpu.due = cpu.clock;
}

void cpu_sync(void)
{
    pin_link_sync(&bus);
    keep_error();
}

/* After chips were touched: their outputs may have moved, and with them interrupts. */
static void settle(void)
{
    if (bus.pins.output_count > 0 && bus.error == 0 && (bus.touched || bus.told)) {
        if (bus.touched)
            pin_link_sync(&bus);
        bus.told = 0;
        cpu.moved = 1;
        cpu.due = cpu.clock;
    }
    keep_error();
}

/* --- the session ------------------------------------------------------------------------------ */

int cpu_open(const char *where)
{
    cpu.error = pin_link_open(&bus, where, PIN_BITS);
    bus.clock = now;
    return cpu.error;
}

int cpu_close(void)
{
    return pin_link_close(&bus);
}

const char *cpu_sentence(int error)
{
    return error == VBUS_E_SYSTEM ? strerror(bus.bus.system) : pin_link_strerror(error);
}

int cpu_slaved(void)
{
    return bus.slaved;
}

uint64_t cpu_cycles(void)
{
    return bus.cycles;
}

/* Address of row `row` of the card's table; ~0 behind the last. */
uint64_t cpu_card_row(uint32_t row)
{
    return row < bus.card.count ? bus.card.ports[row].address : ~UINT64_C(0);
}

/* Which bits of a port anything is wired to. */
uint32_t cpu_wired(uint32_t port)
{
    const struct pin_decoder *pins = &bus.pins;
    const struct pin_side *lists[3];
    unsigned counts[3], chip, line, list;
    uint32_t bits = 0;

    lists[0] = pins->sides, lists[1] = pins->outputs, lists[2] = pins->lines;
    counts[0] = pins->side_count, counts[1] = pins->output_count, counts[2] = pins->line_count;
    for (chip = 0; chip < pins->chip_count; chip++)
        for (line = 0; line < 4 + 8 + 8 + 8; line++) {
            const struct pin_source *source = &pins->chips[chip].select + line;

            if (source->kind == 1 && source->port == port)
                bits |= 1U << source->bit;
        }
    for (list = 0; list < 3; list++)
        for (line = 0; line < counts[list]; line++)
            if (lists[list][line].source.kind == 1 && lists[list][line].source.port == port)
                bits |= 1U << lists[list][line].source.bit;
    return bits;
}

/* --- port bits -------------------------------------------------------------------------------- */

/* What the firmware drives is as `port` says now. */
void cpu_port_moved(struct cpu_port *port)
{
    uint32_t drive = port->drive & ~(port->open & port->level);
    uint32_t level = (port->level & (port->drive | port->pulled)) | (port->pull & ~port->drive);

    if (bus.pins.drive[port->number] == drive && bus.pins.level[port->number] == level)
        return;
    pin_decoder_port(&bus.pins, port->number, drive, level);
    settle();
}

uint32_t cpu_input(uint32_t port)
{
    pin_decoder_look(&bus.pins, port);
    keep_error();
    return pin_decoder_input(&bus.pins, port);
}

static struct cpu_port *port_at(uint64_t address)
{
    uint32_t turn, base = (uint32_t)address & ~(uint32_t)(PAGE - 1);

    for (turn = 0; turn < cpu.port_count; turn++)
        if (cpu.ports[turn]->base == base && !cpu.ports[turn]->off)
            return cpu.ports[turn];
    return NULL;
}

/* --- a card's bus: wide accesses are successive byte cycles, the lowest address first ----------- */

static uint64_t card_access(uint64_t address, unsigned size, int write, uint64_t value)
{
    uint64_t result = 0;
    unsigned turn;

    for (turn = 0; turn < size; turn++) {
        unsigned shift = 8 * (cpu.big_endian ? size - 1 - turn : turn);
        const struct card_port *port
            = card_table_find(&bus.card, (unsigned long)(address + turn), write);
        unsigned data = (unsigned)(value >> shift) & 0xFF;

        cpu.clock += cpu.access;
        if (port == NULL) {
            cpu.nobody(address + turn, (uint32_t)write);
            result |= UINT64_C(0xFF) << shift;
            continue;
        }
        if (port->answers && write)
            pin_link_write(&bus, 1U << port->chip, port->chip_address, data);
        else if (port->answers)
            data = pin_link_read(&bus, 1U << port->chip, port->chip_address);
        if (port->acknowledges) {
            pin_link_side(&bus, port->pin, 0);
            pin_link_side(&bus, port->pin, 2);
        }
        result |= (uint64_t)(data | port->floating) << shift;
    }
    settle();
    return result;
}

uint64_t cpu_card_read(uint64_t address, uint32_t size)
{
    return card_access(address, size, 0, 0);
}

void cpu_card_write(uint64_t address, uint32_t size, uint64_t value)
{
    card_access(address, size, 1, value);
}

static uint64_t count_of(const struct cpu_counter *counter)
{
    uint64_t count = (cpu.clock - counter->zero) / counter->divider % counter->period;

    return counter->down && count ? counter->period - count : count;
}

/* --- what the emulator calls ------------------------------------------------------------------ */

uint64_t cpu_read(void *engine, uint64_t offset, unsigned size, void *user)
{
    const struct cpu_window *window = (const struct cpu_window *)user;
    uint64_t address = window->base + offset;
    const struct cpu_port *port;
    unsigned turn;

    (void)engine;
    if (window->card)
        return card_access(address, size, 0, 0);
    port = port_at(address);
    if (port != NULL && size == 4 && (address & (PAGE - 1)) == port->input)
        return cpu_input(port->number);
    for (turn = 0; turn < cpu.counter_count; turn++)
        if (cpu.counters[turn]->address == address && cpu.counters[turn]->on)
            return count_of(cpu.counters[turn]) & (size < 4 ? (1U << 8 * size) - 1 : ~0U);
    return cpu.read(address, size);
}

void cpu_write(void *engine, uint64_t offset, unsigned size, uint64_t value, void *user)
{
    const struct cpu_window *window = (const struct cpu_window *)user;
    uint64_t address = window->base + offset;
    uint32_t place = (uint32_t)address & (PAGE - 1), word = (uint32_t)value;
    struct cpu_port *port;

    (void)engine;
    if (window->card) {
        card_access(address, size, 1, value);
        return;
    }
    port = port_at(address);
    if (port != NULL && size == 4 && place == port->output)
        port->level = word & 0xFFFF;
    else if (port != NULL && size == 4 && place == port->set)
        port->level = (port->level & ~(word >> 16)) | (word & 0xFFFF);
    else if (port != NULL && size == 4 && place == port->reset)
        port->level &= ~word;
    else {
        cpu.write(address, size, value);
        return;
    }
    cpu_port_moved(port);
}

/* Whether the instruction at `address` may let an interrupt in. */
static void look_at(uint64_t address)
{
    const struct cpu_memory *memory = cpu.memories;
    uint64_t place = address - memory->start;
    unsigned turn = 0, word;

    while (place >= memory->size) {
        if (++turn == MEMORIES)
            return;
        memory++;
        place = address - memory->start;
    }
    word = memory->bytes[place];
    if (place + 1 < memory->size)
        word = cpu.big_endian ? word << 8 | memory->bytes[place + 1]
                              : word | (unsigned)memory->bytes[place + 1] << 8;
    for (turn = 0; turn < OPCODES; turn++)
        if (cpu.opcodes[turn].after && (word & cpu.opcodes[turn].mask) == cpu.opcodes[turn].value) {
            cpu.due = cpu.clock + (cpu.opcodes[turn].after - 1) * cpu.step;
            return;
        }
}

void cpu_tick(void *engine, uint64_t address, uint32_t size, void *user)
{
    (void)size;
    (void)user;
    if (cpu.clock >= cpu.due) {
        cpu.stop(engine);
        return;
    }
    cpu.clock += cpu.step;
    if (cpu.masked)
        look_at(address);
}
