/* x86_decode.h - an instruction being taken apart: its registers, its operand, its immediates.
 * License: Apache-2.0.
 */
#ifndef VBUS_EXEC_X86_DECODE_H
#define VBUS_EXEC_X86_DECODE_H

#include "x86.h"

#include <string.h>

typedef uintptr_t word;

#define CARRY 0x001u
#define ZERO 0x040u
#define DIRECTION 0x400u
#define MASK(size) ((size) >= sizeof(word) ? ~(word)0 : ((word)1 << 8 * (size)) - 1)

/* An instruction being taken apart. */
struct decoder {
    struct x86 *cpu;
    const struct x86_bus *bus;
    const unsigned char *next;
    word flags;
    unsigned rex, size, segment, address_size;
    int operand16, repeat; /* repeat: 0, F2h or F3h */
    unsigned mod, reg, rm;
    int has_address, ip_relative;
    word address;
    unsigned vex, wide, other; /* a VEX prefix; of 32 bytes; its second register */
};

#define REX_W 8u
#define REX_R 4u
#define REX_X 2u
#define REX_B 1u

/* --- registers and memory --------------------------------------------------------------------- */

static inline int high_byte(const struct decoder *d, unsigned number, unsigned size)
{
    return size == 1 && d->rex == 0 && number >= 4 && number < 8;
}

static inline word get(const struct decoder *d, unsigned number, unsigned size)
{
    if (high_byte(d, number, size))
        return d->cpu->regs[number - 4] >> 8 & 0xFF;
    return d->cpu->regs[number] & MASK(size);
}

static inline void set(struct decoder *d, unsigned number, word value, unsigned size)
{
    word *reg = &d->cpu->regs[number];

    if (high_byte(d, number, size)) {
        reg = &d->cpu->regs[number - 4];
        *reg = (*reg & ~(word)0xFF00) | (value & 0xFF) << 8;
    } else if (size >= 4)
        *reg = value & MASK(size); /* 32-bit results clear the upper half */
    else
        *reg = (*reg & ~MASK(size)) | (value & MASK(size));
}

static inline void load_bytes(const struct decoder *d, word address, unsigned char *data, unsigned size)
{
    if (d->bus->follows || d->bus->covers(address, size))
        d->bus->load(address, data, size);
    else
        memcpy(data, (const void *)address, size);
}

static inline void store_bytes(const struct decoder *d, word address, const unsigned char *data,
                        unsigned size)
{
    if (d->bus->follows || d->bus->covers(address, size))
        d->bus->store(address, data, size);
    else
        memcpy((void *)address, data, size);
}

static inline word load(const struct decoder *d, word address, unsigned size)
{
    word value = 0;

    load_bytes(d, address, (unsigned char *)&value, size);
    return value;
}

static inline void store(const struct decoder *d, word address, word value, unsigned size)
{
    store_bytes(d, address, (const unsigned char *)&value, size);
}

static inline word get_rm(const struct decoder *d, unsigned size)
{
    return d->has_address ? load(d, d->address, size) : get(d, d->rm, size);
}

static inline void set_rm(struct decoder *d, word value, unsigned size)
{
    if (d->has_address)
        store(d, d->address, value, size);
    else
        set(d, d->rm, value, size);
}

static inline word sign_extend(word value, unsigned from)
{
    word sign = (word)1 << (8 * from - 1);

    return from >= sizeof(word) ? value : ((value & MASK(from)) ^ sign) - sign;
}

/* --- operands --------------------------------------------------------------------------------- */

/* Take an immediate of up to 4 bytes, sign-extended. */
static inline word immediate(struct decoder *d, unsigned size)
{
    word value = 0;

    memcpy(&value, d->next, size);
    d->next += size;
    return sign_extend(value, size);
}

static inline unsigned immediate_size(const struct decoder *d)
{
    return d->size == 2 ? 2 : 4;
}

/* Take the ModRM byte and what belongs to it. */
static inline void operands(struct decoder *d)
{
    unsigned char modrm = *d->next++;
    word address = 0;

    d->mod = modrm >> 6;
    d->reg = (modrm >> 3 & 7) | (d->rex & REX_R ? 8 : 0);
    d->rm = (modrm & 7) | (d->rex & REX_B ? 8 : 0);
    d->has_address = d->mod != 3;
    if (!d->has_address)
        return;
    if ((modrm & 7) == 4) {
        unsigned char sib = *d->next++;
        unsigned index = (sib >> 3 & 7) | (d->rex & REX_X ? 8 : 0);
        unsigned base = (sib & 7) | (d->rex & REX_B ? 8 : 0);

        if (index != 4)
            address = d->cpu->regs[index] << (sib >> 6);
        if ((sib & 7) == 5 && d->mod == 0)
            address += immediate(d, 4);
        else
            address += d->cpu->regs[base];
    } else if ((modrm & 7) == 5 && d->mod == 0) {
        address = immediate(d, 4);
        d->ip_relative = X86_BITS == 64;
    } else {
        address = d->cpu->regs[d->rm];
    }
    if (d->mod == 1)
        address += immediate(d, 1);
    else if (d->mod == 2)
        address += immediate(d, 4);
    d->address = address & MASK(d->address_size);
}

/* The operand in memory, once `rest` bytes of immediates are known to follow. */
static inline void settle_address(struct decoder *d, unsigned rest)
{
    if (d->has_address && d->ip_relative)
        d->address = (d->address + (word)d->next + rest) & MASK(d->address_size);
}

static inline int in_window(const struct decoder *d, unsigned size)
{
    return d->bus->follows || (d->has_address && d->bus->covers(d->address, size));
}

int x86_two_bytes(struct decoder *d); /* x86_two.c */
int x86_condition(word flags, unsigned code);

/* An instruction that is followed, not trapped: x86_follow.c. */
#define X86_USUAL (-1) /* it is carried out as if it were trapped */

int x86_follow(struct decoder *d, unsigned op);

/* Instructions of the wide registers: x86_wide.c. */
#define WIDE_MOVNTDQA 0x12Au /* 0Fh 38h 2Ah */

int wide_vector(struct decoder *d, unsigned op);
int wide_avx(struct decoder *d, unsigned op);
int wide_x87(struct decoder *d, unsigned op);

#endif
