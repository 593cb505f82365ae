/* x86_two.c - instructions whose first byte is 0Fh. License: Apache-2.0. */
#include "x86_alu.h"
#include "x86_decode.h"

int x86_condition(word flags, unsigned code)
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
    int yes = x86_condition(d->flags, op & 15);
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

/* cmpxchg8b and cmpxchg16b: what was read is written back where it differs */
static int exchange_wide(struct decoder *d)
{
    unsigned half = d->rex & REX_W ? 8 : 4;
    word low, high;

    operands(d);
    settle_address(d, 0);
    if (!in_window(d, 2 * half))
        return X86_FOREIGN;
    if ((d->reg & 7) != 1)
        return X86_UNKNOWN;
    low = load(d, d->address, half);
    high = load(d, d->address + half, half);
    if (low == get(d, X86_AX, half) && high == get(d, X86_DX, half)) {
        d->flags |= ZERO;
        store(d, d->address, get(d, X86_BX, half), half);
        store(d, d->address + half, get(d, X86_CX, half), half);
    } else {
        d->flags &= ~(word)ZERO;
        store(d, d->address, low, half);
        store(d, d->address + half, high, half);
        set(d, X86_AX, low, half);
        set(d, X86_DX, high, half);
    }
    return X86_DONE;
}

/* shld and shrd */
static int shift_in(struct decoder *d, unsigned op)
{
    unsigned by_immediate = !(op & 1);
    word count, value;

    operands(d);
    settle_address(d, by_immediate);
    if (!in_window(d, d->size))
        return X86_FOREIGN;
    count = by_immediate ? *d->next++ : get(d, X86_CX, 4) & 0xFF;
    value = (op & 8 ? alu_shrd : alu_shld)(get_rm(d, d->size), get(d, d->reg, d->size), count,
                                          d->size, &d->flags);
    set_rm(d, value, d->size);
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

/* imul, bsf, bsr, tzcnt, lzcnt, popcnt: a register and what was read */
static int combine(struct decoder *d, unsigned op)
{
    word value, flags = d->flags;

    operands(d);
    settle_address(d, 0);
    if (!in_window(d, d->size))
        return X86_FOREIGN;
    value = get_rm(d, d->size);
    if (d->repeat == 0xF3 && op != 0xAF) { /* a processor without it runs the other */
        value = (op == 0xB8 ? alu_popcnt : op == 0xBC ? alu_tzcnt : alu_lzcnt)(
            get(d, d->reg, d->size), value, d->size, &d->flags);
        set(d, d->reg, value, d->size);
        return X86_DONE;
    }
    if (op == 0xB8)
        return X86_UNKNOWN;
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

int x86_two_bytes(struct decoder *d)
{
    unsigned op = *d->next++;

    if ((op >= 0x40 && op < 0x50) || (op >= 0x90 && op < 0xA0))
        return set_or_move_if(d, op);
    switch (op) {
    case 0x10: case 0x11: case 0x12: case 0x13: case 0x16: case 0x17:
    case 0x28: case 0x29: case 0x2B: case 0x6E: case 0x6F: case 0x7E: case 0x7F:
    case 0xD6: case 0xE7: case 0xF0:
        return wide_vector(d, op);
    case 0xA3: case 0xAB: case 0xB3: case 0xBB: case 0xBA:
        return bit(d, op);
    case 0xA4: case 0xA5: case 0xAC: case 0xAD:
        return shift_in(d, op);
    case 0xAF: case 0xB8: case 0xBC: case 0xBD:
        return combine(d, op);
    case 0xB0: case 0xB1: case 0xC0: case 0xC1:
        return exchange(d, op);
    case 0xB6: case 0xB7: case 0xBE: case 0xBF:
        return extend(d, op);
    case 0xC3: /* movnti */
        operands(d);
        settle_address(d, 0);
        if (!in_window(d, d->size))
            return X86_FOREIGN;
        set_rm(d, get(d, d->reg, d->size), d->size);
        return X86_DONE;
    case 0xC7:
        return exchange_wide(d);
    case 0x38:
        op = *d->next++;
        if (op == 0x2A)
            return wide_vector(d, WIDE_MOVNTDQA);
        return op == 0xF0 || op == 0xF1 ? swap_move(d, op) : X86_UNKNOWN;
    default:
        return X86_UNKNOWN;
    }
}
