/* pin_decoder.c - see pin_decoder.h. License: Apache-2.0. */
#include "pin_decoder.h"

#include <stdlib.h>
#include <string.h>

enum { UNWIRED, PORT_BIT, TIED };

#define FLOATS 2U
#define BIT(source) (1U << (source)->bit)

/* --- the wiring text -------------------------------------------------------------------------- */

/* Read "!B3", "A12", "0" or "1"; return what follows, or NULL. */
static const char *read_source(const char *text, struct pin_source *source)
{
    source->inverted = *text == '!';
    text += source->inverted;
    if (*text == '0' || *text == '1') {
        source->kind = TIED;
        source->level = (unsigned char)(*text - '0');
        return text + 1;
    }
    if (*text < 'A' || *text >= 'A' + PIN_PORTS || text[1] < '0' || text[1] > '9')
        return NULL;
    source->port = (unsigned char)(*text++ - 'A');
    source->bit = 0;
    for (; *text >= '0' && *text <= '9' && source->bit < PIN_BITS; text++)
        source->bit = (unsigned char)(source->bit * 10 + (*text - '0'));
    source->kind = PORT_BIT;
    return source->bit < PIN_BITS ? text : NULL;
}

static struct pin_source *add(struct pin_side *list, unsigned *count, unsigned most, long number)
{
    struct pin_side *side = list + *count;

    if (*count == most)
        return NULL;
    ++*count;
    side->number = (unsigned char)number;
    side->level = FLOATS;
    return &side->source;
}

/* Find where an entry such as "0r", "1a0", "p3", "o2", "c1" or "0b7" goes; return what follows it,
 * or NULL. */
static const char *read_role(struct pin_decoder *decoder, const char *text, struct pin_source **place)
{
    char *end;
    char role = *text;
    long number;
    struct pin_chip *chip;

    if (role == 'p' || role == 'o' || role == 'c') {
        long most = role == 'p' ? 256 : role == 'o' ? PIN_OUTPUTS : PIN_LINES;

        number = strtol(text + 1, &end, 10);
        if (end == text + 1 || number < 0 || number >= most)
            return NULL;
        if (role == 'c') {
            *place = add(decoder->lines, &decoder->line_count, PIN_LINES, number);
            return end;
        }
        *place = role == 'p' ? add(decoder->sides, &decoder->side_count, PIN_SIDES, number)
                             : add(decoder->outputs, &decoder->output_count, PIN_OUTPUTS, number);
        return end;
    }
    number = strtol(text, &end, 10);
    if (end == text || number < 0 || number >= PIN_CHIPS)
        return NULL;
    chip = &decoder->chips[number];
    if (decoder->chip_count <= (unsigned)number)
        decoder->chip_count = (unsigned)number + 1;
    role = *end++;
    *place = role == 's' ? &chip->select : role == 'r' ? &chip->read : role == 'w' ? &chip->write
             : role == 'l' ? &chip->latch : NULL;
    if ((role == 'a' || role == 'd' || role == 'b') && *end >= '0' && *end <= '7') {
        chip->behind |= role == 'b';
        *place = (role == 'a' ? chip->address : role == 'd' ? chip->data : chip->bus)
                 + (*end++ - '0');
    }
    return end;
}

/* The ports whose moves may begin or end something at a chip, a bit each. */
static unsigned ports_of(const struct pin_chip *chip)
{
    const struct pin_source *one, *last = &chip->latch; /* they lie one behind the other */
    unsigned ports = 0;

    for (one = &chip->select; one <= last; one++)
        ports |= one->kind == TIED ? ~0U : (unsigned)(one->kind == PORT_BIT) << one->port;
    return ports;
}

int pin_decoder_init(struct pin_decoder *decoder, const char *wiring)
{
    const char *text = wiring;
    unsigned turn;

    memset(decoder, 0, sizeof *decoder);
    memset(decoder->external, 0xFF, sizeof decoder->external);
    for (turn = 0; turn < PIN_CHIPS; turn++)
        decoder->chips[turn].driving = PIN_FLOATS;
    while (*text != '\0') {
        struct pin_source *place = NULL;
        const char *next = read_role(decoder, text, &place);

        if (next != NULL && place != NULL && *next == '=')
            next = read_source(next + 1, place);
        else
            next = NULL;
        if (next == NULL || (*next != ' ' && *next != '\0'))
            return (int)(text - wiring) + 1;
        if (place->kind == PORT_BIT && place->bit > decoder->widest)
            decoder->widest = place->bit;
        text = next + (*next == ' ');
    }
    for (turn = 0; turn < decoder->chip_count; turn++)
        decoder->chips[turn].ports = (unsigned short)ports_of(&decoder->chips[turn]);
    return 0;
}

