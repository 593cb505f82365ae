/* x86.c - see x86.h. License: Apache-2.0. */
#include "x86.h"

#include "x86_alu.h"

#include <string.h>

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
};

#define REX_W 8u
#define REX_R 4u
#define REX_X 2u
#define REX_B 1u

/* --- registers and memory --------------------------------------------------------------------- */

static int high_byte(const struct decoder *d, unsigned number, unsigned size)
{
    return size == 1 && d->rex == 0 && number >= 4 && number < 8;
}

static word get(const struct decoder *d, unsigned number, unsigned size)
{
    if (high_byte(d, number, size))
        return d->cpu->regs[number - 4] >> 8 & 0xFF;
    return d->cpu->regs[number] & MASK(size);
}

static void set(struct decoder *d, unsigned number, word value, unsigned size)
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

static void load_bytes(const struct decoder *d, word address, unsigned char *data, unsigned size)
{
    if (d->bus->covers(address, size))
        d->bus->load(address, data, size);
    else
        memcpy(data, (const void *)address, size);
}

static void store_bytes(const struct decoder *d, word address, const unsigned char *data,
                        unsigned size)
{
    if (d->bus->covers(address, size))
        d->bus->store(address, data, size);
    else
        memcpy((void *)address, data, size);
}

static word load(const struct decoder *d, word address, unsigned size)
{
    word value = 0;

    load_bytes(d, address, (unsigned char *)&value, size);
    return value;
}

static void store(const struct decoder *d, word address, word value, unsigned size)
{
    store_bytes(d, address, (const unsigned char *)&value, size);
}

static word get_rm(const struct decoder *d, unsigned size)
{
    return d->has_address ? load(d, d->address, size) : get(d, d->rm, size);
}

static void set_rm(struct decoder *d, word value, unsigned size)
{
    if (d->has_address)
        store(d, d->address, value, size);
    else
        set(d, d->rm, value, size);
}

static word sign_extend(word value, unsigned from)
{
    word sign = (word)1 << (8 * from - 1);

    return from >= sizeof(word) ? value : ((value & MASK(from)) ^ sign) - sign;
}

/* --- operands --------------------------------------------------------------------------------- */

/* Take an immediate of up to 4 bytes, sign-extended. */
static word immediate(struct decoder *d, unsigned size)
{
    word value = 0;

    memcpy(&value, d->next, size);
    d->next += size;
    return sign_extend(value, size);
}

static unsigned immediate_size(const struct decoder *d)
{
    return d->size == 2 ? 2 : 4;
}

/* Take the ModRM byte and what belongs to it. */
static void operands(struct decoder *d)
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
static void settle_address(struct decoder *d, unsigned rest)
{
    if (d->has_address && d->ip_relative)
        d->address = (d->address + (word)d->next + rest) & MASK(d->address_size);
}

static int in_window(const struct decoder *d, unsigned size)
{
    return d->has_address && d->bus->covers(d->address, size);
}

/* --- string instructions ---------------------------------------------------------------------- */

static void advance(struct decoder *d, unsigned number, unsigned size)
{
    word step = d->flags & DIRECTION ? -(word)size : size;

    set(d, number, (d->cpu->regs[number] + step) & MASK(d->address_size), d->address_size);
}

/* One element; whether a repeated comparison goes on is in the flags. */
static void string_element(struct decoder *d, unsigned op, unsigned size)
{
    word mask = MASK(d->address_size);
    word from = d->cpu->regs[X86_SI] & mask, to = d->cpu->regs[X86_DI] & mask;
    word value;

    switch (op & ~1u) {
    case 0x6C: /* ins */
        store(d, to, d->bus->in((unsigned)get(d, X86_DX, 2), size), size);
        advance(d, X86_DI, size);
        break;
    case 0x6E: /* outs */
        d->bus->out((unsigned)get(d, X86_DX, 2), (uint32_t)load(d, from, size), size);
        advance(d, X86_SI, size);
        break;
    case 0xA4: /* movs */
        store(d, to, load(d, from, size), size);
        advance(d, X86_SI, size);
        advance(d, X86_DI, size);
        break;
    case 0xA6: /* cmps */
        value = load(d, from, size);
        alu_cmp(value, load(d, to, size), size, &d->flags);
        advance(d, X86_SI, size);
        advance(d, X86_DI, size);
        break;
    case 0xAA: /* stos */
        store(d, to, get(d, X86_AX, size), size);
        advance(d, X86_DI, size);
        break;
    case 0xAC: /* lods */
        set(d, X86_AX, load(d, from, size), size);
        advance(d, X86_SI, size);
        break;
    default: /* scas */
        alu_cmp(get(d, X86_AX, size), load(d, to, size), size, &d->flags);
        advance(d, X86_DI, size);
    }
}

