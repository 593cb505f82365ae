/* pins.c - drives the pin decoder from standard input, for test_pin_decoder.py.
 *
 * First line: the wiring. Then "A3F 01": port A drives 3Fh to 01h; "?A": what port A reads;
 * "=F0": the byte the next reads give; "o5": the output lines. Prints what is called back. */
#include "pin_decoder.h"

#include <stdio.h>
#include <string.h>

static unsigned next_byte;

static unsigned on_read(void *context, unsigned chips, unsigned address)
{
    (void)context;
    printf("read %X %X\n", chips, address);
    return next_byte;
}

static void on_write(void *context, unsigned chips, unsigned address, unsigned data)
{
    (void)context;
    printf("write %X %X %02X\n", chips, address, data);
}

static void on_side(void *context, unsigned number, unsigned level)
{
    (void)context;
    printf("side %u %u\n", number, level);
}

static void on_lines(void *context, unsigned mask, unsigned levels)
{
    (void)context;
    printf("lines %X %X\n", mask, levels);
}

static void on_bus(void *context, unsigned chip, unsigned data)
{
    (void)context;
    if (data == PIN_FLOATS)
        printf("release %u\n", chip);
    else
        printf("drive %u %02X\n", chip, data);
}

static unsigned on_look(void *context, unsigned chip)
{
    (void)context;
    printf("look %u\n", chip);
    return next_byte;
}

static void on_missed(void *context, unsigned chip, unsigned saw, unsigned gave)
{
    (void)context;
    printf("missed %u %02X %02X\n", chip, saw, gave);
}

int main(void)
{
    static struct pin_decoder decoder;
    char line[4096], port;
    unsigned first, second;
    int wrong;

    if (fgets(line, sizeof line, stdin) == NULL)
        return 1;
    line[strcspn(line, "\n")] = '\0';
    wrong = pin_decoder_init(&decoder, line);
    if (wrong) {
        printf("wrong at %d\n", wrong);
        return 0;
    }
    decoder.on_read = on_read;
    decoder.on_write = on_write;
    decoder.on_side = on_side;
    decoder.on_lines = on_lines;
    decoder.on_bus = on_bus;
    decoder.on_look = on_look;
    decoder.on_missed = on_missed;
    while (fgets(line, sizeof line, stdin) != NULL) {
        if (sscanf(line, "?%c", &port) == 1) {
            pin_decoder_look(&decoder, (unsigned)(port - 'A'));
            printf("%c %02X\n", port,
                   pin_decoder_input(&decoder, (unsigned)(port - 'A')) & (line[2] == '+' ? 0xFFFF : 0xFF));
        } else if (sscanf(line, "=%x", &first) == 1)
            next_byte = first;
        else if (sscanf(line, "o%x", &first) == 1)
            pin_decoder_outputs(&decoder, first);
        else if (sscanf(line, "%c%x %x", &port, &first, &second) == 3)
            pin_decoder_port(&decoder, (unsigned)(port - 'A'), first, second);
    }
    return 0;
}