/* --- levels ----------------------------------------------------------------------------------- */

/* What stands at a pin: 0, 1, or 2 where no pin drives it. */
static unsigned at(const struct pin_decoder *decoder, const struct pin_source *source)
{
    if (source->kind == TIED)
        return source->level ^ source->inverted;
    if (source->kind == UNWIRED || !(decoder->drive[source->port] & BIT(source)))
        return FLOATS;
    return !(decoder->level[source->port] & BIT(source)) ^ !source->inverted;
}

static unsigned input_at(const struct pin_decoder *decoder, unsigned port)
{
    unsigned drive = decoder->drive[port], level = decoder->level[port];
    unsigned floats = ~(drive | decoder->driven[port]);

    return ((level & drive) | (decoder->external[port] & ~drive) | (level & floats)) & 0xFFFF;
}

/* The same where something must be read: a floating line is what the microcontroller sees there. */
static unsigned seen(const struct pin_decoder *decoder, const struct pin_source *source)
{
    unsigned level = at(decoder, source);

    if (level == FLOATS && source->kind == PORT_BIT)
        return !(input_at(decoder, source->port) & BIT(source)) ^ !source->inverted;
    return level == FLOATS ? 1 : level;
}

static unsigned byte_at(const struct pin_decoder *decoder, const struct pin_source *lines)
{
    unsigned value = 0, bit;

    for (bit = 0; bit < 8; bit++)
        if (lines[bit].kind != UNWIRED && seen(decoder, &lines[bit]))
            value |= 1U << bit;
    return value;
}

static unsigned address_of(const struct pin_decoder *decoder, const struct pin_chip *chip)
{
    return chip->latch.kind != UNWIRED ? chip->latched : byte_at(decoder, chip->address);
}

static void missed(struct pin_decoder *decoder, unsigned turn)
{
    if (decoder->on_missed)
        decoder->on_missed(decoder->context, turn, decoder->chips[turn].saw, decoder->chips[turn].byte);
}

/* A look at a port, and with it at the data lines of chips. */
unsigned pin_decoder_input(struct pin_decoder *decoder, unsigned port)
{
    unsigned turn, bit, wired = 0, answering = 0;

    for (turn = 0; turn < decoder->chip_count; turn++) {
        const struct pin_chip *chip = &decoder->chips[turn];

        for (bit = 0; bit < 8; bit++)
            if (chip->data[bit].kind == PORT_BIT && chip->data[bit].port == port
                && !(decoder->drive[port] & BIT(&chip->data[bit])))
                wired |= 1U << turn;
        answering |= (unsigned)chip->reading << turn;
    }
    for (turn = 0; turn < decoder->chip_count; turn++) {
        struct pin_chip *chip = &decoder->chips[turn];

        if (!(wired >> turn & 1))
            continue;
        if (wired & answering) { /* what is seen is theirs */
            chip->looked = chip->reading;
            chip->late = 0;
            continue;
        }
        chip->saw = (unsigned char)byte_at(decoder, chip->data);
        if (chip->late && chip->saw != chip->byte)
            missed(decoder, turn);
        chip->looked = !chip->late; /* of the strobe that is over; the next one has its own look */
        chip->late = 0;
    }
    return input_at(decoder, port);
}

/* --- chips' side ------------------------------------------------------------------------------ */

static void show(struct pin_decoder *decoder, const struct pin_source *source, unsigned level)
{
    if (source->kind != PORT_BIT)
        return;
    decoder->driven[source->port] |= (unsigned short)BIT(source);
    decoder->external[source->port] &= (unsigned short)~BIT(source);
    if (level != source->inverted)
        decoder->external[source->port] |= (unsigned short)BIT(source);
}

static void show_byte(struct pin_decoder *decoder, const struct pin_chip *chip)
{
    unsigned bit;

    for (bit = 0; bit < 8; bit++)
        show(decoder, &chip->data[bit], chip->byte >> bit & 1U);
}