static int string(struct decoder *d, unsigned op)
{
    unsigned size = op & 1 ? d->size : 1;
    int ports = op < 0x70, compares = (op & ~1u) == 0xA6 || (op & ~1u) == 0xAE;
    word count = 1;

    if (ports && size == 8)
        size = 4;
    if (d->segment || (ports && !d->bus->may((unsigned)get(d, X86_DX, 2), size)))
        return X86_FOREIGN;
    if (d->repeat)
        count = d->cpu->regs[X86_CX] & MASK(d->address_size);
    while (count > 0) {
        string_element(d, op, size);
        count--;
        if (compares && d->repeat && !(d->flags & ZERO) == (d->repeat == 0xF3))
            break;
    }
    if (d->repeat)
        set(d, X86_CX, count, d->address_size);
    return X86_DONE;
}

/* --- ports ------------------------------------------------------------------------------------ */

static int port(struct decoder *d, unsigned op)
{
    unsigned size = !(op & 1) ? 1 : d->operand16 ? 2 : 4;
    unsigned number = op < 0xE8 ? *d->next++ : (unsigned)get(d, X86_DX, 2);

    if (!d->bus->may(number, size))
        return X86_FOREIGN;
    if (op & 2)
        d->bus->out(number, (uint32_t)get(d, X86_AX, size), size);
    else
        set(d, X86_AX, d->bus->in(number, size), size);
    return X86_DONE;
}

/* --- one-byte opcodes ------------------------------------------------------------------------- */

static int arithmetic(struct decoder *d, unsigned op)
{
    unsigned size = op & 1 ? d->size : 1, which = op >> 3 & 7;
    word result;

    operands(d);
    settle_address(d, 0);
    if (!in_window(d, size))
        return X86_FOREIGN;
    if (op & 2) {
        result = alu_group[which](get(d, d->reg, size), get_rm(d, size), size, &d->flags);
        if (which != 7)
            set(d, d->reg, result, size);
    } else {
        result = alu_group[which](get_rm(d, size), get(d, d->reg, size), size, &d->flags);
        if (which != 7)
            set_rm(d, result, size);
    }
    return X86_DONE;
}

static int arithmetic_immediate(struct decoder *d, unsigned op)
{
    unsigned size = op & 1 ? d->size : 1;
    unsigned bytes = op == 0x81 ? immediate_size(d) : 1;
    word value, result;

    operands(d);
    settle_address(d, bytes);
    if (!in_window(d, size))
        return X86_FOREIGN;
    value = immediate(d, bytes);
    result = alu_group[d->reg & 7](get_rm(d, size), value, size, &d->flags);
    if ((d->reg & 7) != 7)
        set_rm(d, result, size);
    return X86_DONE;
}

static int multiply_immediate(struct decoder *d, unsigned op)
{
    unsigned bytes = op == 0x69 ? immediate_size(d) : 1;
    word value;

    operands(d);
    settle_address(d, bytes);
    if (!in_window(d, d->size))
        return X86_FOREIGN;
    value = immediate(d, bytes);
    set(d, d->reg, alu_imul(get_rm(d, d->size), value, d->size, &d->flags), d->size);
    return X86_DONE;
}

/* test, xchg, mov with a register */
static int move(struct decoder *d, unsigned op)
{
    unsigned size = op & 1 ? d->size : 1;
    word value;

    operands(d);
    settle_address(d, 0);
    if (!in_window(d, size))
        return X86_FOREIGN;
    switch (op & ~1u) {
    case 0x84:
        alu_test(get_rm(d, size), get(d, d->reg, size), size, &d->flags);
        break;
    case 0x86:
        value = get_rm(d, size);
        set_rm(d, get(d, d->reg, size), size);
        set(d, d->reg, value, size);
        break;
    case 0x88:
        set_rm(d, get(d, d->reg, size), size);
        break;
    default:
        set(d, d->reg, get_rm(d, size), size);
    }
    return X86_DONE;
}

