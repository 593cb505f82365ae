/* first_draft.c - what axis.c was at first; see axis.h. It moves, and two things in it are wrong.
 *
 * It waits for 84h after the reset, however long, and the manual allows C4h as well. And it defines
 * home without waiting for the chip, which is still busy and does not take the command; with the
 * motor at 0 nobody notices.
 */
#include "axis.h"

#define BUSY 0x01
#define COMPLETE 0x04
#define EXCESSIVE_ERROR 0x20

#define STT 0x01
#define DFH 0x02
#define UDF 0x04
#define RDRP 0x0A
#define LPES 0x1A
#define RSTI 0x1D
#define LFIL 0x1E
#define LTRJ 0x1F

#define BUSY_POLLS 500
#define MOVE_POLLS 20000L /* 10 s */

static int ready(void)
{
    int polls;

    for (polls = 0; polls < BUSY_POLLS; polls++)
        if (!(bus_read_status() & BUSY))
            return AXIS_OK;
    return AXIS_BUSY;
}

static int command(uint8_t code)
{
    if (ready() != AXIS_OK)
        return AXIS_BUSY;
    bus_write_command(code);
    return AXIS_OK;
}

static int word(uint16_t value)
{
    if (ready() != AXIS_OK)
        return AXIS_BUSY;
    bus_write_data((uint8_t)(value >> 8));
    bus_write_data((uint8_t)value);
    return AXIS_OK;
}

static int words(uint8_t code, const uint16_t *values, int count)
{
    int error = command(code);

    while (error == AXIS_OK && count-- > 0)
        error = word(*values++);
    return error;
}

int axis_start(void)
{
    static const uint16_t nothing[] = {0x0000};
    static const uint16_t filter[] = {0x000A, 300, 2000}; /* kp, kd */
    static const uint16_t limit[] = {500};                /* counts of error: stop the motor */
    uint8_t status = bus_read_status();
    int error;

    if (status == 0)
        return AXIS_RESET;
    while (bus_read_status() != 0x84)
        ;
    if ((error = words(RSTI, nothing, 1)) != AXIS_OK || (error = ready()) != AXIS_OK)
        return error;
    if ((error = words(LFIL, filter, 3)) != AXIS_OK || (error = command(UDF)) != AXIS_OK)
        return error;
    error = words(LPES, limit, 1);
    bus_write_command(DFH);
    return error;
}

int axis_move(int32_t position, int32_t *reached)
{
    uint32_t target = (uint32_t)position;
    uint16_t move[7] = {0x002A, 0, 400, 4, 0, 0, 0}; /* acceleration, velocity, position */
    uint32_t value = 0;
    long polls;
    int error, half;
    uint8_t status = 0;

    move[5] = (uint16_t)(target >> 16);
    move[6] = (uint16_t)target;
    if ((error = words(LTRJ, move, 7)) != AXIS_OK || (error = command(STT)) != AXIS_OK)
        return error;
    if ((error = ready()) != AXIS_OK)
        return error;
    for (polls = 0; polls < MOVE_POLLS; polls++) {
        status = bus_read_status();
        if (status & (COMPLETE | EXCESSIVE_ERROR))
            break;
        bus_pause_us(500);
    }
    if (status & EXCESSIVE_ERROR)
        return AXIS_STALLED;
    if (!(status & COMPLETE))
        return AXIS_LATE;
    if ((error = command(RDRP)) != AXIS_OK)
        return error;
    for (half = 0; half < 2; half++) {
        if ((error = ready()) != AXIS_OK)
            return error;
        value = value << 8 | bus_read_data();
        value = value << 8 | bus_read_data();
    }
    *reached = (int32_t)value;
    return AXIS_OK;
}
