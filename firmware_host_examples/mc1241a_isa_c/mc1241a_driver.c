/* mc1241a_driver.c - see mc1241a_driver.h. */
#include "mc1241a_driver.h"

/* Busy ends within 67.5 us, after a reset within 2 ms; an ISA cycle takes about one microsecond. */
#define READY_POLLS 10000

static uint16_t sum; /* of the packet under way */

static int wait_ready(void)
{
    unsigned polls;

    for (polls = 0; polls < READY_POLLS; polls++)
        if (mc1241a_bus_ready())
            return MC1241A_OK;
    return MC1241A_E_BUSY;
}

static int send_command(uint8_t command)
{
    if (wait_ready() != MC1241A_OK)
        return MC1241A_E_BUSY;
    mc1241a_bus_write_command(command);
    sum = command;
    return MC1241A_OK;
}

static int send_word(uint16_t word)
{
    if (wait_ready() != MC1241A_OK)
        return MC1241A_E_BUSY;
    mc1241a_bus_write_data((uint8_t)(word >> 8));
    mc1241a_bus_write_data((uint8_t)word);
    sum = (uint16_t)(sum + word);
    return MC1241A_OK;
}

static int take_word(uint16_t *word)
{
    if (wait_ready() != MC1241A_OK)
        return MC1241A_E_BUSY;
    *word = (uint16_t)(mc1241a_bus_read_data() << 8);
    *word = (uint16_t)(*word | mc1241a_bus_read_data());
    return MC1241A_OK;
}

static int take_data(uint16_t *word)
{
    int error = take_word(word);

    if (error == MC1241A_OK)
        sum = (uint16_t)(sum + *word);
    return error;
}

static int end_packet(void)
{
    uint16_t checksum;

    if (take_word(&checksum) != MC1241A_OK)
        return MC1241A_E_BUSY;
    return checksum == sum ? MC1241A_OK : MC1241A_E_CHECKSUM;
}

int mc1241a_command(uint8_t command)
{
    return send_command(command) ? MC1241A_E_BUSY : end_packet();
}

int mc1241a_write_word(uint8_t command, uint16_t word)
{
    return send_command(command) || send_word(word) ? MC1241A_E_BUSY : end_packet();
}

int mc1241a_write_long(uint8_t command, int32_t value)
{
    uint32_t bits = (uint32_t)value;

    if (send_command(command) || send_word((uint16_t)(bits >> 16)) || send_word((uint16_t)bits))
        return MC1241A_E_BUSY;
    return end_packet();
}

int mc1241a_read_word(uint8_t command, uint16_t *word)
{
    return send_command(command) || take_data(word) ? MC1241A_E_BUSY : end_packet();
}

int mc1241a_read_long(uint8_t command, int32_t *value)
{
    uint16_t high, low;

    if (send_command(command) || take_data(&high) || take_data(&low))
        return MC1241A_E_BUSY;
    *value = (int32_t)((uint32_t)high << 16 | low);
    return end_packet();
}

int mc1241a_reset(void)
{
    mc1241a_bus_reset();
    mc1241a_pause_ms(2);
    return wait_ready();
}

int mc1241a_wait(uint8_t command, uint16_t bits, unsigned pause, unsigned limit, uint16_t *status)
{
    while (limit-- > 0) {
        int error = mc1241a_read_word(command, status);

        if (error != MC1241A_OK)
            return error;
        if (*status & bits)
            return MC1241A_OK;
        mc1241a_pause_ms(pause);
    }
    return MC1241A_E_TIME;
}