/* The chips of `unread` let go of the data bus; others on the same lines may still drive it. */
static void let_go(struct pin_decoder *decoder, unsigned unread)
{
    unsigned turn, bit;

    for (turn = 0; turn < decoder->chip_count; turn++)
        for (bit = 0; bit < 8 && unread >> turn & 1; bit++) {
            const struct pin_source *line = &decoder->chips[turn].data[bit];

            if (line->kind == PORT_BIT)
                decoder->driven[line->port] &= (unsigned short)~BIT(line);
        }
    for (turn = 0; turn < decoder->chip_count && unread; turn++)
        if (decoder->chips[turn].reading)
            show_byte(decoder, &decoder->chips[turn]);
}

void pin_decoder_outputs(struct pin_decoder *decoder, unsigned long word)
{
    unsigned turn;

    for (turn = 0; turn < decoder->output_count; turn++)
        show(decoder, &decoder->outputs[turn].source, word >> decoder->outputs[turn].number & 1);
}

void pin_decoder_look(struct pin_decoder *decoder, unsigned port)
{
    unsigned turn, bit;

    for (turn = 0; turn < decoder->chip_count; turn++) {
        struct pin_chip *chip = &decoder->chips[turn];
        unsigned wired = 0;

        for (bit = 0; chip->behind && bit < 8; bit++)
            wired |= chip->bus[bit].kind == PORT_BIT && chip->bus[bit].port == port
                     && !(decoder->drive[port] & BIT(&chip->bus[bit]));
        if (!wired)
            continue;
        chip->byte = (unsigned char)decoder->on_look(decoder->context, turn);
        for (bit = 0; bit < 8; bit++)
            show(decoder, &chip->bus[bit], chip->byte >> bit & 1U);
    }
}

/* --- the microcontroller's side --------------------------------------------------------------- */

/* Move the lines before glue that go to `level` now; those without a driver are idle (high). */
static void move_lines(struct pin_decoder *decoder, unsigned level)
{
    unsigned turn, mask = 0;

    for (turn = 0; turn < decoder->line_count; turn++) {
        struct pin_side *line = &decoder->lines[turn];
        unsigned now = at(decoder, &line->source) != 0;

        if (now != level || now == line->level)
            continue;
        line->level = (unsigned char)now;
        mask |= 1U << line->number;
    }
    if (mask)
        decoder->on_lines(decoder->context, mask, level ? mask : 0);
}

/* Drive the data buses before glue, or let go: a bus of which a wire floats is not driven. */
static void move_buses(struct pin_decoder *decoder)
{
    unsigned turn, bit;

    for (turn = 0; turn < decoder->chip_count; turn++) {
        struct pin_chip *chip = &decoder->chips[turn];
        unsigned value = 0;

        if (!chip->behind)
            continue;
        for (bit = 0; bit < 8; bit++) {
            unsigned level = at(decoder, &chip->bus[bit]);

            value |= level == FLOATS ? PIN_FLOATS : level << bit;
        }
        value = value & PIN_FLOATS ? PIN_FLOATS : value;
        if (value == chip->driving)
            continue;
        chip->driving = (unsigned short)value;
        decoder->on_bus(decoder->context, turn, value);
    }
}

/* Latch the writes of `ended` with the pins as they are; equal ones are one cycle. */
static void finish_writes(struct pin_decoder *decoder, unsigned ended)
{
    unsigned first, other;

    for (first = 0; first < decoder->chip_count; first++) {
        unsigned address, data, together = 0;

        if (!(ended >> first & 1))
            continue;
        address = address_of(decoder, &decoder->chips[first]);
        data = byte_at(decoder, decoder->chips[first].data);
        for (other = first; other < decoder->chip_count; other++)
            if (ended >> other & 1 && address_of(decoder, &decoder->chips[other]) == address
                && byte_at(decoder, decoder->chips[other].data) == data)
                together |= 1U << other;
        ended &= ~together;
        decoder->on_write(decoder->context, together, address, data);
    }
}

