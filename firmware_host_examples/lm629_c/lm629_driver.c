/* lm629_driver.c - see lm629_driver.h. */
#include "lm629_driver.h"

#define STT 0x01
#define UDF 0x04
#define RDDP 0x08
#define RDRP 0x0A
#define RDSIGS 0x0C
#define RSTI 0x1D
#define LFIL 0x1E
#define LTRJ 0x1F

#define LFIL_ALL 0x000F /* kp, ki, kd and il follow */
#define LTRJ_ALL 0x002A /* acceleration, velocity and position follow, all absolute */

/* Busy falls within 100 us; an MCU's bus cycle takes about one. */
#define BUSY_POLLS 500

static int wait_ready(void)
{
    int polls;

    for (polls = 0; polls < BUSY_POLLS; polls++)
        if (!(lm629_bus_read_status() & LM629_BUSY))
            return LM629_OK;
    return LM629_E_BUSY;
}

static int write_command(uint8_t command)
{
    if (wait_ready() != LM629_OK)
        return LM629_E_BUSY;
    lm629_bus_write_command(command);
    return LM629_OK;
}

static int write_word(uint16_t word)
{
    if (wait_ready() != LM629_OK)
        return LM629_E_BUSY;
    lm629_bus_write_data((uint8_t)(word >> 8));
    lm629_bus_write_data((uint8_t)word);
    return LM629_OK;
}

static int write_long(uint32_t value)
{
    int error = write_word((uint16_t)(value >> 16));

    return error == LM629_OK ? write_word((uint16_t)value) : error;
}

static int read_word(uint16_t *word)
{
    if (wait_ready() != LM629_OK)
        return LM629_E_BUSY;
    *word = (uint16_t)(lm629_bus_read_data() << 8);
    *word = (uint16_t)(*word | lm629_bus_read_data());
    return LM629_OK;
}

static int read_long(uint8_t command, int32_t *value)
{
    uint16_t high, low;

    if (write_command(command) || read_word(&high) || read_word(&low))
        return LM629_E_BUSY;
    *value = (int32_t)((uint32_t)high << 16 | low);
    return LM629_OK;
}

int lm629_check_reset(uint8_t *first, uint8_t *cleared)
{
    *first = lm629_bus_read_status();
    if (*first != 0x84 && *first != 0xC4)
        return LM629_E_RESET;
    if (lm629_clear_flags(0xFF) != LM629_OK)
        return LM629_E_BUSY;
    if (wait_ready() != LM629_OK)
        return LM629_E_BUSY;
    *cleared = lm629_bus_read_status();
    return *cleared == 0x80 || *cleared == 0xC0 ? LM629_OK : LM629_E_RESET;
}

int lm629_clear_flags(uint8_t flags)
{
    if (write_command(RSTI) || write_word((uint16_t)(~flags & 0x7E)))
        return LM629_E_BUSY;
    return LM629_OK;
}

int lm629_load_filter(const struct lm629_filter *filter)
{
    if (write_command(LFIL) || write_word((uint16_t)(filter->interval << 8 | LFIL_ALL))
        || write_word(filter->kp) || write_word(filter->ki) || write_word(filter->kd)
        || write_word(filter->il) || write_command(UDF))
        return LM629_E_BUSY;
    return LM629_OK;
}

int lm629_start(const struct lm629_move *move)
{
    if (write_command(LTRJ) || write_word(LTRJ_ALL) || write_long(move->acceleration)
        || write_long(move->velocity) || write_long((uint32_t)move->position)
        || write_command(STT))
        return LM629_E_BUSY;
    return LM629_OK;
}

int lm629_read_real_position(int32_t *position)
{
    return read_long(RDRP, position);
}

int lm629_check_move(int32_t target, int32_t *real)
{
    int32_t desired;

    if (read_long(RDRP, real) || read_long(RDDP, &desired))
        return LM629_E_BUSY;
    if (lm629_bus_read_status() & (LM629_POSITION_ERROR | LM629_COMMAND_ERROR))
        return LM629_E_STATUS;
    /* RDDP is exact: a bit of the target that came otherwise may be less than the motor's play. */
    if (desired != target || *real < target - LM629_NEAR || *real > target + LM629_NEAR)
        return LM629_E_ELSEWHERE;
    return LM629_OK;
}

int lm629_read_desired_position(int32_t *position)
{
    return read_long(RDDP, position);
}

int lm629_read_signals(uint16_t *signals)
{
    if (write_command(RDSIGS) || read_word(signals))
        return LM629_E_BUSY;
    return LM629_OK;
}
