/* mcp1200_driver.c - see mcp1200_driver.h. */
#include "mcp1200_driver.h"

#define R_FLAG 0x00
#define R_FEATURE 0x01
#define R_CONFIG 0x02
#define R_CAPTURE_CONTROL 0x03
#define R_EXCEPTION 0x04
#define R_MODE 0x05
#define R_PHASE 0x06
#define R_STATUS 0x07
#define R_COMMAND_LSB 0x0E /* 0C MSB, 0D; written last, it loads all three */
#define R_ACTUAL_LSB 0x14  /* 12 MSB, 13; read first, it latches all three */
#define R_PRESET_LSB 0x17  /* 15 MSB, 16; written last */
#define R_VELOCITY 0x23    /* 23 MSB, 24, 25 fraction */
#define R_ACCELERATION 0x26 /* LSB, MSB */
#define R_PROFILE_VELOCITY 0x28
#define R_FINAL 0x29   /* LSB, CSB, MSB; the LSB is written last */
#define R_CAPTURE 0x2E /* LSB, CSB, MSB */
#define R_BREAK 0x3D   /* LSB, CSB, MSB */
#define R_JERK 0x54    /* LSB, MSB */
#define R_KP 0x61
#define R_KI 0x62
#define R_KD 0x63

#define FEATURE_PID 0x08
#define FEATURE_S_CURVE 0x10
#define FEATURE_HIGH_RESOLUTION 0x20
#define CONFIG_EXTENDED 0x01
#define CONFIG_BREAKPOINT 0x10
#define CONFIG_REPEAT 0x20
#define CAPTURE_INDEX 0x10
#define CAPTURE_INDEX_LATCH 0x08
#define EXCEPTION_DEFAULT 0x09
#define MODE_IDLE 0x01
#define MODE_CONTROL 0x03
#define SET_PROFILE 0x08
#define SET_VELOCITY 0x0D
#define CLEAR_VELOCITY 0x05
#define STATUS_ERRORS 0xF8 /* active low */

/* A sample takes 520 us with the timer's default values and 8 MHz. */
#define SAMPLE_US 520
#define SAMPLES_TO_WAIT 8000

static int32_t from_24_bits(uint32_t value)
{
    return (int32_t)(value & 0x7FFFFF) - (int32_t)(value & 0x800000);
}

/* For registers that read back: what came otherwise is seen here. */
static int put(uint8_t reg, uint8_t value)
{
    mcp1200_bus_write(reg, value);
    return mcp1200_bus_read(reg) == value ? MCP1200_OK : MCP1200_E_READBACK;
}

/* MSB first, towards lower or higher registers. */
static void write_24(uint8_t msb, int step, int32_t value)
{
    mcp1200_bus_write(msb, (uint8_t)(value >> 16));
    mcp1200_bus_write((uint8_t)(msb + step), (uint8_t)(value >> 8));
    mcp1200_bus_write((uint8_t)(msb + 2 * step), (uint8_t)value);
}

/* LSB first. */
static int32_t read_24(uint8_t lsb, int step)
{
    uint32_t value = mcp1200_bus_read(lsb);

    value |= (uint32_t)mcp1200_bus_read((uint8_t)(lsb + step)) << 8;
    value |= (uint32_t)mcp1200_bus_read((uint8_t)(lsb + 2 * step)) << 16;
    return from_24_bits(value);
}

static int write_16(uint8_t lsb, uint16_t value)
{
    int error = put((uint8_t)(lsb + 1), (uint8_t)(value >> 8));

    return error == MCP1200_OK ? put(lsb, (uint8_t)value) : error;
}

static int wait_for(uint8_t reg, uint8_t mask, uint8_t level)
{
    int samples;

    for (samples = 0; samples < SAMPLES_TO_WAIT; samples++) {
        if ((mcp1200_bus_read(reg) & mask) == level)
            return MCP1200_OK;
        mcp1200_pause_us(SAMPLE_US);
    }
    return MCP1200_E_TIMEOUT;
}

static int go_to(uint8_t mode)
{
    mcp1200_bus_write(R_MODE, mode);
    return wait_for(R_FLAG, MCP1200_F_IDLE, mode == MODE_IDLE ? MCP1200_F_IDLE : 0);
}

int mcp1200_check_reset(uint8_t *status)
{
    if (wait_for(R_FLAG, MCP1200_F_IDLE, MCP1200_F_IDLE) != MCP1200_OK)
        return MCP1200_E_TIMEOUT;
    *status = mcp1200_status();
    return (*status & STATUS_ERRORS) == STATUS_ERRORS ? MCP1200_OK : MCP1200_E_FAULT;
}