static int move_immediate(struct decoder *d, unsigned op)
{
    unsigned size = op & 1 ? d->size : 1, bytes = op & 1 ? immediate_size(d) : 1;

    operands(d);
    settle_address(d, bytes);
    if (!in_window(d, size))
        return X86_FOREIGN;
    if ((d->reg & 7) != 0)
        return X86_UNKNOWN;
    set_rm(d, immediate(d, bytes), size);
    return X86_DONE;
}

/* mov between the accumulator and an address that stands in the instruction */
static int move_absolute(struct decoder *d, unsigned op)
{
    unsigned size = op & 1 ? d->size : 1;
    word address = 0;

    memcpy(&address, d->next, d->address_size);
    d->next += d->address_size;
    if (!d->bus->covers(address, size))
        return X86_FOREIGN;
    if (op & 2)
        store(d, address, get(d, X86_AX, size), size);
    else
        set(d, X86_AX, load(d, address, size), size);
    return X86_DONE;
}

static int shift(struct decoder *d, unsigned op)
{
    unsigned size = op & 1 ? d->size : 1, bytes = op < 0xD0;
    word count, value;

    operands(d);
    settle_address(d, bytes);
    if (!in_window(d, size))
        return X86_FOREIGN;
    count = bytes ? *d->next++ : op < 0xD2 ? 1 : get(d, X86_CX, 4) & 0xFF;
    value = get_rm(d, size);
    set_rm(d, shift_group[d->reg & 7](value, count, size, &d->flags), size);
    return X86_DONE;
}

/* mul and imul of the accumulator by what was read */
static void multiply(struct decoder *d, word value, unsigned size, int with_sign)
{
    word low = get(d, X86_AX, size), high = 0;
    word bits = (d->flags & ARITHMETIC) | 0x202;

#define MULTIPLY(op, type)                                                                         \
    {                                                                                              \
        type factor = (type)value;                                                                 \
        __asm__ volatile("push %[f]\n\tpopf\n\t" op " %[v]\n\tpushf\n\tpop %[f]"                   \
                         : "+a"(low), "+d"(high), [f] "+r"(bits)                                   \
                         : [v] "q"(factor)                                                         \
                         : "cc", "memory");                                                        \
    }
#define EITHER(suffix, type)                                                                       \
    if (with_sign)                                                                                 \
        MULTIPLY("imul" suffix, type)                                                              \
    else                                                                                           \
        MULTIPLY("mul" suffix, type)

    switch (size) {
    case 1: EITHER("b", uint8_t) break;
    case 2: EITHER("w", uint16_t) break;
    case 4: EITHER("l", uint32_t) break;
#if X86_BITS == 64
    case 8: EITHER("q", uint64_t) break;
#endif
    }
    d->flags = (d->flags & ~(word)ARITHMETIC) | (bits & ARITHMETIC);
    if (size == 1) {
        set(d, X86_AX, low, 2);
    } else {
        set(d, X86_AX, low, size);
        set(d, X86_DX, high, size);
    }
}

static int unary(struct decoder *d, unsigned op)
{
    unsigned size = op & 1 ? d->size : 1, bytes;
    word value;

    operands(d);
    bytes = (d->reg & 7) > 1 ? 0 : op & 1 ? immediate_size(d) : 1;
    settle_address(d, bytes);
    if (!in_window(d, size))
        return X86_FOREIGN;
    switch (d->reg & 7) {
    case 2:
        set_rm(d, ~get_rm(d, size), size);
        return X86_DONE;
    case 3:
        set_rm(d, alu_neg(get_rm(d, size), 0, size, &d->flags), size);
        return X86_DONE;
    case 4:
    case 5:
        multiply(d, get_rm(d, size), size, (d->reg & 7) == 5);
        return X86_DONE;
    case 6: /* div and idiv may trap */
    case 7:
        return X86_UNKNOWN;
    default:
        value = immediate(d, bytes);
        alu_test(get_rm(d, size), value, size, &d->flags);
        return X86_DONE;
    }
}

static int increment(struct decoder *d, unsigned op)
{
    unsigned size = op & 1 ? d->size : 1, which;
    word value;

    operands(d);
    settle_address(d, 0);
    which = d->reg & 7;
    if (op == 0xFF && which == 6 && X86_BITS == 64 && size == 4)
        size = 8;
    if (!in_window(d, size))
        return X86_FOREIGN;
    if (which < 2) {
        set_rm(d, (which ? alu_dec : alu_inc)(get_rm(d, size), 0, size, &d->flags), size);
        return X86_DONE;
    }
    if (op != 0xFF || which != 6)
        return X86_UNKNOWN; /* calls and jumps through the window */
    value = get_rm(d, size);
    d->cpu->regs[X86_SP] -= size;
    store(d, d->cpu->regs[X86_SP], value, size);
    return X86_DONE;
}

