/* mcp1200_driver.h - a small driver for the MCP-1200 motion control ASIC.
 *
 * Written as for real hardware: the driver knows nothing of the board it runs on. The board
 * supplies two bus functions and a pause.
 */
#ifndef MCP1200_DRIVER_H
#define MCP1200_DRIVER_H

#include <stdint.h>

/* --- what the board supplies ------------------------------------------------------------------ */

uint8_t mcp1200_bus_read(uint8_t reg);             /* /ALE, then /CS and /OE with R/W high */
void mcp1200_bus_write(uint8_t reg, uint8_t data); /* /ALE, then /CS with R/W low */
void mcp1200_pause_us(unsigned microseconds);

/* --- what the driver gives -------------------------------------------------------------------- */

/* Flag register */
#define MCP1200_F_PROFILE 0x01
#define MCP1200_F_IDLE 0x02
#define MCP1200_F_IN_MOTION 0x04

/* Results */
#define MCP1200_OK 0
#define MCP1200_E_TIMEOUT (-1)
#define MCP1200_E_FAULT (-2) /* an error flag in the status register is down */
#define MCP1200_E_READBACK (-3) /* a register reads other than what was written */

struct mcp1200_pid {
    uint8_t kp, ki, kd;
};

struct mcp1200_move {
    int32_t final;         /* counts, 24 bits */
    uint8_t velocity;      /* counts per sample, 0 to 127 */
    uint16_t acceleration; /* 1/256 counts per sample per sample */
    uint16_t jerk;         /* 1/65536 counts per sample cubed; 0 makes a trapezoid */
};

/* Wait for the end of a reset and look at the status register. */
int mcp1200_check_reset(uint8_t *status);

/* Select the PID filter and go to control mode. */
int mcp1200_start(const struct mcp1200_pid *pid);

/* Run at `velocity` (1/256 counts per sample, signed) until the index pulse is captured; stop;
 * make the index position 0. `captured` receives where the index was before. */
int mcp1200_home(int16_t velocity, uint16_t acceleration, int32_t *captured);

/* Pull TRIG low when the position is `first`, and then every `every` counts. */
void mcp1200_breakpoints(int32_t first, int32_t every);
void mcp1200_breakpoints_off(void);

int mcp1200_begin(const struct mcp1200_move *move);
uint8_t mcp1200_flags(void);
uint8_t mcp1200_phase(void); /* 1 to 7 while a profile runs */
uint8_t mcp1200_status(void);
int32_t mcp1200_position(void);
int32_t mcp1200_command_position(void);

#endif
