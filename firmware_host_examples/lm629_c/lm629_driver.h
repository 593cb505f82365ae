/* lm629_driver.h - a small driver for the LM628/LM629 precision motion controller.
 *
 * Written as for real hardware: the driver knows nothing of the board it runs on. The board
 * supplies four bus functions.
 */
#ifndef LM629_DRIVER_H
#define LM629_DRIVER_H

#include <stdint.h>

/* --- what the board supplies: one bus cycle each ---------------------------------------------- */

uint8_t lm629_bus_read_status(void);           /* /PS low,  /RD strobe */
void lm629_bus_write_command(uint8_t command); /* /PS low,  /WR strobe */
uint8_t lm629_bus_read_data(void);             /* /PS high, /RD strobe */
void lm629_bus_write_data(uint8_t data);       /* /PS high, /WR strobe */

/* --- what the driver gives -------------------------------------------------------------------- */

/* Status byte */
#define LM629_BUSY 0x01
#define LM629_COMMAND_ERROR 0x02
#define LM629_TRAJECTORY_COMPLETE 0x04
#define LM629_INDEX 0x08
#define LM629_WRAPAROUND 0x10
#define LM629_POSITION_ERROR 0x20
#define LM629_BREAKPOINT 0x40
#define LM629_MOTOR_OFF 0x80

/* Results */
#define LM629_OK 0
#define LM629_E_BUSY (-1)  /* the chip stays busy: wrong wiring, no clock */
#define LM629_E_RESET (-2) /* the status after reset is not what a healthy chip shows */
#define LM629_E_STATUS (-3) /* position error, command error, or the move does not end */
#define LM629_E_ELSEWHERE (-4) /* the motor is more than LM629_NEAR counts from its target */
#define LM629_NEAR 6

struct lm629_filter {
    uint16_t kp, ki, kd, il; /* 0 to 7FFFh each */
    uint8_t interval;        /* derivative sampling interval, less one sample */
};

struct lm629_move {
    int32_t position;               /* counts */
    uint32_t velocity;              /* 1/65536 counts per sample */
    uint32_t acceleration;          /* 1/65536 counts per sample per sample */
};

/* The check of a healthy reset: status 84h or C4h, and 80h or C0h after RSTI. Call it at least
 * 1.5 ms after /RST has risen. `first` and `cleared` receive the two status bytes. */
int lm629_check_reset(uint8_t *first, uint8_t *cleared);

int lm629_load_filter(const struct lm629_filter *filter); /* LFIL and UDF */
int lm629_start(const struct lm629_move *move);           /* LTRJ and STT */
int lm629_clear_flags(uint8_t flags);                     /* RSTI */
int lm629_read_real_position(int32_t *position);          /* RDRP */
int lm629_check_move(int32_t target, int32_t *position);   /* RDRP, RDDP, status: at rest */
int lm629_read_desired_position(int32_t *position);       /* RDDP */
int lm629_read_signals(uint16_t *signals);                /* RDSIGS */

#endif
