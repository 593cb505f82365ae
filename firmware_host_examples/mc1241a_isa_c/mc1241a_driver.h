/* mc1241a_driver.h - a small driver for the MC1241A advanced microstepping motion chipset.
 *
 * Written as for real hardware: the driver knows the chip set and nothing of the board it sits on.
 * The board supplies six functions.
 */
#ifndef MC1241A_DRIVER_H
#define MC1241A_DRIVER_H

#include <stdint.h>

/* --- what the board supplies ------------------------------------------------------------------ */

int mc1241a_bus_ready(void);                     /* HostRdy, not 0 if high */
void mc1241a_bus_write_command(uint8_t command); /* HostCmd high, ~HostWrite strobe */
uint8_t mc1241a_bus_read_data(void);             /* HostCmd low, ~HostRead strobe */
void mc1241a_bus_write_data(uint8_t data);       /* HostCmd low, ~HostWrite strobe */
void mc1241a_bus_reset(void);                    /* ~Reset pulse */
void mc1241a_pause_ms(unsigned milliseconds);

/* --- what the driver gives -------------------------------------------------------------------- */

/* Status word */
#define MC1241A_MOTION_COMPLETE 0x0001
#define MC1241A_WRAP 0x0002
#define MC1241A_BREAKPOINT 0x0004
#define MC1241A_CAPTURE 0x0008
#define MC1241A_MOTION_ERROR 0x0010
#define MC1241A_POSITIVE_LIMIT 0x0020
#define MC1241A_NEGATIVE_LIMIT 0x0040
#define MC1241A_COMMAND_ERROR 0x0080
#define MC1241A_MOTOR_ON 0x0100
#define MC1241A_IN_MOTION 0x0400
#define MC1241A_AXIS(status) (((status) >> 12 & 3) + 1)

/* Commands without data */
#define MC1241A_SET_PRFL_TRAP 0x09
#define MC1241A_SET_PRFL_S_CRV 0x0B
#define MC1241A_UPDATE 0x1A
#define MC1241A_CLR_STATUS 0x33
#define MC1241A_MTR_ON 0x43
#define MC1241A_STOP 0x46
#define MC1241A_SET_EXT_BRK 0x5E
#define MC1241A_SET_PHASE_2 0x74

/* Commands that take one word */
#define MC1241A_SET_MAX_ACC 0x15
#define MC1241A_SET_POS_ERR 0x29
#define MC1241A_SET_INTRPT_MASK 0x2F
#define MC1241A_RST_INTRPT 0x32
#define MC1241A_MULTI_UPDATE 0x5B
#define MC1241A_SET_STEP_RATIO 0x68
#define MC1241A_SET_BUF_MTR_CMD 0x77

/* Commands that take two words */
#define MC1241A_SET_POS 0x10
#define MC1241A_SET_VEL 0x11
#define MC1241A_SET_ACC 0x12
#define MC1241A_SET_JERK 0x13
#define MC1241A_SET_ACTL_POS 0x4D

/* Commands that give one word */
#define MC1241A_SET_1 0x01
#define MC1241A_SET_2 0x02
#define MC1241A_GET_HOME 0x05
#define MC1241A_SET_I 0x08
#define MC1241A_GET_INTRPT 0x30
#define MC1241A_GET_STATUS 0x31
#define MC1241A_GET_MODE 0x48
#define MC1241A_GET_VRSN 0x6C

/* Commands that give two words */
#define MC1241A_GET_TRGT_POS 0x1D
#define MC1241A_GET_ACTL_POS 0x37
#define MC1241A_GET_TIME 0x3E

/* Results */
#define MC1241A_OK 0
#define MC1241A_E_BUSY (-1)     /* HostRdy stays low: wrong wiring, no clock */
#define MC1241A_E_CHECKSUM (-2) /* the packet was not understood as it was meant */
#define MC1241A_E_TIME (-3)     /* an event has not come in time */

/* Every function reads the checksum of its packet and compares it. */
int mc1241a_command(uint8_t command);
int mc1241a_write_word(uint8_t command, uint16_t word);
int mc1241a_write_long(uint8_t command, int32_t value);
int mc1241a_read_word(uint8_t command, uint16_t *word);
int mc1241a_read_long(uint8_t command, int32_t *value);

/* Pulse ~Reset and wait until HostRdy is high again. */
int mc1241a_reset(void);

/* Read GET_STATUS (or GET_INTRPT) until one of `bits` is set, every `pause` ms, `limit` times. */
int mc1241a_wait(uint8_t command, uint16_t bits, unsigned pause, unsigned limit, uint16_t *status);

#endif