static int pop(struct decoder *d)
{
    unsigned size = d->operand16 ? 2 : sizeof(word);
    word value = load(d, d->cpu->regs[X86_SP], size);

    d->cpu->regs[X86_SP] += size; /* an address that counts from SP counts from the new one */
    operands(d);
    settle_address(d, 0);
    if (!in_window(d, size)) {
        d->cpu->regs[X86_SP] -= size;
        return X86_FOREIGN;
    }
    store(d, d->address, value, size);
    return X86_DONE;
}

/* --- two-byte opcodes ------------------------------------------------------------------------- */

static int condition(word flags, unsigned code)
{
    int carry = (flags & CARRY) != 0, zero = (flags & ZERO) != 0;
    int sign = (flags >> 7 & 1) != 0, overflow = (flags >> 11 & 1) != 0, found;

    switch (code >> 1) {
    case 0: found = overflow; break;
    case 1: found = carry; break;
    case 2: found = zero; break;
    case 3: found = carry || zero; break;
    case 4: found = sign; break;
    case 5: found = (flags >> 2 & 1) != 0; break;
    case 6: found = sign != overflow; break;
    default: found = zero || sign != overflow;
    }
    return found != (int)(code & 1);
}

static int set_or_move_if(struct decoder *d, unsigned op)
{
    int yes = condition(d->flags, op & 15);
    unsigned size = op < 0x50 ? d->size : 1;

    operands(d);
    settle_address(d, 0);
    if (!in_window(d, size))
        return X86_FOREIGN;
    if (op < 0x50) {
        word value = get_rm(d, size); /* read in any case */

        set(d, d->reg, yes ? value : get(d, d->reg, size), size);
    } else {
        set_rm(d, (word)yes, 1);
    }
    return X86_DONE;
}

static int bit(struct decoder *d, unsigned op)
{
    int by_immediate = op == 0xBA;
    alu *action;
    word place, value, result;

    operands(d);
    settle_address(d, by_immediate ? 1 : 0);
    if (by_immediate) {
        place = *d->next++;
        if ((d->reg & 7) < 4)
            return X86_UNKNOWN;
        action = bit_group[d->reg & 3];
    } else {
        word offset = sign_extend(get(d, d->reg, d->size), d->size);
        intptr_t words = (intptr_t)offset >> (d->size == 2 ? 4 : d->size == 4 ? 5 : 6);

        place = offset;
        d->address = (d->address + (word)words * d->size) & MASK(d->address_size);
        action = bit_group[op >> 3 & 3];
    }
    if (!in_window(d, d->size))
        return X86_FOREIGN;
    place &= 8 * d->size - 1;
    value = get_rm(d, d->size);
    result = action(value, place, d->size, &d->flags);
    if (action != alu_bt)
        set_rm(d, result, d->size);
    return X86_DONE;
}

static int exchange(struct decoder *d, unsigned op)
{
    unsigned size = op & 1 ? d->size : 1;
    word value, other;

    operands(d);
    settle_address(d, 0);
    if (!in_window(d, size))
        return X86_FOREIGN;
    value = get_rm(d, size);
    if (op < 0xC0) { /* cmpxchg */
        alu_cmp(get(d, X86_AX, size), value, size, &d->flags);
        set_rm(d, d->flags & ZERO ? get(d, d->reg, size) : value, size);
        if (!(d->flags & ZERO))
            set(d, X86_AX, value, size);
    } else { /* xadd */
        other = alu_add(value, get(d, d->reg, size), size, &d->flags);
        set(d, d->reg, value, size);
        set_rm(d, other, size);
    }
    return X86_DONE;
}

static int extend(struct decoder *d, unsigned op)
{
    unsigned from = op & 1 ? 2 : 1;
    word value;

    operands(d);
    settle_address(d, 0);
    if (!in_window(d, from))
        return X86_FOREIGN;
    value = get_rm(d, from);
    set(d, d->reg, op & 8 ? sign_extend(value, from) : value, d->size);
    return X86_DONE;
}