static void begin_reads(struct pin_decoder *decoder, unsigned begun)
{
    unsigned first, other;

    for (first = 0; first < decoder->chip_count; first++) {
        unsigned address, data, together = 0;

        if (!(begun >> first & 1))
            continue;
        address = address_of(decoder, &decoder->chips[first]);
        for (other = first; other < decoder->chip_count; other++)
            if (begun >> other & 1 && address_of(decoder, &decoder->chips[other]) == address)
                together |= 1U << other;
        begun &= ~together;
        data = decoder->on_read(decoder->context, together, address);
        for (other = first; other < decoder->chip_count; other++)
            if (together >> other & 1) {
                decoder->chips[other].byte = (unsigned char)data;
                if (decoder->chips[other].reading)
                    show_byte(decoder, &decoder->chips[other]);
            }
    }
}

void pin_decoder_port(struct pin_decoder *decoder, unsigned port, unsigned drive, unsigned level)
{
    unsigned short old_drive, old_level;
    unsigned turn, ended = 0, begun = 0, unread = 0, again = 0;

    if (port >= PIN_PORTS)
        return;
    old_drive = decoder->drive[port];
    old_level = decoder->level[port];
    decoder->drive[port] = (unsigned short)drive;
    decoder->level[port] = (unsigned short)level;
    for (turn = 0; turn < decoder->chip_count; turn++) {
        struct pin_chip *chip = &decoder->chips[turn];
        int selected, writing, reading, latching;

        if (!(chip->ports >> port & 1))
            continue;
        selected = at(decoder, &chip->select) == 0;
        writing = selected && at(decoder, &chip->write) == 0;
        reading = selected && at(decoder, &chip->read) == 0 && !writing;
        latching = at(decoder, &chip->latch) == 0;
        if (chip->latch.kind) {
            int strobed = reading && !(chip->reading && chip->selected);
            int rises = chip->selected && !selected;

            reading = at(decoder, &chip->read) == 0 && !writing;
            ended |= (unsigned)(chip->writing && rises) << turn;
            strobed |= rises && !chip->writing && chip->selected != 2;
            begun |= (unsigned)strobed << turn;
            again |= (unsigned)(reading && !chip->reading && !strobed) << turn;
            if (!selected || !chip->selected)
                chip->selected = (unsigned char)selected;
            if (selected && strobed)
                chip->selected = 2;
        } else {
            ended |= (unsigned)(chip->writing && !writing) << turn;
            begun |= (unsigned)(reading && !chip->reading) << turn;
        }
        unread |= (unsigned)(chip->reading && !reading) << turn;
        if (chip->latching && !latching) {
            decoder->drive[port] = old_drive; /* the pins before this edge */
            decoder->level[port] = old_level;
            chip->latched = (unsigned char)byte_at(decoder, chip->data);
            decoder->drive[port] = (unsigned short)drive;
            decoder->level[port] = (unsigned short)level;
        }
        if (reading && !chip->reading) { /* what was seen until now was seen before the strobe */
            chip->early = chip->looked;
            chip->looked = 0;
        }
        if (chip->reading && !reading) {
            if (!chip->looked && chip->early && chip->saw != chip->byte)
                missed(decoder, turn);
            chip->late = !chip->looked && !chip->early;
            chip->looked = 0;
        }
        if (writing) /* lines that the microcontroller drives tell nothing of the chip */
            chip->looked = chip->late = 0;
        chip->writing = (unsigned char)writing;
        chip->reading = (unsigned char)reading;
        chip->latching = (unsigned char)latching;
    }
    if (ended) {
        decoder->drive[port] = old_drive;
        decoder->level[port] = old_level;
        finish_writes(decoder, ended);
        decoder->drive[port] = (unsigned short)drive;
        decoder->level[port] = (unsigned short)level;
    }
    /* What the microcontroller drove stays on a line when it lets go. */
    decoder->external[port] = (unsigned short)((decoder->external[port]
                                               & ~(drive & ~decoder->driven[port]))
                                              | (level & drive & ~decoder->driven[port]));
    let_go(decoder, unread);
    for (turn = 0; turn < decoder->chip_count; turn++)
        if (again >> turn & 1)
            show_byte(decoder, &decoder->chips[turn]);
    begin_reads(decoder, begun);
    move_lines(decoder, 1);
    for (turn = 0; turn < decoder->side_count; turn++) {
        struct pin_side *side = &decoder->sides[turn];
        unsigned now = at(decoder, &side->source);

        if ((side->source.kind == TIED || side->source.port == port) && now != side->level) {
            side->level = (unsigned char)now;
            decoder->on_side(decoder->context, side->number, now);
        }
    }
    move_buses(decoder);
    move_lines(decoder, 0);
}