int mcp1200_start(const struct mcp1200_pid *pid)
{
    if (put(R_CONFIG, CONFIG_EXTENDED) || put(R_FEATURE, FEATURE_PID) || put(R_KP, pid->kp)
        || put(R_KI, pid->ki) || put(R_KD, pid->kd))
        return MCP1200_E_READBACK;
    return go_to(MODE_CONTROL);
}

int mcp1200_home(int16_t velocity, uint16_t acceleration, int32_t *captured)
{
    int32_t stopped;
    int result;

    if (put(R_FEATURE, FEATURE_PID | FEATURE_HIGH_RESOLUTION))
        return MCP1200_E_READBACK;
    mcp1200_bus_write(R_CAPTURE_CONTROL, CAPTURE_INDEX);
    if (write_16(R_ACCELERATION, acceleration))
        return MCP1200_E_READBACK;
    write_24(R_VELOCITY, 1, velocity);
    mcp1200_bus_write(R_FLAG, SET_VELOCITY);
    result = wait_for(R_CAPTURE_CONTROL, CAPTURE_INDEX_LATCH, CAPTURE_INDEX_LATCH);
    write_24(R_VELOCITY, 1, 0);
    if (result != MCP1200_OK || wait_for(R_FLAG, MCP1200_F_IN_MOTION, 0) != MCP1200_OK)
        return MCP1200_E_TIMEOUT;
    mcp1200_bus_write(R_FLAG, CLEAR_VELOCITY);
    *captured = read_24(R_CAPTURE, 1);
    mcp1200_bus_write(R_CAPTURE_CONTROL, 0);

    /* Counter and command position change together only where no loop is closed. */
    mcp1200_pause_us(200 * SAMPLE_US);
    if (go_to(MODE_IDLE) != MCP1200_OK)
        return MCP1200_E_TIMEOUT;
    stopped = mcp1200_position() - *captured;
    write_24(R_PRESET_LSB - 2, 1, stopped);
    write_24(R_COMMAND_LSB - 2, 1, stopped);
    return go_to(MODE_CONTROL);
}

void mcp1200_breakpoints(int32_t first, int32_t every)
{
    /* The manual's usage example, step by step. */
    mcp1200_bus_write(R_EXCEPTION, EXCEPTION_DEFAULT); /* breakpoint: report only */
    mcp1200_bus_write(R_CAPTURE_CONTROL, 0);           /* TRIG is an output */
    mcp1200_bus_write(R_CONFIG, CONFIG_EXTENDED | CONFIG_BREAKPOINT);
    write_24(R_BREAK + 2, -1, first);
    mcp1200_pause_us(2 * SAMPLE_US);
    mcp1200_bus_write(R_STATUS, 0);
    mcp1200_bus_write(R_CONFIG, CONFIG_EXTENDED | CONFIG_BREAKPOINT | CONFIG_REPEAT);
    write_24(R_BREAK + 2, -1, every);
}

void mcp1200_breakpoints_off(void)
{
    mcp1200_bus_write(R_CONFIG, CONFIG_EXTENDED);
    mcp1200_bus_write(R_STATUS, 0);
}

int mcp1200_begin(const struct mcp1200_move *move)
{
    uint8_t feature = FEATURE_PID;

    if (move->jerk != 0) {
        feature |= FEATURE_S_CURVE;
        if (write_16(R_JERK, move->jerk))
            return MCP1200_E_READBACK;
    }
    if (put(R_FEATURE, feature) || put(R_PROFILE_VELOCITY, move->velocity)
        || write_16(R_ACCELERATION, move->acceleration))
        return MCP1200_E_READBACK;
    write_24(R_FINAL + 2, -1, move->final);
    mcp1200_bus_write(R_FLAG, SET_PROFILE);
    return (mcp1200_status() & STATUS_ERRORS) == STATUS_ERRORS ? MCP1200_OK : MCP1200_E_FAULT;
}

uint8_t mcp1200_flags(void)
{
    return mcp1200_bus_read(R_FLAG);
}

uint8_t mcp1200_phase(void)
{
    return mcp1200_bus_read(R_PHASE);
}

uint8_t mcp1200_status(void)
{
    return mcp1200_bus_read(R_STATUS);
}

int32_t mcp1200_position(void)
{
    return read_24(R_ACTUAL_LSB, -1);
}

int32_t mcp1200_command_position(void)
{
    return read_24(R_COMMAND_LSB, -1);
}