/* imul, bsf, bsr, popcnt: a register and what was read */
static int combine(struct decoder *d, unsigned op)
{
    word value, flags = d->flags;

    operands(d);
    settle_address(d, 0);
    if (!in_window(d, d->size))
        return X86_FOREIGN;
    if (d->repeat)
        return X86_UNKNOWN; /* tzcnt, lzcnt, popcnt: not on every processor */
    value = get_rm(d, d->size);
    if (op == 0xAF) {
        set(d, d->reg, alu_imul(get(d, d->reg, d->size), value, d->size, &d->flags), d->size);
        return X86_DONE;
    }
    value = (op == 0xBC ? alu_bsf : alu_bsr)(get(d, d->reg, d->size), value, d->size, &flags);
    d->flags = flags;
    if (!(flags & ZERO))
        set(d, d->reg, value, d->size);
    return X86_DONE;
}

static int swap_move(struct decoder *d, unsigned op)
{
    unsigned turn, size = d->size;
    unsigned char bytes[8], turned[8];
    word value = 0;

    operands(d);
    settle_address(d, 0);
    if (!in_window(d, size) || d->repeat)
        return d->repeat ? X86_UNKNOWN : X86_FOREIGN;
    if (op == 0xF0) {
        load_bytes(d, d->address, bytes, size);
    } else {
        value = get(d, d->reg, size);
        memcpy(bytes, &value, size);
    }
    for (turn = 0; turn < size; turn++)
        turned[turn] = bytes[size - 1 - turn];
    if (op == 0xF0) {
        memcpy(&value, turned, size);
        set(d, d->reg, value, size);
    } else {
        store_bytes(d, d->address, turned, size);
    }
    return X86_DONE;
}

/* Moves between memory and an XMM register: what compilers and string functions use. */
static int xmm_move(struct decoder *d, unsigned op)
{
    unsigned size = 16, place = 0;
    int stores = 0, clears = 1;
    unsigned char *reg;

    operands(d);
    settle_address(d, 0);
    switch (op) {
    case 0x10: /* movups movupd movss movsd */
    case 0x11:
        size = d->repeat == 0xF3 ? 4 : d->repeat == 0xF2 ? 8 : 16;
        stores = op == 0x11;
        break;
    case 0x12: /* movlps movlpd */
    case 0x13:
    case 0x16: /* movhps movhpd */
    case 0x17:
        if (d->repeat)
            return X86_UNKNOWN;
        size = 8;
        place = op & 4 ? 8 : 0;
        clears = 0;
        stores = op & 1;
        break;
    case 0x28: /* movaps movapd */
    case 0x29:
    case 0x2B: /* movntps movntpd */
        stores = op != 0x28;
        break;
    case 0x6E: /* movd movq */
        if (!d->operand16)
            return X86_UNKNOWN;
        size = d->rex & REX_W ? 8 : 4;
        break;
    case 0x7E:
        if (d->repeat == 0xF3) {
            size = 8;
        } else if (d->operand16) {
            size = d->rex & REX_W ? 8 : 4;
            stores = 1;
        } else {
            return X86_UNKNOWN;
        }
        break;
    case 0x6F: /* movdqa movdqu */
    case 0x7F:
        if (!d->operand16 && d->repeat != 0xF3)
            return X86_UNKNOWN;
        stores = op == 0x7F;
        break;
    case 0xD6: /* movq */
        if (!d->operand16)
            return X86_UNKNOWN;
        size = 8;
        stores = 1;
        break;
    default: /* E7h: movntdq */
        if (!d->operand16)
            return X86_UNKNOWN;
        stores = 1;
    }
    if (!in_window(d, size))
        return X86_FOREIGN;
    if (d->cpu->xmm == NULL)
        return X86_UNKNOWN;
    reg = d->cpu->xmm[d->reg];
    if (stores) {
        store_bytes(d, d->address, reg + place, size);
    } else {
        load_bytes(d, d->address, reg + place, size);
        if (clears)
            memset(reg + size, 0, 16 - size);
    }
    return X86_DONE;
}

