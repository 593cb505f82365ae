/* lm629_card.h - an LM629 on a card in a PC's slot: two I/O ports, driven from user space.
 *
 *     base + 0   /PS low:  write commands, read the status
 *     base + 1   /PS high: data, in words, high byte first
 */
#ifndef LM629_CARD_H
#define LM629_CARD_H

#include <stdint.h>

/* Status byte */
#define LM629_BUSY 0x01
#define LM629_COMMAND_ERROR 0x02
#define LM629_TRAJECTORY_COMPLETE 0x04
#define LM629_POSITION_ERROR 0x20

/* Results */
#define LM629_OK 0
#define LM629_E_PORTS (-1) /* the kernel does not give us the ports: errno says why */
#define LM629_E_BUSY (-2)  /* the chip stays busy */
#define LM629_E_RESET (-3) /* it does not come up as the data sheet says, however often we try */

struct lm629 {
    unsigned short base;
    uint8_t after_reset, after_rsti; /* what lm629_open has seen */
    unsigned resets;                 /* how often it has tried */
    unsigned most_polls;             /* the longest wait for busy so far */
};

struct lm629_filter {
    uint16_t kp, ki, kd, il;
    uint8_t interval; /* derivative sampling interval, less one sample */
};

int lm629_open(struct lm629 *card, unsigned short base);
uint8_t lm629_status(struct lm629 *card);
int lm629_clear_flags(struct lm629 *card, uint8_t flags);

/* Which flags interrupt from now on. */
int lm629_interrupt_by(struct lm629 *card, uint8_t flags);

int lm629_load_filter(struct lm629 *card, const struct lm629_filter *filter);

/* 1/65536 counts per sample (and sample), and counts. */
int lm629_start(struct lm629 *card, uint32_t acceleration, uint32_t velocity, int32_t position);

/* Poll the status every millisecond until one of `flags` is there, at most `limit_ms` long. */
int lm629_wait(struct lm629 *card, uint8_t flags, unsigned limit_ms, uint8_t *status);

int lm629_real_position(struct lm629 *card, int32_t *position);

#endif