static int two_bytes(struct decoder *d)
{
    unsigned op = *d->next++;

    if ((op >= 0x40 && op < 0x50) || (op >= 0x90 && op < 0xA0))
        return set_or_move_if(d, op);
    switch (op) {
    case 0x10: case 0x11: case 0x12: case 0x13: case 0x16: case 0x17:
    case 0x28: case 0x29: case 0x2B: case 0x6E: case 0x6F: case 0x7E: case 0x7F:
    case 0xD6: case 0xE7:
        return xmm_move(d, op);
    case 0xA3: case 0xAB: case 0xB3: case 0xBB: case 0xBA:
        return bit(d, op);
    case 0xAF: case 0xBC: case 0xBD:
        return combine(d, op);
    case 0xB0: case 0xB1: case 0xC0: case 0xC1:
        return exchange(d, op);
    case 0xB6: case 0xB7: case 0xBE: case 0xBF:
        return extend(d, op);
    case 0xC3: /* movnti */
        return move(d, 0x89);
    case 0x38:
        op = *d->next++;
        return op == 0xF0 || op == 0xF1 ? swap_move(d, op) : X86_UNKNOWN;
    default:
        return X86_UNKNOWN;
    }
}

static int one_byte(struct decoder *d, unsigned op)
{
    if (op < 0x40 && (op & 7) < 4)
        return arithmetic(d, op);
    switch (op) {
    case 0x0F:
        return two_bytes(d);
#if X86_BITS == 64
    case 0x63: /* movslq */
        operands(d);
        settle_address(d, 0);
        if (!in_window(d, 4))
            return X86_FOREIGN;
        set(d, d->reg, sign_extend(get_rm(d, 4), 4), d->size);
        return X86_DONE;
#endif
    case 0x69: case 0x6B:
        return multiply_immediate(d, op);
    case 0x6C: case 0x6D: case 0x6E: case 0x6F:
    case 0xA4: case 0xA5: case 0xA6: case 0xA7:
    case 0xAA: case 0xAB: case 0xAC: case 0xAD: case 0xAE: case 0xAF:
        return string(d, op);
    case 0x80: case 0x81: case 0x83:
        return arithmetic_immediate(d, op);
    case 0x84: case 0x85: case 0x86: case 0x87: case 0x88: case 0x89: case 0x8A: case 0x8B:
        return move(d, op);
    case 0x8F:
        return pop(d);
    case 0xA0: case 0xA1: case 0xA2: case 0xA3:
        return move_absolute(d, op);
    case 0xC0: case 0xC1: case 0xD0: case 0xD1: case 0xD2: case 0xD3:
        return shift(d, op);
    case 0xC6: case 0xC7:
        return move_immediate(d, op);
    case 0xE4: case 0xE5: case 0xE6: case 0xE7:
    case 0xEC: case 0xED: case 0xEE: case 0xEF:
        return port(d, op);
    case 0xF6: case 0xF7:
        return unary(d, op);
    case 0xFA: /* cli and sti: there is nothing to keep out */
    case 0xFB:
        return d->bus->may(0, 0) ? X86_DONE : X86_FOREIGN;
    case 0xFE: case 0xFF:
        return increment(d, op);
    default:
        return X86_UNKNOWN;
    }
}

int x86_step(struct x86 *cpu, const struct x86_bus *bus)
{
    struct decoder d;
    unsigned turn, op = 0;
    int result;

    memset(&d, 0, sizeof d);
    d.cpu = cpu;
    d.bus = bus;
    d.next = (const unsigned char *)cpu->ip;
    d.flags = cpu->flags;
    d.address_size = sizeof(word);
    for (turn = 0; turn < 15; turn++) {
        op = *d.next++;
        if (op == 0x66)
            d.operand16 = 1;
        else if (op == 0xF2 || op == 0xF3)
            d.repeat = (int)op;
        else if (op == 0x64 || op == 0x65)
            d.segment = op;
        else if (op == 0x67 && X86_BITS == 64)
            d.address_size = 4;
        else if (op == 0x67)
            return X86_UNKNOWN;
        else if (op != 0xF0 && op != 0x2E && op != 0x36 && op != 0x3E && op != 0x26)
            break;
    }
    if (X86_BITS == 64 && (op & 0xF0) == 0x40) {
        d.rex = op;
        op = *d.next++;
    }
    d.size = d.rex & REX_W ? 8 : d.operand16 ? 2 : 4;
    if (d.segment && op != 0xE4 && op != 0xEC)
        return X86_UNKNOWN;
    result = one_byte(&d, op);
    if (result == X86_DONE) {
        cpu->ip = (word)d.next;
        cpu->flags = d.flags;
    }
    return result;
}
